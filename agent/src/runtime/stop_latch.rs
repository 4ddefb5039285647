//! The latched stop on the board: what it is, what is kept of it, and what its reset needs.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{
    Denial, DenialCode, LatchedStop, ResetNeeds, ResetParams, ResetZone, StopLatch, StopLevel,
    StopStage,
};
use armada_protocol::signature::SigningKey;
use uuid::Uuid;

use super::board::Board;
use super::stop_file::{Found, Kept};

/// Source of the stop that an emergency stop of the controller is.
pub(super) const CONTROLLER: &str = "controller";
/// Source of the stop that follows an agent which died.
const AGENT_LOST: &str = "agent_lost";
/// How long an acknowledgement at the arm is good for.
const ACKNOWLEDGED_FOR: Duration = Duration::from_secs(10);

/// What a reset needs besides the list of stops.
#[derive(Clone, Debug, Default)]
pub(super) struct ResetRules {
    pub(super) zone: ResetZone,
    /// What it has to be signed with, if it has to.
    pub(super) key: Option<SigningKey>,
}

/// A latched stop as the agent knows it.
#[derive(Debug)]
pub(super) struct StopRecord {
    pub(super) level: StopLevel,
    pub(super) stops: Vec<ReceivedStop>,
    pub(super) stage: StopStage,
    /// Names the state of the gate that a reset may open.
    pub(super) gate_count: u64,
    /// To be returned in the reset.
    pub(super) nonce: Uuid,
}

/// One stop of a [`StopRecord`].
#[derive(Clone, Debug)]
pub(super) struct ReceivedStop {
    pub(super) stop: LatchedStop,
    pub(super) received: MonoTime,
}

impl StopRecord {
    /// A stop that was latched before this agent began, or none.
    pub(super) fn from_kept(kept: &Kept, gate_count: u64, received: MonoTime) -> Option<Self> {
        let stops = kept.stops.iter().map(|stop| ReceivedStop { stop: stop.clone(), received });
        Some(Self {
            level: kept.level?,
            stops: stops.collect(),
            stage: StopStage::Received,
            gate_count,
            nonce: Uuid::new_v4(),
        })
    }

    fn last_received(&self) -> MonoTime {
        self.stops.iter().map(|stop| stop.received).max().unwrap_or_default()
    }
}

/// What is latched at the start, by what was found.
pub(super) fn at_start(found: Found) -> Kept {
    let (mut kept, news) = match found {
        Found::Nothing | Found::Kept { died: false, kept: Kept { level: None, .. } } => {
            return Kept::default();
        }
        Found::Kept { kept, died: false } => return kept,
        Found::Kept { kept, died: true } => {
            let reason = "the agent before this one died without bringing the robot to rest";
            (kept, (AGENT_LOST, StopLevel::L2, reason.to_owned()))
        }
        Found::Unreadable(problem) => {
            let reason = format!("what was latched before is not known: {problem}");
            (Kept::default(), ("latch file unreadable", StopLevel::L1, reason))
        }
    };
    let (source, level, reason) = news;
    // An agent that dies again and again is one reason to look, not many.
    if !kept.stops.iter().any(|stop| stop.source == source) {
        let (stop_id, source) = (Uuid::now_v7(), source.to_owned());
        kept.stops.push(LatchedStop { stop_id, source, level, reason });
    }
    kept.level = kept.level.max(Some(level));
    kept
}

/// What is kept, with a stop that nobody wrote down.
pub(super) fn untold(mut kept: Kept, level: StopLevel, reason: &str) -> Kept {
    kept.stops.push(untold_stop(level, reason));
    kept.level = kept.level.max(Some(level));
    kept
}

/// A stop of which nothing is known but that it closed the gate.
pub(super) fn untold_stop(level: StopLevel, reason: &str) -> LatchedStop {
    let (stop_id, source) = (Uuid::now_v7(), "unrecorded stops".to_owned());
    LatchedStop { stop_id, source, level, reason: reason.to_owned() }
}

impl Board {
    /// The latched stop as clients are told of it.
    pub(super) fn latch(&self, now: MonoTime) -> Option<StopLatch> {
        let record = self.stop.as_ref()?;
        let reset = ResetNeeds {
            nonce: record.nonce,
            signed: self.reset_rules.key.is_some(),
            zone: self.reset_rules.zone,
            acknowledged: self.is_acknowledged(record, now),
        };
        let stops = record.stops.iter().map(|received| received.stop.clone()).collect();
        Some(StopLatch { level: record.level, stops, stage: record.stage, reset })
    }

    /// What is to be kept of it while no agent runs.
    pub(super) fn kept(&self) -> Kept {
        let Some(record) = &self.stop else { return Kept::default() };
        let stops = record.stops.iter().map(|received| received.stop.clone()).collect();
        Kept { level: Some(record.level), stops }
    }

    /// Whether this reset may clear this stop now.
    ///
    /// # Errors
    /// The denial that says what it lacks.
    pub(super) fn check_reset(
        &self,
        record: &StopRecord,
        params: &ResetParams,
        now: MonoTime,
    ) -> Result<(), Denial> {
        check_list(record, &params.stop_ids)?;
        if params.nonce != record.nonce {
            let text =
                "the nonce of the reset is not the one in the status: look at the stops again";
            return Err(Denial::new(DenialCode::StaleSequence, text).with("field", "nonce"));
        }
        let robot = &self.vocabulary.robot;
        let key = self.reset_rules.key.as_ref();
        if key.is_some_and(|key| !key.has_signed_reset(robot, self.boot_id, params)) {
            let text = format!("a reset of {robot} has to be signed with its reset key");
            return Err(Denial::new(DenialCode::InvalidArgument, text).with("field", "signature"));
        }
        if let Err(held) = self.stop_sources.check_released(now) {
            return Err(not_ready(robot, &held.to_string()).with("source", held.source_name));
        }
        self.check_controller_released(record)?;
        if !self.is_acknowledged(record, now) {
            let limit = ACKNOWLEDGED_FOR.as_secs();
            let text = format!(
                "somebody has to acknowledge at the arm, after the last stop and within {limit} s"
            );
            return Err(not_ready(robot, &text).with("zone", "manual"));
        }
        if record.stage < StopStage::Standstill {
            // Whoever stopped it waits for the proof, and drives that are to go off have to.
            return Err(not_ready(robot, "it was not measured to stand still yet"));
        }
        Ok(())
    }

    /// A button that cannot be seen is taken for pressed, if it stopped the robot.
    fn check_controller_released(&self, record: &StopRecord) -> Result<(), Denial> {
        let stopped = record.stops.iter().any(|stop| stop.stop.source == CONTROLLER);
        let text = match self.snapshot.emergency_stop {
            Some(true) => "the emergency stop of the controller is pressed",
            None if stopped => {
                "the controller is not heard, so its emergency stop may still be pressed"
            }
            _ => return Ok(()),
        };
        Err(not_ready(&self.vocabulary.robot, text).with("source", CONTROLLER))
    }

    fn is_acknowledged(&self, record: &StopRecord, now: MonoTime) -> bool {
        match self.reset_rules.zone {
            ResetZone::Remote => true,
            ResetZone::Manual => self.snapshot.acknowledged.is_some_and(|at| {
                at > record.last_received() && now.saturating_since(at) <= ACKNOWLEDGED_FOR
            }),
        }
    }
}

/// The reset has to list the latched stops: all, and none that its sender cannot have seen.
fn check_list(record: &StopRecord, listed: &[Uuid]) -> Result<(), Denial> {
    let latched: Vec<Uuid> = record.stops.iter().map(|stop| stop.stop.stop_id).collect();
    let lacking = |from: &[Uuid], of: &[Uuid]| -> Vec<String> {
        from.iter().filter(|id| !of.contains(id)).map(ToString::to_string).collect()
    };
    let missing = lacking(&latched, listed);
    let unknown = lacking(listed, &latched);
    if missing.is_empty() && unknown.is_empty() {
        return Ok(());
    }
    let text = if missing.is_empty() {
        format!("the reset lists stops that are not latched: {}", unknown.join(", "))
    } else {
        format!("the reset must list every latched stop, it lacks {}", missing.join(", "))
    };
    Err(Denial::new(DenialCode::InvalidArgument, text)
        .with("field", "stop_ids")
        .with("missing", missing)
        .with("unknown", unknown))
}

fn not_ready(robot: &RobotName, why: &str) -> Denial {
    Denial::new(DenialCode::NotReady, format!("{robot} cannot be reset: {why}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stop(number: u128, level: StopLevel) -> LatchedStop {
        let (stop_id, source) = (Uuid::from_u128(number), "test".to_owned());
        LatchedStop { stop_id, source, level, reason: String::new() }
    }

    fn sources(kept: &Kept) -> Vec<&str> {
        kept.stops.iter().map(|stop| stop.source.as_str()).collect()
    }

    #[test]
    fn what_was_latched_stays_latched_and_an_orderly_end_adds_nothing() {
        let kept = Kept { level: Some(StopLevel::L0), stops: vec![stop(1, StopLevel::L1)] };
        assert_eq!(at_start(Found::Kept { kept: kept.clone(), died: false }), kept);
        let free = Found::Kept { kept: Kept::default(), died: false };
        assert_eq!(at_start(free), Kept::default());
        assert_eq!(at_start(Found::Nothing), Kept::default());
    }

    #[test]
    fn an_agent_that_died_is_one_more_stop_however_often_it_does() {
        let died = |kept| at_start(Found::Kept { kept, died: true });
        let once = died(Kept::default());
        assert_eq!((once.level, sources(&once)), (Some(StopLevel::L2), vec!["agent_lost"]));
        assert_eq!(died(once.clone()), once);
        let before = Kept { level: Some(StopLevel::L1), stops: vec![stop(1, StopLevel::L1)] };
        let after = died(before);
        assert_eq!(
            (after.level, sources(&after)),
            (Some(StopLevel::L1), vec!["test", "agent_lost"])
        );
    }

    #[test]
    fn a_file_that_is_not_understood_is_a_stop() {
        let kept = at_start(Found::Unreadable("EOF".to_owned()));
        assert_eq!(sources(&kept), ["latch file unreadable"]);
        assert!(kept.level.is_some());
        assert!(kept.stops.iter().all(|stop| stop.reason.contains("EOF")));
    }
}
