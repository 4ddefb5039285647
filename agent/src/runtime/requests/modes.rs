//! Mode, drives, faults and stops.

use std::time::Duration;

use armada_protocol::messages::{
    Denial, DenialCode, Empty, HaltAnswer, ModeAnswer, ResetAnswer, ResetParams, SetModeParams,
};
use armada_protocol::method::{Method, robot};
use uuid::Uuid;

use super::{Asker, LOOP_PATIENCE, Requests};
use crate::control::{Granted, Order};

impl Requests {
    pub(super) async fn set_mode(
        &self,
        asker: Asker,
        params: SetModeParams,
    ) -> Result<ModeAnswer, Denial> {
        self.mode(&asker, Order::SetMode(params.mode), robot::SetMode::TIMEOUT).await
    }

    pub(super) async fn halt_by(&self, asker: Asker, _: Empty) -> Result<HaltAnswer, Denial> {
        let Granted { epoch, .. } = self.ask(&asker, Order::Halt, LOOP_PATIENCE).await?;
        Ok(HaltAnswer { epoch })
    }

    pub(super) async fn enable(&self, asker: Asker, _: Empty) -> Result<ModeAnswer, Denial> {
        self.mode(&asker, Order::Enable, robot::Enable::TIMEOUT).await
    }

    pub(super) async fn disable(&self, asker: Asker, _: Empty) -> Result<ModeAnswer, Denial> {
        self.mode(&asker, Order::Disable, robot::Disable::TIMEOUT).await
    }

    pub(super) async fn reset_errors(&self, asker: Asker, _: Empty) -> Result<ModeAnswer, Denial> {
        self.mode(&asker, Order::ResetErrors, robot::ResetErrors::TIMEOUT).await
    }

    async fn mode(
        &self,
        asker: &Asker,
        order: Order,
        patience: Duration,
    ) -> Result<ModeAnswer, Denial> {
        let Granted { epoch, command_mode } = self.ask(asker, order, patience).await?;
        Ok(ModeAnswer { command_mode, epoch })
    }

    /// Ramps to standstill and stays in halt.
    pub(in crate::runtime) async fn halt(&self) -> Result<HaltAnswer, Denial> {
        self.halt_by(Asker::agent(), Empty {}).await
    }

    pub(super) async fn reset(&self, _: Asker, params: ResetParams) -> Result<ResetAnswer, Denial> {
        let mut cleared_count = self.cleared.clone();
        cleared_count.mark_unchanged();
        let cleared = {
            let mut board = self.board.lock();
            let Some(record) = &board.stop else {
                let epoch = board.snapshot.epoch;
                return Ok(ResetAnswer { cleared: Vec::new(), epoch });
            };
            let latched: Vec<Uuid> = record.stops.iter().map(|s| s.stop.stop_id).collect();
            let missing: Vec<&Uuid> =
                latched.iter().filter(|id| !params.stop_ids.contains(id)).collect();
            if !missing.is_empty() {
                return Err(unlisted(&missing));
            }
            if !self.gate.open(record.gate_count) {
                return Err(board
                    .vocabulary
                    .stopped(record.level)
                    .with("why", "a new stop came in"));
            }
            board.stop = None;
            board.stages.clear();
            latched
        };
        let waited = tokio::time::timeout(LOOP_PATIENCE, cleared_count.changed()).await;
        if !matches!(waited, Ok(Ok(()))) {
            return Err(Denial::new(DenialCode::Timeout, "the control loop does not answer"));
        }
        Ok(ResetAnswer { cleared, epoch: self.board.lock().snapshot.epoch })
    }
}

fn unlisted(missing: &[&Uuid]) -> Denial {
    let ids: Vec<String> = missing.iter().map(ToString::to_string).collect();
    Denial::new(
        DenialCode::InvalidArgument,
        format!("the reset must list every latched stop, it lacks {}", ids.join(", ")),
    )
    .with("field", "stop_ids")
    .with("missing", ids)
}
