//! The condition of the cell: what is in it and when it is published.

use std::collections::BTreeMap;
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{CellMotionStatus, CellStatus, CellVerdict};
use uuid::Uuid;

use super::robot::RobotRecord;

/// Least time between two statuses, so that a burst of changes is one message.
const COALESCE: Duration = Duration::from_millis(20);
/// Longest time between two statuses.
const PERIOD: Duration = Duration::from_secs(1);

/// When the status goes out next, and its number.
#[derive(Debug)]
pub(super) struct StatusSchedule {
    seqno: u64,
    changed: bool,
    published: Option<MonoTime>,
}

impl StatusSchedule {
    pub(super) const fn new() -> Self {
        Self { seqno: 0, changed: true, published: None }
    }

    /// Something that others should know at once is different.
    pub(super) const fn note_change(&mut self) {
        self.changed = true;
    }

    pub(super) fn due(&self) -> MonoTime {
        let pause = if self.changed { COALESCE } else { PERIOD };
        self.published.map_or(MonoTime::ZERO, |published| published + pause)
    }

    /// The number of the status that goes out now.
    pub(super) const fn publish(&mut self, now: MonoTime) -> u64 {
        let seqno = self.seqno;
        self.seqno += 1;
        self.changed = false;
        self.published = Some(now);
        seqno
    }
}

/// Who says it, which one it is, and when.
pub(super) struct Head<'a> {
    pub(super) cell: &'a str,
    pub(super) boot_id: Uuid,
    pub(super) seqno: u64,
    pub(super) now: MonoTime,
}

pub(super) fn report(
    head: &Head<'_>,
    robots: &BTreeMap<RobotName, RobotRecord>,
    motions: Vec<CellMotionStatus>,
) -> CellStatus {
    CellStatus {
        cell: head.cell.to_owned(),
        boot_id: head.boot_id,
        seqno: head.seqno,
        stamp_ns: head.now,
        verdict: verdict(robots, !motions.is_empty()),
        robots: robots.iter().map(|(name, r)| (name.clone(), r.report(head.now))).collect(),
        motions,
    }
}

/// The worst that can be said of any robot.
fn verdict(robots: &BTreeMap<RobotName, RobotRecord>, has_motion: bool) -> CellVerdict {
    if !robots.values().all(RobotRecord::is_sound) {
        CellVerdict::Degraded
    } else if robots.values().any(|robot| !robot.latched_stops().is_empty()) {
        CellVerdict::Stopped
    } else if has_motion || robots.values().any(RobotRecord::is_moving) {
        CellVerdict::Moving
    } else {
        CellVerdict::Ready
    }
}
