//! Why a robot is as it is, and what may be done next: read off its status, in words for a person.
//!
//! | code | while | next |
//! |---|---|---|
//! | `not_connected` | the controller is not heard | see to it |
//! | `stopped` | a stop is latched, one for each | reset, when it is safe |
//! | `stop_source` | a source of stops is pressed or silent | release it |
//! | `faulted` | a fault is latched, one for each | its remedy |
//! | `local` | the pendant has control | give it back there |
//! | `drives_off` | drives are off | switch them on |
//! | `driven_by` | somebody holds the lease | for others: wait, or take it |
//! | `lease_stale` | the lease has run out | renew or acquire it |
//! | `moving` | a motion or a stream is in progress | wait, or halt |
//! | `waiting` | a motion is paused, or waits for its start | resume or cancel it |
//! | `degraded_link` | a stream starves, is slowed or refused | see to the link |
//! | `halted` | the mode is `halt`, and nothing above but leases is there | set a mode |
//! | `ready` | nothing above but leases is there | what the mode takes |
//!
//! In this order, which is that of their weight: a robot that is stopped and has its drives off is
//! to be reset first. Only the next steps of the first five are told while one of them is there,
//! and drives that are off come before all that needs them.

use armada_model::MonoTime;
use armada_protocol::messages::{
    ActionStatus, AuthorityState, CommandMode, Fault, FaultCode, Lease, ResetZone, RobotFlags,
    RobotStatus, StopLatch, StopStage, StreamStatistics, Why, WhyCode,
};
use uuid::Uuid;

use super::leases::title;
use super::words::scope_name;

/// What explains a status and is not in it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Known {
    /// When each latched stop came.
    pub(super) stops: Vec<(Uuid, MonoTime)>,
    /// Since when the lease has been held.
    pub(super) lease: Option<MonoTime>,
    /// Since when the pendant has had control.
    pub(super) local: Option<MonoTime>,
    /// Whether the robot is moved under a lease only.
    pub(super) lease_required: bool,
    /// Why the controller does not serve this client, if it says so.
    pub(super) link: Option<String>,
}

/// Since when reasons have been told that come with no time of their own.
#[derive(Clone, Debug, Default)]
pub(super) struct FirstTold(Vec<(WhyCode, Option<String>, MonoTime)>);

impl FirstTold {
    /// Dates reasons by when each was first told without a break, up to `now`.
    pub(super) fn date(&mut self, reasons: &mut [Why], now: MonoTime) {
        let is_of = |entry: &(WhyCode, Option<String>, MonoTime), why: &Why| {
            entry.0 == why.code && entry.1 == why.who
        };
        self.0.retain(|entry| reasons.iter().any(|why| is_of(entry, why)));
        for why in reasons.iter_mut().filter(|why| why.since_ns.is_none()) {
            let known = self.0.iter().find(|entry| is_of(entry, why)).map(|entry| entry.2);
            if known.is_none() {
                self.0.push((why.code, why.who.clone(), now));
            }
            why.since_ns = Some(known.unwrap_or(now));
        }
    }
}

/// Why the robot does not move, or for whom it does: the most important first, never empty.
pub(super) fn why(status: &RobotStatus, known: &Known) -> Vec<Why> {
    let mut reasons = Vec::new();
    reasons.extend(not_connected(status, known));
    reasons.extend(stopped(status, known));
    reasons.extend(stop_sources(status));
    reasons.extend(faulted(status));
    if status.authority == AuthorityState::Local {
        let message = "the pendant has control".to_owned();
        let who = Some("pendant".to_owned());
        reasons.push(Why { code: WhyCode::Local, message, who, since_ns: known.local });
    }
    if is_connected(status) && !status.flags.contains(RobotFlags::ENABLED) {
        reasons.push(reason(WhyCode::DrivesOff, "the drives are off"));
    }
    let leases = reasons.len();
    reasons.extend(status.lease.as_ref().map(|lease| driven_by(lease, known)));
    let after_leases = reasons.len();
    reasons.extend(moving(status));
    reasons.extend(waiting(status));
    reasons.extend(status.stream.as_ref().and_then(|stream| degraded_link(status, stream)));
    if leases == 0 && reasons.len() == after_leases {
        reasons.push(match status.command_mode {
            CommandMode::Halt => reason(WhyCode::Halted, "it is in halt: nothing is asked of it"),
            CommandMode::InvalidState => {
                reason(WhyCode::NotConnected, "nothing is known of the controller yet")
            }
            _ => reason(WhyCode::Ready, "nothing keeps it from moving"),
        });
    }
    reasons
}

/// What may be done next, in the order of the reasons.
pub(super) fn next(status: &RobotStatus, known: &Known) -> Vec<String> {
    let reasons = why(status, known);
    let wanted = |code: WhyCode| match reasons.first().map(|first| first.code) {
        Some(first) if is_grave(first) => is_grave(code),
        Some(WhyCode::DrivesOff) => code == WhyCode::DrivesOff,
        _ => true,
    };
    let mut steps = Vec::new();
    for reason in reasons.iter().filter(|reason| wanted(reason.code)) {
        for step in steps_after(reason, status, known) {
            if !steps.contains(&step) {
                steps.push(step);
            }
        }
    }
    steps
}

/// Whether nothing moves before it is put right.
const fn is_grave(code: WhyCode) -> bool {
    use WhyCode::{Faulted, Local, NotConnected, StopSource, Stopped};
    matches!(code, NotConnected | Stopped | StopSource | Faulted | Local)
}

fn steps_after(reason: &Why, status: &RobotStatus, known: &Known) -> Vec<String> {
    let robot = &status.robot;
    let who = reason.who.as_deref().unwrap_or("somebody");
    let step = match reason.code {
        WhyCode::NotConnected => {
            let step = match &known.link {
                Some(refusal) => format!("{refusal}: put that right"),
                None => "check that the controller runs and its address is right".to_owned(),
            };
            let remedy = silence(status).map(|fault| fault.remedy.clone());
            return std::iter::once(step).chain(remedy).collect();
        }
        WhyCode::Faulted => {
            let fault = status.faults.iter().find(|fault| fault.message == reason.message);
            return fault.map(|fault| fault.remedy.clone()).into_iter().collect();
        }
        WhyCode::Stopped => {
            let needs = status.stop.as_ref().map(|stop| &stop.reset);
            let at_arm = needs.is_some_and(|n| n.zone == ResetZone::Manual && !n.acknowledged);
            let first = if at_arm { "acknowledge it at the arm, " } else { "" };
            let stands = |stop: &StopLatch| stop.stage >= StopStage::Standstill;
            let wait = match status.stop.as_ref().is_some_and(stands) {
                true => "",
                false => "wait until it is measured to stand still, ",
            };
            let key = if needs.is_some_and(|needs| needs.signed) { " --key-file FILE" } else { "" };
            format!("{wait}{first}see that it is safe, then: armada reset {robot}{key}")
        }
        WhyCode::StopSource => format!("release {who}, and see that it can be heard"),
        WhyCode::Local => "give control back at the pendant".to_owned(),
        WhyCode::DrivesOff => format!("switch the drives on: armada enable {robot}"),
        WhyCode::DrivenBy => {
            let take = format!("armada lease take {robot} --role operator --reason WHY");
            format!("anybody but {who}: wait, or: {take}")
        }
        WhyCode::LeaseStale => format!("acquire the lease: armada lease hold {robot}"),
        WhyCode::Moving => format!("wait for its end, or: armada halt {robot}"),
        WhyCode::Waiting => "resume or cancel the motion, or wait for its start".to_owned(),
        WhyCode::DegradedLink => format!("see to the link of {who}"),
        WhyCode::Halted | WhyCode::Ready if known.lease_required && status.lease.is_none() => {
            format!("acquire the lease, without which it is not moved: armada lease hold {robot}")
        }
        WhyCode::Halted => "set a mode and move, or: armada move".to_owned(),
        WhyCode::Ready => match status.command_mode {
            CommandMode::Jog => "jog_freespace, or set mode halt".to_owned(),
            CommandMode::Trajectory => "execute_trajectory, or set mode halt".to_owned(),
            CommandMode::PositionCommand => {
                "stream positions under a lease, or set mode halt".to_owned()
            }
            CommandMode::VelocityCommand => {
                "stream velocities under a lease, or set mode halt".to_owned()
            }
            _ => return Vec::new(),
        },
    };
    vec![step]
}

const fn is_connected(status: &RobotStatus) -> bool {
    !status.flags.contains(RobotFlags::COMMUNICATION_FAILURE)
}

fn silence(status: &RobotStatus) -> Option<&Fault> {
    status.faults.iter().find(|fault| fault.code == FaultCode::CommunicationLost)
}

fn not_connected(status: &RobotStatus, known: &Known) -> Option<Why> {
    if is_connected(status) {
        return None;
    }
    let fault = silence(status);
    let message = match (fault, &known.link) {
        (Some(fault), _) => fault.message.clone(),
        (None, Some(refusal)) => refusal.clone(),
        (None, None) => "the controller has not been heard yet".to_owned(),
    };
    let since_ns = fault.map(|fault| fault.since_ns);
    Some(Why { since_ns, ..reason(WhyCode::NotConnected, message) })
}

fn stopped<'a>(status: &'a RobotStatus, known: &'a Known) -> impl Iterator<Item = Why> + 'a {
    let stops = status.stop.iter().flat_map(|latch| &latch.stops);
    stops.map(|stop| {
        let why = if stop.reason.is_empty() { "no reason given" } else { &stop.reason };
        let message = format!("stop {:?} by {}: {why}", stop.level, stop.source);
        let since = known.stops.iter().find(|(id, _)| *id == stop.stop_id);
        Why {
            code: WhyCode::Stopped,
            message,
            who: Some(stop.source.clone()),
            since_ns: since.map(|(_, stamp)| *stamp),
        }
    })
}

fn stop_sources(status: &RobotStatus) -> impl Iterator<Item = Why> + '_ {
    status.stop_sources.iter().filter(|source| source.pressed).map(|source| {
        let name = &source.source;
        let message = match source.age_ms {
            Some(age_ms) => format!("{name} is pressed or silent, heard {age_ms:.0} ms ago"),
            None => format!("{name} has not been heard yet, which counts as pressed"),
        };
        Why { who: Some(name.clone()), ..reason(WhyCode::StopSource, message) }
    })
}

/// The faults, but for a silence that still lasts.
fn faulted(status: &RobotStatus) -> impl Iterator<Item = Why> + '_ {
    let told = |fault: &&Fault| is_connected(status) || fault.code != FaultCode::CommunicationLost;
    status.faults.iter().filter(told).map(|fault| Why {
        since_ns: Some(fault.since_ns),
        ..reason(WhyCode::Faulted, fault.message.clone())
    })
}

fn driven_by(lease: &Lease, known: &Known) -> Why {
    let who = title(&lease.holder, lease.role);
    let (code, mut message) = if lease.stale {
        let text = format!("the lease of {who} has run out: it may renew it, anybody may have one");
        (WhyCode::LeaseStale, text)
    } else {
        let left_s = lease.remaining_ms as f64 / 1e3;
        (WhyCode::DrivenBy, format!("driven by {who} for another {left_s:.1} s"))
    };
    if let Some(reason) = &lease.reason {
        message.push_str(&format!(", who took it: {reason:?}"));
    }
    for delegate in &lease.delegates {
        let scope = scope_name(delegate.scope);
        message.push_str(&format!("; {} may command as well ({scope})", delegate.holder));
    }
    Why { code, message, who: Some(lease.holder.clone()), since_ns: known.lease }
}

fn moving(status: &RobotStatus) -> Option<Why> {
    let running = status.motion.as_ref().filter(|m| m.status == ActionStatus::Running);
    if let Some(motion) = running {
        let message = format!("it moves for {}, motion {}", motion.client, motion.id);
        let who = Some(motion.client.clone());
        return Some(Why { code: WhyCode::Moving, message, who, since_ns: motion.started_ns });
    }
    let stream = status.stream.as_ref().filter(|stream| !stream.starved)?;
    let message = format!("it follows a stream, {} samples so far", stream.taken);
    Some(Why { who: holder(status), ..reason(WhyCode::Moving, message) })
}

fn waiting(status: &RobotStatus) -> Option<Why> {
    let motion = status.motion.as_ref()?;
    let what = match motion.status {
        ActionStatus::Paused => "is paused",
        ActionStatus::Queued => "waits for its start",
        _ => return None,
    };
    let message = format!("motion {} of {} {what}", motion.id, motion.client);
    Some(Why { who: Some(motion.client.clone()), ..reason(WhyCode::Waiting, message) })
}

fn degraded_link(status: &RobotStatus, stream: &StreamStatistics) -> Option<Why> {
    let message = if stream.allowed <= 0.0 {
        format!(
            "the stream is refused: jitter {:.1} ms, loss {:.0} %",
            stream.jitter_ms,
            stream.loss * 1e2
        )
    } else if stream.starved {
        format!("the stream starves: no sample for {:.0} ms", stream.age_ms)
    } else if stream.allowed < 1.0 {
        format!(
            "the stream is slowed to {:.0} %: jitter {:.1} ms, loss {:.0} %",
            stream.allowed * 1e2,
            stream.jitter_ms,
            stream.loss * 1e2
        )
    } else {
        return None;
    };
    Some(Why { who: holder(status), ..reason(WhyCode::DegradedLink, message) })
}

fn holder(status: &RobotStatus) -> Option<String> {
    status.lease.as_ref().map(|lease| lease.holder.clone())
}

fn reason(code: WhyCode, message: impl Into<String>) -> Why {
    Why { code, message: message.into(), who: None, since_ns: None }
}

#[cfg(test)]
mod tests;
