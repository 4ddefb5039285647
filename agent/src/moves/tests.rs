//! Plans of single moves on a six-axis arm.

use armada_model::{JointLimits, JointVector, MotionLimits, Pose, RobotModel};

use super::*;
use crate::control::{Equipment, EquippedChain};

const NAMES: [&str; 6] = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
];
const READY: [f64; 6] = [0.1, -1.4, 1.6, -1.7, -1.5, 0.2];

struct Arm {
    equipment: Equipment,
    limits: MotionLimits,
    names: Vec<String>,
}

impl Arm {
    fn new() -> Self {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/robots/six_axis_arm.urdf");
        let urdf = std::fs::read_to_string(file).expect("a robot description");
        let model = RobotModel::from_urdf(&urdf, file).expect("a robot");
        let limits = JointLimits {
            lower: Some(-6.2),
            upper: Some(6.2),
            velocity: 2.0,
            acceleration: Some(5.0),
            ..JointLimits::default()
        };
        let joints = NAMES.map(|name| (name, limits));
        let links = ("base_link", "tool0");
        let chain = EquippedChain::new(&model, links, &joints, Pose::default());
        let tcp = Pose::from_translation(0.0, 0.0, 0.15);
        let chain = EquippedChain { tcp, ..chain.expect("a chain") };
        Self {
            equipment: Equipment { config_seqno: 1, chains: vec![chain] },
            limits: MotionLimits::new(&[limits; 6]).expect("complete"),
            names: NAMES.map(str::to_owned).to_vec(),
        }
    }

    fn planner(&self) -> MovePlanner<'_> {
        MovePlanner { equipment: &self.equipment, limits: &self.limits, names: &self.names }
    }

    fn plan(&self, moves: &[SingleMove]) -> Result<MovePlan, MoveError> {
        self.planner().plan(&ready(), moves)
    }

    fn tcp(&self, position: &JointVector) -> Pose {
        self.equipment.chains[0].tip(position, &JointVector::EMPTY).expect("finite").tcp
    }

    /// Where the tool is every 5 ms.
    fn way(&self, plan: &MovePlan) -> Vec<Pose> {
        let steps = (plan.trajectory.duration_s() / 5e-3).ceil() as u32;
        let mut hint = 0;
        let at = |step| plan.trajectory.sample(f64::from(step) * 5e-3, &mut hint).position;
        (0..=steps).map(at).map(|position| self.tcp(&position)).collect()
    }
}

fn ready() -> JointVector {
    JointVector::from_slice(&READY).expect("finite")
}

fn step(goal: MoveGoal) -> SingleMove {
    SingleMove { goal, speed: 1.0, blend_radius_m: 0.0 }
}

fn joint(changes: &[(usize, f64)]) -> MoveGoal {
    let mut goal = ready();
    for (joint, change) in changes {
        goal[*joint] += change;
    }
    MoveGoal::Joint(goal)
}

fn line(to: Pose) -> MoveGoal {
    MoveGoal::Linear { chain: 0, pose: to }
}

#[test]
fn a_straight_move_is_straight() {
    let arm = Arm::new();
    let from = arm.tcp(&ready());
    let to = Pose::from_translation(-0.1, 0.2, 0.1) * from;
    let plan = arm.plan(&[step(line(to))]).expect("a plan");
    let way = arm.way(&plan);
    let direction = (to.position() - from.position()).normalize();
    for pose in &way {
        let off = pose.position() - from.position();
        let beside = off - direction * off.dot(&direction);
        assert!(beside.norm() < 1.5e-4, "{} m beside the line", beside.norm());
    }
    let (distance, angle) = way.last().expect("an end").distance(&to);
    assert!(distance < 1e-4 && angle < 1e-3, "{distance} {angle}");
}

#[test]
fn a_move_to_a_pose_gets_there_on_a_straight_way_of_the_joints() {
    let arm = Arm::new();
    let pose = Pose::from_translation(0.05, -0.1, -0.1) * arm.tcp(&ready());
    let plan = arm.plan(&[step(MoveGoal::Pose { chain: 0, pose })]).expect("a plan");
    let end = plan.trajectory.end();
    assert!(arm.tcp(&end).distance(&pose).0 < 1e-5);
    assert!(end.max_abs_difference(&ready()) < 1.0, "the posture is kept: {end:?}");
}

#[test]
fn half_the_speed_takes_longer_and_a_move_to_here_takes_a_moment() {
    let arm = Arm::new();
    let goal = joint(&[(0, 1.5)]);
    let quick = arm.plan(&[step(goal)]).expect("a plan").trajectory.duration_s();
    let slow = arm.plan(&[SingleMove { speed: 0.5, ..step(goal) }]).expect("a plan");
    assert!((slow.trajectory.duration_s() - 1.7).abs() < 0.05, "1.5 rad at 1 rad/s");
    assert!(slow.trajectory.duration_s() > 1.4 * quick);
    let here = arm.plan(&[step(joint(&[]))]).expect("a plan");
    assert!(here.trajectory.duration_s() <= 0.01);
    assert_eq!(here.trajectory.end(), ready());
}

#[test]
fn a_blend_of_joint_moves_stays_within_its_radius_of_the_corner_and_saves_time() {
    let arm = Arm::new();
    let (first, second) = (joint(&[(0, 0.6)]), joint(&[(0, 0.6), (1, -0.5)]));
    let radius = 0.05;
    let rounded = SingleMove { blend_radius_m: radius, ..step(first) };
    let blended = arm.plan(&[rounded, step(second)]).expect("a plan");
    let sharp = arm.plan(&[step(first), step(second)]).expect("a plan");
    assert!(blended.trajectory.duration_s() < 0.95 * sharp.trajectory.duration_s());
    let MoveGoal::Joint(corner) = first else { unreachable!("a joint move") };
    let corner = arm.tcp(&corner);
    let nearest = arm.way(&blended).iter().map(|pose| pose.distance(&corner).0).fold(1.0, f64::min);
    assert!(nearest > 1e-4 && nearest < radius, "{nearest} m from the corner");
    let [passed, end] = blended.passed_s[..] else { panic!("two moves") };
    assert!(passed > 0.2 && passed < end - 0.2, "{passed} {end}");
    assert!((end - blended.trajectory.duration_s()).abs() < 1e-9);
}

#[test]
fn blended_lines_pass_their_corner_without_a_stop() {
    let arm = Arm::new();
    let from = arm.tcp(&ready());
    let corner = Pose::from_translation(0.0, 0.15, 0.0) * from;
    let end = Pose::from_translation(0.0, 0.15, -0.15) * from;
    let rounded = SingleMove { blend_radius_m: 0.03, ..step(line(corner)) };
    let plan = arm.plan(&[rounded, step(line(end))]).expect("a plan");
    let way = arm.way(&plan);
    let inner = &way[way.len() / 8..way.len() * 7 / 8];
    let slowest = inner.windows(2).map(|two| two[0].distance(&two[1]).0).fold(1.0, f64::min);
    assert!(slowest / 5e-3 > 0.02, "{} m/s", slowest / 5e-3);
    let nearest = way.iter().map(|pose| pose.distance(&corner).0).fold(1.0, f64::min);
    assert!(nearest > 1e-3 && nearest < 0.03, "{nearest} m from the corner");
}

#[test]
fn what_cannot_be_reached_or_blended_is_refused_with_its_place() {
    let arm = Arm::new();
    let far = Pose::from_translation(3.0, 0.0, 0.0);
    let error = arm.plan(&[step(MoveGoal::Pose { chain: 0, pose: far })]).expect_err("too far");
    assert!(matches!(error.problem, MoveProblem::Unreachable { .. }), "{error}");
    let to = Pose::from_translation(2.0, 0.0, 0.0) * arm.tcp(&ready());
    let error = arm.plan(&[step(line(to))]).expect_err("too far");
    assert!(error.to_string().contains("fraction"), "{error}");
    let beyond = arm.plan(&[step(joint(&[])), step(joint(&[(0, 7.0)]))]).expect_err("beyond");
    assert_eq!(beyond.index, 1);
    assert!(matches!(beyond.problem, MoveProblem::BeyondLimit { joint: 0, .. }), "{beyond}");
    let rounded = SingleMove { blend_radius_m: 0.05, ..step(joint(&[(0, 0.3)])) };
    let near = Pose::from_translation(0.0, 0.1, 0.0) * arm.tcp(&ready());
    let mixed = arm.plan(&[rounded, step(line(near))]).expect_err("no such blend");
    assert!(matches!(mixed.problem, MoveProblem::MixedBlend), "{mixed}");
    let slow = SingleMove { speed: 0.5, ..step(joint(&[(1, 0.2)])) };
    let speeds = arm.plan(&[rounded, slow]).expect_err("two speeds");
    assert!(matches!(speeds.problem, MoveProblem::BlendedSpeed { .. }), "{speeds}");
}
