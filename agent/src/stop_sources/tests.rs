use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::*;

const DOOR: &str = "door_1";

fn at(ms: u64) -> MonoTime {
    MonoTime::from_nanos(1_000_000_000 + ms * 1_000_000)
}

fn sources(key: Option<&str>) -> StopSources {
    let key = key.map(|key| SigningKey::from_bytes(key.as_bytes()).expect("a key"));
    let setting = StopSourceSetting { name: DOOR.to_owned(), level: StopLevel::L1, key };
    StopSources::new("left_arm".parse().expect("a name"), vec![setting], at(0))
}

fn answer(nonce: u128, pressed: bool) -> StopCheckIn {
    let nonce = Uuid::from_u128(nonce);
    StopCheckIn { source: DOOR.to_owned(), nonce, pressed, signature: None }
}

/// Asks at `ms`, and is answered `released` at the same instant.
fn release(sources: &mut StopSources, nonce: u128, ms: u64) {
    sources.note_challenge(DOOR, Uuid::from_u128(nonce), at(ms));
    assert_eq!(sources.handle_check_in(&answer(nonce, false), at(ms)), Ok(None));
}

fn cause(sources: &mut StopSources, ms: u64) -> Option<PressCause> {
    sources.poll_silence(at(ms)).map(|press| press.cause)
}

#[test]
fn a_source_that_is_never_heard_is_pressed_after_half_a_second_and_once() {
    let mut sources = sources(None);
    assert_eq!(cause(&mut sources, 500), None);
    assert!(sources.check_released(at(500)).is_err(), "nothing is known of it yet");
    assert_eq!(cause(&mut sources, 501), Some(PressCause::NeverHeard));
    assert_eq!(cause(&mut sources, 5_000), None, "one press, one stop");
    let [status] = sources.status(at(600)).try_into().expect("one source");
    assert_eq!((status.source.as_str(), status.pressed, status.age_ms), (DOOR, true, None));
}

#[test]
fn a_source_that_answers_is_released_and_its_silence_is_a_press() {
    let mut sources = sources(None);
    release(&mut sources, 1, 100);
    assert_eq!(sources.check_released(at(600)), Ok(()));
    assert_eq!(cause(&mut sources, 600), None);
    let silent = sources.check_released(at(601)).expect_err("it was heard too long ago");
    assert_eq!(silent.to_string(), "stop source door_1 is silent for more than 500 ms");
    assert_eq!(cause(&mut sources, 601), Some(PressCause::Silent));
    assert_eq!(cause(&mut sources, 700), None);
    release(&mut sources, 2, 800);
    assert_eq!(cause(&mut sources, 1_301), Some(PressCause::Silent), "a new silence");
}

#[test]
fn a_press_is_one_stop_however_often_it_is_told() {
    let mut sources = sources(None);
    release(&mut sources, 1, 0);
    let press = sources.handle_check_in(&answer(2, true), at(50)).expect("taken");
    let press = press.expect("a press");
    assert_eq!((press.level, press.cause), (StopLevel::L1, PressCause::Pressed));
    for ms in [60, 160, 260] {
        assert_eq!(sources.handle_check_in(&answer(3, true), at(ms)), Ok(None));
    }
    assert_eq!(cause(&mut sources, 2_000), None, "silence after a press is the same press");
    release(&mut sources, 4, 2_100);
    let again = sources.handle_check_in(&answer(5, true), at(2_200)).expect("taken");
    assert!(again.is_some(), "released in between: another press");
}

#[test]
fn a_press_needs_no_proof_and_a_release_does() {
    let mut sources = sources(Some("secret"));
    sources.note_challenge(DOOR, Uuid::from_u128(1), at(0));
    let key = SigningKey::from_bytes(b"secret").expect("a key");
    let challenge = armada_protocol::messages::StopChallenge {
        robot: "left_arm".parse().expect("a name"),
        nonce: Uuid::from_u128(1),
    };
    assert_eq!(
        sources.handle_check_in(&answer(1, false), at(1)),
        Err(CheckInError::Signature),
        "not signed"
    );
    let signed = key.sign_check_in(&challenge, answer(1, false));
    assert_eq!(sources.handle_check_in(&signed, at(2)), Ok(None));
    assert_eq!(sources.check_released(at(2)), Ok(()));
    assert_eq!(sources.handle_check_in(&signed, at(3)), Err(CheckInError::Nonce), "repeated");
    let forged = answer(99, true);
    assert!(sources.handle_check_in(&forged, at(4)).expect("taken").is_some());
    let stranger = StopCheckIn { source: "door_2".to_owned(), ..answer(1, true) };
    assert_eq!(sources.handle_check_in(&stranger, at(5)), Err(CheckInError::UnknownSource));
}

#[test]
fn what_was_asked_before_a_press_does_not_release() {
    let mut sources = sources(None);
    sources.note_challenge(DOOR, Uuid::from_u128(1), at(0));
    sources.note_challenge(DOOR, Uuid::from_u128(2), at(100));
    assert!(sources.handle_check_in(&answer(2, true), at(110)).expect("taken").is_some());
    let late = sources.handle_check_in(&answer(1, false), at(120));
    assert_eq!(late, Err(CheckInError::Nonce), "read before the press");
    assert!(sources.check_released(at(120)).is_err());
}

/// What the network does with one challenge and its answer.
#[derive(Clone, Copy, Debug)]
struct Fate {
    lost: bool,
    there_ms: u64,
    back_ms: u64,
    /// The answer comes a second time, so much later.
    again_ms: Option<u64>,
}

fn fate(worst_ms: u64, losses: bool) -> impl Strategy<Value = Fate> {
    let delay = 0..worst_ms;
    let again = prop::option::weighted(0.2, 1..900_u64);
    (prop::bool::weighted(if losses { 0.4 } else { 0.0 }), delay.clone(), delay, again)
        .prop_map(|(lost, there_ms, back_ms, again_ms)| Fate { lost, there_ms, back_ms, again_ms })
}

/// A button that changes at these times, beginning released.
fn is_pressed(changes: &[u64], ms: u64) -> bool {
    changes.iter().filter(|&&change| change <= ms).count() % 2 == 1
}

/// Runs the machine against a button behind a network, a millisecond at a time; returns the
/// presses with their times, and for each millisecond whether the source was known released; the
/// times of the releases that were taken go into `releases`.
fn run_noting(
    changes: &[u64],
    fates: &[Fate],
    releases: &mut Vec<u64>,
) -> (Vec<(u64, Press)>, Vec<bool>) {
    let mut machine = sources(None);
    let mut arriving: Vec<(u64, StopCheckIn)> = Vec::new();
    let (mut presses, mut released) = (Vec::new(), Vec::new());
    for ms in 0..(fates.len() as u64 + 6) * 100 {
        let turn = usize::try_from(ms / 100).expect("small");
        if ms % 100 == 0
            && let Some(fate) = fates.get(turn)
        {
            let nonce = turn as u128 + 1;
            machine.note_challenge(DOOR, Uuid::from_u128(nonce), at(ms));
            let read = ms + fate.there_ms;
            let check_in = answer(nonce, is_pressed(changes, read));
            let arrival = read + fate.back_ms;
            if !fate.lost {
                arriving.push((arrival, check_in.clone()));
                arriving.extend(fate.again_ms.map(|later| (arrival + later, check_in)));
            }
        }
        for (_, check_in) in arriving.iter().filter(|(arrival, _)| *arrival == ms) {
            match machine.handle_check_in(check_in, at(ms)) {
                Ok(Some(press)) => presses.push((ms, press)),
                Ok(None) if !check_in.pressed => releases.push(ms),
                _ => {}
            }
        }
        while let Some(press) = machine.poll_silence(at(ms)) {
            presses.push((ms, press));
        }
        released.push(machine.check_released(at(ms)).is_ok());
    }
    (presses, released)
}

fn run(changes: &[u64], fates: &[Fate]) -> (Vec<(u64, Press)>, Vec<bool>) {
    run_noting(changes, fates, &mut Vec::new())
}

proptest! {
    #![proptest_config(ProptestConfig {
        rng_seed: RngSeed::Fixed(10),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_source_known_released_was_so_within_half_a_second_whatever_the_network_does(
        changes in prop::collection::vec(0..4_000_u64, 0..6),
        fates in prop::collection::vec(fate(700, true), 40),
    ) {
        let mut changes = changes;
        changes.sort_unstable();
        let (_, released) = run(&changes, &fates);
        for (ms, _) in released.iter().enumerate().filter(|(_, released)| **released) {
            let ms = ms as u64;
            let was = (ms.saturating_sub(500)..=ms).any(|then| !is_pressed(&changes, then));
            prop_assert!(was, "at {ms} ms it had been pressed for half a second: {changes:?}");
        }
    }

    #[test]
    fn a_press_that_stays_is_a_stop_within_half_a_second_and_only_one(
        pressed_at in 0..3_000_u64,
        fates in prop::collection::vec(fate(700, true), 40),
    ) {
        let (presses, released) = run(&[pressed_at], &fates);
        let stops = |from: u64, to: u64| {
            presses.iter().filter(|(ms, _)| (from..=to).contains(ms)).count()
        };
        let after = usize::try_from(pressed_at).expect("small") + 501;
        prop_assert!(released[after..].iter().all(|released| !released));
        prop_assert!(stops(0, pressed_at + 501) >= 1, "{presses:?}");
        prop_assert_eq!(stops(pressed_at + 502, u64::MAX), 0);
    }

    #[test]
    fn a_released_source_on_a_fair_network_never_stops_anything(
        fates in prop::collection::vec(fate(190, false), 40),
    ) {
        let (presses, _) = run(&[], &fates);
        let while_asked = presses.iter().filter(|(ms, _)| *ms < 4_000).count();
        prop_assert_eq!(while_asked, 0, "{:?}", presses);
    }

    #[test]
    fn two_stops_of_a_source_have_a_release_between_them(
        changes in prop::collection::vec(0..4_000_u64, 0..6),
        fates in prop::collection::vec(fate(700, true), 40),
    ) {
        let mut changes = changes;
        changes.sort_unstable();
        let mut releases = Vec::new();
        let (presses, _) = run_noting(&changes, &fates, &mut releases);
        for pair in presses.windows(2) {
            let between = pair[0].0..=pair[1].0;
            prop_assert!(releases.iter().any(|release| between.contains(release)), "{presses:?}");
        }
    }
}
