//! The same random numbers at every run and in every language.
#![allow(dead_code, reason = "each test binary uses a part of this module")]

/// splitmix64, as numbers from 0 to 1.
#[derive(Clone, Debug)]
pub(crate) struct Uniform(u64);

impl Uniform {
    pub(crate) const fn seeded(seed: u64) -> Self {
        Self(seed)
    }

    /// From 0 to 1, which is left out.
    #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * (-53.0_f64).exp2()
    }

    /// A whole number below `end`.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small")]
    pub(crate) fn below(&mut self, end: f64) -> usize {
        (self.next() * end) as usize
    }

    /// From -1 to 1.
    pub(crate) fn signed(&mut self) -> f64 {
        2.0 * self.next() - 1.0
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.next() < probability
    }
}
