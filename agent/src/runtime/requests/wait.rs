//! Answers at the end of a motion: `wait: true`.
//!
//! ```text
//! place taken --> motion started --> its terminal status --> complete, cancelled: the answer
//!      |                |                                +-> failed: its reason, as a denial
//!      busy             refused
//! ```
//! A request that waits holds one of the places that all requests of the robot share. So no more
//! than [`MAX_WAITS`] may wait, and the rest of the places is left to those who do not. The place
//! is taken before the motion is started: no motion begins whose asker is then turned away.

use armada_protocol::messages::{Accepted, ActionStatus, Denial, DenialCode};
use tokio::sync::SemaphorePermit;
use uuid::Uuid;

use super::{Asker, NewMotion, Requests};
use crate::control::Order;

/// Most requests of a robot that wait for the end of a motion; half of all that are in progress.
pub(in crate::runtime) const MAX_WAITS: usize = 16;

/// When a request is answered that starts a motion.
#[derive(Debug)]
pub(super) enum Answering<'a> {
    /// As soon as the loop has taken it.
    AtOnce,
    /// When the motion has ended.
    AtEnd {
        /// Given back with the answer.
        _place: SemaphorePermit<'a>,
    },
}

impl Requests {
    /// When to answer, with a place to wait if `wait` is asked for.
    pub(super) fn answering(&self, wait: bool) -> Result<Answering<'_>, Denial> {
        if !wait {
            return Ok(Answering::AtOnce);
        }
        match self.waits.try_acquire() {
            Ok(place) => Ok(Answering::AtEnd { _place: place }),
            Err(_) => Err(Denial::new(
                DenialCode::Busy,
                format!(
                    "{MAX_WAITS} requests wait for the end of a motion already: ask without \
                         wait and watch the motion"
                ),
            )
            .with("field", "wait")
            .with("limit", MAX_WAITS)),
        }
    }

    /// Starts a motion, and waits for its end if that is asked for.
    pub(super) async fn start_and(
        &self,
        answering: Answering<'_>,
        asker: &Asker,
        motion: NewMotion,
        order: Order,
    ) -> Result<Accepted, Denial> {
        let accepted = self.start(asker, motion, order).await?;
        self.finish(accepted, answering).await
    }

    /// The answer for a motion that was started: at once, or at its end with its status.
    ///
    /// A motion that failed is answered with the reason, as a denial.
    pub(super) async fn finish(
        &self,
        accepted: Accepted,
        answering: Answering<'_>,
    ) -> Result<Accepted, Denial> {
        match answering {
            Answering::AtOnce => Ok(accepted),
            Answering::AtEnd { .. } => self.end_of(accepted).await,
        }
    }

    async fn end_of(&self, accepted: Accepted) -> Result<Accepted, Denial> {
        let id = accepted.motion_id;
        let ended = self.board.lock().motions.ended();
        loop {
            // Made before the look at the status: an end between the two wakes it.
            let next_end = ended.notified();
            let status = self.board.lock().motions.find(id).cloned();
            let status = status.ok_or_else(|| forgotten(id))?;
            match status.status {
                ActionStatus::Failed => return Err(status.reason.unwrap_or_else(|| failed(id))),
                status if status.is_terminal() => {
                    return Ok(Accepted { status: Some(status), ..accepted });
                }
                _ => next_end.await,
            }
        }
    }
}

fn forgotten(id: Uuid) -> Denial {
    Denial::new(DenialCode::Internal, format!("motion {id} ended, and is not on record any more"))
        .with("motion_id", id.to_string())
}

fn failed(id: Uuid) -> Denial {
    Denial::new(DenialCode::Internal, format!("motion {id} failed without a reason"))
        .with("motion_id", id.to_string())
}
