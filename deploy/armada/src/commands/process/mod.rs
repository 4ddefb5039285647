//! The processes of a cell, one by one: `armada agent`, `gateway` and `emulator`.

pub(crate) mod agent;
pub(crate) mod emulator;
pub(crate) mod gateway;

use std::process;

use anyhow::{Context as _, bail};
use clap::Args;
use rustix::process::{Signal, getppid, set_parent_process_death_signal};

use crate::signals::Signals;

/// The tie of a process to the supervisor that started it.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct ParentArgs {
    /// Process that started this one; when it ends, this one ends too
    #[arg(long, value_name = "PID", hide = true)]
    parent: Option<u32>,
}

impl ParentArgs {
    /// Makes the kernel send this process SIGTERM when its parent ends. Call it on the main thread
    /// before any other runs.
    ///
    /// # Errors
    /// If the parent has ended already.
    pub(crate) fn tie(self) -> anyhow::Result<()> {
        let Some(parent) = self.parent else { return Ok(()) };
        set_parent_process_death_signal(Some(Signal::TERM)).context("cannot follow the parent")?;
        // It may have ended before the line above.
        let now = getppid().map(|pid| pid.as_raw_nonzero().get());
        if now.map(i64::from) != Some(i64::from(parent)) {
            bail!("process {parent}, which started this one, has ended");
        }
        Ok(())
    }
}

/// Runs `ending` to its end, unless another signal comes: then the process ends at once.
pub(crate) async fn end_or_signal<T>(signals: &mut Signals, ending: impl Future<Output = T>) -> T {
    tokio::select! {
        ended = ending => ended,
        signal = signals.next() => {
            tracing::warn!(signal, "second signal: ending at once");
            process::exit(1);
        }
    }
}
