//! One emulated joint: a drive with limits that follows a reference with a lag.
//!
//! ```text
//! reference --first-order lag--> target --position controller--> speed --integrator--> position
//!                                             | speed and acceleration limits
//! ```
//!
//! The target's own speed is fed forward, so a reference that keeps the limits is followed with
//! exactly the lag; one that breaks them is caught up with at the limits and without overshoot.

/// What the drive of a joint can do, in the joint's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drive {
    /// Highest speed \[1/s\].
    pub(super) velocity: f64,
    /// Highest acceleration under control \[1/s²\].
    pub(super) acceleration: f64,
    /// Deceleration of the brake \[1/s²\].
    pub(super) brake: f64,
    /// Time constant of the lag \[s\].
    pub(super) time_constant: f64,
    /// Mechanical stop below; infinite if there is none.
    pub(super) lower_stop: f64,
    /// Mechanical stop above; infinite if there is none.
    pub(super) upper_stop: f64,
    /// Effort limit that scales the reported effort \[Nm or N\].
    pub(super) effort: f64,
    /// Whether the effort of gravity depends on the position, as that of a turning joint.
    pub(super) turns: bool,
}

/// Motion of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Joint {
    /// Where it is.
    pub(super) position: f64,
    /// Its speed.
    pub(super) velocity: f64,
    /// Its acceleration in the last step.
    pub(super) acceleration: f64,
    /// The reference after the lag.
    target: f64,
}

/// Share of the acceleration that plans the catching-up; the rest is for the target's own.
const CATCH_UP_SHARE: f64 = 0.8;
/// Shares of the effort limit: gravity, full acceleration, full speed.
const GRAVITY_EFFORT: f64 = 0.3;
const ACCELERATION_EFFORT: f64 = 0.3;
const FRICTION_EFFORT: f64 = 0.05;

impl Joint {
    /// A joint at rest.
    pub(super) const fn at(position: f64) -> Self {
        Self { position, velocity: 0.0, acceleration: 0.0, target: position }
    }

    /// Follows `reference` for `dt` seconds.
    pub(super) fn follow(&mut self, drive: &Drive, reference: f64, dt: f64) {
        let before = self.target;
        self.target += (1.0 - (-dt / drive.time_constant).exp()) * (reference - before);
        let feed_forward = (self.target - before) / dt;
        let wanted = (feed_forward + catch_up(drive, before - self.position))
            .clamp(-drive.velocity, drive.velocity);
        self.accelerate(wanted, drive.acceleration, dt);
        self.position += self.velocity * dt;
        self.hit_stops(drive);
    }

    /// Decelerates towards standstill for `dt` seconds and forgets the reference.
    pub(super) fn decelerate(&mut self, drive: &Drive, deceleration: f64, dt: f64) {
        let before = self.velocity;
        self.accelerate(0.0, deceleration, dt);
        self.position += 0.5 * (before + self.velocity) * dt;
        self.hit_stops(drive);
        self.forget_reference();
    }

    /// Begins to follow from where it is.
    pub(super) const fn forget_reference(&mut self) {
        self.target = self.position;
    }

    /// Stands still at once, as a joint that is mechanically blocked.
    pub(super) const fn block(&mut self) {
        self.velocity = 0.0;
        self.acceleration = 0.0;
    }

    /// Effort that the drive reports, of a shape like a real one and nothing more: a weight, the
    /// acceleration and viscous friction, each as a share of the effort limit.
    pub(super) fn effort(&self, drive: &Drive) -> f64 {
        let gravity = if drive.turns { self.position.cos() } else { 1.0 };
        let share = GRAVITY_EFFORT * gravity
            + ACCELERATION_EFFORT * self.acceleration / drive.acceleration
            + FRICTION_EFFORT * self.velocity / drive.velocity;
        share * drive.effort
    }

    fn accelerate(&mut self, wanted: f64, limit: f64, dt: f64) {
        let change = (wanted - self.velocity).clamp(-limit * dt, limit * dt);
        self.velocity += change;
        self.acceleration = change / dt;
    }

    fn hit_stops(&mut self, drive: &Drive) {
        if self.position < drive.lower_stop {
            self.position = drive.lower_stop;
            self.velocity = self.velocity.max(0.0);
        } else if self.position > drive.upper_stop {
            self.position = drive.upper_stop;
            self.velocity = self.velocity.min(0.0);
        }
    }
}

/// Speed that brings an error to zero: proportional near the target, further away the speed from
/// which the drive can still stop in time.
fn catch_up(drive: &Drive, error: f64) -> f64 {
    let deceleration = CATCH_UP_SHARE * drive.acceleration;
    let gain = 1.0 / drive.time_constant;
    let near = deceleration / (gain * gain);
    if error.abs() <= near {
        gain * error
    } else {
        (2.0 * deceleration * (error.abs() - 0.5 * near)).sqrt().copysign(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVE: Drive = Drive {
        velocity: 2.0,
        acceleration: 5.0,
        brake: 10.0,
        time_constant: 0.008,
        lower_stop: -3.0,
        upper_stop: 3.0,
        effort: 100.0,
        turns: true,
    };
    const DT: f64 = 0.001;

    #[test]
    fn a_ramp_is_followed_with_exactly_the_lag() {
        let mut joint = Joint::at(0.0);
        let mut reference = 0.0;
        for step in 0..2000 {
            let speed = (f64::from(step) * DT * 4.0).min(1.0);
            reference += speed * DT;
            joint.follow(&DRIVE, reference, DT);
        }
        let lag = (reference - joint.position) / joint.velocity;
        assert!((lag - DRIVE.time_constant).abs() < 0.001, "lag {lag} s");
    }

    #[test]
    fn a_step_is_reached_within_the_limits_and_without_overshoot() {
        let mut joint = Joint::at(0.0);
        let mut peak: f64 = 0.0;
        for _ in 0..3000 {
            let before = joint.velocity;
            joint.follow(&DRIVE, 1.5, DT);
            assert!(joint.velocity.abs() <= DRIVE.velocity);
            assert!((joint.velocity - before).abs() <= DRIVE.acceleration * DT * (1.0 + 1e-9));
            peak = peak.max(joint.position);
        }
        assert!((joint.position - 1.5).abs() < 1e-6, "ended at {}", joint.position);
        assert!(peak < 1.505, "overshot to {peak}");
    }

    #[test]
    fn deceleration_takes_the_distance_of_its_closed_form() {
        let mut joint = Joint { velocity: 1.0, ..Joint::at(0.0) };
        for _ in 0..300 {
            joint.decelerate(&DRIVE, 5.0, DT);
        }
        assert_eq!(joint.velocity, 0.0);
        assert!((joint.position - 0.1).abs() < 1e-9, "stopped after {}", joint.position);
    }

    #[test]
    fn the_mechanical_stop_ends_every_motion() {
        let mut joint = Joint { velocity: 2.0, ..Joint::at(2.99) };
        joint.decelerate(&DRIVE, 0.1, 0.1);
        assert_eq!((joint.position, joint.velocity), (3.0, 0.0));
    }
}
