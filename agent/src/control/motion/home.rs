//! Homing: groups of joints, one group after the other.
//!
//! ```text
//! controller:    ask --homing shown--> searching --homed--> next group .. --> complete
//!                 |                        |
//!                 +---- no effect, lost, too long ----> fault homing_failed
//! move_to_home:  a jerk-limited move of each group .. --> complete
//! ```
//!
//! While the controller searches it moves the robot itself, so no set-points are sent: their stream
//! ends, and begins anew at the measured position. That holds until the controller has
//! shown that it stopped: whatever ends the motion early asks it to, again and again.

use armada_model::{JointVector, MAX_JOINTS, MonoTime, OnlineState};
use armada_protocol::messages::{FaultCode, HomeMethod};
use serde::{Deserialize, Serialize};

use super::{Drive, End, JogMotion, Motion, Next, Source};
use crate::control::faults::fault;
use crate::control::io::{HomeOrder, Params, Refusal};
use crate::control::state::{LoopState, Tick};
use crate::drivers::{DriverRequest, Feedback, JointSet};

/// Homing in progress.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::control) struct HomeMotion {
    groups: [JointSet; MAX_JOINTS],
    /// The group in progress.
    at: usize,
    way: Way,
    ticks: u64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[expect(clippy::large_enum_variant, reason = "the loop allocates nothing")]
enum Way {
    /// The controller searches.
    Controller(Search),
    /// The loop moves to the home positions; time of the groups before this one \[s\].
    Agent { jog: JogMotion, before_s: f64 },
}

/// What is known of the search of one group.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Search {
    /// When it was first asked for.
    asked: Option<MonoTime>,
    /// Whether the controller has been seen at it.
    seen: bool,
}

/// What a search has come to.
enum Step {
    /// It is to be asked for, if that was not done a moment ago.
    Ask,
    /// It is in progress.
    Searching,
    /// Every joint of the group knows its reference.
    Done,
    /// It ended without success, or took too long: the value [s] and its limit.
    Failed { value: f64, limit: f64 },
}

impl HomeMotion {
    /// Makes ready to home, if the order makes sense for this robot.
    fn plan(order: &HomeOrder, start: &OnlineState, drive: &Drive<'_>) -> Result<Self, Refusal> {
        let groups = order.groups;
        let way = match order.method {
            HomeMethod::Controller => Way::Controller(Search::default()),
            HomeMethod::MoveToHome => {
                let all = groups.iter().fold(JointSet::NONE, |all, group| {
                    JointSet::from_bits(all.bits() | group.bits())
                });
                if let Some(joint) = first_without_home(all, drive.params) {
                    return Err(Refusal::NoHome { joint });
                }
                let first = groups.first().copied().unwrap_or_default();
                Way::Agent { jog: plan_group(first, start, drive)?, before_s: 0.0 }
            }
        };
        Ok(Self { groups, at: 0, way, ticks: 0 })
    }

    /// Whether the controller moves the robot.
    pub(super) const fn is_controllers(&self) -> bool {
        matches!(self.way, Way::Controller(_))
    }

    pub(super) fn elapsed_s(&self, period_s: f64) -> f64 {
        match &self.way {
            Way::Controller(_) => self.ticks as f64 * period_s,
            Way::Agent { jog, before_s } => before_s + jog.elapsed_s(period_s),
        }
    }

    /// As far as it is known: of a search nothing.
    pub(super) fn duration_s(&self) -> f64 {
        match &self.way {
            Way::Controller(_) => 0.0,
            Way::Agent { jog, before_s } => before_s + jog.duration_s(),
        }
    }

    /// Number of groups that are done.
    pub(super) fn groups_done(&self) -> u32 {
        u32::try_from(self.at).unwrap_or(u32::MAX)
    }

    /// The next set-point of the loop's own way.
    pub(super) fn next(&mut self, drive: &Drive<'_>) -> Next {
        let following = self.following();
        let Way::Agent { jog, before_s } = &mut self.way else { return Next::Waiting };
        match (jog.next(drive), following) {
            (Next::Last(state), Some(group)) => {
                match plan_group(group, &OnlineState::at_rest(state.position), drive) {
                    Ok(next) => {
                        *before_s += jog.duration_s();
                        *jog = next;
                        self.at += 1;
                        Next::Moving(state)
                    }
                    Err(refusal) => Next::Failed(refusal),
                }
            }
            (next, _) => next,
        }
    }

    /// What the controller is still to be asked for.
    pub(super) fn wants(&self) -> Option<DriverRequest> {
        match &self.way {
            Way::Controller(search) if !search.seen => Some(DriverRequest::Home(self.group())),
            _ => None,
        }
    }

    fn group(&self) -> JointSet {
        self.groups.get(self.at).copied().unwrap_or_default()
    }

    /// The group after the one in progress.
    fn following(&self) -> Option<JointSet> {
        self.groups.get(self.at + 1).copied().filter(|group| !group.is_empty())
    }

    /// Judges what the controller reports; goes on to the next group by itself.
    fn search(&mut self, feedback: &Feedback, now: MonoTime, params: &Params) -> Step {
        self.ticks += 1;
        let (group, following) = (self.group(), self.following());
        let Way::Controller(search) = &mut self.way else { return Step::Searching };
        let step = search.judge(group, feedback, now, params);
        if matches!(step, Step::Done) && following.is_some() {
            *search = Search::default();
            self.at += 1;
            return Step::Ask;
        }
        step
    }
}

impl Search {
    fn judge(
        &mut self,
        group: JointSet,
        feedback: &Feedback,
        now: MonoTime,
        params: &Params,
    ) -> Step {
        let Some(asked) = self.asked else {
            self.asked = Some(now);
            return Step::Ask;
        };
        let (homed, searching) =
            (feedback.homed.contains_all(group), feedback.homing.bits() & group.bits() != 0);
        self.seen |= searching;
        let (for_s, late_s) = (now.saturating_since(asked), params.request_timeout);
        let failed = |limit: std::time::Duration| Step::Failed {
            value: for_s.as_secs_f64(),
            limit: limit.as_secs_f64(),
        };
        match (searching, homed) {
            (true, _) if for_s > params.homing_timeout => failed(params.homing_timeout),
            (true, _) => Step::Searching,
            (false, true) if self.seen => Step::Done,
            (false, false) if self.seen => failed(params.homing_timeout),
            // Not seen at it: it was too short to be seen, there was nothing to do, or the
            // request is still on its way.
            (false, true) if for_s > late_s => Step::Done,
            (false, false) if for_s > late_s => failed(late_s),
            (false, _) => Step::Ask,
        }
    }
}

impl LoopState {
    /// Begins to home.
    pub(in crate::control) fn home(
        &mut self,
        tick: &mut Tick<'_>,
        order: &HomeOrder,
    ) -> Result<(), Refusal> {
        self.check_motion_mode(armada_protocol::messages::CommandMode::Homing)?;
        if let Some(motion) = &self.motion {
            return Err(Refusal::Busy(motion.id));
        }
        let start = match order.method {
            HomeMethod::Controller if !tick.params.abilities.homing => {
                return Err(Refusal::NotSupported("a controller that can home its joints"));
            }
            HomeMethod::Controller => {
                self.check_homable()?;
                OnlineState::at_rest(self.hold)
            }
            HomeMethod::MoveToHome => {
                self.check_homed()?;
                OnlineState::at_rest(self.rest()?.position)
            }
        };
        let limits = self.limits_in_force(tick.params);
        let home = HomeMotion::plan(order, &start, &self.drive(tick, limits))?;
        self.motion = Some(Motion::new(order.id, Source::Home(home)));
        Ok(())
    }

    /// Refuses if the controller cannot be asked to home now.
    pub(in crate::control) fn check_homable(&self) -> Result<(), Refusal> {
        if self.controller.awaits(DriverRequest::Disable) {
            return Err(Refusal::Disabled);
        }
        match self.condition.check_follows() {
            Ok(()) | Err(Refusal::NotReady) => {}
            Err(refusal) => return Err(refusal),
        }
        if self.ramp.is_some() || self.is_stopping_own() {
            return Err(Refusal::StillMoving);
        }
        Ok(())
    }

    /// Refuses motion while a joint does not know its reference.
    pub(in crate::control) fn check_homed(&self) -> Result<(), Refusal> {
        let feedback = self.condition.feedback().ok_or(Refusal::CommunicationLost)?;
        match (0..self.limits.len()).find(|&joint| !feedback.homed.contains(joint)) {
            Some(joint) => Err(Refusal::NotHomed { joint }),
            None => Ok(()),
        }
    }

    /// Follows a search of the controller: its end, and what it is to be asked for next.
    pub(in crate::control) fn follow_homing(&mut self, tick: &mut Tick<'_>) {
        let (stopping, standing) = (self.is_stopping_own(), self.has_settled(tick));
        let Some(feedback) = self.condition.feedback().copied() else { return };
        let Some(motion) = self.motion.as_mut() else { return };
        let Source::Home(home) = &mut motion.source else { return };
        if !home.is_controllers() {
            return;
        }
        if motion.cancelling {
            if !stopping && standing {
                self.hold = feedback.joint_position;
                self.end_motion(tick, End::Cancelled(Refusal::Cancelled));
            }
            return;
        }
        let step = home.search(&feedback, tick.now, tick.params);
        motion.announce_running(tick);
        match step {
            Step::Ask | Step::Searching => {}
            Step::Done => self.end_motion(tick, End::Complete),
            Step::Failed { value, limit } => {
                let fault = fault(FaultCode::HomingFailed, tick.now, value);
                self.latch(tick, crate::control::io::LoopFault { limit, ..fault });
            }
        }
    }
}

fn first_without_home(group: JointSet, params: &Params) -> Option<usize> {
    let has_home = |joint: usize| params.home.get(joint).copied().flatten().is_some();
    (0..MAX_JOINTS).find(|&joint| group.contains(joint) && !has_home(joint))
}

fn plan_group(
    group: JointSet,
    start: &OnlineState,
    drive: &Drive<'_>,
) -> Result<JogMotion, Refusal> {
    let goal = start.position.map_indexed(|joint, position| {
        let home = drive.params.home.get(joint).copied().flatten();
        home.filter(|_| group.contains(joint)).unwrap_or(position)
    });
    JogMotion::plan(start, &goal, &JointVector::EMPTY, &drive.limits, drive.speed_ratio)
}
