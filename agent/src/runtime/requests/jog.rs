//! Jogs and homing.

use std::ops::RangeInclusive;
use std::time::Duration;

use armada_protocol::messages::{
    Accepted, ChainTwist, Denial, DenialCode, Executor, HomeMethod, HomeParams, JogCartesianParams,
    JogFreespaceParams, JogJointParams, MotionKind,
};
use uuid::Uuid;

use super::{Asker, LOOP_PATIENCE, NewMotion, Requests};
use crate::control::{
    Granted, HomeOrder, JogCartesianOrder, JogJointOrder, JogOrder, MAX_CHAINS, Order, Refusal,
    TwistTarget,
};
use crate::drivers::JointSet;

/// Dead-man times that may be asked for \[s\]: shorter than a few repetitions would stutter, longer
/// would be no dead man's switch.
const TIMEOUT_S: RangeInclusive<f64> = 0.02..=10.0;

impl Requests {
    pub(super) async fn jog_freespace(
        &self,
        asker: Asker,
        params: JogFreespaceParams,
    ) -> Result<Accepted, Denial> {
        let answering = self.answering(params.wait)?;
        let max_velocity = params.max_velocity_rad_s;
        if max_velocity.is_some_and(|speeds| speeds.is_empty()) {
            // Of the loop an empty vector asks for the limits, which is what leaving it out does.
            let refusal = Refusal::WrongLength { given: 0, expected: self.limits.len() };
            return Err(self.board.lock().vocabulary.denial(&refusal));
        }
        let order = JogOrder {
            id: params.motion_id.unwrap_or_else(Uuid::now_v7),
            joint_position: params.joint_position_rad,
            max_velocity: max_velocity.unwrap_or_default(),
        };
        let motion = jog(order.id, MotionKind::JogFreespace, 0.0);
        self.start_and(answering, &asker, motion, Order::Jog(order)).await
    }

    pub(super) async fn jog_joint(
        &self,
        asker: Asker,
        params: JogJointParams,
    ) -> Result<Accepted, Denial> {
        let timeout = dead_man_time(params.timeout_s)?;
        let motion = self.speed_motion(params.motion_id, MotionKind::JogJoint, params.timeout_s);
        let order = JogJointOrder {
            id: motion.id,
            joint_velocity: params.joint_velocity_rad_s,
            timeout,
            renews: self.is_in_progress(&motion),
        };
        self.jog_at_speed(&asker, motion, Order::JogJoint(order), params.wait).await
    }

    pub(super) async fn jog_cartesian(
        &self,
        asker: Asker,
        params: JogCartesianParams,
    ) -> Result<Accepted, Denial> {
        let timeout = dead_man_time(params.timeout_s)?;
        let twists = self.twists(&params.chains)?;
        let motion =
            self.speed_motion(params.motion_id, MotionKind::JogCartesian, params.timeout_s);
        let renews = self.is_in_progress(&motion);
        let order = JogCartesianOrder { id: motion.id, twists, timeout, renews };
        self.jog_at_speed(&asker, motion, Order::JogCartesian(order), params.wait).await
    }

    pub(super) async fn home(&self, asker: Asker, params: HomeParams) -> Result<Accepted, Denial> {
        let groups = self.groups(&params.order)?;
        let answering = self.answering(params.wait)?;
        let id = params.motion_id.unwrap_or_else(Uuid::now_v7);
        let executor = match params.method {
            HomeMethod::Controller => Executor::Controller,
            HomeMethod::MoveToHome => Executor::Agent,
        };
        let motion = NewMotion { executor, ..jog(id, MotionKind::Home, 0.0) };
        let order = HomeOrder { id, groups, method: params.method };
        self.start_and(answering, &asker, motion, Order::Home(order)).await
    }

    fn speed_motion(&self, id: Option<Uuid>, kind: MotionKind, timeout_s: f64) -> NewMotion {
        jog(id.unwrap_or_else(Uuid::now_v7), kind, timeout_s)
    }

    /// Whether this motion goes on already, so that a request only keeps it going.
    fn is_in_progress(&self, motion: &NewMotion) -> bool {
        let board = self.board.lock();
        let known = board.motions.find(motion.id);
        known.is_some_and(|known| known.kind == motion.kind && !known.status.is_terminal())
    }

    /// Starts a jog at a speed, or keeps one going.
    async fn jog_at_speed(
        &self,
        asker: &Asker,
        motion: NewMotion,
        order: Order,
        wait: bool,
    ) -> Result<Accepted, Denial> {
        let answering = self.answering(wait)?;
        let renews = match &order {
            Order::JogJoint(order) => order.renews,
            Order::JogCartesian(order) => order.renews,
            _ => false,
        };
        if !renews {
            return self.start_and(answering, asker, motion, order).await;
        }
        let Granted { epoch, .. } = self.ask(asker, order, LOOP_PATIENCE).await?;
        let (motion_id, duration_s) = (motion.id, motion.duration_s);
        let accepted = Accepted { motion_id, duration_s, epoch, status: None };
        self.finish(accepted, answering).await
    }

    /// The chains by number, each at most once.
    fn twists(&self, chains: &[ChainTwist]) -> Result<[Option<TwistTarget>; MAX_CHAINS], Denial> {
        let refuse = |field: String, message: String| {
            Err(Denial::new(DenialCode::InvalidArgument, message).with("field", field))
        };
        if chains.is_empty() {
            return refuse("chains".to_owned(), "chains is empty: name a chain".to_owned());
        }
        let mut twists = [None; MAX_CHAINS];
        for (index, ChainTwist { chain, twist, frame }) in chains.iter().enumerate() {
            let field = format!("chains.{index}.chain");
            let number = self.chain_names.iter().position(|name| name == chain);
            let Some((number, slot)) = number.and_then(|n| Some((n, twists.get_mut(n)?))) else {
                let names = self.chain_names.join(", ");
                return refuse(field, format!("there is no chain {chain:?}, there are: {names}"));
            };
            if slot.is_some() {
                return refuse(field, format!("chain {chain:?} is given twice"));
            }
            let chain = u8::try_from(number).unwrap_or(u8::MAX);
            *slot = Some(TwistTarget { chain, twist: *twist, frame: *frame });
        }
        Ok(twists)
    }

    /// Groups of joints by number: all at the same time if none is named.
    fn groups(
        &self,
        order: &[Vec<String>],
    ) -> Result<[JointSet; armada_model::MAX_JOINTS], Denial> {
        let mut groups = [JointSet::NONE; armada_model::MAX_JOINTS];
        if order.is_empty() {
            groups[0] = JointSet::first(self.joint_names.len());
            return Ok(groups);
        }
        let refuse = |index: usize, message: String| {
            let field = format!("order.{index}");
            Err(Denial::new(DenialCode::InvalidArgument, message).with("field", field))
        };
        let mut named = JointSet::NONE;
        for (index, names) in order.iter().enumerate() {
            // Joints are named once and no group is empty, so there are no more groups than joints.
            let Some(group) = groups.get_mut(index).filter(|_| !names.is_empty()) else {
                return refuse(index, format!("order.{index} is empty: name a joint"));
            };
            for name in names {
                let Some(joint) = self.joint_names.iter().position(|known| known == name) else {
                    let known = self.joint_names.join(", ");
                    return refuse(index, format!("there is no joint {name:?}, there are {known}"));
                };
                if named.contains(joint) {
                    return refuse(index, format!("joint {name:?} is named twice"));
                }
                (named, *group) = (named.with(joint), group.with(joint));
            }
        }
        Ok(groups)
    }
}

fn jog(id: Uuid, kind: MotionKind, duration_s: f64) -> NewMotion {
    NewMotion { id, kind, executor: Executor::Agent, duration_s, waypoint_count: 0 }
}

fn dead_man_time(timeout_s: f64) -> Result<Duration, Denial> {
    let (least, most) = (*TIMEOUT_S.start(), *TIMEOUT_S.end());
    if TIMEOUT_S.contains(&timeout_s) {
        return Ok(Duration::from_secs_f64(timeout_s));
    }
    Err(Denial::new(
        DenialCode::OutOfRange,
        format!("timeout_s is {timeout_s}, expected {least} to {most}"),
    )
    .with("field", "timeout_s")
    .with("value", timeout_s)
    .with("lower", least)
    .with("upper", most))
}
