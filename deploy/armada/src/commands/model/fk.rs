//! `armada model fk`.

#![allow(non_snake_case, reason = "X_WL is the pose of frame L in frame W")]

use armada_model::{Pose, RobotModel};
use clap::Args;
use serde::Serialize;

use super::file::FileArgs;
use super::input::one_stdin;
use super::joints::{JointsArgs, as_map, outside_limits};
use super::pose::{self, rows};
use crate::exit::{Exit, UsageError};
use crate::output::{self, Output};
use crate::table::Table;

/// Arguments of `armada model fk`.
#[derive(Args, Debug)]
#[command(after_help = format!("{AFTER_HELP}\n\n{}", pose::HELP))]
pub(super) struct FkArgs {
    #[command(flatten)]
    file: FileArgs,
    #[command(flatten)]
    joints: JointsArgs,
    /// Only this link; may be given several times
    #[arg(long = "link", value_name = "NAME")]
    links: Vec<String>,
    /// Pose of the robot's root in the frame in which links are told, such as the cell's
    #[arg(long, value_name = "POSE")]
    root_pose: Option<String>,
}

const AFTER_HELP: &str = "Examples:
  armada model fk arm.urdf
  armada model fk arm.urdf --joints '{\"elbow\": 1.2, \"lift\": 0.3}' --link tool0
  armada model fk arm.urdf --joints '[0, -1.2, 1.9, 0, 1.5, 0]' --json
  armada model fk arm.urdf --joints @ready.json --json | jq '.links.tool0'

Joints that are left out are at 0, even where 0 is outside their limits; what is outside is warned
of. A joint that mimics another follows it and cannot be given.

With --json, one line: {\"robot\": NAME, \"root\": LINK, \"joints\": {NAME: POSITION}, \"links\": {NAME:
[[4 numbers], [4], [4], [4]]}, \"warnings\": [TEXT]}. A link's matrix is its pose in the root, or in
the frame of --root-pose, row by row, in metres.";

/// Where the links are.
#[derive(Debug, Serialize)]
struct Answer<'m> {
    robot: &'m str,
    root: &'m str,
    #[serde(serialize_with = "as_map")]
    joints: Vec<(&'m str, f64)>,
    #[serde(serialize_with = "as_map")]
    links: Vec<(&'m str, [[f64; 4]; 4])>,
    warnings: Vec<String>,
}

/// Prints where the links are.
pub(super) fn run(args: &FkArgs) -> anyhow::Result<Exit> {
    let (joints, root_pose) = (args.joints.joints.as_deref(), args.root_pose.as_deref());
    one_stdin(&[Some(&args.file.file), joints, root_pose])?;
    let model = args.file.model()?;
    let positions = args.joints.positions(&model)?;
    let X_WR = match root_pose {
        Some(argument) => pose::of_argument("--root-pose", argument)?,
        None => Pose::default(),
    };
    let poses = poses(&model, &positions, &X_WR, &args.links)?;
    let warnings = outside_limits(&model, &positions);
    for warning in &warnings {
        output::note(format_args!("warning: {warning}"));
    }
    let out = Output::new(args.file.json);
    if !out.is_json() {
        out.line(table(&poses))?;
        return Ok(Exit::Success);
    }
    let names = model.variables().map(|variable| variable.name);
    out.json_line(&Answer {
        robot: model.name(),
        root: model.links().first().map_or("", |root| &root.name),
        joints: names.zip(positions).collect(),
        links: poses.iter().map(|(name, pose)| (*name, rows(pose))).collect(),
        warnings,
    })?;
    Ok(Exit::Success)
}

/// Poses of the named links, of all if none is named.
fn poses<'m>(
    model: &'m RobotModel,
    positions: &[f64],
    X_WR: &Pose,
    names: &[String],
) -> anyhow::Result<Vec<(&'m str, Pose)>> {
    let mut poses = vec![nalgebra::Isometry3::identity(); model.links().len()];
    model.link_poses(positions, &mut poses)?;
    let place = |(link, X_RL): (&'m armada_model::Link, &nalgebra::Isometry3<f64>)| {
        (link.name.as_str(), *X_WR * Pose::from_isometry(*X_RL))
    };
    let all: Vec<_> = model.links().iter().zip(&poses).map(place).collect();
    if names.is_empty() {
        return Ok(all);
    }
    let find = |name: &String| {
        let found = model.link_index(name).and_then(|index| all.get(index)).copied();
        found.ok_or_else(|| {
            let known: Vec<_> = all.iter().map(|(name, _)| *name).collect();
            UsageError(format!("there is no link {name:?}; there are {}", known.join(", "))).into()
        })
    };
    names.iter().map(find).collect()
}

fn table(poses: &[(&str, Pose)]) -> Table {
    let mut table = Table::new(&["link", "x [m]", "y", "z", "qw", "qx", "qy", "qz"]);
    for (name, pose) in poses {
        let (p, q) = (pose.position(), pose.isometry().rotation);
        let numbers = [p.x, p.y, p.z, q.w, q.i, q.j, q.k];
        // Adding zero turns the minus of a negative zero away.
        let numbers = numbers.map(|number| format!("{:>9.6}", (number * 1e6).round() / 1e6 + 0.0));
        table.row(std::iter::once((*name).to_owned()).chain(numbers).collect());
    }
    table
}

#[cfg(test)]
mod tests {
    use super::super::own_robot;
    use super::*;

    #[test]
    fn the_table_has_links_in_order_and_no_negative_zero() {
        let torso = own_robot("lift_torso.urdf");
        let poses = poses(&torso, &[0.25], &Pose::default(), &[]).expect("positions fit");
        let text = table(&poses).to_string();
        let names: Vec<_> =
            text.lines().skip(1).filter_map(|line| line.split(' ').next()).collect();
        let expected: Vec<_> = torso.links().iter().map(|link| link.name.as_str()).collect();
        assert_eq!(names, expected);
        assert!(!text.contains("-0.000000"), "{text}");
    }

    #[test]
    fn the_roots_pose_moves_every_link() {
        let torso = own_robot("lift_torso.urdf");
        let X_WR = pose::parse("[[0,-1,0,1],[1,0,0,2],[0,0,1,3],[0,0,0,1]]").expect("a pose");
        let names = ["head".to_owned()];
        let alone = poses(&torso, &[0.0], &Pose::default(), &names).expect("positions fit");
        let moved = poses(&torso, &[0.0], &X_WR, &names).expect("positions fit");
        let (distance, angle) = moved[0].1.distance(&(X_WR * alone[0].1));
        assert!(distance < 1e-15 && angle < 1e-7, "{distance} m, {angle} rad");
        assert_eq!(rows(&moved[0].1)[3], [0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn a_link_that_does_not_exist_is_refused_with_those_that_do() {
        let torso = own_robot("lift_torso.urdf");
        let error = poses(&torso, &[0.0], &Pose::default(), &["hand".to_owned()])
            .expect_err("there is no hand");
        assert!(error.is::<UsageError>());
        assert!(error.to_string().contains("there is no link \"hand\"; there are base_link"));
    }
}
