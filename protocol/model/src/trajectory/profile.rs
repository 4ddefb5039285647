//! Time-optimal motion of one axis to rest at a target.

use super::motion_limits::AxisLimits;
use serde::{Deserialize, Serialize};

/// Position and velocity of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AxisState {
    /// Position \[rad or m\].
    pub position: f64,
    /// Velocity \[rad/s or m/s\].
    pub velocity: f64,
}

/// The fastest motion of one axis from a state to rest at a target, under a limit of velocity and
/// of acceleration: speed up (or slow down) to a peak velocity, hold it, brake.
///
/// Any start velocity is taken. One above the limit is first reduced to it; one that cannot be
/// braked before the target overshoots and returns; so does one that points away.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisProfile {
    start: AxisState,
    target: f64,
    /// Acceleration until `cruise_from_s`, with its sign.
    acceleration: f64,
    /// Velocity between `cruise_from_s` and `brake_from_s`, with its sign.
    peak_velocity: f64,
    /// Acceleration from `brake_from_s` on, of opposite sign to the peak velocity.
    deceleration: f64,
    cruise_from_s: f64,
    brake_from_s: f64,
    duration_s: f64,
}

/// Why there is no profile.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// A value, or the duration that follows from the values, is infinite or not a number.
    #[error("{field} is {value}, which is not finite")]
    NotFinite {
        /// Which value.
        field: &'static str,
        /// The value.
        value: f64,
    },
    /// A limit is not above zero.
    #[error("{field} is {value}, expected above 0")]
    NotPositive {
        /// Which limit.
        field: &'static str,
        /// The value.
        value: f64,
    },
}

impl AxisProfile {
    /// The fastest motion from `start` to rest at `target`. Of `limits` only velocity and
    /// acceleration are used; for the positions see [`range`](Self::range).
    ///
    /// # Errors
    /// [`ProfileError::NotFinite`] if a value or the resulting duration is not finite,
    /// [`ProfileError::NotPositive`] if a limit is not above zero.
    pub fn plan(start: AxisState, target: f64, limits: &AxisLimits) -> Result<Self, ProfileError> {
        finite("start position", start.position)?;
        finite("start velocity", start.velocity)?;
        finite("target position", target)?;
        let v_max = positive("velocity limit", limits.velocity)?;
        let a_max = positive("acceleration limit", limits.acceleration)?;
        let distance = target - start.position;
        // If full braking ends short of the target, the motion is towards positive, else negative.
        let braking_distance = 0.5 * start.velocity * start.velocity.abs() / a_max;
        let sign = if braking_distance <= distance { 1.0 } else { -1.0 };
        let profile = Self::towards(sign, start, target, (v_max, a_max));
        finite("duration", profile.duration_s)?;
        Ok(profile)
    }

    /// Speed-up towards `sign`, cruise and braking. Seen along `sign`, braking at once must not
    /// end beyond the target; then every duration below is zero or more.
    fn towards(sign: f64, start: AxisState, target: f64, (v_max, a_max): (f64, f64)) -> Self {
        let distance = sign * (target - start.position);
        let v0 = sign * start.velocity;
        // Without a limit of velocity: v² = v0² + 2 a d1, v² = 2 a d3, d1 + d3 = distance.
        let unlimited_peak = (a_max * distance + 0.5 * v0 * v0).max(0.0).sqrt();
        let peak = unlimited_peak.min(v_max);
        let speed_up_s = (peak - v0).abs() / a_max;
        let brake_s = peak / a_max;
        let cruise_distance = distance - 0.5 * (v0 + peak) * speed_up_s - 0.5 * peak * brake_s;
        let cruise_s = if unlimited_peak > v_max { (cruise_distance / peak).max(0.0) } else { 0.0 };
        Self {
            start,
            target,
            acceleration: sign * a_max.copysign(peak - v0),
            peak_velocity: sign * peak,
            deceleration: -sign * a_max,
            cruise_from_s: speed_up_s,
            brake_from_s: speed_up_s + cruise_s,
            duration_s: speed_up_s + cruise_s + brake_s,
        }
    }

    /// This profile, which must go from rest at 0 to 1, stretched in space: from rest at `from` to
    /// `to` in the same time and the same phases.
    pub(super) fn stretched(&self, from: f64, to: f64) -> Self {
        let distance = to - from;
        Self {
            start: AxisState { position: from, velocity: 0.0 },
            target: to,
            acceleration: distance * self.acceleration,
            peak_velocity: distance * self.peak_velocity,
            deceleration: distance * self.deceleration,
            ..*self
        }
    }

    /// Rest at `position`, for ever.
    pub(super) const fn resting(position: f64) -> Self {
        Self {
            start: AxisState { position, velocity: 0.0 },
            target: position,
            acceleration: 0.0,
            peak_velocity: 0.0,
            deceleration: 0.0,
            cruise_from_s: 0.0,
            brake_from_s: 0.0,
            duration_s: 0.0,
        }
    }

    /// How long the motion takes \[s\].
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Where the motion ends.
    #[must_use]
    pub const fn target(&self) -> f64 {
        self.target
    }

    /// The state at `t_s` \[s since the start\]: the start before zero, at rest at exactly the
    /// target from the duration on.
    #[must_use]
    pub fn at(&self, t_s: f64) -> AxisState {
        if t_s >= self.duration_s {
            return AxisState { position: self.target, velocity: 0.0 };
        }
        let t_s = t_s.max(0.0);
        if t_s == 0.0 {
            return self.start;
        }
        if t_s < self.cruise_from_s {
            return self.speeding_up(t_s);
        }
        if t_s < self.brake_from_s {
            let from = self.speeding_up(self.cruise_from_s).position;
            let position = from + self.peak_velocity * (t_s - self.cruise_from_s);
            return AxisState { position, velocity: self.peak_velocity };
        }
        // Counted back from the end, so that rounding cannot make the last step a jump.
        let left_s = self.duration_s - t_s;
        AxisState {
            position: self.target + 0.5 * self.deceleration * left_s * left_s,
            velocity: -self.deceleration * left_s,
        }
    }

    /// Its three phases of constant acceleration: when each begins and ends \[s\], and which
    /// \[1/s²\].
    pub(crate) const fn phases(&self) -> [(f64, f64, f64); 3] {
        [
            (0.0, self.cruise_from_s, self.acceleration),
            (self.cruise_from_s, self.brake_from_s, 0.0),
            (self.brake_from_s, self.duration_s, self.deceleration),
        ]
    }

    /// Lowest and highest position of the whole motion: start, target, and where it turns.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        let (mut low, mut high) = ends(self.start.position, self.target);
        // Velocity changes its sign at most once, during the speed-up.
        if self.start.velocity * self.peak_velocity < 0.0 {
            let turn_s = (self.start.velocity / self.acceleration).abs();
            let turn = self.speeding_up(turn_s).position;
            (low, high) = (low.min(turn), high.max(turn));
        }
        (low, high)
    }

    fn speeding_up(&self, t_s: f64) -> AxisState {
        let AxisState { position, velocity } = self.start;
        AxisState {
            position: position + t_s * (velocity + 0.5 * self.acceleration * t_s),
            velocity: velocity + self.acceleration * t_s,
        }
    }
}

fn ends(a: f64, b: f64) -> (f64, f64) {
    (a.min(b), a.max(b))
}

fn finite(field: &'static str, value: f64) -> Result<f64, ProfileError> {
    if value.is_finite() { Ok(value) } else { Err(ProfileError::NotFinite { field, value }) }
}

fn positive(field: &'static str, value: f64) -> Result<f64, ProfileError> {
    if finite(field, value)? > 0.0 {
        Ok(value)
    } else {
        Err(ProfileError::NotPositive { field, value })
    }
}
