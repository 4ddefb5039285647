//! Broken robot descriptions end in an answer, never in a panic.

use armada_model::{Place, RobotModel};
use nalgebra::Isometry3;
use proptest::prelude::*;
use proptest::sample::Index;
use proptest::test_runner::RngSeed;

const ARM: &str = include_str!("../../../config/robots/six_axis_arm.urdf");

/// Texts that have broken parsers before.
const NASTY: [&str; 24] = [
    "",
    "NaN",
    "inf",
    "-1",
    "1e999",
    "1e308",
    "0 0 0",
    "<",
    ">",
    "/>",
    "\"",
    "&",
    "&#0;",
    "&amp;",
    "]]>",
    "<!--",
    "<![CDATA[",
    "\u{0}",
    "\u{FEFF}",
    "ü",
    "xmlns=\"a\"",
    "<joint",
    "<mimic joint=\"elbow_joint\"/>",
    "<link name=\"base_link\"/>",
];

#[derive(Clone, Debug)]
enum Edit {
    Remove(Index, usize),
    Insert(Index, &'static str),
    Copy(Index, Index, usize),
    /// Replaces the content of an attribute.
    Value(Index, &'static str),
    /// Replaces the content of an attribute by that of another.
    Swap(Index, Index),
}

fn edit() -> impl Strategy<Value = Edit> {
    let nasty = || prop::sample::select(NASTY.as_slice());
    prop_oneof![
        (any::<Index>(), 1..200_usize).prop_map(|(at, length)| Edit::Remove(at, length)),
        (any::<Index>(), nasty()).prop_map(|(at, text)| Edit::Insert(at, text)),
        (any::<Index>(), any::<Index>(), 1..300_usize)
            .prop_map(|(from, to, length)| Edit::Copy(from, to, length)),
        (any::<Index>(), nasty()).prop_map(|(at, text)| Edit::Value(at, text)),
        (any::<Index>(), any::<Index>()).prop_map(|(from, to)| Edit::Swap(from, to)),
    ]
}

fn apply(text: &mut Vec<char>, edit: &Edit) {
    let position = |index: &Index, text: &[char]| index.index(text.len() + 1);
    match edit {
        Edit::Remove(at, length) => {
            let start = position(at, text);
            let end = text.len().min(start + length);
            text.drain(start..end);
        }
        Edit::Insert(at, inserted) => {
            let start = position(at, text);
            text.splice(start..start, inserted.chars());
        }
        Edit::Copy(from, to, length) => {
            let start = position(from, text);
            let copy = text[start..text.len().min(start + length)].to_vec();
            let to = position(to, text);
            text.splice(to..to, copy);
        }
        Edit::Value(at, value) => {
            if let Some(range) = attribute(at, text) {
                text.splice(range, value.chars());
            }
        }
        Edit::Swap(from, to) => {
            if let (Some(from), Some(to)) = (attribute(from, text), attribute(to, text)) {
                let copy = text[from].to_vec();
                text.splice(to, copy);
            }
        }
    }
}

/// What stands between the quotes of some attribute.
fn attribute(index: &Index, text: &[char]) -> Option<std::ops::Range<usize>> {
    let starts: Vec<_> = text
        .windows(2)
        .enumerate()
        .filter(|(_, pair)| *pair == ['=', '"'])
        .map(|(at, _)| at + 2)
        .collect();
    let start = *starts.get(index.index(starts.len().max(1)))?;
    let end = start + text[start..].iter().position(|&character| character == '"')?;
    Some(start..end)
}

/// Loads and checks the text and uses what that gave.
fn exercise(text: &str) {
    let report = RobotModel::check_urdf(text, "mutated.urdf");
    let loaded = RobotModel::from_urdf(text, "mutated.urdf");
    assert_eq!(report.model.is_some(), loaded.is_ok(), "{:?}", report.problems);
    assert_eq!(report.problems.first(), loaded.as_ref().err());
    assert!(report.problems.iter().is_sorted_by_key(|problem| position(&problem.place)));
    assert!(report.warnings.iter().is_sorted_by_key(|warning| position(&warning.place)));
    assert!(report.problems.iter().all(|problem| !problem.remedy().is_empty()));
    let Ok(model) = loaded.inspect_err(|error| {
        assert!(error.place.line >= 1, "{error}");
        assert!(error.to_string().starts_with("mutated.urdf:"), "{error}");
    }) else {
        return;
    };
    let positions = vec![0.5; model.variable_count()];
    let mut poses = vec![Isometry3::identity(); model.links().len()];
    let all = model.link_poses(&positions, &mut poses);
    for link in 0..model.links().len() {
        assert!(model.link_pose(&positions, link).is_ok() || all.is_err(), "link {link}");
    }
}

const fn position(place: &Place) -> (u32, u32) {
    (place.line, place.column)
}

fn config(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(20_261_122);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config(2000))]

    #[test]
    fn a_damaged_robot_description_never_panics(edits in prop::collection::vec(edit(), 1..6)) {
        let mut text: Vec<char> = ARM.chars().collect();
        for edit in &edits {
            apply(&mut text, edit);
        }
        exercise(&text.into_iter().collect::<String>());
    }

    #[test]
    fn a_description_with_values_in_wrong_places_never_panics(
        swaps in prop::collection::vec((any::<Index>(), any::<Index>()), 1..4)
    ) {
        let mut text: Vec<char> = ARM.chars().collect();
        for (from, to) in swaps {
            apply(&mut text, &Edit::Swap(from, to));
        }
        exercise(&text.into_iter().collect::<String>());
    }

    #[test]
    fn any_text_never_panics(text in "\\PC{0,200}") {
        exercise(&text);
    }
}
