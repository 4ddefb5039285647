//! Signals and parameters of the controller: asked for until the feedback shows them.
//!
//! ```text
//! order --restricted and moving, or an output and stopped--> refused
//!   |
//!   +--> asked, again every 50 ms --feedback shows the value--> granted
//!                 +-----------------time is up----------------> refused
//! ```
//!
//! A value that is asked for while an older one is under way takes its place; whoever waits for
//! the older one is told so. An output may close a gripper, so a stop keeps outputs as they are, but for
//! those that are meant to be set then, such as a lamp.

use serde::{Deserialize, Serialize};
use std::time::Duration;

use armada_model::{MAX_JOINTS, MonoTime};
use arrayvec::ArrayVec;

use super::io::Refusal;
use super::state::{LoopState, Tick};
use crate::drivers::{DriverRequest, Feedback, Values};

/// Most values that are under way to the controller.
const MAX_PENDING: usize = 8;
/// How soon a value is asked for again that the feedback does not show.
const REPEAT: Duration = Duration::from_millis(50);

/// Where the feedback shows a signal or parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ValueSlot {
    /// Index of its first number.
    pub first: usize,
    /// How many numbers it has.
    pub len: usize,
    /// How far the controller may be from a number that it took, since it rounds.
    pub tolerance: f64,
}

/// A value to be set.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ValueOrder {
    pub(super) place: ValuePlace,
    pub(super) values: Values<MAX_JOINTS>,
    /// Whether it may be set only while the robot does not move.
    pub(super) restricted: bool,
    /// Whether it may be set while a stop is latched.
    pub(super) while_stopped: bool,
}

/// Which value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum ValuePlace {
    Signal(u8),
    Parameter(u8),
}

/// Values under way to the controller, oldest first.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct PendingValues(ArrayVec<PendingValue, MAX_PENDING>);

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct PendingValue {
    ticket: u64,
    order: ValueOrder,
    slot: ValueSlot,
    deadline: MonoTime,
    asked: Option<MonoTime>,
}

impl LoopState {
    /// Begins to ask the controller for a value; the answer comes later.
    pub(super) fn set_value(
        &mut self,
        tick: &mut Tick<'_>,
        ticket: u64,
        order: ValueOrder,
    ) -> Result<(), Refusal> {
        let slot = match order.place {
            ValuePlace::Signal(index) => tick.params.signals.get(usize::from(index)),
            ValuePlace::Parameter(index) => tick.params.parameters.get(usize::from(index)),
        };
        let slot = *slot.ok_or(Refusal::NotSupported("such a signal or parameter"))?;
        let (given, expected) = (order.values.as_slice().len(), slot.len);
        if given != expected {
            return Err(Refusal::WrongLength { given, expected });
        }
        if self.condition.feedback().is_none() {
            return Err(Refusal::CommunicationLost);
        }
        if !order.while_stopped {
            self.check_gate()?;
        }
        if order.restricted {
            self.check_idle(tick)?;
        }
        let pending = &mut self.values.0;
        if let Some(older) = pending.iter().position(|known| known.order.place == order.place) {
            let older = pending.remove(older);
            tick.answer(older.ticket, Err(Refusal::Superseded));
        }
        let deadline = tick.now + tick.params.request_timeout;
        let value = PendingValue { ticket, order, slot, deadline, asked: None };
        pending.try_push(value).map_err(|_| Refusal::TooManyPending)
    }

    /// Refuses what a stop came before, for `why`.
    pub(super) fn refuse_values(&mut self, tick: &mut Tick<'_>, why: Refusal) {
        self.values.0.retain(|pending| {
            if !pending.order.while_stopped {
                tick.answer(pending.ticket, Err(why));
            }
            pending.order.while_stopped
        });
    }

    /// The value that the controller is to be asked for now.
    pub(super) fn value_request(&mut self, now: MonoTime) -> Option<DriverRequest> {
        let is_due = |pending: &&mut PendingValue| {
            pending.asked.is_none_or(|asked| now.saturating_since(asked) >= REPEAT)
        };
        let due = self.values.0.iter_mut().find(is_due)?;
        due.asked = Some(now);
        let values = due.order.values;
        Some(match due.order.place {
            ValuePlace::Signal(signal) => DriverRequest::SetSignal { signal, values },
            ValuePlace::Parameter(parameter) => {
                let value = values.as_slice().first().copied().unwrap_or_default();
                DriverRequest::SetParameter { parameter, value }
            }
        })
    }

    /// Answers what the feedback shows to be set, and whose time is up.
    pub(super) fn answer_values(&mut self, tick: &mut Tick<'_>) {
        let feedback = self.condition.feedback().copied();
        let granted = self.granted();
        self.values.0.retain(|pending| {
            let done = feedback.as_ref().is_some_and(|feedback| pending.is_shown(feedback));
            let late = tick.now >= pending.deadline;
            if done {
                tick.answer(pending.ticket, Ok(granted));
            } else if late {
                let silent = feedback.is_none();
                let why =
                    if silent { Refusal::CommunicationLost } else { Refusal::ControllerTimeout };
                tick.answer(pending.ticket, Err(why));
            }
            !(done || late)
        });
    }
}

impl PendingValue {
    /// Whether a report that came after the value was asked for shows it.
    fn is_shown(&self, feedback: &Feedback) -> bool {
        let all = match self.order.place {
            ValuePlace::Signal(_) => feedback.signals.as_slice(),
            ValuePlace::Parameter(_) => feedback.parameters.as_slice(),
        };
        let shown = all.get(self.slot.first..self.slot.first + self.slot.len);
        let asked = self.asked.is_some_and(|asked| feedback.stamp > asked);
        asked
            && shown.is_some_and(|shown| {
                let pairs = shown.iter().zip(self.order.values.as_slice());
                pairs.into_iter().all(|(is, wanted)| (is - wanted).abs() <= self.slot.tolerance)
            })
    }
}
