//! The emulated controller behind the packets: power, errors, the stream of commands, the joints.
//!
//! ```text
//! power   Off --power on--> Starting --enable time--> On --power off, error, emergency stop--> Off
//! motion  Hold --command--> Stream --silence at rest--> Hold
//!         (On)              Stream --silence in motion--> Stop (error) --standstill--> Hold
//! ```
//!
//! Off: the brakes decelerate each joint and hold it. Commands count while drives are on and no
//! error is in force. An error switches the drives off, but for the watchdog's: there the drives
//! decelerate at their limit and hold.

use std::time::Duration;

use armada_model::{JointVector, MonoTime};

use super::EmulatorConfig;
use super::axis::{Axis, check_initial_names};
use super::dynamics::Drive;
use super::noise::Noise;
use crate::config::millis;
use crate::drivers::{DriverSetup, SetPoint, SetupError};

/// Errors the emulated controller makes itself; injected ones may have any number.
pub mod error_code {
    /// Commands went silent in motion.
    pub const WATCHDOG: u32 = 101;
    /// A joint went, or was commanded, past its position limit.
    pub const JOINT_LIMIT: u32 = 102;
    /// A joint was too far from its reference.
    pub const FOLLOWING_ERROR: u32 = 103;
}

/// Longest step of the integration; a controller cycle is cut into equal parts of at most this.
const MAX_STEP: Duration = Duration::from_millis(1);
/// How long the reference goes on at the commanded speed when no newer command comes.
const MAX_EXTRAPOLATION: Duration = Duration::from_millis(20);
/// Speed below which a joint counts as standing, as a share of its drive's highest.
const STANDSTILL_SHARE: f64 = 1e-3;

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
    emergency_stop: bool,
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
        Ok(Self {
            axes,
            power: Power::Off,
            motion: Motion::Hold,
            set_point: SetPoint { joint_position: hold, joint_velocity: hold },
            hold,
            error: 0,
            emergency_stop: false,
            noise: Noise::new(config.noise_seed),
            enable_time: millis(config.enable_time_ms),
            watchdog: millis(config.watchdog_ms),
        })
    }

    /// Begins to switch the drives on, unless an error or the emergency stop forbids it.
    pub(super) fn power_on(&mut self, now: MonoTime) {
        if self.power == Power::Off && self.error == 0 && !self.emergency_stop {
            self.power = Power::Starting { done: now + self.enable_time };
        }
    }

    /// Switches the drives off; the brakes stop the joints.
    pub(super) fn power_off(&mut self) {
        self.power = Power::Off;
        self.motion = Motion::Hold;
    }

    /// Clears the error; an emergency stop stays.
    pub(super) fn reset_errors(&mut self) {
        self.error = 0;
    }

    /// Switches the drives off with an error; the first error stays until it is reset.
    pub(super) fn fail(&mut self, error: u32) {
        if self.error == 0 {
            self.error = error;
        }
        self.power_off();
    }

    /// Presses or releases the emergency stop; after release the drives stay off.
    pub(super) fn set_emergency_stop(&mut self, pressed: bool) {
        self.emergency_stop = pressed;
        if pressed {
            self.power_off();
        }
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
        if !self.ready() || set_point.joint_position.len() != self.axes.len() {
            return;
        }
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
            self.hold_here();
        }
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
        self.enabled() && self.error == 0
    }

    /// The error in force; 0 for none.
    pub(super) const fn error(&self) -> u32 {
        self.error
    }

    /// Whether the emergency stop is pressed.
    pub(super) const fn emergency_stop(&self) -> bool {
        self.emergency_stop
    }

    /// Number of joints.
    pub(super) const fn joint_count(&self) -> usize {
        self.axes.len()
    }

    /// Measures all joints, with noise.
    pub(super) fn measure(&mut self) -> Measurement {
        let powered = self.power == Power::On;
        let Self { axes, noise, hold, .. } = self;
        let mut measure = |value: fn(&Axis, &mut Noise) -> f64| {
            let mut values = *hold; // for its length only
            values.iter_mut().zip(&*axes).for_each(|(out, axis)| *out = value(axis, noise));
            values
        };
        Measurement {
            position: measure(|axis, noise| axis.joint.position + noise.next(axis.position_noise)),
            velocity: measure(|axis, noise| axis.joint.velocity + noise.next(axis.velocity_noise)),
            effort: measure(if powered {
                |axis, _| axis.joint.effort(&axis.drive)
            } else {
                |_, _| 0.0
            }),
        }
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

    /// Ends a stream that has gone silent: at rest it just ends, in motion it is an error.
    fn supervise_stream(&mut self, now: MonoTime) {
        let Motion::Stream { taken } = self.motion else { return };
        if now.saturating_since(taken) <= self.watchdog {
            return;
        }
        let commanded = self.set_point.joint_velocity.iter();
        let moves = self.axes.iter().zip(commanded).any(|(axis, commanded)| {
            let standstill = STANDSTILL_SHARE * axis.drive.velocity;
            axis.joint.velocity.abs() > standstill || commanded.abs() > standstill
        });
        if moves {
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
