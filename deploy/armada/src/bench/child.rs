//! Processes of a measurement, as their parent sees them.

use std::process::Stdio;
use std::time::Duration;

use anyhow::{Context as _, bail};
use rustix::process::{Pid, Signal, kill_process};
use serde::de::DeserializeOwned;
use tokio::io::{AsyncBufReadExt as _, AsyncWriteExt as _, BufReader, Lines};
use tokio::process::{ChildStdin, ChildStdout, Command};
use tokio::time::timeout;

use super::part::{Ask, Part, Ready};

/// How long a process may take to be ready, to answer, and to end.
const PATIENCE: Duration = Duration::from_secs(20);

/// A process of a measurement; it is killed if this is dropped.
#[derive(Debug)]
pub(super) struct Child {
    process: tokio::process::Child,
    asks: ChildStdin,
    answers: Lines<BufReader<ChildStdout>>,
    /// What it said first.
    pub(super) ready: Ready,
}

impl Child {
    /// Starts a process and waits until it is ready.
    pub(super) async fn start(part: &Part) -> anyhow::Result<Self> {
        let program = std::env::current_exe().context("where is this program?")?;
        let mut process = Command::new(program)
            // What happens to the robots is asked for, and need not be logged as well.
            .env("RUST_LOG", std::env::var("RUST_LOG").unwrap_or_else(|_| "error".to_owned()))
            .args(["bench", "part", &serde_json::to_string(part)?])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .context("cannot start a process")?;
        let asks = process.stdin.take().context("no standard input")?;
        let answers = process.stdout.take().context("no standard output")?;
        let answers = BufReader::new(answers).lines();
        let mut child = Self { process, asks, answers, ready: Ready::default() };
        child.ready = child.answer(PATIENCE).await.with_context(|| part.to_string())?;
        Ok(child)
    }

    /// Asks the process.
    pub(super) async fn ask<T: DeserializeOwned>(&mut self, ask: Ask) -> anyhow::Result<T> {
        let line = format!("{}\n", serde_json::to_string(&ask)?);
        self.asks.write_all(line.as_bytes()).await?;
        let busy = if let Ask::Wakes(time) = ask { time } else { Duration::ZERO };
        self.answer(PATIENCE + busy).await
    }

    /// Stops it where it is, as a machine that hangs; [`Self::thaw`] lets it go on.
    pub(super) fn freeze(&self) -> anyhow::Result<()> {
        self.signal(Signal::STOP)
    }

    /// Lets it go on.
    pub(super) fn thaw(&self) -> anyhow::Result<()> {
        self.signal(Signal::CONT)
    }

    fn signal(&self, signal: Signal) -> anyhow::Result<()> {
        let pid = self.process.id().and_then(|pid| Pid::from_raw(i32::try_from(pid).ok()?));
        Ok(kill_process(pid.context("the process has ended")?, signal)?)
    }

    /// Ends the process and waits for its end.
    pub(super) async fn end(self) -> anyhow::Result<()> {
        let Self { mut process, asks, .. } = self;
        drop(asks);
        let status =
            timeout(PATIENCE, process.wait()).await.context("a process does not end")??;
        if !status.success() {
            bail!("a process of the measurement ended with {status}");
        }
        Ok(())
    }

    async fn answer<T: DeserializeOwned>(&mut self, patience: Duration) -> anyhow::Result<T> {
        let line = timeout(patience, self.answers.next_line()).await;
        let line = line.context("a process of the measurement does not answer")??;
        let line = line.context("a process of the measurement has ended")?;
        Ok(serde_json::from_str(&line)?)
    }
}
