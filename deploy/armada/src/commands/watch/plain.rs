//! A robot as lines, for logs and scripts.

use std::time::Duration;

use armada_protocol::messages::{AuthorityState, WhyCode};
use serde_json::json;
use tokio::time::{Instant, MissedTickBehavior, interval_at};

use super::feed::Feed;
use super::model::Model;
use crate::clock;
use crate::exit::Exit;
use crate::motion::fraction;
use crate::output::Output;
use crate::words;

/// Pause between looks at what has come, so that its age is known.
const LOOK_PAUSE: Duration = Duration::from_millis(20);
/// How long the first line waits for a first state.
const FIRST_PAUSE: Duration = Duration::from_millis(300);

/// Writes a line or a JSON object each `interval` until Ctrl-C, or until nobody reads.
pub(super) async fn run(mut feed: Feed, out: &Output, interval: Duration) -> anyhow::Result<Exit> {
    let first = Instant::from_std(clock::now() + FIRST_PAUSE);
    let mut lines = interval_at(first, interval);
    lines.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut looks = tokio::time::interval(LOOK_PAUSE);
    looks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let interrupted = tokio::signal::ctrl_c();
    tokio::pin!(interrupted);
    while !out.is_closed() {
        tokio::select! {
            _ = &mut interrupted => break,
            _ = looks.tick() => feed.update().await?,
            _ = lines.tick() => {
                feed.update().await?;
                write(&feed, out)?;
            }
        }
    }
    Ok(Exit::Success)
}

fn write(feed: &Feed, out: &Output) -> anyhow::Result<()> {
    let now = feed.now();
    if out.is_json() {
        out.json_line(&object(&feed.model, now))
    } else {
        out.line(line(&feed.model, now))
    }
}

fn object(model: &Model, now: Duration) -> serde_json::Value {
    json!({
        "robot": model.robot,
        "state_age_ms": model.age(now).map(|age| age.as_secs_f64() * 1e3),
        "state_rate_hz": model.rate_hz(now),
        "state": model.state,
        "status": model.status,
    })
}

fn line(model: &Model, now: Duration) -> String {
    let (Some(state), Some(age)) = (&model.state, model.age(now)) else {
        return format!("{}: no state yet", model.robot);
    };
    let positions: Vec<String> =
        state.joint_position_rad.iter().map(|&position| words::tidy(position, 4)).collect();
    let mut line = format!(
        "{}: {} {}, joints [{}], {:.0} Hz, {} ms old",
        model.robot,
        words::mode(state.command_mode),
        words::controller(state.controller_state),
        positions.join(" "),
        model.rate_hz(now),
        age.as_millis()
    );
    if let Some(motion) = state.motion {
        let done = fraction(motion.elapsed_s, motion.duration_s) * 100.0;
        line.push_str(&format!(", motion {done:.0} %"));
        let pace = words::pace(&motion, state.speed_ratio);
        if !pace.is_empty() {
            line.push_str(&format!(" ({pace})"));
        }
    }
    if let Some(status) = &model.status {
        if status.stop.is_some() {
            line.push_str(", STOPPED");
        }
        if status.lease.is_some() || status.authority == AuthorityState::Local {
            let who = words::authority(Some(status.authority), status.lease.as_ref());
            line.push_str(&format!(", commanded by {who}"));
        }
        if let Some(stream) = &status.stream {
            line.push_str(&format!(", {}", words::stream(stream)));
        }
        for fault in &status.faults {
            line.push_str(&format!(", FAULT {}", fault.message));
        }
        for why in &status.why {
            if matches!(why.code, WhyCode::StopSource | WhyCode::DegradedLink) {
                line.push_str(&format!(", {}", why.message));
            }
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::RobotStatus;

    use super::super::model::tests::full_model;
    use super::*;

    #[test]
    fn a_line_tells_mode_joints_rate_motion_and_faults() {
        assert_eq!(
            line(&full_model(), Duration::from_secs(1)),
            "left_arm: trajectory motor on, joints [0.5000 -0.2500], 100 Hz, 0 ms old, \
             motion 25 %, FAULT joint shoulder: 0.3 rad behind"
        );
    }

    #[test]
    fn who_commands_and_what_keeps_the_robot_are_in_the_line() {
        let mut model = full_model();
        let text = include_str!("../../../../../protocol/golden/robot_status.json");
        let mut status: RobotStatus = serde_json::from_str(text).expect("the golden sample");
        status.faults.clear();
        status.stream = None;
        status.authority = AuthorityState::Held;
        status.why[0].code = WhyCode::StopSource;
        status.why[0].message = "door_1 is pressed".to_owned();
        model.take_status(status);
        let line = line(&model, Duration::from_secs(1));
        let end = ", STOPPED, commanded by planner (operator) 0.8 s, and gripper-ui, \
                   door_1 is pressed";
        assert!(line.ends_with(end), "{line}");
    }

    #[test]
    fn before_the_first_state_the_line_says_so() {
        let model = Model::new("torso".parse().expect("a name"));
        assert_eq!(line(&model, Duration::ZERO), "torso: no state yet");
        assert!(object(&model, Duration::ZERO)["state"].is_null());
    }
}
