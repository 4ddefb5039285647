//! Logs of this process: fields, to standard error.

use anyhow::Context as _;
use clap::ValueEnum;
use tracing::Level;
use tracing_subscriber::EnvFilter;

/// Form of a log line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogFormat {
    /// For people.
    Text,
    /// One JSON object a line.
    Json,
}

/// Starts logging at `level`, unless `RUST_LOG` says otherwise.
pub(crate) fn start(format: LogFormat, level: Level) -> anyhow::Result<()> {
    let directives = match std::env::var("RUST_LOG") {
        Ok(text) if !text.is_empty() => text,
        // Zenoh warns of every endpoint that does not answer yet, which is the ordinary course here.
        _ => format!("{level},zenoh=error,zenoh_transport=error,zenoh_link_tcp=error"),
    };
    let filter = EnvFilter::try_new(&directives)
        .with_context(|| format!("RUST_LOG={directives:?} is not understood"))?;
    let builder = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    let started = match format {
        LogFormat::Text => {
            let colour = std::io::IsTerminal::is_terminal(&std::io::stderr());
            builder.with_ansi(colour).try_init()
        }
        LogFormat::Json => builder.json().flatten_event(true).try_init(),
    };
    started.map_err(|error| anyhow::anyhow!("logging cannot start: {error}"))
}
