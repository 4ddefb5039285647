//! A motion under way: pause, resume, another speed, a stop on the path.
//!
//! ```text
//! TimedCurve, limits --start--> OnPath --tick(curve, dt)--> PathState
//!                                 ^ set_speed_ratio, pause, resume, stop
//! OnlineState, next curve --plan--> Transition --at(t)--> OnlineState, then OnPath::join
//! ```
//!
//! # The model
//!
//! The curve `q(s)` is legal at its own speed. On it the phase `s` runs with a rate `r`, from 0 to
//! 1, and `u = dr/dt`, `w = du/dt`. With `'` for the derivative by the phase each joint has
//!
//! ```text
//! velocity      q' r
//! acceleration  q'' r² + q' u
//! jerk          q''' r³ + 3 q'' r u + q' w
//! ```
//!
//! Velocity is legal at any rate. At `u = w = 0` so are acceleration and jerk, being those of the
//! curve times a number up to 1: a constant rate is always possible. Jerk is limited in total where
//! the curve promises to keep it ([`TimedCurve::limits_jerk`]). Where it does not, as a cubic with
//! jumps of acceleration, what the motion *adds* is limited: `3 q'' r u + q' w`.
//!
//! # Never beyond a limit
//!
//! At every time there is a *way back*: constant `w` until `u = 0`, then a constant rate. A step is
//! taken only if the step itself and the way back from its end keep all limits. If no such step
//! goes toward the rate that is asked for, the next piece of the way back is taken. By induction
//! there is always a legal next step: the first way back is the constant rate, the next one was
//! checked with the step before it, and a piece of it leaves the rest of it.
//!
//! "Keep all limits" is decided for whole pieces of time, not for samples of them: the curve gives
//! bounds of its derivatives between two phases, the piece bounds of `r` and `u`, and the two
//! formulae above are evaluated in interval arithmetic. So it holds between the ticks as well, for
//! ticks of any length, and across the knots of the curve.
//!
//! # Least time
//!
//! Without a limit of jerk the strongest `u` at every instant is the shortest stop. Let `x = r²` as
//! a function of the phase: `dx/ds = 2u`, and `u` is bounded below by the largest of the joints'
//! `(-A - q'' x) / q'`, a function of `s` and `x` alone. The profile that always takes the lowest
//! slope is nowhere above any other legal one that starts with it, by comparison: where they meet,
//! its slope is not higher. So it has the lowest rate at each phase and stops at the earliest, and
//! taking the lowest slope never leads to where none is left, as zero is always allowed. It is the
//! stop of least time too wherever the bound does not fall along the path faster than the profile
//! itself; else one could, in principle, win time by hurrying on to where it is easier to brake.
//!
//! With the limit of jerk the same greedy choice is made among the steps that have a way back. It
//! loses the time in which `u` builds up and goes back, the latter at three quarters of the jerk.
//!
//! A curve that brakes at the limit of a joint cannot be slowed down faster there. Where a curve
//! that promises to limit its jerk is at that limit, no way back can be added to it at full speed: a
//! stop that is asked for there begins when that phase of the curve ends, or when the rate is lower.

mod compiled_curve;
mod curve;
mod legality;
mod motion;
mod move_curves;
mod ramp;
mod rate;
mod transition;

pub use curve::{CurveBounds, CurvePoint, Span, TimedCurve};
pub use motion::{OnPath, OnPathError, PathState, PredictedStop};
pub use transition::Transition;
