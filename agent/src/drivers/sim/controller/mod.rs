//! The emulated controller behind the packets: power, errors, the stream of commands, the joints.
//!
//! ```text
//! power   Off --power on--> Starting --enable time--> On --power off, error, emergency stop--> Off
//! motion  Hold --command--> Stream --silence at rest--> Hold
//!         (On)              Stream --silence in motion--> Stop (error) --standstill--> Hold
//!         Hold, Stream at rest --home, moves of its own--> Own --their end--> Hold
//!         any --guard stop--> Stop
//! ```
//!
//! Off: the brakes decelerate each joint and hold it. Commands count while drives are on, no error
//! is in force and nothing of the controller's own is in progress; set-points that come meanwhile
//! are dropped. An error switches the drives off, but for the watchdog's: there the drives
//! decelerate at their limit and hold.

mod own;

use std::time::Duration;

use armada_model::{JointLimits, JointVector, MonoTime, MotionLimits};
use armada_protocol::messages::{OperationalMode, RobotFlags};

use super::axis::{Axis, check_initial_names};
use super::board::Board;
use super::dynamics::Drive;
use super::homing::Homing;
use super::noise::Noise;
use super::planner::Planner;
use super::program::Program;
use super::safety::{Safety, StopSource};
use super::{EmulatorConfig, GuardStop, ReportsTip, error_code};
use crate::config::millis;
use crate::drivers::{
    DelegatedReport, DriverSetup, JointSet, LoadSetting,
    MAX_REPORTED_TIPS, ReportedTip, SetPoint, SetupError, TipFrame,
};

/// Longest step of the integration; a controller cycle is cut into equal parts of at most this.
const MAX_STEP: Duration = Duration::from_millis(1);
/// How long the reference goes on at the commanded speed when no newer command comes.
const MAX_EXTRAPOLATION: Duration = Duration::from_millis(20);
/// Speed below which a joint counts as standing, as a share of its drive's highest.
const STANDSTILL_SHARE: f64 = 1e-3;
/// Distance from its reference at which a joint has settled at the end of a way \[rad or m\].
const SETTLED: f64 = 1e-5;

/// Drives and their switching.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Power {
    Off,
    Starting { done: MonoTime },
    On,
}

/// What moves the joints while the drives are on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    Hold,
    Stream { taken: MonoTime },
    /// Homing, or moves of the controller's own.
    Own,
    Stop,
}

/// What the encoders and drives measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measurement {
    pub(super) position: JointVector,
    pub(super) velocity: JointVector,
    pub(super) effort: JointVector,
}

/// The emulated controller with its robot.
#[derive(Debug)]
pub(super) struct Controller {
    axes: Vec<Axis>,
    power: Power,
    motion: Motion,
    /// What is followed in [`Motion::Stream`].
    set_point: SetPoint,
    /// What is followed in [`Motion::Hold`].
    hold: JointVector,
    error: u32,
    safety: Safety,
    board: Board,
    homing: Homing,
    program: Program,
    planner: Planner,
    own_moves: bool,
    loads: Vec<LoadSetting>,
    guard_stop: GuardStop,
    reports_tip: ReportsTip,
    noise: Noise,
    enable_time: Duration,
    watchdog: Duration,
}

impl Controller {
    /// A controller with drives off, brakes on and joints at rest.
    pub(super) fn new(config: &EmulatorConfig, setup: &DriverSetup) -> Result<Self, SetupError> {
        let count = setup.joint_count()?;
        check_initial_names(config, setup)?;
        let axes = setup.joints.iter().map(|joint| Axis::new(config, joint));
        let axes = axes.collect::<Result<Vec<_>, _>>()?;
        let mut hold = JointVector::zeros(count).map_err(|_| SetupError::JointCount { count })?;
        hold.iter_mut().zip(&axes).for_each(|(hold, axis)| *hold = axis.joint.position);
        let limits: Vec<JointLimits> = setup.joints.iter().map(|joint| joint.limits).collect();
        let limits = MotionLimits::new(&limits).map_err(|error| SetupError::Config {
            vendor: "sim",
            field: "joints".to_owned(),
            problem: error.to_string(),
        })?;
        Ok(Self {
            axes,
            power: Power::Off,
            motion: Motion::Hold,
            set_point: SetPoint { joint_position: hold, joint_velocity: hold },
            hold,
            error: 0,
            safety: Safety::new(config),
            board: Board::new(config),
            homing: Homing::new(config, &setup.joints),
            program: Program::new(limits),
            planner: Planner::new(config, setup),
            own_moves: config.own_moves,
            loads: vec![LoadSetting::default(); setup.chains.len()],
            guard_stop: config.guard_stop,
            reports_tip: config.reports_tip,
            noise: Noise::new(config.noise_seed),
            enable_time: millis(config.enable_time_ms),
            watchdog: millis(config.watchdog_ms),
        })
    }

    /// Begins to switch the drives on, unless an error, a stop, the pendant or the enabling switch
    /// forbids it.
    pub(super) fn power_on(&mut self, now: MonoTime) {
        let forbidden = self.error != 0
            || self.safety.emergency_stop()
            || self.safety.guard_stop()
            || self.safety.local_control()
            || !self.safety.is_enabled_by_hand();
        if self.power == Power::Off && !forbidden {
            self.power = Power::Starting { done: now + self.enable_time };
        }
    }

    /// Switches the drives off; the brakes stop the joints.
    pub(super) fn power_off(&mut self) {
        self.power = Power::Off;
        self.motion = Motion::Hold;
        self.end_own_motion(error_code::INTERRUPTED);
    }

    /// Clears the error unless it is fatal, and a guard stop whose guards are closed; an emergency
    /// stop stays.
    pub(super) fn reset_errors(&mut self) {
        if !self.safety.fatal() {
            self.error = 0;
        }
        self.safety.reset();
    }

    /// Switches the drives off with an error; the first error stays until it is reset.
    pub(super) fn fail(&mut self, error: u32) {
        if self.error == 0 {
            self.error = error;
        }
        self.end_own_motion(error);
        self.power_off();
    }

    /// Switches the drives off with an error that no reset clears.
    pub(super) fn fail_fatally(&mut self, error: u32) {
        self.safety.set_fatal(true);
        self.fail(error);
    }

    /// The cause of a fatal error is gone.
    pub(super) const fn repair(&mut self) {
        self.safety.set_fatal(false);
    }

    /// An emergency stop acts.
    pub(super) fn press(&mut self, source: StopSource) {
        self.safety.press(source);
        self.power_off();
    }

    /// Releases all emergency stops; the drives stay off.
    pub(super) fn release_emergency_stop(&mut self) {
        self.safety.release_all();
    }

    /// Opens or closes a guard, 1 to 4.
    pub(super) fn set_guard(&mut self, guard: u8, open: bool) {
        self.safety.set_guard(guard, open);
        match self.guard_stop {
            GuardStop::DrivesOff if open => self.power_off(),
            GuardStop::ControlledStop if open => self.stop_controlled(error_code::INTERRUPTED),
            GuardStop::DrivesOff | GuardStop::ControlledStop => {}
        }
    }

    /// Turns the key switch; what the controller does on its own ends.
    pub(super) fn turn_key(&mut self, mode: OperationalMode) {
        if mode != self.safety.mode() {
            self.safety.turn_key(mode);
            self.stop_own_motion();
        }
    }

    /// Gives control to the pendant, which stops the robot, or takes it back.
    pub(super) fn set_local_control(&mut self, local: bool) {
        self.safety.set_local_control(local);
        if local {
            self.stop_controlled(error_code::INTERRUPTED);
        }
    }

    /// Whether the pendant has control.
    pub(super) const fn local_control(&self) -> bool {
        self.safety.local_control()
    }

    /// Holds the enabling switch, or lets it go.
    pub(super) const fn hold_enabling_switch(&mut self, held: bool) {
        self.safety.hold_enabling_switch(held);
    }

    /// Makes searches of references fail, or no longer.
    pub(super) const fn break_homing(&mut self, broken: bool) {
        self.homing.set_broken(broken);
    }

    /// Sets one value of an input from outside; says whether there is one that takes it.
    pub(super) fn set_input(&mut self, name: &str, element: u8, value: f64) -> bool {
        self.board.set_input(name, element, value)
    }

    /// Another client: it knows nothing of moves that were made for the one before.
    pub(super) const fn forget_report(&mut self) {
        self.program.forget_report();
    }

    /// Blocks one joint and no other, or none; says whether there is such a joint.
    pub(super) fn block(&mut self, joint: Option<usize>) -> bool {
        if joint.is_some_and(|index| index >= self.axes.len()) {
            return false;
        }
        for (index, axis) in self.axes.iter_mut().enumerate() {
            axis.blocked = joint == Some(index);
        }
        true
    }

    /// Takes a set-point of as many joints as there are; one is ignored unless [`Self::ready`].
    pub(super) fn command(&mut self, now: MonoTime, set_point: SetPoint) {
        let own = self.motion == Motion::Own;
        if own || !self.ready() || set_point.joint_position.len() != self.axes.len() {
            return;
        }
        let homing = &self.homing;
        let joint_position =
            set_point.joint_position.map_indexed(|joint, value| value - homing.offset(joint));
        let set_point = SetPoint { joint_position, ..set_point };
        let outward = self.axes.iter().zip(set_point.joint_position.iter());
        if outward
            .into_iter()
            .any(|(axis, &goal)| axis.passes_limit(goal, goal - axis.joint.position))
        {
            self.fail(error_code::JOINT_LIMIT);
            return;
        }
        self.set_point = set_point;
        self.motion = Motion::Stream { taken: now };
    }

    /// Advances the robot by the cycle that ends at `now`.
    pub(super) fn advance(&mut self, now: MonoTime, cycle: Duration) {
        if let Power::Starting { done } = self.power
            && now >= done
        {
            self.power = Power::On;
            self.safety.drives_went_on();
            self.hold_here();
        }
        if self.power != Power::Off && !self.safety.is_enabled_by_hand() {
            self.power_off();
        }
        self.begin_moves();
        let steps = cycle.as_nanos().div_ceil(MAX_STEP.as_nanos()).clamp(1, 1000) as u32;
        let step = cycle / steps;
        let begin = now - cycle;
        for index in 1..=steps {
            self.step(begin + step * index, step.as_secs_f64());
        }
    }

    /// Drives are on.
    pub(super) fn enabled(&self) -> bool {
        self.power == Power::On
    }

    /// Commands are taken.
    pub(super) fn ready(&self) -> bool {
        let free = !self.safety.guard_stop() && !self.safety.local_control();
        self.enabled() && self.error == 0 && free
    }

    /// The error in force; 0 for none.
    pub(super) const fn error(&self) -> u32 {
        self.error
    }

    /// Whether an emergency stop acts.
    pub(super) fn emergency_stop(&self) -> bool {
        self.safety.emergency_stop()
    }

    /// Whether a guard is open, or was and is not reset.
    pub(super) const fn guard_stop(&self) -> bool {
        self.safety.guard_stop()
    }

    /// Buttons, guards and switches.
    pub(super) fn conditions(&self) -> RobotFlags {
        self.safety.conditions()
    }

    /// Where the key switch stands.
    pub(super) const fn operational_mode(&self) -> OperationalMode {
        self.safety.mode()
    }

    /// Joints that know their reference, and those that search it.
    pub(super) fn homed_and_homing(&self) -> [JointSet; 2] {
        [self.homing.homed(), self.homing.homing()]
    }

    /// Inputs, outputs and settings.
    pub(super) const fn board(&self) -> &Board {
        &self.board
    }

    /// What has become of the newest move of its own.
    pub(super) fn report(&self) -> Option<DelegatedReport> {
        self.program.report()
    }

    /// The poses it reports, for these measured positions.
    pub(super) fn tips(&self, position: &JointVector) -> [Option<ReportedTip>; MAX_REPORTED_TIPS] {
        let frame = match self.reports_tip {
            ReportsTip::None => return [None; MAX_REPORTED_TIPS],
            ReportsTip::Flange => TipFrame::Flange,
            ReportsTip::Tcp => TipFrame::Tcp,
        };
        let mut tips = [None; MAX_REPORTED_TIPS];
        let found = (0..=u8::MAX).take(self.loads.len()).filter_map(|chain| {
            let (flange, tool) = self.planner.flange_and_tool(chain, position)?;
            let pose = if frame == TipFrame::Tcp { flange * tool } else { flange };
            Some(ReportedTip { chain, frame, pose })
        });
        tips.iter_mut().zip(found).for_each(|(slot, tip)| *slot = Some(tip));
        tips
    }

    /// Number of joints.
    pub(super) const fn joint_count(&self) -> usize {
        self.axes.len()
    }

    /// Measures all joints, with noise.
    pub(super) fn measure(&mut self) -> Measurement {
        let powered = self.power == Power::On;
        let Self { axes, noise, hold, homing, .. } = self;
        let mut measure = |value: fn(&Axis, &mut Noise) -> f64| {
            let mut values = *hold; // for its length only
            values.iter_mut().zip(&*axes).for_each(|(out, axis)| *out = value(axis, noise));
            values
        };
        let position = measure(|axis, noise| axis.joint.position + noise.next(axis.position_noise))
            .map_indexed(|joint, value| value + homing.offset(joint));
        let velocity =
            measure(|axis, noise| axis.joint.velocity + noise.next(axis.velocity_noise));
        let mut effort = measure(if powered {
            |axis, _| axis.joint.effort(&axis.drive)
        } else {
            |_, _| 0.0
        });
        let loads = (0..=u8::MAX).zip(&self.loads).filter(|(_, load)| powered && load.mass > 0.0);
        for (chain, load) in loads {
            self.planner.add_weight(chain, load.mass, &position, &mut effort);
        }
        Measurement { position, velocity, effort }
    }

    fn step(&mut self, now: MonoTime, dt: f64) {
        self.supervise_stream(now);
        match (self.power, self.motion) {
            (Power::Off | Power::Starting { .. }, _) => {
                self.decelerate(|drive| drive.brake, dt);
            }
            (Power::On, Motion::Hold) => self.follow(self.hold, dt),
            (Power::On, Motion::Stream { taken }) => {
                self.follow(self.reference(now.saturating_since(taken)), dt);
            }
            (Power::On, Motion::Own) => self.follow_own(dt),
            (Power::On, Motion::Stop) => {
                self.decelerate(|drive| drive.acceleration, dt);
                if self.axes.iter().all(|axis| axis.joint.velocity == 0.0) {
                    self.hold_here();
                }
            }
        }
        let outside = |axis: &Axis| axis.passes_limit(axis.joint.position, axis.joint.velocity);
        if self.power == Power::On && self.axes.iter().any(outside) {
            self.fail(error_code::JOINT_LIMIT);
        }
    }

    /// Where the robot is at rest; `None` while it moves.
    fn rest_position(&self) -> Option<JointVector> {
        match self.motion {
            Motion::Hold => Some(self.hold),
            Motion::Stream { .. } if !self.stream_moves() => Some(self.set_point.joint_position),
            Motion::Stream { .. } | Motion::Own | Motion::Stop => None,
        }
    }

    fn is_moving(&self) -> bool {
        self.enabled() && self.rest_position().is_none()
    }

    /// Whether a joint moves, or is commanded to.
    fn stream_moves(&self) -> bool {
        let commanded = self.set_point.joint_velocity.iter();
        self.axes.iter().zip(commanded).any(|(axis, commanded)| {
            let standstill = STANDSTILL_SHARE * axis.drive.velocity;
            axis.joint.velocity.abs() > standstill || commanded.abs() > standstill
        })
    }

    /// Ends a stream that has gone silent: at rest it just ends, in motion it is an error.
    fn supervise_stream(&mut self, now: MonoTime) {
        let Motion::Stream { taken } = self.motion else { return };
        if now.saturating_since(taken) <= self.watchdog {
            return;
        }
        if self.stream_moves() {
            self.error = error_code::WATCHDOG;
            self.motion = Motion::Stop;
        } else {
            self.hold = self.reference(Duration::ZERO);
            self.motion = Motion::Hold;
        }
    }

    /// Where the joints should be `age` after the set-point came, inside the position limits.
    fn reference(&self, age: Duration) -> JointVector {
        let ahead = age.min(MAX_EXTRAPOLATION).as_secs_f64();
        let mut reference = self.set_point.joint_position;
        let speeds = self.set_point.joint_velocity.iter();
        for ((value, speed), axis) in reference.iter_mut().zip(speeds).zip(&self.axes) {
            let commanded = *value;
            *value += speed * ahead;
            // The speed must not carry it past a limit that the position itself keeps.
            *value = value.clamp(axis.lower.min(commanded), axis.upper.max(commanded));
        }
        reference
    }

    fn follow(&mut self, reference: JointVector, dt: f64) {
        for (axis, &reference) in self.axes.iter_mut().zip(reference.iter()) {
            if axis.blocked {
                axis.joint.block();
            } else {
                axis.joint.follow(&axis.drive, reference, dt);
            }
        }
        let too_far = |(axis, &reference): (&Axis, &f64)| {
            (reference - axis.joint.position).abs() > axis.following_error
        };
        if self.axes.iter().zip(reference.iter()).any(too_far) {
            self.fail(error_code::FOLLOWING_ERROR);
        }
    }

    fn decelerate(&mut self, deceleration: fn(&Drive) -> f64, dt: f64) {
        for axis in &mut self.axes {
            if axis.blocked {
                axis.joint.block();
            }
            axis.joint.decelerate(&axis.drive, deceleration(&axis.drive), dt);
        }
    }

    /// Holds the joints where they are.
    fn hold_here(&mut self) {
        for (hold, axis) in self.hold.iter_mut().zip(&mut self.axes) {
            *hold = axis.joint.position;
            axis.joint.forget_reference();
        }
        self.motion = Motion::Hold;
    }
}
