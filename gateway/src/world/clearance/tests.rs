//! Clearances that are known, and those that a fine grid finds.

#![allow(non_snake_case, reason = "X_WR is the pose of robot R in the world")]

use std::collections::BTreeMap;

use armada_model::{
    Accuracy, CompiledTrajectory, JointLimits, JointTrajectory, Mount, Pose, RobotModel,
    SceneBuilder, Waypoint,
};
use armada_protocol::RobotName;
use armada_protocol::messages::{
    CellRobot, DenialCode, JointInfo, Mount as CellMount, ReducedLimits, RobotInfo,
};

use nalgebra::{Isometry3, Vector3};

use super::{ClearanceReport, ClearanceRequest};
use crate::world::World;

const ARM: &str = include_str!("../../../../config/robots/seven_axis_arm.urdf");

/// A ball of 0.1 m that slides along x.
const BALL: &str = r#"<robot name="ball">
  <link name="rail"/>
  <link name="ball"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="slide" type="prismatic">
    <parent link="rail"/><child link="ball"/><axis xyz="1 0 0"/>
    <limit lower="-3" upper="3" velocity="10" effort="1"/>
  </joint>
</robot>"#;

/// The same without a shape.
const GHOST: &str = r#"<robot name="ghost">
  <link name="rail"/><link name="ball"/>
  <joint name="slide" type="prismatic">
    <parent link="rail"/><child link="ball"/><axis xyz="1 0 0"/>
    <limit lower="-3" upper="3" velocity="10" effort="1"/>
  </joint>
</robot>"#;

/// A robot, where it stands, and where it goes from and to.
struct Actor {
    name: &'static str,
    urdf: &'static str,
    parent: &'static str,
    X_PR: Pose,
    from: Vec<f64>,
    to: Vec<f64>,
}

fn name(robot: &str) -> RobotName {
    robot.parse().expect("a name")
}

fn info(actor: &Actor) -> RobotInfo {
    let mut info: RobotInfo =
        serde_json::from_str(include_str!("../../../../protocol/golden/robot_info.json"))
            .expect("golden sample");
    let model = RobotModel::from_urdf(actor.urdf, actor.name).expect("valid");
    let joints = model.variables().map(|variable| JointInfo {
        name: variable.name.to_owned(),
        joint_type: variable.motion.joint_type,
        limits: JointLimits { acceleration: Some(20.0), ..variable.motion.limits },
        reduced: ReducedLimits::default(),
        home: None,
    });
    info.joints = joints.collect();
    info.equipment.clear();
    info.robot = name(actor.name);
    actor.urdf.clone_into(&mut info.urdf);
    info
}

fn trajectory(actor: &Actor, duration_s: f64) -> JointTrajectory {
    let row = |time_from_start_s, position: &[f64]| Waypoint {
        time_from_start_s,
        joint_position: position.to_vec(),
        joint_velocity: vec![0.0; position.len()],
        ..Waypoint::default()
    };
    JointTrajectory {
        joint_names: info(actor).joints.into_iter().map(|joint| joint.name).collect(),
        waypoints: vec![row(0.0, &actor.from), row(duration_s, &actor.to)],
        ..JointTrajectory::default()
    }
}

fn world(actors: &[Actor]) -> World {
    let placed = actors.iter().map(|actor| CellRobot {
        robot: name(actor.name),
        mount: CellMount { parent: actor.parent.to_owned(), pose: actor.X_PR },
        endpoint: String::new(),
    });
    let mut world = World::new(placed);
    for actor in actors {
        assert!(world.set_model(&info(actor)).is_empty());
        let positions = actor.from.clone().try_into().expect("finite");
        world.set_positions(&name(actor.name), &positions);
    }
    world
}

fn request(actors: &[Actor], duration_s: f64, offset_s: f64) -> ClearanceRequest {
    let parts = actors.iter().map(|actor| (name(actor.name), trajectory(actor, duration_s)));
    let parts: BTreeMap<_, _> = parts.collect();
    ClearanceRequest { parts, reduced: Default::default(), offset_s, required_m: 0.01 }
}

fn checked(actors: &[Actor], duration_s: f64, offset_s: f64) -> ClearanceReport {
    let problem = world(actors).clearance(&request(actors, duration_s, offset_s));
    problem.expect("compiles").solve().expect("can be told")
}

/// Two balls whose ways cross: the first passes the crossing after 2 s of 4, the other earlier.
fn crossing() -> [Actor; 2] {
    let turn = Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    let quarter = Pose::from_isometry(Isometry3::new(Vector3::zeros(), turn));
    let ball = |name, X_PR, from: f64, to: f64| Actor {
        name,
        urdf: BALL,
        parent: "world",
        X_PR,
        from: vec![from],
        to: vec![to],
    };
    [ball("a", Pose::default(), -1.0, 1.0), ball("b", quarter, -0.5, 1.5)]
}

#[test]
fn ways_that_cross_one_after_the_other_are_clear_in_step() {
    let report = checked(&crossing(), 4.0, 0.0);
    assert!(report.answer.clear, "{report:?}");
    // Nearest are the centres at (-0.25, 0.25), by the symmetry of the two.
    let truth = 0.25 * 2.0_f64.sqrt() - 0.2;
    let bound = report.answer.distance_m.expect("told");
    assert!(bound <= truth + 1e-9 && bound > 0.34 * truth, "{bound} m of {truth} m");
    assert_eq!(report.answer.links, Some(("a/ball".to_owned(), "b/ball".to_owned())));
}

#[test]
fn a_lead_that_brings_them_together_is_a_collision() {
    assert!(checked(&crossing(), 4.0, 0.1).answer.clear);
    let report = checked(&crossing(), 4.0, 0.8);
    assert!(!report.answer.clear);
    let denial = report.refusal.expect("refused");
    assert_eq!(denial.code, DenialCode::Collision);
    assert!(denial.message.starts_with("a/ball and b/ball come within"), "{denial}");
    assert!(denial.message.contains("ms behind a"), "{denial}");
    assert_eq!(denial.details["required_m"], 0.01);
}

#[test]
fn robots_without_shapes_are_named_and_never_clear() {
    let [a, mut b] = crossing();
    b.urdf = GHOST;
    let report = checked(&[a, b], 4.0, 0.8);
    assert_eq!(report.refusal, None, "nothing is known that would forbid it");
    assert!(!report.answer.clear);
    assert_eq!(report.answer.distance_m, None);
    assert_eq!(report.answer.without_shape, ["b/ball", "b/rail"]);
}

#[test]
fn a_robot_that_moves_and_of_which_nothing_is_known_is_refused() {
    let [a, b] = crossing();
    let mut request = request(&[a, b], 4.0, 0.2);
    let [a, b] = crossing();
    let mut unknown = world(&[a]);
    assert!(unknown.clearance(&request).is_ok(), "it is no robot of this cell");
    let placed = [("a", Pose::default()), ("b", b.X_PR)].map(|(robot, pose)| CellRobot {
        robot: name(robot),
        mount: CellMount { parent: "world".to_owned(), pose },
        endpoint: String::new(),
    });
    unknown = World::new(placed);
    let [a, _] = crossing();
    assert!(unknown.set_model(&info(&a)).is_empty());
    let denial = unknown.clearance(&request).expect_err("nobody knows its shape");
    assert_eq!(denial.code, DenialCode::NotReady);
    assert!(denial.message.starts_with("b: "), "{denial}");
    request.parts.remove(&name("b"));
    let report = unknown.clearance(&request).expect("it stays").solve().expect("can be told");
    assert!(!report.answer.clear && report.answer.without_shape == ["b"], "{report:?}");
}

#[test]
fn a_robot_that_takes_no_part_is_an_obstacle_where_it_stands() {
    let [a, b] = crossing();
    let actors = [a, Actor { from: vec![0.1], ..b }];
    let mut request = request(&actors, 4.0, 0.2);
    request.parts.remove(&name("b"));
    let problem = world(&actors).clearance(&request).expect("compiles");
    let denial = problem.solve().expect("can be told").refusal.expect("in the way");
    assert_eq!(denial.code, DenialCode::Collision);
}

#[test]
fn what_a_robot_carries_moves_with_it_and_may_touch_it() {
    // The upper ball stands on the lower one, which takes it to a third.
    let ball = |name, parent, X_PR, from: f64, to: f64| Actor {
        name,
        urdf: BALL,
        parent,
        X_PR,
        from: vec![from],
        to: vec![to],
    };
    let above = Pose::from_translation(0.0, 0.0, 0.15);
    let beside = |x| Pose::from_translation(x, 0.0, 0.15);
    let actors = |x| {
        [
            ball("lower", "world", Pose::default(), 0.0, 1.0),
            ball("upper", "lower/ball", above, 0.0, 0.0),
            ball("wall", "world", beside(x), 0.0, 0.0),
        ]
    };
    let report = checked(&actors(1.5), 4.0, 0.2);
    assert!(report.answer.clear, "{report:?}");
    assert_eq!(checked(&actors(1.1), 4.0, 0.2).refusal.expect("hit").code, DenialCode::Collision);
}

#[test]
fn a_trajectory_beyond_the_limits_is_refused_by_name() {
    let actors = crossing();
    let denial = world(&actors)
        .clearance(&request(&actors, 0.1, 0.0))
        .expect("known")
        .solve()
        .expect_err("too fast");
    assert_eq!(denial.code, DenialCode::InvalidArgument);
    assert!(denial.message.starts_with("a: "), "{denial}");
}

/// Smallest distance of two arms over a fine grid of phases.
fn grid_minimum(actors: &[Actor], duration_s: f64, offset_s: f64) -> f64 {
    let mut builder = SceneBuilder::new();
    let mut ids = Vec::new();
    let mut courses = Vec::new();
    for actor in actors {
        let model = RobotModel::from_urdf(actor.urdf, actor.name).expect("valid");
        let mount = Mount::World(actor.X_PR);
        ids.push(builder.add_robot(actor.name, &model, mount, &mut |_| None).expect("valid"));
        let body = crate::world::body::Body::new(&info(actor)).expect("valid");
        courses.push(body.joints.compile(&trajectory(actor, duration_s), false).expect("legal"));
    }
    let scene = builder.build();
    let mut workspace = scene.workspace();
    let at = |course: &CompiledTrajectory, t: f64| {
        course.sample(t.clamp(0.0, duration_s), &mut 0).position.to_vec()
    };
    let mut least = f64::INFINITY;
    for step in 0..=80 {
        let t = duration_s * f64::from(step) / 80.0;
        for shift in -6..=6 {
            let positions =
                [at(&courses[0], t), at(&courses[1], t + offset_s * f64::from(shift) / 6.0)];
            let mut placed = scene.place(&positions.concat(), &mut workspace).expect("fits");
            let pair = placed.cross_distance((ids[0], ids[1]), Accuracy::Shapes).expect("shapes");
            least = least.min(pair.distance_m);
        }
    }
    least
}

#[test]
fn no_grid_finds_less_than_what_was_proved_of_two_arms() {
    let mut seed = 11_u64;
    let mut random = |most: f64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        most * (2.0 * f64::from(u32::try_from(seed >> 32).expect("fits")) / f64::from(u32::MAX)
            - 1.0)
    };
    let (mut clear, mut refused) = (0, 0);
    let model = RobotModel::from_urdf(ARM, "arm.urdf").expect("valid");
    for case in 0..12 {
        let arm = |name, y, from, to| Actor {
            name,
            urdf: ARM,
            parent: "world",
            X_PR: Pose::from_translation(0.0, y, 0.0),
            from,
            to,
        };
        let mut pose = || {
            let limits = model.variables().map(|variable| variable.motion.limits);
            let bounds = limits.map(|l| (l.lower.expect("bounded"), l.upper.expect("bounded")));
            bounds.map(|(l, u)| 0.5 * (l + u) + random(0.3) * (u - l)).collect::<Vec<f64>>()
        };
        let y = 0.25 + 0.05 * f64::from(case);
        let actors = [arm("left", y, pose(), pose()), arm("right", -y, pose(), pose())];
        let report = checked(&actors, 4.0, 0.3);
        let grid = grid_minimum(&actors, 4.0, 0.3);
        assert!(report.states < 50_000, "case {case}: {} configurations", report.states);
        match &report.refusal {
            None => {
                let bound = report.answer.distance_m.expect("both have shapes");
                assert!(bound >= 0.01 && bound <= grid + 1e-9, "{bound} m proved, {grid} m found");
                clear += 1;
            }
            Some(denial) => {
                let found = denial.details["distance_m"].as_f64().expect("a number");
                assert!(grid < 0.02 || found < 0.01, "{denial}, the grid finds {grid} m");
                refused += 1;
            }
        }
    }
    assert!(clear >= 3 && refused >= 1, "{clear} clear, {refused} refused: a weak test");
}
