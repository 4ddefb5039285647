//! A loop with a controller that does what it is asked.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use armada_agent::control::{
    Equipment, EquippedChain, GroupWord, Input, LoopAbilities, LoopRequest, LoopState, MAX_WORDS,
    Order, Output, Params, StreamSample, ValueSlot, step,
};
use armada_agent::drivers::{
    DelegatedReport, DelegatedStatus, DriverRequest, Feedback, JointSet, LoadSetting, Values,
};
use armada_agent::recorder::{Shelf, Tape};
use armada_model::{
    Chain, CompiledTrajectory, JointLimits, JointTrajectory, JointVector, MonoTime, MotionLimits,
    Pose, RobotModel, TrajectoryOptions, Waypoint,
};
use armada_protocol::messages::{CommandMode, OperationalMode, StopLevel};
use arrayvec::ArrayVec;

use crate::counting::calls;

pub(crate) const JOINTS: usize = 7;
pub(crate) const PERIOD: Duration = Duration::from_millis(1);

pub(crate) fn all(value: f64) -> JointVector {
    JointVector::from_slice(&[value; JOINTS]).expect("finite")
}

pub(crate) fn params() -> Params {
    let joint = JointLimits {
        lower: Some(-2.9),
        upper: Some(2.9),
        velocity: 2.0,
        acceleration: Some(5.0),
        jerk: None,
        effort: None,
    };
    Params {
        standstill_hold: Duration::from_millis(50),
        start_tolerance: all(0.05),
        tracking_tolerance: all(0.05),
        tracking_lag: PERIOD,
        request_timeout: Duration::from_millis(200),
        enable_on_start: true,
        home: vec![Some(0.1); JOINTS],
        abilities: LoopAbilities {
            homing: true,
            move_joint: true,
            move_pose: true,
            move_linear: true,
            pause: true,
            load: true,
        },
        signals: vec![slot(0, 1), slot(1, 3)],
        parameters: vec![slot(0, 1)],
        equipment: Arc::new(equipment()),
        ..Params::for_joints(vec![joint; JOINTS], PERIOD).expect("few joints")
    }
}

const fn slot(first: usize, len: usize) -> ValueSlot {
    ValueSlot { first, len, tolerance: 1e-6 }
}

/// The chain of the seven-axis arm of the project.
pub(crate) fn equipment() -> Equipment {
    let text = include_str!("../../../config/robots/seven_axis_arm.urdf");
    let model = RobotModel::from_urdf(text, "arm.urdf").expect("a robot description");
    let chain = EquippedChain {
        chain: Chain::new(&model, "base_link", "tool0").expect("a chain"),
        tcp: Pose::from_translation(0.0, 0.0, 0.1),
        base_in_world: Pose::default(),
        joints: (0..JOINTS).collect(),
        load: LoadSetting::default(),
    };
    Equipment { config_seqno: 1, chains: vec![chain] }
}

pub(crate) fn trajectory(from: f64, to: f64) -> Arc<CompiledTrajectory> {
    let names: Vec<String> = (0..JOINTS).map(|joint| format!("joint_{joint}")).collect();
    let row = |time_from_start_s, value| Waypoint {
        time_from_start_s,
        joint_position: vec![value; JOINTS],
        ..Waypoint::default()
    };
    let waypoints = (0..=20).map(|k| {
        let share = f64::from(k) / 20.0;
        row(share, from + (to - from) * share * share * (3.0 - 2.0 * share))
    });
    let wanted = JointTrajectory {
        joint_names: names.clone(),
        waypoints: waypoints.collect(),
        ..JointTrajectory::default()
    };
    let limits = MotionLimits::new(&params().limits).expect("complete");
    let options = TrajectoryOptions::default();
    let compiled = CompiledTrajectory::compile(&wanted, &names, &limits, &options);
    Arc::new(compiled.expect("legal"))
}

/// A loop whose robot is always where it was told to be a tick ago.
pub(crate) struct Rig {
    pub(crate) params: Params,
    pub(crate) state: LoopState,
    pub(crate) now: MonoTime,
    pub(crate) feedback: Option<Feedback>,
    pub(crate) stop: Option<StopLevel>,
    /// Samples of the next tick.
    pub(crate) stream: ArrayVec<StreamSample, 8>,
    /// Words of partners of the next tick.
    pub(crate) words: ArrayVec<GroupWord, MAX_WORDS>,
    /// What writes the ticks down, and what takes it off its hands.
    pub(crate) tape: Option<(Tape, Shelf)>,
    /// What answers requests.
    controller: Controller,
    /// Whether the controller takes no requests.
    pub(crate) deaf: bool,
    calls: u64,
    ticks: u64,
}

impl Rig {
    pub(crate) fn new() -> Self {
        let params = params();
        let state = LoopState::new(&params).expect("sensible");
        let now = MonoTime::from_nanos(1);
        let feedback = Feedback {
            joint_velocity: all(0.0),
            operational_mode: OperationalMode::Cobot,
            signals: Values::from_slice(&[0.0; 4]).expect("room for four"),
            parameters: Values::from_slice(&[0.0]).expect("room for one"),
            ..Feedback::of(now, all(0.0))
        };
        Self {
            params,
            state,
            now,
            feedback: Some(feedback),
            stop: None,
            stream: ArrayVec::new(),
            words: ArrayVec::new(),
            tape: None,
            controller: Controller::default(),
            deaf: false,
            calls: 0,
            ticks: 0,
        }
    }

    /// One tick, which becomes the only owner of what `orders` hold.
    pub(crate) fn tick<const N: usize>(&mut self, orders: [Order; N]) -> Output {
        self.now = self.now + PERIOD;
        if let Some(feedback) = &mut self.feedback {
            feedback.stamp = self.now;
        }
        let requests = (0u64..).zip(orders);
        let mut input = Input {
            now: self.now,
            feedback: self.feedback,
            stop: self.stop,
            resets: 0,
            loop_error: false,
            requests: requests
                .map(|(ticket, order)| LoopRequest::new(ticket, order))
                .collect::<ArrayVec<_, 8>>(),
            stream: self.stream.take(),
            group: self.words.take(),
        };
        let before = calls();
        if let Some((tape, _)) = &mut self.tape {
            tape.before(&self.state, &input);
        }
        let output = black_box(step(&self.params, &mut self.state, black_box(&mut input)));
        if let Some((tape, _)) = &mut self.tape {
            tape.after(&input, &output);
        }
        self.calls += calls() - before;
        if let Some((_, shelf)) = &mut self.tape {
            shelf.tidy();
        }
        self.ticks += 1;
        self.obey(&output);
        output
    }

    fn obey(&mut self, output: &Output) {
        let Some(feedback) = &mut self.feedback else {
            return;
        };
        if let Some(command) = output.command {
            feedback.joint_velocity = command.joint_position.map_indexed(|joint, x| {
                (x - feedback.joint_position[joint]) / PERIOD.as_secs_f64()
            });
            feedback.joint_position = command.joint_position;
        } else {
            feedback.joint_velocity = all(0.0);
        }
        if let Some(request) = output.driver_request.filter(|_| !self.deaf) {
            self.controller.take(request, feedback);
        }
        self.controller.advance(feedback);
    }

    pub(crate) fn ticks(&mut self, count: usize) -> Output {
        for _ in 1..count {
            self.tick([]);
        }
        self.tick([])
    }

    #[track_caller]
    pub(crate) fn expect_mode(&mut self, mode: CommandMode) {
        let output = self.tick([]);
        assert_eq!(output.snapshot.command_mode, mode);
        assert_eq!(self.calls, 0, "calls of the allocator after {} ticks", self.ticks);
    }

    pub(crate) fn held(&self) -> f64 {
        self.feedback.as_ref().expect("heard").joint_position[0]
    }
}

/// What the controller does when it is asked.
#[derive(Default)]
struct Controller {
    /// The newest move of its own.
    own: Option<DelegatedReport>,
}

impl Controller {
    fn take(&mut self, request: DriverRequest, feedback: &mut Feedback) {
        match request {
            DriverRequest::Enable => (feedback.enabled, feedback.ready) = (true, true),
            DriverRequest::Disable => (feedback.enabled, feedback.ready) = (false, false),
            DriverRequest::ResetErrors => feedback.error_code = 0,
            DriverRequest::Home(joints) => {
                (feedback.homing, feedback.homed) = (joints, JointSet::NONE);
            }
            DriverRequest::StopMotion => {
                feedback.homing = JointSet::NONE;
                self.change(DelegatedStatus::Stopped);
            }
            DriverRequest::Move(wanted) => {
                let (number, status) = (wanted.number, DelegatedStatus::Running);
                self.own = Some(DelegatedReport { number, status, progress: 0.0 });
            }
            DriverRequest::PauseMotion => self.change(DelegatedStatus::Paused),
            DriverRequest::ResumeMotion => self.change(DelegatedStatus::Running),
            DriverRequest::SetSignal { signal, values } => {
                let first = usize::from(signal);
                let slots = feedback.signals.as_mut_slice().iter_mut().skip(first);
                slots.zip(values.as_slice()).for_each(|(slot, value)| *slot = *value);
            }
            DriverRequest::SetParameter { value, .. } => {
                feedback.parameters.as_mut_slice().fill(value);
            }
            // Nothing of them is reported.
            DriverRequest::SetSpeedRatio(_)
            | DriverRequest::SetLoad { .. }
            | DriverRequest::SetTool { .. } => {}
        }
    }

    fn change(&mut self, to: DelegatedStatus) {
        let moves = |report: &&mut DelegatedReport| {
            matches!(report.status, DelegatedStatus::Running | DelegatedStatus::Paused)
        };
        if let Some(report) = self.own.as_mut().filter(moves) {
            report.status = to;
        }
    }

    /// A move takes 200 ticks at 0.5 rad/s, wherever it goes.
    fn advance(&mut self, feedback: &mut Feedback) {
        if let Some(report) = &mut self.own
            && report.status == DelegatedStatus::Running
        {
            feedback.joint_velocity = all(0.5);
            feedback.joint_position =
                feedback.joint_position.map_indexed(|_, x| x + 0.5 * PERIOD.as_secs_f64());
            report.progress += 0.005;
            if report.progress >= 1.0 {
                report.status = DelegatedStatus::Done;
            }
        }
        feedback.delegated = self.own;
    }
}
