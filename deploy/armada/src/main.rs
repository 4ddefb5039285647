//! Armada: agents, gateway and tools of a robot cell in one program.
//!
//! ```text
//! cli            arguments               commands/*    one file per command
//! cell_address   where the cell is       motion        asking for a motion and waiting for its end
//! output         the only place that prints            logging    tracing to standard error
//! ```
//!
//! Invariants: everything a program may read goes to standard output through `output`; logs, notes
//! and progress go to standard error; a command ends with one of the codes of `exit`.

mod bench;
mod cell_address;
mod choice;
mod cli;
mod clock;
mod commands;
mod exit;
mod joint_goal;
mod logging;
mod motion;
mod output;
mod pose_arg;
mod run_file;
mod signals;
mod standstill;
mod started;
mod state_dir;
mod table;
mod words;

use std::process::ExitCode;

use clap::Parser;

use crate::cli::Cli;

fn main() -> ExitCode {
    let cli = Cli::parse();
    if let Err(error) = logging::start(cli.log_format, cli.command.default_log_level()) {
        output::report_error(&error);
        return exit::of_error(&error).into();
    }
    match commands::run(cli) {
        Ok(exit) => exit.into(),
        Err(error) => {
            output::report_error(&error);
            exit::of_error(&error).into()
        }
    }
}
