//! Every fault that can be injected, as the driver sees it.

use super::*;

#[test]
fn the_emergency_stop_takes_the_drives_until_it_is_released_and_enabled_again() {
    let mut pair = Pair::enabled(quiet());
    assert!(pair.inject("estop"));
    pair.run(0.01);
    assert!(pair.feedback().emergency_stop && !pair.feedback().enabled && !pair.feedback().ready);
    pair.driver.request(pair.now, DriverRequest::ResetErrors);
    pair.driver.request(pair.now, DriverRequest::Enable);
    pair.run(0.5);
    assert!(pair.feedback().emergency_stop, "no request releases it");
    assert!(!pair.feedback().enabled, "nothing switches on while it is pressed");
    assert!(pair.inject("estop_release"));
    pair.run(0.5);
    assert!(!pair.feedback().emergency_stop && !pair.feedback().enabled);
    pair.enable();
}

#[test]
fn an_error_of_the_controller_stays_until_it_is_reset_and_the_first_one_is_shown() {
    let mut pair = Pair::enabled(quiet());
    assert!(pair.inject("error=17"));
    assert!(pair.inject("error=18"));
    pair.run(0.01);
    assert_eq!(pair.feedback().error_code, 17);
    assert!(!pair.feedback().enabled && !pair.feedback().ready);
    pair.driver.request(pair.now, DriverRequest::Enable);
    pair.run(0.5);
    assert!(!pair.feedback().enabled, "no enabling with an error");
    pair.driver.request(pair.now, DriverRequest::ResetErrors);
    pair.run(0.5);
    assert_eq!(pair.feedback().error_code, 0);
    assert!(!pair.feedback().enabled, "a reset never enables");
}

#[test]
fn reset_and_enable_asked_for_together_do_both() {
    let mut pair = Pair::enabled(quiet());
    pair.inject("error=17");
    pair.run(0.01);
    pair.driver.request(pair.now, DriverRequest::Enable);
    pair.driver.request(pair.now, DriverRequest::ResetErrors);
    pair.until("enabled", 1.0, |feedback| feedback.enabled && feedback.error_code == 0);
}

#[test]
fn silence_stops_the_reports_for_its_time_and_a_move_with_an_error() {
    let mut pair = Pair::enabled(quiet());
    pair.accelerate_to(0.5);
    assert!(pair.inject("silence_ms=300"));
    let before = pair.feedback().stamp;
    pair.run(0.298);
    assert_eq!(pair.feedback().stamp, before);
    pair.run(0.02);
    assert!(pair.feedback().stamp > before);
    assert_eq!(pair.feedback().error_code, error_code::WATCHDOG);
}

#[test]
fn frozen_measurements_stand_still_while_the_robot_goes_on() {
    let mut pair = Pair::enabled(EmulatorConfig::default());
    pair.command(0.1, |_| [(0.0, 0.0), (0.0, 0.0)]);
    assert!(pair.inject("freeze"));
    pair.tick();
    let frozen = *pair.feedback();
    pair.command(0.3, |t| [(0.3 * t, 0.3), (0.0, 0.0)]);
    assert_eq!(pair.feedback().joint_position, frozen.joint_position, "even the noise is frozen");
    assert!(pair.feedback().stamp > frozen.stamp, "reports still come");
    assert!(pair.inject("unfreeze"));
    pair.tick();
    assert!(pair.position() > 0.05);
}

#[test]
fn drives_that_go_off_show_no_error() {
    let mut pair = Pair::enabled(quiet());
    assert!(pair.inject("drives_off"));
    pair.run(0.01);
    assert!(!pair.feedback().enabled && !pair.feedback().ready);
    assert_eq!(pair.feedback().error_code, 0);
    pair.enable();
}

#[test]
fn a_blocked_joint_stands_still_until_the_controller_sees_the_following_error() {
    let config = EmulatorConfig { following_error_rad: 0.2, ..quiet() };
    let mut pair = Pair::enabled(config);
    assert!(pair.inject("block_joint=0"));
    pair.command(0.3, |t| [(0.5 * t, 0.5), (0.02 * t, 0.02)]);
    assert_eq!(pair.position(), 0.0);
    assert!(pair.feedback().joint_position[1] > 0.005, "the other joint moves");
    assert!(pair.feedback().enabled);
    pair.command(0.3, |t| [(0.15 + 0.5 * t, 0.5), (0.006, 0.0)]);
    assert_eq!(pair.feedback().error_code, error_code::FOLLOWING_ERROR);
    assert!(pair.inject("unblock"));
    pair.driver.request(pair.now, DriverRequest::ResetErrors);
    pair.enable();
    pair.command(0.3, |t| [(0.2 * t, 0.2), (0.006, 0.0)]);
    assert!(pair.position() > 0.05);
}

#[test]
fn a_fault_of_a_joint_that_the_robot_does_not_have_is_refused() {
    let mut pair = Pair::enabled(quiet());
    assert!(!pair.inject("block_joint=2"));
    pair.command(0.2, |t| [(0.2 * t, 0.2), (0.0, 0.0)]);
    assert!(pair.position() > 0.02);
}

#[test]
fn extra_latency_delays_requests_and_reports() {
    let mut pair = Pair::new(EmulatorConfig { enable_time_ms: 0.0, ..quiet() });
    pair.run(0.1);
    assert!(pair.inject("latency_ms=30"));
    pair.run(0.1);
    pair.driver.request(pair.now, DriverRequest::Enable);
    let took = pair.until("enabled", 1.0, |feedback| feedback.enabled);
    assert!((0.060..=0.068).contains(&took), "took {took} s");
    assert!(pair.inject("latency_ms=0"));
    pair.run(0.1);
    pair.driver.request(pair.now, DriverRequest::Disable);
    let took = pair.until("disabled", 1.0, |feedback| !feedback.enabled);
    assert!(took <= 0.004, "took {took} s");
}
