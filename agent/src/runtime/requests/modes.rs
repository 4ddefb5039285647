//! Mode, drives and faults.

use std::time::Duration;

use armada_protocol::messages::{Denial, Empty, HaltAnswer, ModeAnswer, SetModeParams};
use armada_protocol::method::{Method, robot};

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
}
