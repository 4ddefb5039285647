//! The only place that prints.
//!
//! Results go to standard output. When its reader is gone (`armada status | head -1`), the rest is
//! dropped without a word and the command ends with the code it would have ended with.

use std::cell::Cell;
use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use serde::Serialize;

use crate::clock;

/// Pause between progress lines where there is no terminal to rewrite one.
const PLAIN_PROGRESS: Duration = Duration::from_secs(2);

/// Where a command's results go, and in which form.
#[derive(Debug)]
pub(crate) struct Output {
    json: bool,
    closed: Cell<bool>,
}

impl Output {
    /// Results as JSON, or as text for people.
    pub(crate) const fn new(json: bool) -> Self {
        Self { json, closed: Cell::new(false) }
    }

    /// Whether results are JSON.
    pub(crate) const fn is_json(&self) -> bool {
        self.json
    }

    /// Whether nobody reads any more.
    pub(crate) const fn is_closed(&self) -> bool {
        self.closed.get()
    }

    /// Writes a text and a line feed.
    pub(crate) fn line(&self, text: impl Display) -> anyhow::Result<()> {
        self.write(format!("{text}\n").as_bytes())
    }

    /// Writes bytes as they are.
    pub(crate) fn write(&self, bytes: &[u8]) -> anyhow::Result<()> {
        if self.closed.get() {
            return Ok(());
        }
        let mut stdout = io::stdout().lock();
        match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {
                self.closed.set(true);
                Ok(())
            }
            other => other.context("standard output"),
        }
    }

    /// Writes a value as indented JSON.
    pub(crate) fn json<T: Serialize + ?Sized>(&self, value: &T) -> anyhow::Result<()> {
        self.line(serde_json::to_string_pretty(value)?)
    }

    /// Writes a value as one line of JSON.
    pub(crate) fn json_line<T: Serialize + ?Sized>(&self, value: &T) -> anyhow::Result<()> {
        self.line(serde_json::to_string(value)?)
    }
}

/// Whether a progress line stands on the terminal, which another text has to remove first.
static PROGRESS_SHOWN: AtomicBool = AtomicBool::new(false);

const CLEAR_LINE: &str = "\r\x1b[2K";

/// Tells the person something that is no result, on standard error.
pub(crate) fn note(text: impl Display) {
    let mut stderr = io::stderr().lock();
    let clear = if PROGRESS_SHOWN.swap(false, Ordering::Relaxed) { CLEAR_LINE } else { "" };
    // Nobody to tell is no reason to fail.
    drop(writeln!(stderr, "{clear}{text}"));
}

/// Tells why the command failed, with every cause.
pub(crate) fn report_error(error: &anyhow::Error) {
    note(format_args!("error: {}", chain(error)));
}

/// The error with its causes; a cause that its parent's text already ends with is left out.
fn chain(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.ends_with(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

/// A line on standard error that changes while something is in progress.
#[derive(Debug)]
pub(crate) struct Progress {
    terminal: bool,
    last_plain: Option<Instant>,
}

impl Progress {
    pub(crate) fn new() -> Self {
        Self { terminal: io::stderr().is_terminal(), last_plain: None }
    }

    /// Shows `text` in place of what was shown before.
    pub(crate) fn show(&mut self, text: &str) {
        let mut stderr = io::stderr().lock();
        if self.terminal {
            let width = ratatui::crossterm::terminal::size().map_or(80, |(columns, _)| columns);
            let text: String = text.chars().take(usize::from(width.max(2)) - 1).collect();
            drop(write!(stderr, "{CLEAR_LINE}{text}").and_then(|()| stderr.flush()));
            PROGRESS_SHOWN.store(true, Ordering::Relaxed);
        } else if self.last_plain.is_none_or(|last| last.elapsed() >= PLAIN_PROGRESS) {
            drop(writeln!(stderr, "{text}"));
            self.last_plain = Some(clock::now());
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if PROGRESS_SHOWN.swap(false, Ordering::Relaxed) {
            let mut stderr = io::stderr().lock();
            drop(write!(stderr, "{CLEAR_LINE}").and_then(|()| stderr.flush()));
        }
    }
}

/// A bar of `width` characters, filled to `fraction`.
pub(crate) fn bar(fraction: f64, width: usize) -> String {
    let fraction = if fraction.is_finite() { fraction.clamp(0.0, 1.0) } else { 0.0 };
    let filled = (fraction * width as f64).round() as usize;
    format!("{}{}", "█".repeat(filled), "░".repeat(width.saturating_sub(filled)))
}

#[cfg(test)]
mod tests {
    use anyhow::anyhow;

    use super::*;

    #[test]
    fn a_bar_never_leaves_its_width() {
        for fraction in [f64::NAN, -1.0, 0.0, 0.33, 1.0, 7.0] {
            assert_eq!(bar(fraction, 10).chars().count(), 10, "{fraction}");
        }
        assert_eq!(bar(0.5, 4), "██░░");
    }

    #[test]
    fn every_cause_is_told_once() {
        let error = anyhow!("no such file").context("config/cell.yaml");
        assert_eq!(chain(&error), "config/cell.yaml: no such file");
        let repeated = anyhow!("no such file").context("cell.yaml: no such file");
        assert_eq!(chain(&repeated), "cell.yaml: no such file");
    }
}
