//! The arguments.

use clap::{Parser, Subcommand};
use tracing::Level;

use crate::bench;
use crate::commands::{
    call, clearance, completions, control, events, home, info, jog, kinematics, lease, model,
    modes, moves, payload, process, replay, reset, run, status, stop, stop_button, tool, up,
    values, watch, why,
};
use crate::exit;
use crate::logging::LogFormat;

const ABOUT: &str = "Armada runs a cell of robot arms over a network.

One agent process per robot controller closes the control loop and speaks Zenoh; one gateway per cell \
knows all robots, and routes motions and stops. This program is all of them, and the tools for people \
and scripts.";

const EXAMPLES: &str = "Examples:
  armada up config/cells/dual_arm.yaml          start a whole cell on this machine
  armada status                                 how is every robot, what to do next
  armada watch left_arm                         one robot, live
  armada move left_arm --joints elbow=1.2       move one joint, the others stay
  armada jog left_arm --tool x=0.02 --for 2     move the tool by hand
  armada run config/motions/handover.json       a motion of several robots
  armada stop                                   stop all robots, gateway alive or not
  armada status --connect tcp/10.0.0.5:7447     a cell on another machine

Where the cell is: --connect, else --cell FILE, else the cell that `armada up` started on this
machine, else tcp/127.0.0.1:7447.";

/// Arguments of the program.
#[derive(Debug, Parser)]
#[command(
    name = "armada",
    version,
    about = "Runs a cell of robot arms over a network",
    long_about = ABOUT,
    after_help = EXAMPLES,
    after_long_help = format!("{EXAMPLES}\n\n{}", exit::HELP),
    max_term_width = 100,
    subcommand_required = true,
    arg_required_else_help = true
)]
pub(crate) struct Cli {
    /// Form of the log on standard error; `RUST_LOG` chooses what is logged
    #[arg(long, global = true, value_enum, default_value = "text", value_name = "FORMAT")]
    pub(crate) log_format: LogFormat,
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Start a whole cell on this machine, and end it on Ctrl-C
    #[command(long_about = up::LONG_ABOUT)]
    Up(up::UpArgs),
    /// Run the agent of one robot
    Agent(process::agent::AgentArgs),
    /// Run the gateway of a cell
    Gateway(process::gateway::GatewayArgs),
    /// Run an emulated controller, or inject a fault into one
    Emulator(process::emulator::EmulatorArgs),
    /// Show every robot: presence, mode, stops, lease, pose, rates, and what to do next
    Status(status::StatusArgs),
    /// Tell why a robot does not move, or for whom it does, and what to do
    Why(why::WhyArgs),
    /// Show one robot live: joints between their limits, mode, faults, rates
    Watch(watch::WatchArgs),
    /// Show what a robot is: joints, limits, chains, methods, URDF
    Info(info::InfoArgs),
    /// Follow what happens: faults, mode changes, motions, stops
    Events(events::EventsArgs),
    /// Move a robot's joints to a position or its tool to a pose, and wait for the end
    Move(moves::MoveArgs),
    /// Move joints or a tool at a speed, for a time
    Jog(jog::JogArgs),
    /// Find the references of a robot's joints
    Home(home::HomeArgs),
    /// Follow a trajectory from a file, with one robot or several
    Run(run::RunArgs),
    /// Check how near robots come to each other on a trajectory; nothing moves
    CheckClearance(clearance::ClearanceArgs),
    /// Bring a motion to rest on its path until it is resumed
    Pause(control::MotionArgs),
    /// Go on with a paused motion
    Resume(control::MotionArgs),
    /// End a motion with a ramp, or take it out of the queue
    Cancel(control::MotionArgs),
    /// Change the speed of all motions of a robot, or of a motion of several
    Speed(control::SpeedArgs),
    /// Ramp robots to standstill; they stay ready for the next command
    Halt(modes::RobotsArgs),
    /// Stop robots and keep them stopped until a reset, gateway alive or not
    #[command(long_about = stop::LONG_ABOUT)]
    Stop(stop::StopArgs),
    /// Be a stop button for robots whose files name it: silence is a press
    #[command(long_about = stop_button::LONG_ABOUT)]
    StopButton(stop_button::StopButtonArgs),
    /// Clear latched stops; nothing moves and nothing is enabled by it
    Reset(reset::ResetArgs),
    /// Change the command mode of a robot
    Mode(modes::ModeArgs),
    /// Switch the drives of robots on
    Enable(modes::RobotsArgs),
    /// Ramp robots to standstill and switch their drives off
    Disable(modes::RobotsArgs),
    /// Clear the latched faults of a robot whose cause is gone
    ResetErrors(modes::RobotArgs),
    /// Hold, take or delegate the right to command robots, or show who has it
    Lease(lease::LeaseArgs),
    /// Attach, detach and list tools
    Tool(tool::ToolArgs),
    /// Attach and detach payloads
    Payload(payload::PayloadArgs),
    /// Read and set signals of a controller
    Signal(values::SignalArgs),
    /// Read and set parameters of a controller
    Param(values::ParamArgs),
    /// Show where a robot's tool is, with the tool that it carries
    Tcp(kinematics::TcpArgs),
    /// Find joint positions of a running robot for a pose of its tool
    Ik(kinematics::IkArgs),
    /// Write the last seconds of a robot's control loop to a file
    Record(control::RecordArgs),
    /// Call a method by its name with JSON parameters, for scripts and debugging
    Call(call::CallArgs),
    /// Answer questions about a robot description: check it, show it, where its links are
    Model(model::ModelArgs),
    /// Run a recording of a control loop through it again, and show what differs
    Replay(replay::ReplayArgs),
    /// Measure timing on this machine, against what Armada is built on
    Bench(bench::BenchArgs),
    /// Write the completion script of a shell
    Completions(completions::CompletionsArgs),
}

impl Command {
    /// What is logged if `RUST_LOG` does not say: the processes of a cell tell more than its tools.
    pub(crate) const fn default_log_level(&self) -> Level {
        match self {
            Self::Agent(_) | Self::Gateway(_) | Self::Emulator(_) => Level::INFO,
            _ => Level::WARN,
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_command_explains_itself_with_an_example() {
        let mut cli = Cli::command();
        cli.build();
        for command in cli.get_subcommands_mut().filter(|command| command.get_name() != "help") {
            let help = command.render_long_help().to_string();
            let name = command.get_name().to_owned();
            assert!(help.contains(&format!("armada {name}")), "{name} has no example:\n{help}");
        }
    }
}
