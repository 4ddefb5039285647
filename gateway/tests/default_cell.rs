//! The default cell and its demonstration motion fit each other.

#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests, not only tests")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use armada_gateway::config::{CellConfig, RobotEntry};
use armada_gateway::world::{ClearanceRequest, World};
use armada_model::{
    CompiledTrajectory, JointLimits, JointTrajectory, JointVector, MonoTime, MotionLimits,
    RobotModel, TrajectoryOptions,
};
use armada_protocol::RobotName;
use armada_protocol::messages::{JointInfo, ReducedLimits, RobotInfo};
use serde_json::Value;

/// Height of the table the arms stand on \[m\].
const TABLE_M: f64 = 0.75;

fn config_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config")
}

fn cell() -> CellConfig {
    CellConfig::load(&config_folder().join("cells/dual_arm.yaml")).expect("valid")
}

fn handover() -> JointTrajectory {
    let path = config_folder().join("motions/handover.json");
    serde_json::from_str(&std::fs::read_to_string(path).expect("readable")).expect("a trajectory")
}

/// A robot of the default cell, with what matters of its robot file.
struct Robot {
    joints: Vec<JointInfo>,
    urdf: String,
    /// Where its emulator begins.
    initial: Vec<f64>,
}

fn robot(entry: &RobotEntry) -> Robot {
    let text = std::fs::read_to_string(&entry.file).expect("robot file");
    let file: Value = serde_saphyr::from_str(&text).expect("YAML");
    let urdf_file = entry.file.with_file_name(file["urdf"].as_str().expect("a name"));
    let urdf = std::fs::read_to_string(urdf_file).expect("URDF");
    let model = RobotModel::from_urdf(&urdf, entry.name.as_str()).expect("valid");
    let either = |value: &Value, rad: &str, m: &str| {
        value.get(rad).or_else(|| value.get(m)).cloned().unwrap_or_default()
    };
    let acceleration = |joint: &str| {
        either(&file["joints"][joint], "acceleration_rad_s2", "acceleration_m_s2").as_f64()
    };
    let joints = model.variables().map(|variable| JointInfo {
        name: variable.name.to_owned(),
        joint_type: variable.motion.joint_type,
        limits: JointLimits { acceleration: acceleration(variable.name), ..variable.motion.limits },
        reduced: ReducedLimits::default(),
        home: None,
    });
    let joints: Vec<_> = joints.collect();
    let initial = either(&file["driver"]["sim"]["emulator"], "initial_rad", "initial_m");
    let initial = joints.iter().map(|joint| initial[&joint.name].as_f64().unwrap_or_default());
    let initial = initial.collect();
    Robot { joints, urdf, initial }
}

fn part(motion: &JointTrajectory, name: &RobotName, robot: &Robot) -> CompiledTrajectory {
    let prefix = format!("{name}/");
    let named = motion.joint_names.iter().enumerate();
    let (columns, names): (Vec<_>, Vec<_>) = named
        .filter_map(|(column, joint)| Some((column, joint.strip_prefix(&prefix)?.to_owned())))
        .unzip();
    let part = motion.select(&columns, names).expect("columns exist");
    let order: Vec<_> = robot.joints.iter().map(|joint| &joint.name).collect();
    let limits: Vec<_> = robot.joints.iter().map(|joint| joint.limits).collect();
    let limits = MotionLimits::new(&limits).expect("complete");
    CompiledTrajectory::compile(&part, &order, &limits, &TrajectoryOptions::default())
        .unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn parts() -> BTreeMap<RobotName, (Robot, CompiledTrajectory)> {
    let motion = handover();
    let of_entry = |entry: RobotEntry| {
        let robot = robot(&entry);
        let part = part(&motion, &entry.name, &robot);
        (entry.name, (robot, part))
    };
    cell().robots.into_iter().map(of_entry).collect()
}

fn world(parts: &BTreeMap<RobotName, (Robot, CompiledTrajectory)>) -> World {
    let mut world = World::new(cell().cell_robots());
    for (name, (robot, _)) in parts {
        let mut info: RobotInfo =
            serde_json::from_str(include_str!("../../protocol/golden/robot_info.json"))
                .expect("golden sample");
        info.robot = name.clone();
        info.joints.clone_from(&robot.joints);
        info.urdf.clone_from(&robot.urdf);
        let errors = world.set_model(&info);
        assert!(errors.is_empty(), "{errors:?}");
    }
    world
}

#[test]
fn the_handover_is_legal_for_every_robot_and_can_be_repeated() {
    for (name, (_, part)) in parts() {
        assert!((10.0..=12.0).contains(&part.duration_s()), "{name}: {} s", part.duration_s());
        assert_eq!(part.start(), part.end(), "{name} does not come back to where it began");
    }
}

#[test]
fn the_handover_begins_where_the_emulators_begin() {
    for (name, (robot, part)) in parts() {
        let initial = JointVector::from_slice(&robot.initial).expect("finite");
        assert_eq!(part.start(), initial, "{name}");
    }
}

#[test]
fn the_arms_meet_without_touching_each_other_or_the_table() {
    let parts = parts();
    let mut world = world(&parts);
    let [left, right] = ["left_arm", "right_arm"].map(|name| name.parse().expect("a name"));
    let moving = ["forearm_link", "wrist_1_link", "wrist_2_link", "wrist_3_link", "tool0"];
    let mut nearest = f64::INFINITY;
    for step in 0..=1_200_u32 {
        for (name, (_, part)) in &parts {
            let sample = part.sample(f64::from(step) * 0.01, &mut 0);
            world.set_positions(name, &sample.position);
        }
        drop(world.frames(MonoTime::ZERO));
        let at = |robot, link| *world.link_pose(robot, link).expect("placed").position();
        nearest = nearest.min((at(&left, "tool0") - at(&right, "tool0")).norm());
        for link in moving {
            for robot in [&left, &right] {
                let height = at(robot, link).z - TABLE_M;
                assert!(height > 0.2, "{robot}/{link} is {height} m above the table at {step}");
            }
            for other in moving {
                let distance = (at(&left, link) - at(&right, other)).norm();
                assert!(distance >= 0.15, "{link} and {other}: {distance} m at step {step}");
            }
        }
    }
    assert!((0.15..0.25).contains(&nearest), "the tools come within {nearest} m");
}

#[test]
fn the_handover_is_clear_even_if_one_robot_stops_at_once() {
    let parts = parts();
    let mut world = world(&parts);
    for (name, (robot, _)) in &parts {
        world.set_positions(name, &JointVector::from_slice(&robot.initial).expect("finite"));
    }
    let motion = handover();
    let select = |name: &RobotName| {
        let prefix = format!("{name}/");
        let named = motion.joint_names.iter().enumerate();
        let (columns, names): (Vec<_>, Vec<_>) = named
            .filter_map(|(column, joint)| Some((column, joint.strip_prefix(&prefix)?.to_owned())))
            .unzip();
        motion.select(&columns, names).expect("columns exist")
    };
    let request = ClearanceRequest {
        parts: parts.keys().map(|name| (name.clone(), select(name))).collect(),
        reduced: Default::default(),
        offset_s: 0.5,
        required_m: cell().clearance.required_m,
    };
    let report = world.clearance(&request).expect("legal").solve().expect("can be told");
    assert_eq!(report.refusal, None);
    let distance = report.answer.distance_m.expect("all have shapes");
    assert!((0.01..0.2).contains(&distance), "{distance} m");
    assert!(report.answer.clear, "{:?}", report.answer.without_shape);
}
