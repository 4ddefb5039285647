//! The reset of a latched stop: checked, made durable, and only then done.
//!
//! ```text
//! list, nonce, signature, sources, zone --> file without the latch, durable --> gate opened, if no
//! stop came in between --> the loop says that it is cleared --> answer
//! ```
//!
//! A crash in between leaves an agent that died, which is a stop by itself. It moves nothing and
//! enables nothing.

use armada_protocol::messages::{Denial, DenialCode, ResetAnswer, ResetParams};
use uuid::Uuid;

use super::{Asker, LOOP_PATIENCE, Requests};
use crate::runtime::board::Board;
use crate::runtime::clock::monotonic;

/// A reset that was granted, while it becomes durable.
struct Granted {
    cleared: Vec<Uuid>,
    gate_count: u64,
    kept: u64,
}

impl Requests {
    pub(super) async fn reset(
        &self,
        asker: Asker,
        params: ResetParams,
    ) -> Result<ResetAnswer, Denial> {
        let _one_at_a_time = self.resetting.lock().await;
        let mut cleared_count = self.cleared.clone();
        cleared_count.mark_unchanged();
        let Some(granted) = self.grant_reset(&params)? else {
            let epoch = self.board.lock().snapshot.epoch;
            return Ok(ResetAnswer { cleared: Vec::new(), epoch });
        };
        let durable = tokio::time::timeout(LOOP_PATIENCE, self.keeper.durable(granted.kept)).await;
        let durable = durable.unwrap_or_else(|_| Err("the disk does not answer".to_owned()));
        self.open_gate(&granted, asker, durable)?;
        let waited = tokio::time::timeout(LOOP_PATIENCE, cleared_count.changed()).await;
        if !matches!(waited, Ok(Ok(()))) {
            return Err(Denial::new(DenialCode::Timeout, "the control loop does not answer"));
        }
        let epoch = self.board.lock().snapshot.epoch;
        Ok(ResetAnswer { cleared: granted.cleared, epoch })
    }

    /// Checks the reset and has a file without the latch written; `None` if nothing is latched. Its
    /// nonce is used up, whatever comes of it.
    fn grant_reset(&self, params: &ResetParams) -> Result<Option<Granted>, Denial> {
        let mut board = self.board.lock();
        let Some(mut record) = board.stop.take() else { return Ok(None) };
        let checked = board.check_reset(&record, params, monotonic());
        record.nonce = Uuid::new_v4();
        let (level, gate_count) = (record.level, record.gate_count);
        let cleared = record.stops.iter().map(|stop| stop.stop.stop_id).collect();
        board.stop = Some(record);
        checked?;
        if self.gate.count() != gate_count {
            return Err(board.vocabulary.stopped(level).with("why", "a new stop came in"));
        }
        let kept = self.keeper.keep(crate::runtime::stop_file::Kept::default());
        Ok(Some(Granted { cleared, gate_count, kept }))
    }

    /// Opens the gate, unless the file could not be written or anything changed meanwhile.
    fn open_gate(
        &self,
        granted: &Granted,
        asker: Asker,
        durable: Result<(), String>,
    ) -> Result<(), Denial> {
        let mut board = self.board.lock();
        let refused = match durable {
            Err(problem) => Some(not_kept(&board, &problem)),
            Ok(()) if self.keeper.newest() != granted.kept => Some(changed(&board)),
            Ok(()) if !self.gate.open(granted.gate_count) => Some(changed(&board)),
            Ok(()) => None,
        };
        if let Some(denial) = refused {
            self.keeper.keep(board.kept());
            return Err(denial);
        }
        board.stop = None;
        board.stages.clear();
        board.reset_by = Some((asker.client, granted.cleared.clone()));
        Ok(())
    }
}

fn not_kept(board: &Board, problem: &str) -> Denial {
    let robot = &board.vocabulary.robot;
    let text = format!(
        "{robot} stays stopped, for the reset cannot be kept over a restart of its agent: {problem}"
    );
    Denial::new(DenialCode::NotReady, text).with("cause", problem)
}

fn changed(board: &Board) -> Denial {
    let level = board.stop.as_ref().map(|stop| stop.level);
    let level = level.unwrap_or(armada_protocol::messages::StopLevel::L2);
    board.vocabulary.stopped(level).with("why", "a new stop came in")
}
