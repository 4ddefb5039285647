//! The table of keys. No other file spells a key.
//!
//! From it come `KEYS.md` and `keys.json` (by the example `generate_keys`), and every key that
//! agents, gateway and clients use.

use serde::Serialize;

use crate::RobotName;
use crate::qos::Channel;

/// One row of the table.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Key {
    /// Name of the row.
    pub name: &'static str,
    /// Key expression; `{…}` stands for one chunk, `{method}` for the rest.
    pub pattern: &'static str,
    /// How it is used.
    pub kinds: &'static [Kind],
    /// Who sends or answers.
    pub owner: Owner,
    /// Message type; `-` for none.
    pub message: &'static str,
    /// Its urgency.
    pub channel: Channel,
    /// What it is, for people.
    pub notes: &'static str,
}

/// How a key is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A liveliness token.
    Liveliness,
    /// Samples, newest counts.
    Published,
    /// Samples, kept for late joiners, gaps detected.
    Cached,
    /// Answers queries.
    Queryable,
    /// Takes samples.
    Subscribed,
}

/// Who sends on or answers at a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Owner {
    /// The agent of the robot.
    Agent,
    /// The gateway of the cell.
    Gateway,
    /// Any client.
    Client,
}

impl Key {
    /// The key with its placeholders filled in order; those not given become `*`.
    ///
    /// A part is taken as it is: names of robots, ids and methods are valid chunks.
    #[must_use]
    pub fn with(&self, parts: &[&str]) -> String {
        let mut parts = parts.iter();
        let chunks = self.pattern.split('/').map(|chunk| {
            if chunk.starts_with('{') { parts.next().copied().unwrap_or("*") } else { chunk }
        });
        chunks.collect::<Vec<_>>().join("/")
    }

    /// The key with every placeholder open.
    #[must_use]
    pub fn any(&self) -> String {
        self.with(&[])
    }

    /// The key of this robot.
    #[must_use]
    pub fn of(&self, robot: &RobotName) -> String {
        self.with(&[robot.as_str()])
    }
}

/// The robot that a key `robots/{robot}/…` belongs to.
#[must_use]
pub fn robot_of(key: &str) -> Option<RobotName> {
    let mut chunks = key.split('/');
    if chunks.next() != Some("robots") {
        return None;
    }
    chunks.next()?.parse().ok()
}

macro_rules! keys {
    ($($(#[doc = $doc:literal])* $name:ident = $pattern:literal, [$($kind:ident)+], $owner:ident, $message:literal, $channel:ident;)+) => {
        $($(#[doc = $doc])* pub const $name: Key = Key {
            name: stringify!($name),
            pattern: $pattern,
            kinds: &[$(Kind::$kind),+],
            owner: Owner::$owner,
            message: $message,
            channel: Channel::$channel,
            notes: concat!($($doc),*),
        };)+

        /// Every row, in the order of the documentation.
        pub const ALL: &[Key] = &[$($name),+];
    };
}

keys! {
    /// Presence of the agent; no stop depends on it.
    ROBOT_ALIVE = "robots/{robot}/alive", [Liveliness], Agent, "-", Report;
    /// Identity, joints, limits, chains, capabilities, methods, URDF text.
    ROBOT_INFO = "robots/{robot}/info", [Cached Queryable], Agent, "RobotInfo", Report;
    /// Measured and commanded state, at the robot's state rate.
    ROBOT_STATE = "robots/{robot}/state", [Published], Agent, "RobotState", State;
    /// The state at a lower rate, for the rates of `RobotInfo.state_classes_hz`.
    ROBOT_STATE_AT = "robots/{robot}/state/{rate_hz}", [Published], Agent, "RobotState", State;
    /// Mode, latched stop, faults, motion, loop timing, what may be done next; on change and at 1 Hz.
    ROBOT_STATUS = "robots/{robot}/status", [Cached Queryable], Agent, "RobotStatus", Report;
    /// The state in the shape of ROS; published with the state.
    ROBOT_JOINT_STATES = "robots/{robot}/joint_states", [Published], Agent, "JointState", State;
    /// The audit trail, numbered without gaps.
    ROBOT_EVENTS = "robots/{robot}/events", [Cached], Agent, "Event", Report;
    /// Status of a motion: on change and at 10 Hz while running; queryable after its end.
    ROBOT_MOTION = "robots/{robot}/motions/{id}", [Published Queryable], Agent, "MotionStatus", Progress;
    /// Streamed joint positions, in mode `position_command`.
    ROBOT_STREAM_POSITION = "robots/{robot}/stream/position", [Subscribed], Agent, "StreamCommand", Stream;
    /// Streamed joint velocities, in mode `velocity_command`.
    ROBOT_STREAM_VELOCITY = "robots/{robot}/stream/velocity", [Subscribed], Agent, "StreamCommand", Stream;
    /// Streamed velocities of a tool, in mode `velocity_command`.
    ROBOT_STREAM_TWIST = "robots/{robot}/stream/twist", [Subscribed], Agent, "StreamTwist", Stream;
    /// Streamed commands to any joints by name, in mode `position_command` or `velocity_command`.
    ROBOT_COMMAND = "robots/{robot}/command", [Subscribed], Agent, "JointCommand", Stream;
    /// Requests to the agent, one query and one answer.
    ROBOT_RPC = "robots/{robot}/rpc/{method}", [Queryable], Agent, "per method", Rpc;
    /// Stops this robot; needs no lease and is never refused.
    ROBOT_STOP = "robots/{robot}/stop", [Queryable Subscribed], Agent, "StopRequest -> StopAck", Stop;
    /// Stages of a stop: received, commanded, standstill, drives off.
    ROBOT_STOP_ACK = "robots/{robot}/stop/ack", [Published], Agent, "StopAck", Stop;
    /// The agent's clock, for measuring the offset to it.
    ROBOT_CLOCK = "robots/{robot}/clock", [Queryable], Agent, "ClockSample", Rpc;
    /// Stops every robot; published by any client, taken by every agent and the gateway.
    CELL_STOP = "cell/stop", [Published], Client, "StopRequest", Stop;
    /// Whether a source of stops is pressed: agents ask it again and again, silence is a press.
    CELL_STOP_SOURCE = "cell/stop_sources/{source}", [Queryable], Client, "StopChallenge -> StopCheckIn", Stop;
    /// Presence of the gateway.
    CELL_GATEWAY_ALIVE = "cell/gateway/alive", [Liveliness], Gateway, "-", Report;
    /// The robots of the cell and where they stand.
    CELL_INFO = "cell/info", [Cached Queryable], Gateway, "CellInfo", Report;
    /// Condition of every robot and the cell's verdict; on change and at 1 Hz.
    CELL_STATUS = "cell/status", [Cached Queryable], Gateway, "CellStatus", Report;
    /// World poses of the links that moved, at 30 Hz.
    CELL_FRAMES = "cell/frames", [Published], Gateway, "CellFrames", State;
    /// Every robot's events and the gateway's own in one stream, numbered without gaps.
    CELL_EVENTS = "cell/events", [Cached], Gateway, "Event", Report;
    /// Status of a motion of several robots.
    CELL_MOTION = "cell/motions/{id}", [Published Queryable], Gateway, "CellMotionStatus", Progress;
    /// A robot is ready to start with its partners.
    GROUP_GO = "cell/groups/{group}/go/{robot}", [Published Subscribed], Agent, "GroupGo", Stop;
    /// Where a robot is on the common path, every 20 ms, for its partners.
    GROUP_HEARTBEAT = "cell/groups/{group}/heartbeat/{robot}", [Published Subscribed], Agent, "GroupHeartbeat", Stream;
    /// A robot stops, and its partners are to do the same.
    GROUP_ABORT = "cell/groups/{group}/abort/{robot}", [Published Subscribed], Agent, "GroupAbort", Stop;
    /// Requests to the gateway, one query and one answer.
    CELL_RPC = "cell/rpc/{method}", [Queryable], Gateway, "per method", Rpc;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placeholders_are_filled_in_order_and_the_rest_stays_open() {
        assert_eq!(ROBOT_RPC.with(&["left_arm", "halt"]), "robots/left_arm/rpc/halt");
        assert_eq!(ROBOT_RPC.with(&["left_arm"]), "robots/left_arm/rpc/*");
        assert_eq!(ROBOT_STATE.any(), "robots/*/state");
        assert_eq!(CELL_STOP.any(), "cell/stop");
    }

    #[test]
    fn the_robot_of_a_key_is_its_second_chunk() {
        assert_eq!(robot_of("robots/torso/state").map(String::from), Some("torso".into()));
        assert_eq!(robot_of("cell/stop"), None);
        assert_eq!(robot_of("robots/*/state"), None);
    }

    #[test]
    fn stops_and_words_of_partners_are_alone_in_their_priority() {
        for key in ALL {
            let ends_motion = ["Stop", "GroupGo", "GroupAbort"];
            let is_stop = ends_motion.iter().any(|kind| key.message.starts_with(kind));
            assert_eq!(key.channel == Channel::Stop, is_stop, "{}", key.pattern);
        }
    }
}
