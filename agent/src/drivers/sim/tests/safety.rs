//! Key switch, buttons, guards, enabling switch, fatal error.

use armada_protocol::messages::{OperationalMode, RobotFlags};

use super::super::GuardStop;
use super::*;

#[test]
fn the_key_switch_is_reported_and_can_be_turned() {
    let mut pair = Pair::enabled(quiet());
    assert_eq!(pair.feedback().operational_mode, OperationalMode::Cobot);
    for (text, mode) in [
        ("key_switch=auto", OperationalMode::Auto),
        ("key_switch=manual_reduced_speed", OperationalMode::ManualReducedSpeed),
        ("key_switch=manual_full_speed", OperationalMode::ManualFullSpeed),
    ] {
        assert!(pair.inject(text));
        pair.run(0.01);
        assert_eq!(pair.feedback().operational_mode, mode);
        assert!(pair.feedback().ready, "without an enabling switch drives stay on");
    }
}

#[test]
fn an_emergency_stop_shows_its_source_and_then_that_it_is_released() {
    let mut pair = Pair::enabled(quiet());
    for (text, flag) in [
        ("estop_button=1", RobotFlags::ESTOP_BUTTON1),
        ("estop_button=4", RobotFlags::ESTOP_BUTTON4),
        ("estop_fault", RobotFlags::ESTOP_FAULT),
        ("estop_other", RobotFlags::ESTOP_OTHER),
        ("estop", RobotFlags::NONE),
    ] {
        assert!(pair.inject(text));
        pair.run(0.01);
        assert!(pair.feedback().emergency_stop && !pair.feedback().enabled, "{text}");
        assert_eq!(pair.feedback().conditions, flag, "{text}");
        assert!(pair.inject("estop_release"));
        pair.run(0.01);
        assert!(!pair.feedback().emergency_stop);
        assert_eq!(pair.feedback().conditions, RobotFlags::ESTOP_RELEASED, "{text}");
        pair.request(DriverRequest::ResetErrors);
        pair.run(0.05);
        assert_eq!(pair.feedback().conditions, RobotFlags::NONE, "{text}");
    }
}

#[test]
fn an_open_guard_stops_the_robot_until_it_is_closed_and_reset() {
    let mut pair = Pair::enabled(quiet());
    pair.accelerate_to(0.5);
    assert!(pair.inject("guard_open=2"));
    pair.run(0.5);
    assert!(pair.feedback().enabled && !pair.feedback().ready && pair.feedback().guard_stop);
    assert_eq!(pair.feedback().error_code, 0, "a stop by a guard is no error");
    assert_eq!(pair.feedback().conditions, RobotFlags::ESTOP_GUARD2);
    let rest = pair.position();
    // 0.5 rad/s at 1.2 times 5 rad/s² takes 0.021 rad, after 0.075 rad and the lag.
    assert!((0.09..0.2).contains(&rest), "stopped at {rest}");
    pair.command(0.1, |_| [(0.0, 0.0), (0.0, 0.0)]);
    assert_eq!(pair.position(), rest, "set-points are not taken");
    pair.request(DriverRequest::ResetErrors);
    pair.run(0.05);
    assert!(pair.feedback().guard_stop, "still open");
    assert!(pair.inject("guard_close=2"));
    pair.run(0.05);
    assert!(pair.feedback().guard_stop && !pair.feedback().ready, "not reset");
    assert_eq!(pair.feedback().conditions, RobotFlags::NONE);
    pair.request(DriverRequest::ResetErrors);
    pair.run(0.05);
    assert!(!pair.feedback().guard_stop && pair.feedback().ready);
}

#[test]
fn a_guard_may_switch_the_drives_off() {
    let mut pair =
        Pair::enabled(EmulatorConfig { guard_stop: GuardStop::DrivesOff, ..quiet() });
    assert!(pair.inject("guard_open=1"));
    pair.request(DriverRequest::Enable);
    pair.run(0.5);
    assert!(!pair.feedback().enabled && pair.feedback().guard_stop);
    assert!(pair.inject("guard_close=1"));
    pair.request(DriverRequest::ResetErrors);
    pair.enable();
}

#[test]
fn drives_need_the_enabling_switch_in_manual_modes_only() {
    let mut pair = Pair::enabled(EmulatorConfig { enabling_switch_required: true, ..quiet() });
    assert!(pair.inject("key_switch=manual_full_speed"));
    pair.run(0.05);
    assert!(!pair.feedback().enabled, "off when the key is turned");
    pair.request(DriverRequest::Enable);
    pair.run(0.5);
    assert!(!pair.feedback().enabled);
    assert!(pair.inject("enabling_hold"));
    pair.enable();
    assert_eq!(pair.feedback().conditions, RobotFlags::ENABLING_SWITCH);
    assert!(pair.inject("enabling_release"));
    pair.run(0.05);
    assert!(!pair.feedback().enabled);
    assert!(pair.inject("key_switch=auto"));
    pair.enable();
}

#[test]
fn a_fatal_error_outlives_every_reset_until_its_cause_is_gone() {
    let mut pair = Pair::enabled(quiet());
    assert!(pair.inject("fatal_error=77"));
    pair.request(DriverRequest::ResetErrors);
    pair.request(DriverRequest::Enable);
    pair.run(0.5);
    assert_eq!((pair.feedback().error_code, pair.feedback().enabled), (77, false));
    assert_eq!(pair.feedback().conditions, RobotFlags::FATAL_ERROR);
    assert!(pair.inject("fatal_clear"));
    pair.run(0.05);
    assert_eq!(pair.feedback().error_code, 77, "the error itself is still to be reset");
    assert_eq!(pair.feedback().conditions, RobotFlags::NONE);
    pair.request(DriverRequest::ResetErrors);
    pair.enable();
    assert_eq!(pair.feedback().error_code, 0);
}

#[test]
fn the_pendant_stops_the_robot_and_keeps_others_out_until_it_gives_control_back() {
    let mut pair = Pair::enabled(quiet());
    pair.accelerate_to(0.5);
    assert!(pair.inject("local_on"));
    pair.run(0.5);
    assert!(pair.feedback().local_control && pair.feedback().enabled && !pair.feedback().ready);
    assert!(!pair.feedback().guard_stop && !pair.feedback().emergency_stop);
    assert_eq!(pair.feedback().error_code, 0, "no error and no stop");
    let rest = pair.position();
    pair.command(0.1, |_| [(0.0, 0.0), (0.0, 0.0)]);
    assert_eq!(pair.position(), rest, "set-points are not taken");
    pair.request(DriverRequest::Disable);
    pair.run(0.5);
    pair.request(DriverRequest::Enable);
    pair.run(0.5);
    assert!(!pair.feedback().enabled, "off goes always, on does not");
    assert!(pair.inject("local_off"));
    pair.enable();
    assert!(!pair.feedback().local_control && pair.feedback().ready);
}

#[test]
fn the_pendant_may_have_control_from_the_start() {
    let mut pair = Pair::new(EmulatorConfig { local_control: true, ..quiet() });
    pair.run(0.1);
    assert!(pair.feedback().local_control && !pair.feedback().enabled);
}
