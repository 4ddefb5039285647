//! The commands, one per file.

pub(crate) mod call;
pub(crate) mod clearance;
pub(crate) mod completions;
pub(crate) mod control;
pub(crate) mod events;
pub(crate) mod home;
pub(crate) mod info;
pub(crate) mod jog;
pub(crate) mod kinematics;
pub(crate) mod lease;
pub(crate) mod model;
pub(crate) mod modes;
pub(crate) mod moves;
pub(crate) mod payload;
pub(crate) mod process;
pub(crate) mod replay;
pub(crate) mod reset;
pub(crate) mod run;
pub(crate) mod status;
pub(crate) mod stop;
pub(crate) mod stop_button;
pub(crate) mod tool;
mod typed_value;
pub(crate) mod up;
pub(crate) mod values;
pub(crate) mod watch;
pub(crate) mod why;

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
        Command::Why(args) => block_on(why::run(args)),
        Command::CheckClearance(args) => block_on(clearance::run(args)),
        Command::Watch(args) => block_on(watch::run(args)),
        Command::Info(args) => block_on(info::run(args)),
        Command::Events(args) => block_on(events::run(args)),
        Command::Move(args) => block_on(moves::run(args)),
        Command::Jog(args) => block_on(jog::run(args)),
        Command::Home(args) => block_on(home::run(args)),
        Command::Pause(args) => block_on(control::run_pause(args)),
        Command::Resume(args) => block_on(control::run_resume(args)),
        Command::Cancel(args) => block_on(control::run_cancel(args)),
        Command::Speed(args) => block_on(control::run_speed(args)),
        Command::Lease(args) => block_on(lease::run(args)),
        Command::Tool(args) => block_on(tool::run(args)),
        Command::Payload(args) => block_on(payload::run(args)),
        Command::Signal(args) => block_on(values::run_signal(args)),
        Command::Param(args) => block_on(values::run_param(args)),
        Command::Tcp(args) => block_on(kinematics::run_tcp(args)),
        Command::Ik(args) => block_on(kinematics::run_ik(args)),
        Command::Record(args) => block_on(control::run_record(args)),
        Command::Run(args) => block_on(run::run(args)),
        Command::Halt(args) => block_on(modes::run_on_robots::<Halt>(args)),
        Command::Stop(args) => block_on(stop::run(args)),
        Command::StopButton(args) => block_on(stop_button::run(args)),
        Command::Reset(args) => block_on(reset::run(args)),
        Command::Mode(args) => block_on(modes::run_mode(args)),
        Command::Enable(args) => block_on(modes::run_on_robots::<Enable>(args)),
        Command::Disable(args) => block_on(modes::run_on_robots::<Disable>(args)),
        Command::ResetErrors(args) => block_on(modes::run_on_robot::<ResetErrors>(args)),
        Command::Model(args) => model::run(&args),
        Command::Replay(args) => replay::run(&args),
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
