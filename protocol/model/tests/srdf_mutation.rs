//! Broken SRDFs end in an answer, never in a panic.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use std::sync::LazyLock;

use armada_model::{RobotModel, Srdf};
use proptest::prelude::*;
use proptest::sample::Index;
use proptest::test_runner::RngSeed;

/// Uses every element of the format, on our six-axis arm.
const TEXT: &str = r#"<?xml version="1.0"?>
<robot name="six_axis_arm">
  <virtual_joint name="fixed_base" type="fixed" parent_frame="world" child_link="base_link"/>
  <passive_joint name="fixed_base"/>
  <group name="upper"><joint name="shoulder_pan_joint"/><joint name="shoulder_lift_joint"/></group>
  <group name="arm"><chain base_link="base_link" tip_link="tool0"/></group>
  <group name="wrist"><link name="wrist_1_link"/><link name="wrist_2_link"/></group>
  <group name="all"><group name="upper"/><group name="wrist"/></group>
  <group_state name="home" group="upper">
    <joint name="shoulder_pan_joint" value="0.5"/><joint name="shoulder_lift_joint" value="-1"/>
  </group_state>
  <end_effector name="hand" parent_link="tool0" group="wrist" parent_group="arm"/>
  <disable_default_collisions link="tool0"/>
  <enable_collisions link1="tool0" link2="base_link"/>
  <disable_collisions link1="base_link" link2="shoulder_link" reason="Adjacent"/>
  <link_sphere_approximation link="tool0"><sphere center="0 0 0" radius="0.1"/>
  </link_sphere_approximation>
</robot>"#;

/// Texts that have broken parsers before.
const NASTY: [&str; 18] = [
    "",
    "NaN",
    "inf",
    "-1",
    "1e999",
    "<",
    ">",
    "/>",
    "\"",
    "&",
    "&#0;",
    "<!--",
    "\u{0}",
    "ü",
    "arm",
    "all",
    "base_link",
    "<group name=\"all\"><group name=\"all\"/></group>",
];

static MODEL: LazyLock<RobotModel> = LazyLock::new(|| common::own_robot("six_axis_arm.urdf"));

fn config(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(20_261_122);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

/// Reads the text and follows every index it gave.
fn exercise(model: &RobotModel, text: &str) {
    let Ok((srdf, problems)) = Srdf::read(text, "m.srdf", model) else { return };
    for problem in problems {
        assert!(problem.to_string().starts_with("m.srdf:") && problem.place.line >= 1, "{problem}");
    }
    let links = srdf.groups.iter().flat_map(|group| &group.links);
    assert!(links.chain(&srdf.unchecked_links).all(|&link| link < model.links().len()));
    let joints = srdf.groups.iter().flat_map(|group| &group.joints);
    assert!(joints.chain(&srdf.passive_joints).all(|&joint| joint < model.joints().len()));
    for state in &srdf.states {
        assert!(state.group < srdf.groups.len());
        assert!(state.positions.iter().all(|&(v, x)| v < model.variable_count() && x.is_finite()));
    }
    for end_effector in &srdf.end_effectors {
        assert!(end_effector.group < srdf.groups.len());
    }
    for pair in &srdf.disabled_pairs {
        assert!(pair.links[0] < pair.links[1] && pair.links[1] < model.links().len());
    }
}

/// Where the values of attributes stand.
fn values(text: &str) -> Vec<std::ops::Range<usize>> {
    let starts = text.match_indices("=\"").map(|(at, _)| at + 2);
    starts.filter_map(|start| Some(start..start + text[start..].find('"')?)).collect()
}

#[test]
fn the_text_before_mutation_is_clean() {
    let (srdf, problems) = Srdf::read(TEXT, "m.srdf", &MODEL).expect("an SRDF");
    assert_eq!(problems, []);
    assert_eq!((srdf.groups.len(), srdf.states.len(), srdf.end_effectors.len()), (4, 1, 1));
}

proptest! {
    #![proptest_config(config(1500))]

    #[test]
    fn a_damaged_srdf_never_panics(
        edits in prop::collection::vec(
            (any::<Index>(), 0..60_usize, prop::sample::select(NASTY.as_slice())), 1..5)
    ) {
        let mut text: Vec<char> = TEXT.chars().collect();
        for (at, length, nasty) in edits {
            let start = at.index(text.len() + 1);
            let end = text.len().min(start + length);
            text.splice(start..end, nasty.chars());
        }
        exercise(&MODEL, &text.into_iter().collect::<String>());
    }

    #[test]
    fn values_in_wrong_places_never_panic(
        edits in prop::collection::vec(
            (any::<Index>(), any::<Index>(), prop::option::of(prop::sample::select(NASTY.as_slice()))),
            1..5)
    ) {
        let mut text = TEXT.to_owned();
        for (from, to, nasty) in edits {
            let ranges = values(&text);
            let value = text[ranges[from.index(ranges.len())].clone()].to_owned();
            let value = nasty.filter(|nasty| !nasty.contains('"')).unwrap_or(&value);
            text.replace_range(ranges[to.index(ranges.len())].clone(), value);
        }
        exercise(&MODEL, &text);
    }
}
