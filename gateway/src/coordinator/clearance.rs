//! Checks of clearances for clients; those of motions are the groups' own.

use armada_model::MonoTime;
use armada_protocol::messages::{CheckClearanceParams, Denial, DenialCode};

use super::io::{CellAnswer, CheckId, Ticket};
use super::outbox::CheckFor;
use super::{Coordinator, plan};
use crate::world::{ClearanceReport, ClearanceRequest};

/// Largest difference of phases that can be asked for \[ms\].
const MAX_OFFSET_MS: f64 = 1_000.0;

impl Coordinator {
    pub(super) fn check_clearance(
        &mut self,
        ticket: Ticket,
        client: String,
        params: &CheckClearanceParams,
        now: MonoTime,
    ) {
        let request = check_offset(params.offset_ms).and_then(|offset_s| {
            let parts = plan::split(&params.trajectory, &self.robots)?;
            let required_m = self.clearance.required_m;
            Ok(ClearanceRequest {
                parts,
                reduced: plan::reduced(&self.robots),
                offset_s,
                required_m,
            })
        });
        let reason = CheckFor::Client(ticket, client.clone());
        let begun = request.and_then(|request| self.outbox.check(request, reason));
        if let Err(denial) = begun {
            self.deny(ticket, &client, denial, now);
        }
    }

    pub(super) fn on_clearance(
        &mut self,
        check: CheckId,
        result: Result<ClearanceReport, Denial>,
        now: MonoTime,
    ) {
        match self.outbox.settle_check(check) {
            Some(CheckFor::Group(id)) => {
                self.with_group(id, now, |group, cx| group.on_clearance(result, cx));
            }
            Some(CheckFor::Client(ticket, client)) => match result {
                Ok(report) => self.outbox.answer(ticket, Ok(CellAnswer::Clearance(report.answer))),
                Err(denial) => self.deny(ticket, &client, denial, now),
            },
            None => {}
        }
    }
}

fn check_offset(offset_ms: f64) -> Result<f64, Denial> {
    if (0.0..=MAX_OFFSET_MS).contains(&offset_ms) {
        return Ok(1e-3 * offset_ms);
    }
    let message = format!("offset_ms is {offset_ms}, expected 0 to {MAX_OFFSET_MS}");
    Err(Denial::new(DenialCode::OutOfRange, message).with("field", "offset_ms"))
}
