//! The search of references.

use super::super::HomingConfig;
use super::*;
use crate::drivers::JointSet;

fn unhomed() -> EmulatorConfig {
    let homing = HomingConfig { required: true, offset_rad: 0.01, ..HomingConfig::default() };
    EmulatorConfig { homing, ..quiet() }
}

const BOTH: JointSet = JointSet::first(2);
const TURN: JointSet = JointSet::first(1);

#[test]
fn a_robot_that_needs_no_homing_is_homed_and_does_not_offer_it() {
    let mut pair = Pair::enabled(quiet());
    assert_eq!(pair.feedback().homed, BOTH);
    assert!(!pair.driver.abilities().homing);
    pair.request(DriverRequest::Home(BOTH));
    pair.run(0.5);
    assert_eq!((pair.feedback().homed, pair.position()), (BOTH, 0.0));
}

#[test]
fn homing_moves_slowly_to_the_next_mark_and_takes_the_offset_away() {
    let mut pair = Pair::enabled(unhomed());
    assert_eq!(pair.feedback().homed, JointSet::NONE);
    assert!(pair.driver.abilities().homing);
    assert_eq!(pair.position(), 0.01, "the encoder is off");
    pair.request(DriverRequest::Home(BOTH));
    pair.until("homing", 0.1, |feedback| feedback.homing == BOTH);
    let mut fastest: f64 = 0.0;
    while pair.feedback().homed != BOTH {
        pair.tick();
        fastest = fastest.max(pair.feedback().joint_velocity[0]);
        assert!(pair.feedback().ready, "{:?}", pair.feedback());
    }
    assert!((0.15..=0.1 * SPEED_LIMIT * 1.001).contains(&fastest), "{fastest} rad/s");
    assert!(pair.feedback().homing.is_empty());
    let reached = pair.feedback().joint_position;
    assert!(reached.max_abs_difference(&vector([0.2, 0.02])) < 1e-4, "{reached:?}");
}

#[test]
fn one_joint_is_homed_while_the_other_stands_still() {
    let mut pair = Pair::enabled(unhomed());
    pair.request(DriverRequest::Home(TURN));
    let took = pair.until("homed", 5.0, |feedback| feedback.homed == TURN);
    assert!(took > 0.5, "after {took} s");
    assert!((pair.feedback().joint_position[1] - 0.0005).abs() < 1e-9);
}

#[test]
fn set_points_move_a_robot_that_is_not_homed_but_not_one_that_homes() {
    let mut pair = Pair::enabled(unhomed());
    pair.command(1.0, |t| {
        let (s, v) = blend(0.5, t);
        [(0.01 + 0.05 * s, 0.05 * v), (0.0005, 0.0)]
    });
    assert!((pair.position() - 0.06).abs() < 1e-6, "{}", pair.position());
    pair.request(DriverRequest::Home(TURN));
    pair.command(3.0, |_| [(0.06, 0.0), (0.0005, 0.0)]);
    assert_eq!(pair.feedback().homed, TURN);
}

#[test]
fn a_stop_ends_homing_and_leaves_the_joint_without_reference() {
    let mut pair = Pair::enabled(unhomed());
    pair.request(DriverRequest::Home(BOTH));
    pair.until("homing", 0.1, |feedback| feedback.homing == BOTH);
    pair.run(0.3);
    pair.request(DriverRequest::StopMotion);
    pair.run(0.5);
    assert_eq!((pair.feedback().homing, pair.feedback().homed), (JointSet::NONE, JointSet::NONE));
    assert!(pair.feedback().ready);
    let rest = pair.position();
    pair.run(0.5);
    assert_eq!(pair.position(), rest);
    pair.request(DriverRequest::Home(BOTH));
    pair.until("homed", 5.0, |feedback| feedback.homed == BOTH);
}

#[test]
fn homing_that_fails_is_an_error_and_can_be_repeated_when_repaired() {
    let mut pair = Pair::enabled(unhomed());
    pair.request(DriverRequest::Home(BOTH));
    pair.until("homing", 0.1, |feedback| feedback.homing == BOTH);
    assert!(pair.inject("homing_failure"));
    pair.run(0.05);
    assert_eq!(pair.feedback().error_code, error_code::HOMING);
    assert!(!pair.feedback().enabled && pair.feedback().homing.is_empty());
    assert_eq!(pair.feedback().homed, JointSet::NONE);
    assert!(pair.inject("homing_repair"));
    pair.request(DriverRequest::ResetErrors);
    pair.enable();
    pair.request(DriverRequest::Home(BOTH));
    pair.until("homed", 5.0, |feedback| feedback.homed == BOTH);
}

#[test]
fn homing_goes_on_through_a_bad_network_and_is_done_once() {
    let mut pair =
        Pair::in_weather(unhomed(), Weather { loss: 0.3, hold_up: 3, twice: 0.3 });
    pair.enable();
    pair.request(DriverRequest::Home(BOTH));
    pair.until("homed", 5.0, |feedback| feedback.homed == BOTH);
    pair.run(2.0);
    assert!((pair.position() - 0.2).abs() < 1e-4, "a second search would have gone on to 0.4");
}

#[test]
fn homing_stops_when_the_client_dies_and_a_new_one_may_begin_it_again() {
    let mut pair = Pair::enabled(unhomed());
    pair.request(DriverRequest::Home(BOTH));
    pair.until("homing", 0.1, |feedback| feedback.homing == BOTH);
    pair.driver = config(unhomed()).driver(&setup(12)).expect("driver");
    pair.peer = address(50_002);
    pair.until("status", 2.0, |_| true);
    pair.run(0.2);
    assert_eq!((pair.feedback().homing, pair.feedback().homed), (JointSet::NONE, JointSet::NONE));
    pair.request(DriverRequest::Home(BOTH));
    pair.until("homed", 5.0, |feedback| feedback.homed == BOTH);
}

#[test]
fn a_controller_that_restarts_while_homing_is_not_homed_and_does_not_go_on() {
    let mut pair = Pair::enabled(unhomed());
    pair.request(DriverRequest::Home(BOTH));
    pair.until("homing", 0.1, |feedback| feedback.homing == BOTH);
    pair.emulator = config(unhomed()).emulator(&setup(33)).expect("emulator");
    pair.run(0.5);
    assert_eq!((pair.feedback().homing, pair.feedback().homed), (JointSet::NONE, JointSet::NONE));
    assert!(!pair.feedback().enabled);
}
