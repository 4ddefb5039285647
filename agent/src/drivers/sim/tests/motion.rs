//! The robot behind the emulated controller.

use proptest::prelude::*;

use super::*;

#[test]
fn drives_take_their_time_to_switch_on_and_none_to_switch_off() {
    let mut pair = Pair::new(EmulatorConfig { enable_time_ms: 300.0, ..quiet() });
    pair.run(0.1);
    assert!(!pair.feedback().enabled && !pair.feedback().ready);
    pair.driver.request(pair.now, DriverRequest::Enable);
    let took = pair.until("enabled", 1.0, |feedback| feedback.enabled && feedback.ready);
    assert!((0.298..=0.306).contains(&took), "took {took} s");
    pair.driver.request(pair.now, DriverRequest::Disable);
    let took = pair.until("disabled", 1.0, |feedback| !feedback.enabled && !feedback.ready);
    assert!(took <= 0.004, "took {took} s");
    assert!(pair.feedback().joint_effort.iter().all(|effort| *effort == 0.0));
}

#[test]
fn a_move_within_the_limits_is_followed_with_the_lag_and_ends_at_the_goal() {
    let mut pair = Pair::enabled(EmulatorConfig { time_constant_ms: 20.0, ..quiet() });
    pair.accelerate_to(1.0);
    let commanded = 0.5 / ACCELERATION_LIMIT + 0.1;
    let lag = commanded - pair.position();
    assert!((lag - 0.02).abs() < 0.004, "{lag} rad behind at 1 rad/s");
    assert!((pair.feedback().joint_velocity[0] - 1.0).abs() < 0.02);

    let mut pair = Pair::enabled(quiet());
    pair.command(2.0, |t| {
        let (s, v) = blend(1.0, t);
        [(0.6 * s, 0.6 * v), (0.05 * s, 0.05 * v)]
    });
    assert!(pair.feedback().joint_position.max_abs_difference(&vector([0.6, 0.05])) < 1e-9);
    assert_eq!(pair.feedback().error_code, 0);
}

#[test]
fn set_points_while_the_drives_are_off_move_nothing() {
    let mut pair = Pair::new(quiet());
    pair.run(0.1);
    pair.command(0.3, |_| [(0.1, 0.0), (0.1, 0.0)]);
    assert_eq!(&*pair.feedback().joint_position, &[0.0, 0.0]);
    assert_eq!(pair.feedback().error_code, 0);
}

#[test]
fn measured_noise_has_the_deviation_of_the_file_and_repeats_with_the_seed() {
    let noisy = EmulatorConfig {
        position_noise_rad: 1e-3,
        velocity_noise_m_s: 2e-3,
        ..EmulatorConfig::default()
    };
    let record = || {
        let mut pair = Pair::new(noisy.clone());
        pair.run(0.1);
        let mut values = Vec::new();
        for _ in 0..5000 {
            pair.tick();
            values.push((pair.position(), pair.feedback().joint_velocity[1]));
        }
        values
    };
    let values = record();
    let deviation = |pick: fn(&(f64, f64)) -> f64| {
        let mean = values.iter().map(pick).sum::<f64>() / values.len() as f64;
        let squares = values.iter().map(|value| (pick(value) - mean).powi(2)).sum::<f64>();
        (squares / values.len() as f64).sqrt()
    };
    let (position, velocity) = (deviation(|v| v.0), deviation(|v| v.1));
    assert!((position - 1e-3).abs() < 5e-5, "position deviates by {position}");
    assert!((velocity - 2e-3).abs() < 1e-4, "speed deviates by {velocity}");
    assert_eq!(values, record());
}

#[test]
fn silence_in_motion_ends_in_a_stop_with_an_error_and_the_drives_on() {
    let mut pair = Pair::enabled(quiet());
    pair.accelerate_to(1.0);
    let silent_at = pair.position();
    // Until the watchdog expires the reference has stopped after its 20 ms.
    let took = pair.until("error", 0.5, |feedback| feedback.error_code != 0);
    assert!((0.100..=0.106).contains(&took), "after {took} s");
    assert_eq!(pair.feedback().error_code, error_code::WATCHDOG);
    assert!(pair.feedback().enabled && !pair.feedback().ready);
    pair.until("standstill", 1.0, |feedback| feedback.joint_velocity[0] == 0.0);
    let way = pair.position() - silent_at;
    let limit = 1.2 * ACCELERATION_LIMIT;
    let longest = 0.1 + 0.5 / limit + 0.01;
    assert!(way > 0.02 && way < longest, "stopped after {way} rad");
    let stopped_at = pair.position();
    pair.command(0.2, |_| [(stopped_at + 0.1, 0.0), (0.0, 0.0)]);
    assert_eq!(pair.position(), stopped_at, "commands count only after a reset");
    pair.driver.request(pair.now, DriverRequest::ResetErrors);
    pair.until("ready", 0.1, |feedback| feedback.ready && feedback.error_code == 0);
    pair.command(0.5, |_| [(stopped_at + 0.1, 0.0), (0.0, 0.0)]);
    assert!((pair.position() - stopped_at - 0.1).abs() < 1e-6);
}

#[test]
fn silence_at_rest_is_no_error() {
    let mut pair = Pair::enabled(quiet());
    pair.command(0.5, |_| [(0.0, 0.0), (0.0, 0.0)]);
    pair.run(1.0);
    assert!(pair.feedback().ready);
    assert_eq!(pair.feedback().error_code, 0);
}

#[test]
fn switching_off_in_motion_stops_with_the_brakes() {
    let mut pair = Pair::enabled(quiet());
    pair.accelerate_to(1.0);
    let begin = pair.position();
    pair.driver.request(pair.now, DriverRequest::Disable);
    let took = pair.until("standstill", 1.0, |feedback| feedback.joint_velocity[0] == 0.0);
    let brake = 2.0 * 1.2 * ACCELERATION_LIMIT;
    assert!((took - 1.0 / brake).abs() < 0.006, "stopped in {took} s");
    assert!((pair.position() - begin - 0.5 / brake).abs() < 0.006);
    pair.run(0.5);
    assert_eq!(pair.feedback().joint_velocity[0], 0.0, "brakes hold");
}

#[test]
fn a_set_point_past_a_limit_is_an_error_and_the_way_back_is_free() {
    let mut pair = Pair::enabled(quiet());
    pair.command(0.05, |_| [(0.0, 0.0), (0.51, 0.0)]);
    assert_eq!(pair.feedback().error_code, error_code::JOINT_LIMIT);
    assert!(!pair.feedback().enabled);
    assert_eq!(pair.feedback().joint_position[1], 0.0);
    pair.driver.request(pair.now, DriverRequest::ResetErrors);
    pair.enable();
    assert_eq!(pair.feedback().error_code, 0);
}

#[test]
fn a_joint_too_fast_to_stop_before_its_limit_is_an_error_and_hits_the_stop_at_most() {
    let mut emulator = quiet();
    emulator.initial_rad.insert("turn".into(), 2.5);
    let mut pair = Pair::enabled(emulator);
    pair.command(1.0, |t| {
        // Every set-point keeps the limit of 3 rad, but the last step is from 1 rad/s to rest.
        let ramped = t.min(0.2);
        let position = 2.5 + 2.5 * ramped * ramped + (t - ramped);
        [(position.min(3.0), if position < 3.0 { 5.0 * ramped } else { 0.0 }), (0.0, 0.0)]
    });
    assert_eq!(pair.feedback().error_code, error_code::JOINT_LIMIT);
    assert!(!pair.feedback().enabled);
    assert!((3.001..=3.05).contains(&pair.position()), "at {}", pair.position());
}

#[test]
fn a_set_point_far_away_is_a_following_error() {
    let mut pair = Pair::enabled(quiet());
    pair.command(0.05, |_| [(0.51, 0.0), (0.0, 0.0)]);
    assert_eq!(pair.feedback().error_code, error_code::FOLLOWING_ERROR);
    assert!(!pair.feedback().enabled && pair.position() < 0.01);
}

#[test]
fn joints_begin_where_the_file_says_or_at_the_limit_next_to_zero() {
    let mut emulator = quiet();
    emulator.initial_rad.insert("turn".into(), -1.25);
    let mut setup = setup(3);
    setup.joints[1].limits.lower = Some(0.2);
    let config = config(emulator.clone());
    let mut pair = Pair::new(quiet());
    pair.emulator = config.emulator(&setup).expect("emulator");
    pair.run(0.01);
    assert_eq!(&*pair.feedback().joint_position, &[-1.25, 0.2]);

    for (table, joint, value, problem) in [
        ("rad", "nose", 0.0, "driver.sim.emulator.initial_rad.nose: the robot has no such joint"),
        ("rad", "slide", 0.1, "initial_rad.slide: the joint slides, give initial_m"),
        ("rad", "turn", 4.0, "initial_rad.turn: 4 is outside the joint's limits -3 to 3"),
        ("m", "turn", 1.0, "initial_m.turn: the joint turns, give initial_rad"),
    ] {
        let mut emulator = quiet();
        let initial =
            if table == "rad" { &mut emulator.initial_rad } else { &mut emulator.initial_m };
        initial.insert(joint.into(), value);
        let error = super::config(emulator).emulator(&setup).expect_err(problem).to_string();
        assert!(error.contains(problem), "{error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn no_set_point_makes_a_joint_exceed_what_its_drive_can_do(
        goals in prop::collection::vec(
            (-4.0..4.0, -20.0..20.0, -0.6..0.6, -20.0..20.0, 1_u8..80),
            1..12,
        ),
    ) {
        // Never stopped by supervision of the controller, so that the drives alone must hold.
        let emulator = EmulatorConfig { following_error_rad: 100.0, following_error_m: 100.0, ..quiet() };
        let mut pair = Pair::enabled(emulator);
        let (mut last, brake) = (*pair.feedback(), 2.0);
        for (a, va, b, vb, ticks) in goals {
            for _ in 0..ticks {
                pair.driver.command(pair.now, &set_point([a, b], [va, vb]));
                pair.tick();
                let feedback = *pair.feedback();
                for (joint, scale) in [(0, 1.0), (1, 0.1)] {
                    let speed = feedback.joint_velocity[joint];
                    prop_assert!(speed.abs() <= 1.2 * SPEED_LIMIT * scale + 1e-9);
                    let change = (speed - last.joint_velocity[joint]).abs();
                    let ratio = if feedback.enabled && last.enabled { 1.2 } else { 1.2 * brake };
                    let most = ratio * ACCELERATION_LIMIT * scale * PERIOD.as_secs_f64();
                    let upper = if joint == 0 { 3.0 } else { 0.5 };
                    let position = feedback.joint_position[joint];
                    let at_stop = position.abs() >= upper + 0.05 - 1e-9;
                    prop_assert!(change <= most + 1e-9 || at_stop, "{change} in one tick");
                    prop_assert!(position.abs() <= upper + 0.05 + 1e-9, "at {position}");
                }
                last = feedback;
            }
        }
    }
}
