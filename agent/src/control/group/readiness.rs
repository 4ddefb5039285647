//! What a trajectory allows a group: how soon it stops, how fast its rate may change, how far it goes
//! before the loss of a partner is noticed. Worked out outside the loop, before it is accepted.

use armada_model::{
    CompiledTrajectory, CurveBounds, MotionLimits, OnPath, OnPathError, TimedCurve,
};

use super::pace::Pace;

/// Places at which a stop is looked at.
const STOPS: u32 = 24;
/// Places at which a change of the rate is looked at.
const CHANGES: u32 = 8;
/// Changes of the rate that are tried \[1/s\], fastest first.
const SLOPES: [f64; 6] = [4.0, 2.8, 2.0, 1.4, 1.0, 0.5];
/// How far a robot may be from one that follows the common rate exactly \[s\].
const ASTRAY_S: f64 = 0.008;
/// Tick of the look \[s\].
const TICK_S: f64 = 0.004;
/// Times at which the travel from the start is looked at.
const LOOKS: u32 = 12;
/// How much faster than the common rate a robot has to be able to change its own.
const CATCH_UP: f64 = 2.0;
/// Longest stretch that is suggested.
const MAX_STRETCH: f64 = 64.0;

/// The change of the common rate where a trajectory leaves no room for one that was verified
/// \[1/s\]: robots follow it as well as they can.
pub const GENTLE_SLOPE_S: f64 = 0.5;

/// What a trajectory allows a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readiness {
    /// Longest time to rest on the path \[s\], of those from a number of places.
    pub stop_time_s: f64,
    /// Fastest change of the rate that it can follow \[1/s\], of some that were tried; 0 for none.
    pub rate_slope_s: f64,
}

/// Furthest that a joint is from its start after a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartTravel {
    /// Which joint.
    pub joint: usize,
    /// Twice its distance, for it takes as long to stop \[rad or m\].
    pub travel: f64,
}

impl Readiness {
    /// What `trajectory` allows within `limits`.
    ///
    /// # Errors
    /// [`OnPathError::JointCount`] if the limits are for another number of joints.
    pub fn of(trajectory: &CompiledTrajectory, limits: &MotionLimits) -> Result<Self, OnPathError> {
        let duration_s = trajectory.duration_s();
        let place = |index: u32, count: u32| (f64::from(index) + 0.5) / f64::from(count);
        let mut stop_time_s = 0.0_f64;
        for index in 0..STOPS {
            let path = OnPath::join(trajectory, limits, place(index, STOPS) * duration_s)?;
            stop_time_s = stop_time_s.max(path.predicted_stop(trajectory).time_s);
        }
        let mut rate_slope_s = 0.0;
        for slope in SLOPES {
            let mut places = (0..CHANGES).map(|index| place(index, CHANGES) * duration_s);
            if places.all(|from_s| follows(trajectory, limits, from_s, slope).unwrap_or(false)) {
                rate_slope_s = slope;
                break;
            }
        }
        Ok(Self { stop_time_s, rate_slope_s })
    }
}

impl StartTravel {
    /// Of the joint of `trajectory` that gets furthest within `window_s` \[s\].
    #[must_use]
    pub fn of(trajectory: &CompiledTrajectory, window_s: f64) -> Self {
        let start = trajectory.start();
        let mut furthest = Self { joint: 0, travel: 0.0 };
        for look in 1..=LOOKS {
            let time_s = window_s * f64::from(look) / f64::from(LOOKS);
            let point = trajectory.point(time_s.min(trajectory.duration_s()), &mut 0);
            for (joint, (at, from)) in point.position.iter().zip(start.iter()).enumerate() {
                let travel = 2.0 * (at - from).abs();
                if travel > furthest.travel {
                    furthest = Self { joint, travel };
                }
            }
        }
        furthest
    }

    /// How many times longer `trajectory` has to take for a travel of at most `limit`.
    #[must_use]
    pub fn stretch(trajectory: &CompiledTrajectory, window_s: f64, limit: f64) -> f64 {
        least_stretch(|stretch| Self::of(trajectory, window_s / stretch).travel <= limit)
    }
}

/// How many times longer `trajectory` has to take for a change of the rate of `slope` \[1/s\] to be
/// legal everywhere, by bounds of its derivatives, with room to catch up.
#[must_use]
pub fn stretch_for_slope(
    trajectory: &CompiledTrajectory,
    limits: &MotionLimits,
    slope: f64,
) -> f64 {
    let slope = CATCH_UP * slope;
    let mut bounds = CurveBounds::EMPTY;
    trajectory.bounds(0.0, trajectory.duration_s(), &mut 0, &mut bounds);
    least_stretch(|stretch| {
        limits.iter().enumerate().all(|(joint, axis)| {
            let (first, second) = (bounds.first[joint].peak(), bounds.second[joint].peak());
            let jerk =
                if TimedCurve::limits_jerk(trajectory) { bounds.third[joint].peak() } else { 0.0 };
            let acceleration = second / stretch.powi(2) + slope * first / stretch;
            let jerk = jerk / stretch.powi(3) + 3.0 * slope * second / stretch.powi(2);
            acceleration <= axis.acceleration && jerk <= axis.jerk
        })
    })
}

fn least_stretch(suffices: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (1.0, MAX_STRETCH);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if suffices(middle) { high = middle } else { low = middle }
    }
    high
}

/// Whether a motion that is at `from_s` can follow the common rate to rest and back to full speed.
fn follows(
    trajectory: &CompiledTrajectory,
    limits: &MotionLimits,
    from_s: f64,
    slope: f64,
) -> Result<bool, OnPathError> {
    let mut path = OnPath::join(trajectory, limits, from_s)?;
    let (mut pace, mut ideal) = (Pace::at(1.0), Pace::at(1.0));
    let mut ideal_s = path.phase_s();
    let ticks = (1.0 / slope / TICK_S).ceil() as u32 + 50;
    for target in [0.0, 1.0] {
        for _ in 0..ticks {
            pace.follow(target, from_s, path.phase_s(), (slope, TICK_S));
            path.set_speed_ratio(pace.rate())?;
            path.tick(trajectory, TICK_S);
            ideal.follow(target, from_s, ideal_s, (slope, TICK_S));
            ideal_s += ideal.rate() * TICK_S;
            if path.is_finished() {
                return Ok(true);
            }
            if (path.phase_s() - ideal_s).abs() > ASTRAY_S {
                return Ok(false);
            }
        }
    }
    Ok(path.rate() == 1.0)
}
