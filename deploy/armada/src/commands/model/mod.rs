//! `armada model`: questions about a robot description, answered from its file alone.
//!
//! ```text
//! file, input   what is read: the description, and JSON arguments as text, @FILE or -
//! joints, pose  what JSON arguments mean, for every subcommand alike
//! check info fk one subcommand each
//! ```
//!
//! Invariants: no cell is asked; what cannot be used is told with file, line and element, and ends
//! with 1; arguments that do not fit the robot end with 2.

mod check;
mod file;
mod fk;
mod info;
mod input;
mod joints;
mod pose;

use clap::{Args, Subcommand};

use crate::exit::Exit;

/// Arguments of `armada model`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada model check arm.urdf                          is the file sound; what to mend, and how
  armada model info arm.urdf                           its links and joints as a tree
  armada model fk arm.urdf --joints '{\"elbow\": 1.2}'   where every link is
  xacro arm.urdf.xacro | armada model check -          a file that is made on the way

No cell is needed. Exit codes: 0 done, 1 the file cannot be used, 2 wrong arguments.")]
pub(crate) struct ModelArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Tell all that is wrong or doubtful about a robot description, and what to do about it
    Check(check::CheckArgs),
    /// Show links and joints as a tree, with types and limits
    Info(info::InfoArgs),
    /// Forward kinematics: the pose of every link for positions of the joints
    Fk(fk::FkArgs),
}

/// Answers.
pub(crate) fn run(args: &ModelArgs) -> anyhow::Result<Exit> {
    match &args.what {
        What::Check(args) => check::run(args),
        What::Info(args) => info::run(args),
        What::Fk(args) => fk::run(args),
    }
}

/// One of our own robots.
#[cfg(test)]
fn own_robot(file: &str) -> armada_model::RobotModel {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/robots");
    let args = file::FileArgs { file: format!("{folder}/{file}"), json: false };
    args.model().expect("our own robots are sound")
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory as _, Parser};

    use super::*;

    #[derive(Parser)]
    struct Program {
        #[command(flatten)]
        _model: ModelArgs,
    }

    #[test]
    fn every_subcommand_explains_itself_with_an_example_and_has_json() {
        let mut program = Program::command();
        program.build();
        for command in program.get_subcommands_mut().filter(|c| c.get_name() != "help") {
            let help = command.render_long_help().to_string();
            let name = command.get_name().to_owned();
            assert!(help.contains(&format!("armada model {name}")), "{name}:\n{help}");
            assert!(help.contains("--json"), "{name}:\n{help}");
        }
    }
}
