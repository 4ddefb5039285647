//! What each order needs a lease for.
//!
//! | order | needs |
//! |---|---|
//! | mode (but halt), drives on, resetting errors, every motion, pause, resume, speed ratio | `arm` |
//! | tools and payloads | `end_effector` |
//! | signals and parameters | `io` |
//! | halt, cancel, drives off, and whatever is about leases themselves | nothing |
//!
//! Where the robot file says `lease_required`, all that needs a lease needs one also while nobody holds
//! one, but for drives, errors, pauses, speed ratios and parameters.
//!
//! A scope contains those after it. A gripper that is switched by a signal is `io`.

use armada_protocol::messages::{CommandMode, LeaseScope, Queue};

use crate::control::io::{DelegateOrder, FollowOrder, Order};

/// The scope that an order needs, if it commands the robot: what only the holder of a lease may
/// do while there is one.
pub(super) const fn needed_scope(order: &Order) -> Option<LeaseScope> {
    match order {
        Order::SetMode(CommandMode::Halt)
        | Order::Halt
        | Order::Cancel(_)
        | Order::Disable
        | Order::AcquireLease { .. }
        | Order::TakeLease { .. }
        | Order::DelegateLease { .. }
        | Order::RenewLease { .. }
        | Order::ReleaseLease(_) => None,
        Order::SetMode(_)
        | Order::Enable
        | Order::ResetErrors
        | Order::Jog(_)
        | Order::Follow(_)
        | Order::Home(_)
        | Order::JogJoint(_)
        | Order::JogCartesian(_)
        | Order::Delegate(_)
        | Order::Pause(_)
        | Order::Resume(_)
        | Order::SetSpeedRatio(_) => Some(LeaseScope::Arm),
        Order::SetEquipment(_) => Some(LeaseScope::EndEffector),
        Order::SetSignal { .. } | Order::SetParameter { .. } => Some(LeaseScope::Io),
    }
}

/// Whether a commanding order neither leads to motion nor switches anything: robots that require a
/// lease take it without one while nobody holds one.
pub(super) const fn is_harmless(order: &Order) -> bool {
    matches!(
        order,
        Order::Enable
            | Order::ResetErrors
            | Order::Pause(_)
            | Order::SetSpeedRatio(_)
            | Order::SetParameter { .. }
    )
}

/// Whether an order is to wait behind the motion in progress.
pub(super) const fn appends(order: &Order) -> bool {
    match order {
        Order::Follow(FollowOrder { queue, .. }) | Order::Delegate(DelegateOrder { queue, .. }) => {
            matches!(queue, Queue::Append | Queue::AppendBlended)
        }
        _ => false,
    }
}
