//! Numbers, vectors and poses of a packet.

use armada_model::{JointVector, MAX_JOINTS, Pose};
use arrayvec::ArrayString;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::super::fault::{Fault, MAX_NAME, WireFault};
use super::{MAX_VALUE, WireError};
use crate::drivers::{JointSet, Values};

/// How far the square of a quaternion's norm may be from 1.
const NORM_TOLERANCE: f64 = 1e-6;

/// Writes into a buffer as long as there is room.
pub(super) struct Writer<'a> {
    buffer: &'a mut [u8],
    at: usize,
}

impl<'a> Writer<'a> {
    pub(super) const fn new(buffer: &'a mut [u8]) -> Self {
        Self { buffer, at: 0 }
    }

    /// Bytes written.
    pub(super) const fn len(&self) -> usize {
        self.at
    }

    pub(super) fn put(&mut self, bytes: &[u8]) -> Option<()> {
        let end = self.at.checked_add(bytes.len())?;
        self.buffer.get_mut(self.at..end)?.copy_from_slice(bytes);
        self.at = end;
        Some(())
    }

    pub(super) fn u8(&mut self, value: u8) -> Option<()> {
        self.put(&[value])
    }

    pub(super) fn u16(&mut self, value: u16) -> Option<()> {
        self.put(&value.to_le_bytes())
    }

    pub(super) fn u32(&mut self, value: u32) -> Option<()> {
        self.put(&value.to_le_bytes())
    }

    pub(super) fn u64(&mut self, value: u64) -> Option<()> {
        self.put(&value.to_le_bytes())
    }

    pub(super) fn f64(&mut self, value: f64) -> Option<()> {
        self.put(&value.to_le_bytes())
    }

    pub(super) fn f64s(&mut self, values: &[f64]) -> Option<()> {
        values.iter().try_for_each(|&value| self.f64(value))
    }

    pub(super) fn joints(&mut self, values: &JointVector) -> Option<()> {
        self.f64s(values)
    }

    /// Their number, and then they.
    pub(super) fn values<const N: usize>(&mut self, values: &Values<N>) -> Option<()> {
        let values = values.as_slice();
        self.u8(u8::try_from(values.len()).ok()?)?;
        self.f64s(values)
    }

    pub(super) fn pose(&mut self, pose: &Pose) -> Option<()> {
        let (p, q) = (pose.position(), pose.isometry().rotation.quaternion());
        self.f64s(&[p.x, p.y, p.z, q.w, q.i, q.j, q.k])
    }

    pub(super) fn fault(&mut self, fault: &Fault) -> Option<()> {
        let WireFault { tag, number, value, name } = fault.to_wire();
        self.u8(tag)?;
        self.u32(number)?;
        self.f64(value)?;
        self.u8(u8::try_from(name.len()).ok()?)?;
        self.put(name.as_bytes())
    }
}

pub(super) fn joint_count(vector: &JointVector) -> u8 {
    vector.len() as u8 // at most MAX_JOINTS
}

/// Reads from bytes as long as there are any.
pub(super) struct Reader<'a> {
    rest: &'a [u8],
    len: usize,
}

impl<'a> Reader<'a> {
    pub(super) const fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, len: bytes.len() }
    }

    /// Bytes not read yet.
    pub(super) const fn left(&self) -> usize {
        self.rest.len()
    }

    pub(super) fn take<const N: usize>(&mut self) -> Result<[u8; N], WireError> {
        let (head, rest) =
            self.rest.split_first_chunk().ok_or(WireError::Truncated { len: self.len })?;
        self.rest = rest;
        Ok(*head)
    }

    pub(super) fn u8(&mut self) -> Result<u8, WireError> {
        self.take().map(u8::from_le_bytes)
    }

    pub(super) fn u16(&mut self) -> Result<u16, WireError> {
        self.take().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, WireError> {
        self.take().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, WireError> {
        self.take().map(u64::from_le_bytes)
    }

    /// A byte of which only the bits of `allowed` may be set.
    pub(super) fn flags(&mut self, allowed: u8, field: &'static str) -> Result<u8, WireError> {
        let flags = self.u8()?;
        if flags & !allowed == 0 { Ok(flags) } else { Err(WireError::Field { field }) }
    }

    /// A number from `low` to `high`, which are within [`MAX_VALUE`].
    pub(super) fn within(
        &mut self,
        [low, high]: [f64; 2],
        field: &'static str,
    ) -> Result<f64, WireError> {
        let value = self.take().map(f64::from_le_bytes)?;
        // A range does not contain what is not a number.
        if (low..=high).contains(&value) { Ok(value) } else { Err(WireError::Field { field }) }
    }

    pub(super) fn f64(&mut self, field: &'static str) -> Result<f64, WireError> {
        self.within([-MAX_VALUE, MAX_VALUE], field)
    }

    pub(super) fn f64s<const N: usize>(
        &mut self,
        field: &'static str,
    ) -> Result<[f64; N], WireError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64(field)?;
        }
        Ok(values)
    }

    pub(super) fn joint_count(&mut self) -> Result<u8, WireError> {
        let count = self.u8()?;
        if (1..=MAX_JOINTS).contains(&usize::from(count)) {
            Ok(count)
        } else {
            Err(WireError::Field { field: "joints" })
        }
    }

    pub(super) fn joints(
        &mut self,
        count: u8,
        field: &'static str,
    ) -> Result<JointVector, WireError> {
        let refused = WireError::Field { field };
        let mut values = JointVector::zeros(usize::from(count)).map_err(|_| refused)?;
        for value in values.iter_mut() {
            *value = self.f64(field)?;
        }
        Ok(values)
    }

    /// A set of joints, of which there are `count`.
    pub(super) fn joint_set(
        &mut self,
        count: u8,
        field: &'static str,
    ) -> Result<JointSet, WireError> {
        let set = JointSet::from_bits(self.u16()?);
        let known = JointSet::first(usize::from(count));
        if known.contains_all(set) { Ok(set) } else { Err(WireError::Field { field }) }
    }

    /// A number of values, and then they.
    pub(super) fn values<const N: usize>(
        &mut self,
        field: &'static str,
    ) -> Result<Values<N>, WireError> {
        let count = usize::from(self.u8()?);
        let mut values = [0.0; N];
        let given = values.get_mut(..count).ok_or(WireError::Field { field })?;
        for value in given.iter_mut() {
            *value = self.f64(field)?;
        }
        Values::from_slice(given).ok_or(WireError::Field { field })
    }

    pub(super) fn pose(&mut self, field: &'static str) -> Result<Pose, WireError> {
        let [x, y, z, w, i, j, k] = self.f64s(field)?;
        let quaternion = Quaternion::new(w, i, j, k);
        if (quaternion.norm_squared() - 1.0).abs() > NORM_TOLERANCE {
            return Err(WireError::Field { field });
        }
        Ok(Pose::from_isometry(Isometry3::from_parts(
            Translation3::from(Vector3::new(x, y, z)),
            UnitQuaternion::new_unchecked(quaternion),
        )))
    }

    pub(super) fn fault(&mut self) -> Result<Fault, WireError> {
        let refused = WireError::Field { field: "fault" };
        let (tag, number) = (self.u8()?, self.u32()?);
        let value = self.f64("fault")?;
        let length = usize::from(self.u8()?);
        if length > MAX_NAME {
            return Err(refused);
        }
        let (name, rest) =
            self.rest.split_at_checked(length).ok_or(WireError::Truncated { len: self.len })?;
        self.rest = rest;
        let name = str::from_utf8(name).ok().and_then(|name| ArrayString::from(name).ok());
        let name = name.ok_or(refused)?;
        Fault::from_wire(&WireFault { tag, number, value, name }).ok_or(refused)
    }
}
