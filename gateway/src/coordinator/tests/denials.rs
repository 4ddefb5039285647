//! Each reason for which a motion is refused.

use armada_model::JointTrajectory;
use armada_protocol::messages::{ClearBy, CommandMode, DenialCode, Fault, FaultCode, StopScope};
use uuid::Uuid;

use super::bench::{Bench, ms, stop_request, trajectory};
use crate::coordinator::{CellRequest, Input};

/// How the cell is prepared, what is asked, and what must be in the denial.
type Row = (&'static str, fn(&mut Bench) -> JointTrajectory, DenialCode, &'static str);

fn renamed(from: &str, to: &str) -> JointTrajectory {
    let mut changed = trajectory(&["left", "right"]);
    for name in &mut changed.joint_names {
        if name == from {
            to.clone_into(name);
        }
    }
    changed
}

/// What is wrong with the joints' names.
const fn rows_of_names() -> [Row; 6] {
    use DenialCode as Code;
    [
        (
            "no joints",
            |_| JointTrajectory::default(),
            Code::InvalidArgument,
            "joint_names is empty",
        ),
        (
            "name without robot",
            |_| renamed("left/elbow_joint", "elbow_joint"),
            Code::InvalidArgument,
            "expected ROBOT/JOINT",
        ),
        (
            "unknown robot",
            |_| renamed("left/elbow_joint", "lef/elbow_joint"),
            Code::InvalidArgument,
            "no robot \"lef\", it has left, right, torso",
        ),
        (
            "unknown joint",
            |_| renamed("left/elbow_joint", "left/elbow"),
            Code::InvalidArgument,
            "left: it has no joint \"elbow\"",
        ),
        (
            "doubled joint",
            |_| renamed("left/elbow_joint", "left/spin_joint"),
            Code::InvalidArgument,
            "left/spin_joint more than once",
        ),
        (
            "missing joint",
            |_| {
                let mut short = trajectory(&["left"]);
                short.joint_names.pop();
                short.waypoints.iter_mut().for_each(|row| row.joint_position.truncate(1));
                short
            },
            Code::InvalidArgument,
            "left: joint_names lacks its joint spin_joint",
        ),
    ]
}

/// What is wrong with rows, agents and stops.
const fn rows_of_agents() -> [Row; 5] {
    use DenialCode as Code;
    [
        (
            "short row",
            |_| {
                let mut short = trajectory(&["left"]);
                short.waypoints[1].joint_position.pop();
                short
            },
            Code::InvalidArgument,
            "waypoint 1: joint_position has 1 values",
        ),
        (
            "lost agent",
            |bench| {
                bench.vanish("right");
                trajectory(&["left", "right"])
            },
            Code::Unreachable,
            "right: its agent is not on the bus",
        ),
        (
            "restarted agent that has not said what it is",
            |bench| {
                bench.appear("right", 300);
                let agent = bench.agent("right");
                let status = agent.status.clone();
                bench.feed(Input::Status(Box::new(status)));
                trajectory(&["left", "right"])
            },
            Code::NotReady,
            "right: its description has not been received yet",
        ),
        (
            "latched stop",
            |bench| {
                let now = bench.now;
                let request = stop_request(5, StopScope::Cell);
                bench.agent("right").stop(&request, now);
                trajectory(&["left", "right"])
            },
            Code::Stopped,
            "right: a stop of level L2 by \"panel\" is latched",
        ),
        (
            "stop on its way",
            |bench| {
                bench.feed(Input::CellStop(stop_request(5, StopScope::Cell)));
                trajectory(&["left", "right"])
            },
            Code::Stopped,
            "left: a stop is in progress",
        ),
    ]
}

/// What is wrong with the robots themselves.
const fn rows_of_robots() -> [Row; 4] {
    use DenialCode as Code;
    [
        (
            "fault",
            |bench| {
                let (code, message) = (FaultCode::TrackingError, "elbow lags".to_owned());
                let since_ns = armada_model::MonoTime::ZERO;
                let fault = Fault {
                    code,
                    message,
                    joint: None,
                    value: 0.0,
                    limit: 0.0,
                    clear: ClearBy::ResetErrors,
                    remedy: String::new(),
                    recording: None,
                    since_ns,
                };
                bench.agent("right").status.faults.push(fault);
                trajectory(&["left", "right"])
            },
            Code::Faulted,
            "right: a fault is latched, clear it with reset_errors: elbow lags",
        ),
        (
            "other mode",
            |bench| {
                bench.agent("left").status.command_mode = CommandMode::Jog;
                trajectory(&["left", "right"])
            },
            Code::WrongMode,
            "left: its mode is jog, halt it first",
        ),
        (
            "no valid mode",
            |bench| {
                let status = &mut bench.agent("left").status;
                status.command_mode = CommandMode::InvalidState;
                status.next = vec!["enable: armada enable left".to_owned()];
                trajectory(&["left", "right"])
            },
            Code::NotReady,
            "left: it cannot be commanded: enable: armada enable left",
        ),
        (
            "taken robot",
            |bench| {
                bench.execute(77, &["right", "torso"]);
                bench.run(ms(500));
                trajectory(&["left", "right"])
            },
            Code::Busy,
            "right: it takes part in motion 00000000-0000-0000-0000-00000000004d",
        ),
    ]
}

#[test]
fn every_reason_is_told_with_robot_and_joint() {
    for (what, prepare, code, message) in
        [&rows_of_names()[..], &rows_of_agents(), &rows_of_robots()].concat()
    {
        let mut bench = Bench::new();
        let trajectory = prepare(&mut bench);
        let ticket = bench.execute_trajectory(1, trajectory);
        bench.run(ms(100));
        let denial = bench.denial(ticket);
        assert_eq!(denial.code, code, "{what}: {denial}");
        assert!(denial.message.contains(message), "{what}: {denial}");
        let names_robot = denial.details.contains_key("robot");
        let names_other =
            denial.details.contains_key("joint") || denial.details.contains_key("field");
        assert!(names_robot || names_other || what == "short row", "{what}: {denial:?}");
    }
}

#[test]
fn a_motion_id_is_used_once() {
    let mut bench = Bench::new();
    bench.execute(1, &["left"]);
    let ticket = bench.execute(1, &["right"]);
    assert!(bench.denial(ticket).message.contains("was used before"));
    bench.run(ms(4_000));
    let ticket = bench.execute(1, &["right"]);
    assert_eq!(bench.denial(ticket).code, DenialCode::InvalidArgument);
}

#[test]
fn a_motion_that_does_not_exist_cannot_be_cancelled() {
    let mut bench = Bench::new();
    let ticket = bench.request(CellRequest::Cancel { motion_id: Uuid::from_u128(1) });
    assert_eq!(bench.denial(ticket).code, DenialCode::NotAttached);
}

#[test]
fn a_motion_is_refused_before_the_clocks_were_measured() {
    let mut bench = Bench::empty();
    bench.appear("left", 1);
    // It never answers questions about its clock.
    let agent = bench.agent("left");
    let (info, status) = (agent.info.clone(), agent.status.clone());
    bench.feed(Input::Info(Box::new(info)));
    bench.feed(Input::Status(Box::new(status)));
    bench.run(ms(0));
    let ticket = bench.execute(1, &["left"]);
    bench.drop_clock_answers = true;
    bench.run(ms(1_000));
    let denial = bench.denial(ticket);
    assert_eq!(denial.code, DenialCode::NotReady);
    assert!(denial.message.contains("left: the offset of its clock"), "{denial}");
}
