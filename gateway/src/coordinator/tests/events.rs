//! Every robot's events in one stream.

use armada_protocol::messages::{Event, EventKind, Severity};
use serde_json::Map;
use uuid::Uuid;

use super::bench::{Bench, ms, name};
use crate::coordinator::Input;

fn say(bench: &mut Bench, robot: &str, boot_id: Uuid, seqno: u64) {
    let event = Event {
        robot: Some(name(robot)),
        boot_id,
        seqno,
        stamp_ns: bench.now.shifted(7_000),
        utc_ns: 5,
        severity: Severity::Info,
        kind: EventKind::ModeChanged,
        message: format!("{robot} {seqno}"),
        details: Map::new(),
    };
    bench.feed(Input::RobotEvent(Box::new(event)));
}

fn heard(bench: &Bench) -> Vec<&str> {
    let of_robots = bench.events().filter(|event| event.kind == EventKind::ModeChanged);
    of_robots.map(|event| event.message.as_str()).collect()
}

#[test]
fn events_of_robots_are_numbered_among_the_gateways_own() {
    let mut bench = Bench::new();
    let [left, right] = ["left", "right"].map(|robot| bench.agent(robot).boot_id);
    say(&mut bench, "left", left, 40);
    say(&mut bench, "right", right, 3);
    bench.vanish("torso");
    say(&mut bench, "left", left, 41);
    assert_eq!(heard(&bench), ["left 40", "right 3", "left 41"]);
    for (expected, event) in (0..).zip(bench.events()) {
        assert_eq!((event.seqno, event.boot_id), (expected, Uuid::from_u128(7)));
    }
    let event = bench.events().find(|event| event.message == "left 41").expect("passed on");
    assert_eq!(event.robot, Some(name("left")));
    assert_eq!(event.details["robot_seqno"], 41);
    assert_eq!(event.details["robot_boot_id"], left.to_string());
    assert!(!bench.events().any(|event| event.kind == EventKind::EventsLost));
}

#[test]
fn a_gap_is_told_and_a_repeated_event_is_not_repeated() {
    let mut bench = Bench::new();
    let left = bench.agent("left").boot_id;
    for seqno in [5, 6, 6, 5, 9, 8, 10] {
        say(&mut bench, "left", left, seqno);
    }
    assert_eq!(heard(&bench), ["left 5", "left 6", "left 9", "left 10"]);
    let gaps: Vec<_> = bench.events().filter(|event| event.kind == EventKind::EventsLost).collect();
    assert_eq!(gaps.len(), 1);
    assert_eq!(
        (&gaps[0].details["first_seqno"], &gaps[0].details["count"]),
        (&7.into(), &2.into())
    );
    assert_eq!(gaps[0].robot, Some(name("left")));
}

#[test]
fn a_new_run_begins_at_zero_and_the_old_one_is_not_heard_any_more() {
    let mut bench = Bench::new();
    let old = bench.agent("left").boot_id;
    say(&mut bench, "left", old, 5);
    bench.appear("left", 200);
    bench.run(ms(100));
    let new = bench.agent("left").boot_id;
    say(&mut bench, "left", new, 1);
    say(&mut bench, "left", old, 6);
    assert_eq!(heard(&bench), ["left 5", "left 1"]);
    let gap = bench.events().find(|event| event.kind == EventKind::EventsLost).expect("told");
    assert_eq!(gap.details["first_seqno"], 0);
}
