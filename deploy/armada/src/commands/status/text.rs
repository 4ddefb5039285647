//! The condition of a cell as text.

use armada_protocol::RobotName;
use armada_protocol::messages::CellRobotStatus;

use super::{Origin, Report, advice};
use crate::motion::{MotionView, progress_line};
use crate::table::Table;
use crate::words;

/// The table of robots, what is wrong with them, and the verdict.
pub(super) fn render(report: &Report) -> String {
    let mut blocks = Vec::new();
    blocks.push(match (report.origin, &report.cell) {
        (Origin::Gateway, Some(cell)) => format!("cell {cell}"),
        (Origin::Gateway, None) | (Origin::Agents, _) => {
            "the gateway does not answer: this is what the agents say themselves".to_owned()
        }
    });
    blocks.push(robots(report).to_string());
    blocks.push(timing(report).to_string());
    let motions: Vec<String> = report
        .motions
        .iter()
        .map(|motion| progress_line("motion", &MotionView::from(motion.clone())))
        .collect();
    if !motions.is_empty() {
        blocks.push(motions.join("\n"));
    }
    let advice: Vec<String> =
        report.robots.iter().flat_map(|(robot, status)| advice::of(robot, status)).collect();
    if !advice.is_empty() {
        blocks.push(advice.join("\n"));
    }
    blocks.push(words::verdict(report.verdict).to_owned());
    blocks.join("\n\n")
}

fn robots(report: &Report) -> Table {
    let mut table = Table::new(&[
        "robot",
        "presence",
        "mode",
        "controller",
        "stop",
        "may command",
        "tip: x y z  roll pitch yaw",
    ]);
    for (robot, status) in &report.robots {
        table.row(vec![
            robot.to_string(),
            words::presence(status.presence).to_owned(),
            status.command_mode.map_or("-", words::mode).to_owned(),
            status.controller_state.map_or("-", words::controller).to_owned(),
            words::stop(status.stop.as_ref()),
            words::authority(status.authority, status.lease.as_ref()),
            tip(status),
        ]);
    }
    table
}

/// The tip of the first chain; further ones are in `armada watch` and `--json`.
fn tip(status: &CellRobotStatus) -> String {
    status.tcp.first().map_or_else(|| "-".to_owned(), |tcp| words::pose(&tcp.pose))
}

fn timing(report: &Report) -> Table {
    let mut table = Table::new(&["robot", "control loop", "state", "age", "clock within"]);
    for (robot, status) in &report.robots {
        table.row(timing_row(robot, status));
    }
    table
}

fn timing_row(robot: &RobotName, status: &CellRobotStatus) -> Vec<String> {
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    vec![
        robot.to_string(),
        or_dash(status.control_loop.as_ref().map(words::control_loop)),
        or_dash(status.state_age_ms.map(|_| format!("{:.0} Hz", status.state_rate_hz))),
        or_dash(status.state_age_ms.map(|age| format!("{} ms", words::tidy(age, 1)))),
        or_dash(status.clock_bound_ns.map(|bound| format!("±{}", words::nanos(bound)))),
    ]
}

#[cfg(test)]
mod tests {
    use armada_model::Pose;
    use armada_protocol::messages::{
        AuthorityState, CellVerdict, CommandMode, ControllerState, LoopStatistics, Presence,
        TcpState,
    };

    use super::*;

    fn report() -> Report {
        let arm = CellRobotStatus {
            presence: Presence::Online,
            command_mode: Some(CommandMode::Jog),
            controller_state: Some(ControllerState::MotorOn),
            authority: Some(AuthorityState::Free),
            tcp: vec![TcpState::of("arm", Pose::from_translation(0.5, 0.0, 1.0))],
            state_age_ms: Some(3.25),
            state_rate_hz: 99.7,
            control_loop: Some(LoopStatistics {
                rate_hz: 999.8,
                target_rate_hz: 1000.0,
                overruns: 2,
                ..LoopStatistics::default()
            }),
            clock_bound_ns: Some(84_000),
            ..CellRobotStatus::default()
        };
        let robots = [("left_arm", arm), ("torso", CellRobotStatus::default())]
            .map(|(name, status)| (name.parse().expect("a name"), status));
        Report {
            origin: Origin::Gateway,
            cell: Some("dual_arm".to_owned()),
            verdict: CellVerdict::Degraded,
            robots: robots.into_iter().collect(),
            motions: vec![],
        }
    }

    #[test]
    fn the_whole_page_is_readable() {
        let expected = "\
cell dual_arm

robot     presence  mode  controller  stop  may command  tip: x y z  roll pitch yaw
left_arm  online    jog   motor on    -     anybody      0.500 0.000 1.000 m  0.0 0.0 0.0°
torso     not seen  -     -           -     -            -

robot     control loop                        state   age     clock within
left_arm  1000/1000 Hz, 2 overruns, 0 missed  100 Hz  3.2 ms  ±84 µs
torso     -                                   -       -       -

torso: its agent has not been seen: start it (`armada agent ROBOT.yaml`)

degraded: a robot has a fault, cannot be commanded or is not there";
        assert_eq!(render(&report()), expected);
    }

    #[test]
    fn without_the_gateway_the_first_line_says_so() {
        let report = Report { origin: Origin::Agents, cell: None, ..report() };
        assert!(render(&report).starts_with("the gateway does not answer"));
    }
}
