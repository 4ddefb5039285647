//! Orders of jogs: which are granted, and what becomes of the motion in progress.

use armada_model::{MotionLimits, OnlineState};
use armada_protocol::messages::CommandMode;
use uuid::Uuid;

use super::equipment::EquippedChain;
use super::io::{JogCartesianOrder, JogJointOrder, JogOrder, Refusal, TwistTarget};
use super::motion::{DeadManJog, End, JogMotion, Motion, Source, Wanted};
use super::state::{LoopState, Tick};
use crate::drivers::JointSet;

/// A jog at a speed, whatever it moves.
struct SpeedOrder {
    id: Uuid,
    renews: bool,
    wanted: Wanted,
    timeout: std::time::Duration,
}

impl LoopState {
    /// Moves all joints to a position; a jog in progress ends, and this one goes on from its state.
    pub(super) fn jog(&mut self, tick: &mut Tick<'_>, order: &JogOrder) -> Result<(), Refusal> {
        let limits = self.check_jog(tick)?;
        if self.jog_in_progress().is_some_and(|motion| motion.id == order.id) {
            // A motion has one terminal status, so one identity cannot end and go on.
            return Err(Refusal::Busy(order.id));
        }
        let start = self.jog_start(tick)?;
        let JogOrder { joint_position, max_velocity, .. } = order;
        let jog = JogMotion::plan(&start, joint_position, max_velocity, &limits, self.speed_ratio)?;
        self.end_motion(tick, End::Cancelled(Refusal::Cancelled));
        self.motion = Some(Motion::new(order.id, Source::Jog(jog)));
        Ok(())
    }

    /// Moves joints at a speed.
    pub(super) fn jog_joint(
        &mut self,
        tick: &mut Tick<'_>,
        order: &JogJointOrder,
    ) -> Result<(), Refusal> {
        let limits = self.check_jog(tick)?;
        let JogJointOrder { id, joint_velocity, timeout, renews } = *order;
        let (given, expected) = (joint_velocity.len(), limits.len());
        if given != expected {
            return Err(Refusal::WrongLength { given, expected });
        }
        for (joint, (&value, axis)) in joint_velocity.iter().zip(limits.iter()).enumerate() {
            // Written so that not a number is refused as well.
            let within = value.abs() <= axis.velocity;
            if !within {
                let limit = axis.velocity.copysign(value);
                return Err(Refusal::OutOfRange { joint, value, limit });
            }
        }
        self.jog_at_speed(
            tick,
            &SpeedOrder { id, renews, wanted: Wanted::Joints(joint_velocity), timeout },
        )
    }

    /// Moves tools at a speed.
    pub(super) fn jog_cartesian(
        &mut self,
        tick: &mut Tick<'_>,
        order: &JogCartesianOrder,
    ) -> Result<(), Refusal> {
        self.check_jog(tick)?;
        let JogCartesianOrder { id, twists, timeout, renews } = *order;
        let mut moved = JointSet::NONE;
        for target in twists.iter().flatten() {
            let chain = self.chain_of(target)?;
            for &joint in &chain.joints {
                if moved.contains(joint) {
                    return Err(Refusal::NotSupported(
                        "chains without common joints to jog at once",
                    ));
                }
            }
            moved = chain.joints.iter().fold(moved, |set, &joint| set.with(joint));
        }
        self.jog_at_speed(tick, &SpeedOrder { id, renews, wanted: Wanted::Tools(twists), timeout })
    }

    fn jog_at_speed(&mut self, tick: &mut Tick<'_>, order: &SpeedOrder) -> Result<(), Refusal> {
        let period_s = tick.period_s();
        let start = self.jog_start(tick)?;
        let moves_tools = matches!(order.wanted, Wanted::Tools(_));
        if let Some(motion) = self.motion.as_mut().filter(|motion| motion.id == order.id) {
            return match &mut motion.source {
                Source::DeadMan(jog) if jog.moves_tools() == moves_tools => {
                    jog.order(&order.wanted, tick.now, order.timeout, period_s);
                    Ok(())
                }
                _ => Err(Refusal::Busy(order.id)),
            };
        }
        if order.renews {
            return Err(Refusal::NoSuchMotion);
        }
        self.end_motion(tick, End::Cancelled(Refusal::Cancelled));
        let mut jog = DeadManJog::new(&start);
        jog.order(&order.wanted, tick.now, order.timeout, period_s);
        self.motion = Some(Motion::new(order.id, Source::DeadMan(jog)));
        Ok(())
    }

    /// Refuses what any jog is refused for; the limits in force.
    fn check_jog(&self, tick: &Tick<'_>) -> Result<MotionLimits, Refusal> {
        self.check_motion_mode(CommandMode::Jog)?;
        self.check_jogs_allowed(tick.params)?;
        self.check_homed()?;
        Ok(self.limits_in_force(tick.params))
    }

    /// The state a jog begins in: that of the jog in progress on its curve, not between its
    /// set-points, so that velocity and acceleration stay continuous; or at rest.
    fn jog_start(&self, tick: &Tick<'_>) -> Result<OnlineState, Refusal> {
        match self.jog_in_progress().map(|motion| &motion.source) {
            Some(Source::Jog(jog)) => Ok(jog.state(tick.period_s())),
            Some(Source::DeadMan(jog)) => Ok(*jog.state()),
            _ => Ok(OnlineState::at_rest(self.rest()?.position)),
        }
    }

    /// The motion in progress, unless it is on the way to rest because it was cancelled.
    fn jog_in_progress(&self) -> Option<&Motion> {
        self.motion.as_ref().filter(|_| self.ramp.is_none())
    }

    fn chain_of(&self, target: &TwistTarget) -> Result<&EquippedChain, Refusal> {
        let TwistTarget { chain, .. } = *target;
        self.equipment.chains.get(usize::from(chain)).ok_or(Refusal::NoSuchChain { chain })
    }
}
