//! The recorder of the control loop.

use armada_protocol::messages::{Denial, Empty, RecordingAnswer};

use super::{Asker, Requests};

impl Requests {
    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn save_recording(
        &self,
        _: Asker,
        _: Empty,
    ) -> Result<RecordingAnswer, Denial> {
        Err(self.not_supported("save_recording"))
    }
}
