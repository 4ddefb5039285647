//! What a control loop holds can be written down in the middle of a motion, read again, and goes on
//! bit for bit as it would have: what a recording of the loop is made of.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use armada_model::{
    Chain, CompiledTrajectory, JointLimits, JointMove, JointTrajectory, JointVector, MotionLimits,
    MotionState, OnPath, OnlineOptions, OnlineState, Pose, Retargeter, RobotModel, StopRamp,
    TrajectoryOptions, Transition, Waypoint,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

fn again<T: Serialize + DeserializeOwned>(value: &T) -> T {
    let bytes = rmp_serde::to_vec_named(value).expect("encodes");
    rmp_serde::from_slice(&bytes).expect("decodes")
}

fn limits() -> MotionLimits {
    // The second joint turns without end: its limits are infinite, which JSON could not say.
    let joint = |lower, upper| JointLimits {
        lower,
        upper,
        velocity: 1.3,
        acceleration: Some(3.7),
        jerk: Some(71.0),
        effort: None,
    };
    MotionLimits::new(&[joint(Some(-2.0), Some(2.0)), joint(None, None)]).expect("complete")
}

fn vector(values: [f64; 2]) -> JointVector {
    JointVector::from_slice(&values).expect("finite")
}

fn trajectory(rows: &[(f64, [f64; 2])]) -> CompiledTrajectory {
    let waypoints = rows.iter().map(|(time_from_start_s, row)| Waypoint {
        time_from_start_s: *time_from_start_s,
        joint_position: row.to_vec(),
        ..Waypoint::default()
    });
    let trajectory = JointTrajectory {
        joint_names: vec!["a".to_owned(), "b".to_owned()],
        waypoints: waypoints.collect(),
        ..JointTrajectory::default()
    };
    let options = TrajectoryOptions::default();
    CompiledTrajectory::compile(&trajectory, &["a", "b"], &limits(), &options).expect("legal")
}

#[test]
fn a_trajectory_comes_back_equal() {
    let path = trajectory(&[(0.0, [0.0, 0.0]), (0.9, [0.31, -0.2]), (2.0, [0.5, 0.1])]);
    assert_eq!(again(&path), path);
}

#[test]
fn a_motion_on_its_path_goes_on_as_it_would_have() {
    let path = trajectory(&[(0.0, [0.0, 0.0]), (0.9, [0.31, -0.2]), (2.0, [0.5, 0.1])]);
    let mut motion = OnPath::start(&path, &limits()).expect("two joints");
    for tick in 0..700 {
        match tick {
            100 => motion.set_speed_ratio(0.37).expect("a ratio"),
            300 => motion.pause().expect("not stopped"),
            500 => motion.resume().expect("not stopped"),
            _ => {}
        }
        let mut read = again(&motion);
        let (one, other) = (motion.clone().tick(&path, 0.002), read.tick(&path, 0.002));
        assert_eq!(one, other, "tick {tick}");
        motion.tick(&path, 0.002);
    }
}

#[test]
fn a_target_is_followed_as_it_would_have_been() {
    let start = OnlineState::at_rest(vector([0.1, -0.3]));
    let mut joints = Retargeter::new(&start, &limits(), OnlineOptions::default()).expect("at rest");
    for tick in 0..400_u32 {
        if tick % 60 == 0 {
            let goal = f64::from(tick) * 0.004 - 0.7;
            let target = OnlineState::at_rest(vector([goal, -2.0 * goal]));
            joints.retarget(&target).expect("inside the limits");
        }
        let mut read = again(&joints);
        assert_eq!(joints.clone().tick(0.002), read.tick(0.002), "tick {tick}");
        if tick % 60 == 40 {
            let target = OnlineState::at_rest(vector([0.2, 0.2]));
            let mut kept = joints.clone();
            kept.retarget(&target).expect("inside the limits");
            read = again(&joints);
            read.retarget(&target).expect("inside the limits");
            assert_eq!(kept.tick(0.013), read.tick(0.013), "tick {tick}");
        }
        joints.tick(0.002);
    }
}

#[test]
fn ramps_moves_and_transitions_come_back_the_same() {
    let limits = limits();
    let moving = MotionState { position: vector([0.1, 0.2]), velocity: vector([0.7, -0.6]) };
    let mut ramp = StopRamp::plan(&moving, &limits, std::time::Duration::from_millis(2));
    let mut read = again(&ramp);
    while !ramp.is_standstill() {
        assert_eq!(ramp.step(), read.step());
    }
    let plan = JointMove::plan(&moving, &vector([1.0, 1.0]), &limits).expect("inside");
    assert_eq!(again(&plan), plan);
    let path = trajectory(&[(0.0, [0.3, 0.2]), (1.2, [0.9, -0.2])]);
    let state = OnlineState {
        position: moving.position,
        velocity: moving.velocity,
        acceleration: vector([0.0, 0.0]),
    };
    let way = Transition::plan(&state, &path, &limits, 0.2).expect("a way");
    let read = again(&way);
    for step in 0..200 {
        let time_s = f64::from(step) * 0.01;
        assert_eq!(way.at(time_s), read.at(time_s));
    }
}

#[test]
fn a_chain_with_its_tool_comes_back_the_same() {
    let urdf = r#"<robot name="two">
      <link name="base"/><link name="mid"/><link name="tip"/>
      <joint name="a" type="revolute"><parent link="base"/><child link="mid"/>
        <origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/><axis xyz="0.6 0 0.8"/>
        <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
      <joint name="b" type="continuous"><parent link="mid"/><child link="tip"/>
        <origin xyz="0.3 0 0.1" rpy="0.3 -0.2 0.7"/><axis xyz="0 1 0"/>
        <limit velocity="1" effort="1"/></joint>
    </robot>"#;
    let model = RobotModel::from_urdf(urdf, "two").expect("a robot");
    let tool = Pose::from_translation(0.01, 0.02, 0.13);
    let chain = Chain::new(&model, "base", "tip").expect("a chain").with_tool(&tool);
    let read = again(&chain);
    for step in 0..50 {
        let own = [f64::from(step) * 0.02 - 0.5, f64::from(step) * 0.1];
        let (one, other) = (chain.forward_and_jacobian(&own), read.forward_and_jacobian(&own));
        assert_eq!(format!("{one:?}"), format!("{other:?}"));
    }
}
