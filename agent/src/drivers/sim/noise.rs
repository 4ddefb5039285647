//! A repeatable source of measurement noise.

use std::f64::consts::TAU;

/// Normally distributed numbers from a seed: xorshift64* and the Box–Muller transform.
///
/// Source: S. Vigna, "An experimental exploration of Marsaglia's xorshift generators, scrambled",
/// ACM TOMS 42 (2016), generator xorshift64*.
#[derive(Clone, Debug)]
pub(super) struct Noise {
    state: u64,
    spare: Option<f64>,
}

impl Noise {
    /// A generator; equal seeds give equal numbers.
    pub(super) const fn new(seed: u64) -> Self {
        // The all-zero state would stay zero; the mix also sets small seeds apart.
        let state = seed ^ 0x9E37_79B9_7F4A_7C15;
        Self { state: if state == 0 { 1 } else { state }, spare: None }
    }

    /// The next number of a normal distribution with mean 0 and this standard deviation.
    pub(super) fn next(&mut self, standard_deviation: f64) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare * standard_deviation;
        }
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        let (sin, cos) = (TAU * self.uniform()).sin_cos();
        self.spare = Some(radius * sin);
        radius * cos * standard_deviation
    }

    /// A number above 0 and up to 1.
    pub(super) fn uniform(&mut self) -> f64 {
        self.state ^= self.state >> 12;
        self.state ^= self.state << 25;
        self.state ^= self.state >> 27;
        let bits = self.state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11;
        (bits as f64 + 1.0) / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_deviation_are_those_asked_for() {
        let mut noise = Noise::new(7);
        let values: Vec<f64> = (0..20_000).map(|_| noise.next(0.5)).collect();
        let mean = values.iter().sum::<f64>() / 20_000.0;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 20_000.0;
        assert!(mean.abs() < 0.015, "mean {mean}");
        assert!((variance.sqrt() - 0.5).abs() < 0.01, "deviation {}", variance.sqrt());
    }

    #[test]
    fn equal_seeds_give_equal_numbers_and_others_do_not() {
        let take = |seed| {
            let mut noise = Noise::new(seed);
            [noise.next(1.0), noise.next(1.0), noise.next(1.0)]
        };
        assert_eq!(take(3), take(3));
        assert_ne!(take(3), take(4));
        assert!(take(0x9E37_79B9_7F4A_7C15).iter().all(|v| v.is_finite()));
    }
}
