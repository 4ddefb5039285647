//! What the controller is asked to do besides moving, and who waits for it.
//!
//! ```text
//! enable -------------------------------------> asked --feedback: enabled and ready--> granted
//! reset_errors -------------------------------> asked --no cause remains-------------> granted
//! disable --ramp, standstill measured---------> asked --feedback: drives off---------> granted
//!                                                 +-----time is up-------------------> refused
//! ```
//!
//! A controller needs some cycles, and a packet may be lost: a request is repeated until the
//! feedback shows that it was done, or its time is up. An answer tells what was measured. At most
//! one request leaves in a tick, drives-off before all others.

use serde::{Deserialize, Serialize};
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::FaultCode;
use arrayvec::ArrayVec;

use super::faults::refusal_of;
use super::io::Refusal;
use super::state::{LoopState, Tick};
use crate::drivers::DriverRequest;

/// Most requests that wait for the controller. The last place is for a disable only.
const MAX_PENDING: usize = 4;
/// How soon a request is repeated that shows no effect.
pub(super) const REPEAT: Duration = Duration::from_millis(50);

/// Requests under way to the controller.
#[derive(Debug, Default, Clone, Serialize, Deserialize)]
pub(super) struct Controller {
    pending: ArrayVec<Pending, MAX_PENDING>,
    /// Until when drives are to be switched on at start-up.
    enable_until: Option<MonoTime>,
    /// Whether errors are to be reset once, for a request that is answered already.
    reset_once: bool,
    /// When each kind of request was sent last, in the order of `KINDS`.
    asked: [Option<MonoTime>; 3],
    /// Which run of the controller was heard last, while it is heard.
    session: Option<u64>,
}

/// A request whose answer waits for the controller.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Pending {
    ticket: u64,
    request: DriverRequest,
    /// When its time is up; unknown for a disable before it was asked for.
    deadline: Option<MonoTime>,
}

/// Kinds of requests, the most urgent first.
const KINDS: [DriverRequest; 3] =
    [DriverRequest::Disable, DriverRequest::ResetErrors, DriverRequest::Enable];

impl Controller {
    /// Whether somebody waits for `request`.
    pub(super) fn awaits(&self, request: DriverRequest) -> bool {
        self.pending.iter().any(|pending| pending.request == request)
    }

    /// Asks for drives on, until they are or `deadline`.
    pub(super) const fn enable_until(&mut self, deadline: MonoTime) {
        self.enable_until = Some(deadline);
    }

    /// Has errors reset at the controller, at least once.
    pub(super) const fn reset_once(&mut self) {
        self.reset_once = true;
        self.ask_at_once(DriverRequest::ResetErrors);
    }

    /// Sends `request` at the next occasion, however short ago it was sent.
    pub(super) const fn ask_at_once(&mut self, request: DriverRequest) {
        self.asked[index(request)] = None;
    }

    /// Lets `ticket` wait for `request`; the time for a disable begins when it is asked for.
    pub(super) fn wait(
        &mut self,
        ticket: u64,
        request: DriverRequest,
        until: MonoTime,
    ) -> Result<(), Refusal> {
        let (room, deadline) = match request {
            DriverRequest::Disable => (MAX_PENDING, None),
            _ => (MAX_PENDING - 1, Some(until)),
        };
        if self.pending.len() >= room {
            return Err(Refusal::TooManyPending);
        }
        let pending = Pending { ticket, request, deadline };
        self.pending.try_push(pending).map_err(|_| Refusal::TooManyPending)
    }

    /// Whether `request`, if it is wanted, is to be sent at `now`; notes that it is.
    fn is_due(&mut self, request: DriverRequest, wanted: bool, now: MonoTime) -> bool {
        let asked = &mut self.asked[index(request)];
        if !wanted {
            *asked = None;
            return false;
        }
        let due = asked.is_none_or(|asked| now.saturating_since(asked) >= REPEAT);
        if due {
            *asked = Some(now);
        }
        due
    }
}

impl LoopState {
    /// Sees to it that another run of the controller is told what the one before was: one that is
    /// not heard may come back as another, and one that restarts quickly says so itself.
    pub(super) fn watch_session(&mut self) {
        let session = self.condition.feedback().map(|feedback| feedback.session);
        if session.is_none() || session != self.controller.session {
            self.controller.session = session;
            self.owe_equipment();
            self.forget_told();
        }
    }

    /// What the controller is to be asked for in this tick.
    pub(super) fn controller_request(&mut self, tick: &Tick<'_>) -> Option<DriverRequest> {
        if self.condition.is_enabled()
            || self.controller.enable_until.is_some_and(|until| tick.now >= until)
        {
            self.controller.enable_until = None;
        }
        let request = KINDS.into_iter().find(|&request| {
            let wanted = self.wants(tick, request);
            self.controller.is_due(request, wanted, tick.now)
        })?;
        match request {
            DriverRequest::ResetErrors => self.controller.reset_once = false,
            DriverRequest::Disable => self.start_disable_timers(tick),
            _ => {}
        }
        Some(request)
    }

    /// Answers what the feedback shows to be done, and whose time is up.
    pub(super) fn answer_pending(&mut self, tick: &mut Tick<'_>) {
        let mut at = 0;
        while let Some(&Pending { ticket, request, deadline }) = self.controller.pending.get(at) {
            let expired = deadline.is_some_and(|deadline| tick.now >= deadline);
            match self.outcome(tick, request) {
                Err(refusal) if expired => tick.answer(ticket, Err(refusal)),
                Err(_) => {
                    at += 1;
                    continue;
                }
                Ok(()) => {
                    if request == DriverRequest::ResetErrors {
                        self.clear_faults(tick);
                    }
                    tick.answer(ticket, Ok(self.granted()));
                }
            }
            self.controller.pending.remove(at);
        }
    }

    /// Refuses all that wait for `request`.
    pub(super) fn refuse_pending(
        &mut self,
        tick: &mut Tick<'_>,
        request: DriverRequest,
        why: Refusal,
    ) {
        if request == DriverRequest::Enable {
            self.controller.enable_until = None;
        }
        self.controller.pending.retain(|pending| {
            let refused = pending.request == request;
            if refused {
                tick.answer(pending.ticket, Err(why));
            }
            !refused
        });
    }

    /// Refuses what a new fault makes impossible. A reset asked for before it must not clear it.
    pub(super) fn fail_pending(&mut self, tick: &mut Tick<'_>, code: FaultCode) {
        self.refuse_pending(tick, DriverRequest::Enable, refusal_of(code));
        self.refuse_pending(tick, DriverRequest::ResetErrors, Refusal::CauseRemains(code));
        if code == FaultCode::CommunicationLost {
            self.refuse_pending(tick, DriverRequest::Disable, Refusal::CommunicationLost);
        }
    }

    fn wants(&self, tick: &Tick<'_>, request: DriverRequest) -> bool {
        let awaited = self.controller.awaits(request);
        match request {
            DriverRequest::Enable => awaited || self.controller.enable_until.is_some(),
            DriverRequest::ResetErrors => awaited || self.controller.reset_once,
            DriverRequest::Disable => {
                let off = self.condition.drives_are_off();
                // A controller that does not end its own motion is to be ended by its brakes.
                let ignored = self.is_latched(FaultCode::StopIgnored);
                let settled = awaited && self.has_settled(tick);
                !off && (ignored || self.stop_wants_drives_off(tick) || settled)
            }
            _ => false,
        }
    }

    /// Whether `request` is done, else why not.
    fn outcome(&self, tick: &Tick<'_>, request: DriverRequest) -> Result<(), Refusal> {
        match request {
            DriverRequest::Enable => self.condition.check_follows(),
            DriverRequest::ResetErrors => {
                self.remaining_cause(tick).map_or(Ok(()), |code| Err(Refusal::CauseRemains(code)))
            }
            DriverRequest::Disable if self.condition.drives_are_off() => Ok(()),
            DriverRequest::Disable => Err(Refusal::StillEnabled),
            _ => Ok(()),
        }
    }

    fn start_disable_timers(&mut self, tick: &Tick<'_>) {
        let deadline = tick.now + tick.params.request_timeout;
        let disables = self.controller.pending.iter_mut();
        for pending in disables.filter(|pending| pending.request == DriverRequest::Disable) {
            pending.deadline.get_or_insert(deadline);
        }
    }
}

const fn index(request: DriverRequest) -> usize {
    match request {
        DriverRequest::Disable => 0,
        DriverRequest::ResetErrors => 1,
        _ => 2,
    }
}
