//! `armada replay`: a recording through the control loop again.

use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;

use anyhow::Context as _;
use armada_agent::recorder::{Recording, replay};
use clap::{Args, ValueHint};
use serde_json::json;

use crate::exit::Exit;
use crate::output::Output;

/// Arguments of `armada replay`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada replay /tmp/armada-recordings/left_arm-1763820000000.armada
  armada replay recording.armada --json

A recording has the last seconds of a control loop: what each tick was told and said. Run through
the loop of the same build it says the same again, bit for bit; the first tick that differs is
shown. Agents write one when a fault is latched, and when `armada record ROBOT` asks for it.
Exit code 0 if nothing differs, 1 if something does.")]
pub(crate) struct ReplayArgs {
    /// Recording
    #[arg(value_name = "FILE", value_hint = ValueHint::FilePath)]
    file: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the recording and shows the first difference.
pub(crate) fn run(args: &ReplayArgs) -> anyhow::Result<Exit> {
    let label = || args.file.display().to_string();
    let file = File::open(&args.file).with_context(label)?;
    let recording = Recording::read(BufReader::new(file)).with_context(label)?;
    let result = replay(&recording);
    let difference = result.first_difference.as_ref();
    let output = Output::new(args.json);
    if args.json {
        output.json(&json!({
            "robot": recording.robot,
            "reason": recording.reason,
            "software_version": recording.software_version,
            "period_ms": recording.params.period.as_secs_f64() * 1e3,
            "ticks": result.ticks,
            "first_difference": difference.map(|difference| json!({
                "tick": difference.tick,
                "stamp_ns": difference.recorded.now,
                "text": difference.to_string(),
            })),
        }))?;
    } else {
        output.line(format!(
            "{}: {} ticks of {:.3} ms, written because: {}",
            recording.robot,
            recording.ticks(),
            recording.params.period.as_secs_f64() * 1e3,
            recording.reason,
        ))?;
        match difference {
            None => output.line(format!("{} ticks replayed, no difference", result.ticks))?,
            Some(difference) => output.line(difference)?,
        }
    }
    Ok(if difference.is_none() { Exit::Success } else { Exit::Failure })
}
