//! Random paths of seven joints and their limits, equal on every machine.

use armada_model::{AxisLimits, JointPath, SplineEnds};

pub(crate) struct Case {
    pub(crate) waypoints: Vec<Vec<f64>>,
    pub(crate) limits: Vec<AxisLimits>,
}

impl Case {
    /// The path number `seed`: 2 to 9 waypoints within 1.6 rad to either side.
    pub(crate) fn new(seed: u64) -> Self {
        let mut random = SplitMix(seed);
        let count = 2 + (seed % 8) as usize;
        let waypoints =
            (0..count).map(|_| (0..7).map(|_| random.between(-1.6, 1.6)).collect()).collect();
        let limits =
            (0..7).map(|_| axis(random.between(0.8, 3.0), random.between(2.0, 15.0))).collect();
        Self { waypoints, limits }
    }

    pub(crate) fn path(&self) -> JointPath {
        JointPath::through(&self.waypoints, SplineEnds::NotAKnot).expect("a path")
    }
}

/// Limits without positions, with the default jerk.
pub(crate) fn axis(velocity: f64, acceleration: f64) -> AxisLimits {
    AxisLimits {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        velocity,
        acceleration,
        jerk: acceleration / armada_model::DEFAULT_JERK_TIME_S,
    }
}

/// Source: S. Vigna, splitmix64.c, 2015 (public domain).
struct SplitMix(u64);

impl SplitMix {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        low + (high - low) * (z >> 11) as f64 / (1_u64 << 53) as f64
    }
}
