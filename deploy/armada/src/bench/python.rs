//! Python processes that answer questions: one JSON object a line, first what they have.

use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use anyhow::{Context as _, bail};
use serde::de::DeserializeOwned;
use serde_json::Value;
use tokio::io::{AsyncBufReadExt as _, AsyncWriteExt as _, BufReader, Lines};
use tokio::process::{Child, ChildStdin, ChildStdout, Command};
use tokio::time::timeout;

/// How long it may take to start, and to answer.
const PATIENCE: Duration = Duration::from_secs(120);

/// A Python process; it is killed if this is dropped.
#[derive(Debug)]
pub(super) struct Python {
    process: Child,
    asks: ChildStdin,
    answers: Lines<BufReader<ChildStdout>>,
}

impl Python {
    /// Runs `script` with `program`; returns the process with what it says first.
    pub(super) async fn start<T: DeserializeOwned>(
        program: &Path,
        script: &str,
        arguments: &[String],
    ) -> anyhow::Result<(Self, T)> {
        let mut process = Command::new(program)
            // One core for either side: libraries beneath numpy may start threads.
            .env("OMP_NUM_THREADS", "1")
            .args(["-u", "-c", script])
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .kill_on_drop(true)
            .spawn()
            .with_context(|| format!("cannot run {}", program.display()))?;
        let asks = process.stdin.take().context("no standard input")?;
        let answers = process.stdout.take().context("no standard output")?;
        let mut python = Self { process, asks, answers: BufReader::new(answers).lines() };
        let ready = python.answer().await.with_context(|| program.display().to_string())?;
        Ok((python, ready))
    }

    /// Asks for one thing.
    pub(super) async fn ask<T: DeserializeOwned>(&mut self, ask: &Value) -> anyhow::Result<T> {
        self.asks.write_all(format!("{ask}\n").as_bytes()).await?;
        self.answer().await
    }

    /// Ends the process and waits for its end.
    pub(super) async fn end(self) -> anyhow::Result<()> {
        let Self { mut process, asks, .. } = self;
        drop(asks);
        timeout(PATIENCE, process.wait()).await.context("a peer does not end")??;
        Ok(())
    }

    async fn answer<T: DeserializeOwned>(&mut self) -> anyhow::Result<T> {
        let line = timeout(PATIENCE, self.answers.next_line()).await;
        let line = line.context("the peer does not answer")??.context("the peer has ended")?;
        let answer: Value = serde_json::from_str(&line)?;
        if let Some(error) = answer.get("error").and_then(Value::as_str) {
            bail!("the peer: {error}");
        }
        Ok(serde_json::from_value(answer)?)
    }
}
