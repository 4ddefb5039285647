//! What stands between us and the library that solves for profiles.

use super::axis::{AxisMotion, AxisPoint};
use crate::AxisLimits;

/// What one joint is asked for. All numbers are finite, the limits above zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisRequest {
    /// Where the joint is; may be outside the limits.
    pub from: AxisPoint,
    /// Where it shall be.
    pub to: AxisPoint,
    /// What it may do; position limits are not the generator's business.
    pub limits: AxisLimits,
}

/// How long a joint may take: any time from the least on, but for the gaps. A joint that starts or
/// ends in motion may reach its target after 1 s or after 2 s, but not after 1.5 s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisDurations {
    /// The least time \[s\].
    pub least_s: f64,
    /// Beginning and end of up to two open intervals of times that are not possible \[s\].
    pub gaps: [Option<(f64, f64)>; 2],
}

/// Solves for jerk-limited motions, one joint at a time; joints are counted from zero and below
/// [`MAX_JOINTS`](crate::MAX_JOINTS).
///
/// An implementation allocates nothing, takes bounded time and may fail: callers check every motion
/// it makes, and have a way to go on without one.
pub trait OnlineGenerator {
    /// How long `joint` may take for `request`; `None` if no profile was found.
    fn durations(&mut self, joint: usize, request: &AxisRequest) -> Option<AxisDurations>;

    /// The motion of `joint` for its last request that arrives after `duration_s`, a time that
    /// [`durations`](Self::durations) allows; `None` if no profile was found.
    fn motion(&mut self, joint: usize, duration_s: f64) -> Option<AxisMotion>;
}

impl AxisDurations {
    /// Whether the joint can take just `t_s`.
    pub(super) fn allows(&self, t_s: f64) -> bool {
        t_s >= self.least_s
            && self.gaps.iter().flatten().all(|&(from, to)| t_s <= from || t_s >= to)
    }
}
