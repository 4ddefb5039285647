//! The recorder of the control loop.

use armada_protocol::messages::{Denial, DenialCode, Empty, RecordingAnswer};

use super::{Asker, Requests};

impl Requests {
    pub(super) async fn save_recording(
        &self,
        _: Asker,
        _: Empty,
    ) -> Result<RecordingAnswer, Denial> {
        match &self.recorder {
            Some(recorder) => recorder.save().await,
            None => Err(Denial::new(
                DenialCode::NotSupported,
                "the recorder is switched off: recorder.seconds is 0 in the robot file",
            )),
        }
    }
}
