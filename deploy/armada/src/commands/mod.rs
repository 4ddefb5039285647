//! The commands, one per file.

pub(crate) mod call;
pub(crate) mod completions;
pub(crate) mod events;
pub(crate) mod info;
pub(crate) mod jog;
pub(crate) mod model;
pub(crate) mod modes;
pub(crate) mod process;
pub(crate) mod reset;
pub(crate) mod run;
pub(crate) mod status;
pub(crate) mod stop;
pub(crate) mod up;
pub(crate) mod watch;

use std::future::Future;

use anyhow::Context as _;
use armada_protocol::method::robot::{Disable, Enable, Halt, ResetErrors};

use crate::bench;
use crate::cli::{Cli, Command};
use crate::exit::Exit;

/// Does what was asked for.
pub(crate) fn run(cli: Cli) -> anyhow::Result<Exit> {
    match cli.command {
        Command::Up(args) => block_on(up::run(args, cli.log_format)),
        Command::Agent(args) => {
            args.parent.tie()?;
            block_on(process::agent::run(args))
        }
        Command::Gateway(args) => {
            args.parent.tie()?;
            block_on(process::gateway::run(args))
        }
        Command::Emulator(args) => {
            args.parent.tie()?;
            block_on(process::emulator::run(args))
        }
        Command::Status(args) => block_on(status::run(args)),
        Command::Watch(args) => block_on(watch::run(args)),
        Command::Info(args) => block_on(info::run(args)),
        Command::Events(args) => block_on(events::run(args)),
        Command::Move(args) => block_on(jog::run(args)),
        Command::Run(args) => block_on(run::run(args)),
        Command::Halt(args) => block_on(modes::run_on_robots::<Halt>(args)),
        Command::Stop(args) => block_on(stop::run(args)),
        Command::Reset(args) => block_on(reset::run(args)),
        Command::Mode(args) => block_on(modes::run_mode(args)),
        Command::Enable(args) => block_on(modes::run_on_robots::<Enable>(args)),
        Command::Disable(args) => block_on(modes::run_on_robots::<Disable>(args)),
        Command::ResetErrors(args) => block_on(modes::run_on_robot::<ResetErrors>(args)),
        Command::Model(args) => model::run(&args),
        Command::Call(args) => block_on(call::run(args)),
        Command::Bench(args) => block_on(bench::run(args)),
        Command::Completions(args) => completions::run(&args),
    }
}

/// Runs a command to its end on this thread; its helpers run on the runtime's threads.
fn block_on(command: impl Future<Output = anyhow::Result<Exit>>) -> anyhow::Result<Exit> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .context("cannot start threads")?;
    let result = runtime.block_on(command);
    // What still runs in the background, such as a reader of the keyboard, has nothing to add.
    runtime.shutdown_background();
    result
}
