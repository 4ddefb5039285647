//! What one side did in one pair.

use crate::bench::figures::quantiles;
use crate::bench::wakes::Regularity;

/// Median and 99th percentile.
pub(super) type Typical = [f64; 2];

/// What one side did in one pair.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Figures {
    /// Loop at 1 kHz, nothing else started: [`regularity`].
    pub(super) idle: [f64; 3],
    /// The same with every core busy.
    pub(super) busy: [f64; 3],
    /// From the deadline of a tick until its state is in a client's hands, for each rate \[µs\].
    pub(super) latency_us: [Typical; 2],
    /// Processor time of the process of one arm, for each rate, and for the second with the state
    /// at the first \[% of one processor\].
    pub(super) processor_percent: [f64; 3],
    /// From a request for one value to the answer \[µs\].
    pub(super) round_trip_us: Typical,
    /// From the request for a trajectory to the answer, for each number of waypoints \[ms\].
    pub(super) accept_ms: [Typical; 2],
    /// From the request for a trajectory to the first set-point that differs \[ms\].
    pub(super) first_motion_ms: Typical,
}

/// Median and 99th percentile of samples; not a number where there are none.
pub(super) fn typical(samples: &mut [f64]) -> Typical {
    quantiles(samples).map_or([f64::NAN; 2], |[p50, p99, ..]| [p50, p99])
}

/// Median and 99th percentile of the period error \[µs\], and the missed periods \[%\].
pub(super) fn regularity(mut regularity: Regularity) -> [f64; 3] {
    let missed = regularity.missed_share() * 100.0;
    let [p50, p99] = typical(&mut regularity.errors_us);
    [p50, p99, missed]
}
