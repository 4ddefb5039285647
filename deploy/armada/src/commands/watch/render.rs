//! A model as a picture: pure, and in any size.

use std::time::Duration;

use armada_model::JointLimits;
use armada_protocol::messages::{JointInfo, RobotState, RobotStatus, Why, WhyCode};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Paragraph, Row, Table, Wrap};

use super::model::{Model, STALE};
use crate::commands::tool::carried;
use crate::motion::fraction;
use crate::output::bar;
use crate::words;

/// Width of the scale on which a joint's position is shown.
const SCALE: usize = 21;
/// Share of its range next to a limit in which a joint is shown in yellow.
const NEAR: f64 = 0.05;

const KEYS: &str = " STOP: s   halt: h   help: ?   quit: q ";

const HELP: &str = "\
s      STOP this robot and keep it stopped until `armada reset`
h      halt: ramp to standstill, ready for the next command
?      show or hide this
q      quit; the robot goes on with what it does

The stop is an operational stop over a network, never a rated
safety function: where people can be hurt, press the robot's
emergency stop.";

/// Draws the model as of `now`.
pub(super) fn render(frame: &mut Frame<'_>, model: &Model, now: Duration) {
    // The footer with the stop is given its row before anything else.
    let [body, footer] =
        Layout::vertical([Constraint::Fill(1), Constraint::Length(1)]).areas(frame.area());
    frame.render_widget(Paragraph::new(KEYS).style(footer_style()), footer);
    let joints = model.info.as_ref().map_or(0, |info| info.joints.len());
    let rows = u16::try_from(joints).unwrap_or(u16::MAX).saturating_add(3);
    let [head, table, motion, alerts, message] = Layout::vertical([
        Constraint::Length(6),
        Constraint::Length(rows),
        Constraint::Length(1),
        Constraint::Fill(1),
        Constraint::Length(1),
    ])
    .areas(body);
    frame.render_widget(header(model, now), head);
    draw_joints(frame, model, table);
    frame.render_widget(Paragraph::new(motion_line(model)), motion);
    frame.render_widget(Paragraph::new(alert_lines(model)).wrap(Wrap { trim: false }), alerts);
    frame.render_widget(Paragraph::new(model.message.as_str()), message);
    if model.help {
        draw_help(frame, body);
    }
}

fn footer_style() -> Style {
    Style::new().fg(Color::White).bg(Color::Red).add_modifier(Modifier::BOLD)
}

fn header(model: &Model, now: Duration) -> Paragraph<'_> {
    let kind = model
        .info
        .as_ref()
        .map_or_else(String::new, |info| format!(" {} {}", info.vendor, info.model));
    let block = Block::bordered().title(format!(" {}{kind} ", model.robot));
    let lines = match &model.state {
        Some(state) => state_lines(model, state, now),
        None => vec![Line::styled("no state yet", Style::new().fg(Color::Yellow))],
    };
    Paragraph::new(lines).block(block)
}

fn state_lines<'a>(model: &Model, state: &'a RobotState, now: Duration) -> Vec<Line<'a>> {
    let flags: Vec<_> = state.flags.names().collect();
    let mut lines = vec![
        Line::from(vec![
            Span::styled(words::mode(state.command_mode), Style::new().bold()),
            Span::raw(format!(
                "  {}  {}  epoch {}",
                words::controller(state.controller_state),
                words::operational(state.operational_mode),
                state.epoch
            )),
        ]),
        Line::raw(format!("flags: {}", flags.join(" "))),
        timing_line(model, now),
    ];
    lines.extend(state.tcp.iter().map(|tcp| {
        let speed = words::speed(tcp.twist.as_ref());
        let text = format!("{}: {}  {speed}", tcp.chain, words::pose(&tcp.pose));
        Line::raw(text.trim_end().to_owned())
    }));
    lines
}

fn timing_line<'a>(model: &Model, now: Duration) -> Line<'a> {
    let age = model.age(now).unwrap_or_default();
    let style = if age > STALE { Style::new().fg(Color::Red).bold() } else { Style::new() };
    let mut spans = vec![Span::styled(
        format!("state {:.0} Hz, {} ms old", model.rate_hz(now), age.as_millis()),
        style,
    )];
    if let Some(status) = &model.status {
        let timing = &status.control_loop;
        spans.push(Span::raw(format!(
            "  loop {}, {}",
            words::control_loop(timing),
            words::scheduling(timing.scheduling)
        )));
    }
    Line::from(spans)
}

fn draw_joints(frame: &mut Frame<'_>, model: &Model, area: Rect) {
    let (Some(info), Some(state)) = (&model.info, &model.state) else { return };
    let rows = info.joints.iter().enumerate().map(|(index, joint)| joint_row(joint, state, index));
    let header =
        Row::new(["joint", "between its limits", "position", "command", "velocity", "effort"])
            .style(Style::new().bold());
    let widths = [
        Constraint::Max(20),
        Constraint::Length(SCALE as u16),
        Constraint::Length(12),
        Constraint::Length(9),
        Constraint::Length(9),
        Constraint::Length(9),
    ];
    frame.render_widget(Table::new(rows, widths).header(header).block(Block::bordered()), area);
}

fn joint_row<'a>(joint: &'a JointInfo, state: &RobotState, index: usize) -> Row<'a> {
    let position = state.joint_position_rad.get(index).copied();
    let value = |value: Option<&f64>, decimals| {
        value.map_or_else(|| "-".to_owned(), |&value| words::tidy(value, decimals))
    };
    let position_text = position.map_or_else(
        || "-".to_owned(),
        |position| format!("{} {}", words::tidy(position, 4), words::unit(joint.joint_type)),
    );
    Row::new([
        joint.name.clone(),
        position.map_or_else(String::new, |position| scale(position, &joint.limits)),
        position_text,
        value(state.joint_position_command_rad.get(index), 4),
        value(state.joint_velocity_rad_s.get(index), 4),
        value(state.joint_effort_nm.get(index), 2),
    ])
    .style(position.map_or_else(Style::new, |position| limit_style(position, &joint.limits)))
}

/// Where the position lies between the limits: `├──●────┤`.
fn scale(position: f64, limits: &JointLimits) -> String {
    let (Some(lower), Some(upper)) = (limits.lower, limits.upper) else {
        return "no limits".to_owned();
    };
    let inside = SCALE - 2;
    let share = fraction(position - lower, upper - lower);
    let at = (share * (inside - 1) as f64).round() as usize;
    let marks: String = (0..inside).map(|place| if place == at { '●' } else { '─' }).collect();
    format!("├{marks}┤")
}

fn limit_style(position: f64, limits: &JointLimits) -> Style {
    let (Some(lower), Some(upper)) = (limits.lower, limits.upper) else { return Style::new() };
    let margin = (upper - lower) * NEAR;
    if !limits.contains(position) {
        Style::new().fg(Color::Red).bold()
    } else if position < lower + margin || position > upper - margin {
        Style::new().fg(Color::Yellow)
    } else {
        Style::new()
    }
}

fn motion_line(model: &Model) -> Line<'_> {
    let Some(motion) = model.state.as_ref().and_then(|state| state.motion) else {
        return Line::raw("no motion");
    };
    let done = fraction(motion.elapsed_s, motion.duration_s);
    let ratio = model.state.as_ref().map_or(1.0, |state| state.speed_ratio);
    let line = format!(
        "motion {} {:3.0} %  {:.1}/{:.1} s  waypoint {}  {}",
        bar(done, 30),
        done * 100.0,
        motion.elapsed_s,
        motion.duration_s,
        motion.waypoint,
        words::pace(&motion, ratio)
    );
    Line::raw(line.trim_end().to_owned())
}

fn alert_lines(model: &Model) -> Vec<Line<'_>> {
    let mut lines = model.status.as_ref().map_or_else(Vec::new, status_lines);
    if let Some(info) = &model.info {
        let loaded = info.equipment.iter().filter(|chain| chain.tool.is_some());
        lines.extend(loaded.map(|chain| Line::raw(carried(chain))));
    }
    lines
}

fn status_lines(status: &RobotStatus) -> Vec<Line<'_>> {
    let alarm = Style::new().fg(Color::Red).bold();
    let mut lines = Vec::new();
    if let Some(stop) = &status.stop {
        for latched in &stop.stops {
            lines.push(Line::styled(
                format!(
                    "STOPPED ({:?}, {}) by {}: {}",
                    latched.level,
                    words::stage(stop.stage),
                    latched.source,
                    latched.reason
                ),
                alarm,
            ));
        }
    }
    for fault in &status.faults {
        let code = words::wire_name(fault.code);
        lines.push(Line::styled(format!("FAULT {code}: {}", fault.message), alarm));
        lines.push(Line::raw(format!("  {}", words::remedy(&status.robot, fault))));
    }
    lines.push(Line::raw(format!("may command: {}", who_may_command(status))));
    let pressed = |pressed| if pressed { alarm } else { Style::new() };
    for source in &status.stop_sources {
        let text = format!("stop source {}", words::stop_source(source));
        lines.push(Line::styled(text, pressed(source.pressed)));
    }
    lines.extend(others(status).map(|why| Line::raw(format!("why: {}", why.message))));
    if let Some(stream) = &status.stream {
        lines.push(Line::raw(words::stream(stream)));
    }
    lines.extend(status.next.iter().map(|next| Line::raw(format!("next: {next}"))));
    lines
}

fn who_may_command(status: &RobotStatus) -> String {
    let mut text = words::authority(Some(status.authority), status.lease.as_ref());
    if let Some(reason) = status.lease.as_ref().and_then(|lease| lease.reason.as_ref()) {
        text.push_str(&format!(", who took it: {reason}"));
    }
    text
}

/// The reasons that have no line of their own.
fn others(status: &RobotStatus) -> impl Iterator<Item = &Why> {
    let own = [
        WhyCode::Stopped,
        WhyCode::StopSource,
        WhyCode::Faulted,
        WhyCode::DrivenBy,
        WhyCode::LeaseStale,
    ];
    status.why.iter().filter(move |why| !own.contains(&why.code))
}

fn draw_help(frame: &mut Frame<'_>, area: Rect) {
    let width = area.width.min(66);
    let height = area.height.min(10);
    let place = Rect {
        x: area.x + (area.width - width) / 2,
        y: area.y + (area.height - height) / 2,
        width,
        height,
    };
    frame.render_widget(Clear, place);
    frame.render_widget(Paragraph::new(HELP).block(Block::bordered().title(" keys ")), place);
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::AuthorityState;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    use super::super::model::tests::{full_model, state, vector};
    use super::*;

    fn drawn(model: &Model, width: u16, height: u16, now: Duration) -> Vec<String> {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("in memory");
        terminal.draw(|frame| render(frame, model, now)).expect("in memory");
        let buffer = terminal.backend().buffer();
        let row = |y| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>();
        (0..height).map(|y| row(y).trim_end().to_owned()).collect()
    }

    #[test]
    fn the_whole_screen_shows_joints_mode_motion_faults_and_the_stop() {
        let screen = drawn(&full_model(), 86, 18, Duration::from_secs(1));
        let expected = [
            "┌ left_arm sim six-axis ─────────────────────────────────────────────────────────────┐",
            "│trajectory  motor on  automatic  epoch 4                                            │",
            "│flags: enabled ready                                                                │",
            "│state 100 Hz, 0 ms old  loop 500/500 Hz, 7 overruns, 0 missed, SCHED_FIFO 80        │",
            "│arm: 0.500 0.000 1.000 m  0.0 0.0 0.0°                                              │",
            "└────────────────────────────────────────────────────────────────────────────────────┘",
            "┌────────────────────────────────────────────────────────────────────────────────────┐",
            "│joint               between its limits    position     command   velocity  effort   │",
            "│shoulder            ├──────────────●────┤ 0.5000 rad   0.5100    0.1000    -        │",
            "│wrist               no limits             -0.2500 rad  -0.2500   0.0000    -        │",
            "└────────────────────────────────────────────────────────────────────────────────────┘",
            "motion ████████░░░░░░░░░░░░░░░░░░░░░░  25 %  1.0/4.0 s  waypoint 3",
            "FAULT tracking error: joint shoulder: 0.3 rad behind",
            "  `armada reset-errors left_arm` clears it",
            "may command: anybody",
            "next: reset_errors when the cause is gone",
            "",
            " STOP: s   halt: h   help: ?   quit: q",
        ];
        assert_eq!(screen, expected);
    }

    #[test]
    fn no_size_panics_and_the_stop_is_in_the_last_row_of_all() {
        let mut model = full_model();
        model.help = true;
        for (width, height) in
            (0..=20).flat_map(|width| (0..=20).map(move |height| (width * 5, height)))
        {
            let screen = drawn(&model, width, height, Duration::from_secs(1));
            if width >= 10 && height >= 1 {
                let last = screen.last().expect("a row");
                assert!(last.starts_with(" STOP: s"), "{width}x{height}: {last:?}");
            }
        }
    }

    #[test]
    fn an_empty_model_says_that_nothing_has_come() {
        let model = Model::new("torso".parse().expect("a name"));
        let screen = drawn(&model, 40, 12, Duration::ZERO);
        assert!(screen[1].contains("no state yet"), "{screen:#?}");
    }

    #[test]
    fn a_state_of_fewer_joints_than_described_is_shown_without_them() {
        let mut model = full_model();
        let short = RobotState { joint_position_rad: vector(&[0.5]), ..state() };
        model.take_state(Duration::from_secs(1), short);
        let screen = drawn(&model, 86, 17, Duration::from_secs(1));
        let cells: Vec<_> = screen[9].split_whitespace().collect();
        assert_eq!(cells, ["│wrist", "-", "-0.2500", "0.0000", "-", "│"]);
    }

    #[test]
    fn a_joint_at_or_beyond_a_limit_stays_on_its_scale() {
        let limits = JointLimits { lower: Some(0.0), upper: Some(1.0), ..JointLimits::default() };
        for (position, place) in [(-5.0, 1), (0.0, 1), (1.0, SCALE - 2), (9.0, SCALE - 2)] {
            let at = scale(position, &limits).chars().position(|c| c == '●');
            assert_eq!(at, Some(place), "{position}");
        }
    }

    #[test]
    fn who_may_command_stop_sources_and_other_reasons_have_their_lines() {
        let text = include_str!("../../../../../protocol/golden/robot_status.json");
        let mut status: RobotStatus = serde_json::from_str(text).expect("the golden sample");
        status.authority = AuthorityState::Held;
        status.why.push(Why {
            code: WhyCode::DegradedLink,
            message: "the stream starves".to_owned(),
            who: None,
            since_ns: None,
        });
        let lines: Vec<String> = status_lines(&status).iter().map(Line::to_string).collect();
        for expected in [
            "may command: planner (operator) 0.8 s, and gripper-ui, who took it: planner hangs",
            "stop source door_1 PRESSED or silent, heard 42 ms ago",
            "why: the stream starves",
        ] {
            assert!(lines.iter().any(|line| line == expected), "{expected}: {lines:#?}");
        }
        assert!(!lines.iter().any(|line| line == "why: stop L1 by door_1: door opened"));
    }

    #[test]
    fn help_covers_the_body_but_not_the_stop() {
        let mut model = full_model();
        model.help = true;
        let screen = drawn(&model, 86, 17, Duration::from_secs(1));
        assert!(screen.iter().any(|row| row.contains("never a rated")), "{screen:#?}");
        assert!(screen[16].starts_with(" STOP: s"));
    }
}
