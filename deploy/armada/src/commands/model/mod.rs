//! `armada model`: questions about a robot description, answered from its file alone.
//!
//! ```text
//! file, input   what is read: the description, and JSON arguments as text, @FILE or -
//! joints, pose  what JSON arguments mean, for every subcommand alike
//! srdf          SRDF files and what is wrong with them
//! tip           from which link to which, with which tool
//! others        one subcommand each
//! ```
//!
//! Invariants: no cell is asked; what cannot be used is told with file, line and element, and ends
//! with 1; arguments that do not fit the robot end with 2.

mod branches;
mod check;
mod clearance;
mod file;
mod fk;
mod ik;
mod info;
pub(crate) mod input;
mod jacobian;
mod joints;
pub(crate) mod pose;
mod retime;
mod srdf;
mod tip;

use clap::{Args, Subcommand};

use crate::exit::Exit;

/// Arguments of `armada model`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada model check arm.urdf                          is the file sound; what to mend, and how
  armada model info arm.urdf                           its links and joints as a tree
  armada model fk arm.urdf --joints '{\"elbow\": 1.2}'   where every link is
  armada model jacobian arm.urdf --tip tool0           how the tool moves with the joints
  armada model ik arm.urdf --tip tool0 --pose @g.json  joint positions for a pose
  armada model retime arm.urdf pick.json --acceleration 5
                                                       a trajectory as fast as limits allow
  armada model clearance arm.urdf arm.srdf             how near its links are to each other
  xacro arm.urdf.xacro | armada model check -          a file that is made on the way

No cell is needed. Exit codes: 0 done, 1 the file cannot be used or nothing was found, 2 wrong arguments.")]
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
    /// How a tool moves with the joints, and how far it is from a singularity
    Jacobian(jacobian::JacobianArgs),
    /// Inverse kinematics: joint positions that bring a tool to a pose
    Ik(ik::IkArgs),
    /// Time a path anew: as fast as limits of velocity, acceleration and jerk allow
    Retime(retime::RetimeArgs),
    /// How near the robot's links are to each other
    Clearance(clearance::ClearanceArgs),
}

/// Answers.
pub(crate) fn run(args: &ModelArgs) -> anyhow::Result<Exit> {
    match &args.what {
        What::Check(args) => check::run(args),
        What::Info(args) => info::run(args),
        What::Fk(args) => fk::run(args),
        What::Jacobian(args) => jacobian::run(args),
        What::Ik(args) => ik::run(args),
        What::Retime(args) => retime::run(args),
        What::Clearance(args) => clearance::run(args),
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
