//! Signals and parameters of the controller.

use armada_protocol::messages::{Denial, NameParams, NamedValue, SetValueParams};

use super::{Asker, Requests};

impl Requests {
    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn get_param(&self, _: Asker, _: NameParams) -> Result<NamedValue, Denial> {
        Err(self.not_supported("get_param"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn set_param(
        &self,
        _: Asker,
        _: SetValueParams,
    ) -> Result<NamedValue, Denial> {
        Err(self.not_supported("set_param"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn get_signal(&self, _: Asker, _: NameParams) -> Result<NamedValue, Denial> {
        Err(self.not_supported("get_signal"))
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn set_signal(
        &self,
        _: Asker,
        _: SetValueParams,
    ) -> Result<NamedValue, Denial> {
        Err(self.not_supported("set_signal"))
    }
}
