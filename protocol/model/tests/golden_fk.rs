//! Forward kinematics against pinocchio's answers for 19 robots, in `../shared/golden/fk`.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]

mod common;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use armada_model::{PositionSource, RobotModel};
use nalgebra::Matrix4;
use serde::Deserialize;

/// Largest difference in any element of a transform.
const TOLERANCE: f64 = 1e-9;

#[derive(Deserialize)]
struct Golden {
    urdf: String,
    mimic: BTreeMap<String, (String, f64, f64)>,
    configurations: Vec<Configuration>,
}

#[derive(Deserialize)]
struct Configuration {
    joint_positions: BTreeMap<String, f64>,
    #[serde(rename = "root_T_link_row_major")]
    link_transforms: BTreeMap<String, Vec<f64>>,
}

/// Golden answers with the robots they belong to; empty if the shared data is absent.
fn golden() -> Vec<(Golden, RobotModel)> {
    let (Some(answers), Some(robots)) = (common::shared("golden/fk"), common::shared("robots"))
    else {
        return Vec::new();
    };
    let mut files: Vec<PathBuf> = std::fs::read_dir(answers)
        .expect("the folder is readable")
        .map(|entry| entry.expect("an entry").path())
        .collect();
    files.sort();
    assert_eq!(files.len(), 19, "golden answers are missing");
    files.iter().map(|file| read(file, &robots)).collect()
}

fn read(file: &Path, robots: &Path) -> (Golden, RobotModel) {
    let text = std::fs::read_to_string(file).expect("the answers are readable");
    let golden: Golden = serde_json::from_str(&text).expect("the answers have their form");
    let urdf = golden.urdf.strip_prefix("shared/robots/").expect("a path in shared");
    let model = common::load(&robots.join(urdf));
    (golden, model)
}

fn positions(model: &RobotModel, configuration: &Configuration) -> Vec<f64> {
    let named = &configuration.joint_positions;
    assert_eq!(model.variable_count(), named.len(), "{}: driven joints", model.name());
    model.variables().map(|variable| named[variable.name]).collect()
}

#[test]
fn every_link_of_every_robot_stands_where_pinocchio_puts_it() {
    let mut compared = 0;
    for (golden, model) in golden() {
        for (index, configuration) in golden.configurations.iter().enumerate() {
            let positions = positions(&model, configuration);
            let poses = common::link_poses(&model, &positions);
            let expected = &configuration.link_transforms;
            assert_eq!(poses.len(), expected.len(), "{}: links", golden.urdf);
            for (link, pose) in model.links().iter().zip(&poses) {
                let difference =
                    common::difference(pose, &Matrix4::from_row_slice(&expected[&link.name]));
                assert!(
                    difference <= TOLERANCE,
                    "{} configuration {index} link {}: {difference:e}",
                    golden.urdf,
                    link.name
                );
                compared += 1;
            }
        }
    }
    println!("{compared} poses compared");
}

#[test]
fn the_pose_of_one_link_equals_its_pose_among_all() {
    for (golden, model) in golden() {
        for configuration in &golden.configurations {
            let positions = positions(&model, configuration);
            for (link, pose) in common::link_poses(&model, &positions).iter().enumerate() {
                let alone = model.link_pose(&positions, link).expect("the link exists");
                let difference = common::difference(&alone, &pose.to_homogeneous());
                assert!(difference <= 1e-12, "{} link {link}: {difference:e}", golden.urdf);
            }
        }
    }
}

#[test]
fn mimic_joints_follow_the_joints_that_pinocchio_names() {
    for (golden, model) in golden() {
        let variables: Vec<_> = model.variables().map(|variable| variable.name).collect();
        let mut mimics = BTreeMap::new();
        for joint in model.joints() {
            if let Some(PositionSource::Mimic { variable, multiplier, offset }) =
                joint.motion.as_ref().map(|motion| motion.position)
            {
                let master = variables[variable].to_owned();
                mimics.insert(joint.name.clone(), (master, multiplier, offset));
            }
        }
        assert_eq!(mimics, golden.mimic, "{}", golden.urdf);
    }
}
