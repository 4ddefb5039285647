//! Retiming within limits of jerk.
//!
//! The time-optimal `s(t)` switches its acceleration at once. Its mean over a moving window of
//! time has the same way, and a jerk that is constant between the switches as seen through the
//! window. Where that still breaks a limit at some place of the path, the place is passed more
//! slowly in the next try; what remains after the last try is removed by slowing all down.

use super::geometric::{GeometricPath, PathRows};
use super::retime::{RetimeError, RetimeOptions, Retimer};
use super::timed::{PathKnot, TimedPath};
use crate::AxisLimits;

/// Widths of the window that are tried, as multiples of the longest time that a joint takes from
/// no acceleration to its highest: 1 suffices from rest, 2 for switching from one limit to the
/// other.
const WINDOWS: [f64; 4] = [1.0, 1.4, 2.0, 2.8];

/// Further ones for motions that are short, in multiples of that time: they may not reach their
/// highest acceleration.
const SHORT_WINDOWS: [f64; 3] = [0.15, 0.3, 0.6];
const SHORT: f64 = 40.0;

/// Tries with one window, and excess at which there is no need for another.
const TRIES: usize = 12;
const ENOUGH: f64 = 1.0 + 1e-3;

/// Fewest looks per interval of constant jerk.
const LOOKS: f64 = 2.0;

/// Longest time between two of the last looks, as a share of the shortest time that a joint takes
/// to its highest acceleration, and the longest and shortest, as shares of the duration.
const LAST_LOOK: f64 = 0.005;
const LONGEST_LOOK: f64 = 5e-4;
const SHORTEST_LOOK: f64 = 1e-5;

/// Slows down beyond what was seen, for what lies between two looks.
const MARGIN: f64 = 1.0 + 1e-5;

/// How far before and behind a breakpoint of the path it is looked at, as a share of the path.
const ASIDE: f64 = 1e-9;

/// Halvings until the time of a breakpoint is known.
const HALVINGS: u32 = 48;

/// A fast motion along `path` from rest to rest within `limits` of velocity, acceleration and
/// jerk, one per coordinate; acceleration is continuous. Positions of the path are checked too.
///
/// Limits are checked in steps of a two-hundredth of the time that a joint takes to its highest
/// acceleration, 0.25 ms where the jerk limit is the default one. The motion is not optimal, but
/// where joints reach their limits of acceleration it takes only some hundredths longer than that
/// of [`retime`](super::retime()). It costs some hundred times as much to find: tens of milliseconds.
///
/// # Errors
/// [`RetimeError`] as for [`retime`](super::retime()), and [`RetimeError::NotFromRest`] if the
/// options ask for motion at an end.
pub fn retime_jerk_limited<P: GeometricPath>(
    path: P,
    limits: &[AxisLimits],
    options: &RetimeOptions,
) -> Result<TimedPath<P>, RetimeError> {
    for (field, value) in
        [("start_velocity", options.start_velocity), ("end_velocity", options.end_velocity)]
    {
        if value != 0.0 {
            return Err(RetimeError::NotFromRest { field, value });
        }
    }
    let retimer = Retimer::new(&path, limits, options)?;
    let reach_s = limits.iter().map(|axis| axis.acceleration / axis.jerk).fold(0.0, f64::max);
    let mut best: Option<Vec<PathKnot>> = None;
    let is_short = retimer.retime(&[])?.duration_s() < SHORT * reach_s;
    let windows = if is_short { SHORT_WINDOWS.iter() } else { [].iter() };
    for window in windows.chain(&WINDOWS) {
        let found = Smoother { retimer: &retimer, limits, width_s: window * reach_s }.search()?;
        if best.as_ref().is_none_or(|best| duration_s(&found) < duration_s(best)) {
            best = Some(found);
        }
    }
    let found = TimedPath::from_knots(&path, limits, best.unwrap_or_default());
    let mut needed = 1.0_f64;
    let shortest_s = limits.iter().map(|axis| axis.acceleration / axis.jerk).fold(1.0, f64::min);
    let time_s = found.duration_s();
    let step_s = (LAST_LOOK * shortest_s).min(LONGEST_LOOK * time_s).max(SHORTEST_LOOK * time_s);
    look(&found, step_s, |_, slowness| needed = needed.max(slowness * MARGIN));
    let knots = stretched(found.knots(), needed);
    if !duration_s(&knots).is_finite() {
        return Err(RetimeError::Standstill { fraction: 0.0 });
    }
    Ok(TimedPath::from_knots(path, limits, knots))
}

/// Tries with one window.
struct Smoother<'a, P> {
    retimer: &'a Retimer<'a, P>,
    limits: &'a [AxisLimits],
    width_s: f64,
}

impl<P: GeometricPath> Smoother<'_, P> {
    /// The fastest motion of some tries, slowed down until it keeps all limits.
    fn search(&self) -> Result<Vec<PathKnot>, RetimeError> {
        let grid = self.retimer.grid();
        let mut slowness = vec![1.0; grid.len()];
        let mut best: Option<(f64, f64, Vec<PathKnot>)> = None;
        for _ in 0..TRIES {
            let sharp = self.retimer.retime(&slowness)?;
            let path = *sharp.path();
            let smooth = TimedPath::from_knots(path, self.limits, smooth(&sharp, self.width_s));
            let (mut needed, mut factors) = (1.0_f64, vec![1.0_f64; grid.len()]);
            look(&smooth, f64::INFINITY, |time_s, excess| {
                if excess <= 1.0 {
                    return;
                }
                needed = needed.max(excess);
                // What of the sharp motion is seen through the window at this time.
                let from = sharp.state_at(time_s - self.width_s).s;
                let to = sharp.state_at(time_s).s;
                let first = grid.partition_point(|&s| s < from).saturating_sub(1);
                let end = (grid.partition_point(|&s| s <= to) + 1).min(grid.len());
                for factor in &mut factors[first..end] {
                    *factor = factor.min(1.0 / excess);
                }
            });
            let duration_s = smooth.duration_s() * needed;
            if best.as_ref().is_none_or(|(best_s, _, _)| duration_s < *best_s) {
                best = Some((duration_s, needed, smooth.knots().to_vec()));
            }
            if needed <= ENOUGH {
                break;
            }
            for (slowness, factor) in slowness.iter_mut().zip(factors) {
                *slowness *= factor;
            }
        }
        Ok(best.map(|(_, needed, knots)| stretched(&knots, needed)).unwrap_or_default())
    }
}

/// The mean of `sharp` over a window of `width_s`; it takes that much longer.
fn smooth<P: GeometricPath>(sharp: &TimedPath<P>, width_s: f64) -> Vec<PathKnot> {
    let integral = Integral::new(sharp.knots());
    let origin = integral.origin;
    let early = sharp.knots().iter().map(|knot| knot.time_s);
    let late = sharp.knots().iter().map(|knot| knot.time_s + width_s);
    let mut times: Vec<f64> = early.chain(late).collect();
    times.sort_by(f64::total_cmp);
    times.dedup_by(|later, earlier| *later - *earlier < 1e-9 * width_s);
    let state = |time_s: f64| {
        let (entering, leaving) = (integral.at(time_s), integral.at(time_s - width_s));
        PathKnot {
            time_s,
            s: origin + (entering.area - leaving.area) / width_s,
            velocity: ((entering.s - leaving.s) / width_s).max(0.0),
            acceleration: (entering.velocity - leaving.velocity) / width_s,
            jerk: 0.0,
        }
    };
    let mut knots: Vec<PathKnot> = times.iter().copied().map(state).collect();
    for (knot, ends) in knots.iter_mut().zip(times.windows(2)) {
        // In the middle rounding cannot take the acceleration of a neighbour.
        let middle = 0.5 * (ends[0] + ends[1]);
        let (entering, leaving) = (integral.at(middle), integral.at(middle - width_s));
        knot.jerk = (entering.acceleration - leaving.acceleration) / width_s;
    }
    let mut furthest = origin;
    for knot in &mut knots {
        // The means are differences, so that rounding could let them go back.
        furthest = knot.s.max(furthest).min(sharp.path().range().1);
        knot.s = furthest;
    }
    if let (Some(last), Some(end)) = (knots.last_mut(), sharp.knots().last()) {
        *last = PathKnot { time_s: last.time_s, s: end.s, ..PathKnot::default() };
    }
    knots
}

/// The way since the start, its derivatives and its integral over time.
struct Integral<'a> {
    knots: &'a [PathKnot],
    areas: Vec<f64>,
    origin: f64,
}

#[derive(Clone, Copy, Default)]
struct Moment {
    area: f64,
    s: f64,
    velocity: f64,
    acceleration: f64,
}

impl<'a> Integral<'a> {
    fn new(knots: &'a [PathKnot]) -> Self {
        let origin = knots.first().map_or(0.0, |first| first.s);
        let mut found = Self { knots, areas: vec![0.0], origin };
        for (index, next) in knots.iter().enumerate().skip(1) {
            let moment = found.within(index - 1, next.time_s);
            found.areas.push(moment.area);
        }
        found
    }

    /// At rest before the first knot and after the last.
    fn at(&self, time_s: f64) -> Moment {
        let after = self.knots.partition_point(|knot| knot.time_s <= time_s);
        if after == 0 {
            return Moment::default();
        }
        let moment = self.within(after - 1, time_s);
        if after < self.knots.len() {
            return moment;
        }
        Moment { velocity: 0.0, acceleration: 0.0, ..moment }
    }

    fn within(&self, index: usize, time_s: f64) -> Moment {
        let knot = &self.knots[index];
        let tau = time_s - knot.time_s;
        let way = knot.s - self.origin;
        let PathKnot { velocity, acceleration, .. } = *knot;
        Moment {
            area: self.areas[index]
                + tau * (way + tau * (0.5 * velocity + tau * acceleration / 6.0)),
            s: way + tau * (velocity + tau * 0.5 * acceleration),
            velocity: velocity + tau * acceleration,
            acceleration,
        }
    }
}

/// Tells for times at most `step_s` apart, and twice in each interval, by what factor the motion
/// would have to be slower there to keep all limits; also on both sides of each breakpoint.
fn look<P: GeometricPath>(timed: &TimedPath<P>, step_s: f64, mut tell: impl FnMut(f64, f64)) {
    let joints = timed.limits().len();
    let (mut rows, mut third) = (vec![0.0; 3 * joints], vec![0.0; joints]);
    let mut tell = |state: PathKnot| {
        timed.path().evaluate(state.s, &mut PathRows::split(&mut rows));
        timed.path().third_derivative(state.s, &mut third);
        tell(state.time_s, slowness(&state, &rows, &third, timed.limits()));
    };
    for ends in timed.knots().windows(2) {
        let length_s = ends[1].time_s - ends[0].time_s;
        let looks = LOOKS.max((length_s / step_s).ceil()) as usize;
        for index in 0..=looks {
            let state = ends[0].after(length_s * (index as f64 / looks as f64));
            tell(PathKnot { s: state.s.max(ends[0].s).min(ends[1].s), ..state });
        }
    }
    let (start, end) = timed.path().range();
    let mut breakpoints = Vec::new();
    timed.path().add_breakpoints(&mut breakpoints);
    for s in breakpoints {
        let Some(state) = passing(timed.knots(), s) else { continue };
        for aside in [-ASIDE, ASIDE] {
            tell(PathKnot { s: (s + aside * (end - start)).max(start).min(end), ..state });
        }
    }
}

/// The state in which the path parameter passes `s`.
fn passing(knots: &[PathKnot], s: f64) -> Option<PathKnot> {
    let [knot, next] = knots.windows(2).find(|ends| ends[0].s <= s && s <= ends[1].s)? else {
        return None;
    };
    let (mut low, mut high) = (0.0, next.time_s - knot.time_s);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if knot.after(middle).s < s {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(knot.after(high))
}

fn slowness(state: &PathKnot, rows: &[f64], third: &[f64], limits: &[AxisLimits]) -> f64 {
    let PathKnot { velocity: v, acceleration: a, jerk: j, .. } = *state;
    let joints = limits.len();
    let (first, second) = (&rows[joints..2 * joints], &rows[2 * joints..]);
    let derivatives = first.iter().zip(second).zip(third);
    let (mut velocity, mut acceleration, mut jerk) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (((q1, q2), q3), axis) in derivatives.zip(limits) {
        velocity = velocity.max((q1 * v).abs() / axis.velocity);
        acceleration = acceleration.max((q1 * a + q2 * v * v).abs() / axis.acceleration);
        jerk = jerk.max((q1 * j + 3.0 * q2 * v * a + q3 * v * v * v).abs() / axis.jerk);
    }
    velocity.max(acceleration.sqrt()).max(jerk.cbrt())
}

fn stretched(knots: &[PathKnot], k: f64) -> Vec<PathKnot> {
    let slower = |knot: &PathKnot| PathKnot {
        time_s: knot.time_s * k,
        s: knot.s,
        velocity: knot.velocity / k,
        acceleration: knot.acceleration / (k * k),
        jerk: knot.jerk / (k * k * k),
    };
    knots.iter().map(slower).collect()
}

fn duration_s(knots: &[PathKnot]) -> f64 {
    knots.last().map_or(f64::INFINITY, |last| last.time_s)
}
