//! The two sides on a network that loses, delays and doubles, and over restarts of either.

use super::super::wire::{Body, Header, encode};
use super::*;
use crate::drivers::LinkRefusal;

#[test]
fn latencies_of_the_file_delay_each_way() {
    let config = EmulatorConfig {
        command_latency_ms: 20.0,
        status_latency_ms: 30.0,
        enable_time_ms: 0.0,
        ..quiet()
    };
    let mut pair = Pair::new(config);
    let first = pair.until("first status", 1.0, |_| true);
    assert!((0.030..=0.036).contains(&first), "first status after {first} s");
    pair.driver.request(pair.now, DriverRequest::Enable);
    let took = pair.until("enabled", 1.0, |feedback| feedback.enabled);
    assert!((0.050..=0.058).contains(&took), "took {took} s");
}

#[test]
fn a_third_of_the_packets_lost_hinders_neither_requests_nor_motion() {
    let weather = Weather { loss: 0.3, hold_up: 3, twice: 0.1 };
    let mut pair = Pair::in_weather(quiet(), weather);
    pair.enable();
    let mut stamp = pair.feedback().stamp;
    let mut position: f64 = 0.0;
    for step in 0..1500 {
        let (way, speed) = blend(2.5, f64::from(step) * PERIOD.as_secs_f64());
        pair.driver.command(pair.now, &set_point([0.6 * way, 0.0], [0.6 * speed, 0.0]));
        pair.tick();
        assert!(pair.feedback().stamp >= stamp);
        // Old reports and old set-points would show as steps back.
        assert!(pair.position() >= position - 1e-4, "{} after {position}", pair.position());
        (stamp, position) = (pair.feedback().stamp, pair.position().max(position));
    }
    assert!((pair.position() - 0.6).abs() < 1e-6, "ended at {}", pair.position());
    assert_eq!(pair.feedback().error_code, 0);
    assert!(pair.driver.counters().out_of_order > 100, "packets did overtake each other");
    assert!(pair.emulator.counters().out_of_order > 100);
    pair.driver.request(pair.now, DriverRequest::Disable);
    pair.until("disabled", 0.5, |feedback| !feedback.enabled);
}

#[test]
fn a_request_that_comes_late_and_again_is_done_once() {
    let mut pair = Pair::new(quiet());
    pair.run(0.1);
    pair.driver.request(pair.now, DriverRequest::Enable);
    let mut buffer = [0; MAX_PACKET];
    let sent = pair.driver.poll_transmit(pair.now, &mut buffer).expect("the request");
    pair.emulator.receive(pair.now, 0, pair.peer, &buffer[..sent.len]);
    pair.until("enabled", 1.0, |feedback| feedback.enabled);
    pair.driver.request(pair.now, DriverRequest::Disable);
    pair.until("disabled", 1.0, |feedback| !feedback.enabled);
    pair.emulator.receive(pair.now, 0, pair.peer, &buffer[..sent.len]);
    pair.run(0.5);
    assert!(!pair.feedback().enabled, "the old packet switched the drives on again");
}

#[test]
fn a_late_request_to_the_run_before_is_not_done() {
    let mut pair = Pair::new(quiet());
    pair.run(0.1);
    pair.driver.request(pair.now, DriverRequest::Enable);
    let mut buffer = [0; MAX_PACKET];
    let late = pair.driver.poll_transmit(pair.now, &mut buffer).expect("the request");
    pair.emulator = config(quiet()).emulator(&setup(33)).expect("emulator");
    pair.run(0.3);
    let dropped = pair.emulator.counters().out_of_order;
    pair.emulator.receive(pair.now, 0, pair.peer, &buffer[..late.len]);
    assert_eq!(pair.emulator.counters().out_of_order, dropped + 1);
    pair.run(0.5);
    assert!(!pair.feedback().enabled);
}

#[test]
fn a_controller_that_restarts_is_found_again_and_nothing_old_is_done_to_it() {
    let mut pair = Pair::enabled(quiet());
    pair.command(0.2, |t| [(0.2 * t, 0.2), (0.0, 0.0)]);
    pair.run(0.3);
    let before = pair.driver.counters().received;
    // It goes down; meanwhile the driver is asked to enable and goes on commanding.
    pair.emulator = config(quiet()).emulator(&setup(33)).expect("emulator");
    pair.driver.request(pair.now, DriverRequest::Enable);
    pair.command(0.3, |_| [(0.04, 0.0), (0.0, 0.0)]);
    assert!(pair.driver.counters().received > before + 50, "status comes from the new run");
    pair.run(0.5);
    assert!(!pair.feedback().enabled, "what was asked of the old run is not done by the new one");
    assert_eq!(&*pair.feedback().joint_position, &[0.0, 0.0]);
    pair.enable();
    pair.command(0.2, |t| [(0.2 * t, 0.2), (0.0, 0.0)]);
    assert!(pair.position() > 0.02);
}

#[test]
fn a_reset_after_the_controller_restarted_does_not_repeat_what_the_run_before_has_done() {
    let mut pair = Pair::enabled(quiet());
    pair.emulator = config(quiet()).emulator(&setup(33)).expect("emulator");
    pair.run(0.5);
    pair.request(DriverRequest::ResetErrors);
    pair.run(0.5);
    assert!(!pair.feedback().enabled, "the old request to enable went along");
}

#[test]
fn a_set_point_from_before_the_controller_answered_is_never_sent() {
    let mut pair = Pair::new(quiet());
    pair.driver.command(pair.now, &set_point([0.4, 0.0], [0.0, 0.0]));
    pair.tick();
    assert!(pair.driver.feedback().is_some());
    let mut buffer = [0; MAX_PACKET];
    let sent = pair.driver.poll_transmit(pair.now + PERIOD, &mut buffer);
    assert_eq!(sent, None);
}

#[test]
fn a_late_report_of_the_run_before_is_dropped() {
    let mut pair = Pair::enabled(quiet());
    let mut buffer = [0; MAX_PACKET];
    pair.now = pair.now + PERIOD;
    pair.emulator.advance(pair.now);
    let late = pair.emulator.poll_transmit(pair.now, &mut buffer).expect("a report");
    pair.emulator = config(quiet()).emulator(&setup(33)).expect("emulator");
    pair.run(0.3);
    assert!(!pair.feedback().enabled);
    let dropped = pair.driver.counters().out_of_order;
    pair.driver.receive(pair.now, 0, &buffer[..late.len]);
    assert!(!pair.feedback().enabled);
    assert_eq!(pair.driver.counters().out_of_order, dropped + 1);
}

#[test]
fn an_agent_that_restarts_takes_over_once_the_run_before_is_silent() {
    let mut pair = Pair::enabled(quiet());
    pair.driver = config(quiet()).driver(&setup(12)).expect("driver");
    pair.peer = address(50_002);
    pair.run(0.3);
    assert_eq!(pair.driver.feedback(), None);
    assert_eq!(pair.driver.counters().refusal, Some(LinkRefusal::Busy));
    let took = pair.until("status", 1.0, |_| true);
    assert!((0.15..=0.35).contains(&took), "taken over after {took} s more");
    assert!(pair.feedback().enabled, "the controller itself went on");
    assert_eq!(pair.driver.counters().refusal, None);
    pair.command(0.2, |t| [(0.2 * t, 0.2), (0.0, 0.0)]);
    assert!(pair.position() > 0.02);
}

#[test]
fn a_second_client_is_refused_and_the_first_does_not_notice() {
    let mut pair = Pair::enabled(quiet());
    let mut second = config(quiet()).driver(&setup(12)).expect("driver");
    let peer = address(50_002);
    let mut buffer = [0; MAX_PACKET];
    let received = pair.driver.counters().received;
    for _ in 0..500 {
        while let Some(sent) = second.poll_transmit(pair.now, &mut buffer) {
            pair.emulator.receive(pair.now, 0, peer, &buffer[..sent.len]);
        }
        pair.tick();
        for (to, bytes) in pair.to_others.drain(..) {
            assert_eq!(to, peer);
            second.receive(pair.now, 0, &bytes);
        }
    }
    assert_eq!(second.feedback(), None);
    assert!(second.counters().refused >= 9, "{:?}", second.counters());
    assert_eq!(second.counters().refusal, Some(LinkRefusal::Busy));
    assert_eq!(pair.driver.counters().received, received + 500);
    assert_eq!(pair.driver.counters().refused, 0);
}

#[test]
fn a_client_that_comes_back_from_another_address_goes_on() {
    let mut pair = Pair::enabled(quiet());
    pair.peer = address(50_009);
    pair.command(0.2, |t| [(0.2 * t, 0.2), (0.0, 0.0)]);
    assert!(pair.position() > 0.02);
    assert!(pair.to_others.len() <= 1, "reports follow it");
}

#[test]
fn a_silent_client_keeps_the_controller_by_greeting() {
    let mut pair = Pair::new(quiet());
    pair.run(0.1);
    let received = pair.driver.counters().received;
    pair.run(2.0);
    assert_eq!(pair.driver.counters().received, received + 1000);
}

#[test]
fn another_number_of_joints_is_refused_with_both_numbers() {
    let mut pair = Pair::new(quiet());
    let mut short = setup(12);
    short.joints.pop();
    pair.driver = config(quiet()).driver(&short).expect("driver");
    pair.run(0.3);
    assert_eq!(pair.driver.feedback(), None);
    let refusal = pair.driver.counters().refusal.expect("a refusal");
    assert_eq!(refusal.to_string(), "the controller drives 2 joints, the robot file names 1");
}

#[test]
fn another_version_is_refused_with_the_controllers() {
    let mut pair = Pair::new(quiet());
    let mut buffer = [0; MAX_PACKET];
    let sent = pair.driver.poll_transmit(pair.now, &mut buffer).expect("hello");
    buffer[4] = 9;
    pair.emulator.receive(pair.now, 0, pair.peer, &buffer[..sent.len]);
    pair.tick();
    assert_eq!(pair.emulator.counters().malformed, 1);
    assert_eq!(pair.driver.counters().refused, 1);
}

#[test]
fn what_is_no_packet_is_counted_on_both_sides_and_changes_nothing() {
    let mut pair = Pair::enabled(quiet());
    let before = *pair.feedback();
    let mut buffer = [0; MAX_PACKET];
    let header = Header { sender: 22, receiver: 11, sequence: 9_999_999 };
    let len = encode(&header, &Body::Hello { joints: 2 }, &mut buffer);
    for bytes in [&b""[..], b"ASIM", &[0xff; 1500], &buffer[..len]] {
        pair.driver.receive(pair.now, 0, bytes);
    }
    assert_eq!(pair.driver.counters().malformed, 4);
    for bytes in [&b""[..], b"ASIM", &[0xff; 1500]] {
        pair.emulator.receive(pair.now, 0, address(50_003), bytes);
    }
    assert_eq!(pair.emulator.counters().malformed, 3);
    assert_eq!(*pair.feedback(), before);
    pair.run(0.1);
    assert!(pair.feedback().ready);
}

#[test]
fn a_long_pause_of_the_emulator_is_not_caught_up_with() {
    let mut pair = Pair::enabled(quiet());
    let received = pair.driver.counters().received;
    pair.now = pair.now + Duration::from_secs(3600);
    pair.tick();
    assert!(pair.driver.counters().received <= received + 1);
    pair.run(0.3);
    assert!(pair.driver.counters().received > received + 50);
    assert!(pair.feedback().ready);
}

#[test]
fn the_next_deadline_is_a_cycle_or_a_report_that_waits() {
    let mut emulator = config(EmulatorConfig { status_latency_ms: 3.0, ..quiet() })
        .emulator(&setup(22))
        .expect("emulator");
    assert_eq!(emulator.next_deadline(), MonoTime::ZERO);
    let begin = MonoTime::from_nanos(1_000_000);
    let mut buffer = [0; MAX_PACKET];
    let header = Header { sender: 11, receiver: 0, sequence: 1 };
    let len = encode(&header, &Body::Hello { joints: 2 }, &mut buffer);
    emulator.receive(begin, 0, address(50_001), &buffer[..len]);
    emulator.advance(begin);
    assert_eq!(emulator.next_deadline(), begin + PERIOD);
    emulator.advance(begin + PERIOD);
    assert_eq!(emulator.next_deadline(), begin + Duration::from_millis(3));
    assert!(emulator.poll_transmit(begin + Duration::from_millis(3), &mut buffer).is_some());
    assert_eq!(emulator.next_deadline(), begin + 2 * PERIOD);
}

#[test]
fn a_driver_without_an_address_to_send_to_is_refused() {
    let config = Config { address: address(0), emulator: quiet() };
    let error = config.driver(&setup(1)).expect_err("port 0").to_string();
    assert_eq!(error, "driver.sim.address: port 0 cannot be sent to");
    assert!(config.emulator(&setup(1)).is_ok(), "the system chooses the emulator's port");
}
