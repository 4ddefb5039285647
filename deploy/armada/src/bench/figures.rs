//! Numbers from samples.

/// Quantiles that are reported, with their names.
pub(super) const QUANTILES: [(&str, f64); 4] =
    [("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999), ("max", 1.0)];

/// The [`QUANTILES`] of samples, by the nearest rank; `None` of no samples.
pub(super) fn quantiles(samples: &mut [f64]) -> Option<[f64; 4]> {
    samples.sort_unstable_by(f64::total_cmp);
    let [p50, p99, p999, max] = QUANTILES.map(|(_, q)| rank(samples, q));
    Some([p50?, p99?, p999?, max?])
}

#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts of samples are small, the rank lies within them"
)]
fn rank(sorted: &[f64], quantile: f64) -> Option<f64> {
    let rank = (quantile * sorted.len() as f64).ceil().max(1.0) as usize;
    sorted.get(rank.min(sorted.len()).checked_sub(1)?).copied()
}

/// The median with its spread.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub(super) struct Spread {
    /// Median.
    pub(super) median: f64,
    /// Smallest.
    pub(super) min: f64,
    /// Largest.
    pub(super) max: f64,
}

impl Spread {
    /// Of `values`; `None` of no values.
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let (&min, &max) = (sorted.first()?, sorted.last()?);
        let half = sorted.len() / 2;
        let upper = *sorted.get(half)?;
        let median = if sorted.len() % 2 == 1 {
            upper
        } else {
            f64::midpoint(*sorted.get(half - 1)?, upper)
        };
        Some(Self { median, min, max })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_samples_of_the_nearest_rank() {
        let mut samples: Vec<f64> = (1..=1000).rev().map(f64::from).collect();
        assert_eq!(quantiles(&mut samples), Some([500.0, 990.0, 999.0, 1000.0]));
        assert_eq!(quantiles(&mut [7.0]), Some([7.0; 4]));
        assert_eq!(quantiles(&mut []), None);
    }

    #[test]
    fn a_spread_is_the_median_with_the_extremes() {
        let spread = |values: &[f64]| Spread::of(values).map(|s| (s.median, s.min, s.max));
        assert_eq!(spread(&[3.0, 1.0, 2.0]), Some((2.0, 1.0, 3.0)));
        assert_eq!(spread(&[4.0, 1.0, 2.0, 3.0]), Some((2.5, 1.0, 4.0)));
        assert_eq!(spread(&[]), None);
    }
}
