//! What is shown of a robot.

use std::collections::VecDeque;
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::RobotName;
use armada_protocol::messages::{RobotInfo, RobotState, RobotStatus};

/// Time over which rates are measured.
const RATE_WINDOW: Duration = Duration::from_secs(2);
/// Silence after which what is shown is old.
pub(super) const STALE: Duration = Duration::from_millis(1500);

/// What is known of a robot; times are since an arbitrary start.
#[derive(Clone, Debug)]
pub(super) struct Model {
    pub(super) robot: RobotName,
    pub(super) info: Option<RobotInfo>,
    /// Revision of tools and payloads when `info` was asked for.
    info_config: Option<u64>,
    pub(super) status: Option<RobotStatus>,
    pub(super) state: Option<RobotState>,
    /// Outcome of what was asked for by a key.
    pub(super) message: String,
    /// Whether the keys are explained.
    pub(super) help: bool,
    last_state: Option<Duration>,
    /// When each of the last states came, and its own stamp.
    arrivals: VecDeque<(Duration, MonoTime)>,
}

impl Model {
    pub(super) const fn new(robot: RobotName) -> Self {
        Self {
            robot,
            info: None,
            info_config: None,
            status: None,
            state: None,
            message: String::new(),
            help: false,
            last_state: None,
            arrivals: VecDeque::new(),
        }
    }

    /// Takes a state that came at `now`.
    pub(super) fn take_state(&mut self, now: Duration, state: RobotState) {
        if self.state.as_ref().is_some_and(|last| last.boot_id != state.boot_id) {
            // Stamps of two runs of an agent have nothing in common.
            self.arrivals.clear();
        }
        self.arrivals.push_back((now, state.stamp_ns));
        while self.arrivals.front().is_some_and(|(at, _)| now.saturating_sub(*at) > RATE_WINDOW) {
            self.arrivals.pop_front();
        }
        self.last_state = Some(now);
        self.state = Some(state);
    }

    /// Takes a status.
    pub(super) fn take_status(&mut self, status: RobotStatus) {
        self.status = Some(status);
    }

    /// Takes a description, which was asked for at the newest state.
    pub(super) fn take_info(&mut self, info: RobotInfo) {
        self.info_config = self.state.as_ref().map(|state| state.config_seqno);
        self.info = Some(info);
    }

    /// Whether the agent has another description than the one that is shown.
    pub(super) fn needs_info(&self) -> bool {
        let Some(info) = &self.info else { return true };
        let Some(state) = &self.state else { return false };
        state.boot_id != info.boot_id || self.info_config != Some(state.config_seqno)
    }

    /// How long ago the last state came; `None` if none ever did.
    pub(super) fn age(&self, now: Duration) -> Option<Duration> {
        self.last_state.map(|last| now.saturating_sub(last))
    }

    /// How often states come \[Hz\], by their own stamps: they may be taken several at once.
    pub(super) fn rate_hz(&self, now: Duration) -> f64 {
        let recent = |(at, _): &&(Duration, MonoTime)| now.saturating_sub(*at) <= RATE_WINDOW;
        let mut stamps = self.arrivals.iter().filter(recent).map(|(_, stamp)| *stamp);
        let Some(first) = stamps.next() else { return 0.0 };
        let (more, last) = stamps.fold((0, first), |(count, _), stamp| (count + 1, stamp));
        let span = last.saturating_since(first).as_secs_f64();
        if span > 0.0 { f64::from(more) / span } else { 0.0 }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use armada_model::{JointLimits, JointType, JointVector, Pose};
    use armada_protocol::messages::{
        ClearBy, CommandMode, ControllerState, Fault, FaultCode, JointInfo, LoopStatistics,
        MotionProgress, OperationalMode, ReducedLimits, RobotFlags, SchedulingPolicy, TcpState,
    };
    use uuid::Uuid;

    use super::*;

    pub(in super::super) fn vector(values: &[f64]) -> JointVector {
        JointVector::from_slice(values).expect("finite")
    }

    fn info() -> RobotInfo {
        let joint = |name: &str, joint_type, lower| JointInfo {
            name: name.to_owned(),
            joint_type,
            limits: JointLimits {
                lower,
                upper: lower.map(|lower: f64| lower + 2.0),
                velocity: 2.0,
                ..JointLimits::default()
            },
            reduced: ReducedLimits::default(),
            home: None,
        };
        RobotInfo {
            robot: "left_arm".parse().expect("a name"),
            uuid: Uuid::nil(),
            boot_id: Uuid::nil(),
            seqno: 0,
            vendor: "sim".to_owned(),
            model: "six-axis".to_owned(),
            serial: String::new(),
            software_version: "0.1.0".to_owned(),
            model_rev: 1,
            joints: vec![
                joint("shoulder", JointType::Revolute, Some(-1.0)),
                joint("wrist", JointType::Continuous, None),
            ],
            chains: vec![],
            equipment: vec![],
            tools: vec![],
            signals: vec![],
            parameters: vec![],
            capabilities: vec![],
            methods: vec![],
            flags: vec![],
            period_ms: 2.0,
            stop_time_s: 2.5,
            lease_required: false,
            state_rate_hz: 100.0,
            state_classes_hz: vec![],
            urdf: String::new(),
        }
    }

    pub(in super::super) fn state() -> RobotState {
        RobotState {
            stamp_ns: MonoTime::ZERO,
            utc_ns: 0,
            boot_id: Uuid::nil(),
            seqno: 1,
            epoch: 4,
            command_mode: CommandMode::Trajectory,
            operational_mode: OperationalMode::Auto,
            controller_state: ControllerState::MotorOn,
            flags: RobotFlags::ENABLED.with(RobotFlags::READY, true),
            joint_position_rad: vector(&[0.5, -0.25]),
            joint_velocity_rad_s: vector(&[0.1, 0.0]),
            joint_effort_nm: JointVector::EMPTY,
            joint_position_command_rad: vector(&[0.51, -0.25]),
            joint_velocity_command_rad_s: vector(&[0.1, 0.0]),
            tcp: vec![TcpState::of("arm", Pose::from_translation(0.5, 0.0, 1.0))],
            motion: Some(MotionProgress {
                id: Uuid::nil(),
                elapsed_s: 1.0,
                duration_s: 4.0,
                waypoint: 3,
                rate: 1.0,
                paused: false,
                queued: 0,
            }),
            speed_ratio: 1.0,
            config_seqno: 0,
        }
    }

    fn status() -> RobotStatus {
        RobotStatus {
            robot: "left_arm".parse().expect("a name"),
            boot_id: Uuid::nil(),
            seqno: 0,
            stamp_ns: MonoTime::ZERO,
            epoch: 4,
            command_mode: CommandMode::Trajectory,
            operational_mode: OperationalMode::Auto,
            controller_state: ControllerState::MotorOn,
            flags: RobotFlags::NONE,
            stop: None,
            faults: vec![Fault {
                code: FaultCode::TrackingError,
                message: "joint shoulder: 0.3 rad behind".to_owned(),
                joint: Some("shoulder".to_owned()),
                value: 0.3,
                limit: 0.1,
                clear: ClearBy::ResetErrors,
                remedy: String::new(),
                recording: None,
                since_ns: MonoTime::ZERO,
            }],
            authority: Default::default(),
            stop_sources: vec![],
            why: vec![],
            speed_ratio: 1.0,
            lease: None,
            motion: None,
            queued: vec![],
            stream: None,
            control_loop: LoopStatistics {
                rate_hz: 500.0,
                target_rate_hz: 500.0,
                overruns: 7,
                scheduling: SchedulingPolicy::Fifo(80),
                ..LoopStatistics::default()
            },
            dropped: vec![],
            next: vec!["reset_errors when the cause is gone".to_owned()],
        }
    }

    pub(in super::super) fn full_model() -> Model {
        let mut model = Model::new("left_arm".parse().expect("a name"));
        model.take_status(status());
        for tick in 0..=100 {
            let at = Duration::from_millis(tick * 10);
            let stamp_ns = MonoTime::ZERO + at;
            model.take_state(at, RobotState { stamp_ns, ..state() });
        }
        model.take_info(info());
        model
    }

    #[test]
    fn the_rate_is_that_of_the_last_two_seconds() {
        let model = full_model();
        assert!((model.rate_hz(Duration::from_secs(1)) - 100.0).abs() < 0.5);
        assert_eq!(model.rate_hz(Duration::from_secs(9)), 0.0);
    }

    #[test]
    fn states_that_are_taken_together_have_the_rate_of_their_stamps() {
        let mut model = Model::new("torso".parse().expect("a name"));
        for tick in 0..50 {
            let stamp_ns = MonoTime::from_nanos(tick * 20_000_000);
            model.take_state(Duration::from_secs(5), RobotState { stamp_ns, ..state() });
        }
        assert!((model.rate_hz(Duration::from_secs(5)) - 50.0).abs() < 1e-9);
    }

    #[test]
    fn age_grows_while_nothing_comes() {
        let model = full_model();
        assert_eq!(model.age(Duration::from_millis(1250)), Some(Duration::from_millis(250)));
        assert_eq!(Model::new("torso".parse().expect("a name")).age(Duration::ZERO), None);
    }

    #[test]
    fn a_restarted_agent_is_asked_again_what_it_is() {
        let mut model = full_model();
        assert!(!model.needs_info());
        let restarted = RobotState { boot_id: Uuid::max(), ..state() };
        model.take_state(Duration::from_secs(2), restarted);
        assert!(model.needs_info());
    }

    #[test]
    fn a_robot_that_carries_something_else_is_asked_again_what_it_is() {
        let mut model = full_model();
        let loaded = RobotState { config_seqno: 1, ..state() };
        model.take_state(Duration::from_secs(2), loaded);
        assert!(model.needs_info());
        model.take_info(info());
        assert!(!model.needs_info());
    }
}
