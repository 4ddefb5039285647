//! Motions of several robots: prepared here, committed to start at one instant.

use std::sync::{Arc, PoisonError};
use std::time::Duration;

use armada_model::{CompiledTrajectory, MonoTime};
use armada_protocol::messages::{
    Accepted, CancelParams, CommandMode, CommitParams, Denial, DenialCode, Empty, LeaseLoss,
    MotionKind, PrepareParams, Prepared, Queue,
};
use uuid::Uuid;

use super::group::PreparedGroup;
use super::trajectory::check_lease_loss;
use super::{Asker, Requests, check_new};
use crate::control::{FollowOrder, GroupOrder, Refusal};
use crate::runtime::clock::monotonic;
use crate::runtime::leases::check_may_move;

/// How long a prepared motion is kept for its commit.
const PREPARED_TTL: Duration = Duration::from_secs(5);
/// Prepared motions that are kept at once.
const MAX_PREPARED: usize = 8;
/// How long the keys of a group stay open beyond that, for a commit that comes just in time.
const GRACE: Duration = Duration::from_secs(1);

/// A valid trajectory that waits for its commit.
pub(in crate::runtime) struct PreparedMotion {
    trajectory: Arc<CompiledTrajectory>,
    on_lease_loss: LeaseLoss,
    /// None if it is followed alone, at an instant.
    group: Option<PreparedGroup>,
    epoch: u64,
    /// Revision of tools and payloads that it was looked at with.
    model_rev: u64,
    expires: MonoTime,
}

impl Requests {
    pub(super) async fn prepare(
        &self,
        asker: Asker,
        params: PrepareParams,
    ) -> Result<Prepared, Denial> {
        check_lease_loss(params.on_lease_loss)?;
        // Alone, a robot at reduced speed would slow a fast trajectory down; its partners would not
        // wait for it.
        let trajectory = self.compile(&params.trajectory, &self.limits_of_moves())?;
        let epoch = self.check_ready_to_follow(&asker, &trajectory)?;
        let asked_rev = params.group.as_ref().and_then(|group| group.model_rev);
        let model_rev = self.check_model_rev(asked_rev, "group.model_rev")?;
        if params.group.is_some() && params.motion_id.is_none() {
            let text = "motion_id is left out, but all robots of a group need the same";
            let denial = Denial::new(DenialCode::InvalidArgument, text);
            return Err(denial.with("field", "motion_id"));
        }
        let group = match &params.group {
            Some(group) => Some(self.prepare_group((group, model_rev), &trajectory).await?),
            None => None,
        };
        if !group.is_some_and(|(group, _)| group.shares_pace()) {
            self.check_full_speed()?;
        }
        let motion_id = params.motion_id.unwrap_or_else(Uuid::now_v7);
        let duration_s = trajectory.duration_s();
        let expires = monotonic() + PREPARED_TTL;
        self.keep_prepared(
            motion_id,
            PreparedMotion {
                trajectory,
                on_lease_loss: params.on_lease_loss,
                group: group.map(|(group, _)| group),
                epoch,
                model_rev,
                expires,
            },
        )?;
        if let Some(group) = &params.group
            && let Err(denial) = self.groups.open(motion_id, &group.partners, expires + GRACE).await
        {
            self.take_prepared(motion_id);
            return Err(denial);
        }
        let ttl_ms = u64::try_from(PREPARED_TTL.as_millis()).unwrap_or(u64::MAX);
        let group = group.map(|(_, readiness)| readiness);
        Ok(Prepared { motion_id, duration_s, epoch, ttl_ms, group })
    }

    fn keep_prepared(&self, motion_id: Uuid, motion: PreparedMotion) -> Result<(), Denial> {
        let now = monotonic();
        let mut prepared = self.prepared.lock().unwrap_or_else(PoisonError::into_inner);
        prepared.retain(|_, motion| motion.expires > now);
        if prepared.len() >= MAX_PREPARED {
            return Err(Denial::new(
                DenialCode::Busy,
                format!("{MAX_PREPARED} motions are prepared already: commit or abort one"),
            ));
        }
        check_new(&self.board.lock(), motion_id)?;
        prepared.insert(motion_id, motion);
        Ok(())
    }

    pub(super) async fn commit(
        &self,
        asker: Asker,
        params: CommitParams,
    ) -> Result<Accepted, Denial> {
        if params.boot_id != self.boot_id {
            return Err(Denial::new(
                DenialCode::InvalidArgument,
                "start_ns is of another run of this agent: measure its clock again",
            )
            .with("boot_id", self.boot_id.to_string()));
        }
        let prepared = self.take_prepared(params.motion_id).ok_or_else(|| {
            Denial::new(
                DenialCode::NotAttached,
                format!("motion {} is not prepared, or its time is over", params.motion_id),
            )
        })?;
        let group = self.group_order(&prepared, params.rate_slope_s).inspect_err(|_| {
            self.groups.close(params.motion_id);
        })?;
        let order = FollowOrder {
            id: params.motion_id,
            trajectory: prepared.trajectory,
            start: Some(params.start_ns),
            epoch: Some(prepared.epoch),
            kind: MotionKind::Trajectory,
            queue: Queue::Refuse,
            on_lease_loss: prepared.on_lease_loss,
            group,
        };
        self.follow(&asker, order).await
    }

    /// How a prepared motion is to be followed with others, if it may still be followed at all.
    fn group_order(
        &self,
        prepared: &PreparedMotion,
        rate_slope_s: Option<f64>,
    ) -> Result<Option<GroupOrder>, Denial> {
        self.check_model_rev(Some(prepared.model_rev), "model_rev")?;
        match (&prepared.group, rate_slope_s) {
            (Some(group), slope) => group.order(slope).map(Some),
            (None, None) => Ok(None),
            (None, Some(_)) => {
                let text = "rate_slope_s is for motions that were prepared with a group";
                let denial = Denial::new(DenialCode::InvalidArgument, text);
                Err(denial.with("field", "rate_slope_s"))
            }
        }
    }

    pub(super) async fn abort(&self, asker: Asker, params: CancelParams) -> Result<Empty, Denial> {
        if self.take_prepared(params.motion_id).is_some() {
            self.groups.close(params.motion_id);
            return Ok(Empty {});
        }
        self.cancel(asker, params).await
    }

    fn take_prepared(&self, id: Uuid) -> Option<PreparedMotion> {
        let mut prepared = self.prepared.lock().unwrap_or_else(PoisonError::into_inner);
        prepared.remove(&id).filter(|motion| motion.expires > monotonic())
    }

    /// Looks at once whether a trajectory could start now; returns the epoch it could start in.
    /// The loop looks again when it starts.
    fn check_ready_to_follow(
        &self,
        asker: &Asker,
        trajectory: &CompiledTrajectory,
    ) -> Result<u64, Denial> {
        let board = self.board.lock();
        let snapshot = &board.snapshot;
        let refuse = |refusal| Err(board.denial(&refusal));
        if let Some(level) = self.gate.level() {
            return refuse(Refusal::Stopped(level));
        }
        if let Err(refusal) = check_may_move(snapshot, asker.lease, monotonic()) {
            return refuse(refusal);
        }
        if let Some(fault) = board.faults.first() {
            return refuse(Refusal::Faulted(fault.code));
        }
        let (mode, needed) = (snapshot.command_mode, CommandMode::Trajectory);
        if mode != needed {
            return refuse(Refusal::WrongMode { mode, needed });
        }
        if let Some(motion) = snapshot.motion {
            return refuse(Refusal::Busy(motion.id));
        }
        let (start, measured) = (trajectory.start(), snapshot.joint_position);
        let distances = start.iter().zip(measured.iter()).map(|(a, b)| (a - b).abs());
        for (joint, (value, &limit)) in
            distances.zip(self.params.start_tolerance.iter()).enumerate()
        {
            if value > limit {
                return refuse(Refusal::StartTolerance { joint, value, limit });
            }
        }
        Ok(snapshot.epoch)
    }

    /// Refuses a robot that goes slower than its partners would.
    fn check_full_speed(&self) -> Result<(), Denial> {
        let board = self.board.lock();
        let snapshot = &board.snapshot;
        if snapshot.speed_ratio < 1.0 {
            // Its partners would go at their own speed, and meet where nobody looked.
            let robot = &board.vocabulary.robot;
            let text = format!(
                "{robot} has a speed ratio of {}, but robots that move together need 1: set it first",
                snapshot.speed_ratio
            );
            return Err(Denial::new(DenialCode::NotReady, text)
                .with("field", "speed_ratio")
                .with("value", snapshot.speed_ratio)
                .with("limit", 1.0));
        }
        Ok(())
    }
}
