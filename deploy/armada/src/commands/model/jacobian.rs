//! `armada model jacobian`.

#![allow(non_snake_case, reason = "X_BT is the pose of frame T in frame B")]

use armada_model::{Chain, Jacobian, Pose, Twist};
use clap::Args;
use serde::Serialize;

use super::file::FileArgs;
use super::input::one_stdin;
use super::joints::{JointsArgs, outside_limits};
use super::pose::{self, rows};
use super::tip::TipArgs;
use crate::exit::{Exit, UsageError};
use crate::output::{self, Output};
use crate::table::Table;

/// Arguments of `armada model jacobian`.
#[derive(Args, Debug)]
#[command(after_help = format!("{AFTER_HELP}\n\n{}", pose::HELP))]
pub(super) struct JacobianArgs {
    #[command(flatten)]
    file: FileArgs,
    #[command(flatten)]
    tip: TipArgs,
    #[command(flatten)]
    joints: JointsArgs,
    /// Length that weighs as much as a turn of one radian in singular values, in metres, such as
    /// the arm's reach
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    length: f64,
}

const AFTER_HELP: &str = "Examples:
  armada model jacobian arm.urdf --tip tool0 --joints '[0, -1.2, 1.9, 0, 1.5, 0]'
  armada model jacobian arm.urdf --tip tool0 --joints @ready.json --json | jq .manipulability

How the tool centre point moves for a velocity of 1 rad/s or m/s of each joint: linear velocity of
its origin, then angular velocity, in the axes of the base.

With --json, one line: {\"robot\", \"base\", \"tip\": NAME, \"joints\": [NAME], \"jacobian\": [[one number
per joint] x 6 rows, linear then angular], \"pose\": rows of the 4x4 matrix of the tool centre point
in the base, \"manipulability\" (product of the singular values with lengths in metres),
\"length_m\", \"singular_values\" with lengths in units of it, \"distance_to_singularity\" (the
smallest), \"weakest_direction\": {\"linear\": [3], \"angular\": [3]}, \"warnings\": [TEXT]}.";

#[derive(Debug, Serialize)]
struct Answer<'m> {
    robot: &'m str,
    base: &'m str,
    tip: &'m str,
    joints: Vec<&'m str>,
    jacobian: Vec<Vec<f64>>,
    pose: [[f64; 4]; 4],
    manipulability: f64,
    length_m: f64,
    singular_values: Vec<f64>,
    distance_to_singularity: f64,
    weakest_direction: Direction,
    warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
pub(super) struct Direction {
    pub(super) linear: [f64; 3],
    pub(super) angular: [f64; 3],
}

impl Direction {
    pub(super) fn of(twist: &Twist) -> Self {
        Self { linear: twist.linear.into(), angular: twist.angular.into() }
    }
}

impl<'m> Answer<'m> {
    fn of(robot: &'m str, chain: &'m Chain, own: &[f64], length_m: f64) -> anyhow::Result<Self> {
        let (X_BT, jacobian) = chain.forward_and_jacobian(own)?;
        let singular = jacobian.singular_values(length_m);
        Ok(Self {
            robot,
            base: chain.base(),
            tip: chain.tip(),
            joints: chain.variables().iter().map(|variable| variable.name.as_str()).collect(),
            jacobian: matrix(&jacobian),
            pose: rows(&Pose::from_isometry(X_BT)),
            manipulability: jacobian.manipulability(),
            length_m,
            singular_values: singular.iter().collect(),
            distance_to_singularity: singular.smallest(),
            weakest_direction: Direction::of(&singular.weakest_direction()),
            warnings: Vec::new(),
        })
    }
}

/// Six rows of one number per variable.
fn matrix(jacobian: &Jacobian) -> Vec<Vec<f64>> {
    let row = |row| (0..jacobian.len()).filter_map(|k| jacobian.element(row, k)).collect();
    (0..6).map(row).collect()
}

/// Prints how the tool moves with the joints.
pub(super) fn run(args: &JacobianArgs) -> anyhow::Result<Exit> {
    let (joints, tool) = (args.joints.joints.as_deref(), args.tip.tool.as_deref());
    one_stdin(&[Some(&args.file.file), joints, tool])?;
    if !(args.length.is_finite() && args.length > 0.0) {
        let given = args.length;
        let message = format!("--length: {given} m, expected a finite number above 0");
        return Err(UsageError(message).into());
    }
    let model = args.file.model()?;
    let chain = args.tip.chain(&model)?;
    let positions = args.joints.positions(&model)?;
    let own = chain.gather(&positions)?;
    let mut answer = Answer::of(model.name(), &chain, &own, args.length)?;
    answer.warnings = outside_limits(&model, &positions);
    for warning in &answer.warnings {
        output::note(format_args!("warning: {warning}"));
    }
    let out = Output::new(args.file.json);
    if out.is_json() {
        out.json_line(&answer)?;
        return Ok(Exit::Success);
    }
    print(&answer, &out)?;
    Ok(Exit::Success)
}

fn print(answer: &Answer<'_>, out: &Output) -> anyhow::Result<()> {
    let mut table = Table::new(&["joint", "vx", "vy", "vz", "wx", "wy", "wz"]);
    for (column, name) in answer.joints.iter().enumerate() {
        let cells = answer.jacobian.iter().filter_map(|row| row.get(column));
        let cells = cells.map(|cell| format!("{:>9.6}", (cell * 1e6).round() / 1e6 + 0.0));
        table.row(std::iter::once((*name).to_owned()).chain(cells).collect());
    }
    out.line(format_args!("{} in {}:\n{table}", answer.tip, answer.base))?;
    let values: Vec<_> = answer.singular_values.iter().map(|v| format!("{v:.6}")).collect();
    out.line(format_args!("\nmanipulability           {:.6}", answer.manipulability))?;
    out.line(format_args!("singular values          {}", values.join("  ")))?;
    out.line(format_args!("distance to singularity  {:.6}", answer.distance_to_singularity))
}

#[cfg(test)]
mod tests {
    use super::super::own_robot;
    use super::*;

    #[test]
    fn six_rows_hold_one_number_per_joint_and_fit_the_singular_values() {
        let model = own_robot("seven_axis_arm.urdf");
        let tip = model.links().last().expect("a link").name.clone();
        let chain = Chain::from_root(&model, &tip).expect("a chain");
        let own = [0.1, 0.4, -0.3, 1.2, 0.2, 0.8, 0.0];
        let answer = Answer::of(model.name(), &chain, &own[..chain.len()], 1.0).expect("fits");
        assert_eq!(answer.jacobian.len(), 6);
        assert!(answer.jacobian.iter().all(|row| row.len() == answer.joints.len()));
        let squares: f64 = answer.jacobian.iter().flatten().map(|cell| cell * cell).sum();
        let values: f64 = answer.singular_values.iter().map(|value| value * value).sum();
        assert!((squares - values).abs() < 1e-9, "{squares} {values}");
        let product: f64 = answer.singular_values.iter().product();
        assert!((product - answer.manipulability).abs() < 1e-12);
    }
}
