//! The phases of a tick, in their order.

use armada_model::{JointVector, MonoTime};
use armada_protocol::messages::MotionProgress;
use arrayvec::ArrayVec;

use super::io::{Input, Output, Params, Snapshot};
use super::state::{LoopState, Tick};
use crate::drivers::{Feedback, MAX_REPORTED_TIPS, SetPoint, Values};

/// Runs one tick of the loop: takes the requests out of `input`, and tells what is to be sent.
///
/// `state` must have been made for these `params`, and be given every output's command in the
/// order of the ticks. It does not allocate and cannot fail. Trajectories that are no longer
/// needed are in [`Output::retired`], so that they are not freed in the loop.
pub fn step(params: &Params, state: &mut LoopState, input: &mut Input) -> Output {
    let mut output = Output {
        command: None,
        driver_request: None,
        snapshot: state.snapshot(params, input.now, None),
        events: ArrayVec::new(),
        retired: ArrayVec::new(),
        group: ArrayVec::new(),
    };
    let (now, loop_error, stopped) = (input.now, input.loop_error, input.stop.is_some());
    let mut tick = Tick { params, now, loop_error, stopped, output: &mut output };
    state.seqno += 1;
    state.verify(&mut tick, input.feedback.as_ref());
    state.follow_stop(&mut tick, input.stop, input.resets);
    state.watch_acknowledgement(&tick);
    state.watch_lease(&mut tick);
    state.keep_stream(&mut tick);
    for request in input.requests.drain(..) {
        state.take(&mut tick, request);
    }
    state.hear_partners(input.group.drain(..));
    state.take_samples(&mut tick, input.stream.drain(..));
    state.keep_together(&mut tick);
    tick.output.command = state.set_point(&mut tick);
    state.watch_standstill(&tick);
    tick.output.driver_request = state
        .controller_request(&tick)
        .or_else(|| state.own_motion_request(&tick))
        .or_else(|| state.value_request(tick.now))
        .or_else(|| state.equipment_request(&tick));
    state.climb(&mut tick);
    state.answer_pending(&mut tick);
    state.answer_values(&mut tick);
    output.group = state.tell_partners(now, params.period);
    output.snapshot = state.snapshot(params, now, output.command.as_ref());
    output
}

impl LoopState {
    fn watch_standstill(&mut self, tick: &Tick<'_>) {
        let set_points_move = self
            .limiter
            .last()
            .is_some_and(|last| last.velocity.iter().any(|&velocity| velocity != 0.0));
        let moving = set_points_move || self.motion.as_ref().is_some_and(|m| m.is_moving());
        self.standstill.update(tick.params, tick.now, self.condition.feedback(), moving);
    }

    fn snapshot(&self, params: &Params, stamp: MonoTime, sent: Option<&SetPoint>) -> Snapshot {
        let feedback = self.condition.feedback();
        let period_s = params.period.as_secs_f64();
        let measured = |of: fn(&Feedback) -> JointVector| feedback.map_or(JointVector::EMPTY, of);
        let held = self.limiter.last().map(|last| (last.position, last.velocity));
        let sent = sent.map(|sent| (sent.joint_position, sent.joint_velocity));
        let (joint_position_command, joint_velocity_command) = sent.or(held).unwrap_or_default();
        Snapshot {
            stamp,
            seqno: self.seqno,
            epoch: self.epoch,
            command_mode: self.mode,
            operational_mode: self.operational_mode(params),
            controller_state: self.controller_state(),
            flags: self.flags(),
            joint_position: measured(|feedback| feedback.joint_position),
            joint_velocity: measured(|feedback| feedback.joint_velocity),
            joint_effort: measured(|feedback| feedback.joint_effort),
            joint_position_command,
            joint_velocity_command,
            motion: self.motion.as_ref().map(|motion| MotionProgress {
                queued: u32::try_from(self.waiting_count()).unwrap_or(u32::MAX),
                ..motion.progress(period_s)
            }),
            limited_setpoints: self.limiter.changed(),
            speed_ratio: self.speed_ratio,
            authority: self.authority_state(),
            lease: self.authority.report(),
            delegates: self.delegates(),
            stream: self.stream.report(stamp),
            dropped_samples: self.stream.dropped(),
            config_seqno: self.equipment.config_seqno,
            signals: feedback.map_or(Values::EMPTY, |feedback| feedback.signals),
            parameters: feedback.map_or(Values::EMPTY, |feedback| feedback.parameters),
            tips: feedback.map_or([None; MAX_REPORTED_TIPS], |feedback| feedback.tips),
            emergency_stop: feedback.map(|feedback| feedback.emergency_stop),
            acknowledged: self.acknowledgement.at(),
            group: self.group_report(),
        }
    }
}
