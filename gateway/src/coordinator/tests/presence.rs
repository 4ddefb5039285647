//! Who is there, and what the cell's status says.

use armada_model::MonoTime;
use armada_protocol::messages::{
    CellVerdict, CommandMode, EventKind, Presence, RobotState, StopScope,
};

use super::agent::golden;
use super::bench::{Bench, ms, name, stop_request};
use crate::coordinator::Input;

fn state(bench: &mut Bench, robot: &str) -> Input {
    let mut state: RobotState =
        golden(include_str!("../../../../protocol/golden/robot_state.json"));
    state.boot_id = bench.agent(robot).boot_id;
    let arrived = bench.now;
    Input::State { robot: name(robot), state: Box::new(state), arrived, arrivals: 10 }
}

#[test]
fn robots_that_were_never_seen_make_the_cell_degraded() {
    let mut bench = Bench::empty();
    bench.run(ms(10));
    let status = bench.status();
    assert_eq!(status.verdict, CellVerdict::Degraded);
    assert!(status.robots.values().all(|robot| robot.presence == Presence::NeverSeen));
}

#[test]
fn a_cell_with_all_robots_is_ready_and_knows_their_clocks() {
    let mut bench = Bench::new();
    bench.run(ms(1_000));
    let offsets = bench.agents.values().map(|agent| agent.offset_ns).collect::<Vec<_>>();
    let status = bench.status();
    assert_eq!(status.verdict, CellVerdict::Ready);
    let measured: Vec<_> =
        status.robots.values().map(|robot| robot.clock_offset_ns.expect("measured")).collect();
    assert_eq!(measured, offsets);
    assert!(status.robots.values().all(|robot| robot.clock_bound_ns < Some(2_000_000)));
}

#[test]
fn the_verdict_follows_the_robots() {
    let mut bench = Bench::new();
    bench.execute(1, &["left"]);
    bench.run(ms(500));
    assert_eq!(bench.status().verdict, CellVerdict::Moving);
    bench.run(ms(3_000));
    assert_eq!(bench.status().verdict, CellVerdict::Ready);
    let now = bench.now;
    bench.agent("right").stop(&stop_request(3, StopScope::Cell), now);
    bench.run(ms(100));
    assert_eq!(bench.status().verdict, CellVerdict::Stopped);
    let mut status = bench.agent("left").status.clone();
    (status.command_mode, status.seqno) = (CommandMode::InvalidState, status.seqno + 1);
    bench.feed(Input::Status(Box::new(status)));
    bench.run(ms(100));
    assert_eq!(bench.status().verdict, CellVerdict::Degraded);
}

#[test]
fn a_lost_agent_is_told_within_a_moment_and_its_latched_stop_stays_shown() {
    let mut bench = Bench::new();
    let now = bench.now;
    bench.agent("left").stop(&stop_request(3, StopScope::Cell), now);
    bench.run(ms(100));
    bench.vanish("left");
    bench.run(ms(30));
    let left = &bench.status().robots[&name("left")];
    assert_eq!((left.presence, left.command_mode), (Presence::Lost, None));
    assert!(left.stop.is_some());
    let event = bench.events().last().expect("an event");
    assert_eq!((event.kind, event.robot.clone()), (EventKind::PresenceChanged, Some(name("left"))));
}

#[test]
fn a_new_run_of_an_agent_starts_from_nothing() {
    let mut bench = Bench::new();
    let message = state(&mut bench, "left");
    bench.feed(message.clone());
    bench.run(ms(30));
    let old_status = bench.agent("left").status.clone();
    bench.vanish("left");
    bench.appear("left", 200);
    bench.run(ms(100));
    let left = &bench.status().robots[&name("left")];
    assert_eq!((left.presence, left.state_age_ms), (Presence::Online, None));
    assert!(left.clock_offset_ns.is_some(), "measured anew");
    // What the old run sent last arrives late and changes nothing.
    bench.feed(message);
    let mut late = old_status;
    (late.command_mode, late.seqno) = (CommandMode::Jog, 1_000);
    bench.feed(Input::Status(Box::new(late)));
    bench.run(ms(1_100));
    let left = &bench.status().robots[&name("left")];
    assert_eq!((left.command_mode, left.state_age_ms), (Some(CommandMode::Halt), None));
}

#[test]
fn age_and_rate_of_states_are_shown() {
    let mut bench = Bench::new();
    for _ in 0..20 {
        let message = state(&mut bench, "left");
        bench.feed(message);
        bench.run(ms(100));
    }
    let left = &bench.status().robots[&name("left")];
    assert!((left.state_rate_hz - 100.0).abs() < 0.5, "{} Hz", left.state_rate_hz);
    assert!(left.state_age_ms.expect("there is one") <= 100.0);
    assert_eq!(left.tcp.len(), 1);
}

#[test]
fn a_burst_of_changes_is_one_status_and_silence_is_one_a_second() {
    let mut bench = Bench::new();
    bench.run(ms(2_000));
    let count = |bench: &Bench| bench.statuses().count();
    let before = count(&bench);
    for seqno in 0..10 {
        let mut status = bench.agent("left").status.clone();
        status.seqno += seqno;
        let modes = [CommandMode::Halt, CommandMode::Jog];
        status.command_mode = modes[usize::try_from(seqno % 2).expect("small")];
        bench.feed(Input::Status(Box::new(status)));
        bench.run(ms(1));
    }
    bench.run(ms(50));
    let burst = count(&bench) - before;
    assert!((1..=2).contains(&burst), "{burst} statuses for a burst of 10 ms");
    let before = count(&bench);
    bench.run(ms(5_000));
    assert_eq!(count(&bench) - before, 5);
    let times: Vec<MonoTime> = bench.statuses().map(|(at, _)| at).collect();
    assert!(times.windows(2).all(|pair| pair[1].saturating_since(pair[0]) >= ms(20)));
}

#[test]
fn a_status_that_was_overtaken_is_not_taken() {
    let mut bench = Bench::new();
    let mut newer = bench.agent("left").status.clone();
    let mut older = newer.clone();
    (newer.seqno, newer.command_mode) = (101, CommandMode::Jog);
    (older.seqno, older.command_mode) = (100, CommandMode::Trajectory);
    bench.feed(Input::Status(Box::new(newer)));
    bench.feed(Input::Status(Box::new(older)));
    bench.run(ms(50));
    assert_eq!(bench.status().robots[&name("left")].command_mode, Some(CommandMode::Jog));
}

#[test]
fn messages_of_robots_that_are_not_in_the_cell_are_passed_over() {
    let mut bench = Bench::new();
    bench.feed(Input::Presence { robot: name("stranger"), online: true });
    let mut status = bench.agent("left").status.clone();
    status.robot = name("stranger");
    bench.feed(Input::Status(Box::new(status)));
    bench.run(ms(1_100));
    assert!(!bench.status().robots.contains_key(&name("stranger")));
    assert_eq!(bench.status().verdict, CellVerdict::Ready);
}

#[test]
fn a_model_that_cannot_be_used_is_an_event() {
    let mut bench = Bench::new();
    let (robot, message) = (name("left"), "joint elbow has no parent".to_owned());
    bench.feed(Input::ModelRejected { robot, message });
    let event = bench.events().last().expect("an event");
    assert_eq!(event.kind, EventKind::ModelRejected);
    assert_eq!(event.message, "joint elbow has no parent");
}
