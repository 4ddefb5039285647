//! Search of the references of the emulated joints.

use armada_model::{
    JerkLimitedMove, JointLimits, JointType, JointVector, MotionLimits, OnlineOptions, OnlineState,
    Synchronisation,
};
use armada_protocol::messages::JointInfo;

use super::EmulatorConfig;
use super::settings::HomingConfig;
use crate::drivers::JointSet;

/// Which joints know their reference, and the search in progress.
#[derive(Debug)]
pub(super) struct Homing {
    config: HomingConfig,
    joints: Vec<JointInfo>,
    homed: JointSet,
    /// Joints that have been homed once: their encoders are right, even while they search again.
    found: JointSet,
    search: Option<Search>,
    broken: bool,
}

/// A search in progress.
#[derive(Debug)]
struct Search {
    joints: JointSet,
    motion: Box<JerkLimitedMove>,
    time_s: f64,
}

impl Homing {
    pub(super) fn new(config: &EmulatorConfig, joints: &[JointInfo]) -> Self {
        let all = JointSet::first(joints.len());
        let homed = if config.homing.required { JointSet::NONE } else { all };
        Self {
            config: config.homing.clone(),
            joints: joints.to_vec(),
            homed,
            found: homed,
            search: None,
            broken: false,
        }
    }

    pub(super) const fn homed(&self) -> JointSet {
        self.homed
    }

    pub(super) fn is_all_homed(&self) -> bool {
        self.homed.contains_all(JointSet::first(self.joints.len()))
    }

    /// The joints that search.
    pub(super) fn homing(&self) -> JointSet {
        self.search.as_ref().map_or(JointSet::NONE, |search| search.joints)
    }

    /// By how much the encoder of each joint is off \[rad or m\].
    pub(super) fn offset(&self, joint: usize) -> f64 {
        match self.joints.get(joint) {
            Some(info) if !self.found.contains(joint) => self.of_type(info, false),
            _ => 0.0,
        }
    }

    pub(super) const fn set_broken(&mut self, broken: bool) {
        self.broken = broken;
    }

    /// Begins the search of `wanted` from rest at `start`; says whether there is something to do.
    pub(super) fn begin(&mut self, wanted: JointSet, start: &JointVector) -> bool {
        let known = JointSet::first(self.joints.len());
        if !self.config.required || wanted.is_empty() || !known.contains_all(wanted) {
            return false;
        }
        let goal = start.map_indexed(|joint, position| match self.joints.get(joint) {
            Some(info) if wanted.contains(joint) => self.reference(info, position),
            _ => position,
        });
        let slow = |info: &JointInfo| JointLimits {
            velocity: self.config.speed_share * info.limits.velocity,
            ..info.limits
        };
        let limits: Vec<_> = self.joints.iter().map(slow).collect();
        let options =
            OnlineOptions { synchronisation: Synchronisation::None, ..OnlineOptions::default() };
        let planned = MotionLimits::new(&limits).ok().and_then(|limits| {
            let (from, to) = (OnlineState::at_rest(*start), OnlineState::at_rest(goal));
            JerkLimitedMove::plan(&from, &to, &limits, &options).ok()
        });
        let Some(motion) = planned else { return false };
        self.homed = JointSet::from_bits(self.homed.bits() & !wanted.bits());
        self.search = Some(Search { joints: wanted, motion: Box::new(motion), time_s: 0.0 });
        true
    }

    /// Gives the search up; joints that searched stay without reference.
    pub(super) fn abandon(&mut self) {
        self.search = None;
    }

    /// Moves on by `dt` seconds and gives the reference.
    ///
    /// # Errors
    /// If the search fails.
    pub(super) fn advance(&mut self, dt: f64) -> Result<Option<JointVector>, HomingFailed> {
        let Some(search) = &mut self.search else { return Ok(None) };
        if self.broken {
            self.search = None;
            return Err(HomingFailed);
        }
        search.time_s += dt;
        Ok(Some(search.motion.at(search.time_s).position))
    }

    /// Ends the search if it is over and the joints have `settled`.
    pub(super) fn end_if_over(&mut self, settled: bool) -> bool {
        let Some(search) = &self.search else { return false };
        if search.time_s < search.motion.rest_s() || !settled {
            return false;
        }
        self.homed = JointSet::from_bits(self.homed.bits() | search.joints.bits());
        self.found = JointSet::from_bits(self.found.bits() | search.joints.bits());
        self.search = None;
        true
    }

    /// The reference mark that a joint at `position` goes to.
    fn reference(&self, info: &JointInfo, position: f64) -> f64 {
        let spacing = self.of_type(info, true);
        let above = ((position / spacing).floor() + 1.0) * spacing;
        let below = ((position / spacing).ceil() - 1.0) * spacing;
        let inside = [above, below].into_iter().find(|&mark| info.limits.contains(mark));
        // A joint with no mark inside its limits has its reference where it is.
        inside.unwrap_or(position)
    }

    fn of_type(&self, info: &JointInfo, spacing: bool) -> f64 {
        let slides = info.joint_type == JointType::Prismatic;
        match (slides, spacing) {
            (false, true) => self.config.spacing_rad,
            (true, true) => self.config.spacing_m,
            (false, false) => self.config.offset_rad,
            (true, false) => self.config.offset_m,
        }
    }
}

/// No reference was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct HomingFailed;
