//! Where searches begin.

#![allow(non_snake_case, reason = "R_BT is the rotation of frame T in frame B")]

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use super::bounds::Bounds;
use super::target::Task;
use crate::kinematics::Jacobian;
use crate::{Chain, MAX_JOINTS};

/// Postures in the table.
const TABLE: usize = 512;

/// Most starts taken from the table.
const NEAREST: usize = 16;

/// Even pseudo-random numbers, the same for the same seed.
///
/// Source: S. Vigna, splitmix64, public domain, after G. Steele et al., "Fast splittable
/// pseudorandom number generators", OOPSLA 2014.
pub(super) struct Random(u64);

impl Random {
    pub(super) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// A number from 0 up to, but not including, 1.
    pub(super) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        // 53 bits: all that a number holds.
        (z >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// A posture inside the bounds; joints without limits lie within a turn about `seed`.
    pub(super) fn posture(&mut self, bounds: &Bounds, seed: &[f64]) -> [f64; MAX_JOINTS] {
        let mut q = [0.0; MAX_JOINTS];
        for (k, (q, &seed)) in q.iter_mut().zip(seed).enumerate() {
            *q = bounds.at(k, self.unit(), seed);
        }
        q
    }
}

/// Random postures with the poses of the TCP that belong to them.
#[derive(Clone, Debug)]
pub(super) struct SeedTable {
    postures: Vec<Posture>,
}

#[derive(Clone, Debug)]
struct Posture {
    q: [f64; MAX_JOINTS],
    R_BT: Matrix3<f64>,
    p_BT: Vector3<f64>,
}

impl SeedTable {
    pub(super) fn new(chain: &Chain, bounds: &Bounds, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut jacobian = Jacobian::zeros(chain.len());
        let zero = [0.0; MAX_JOINTS];
        let postures = (0..TABLE).filter_map(|_| {
            let q = random.posture(bounds, &zero[..chain.len()]);
            let (R_BT, p_BT) = chain.evaluate(&q[..chain.len()], &mut jacobian).ok()?;
            Some(Posture { q, R_BT, p_BT })
        });
        Self { postures: postures.collect() }
    }

    /// The postures nearest to the target, nearest first.
    pub(super) fn nearest(
        &self,
        task: &Task,
        length: f64,
    ) -> ArrayVec<&[f64; MAX_JOINTS], NEAREST> {
        let mut found: ArrayVec<(f64, &Posture), NEAREST> = ArrayVec::new();
        for posture in &self.postures {
            let distance = distance(posture, task, length);
            if found.is_full() {
                if found.last().is_some_and(|(farthest, _)| distance >= *farthest) {
                    continue;
                }
                found.pop();
            }
            let place = found.iter().position(|(other, _)| distance < *other);
            let _ = found.try_insert(place.unwrap_or(found.len()), (distance, posture));
        }
        found.iter().map(|(_, posture)| &posture.q).collect()
    }
}

/// Square of the distance in units of the length plus a measure of the square of the angle.
#[inline]
fn distance(posture: &Posture, task: &Task, length: f64) -> f64 {
    let linear = task.position().map_or(0.0, |p| (p - posture.p_BT).norm_squared());
    // The trace of R^T S is 1 + 2 cos(angle); 2 - 2 cos is about the square of the angle.
    let angular = match task.orientation() {
        Some(R) => 3.0 - R.dot(&posture.R_BT),
        None => task.misalignment(&posture.R_BT),
    };
    linear / (length * length) + angular
}
