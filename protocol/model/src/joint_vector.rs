//! One number per joint, without heap.

use std::fmt;
use std::ops::{Deref, DerefMut};

use arrayvec::ArrayVec;
use serde::{Deserialize, Serialize};

/// Most joints one robot controller may drive.
pub const MAX_JOINTS: usize = 16;

/// One finite number per joint of a robot, in the robot's joint order; at most [`MAX_JOINTS`].
///
/// Unit and meaning come from the field that holds it: \[rad\] for revolute, \[m\] for prismatic
/// joints where it is a position. An empty vector means that the value is not available.
/// It is `Copy` and never allocates. From the wire only finite numbers are taken.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>", into = "ArrayVec<f64, MAX_JOINTS>")]
pub struct JointVector {
    len: usize,
    values: [f64; MAX_JOINTS],
}

/// Why numbers are not a [`JointVector`].
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum JointVectorError {
    /// More values than [`MAX_JOINTS`].
    #[error("{len} values, but a robot has at most {MAX_JOINTS} joints")]
    TooLong {
        /// Number of values given.
        len: usize,
    },
    /// A value is infinite or not a number.
    #[error("value {index} is {value}, which is not finite")]
    NotFinite {
        /// Index of the first such value.
        index: usize,
        /// The value.
        value: f64,
    },
}

impl JointVector {
    /// No values: "not available".
    pub const EMPTY: Self = Self { len: 0, values: [0.0; MAX_JOINTS] };

    /// `len` zeros.
    ///
    /// # Errors
    /// [`JointVectorError::TooLong`] if `len` is above [`MAX_JOINTS`].
    pub const fn zeros(len: usize) -> Result<Self, JointVectorError> {
        if len > MAX_JOINTS {
            return Err(JointVectorError::TooLong { len });
        }
        Ok(Self { len, values: [0.0; MAX_JOINTS] })
    }

    /// The values of `source`.
    ///
    /// # Errors
    /// [`JointVectorError::TooLong`] if there are more than [`MAX_JOINTS`],
    /// [`JointVectorError::NotFinite`] if one is infinite or not a number.
    pub fn from_slice(source: &[f64]) -> Result<Self, JointVectorError> {
        let mut vector = Self::zeros(source.len())?;
        for (index, &value) in source.iter().enumerate() {
            if !value.is_finite() {
                return Err(JointVectorError::NotFinite { index, value });
            }
            vector.values[index] = value;
        }
        Ok(vector)
    }

    /// As many values as `self` has, each made by `f` from its index and the value here.
    #[must_use]
    pub fn map_indexed(&self, mut f: impl FnMut(usize, f64) -> f64) -> Self {
        let mut out = *self;
        for (index, value) in out.iter_mut().enumerate() {
            *value = f(index, *value);
        }
        out
    }

    /// Whether every value is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.iter().all(|value| value.is_finite())
    }

    /// Largest absolute difference to `other` over the joints both have; zero if there are none.
    #[must_use]
    pub fn max_abs_difference(&self, other: &Self) -> f64 {
        self.iter().zip(other.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }
}

impl Deref for JointVector {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.values[..self.len]
    }
}

impl DerefMut for JointVector {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.values[..self.len]
    }
}

impl fmt::Debug for JointVector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

impl TryFrom<Vec<f64>> for JointVector {
    type Error = JointVectorError;

    fn try_from(values: Vec<f64>) -> Result<Self, JointVectorError> {
        Self::from_slice(&values)
    }
}

impl From<JointVector> for ArrayVec<f64, MAX_JOINTS> {
    fn from(vector: JointVector) -> Self {
        vector.iter().copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seventeen_values_are_refused_with_the_count() {
        assert_eq!(JointVector::from_slice(&[0.0; 17]), Err(JointVectorError::TooLong { len: 17 }));
    }

    #[test]
    fn a_value_that_is_not_finite_is_refused_with_its_index() {
        assert_eq!(
            JointVector::from_slice(&[0.0, f64::INFINITY]),
            Err(JointVectorError::NotFinite { index: 1, value: f64::INFINITY })
        );
    }

    #[test]
    fn it_is_an_array_on_the_wire() {
        let vector = JointVector::from_slice(&[0.5, -1.0]).expect("two finite values");
        let text = serde_json::to_string(&vector).expect("numbers encode");
        assert_eq!(text, "[0.5,-1.0]");
        assert_eq!(serde_json::from_str::<JointVector>(&text).expect("decodes"), vector);
        assert!(serde_json::from_str::<JointVector>("[1e999]").is_err());
    }
}
