//! Copies of the loop's state, for recordings.
//!
//! The copy is made by the loop's thread into a state that holds nothing on the heap but rings of
//! the same length, so it neither takes memory nor gives any back.

use super::state::LoopState;

/// `Clone` field by field, so that boxes are copied into and not made anew; a field that is left
/// out does not compile.
macro_rules! copy_by_fields {
    ($type:ty: $($field:ident),+ $(,)?) => {
        impl Clone for $type {
            fn clone(&self) -> Self {
                Self { $($field: self.$field.clone()),+ }
            }

            fn clone_from(&mut self, from: &Self) {
                $(self.$field.clone_from(&from.$field);)+
            }
        }
    };
}

pub(super) use copy_by_fields;

copy_by_fields! {
    LoopState:
    limits, reduced, seqno, epoch, mode, condition, faults, stop, authority, controller,
    standstill, tracking, limiter, hold, ramp, motion, stream, queue, own_motion, speed_ratio,
    equipment, owed_loads, owed_tools, values, acknowledgement, group,
}
