//! From what the coordinator answers to what a method answers.

use armada_protocol::messages::{
    Accepted, CellResetAnswer, ClearanceAnswer, Denial, DenialCode, Empty, GroupLease,
    GroupLeaseReleased, SpeedRatioAnswer, StopReport,
};

use crate::coordinator::CellAnswer;

/// What a method answers.
pub(super) trait FromAnswer: Sized {
    /// `None` if the answer is to another request.
    fn from_answer(answer: CellAnswer) -> Option<Self>;
}

macro_rules! answers {
    ($($variant:ident => $answer:ty),+ $(,)?) => {$(
        impl FromAnswer for $answer {
            fn from_answer(answer: CellAnswer) -> Option<Self> {
                if let CellAnswer::$variant(answer) = answer { Some(answer) } else { None }
            }
        }
    )+};
}

answers! {
    Stopped => StopReport,
    Reset => CellResetAnswer,
    Accepted => Accepted,
    SpeedRatio => SpeedRatioAnswer,
    Lease => GroupLease,
    LeaseReleased => GroupLeaseReleased,
    Clearance => ClearanceAnswer,
}

impl FromAnswer for Empty {
    fn from_answer(answer: CellAnswer) -> Option<Self> {
        matches!(answer, CellAnswer::Cancelled | CellAnswer::Controlled).then_some(Self {})
    }
}

pub(super) fn confused() -> Denial {
    Denial::new(DenialCode::Internal, "the answer is to another request")
}
