//! Distances in scenes of several robots.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(non_snake_case, reason = "X_WR is the pose of frame R in frame W")]

mod common;

use std::f64::consts::{FRAC_PI_2, PI};

use armada_model::{
    Accuracy, Capsule, ClearanceError, CollisionScene, Mount, Owner, Pose, RobotId, RobotModel,
    SceneBuilder, Shape, Srdf,
};
use nalgebra::{Isometry3, Point2, Point3, Translation3, Vector3};

fn at(x: f64, y: f64, z: f64) -> Mount {
    Mount::World(Pose::from_translation(x, y, z))
}

fn add(builder: &mut SceneBuilder, name: &str, model: &RobotModel, mount: Mount) -> RobotId {
    builder.add_robot(name, model, mount, &mut |_| None).expect("a robot")
}

/// The default cell: its mounts are those of config/cells/dual_arm.yaml, and a table.
fn cell() -> (CollisionScene, [RobotId; 3]) {
    let (arm, torso) =
        (common::own_robot("six_axis_arm.urdf"), common::own_robot("lift_torso.urdf"));
    let half_turn = Vector3::new(0.0, 0.0, PI);
    let mount = |y| {
        let X_WR = Isometry3::new(Vector3::new(0.0, y, 0.75), half_turn);
        Mount::World(Pose::from_isometry(X_WR))
    };
    let mut builder = SceneBuilder::new();
    let left = add(&mut builder, "left_arm", &arm, mount(0.45));
    let right = add(&mut builder, "right_arm", &arm, mount(-0.45));
    let torso = add(&mut builder, "torso", &torso, at(-0.8, 0.0, 0.0));
    let table = Shape::Box { size: [0.8, 1.6, 0.05] };
    builder.add_fixed("table", &table, &Pose::from_translation(0.2, 0.0, 0.725)).expect("a box");
    (builder.build(), [left, right, torso])
}

const HOME: [f64; 6] = [0.0, -FRAC_PI_2, FRAC_PI_2, -FRAC_PI_2, -FRAC_PI_2, 0.0];

/// Positions of the cell: both arms, the torso in the middle of its limits.
fn cell_positions(scene: &CollisionScene, left: [f64; 6], right: [f64; 6]) -> Vec<f64> {
    let mut positions = [left, right].concat();
    positions.resize(scene.variable_count(), 0.1);
    positions
}

/// A seeded generator of positions.
struct Random(u64);

impl Random {
    fn next(&mut self, low: f64, high: f64) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let unit = f64::from(u32::try_from(self.0 >> 32).expect("32 bits")) / f64::from(u32::MAX);
        low + (high - low) * unit
    }
}

#[test]
fn the_default_cell_is_clear_at_home() {
    let (scene, [left, right, torso]) = cell();
    let mut workspace = scene.workspace();
    let positions = cell_positions(&scene, HOME, HOME);
    let mut placed = scene.place(&positions, &mut workspace).expect("positions fit");
    let near = placed.minimum(Accuracy::Shapes).expect("pairs");
    let names = [near.a, near.b].map(|body| scene.body(body).expect("a body").name().to_owned());
    assert!(near.distance_m > 0.005, "{names:?}: {near:?}");
    let cross = placed.cross_distance((left, right), Accuracy::Shapes).expect("pairs");
    let swapped = placed.cross_distance((right, left), Accuracy::Shapes).expect("pairs");
    assert_eq!(cross, swapped);
    // The bases are 0.9 m apart.
    assert!((0.4..0.9).contains(&cross.distance_m), "{cross:?}");
    assert!(placed.cross_distance((left, torso), Accuracy::Shapes).is_some());
    assert!(placed.fixed_distance(left, Accuracy::Shapes).is_some());
    assert!(placed.self_distance(left, Accuracy::Shapes).expect("pairs").distance_m > 0.0);
    assert_eq!(scene.without_shape(), []);
}

#[test]
fn arms_that_reach_for_each_other_collide() {
    let (scene, [left, right, _]) = cell();
    let mut workspace = scene.workspace();
    let (mut l, mut r) = (HOME, HOME);
    // Stretched out, towards each other.
    (l[0], l[1], l[2]) = (FRAC_PI_2, 0.3, 0.0);
    (r[0], r[1], r[2]) = (-FRAC_PI_2, 0.3, 0.0);
    let mut found = f64::INFINITY;
    for turn in [1.0, -1.0] {
        (l[0], r[0]) = (turn * l[0], turn * r[0]);
        for lift in [-0.6, -0.3, 0.0, 0.3] {
            (l[1], r[1]) = (lift, lift);
            let positions = cell_positions(&scene, l, r);
            let mut placed = scene.place(&positions, &mut workspace).expect("positions fit");
            let near = placed.cross_distance((left, right), Accuracy::Shapes).expect("pairs");
            found = found.min(near.distance_m);
        }
    }
    assert!(found <= 0.0, "{found}");
}

#[test]
fn the_minimum_is_that_of_all_pairs_and_capsules_are_never_above_it() {
    let arm = common::own_robot("seven_axis_arm.urdf");
    let mut builder = SceneBuilder::new();
    let left = add(&mut builder, "left", &arm, at(0.0, 0.35, 0.0));
    let right = add(&mut builder, "right", &arm, at(0.0, -0.35, 0.0));
    let plate = Shape::Box { size: [2.0, 2.0, 0.1] };
    builder.add_fixed("table", &plate, &Pose::from_translation(0.0, 0.0, -0.06)).expect("a box");
    let scene = builder.build();
    let mut workspace = scene.workspace();
    let mut random = Random(3);
    for case in 0..60 {
        let positions: Vec<_> = (0..14).map(|_| random.next(-1.7, 1.7)).collect();
        let mut placed = scene.place(&positions, &mut workspace).expect("positions fit");
        let mut all = Vec::new();
        placed.pairs_below(1e3, Accuracy::Shapes, |pair| all.push(pair));
        let mut capsules = Vec::new();
        placed.pairs_below(1e3, Accuracy::Capsules, |pair| capsules.push(pair));
        assert_eq!((all.len(), capsules.len()), (scene.pair_count(), scene.pair_count()));
        for (shape, capsule) in all.iter().zip(&capsules) {
            assert_eq!(
                (shape.a, shape.b, shape.accuracy),
                (capsule.a, capsule.b, Accuracy::Shapes)
            );
            assert!(capsule.distance_m <= shape.distance_m + 1e-9, "{shape:?} {capsule:?}");
            let gap = (shape.point_b - shape.point_a).norm();
            assert!(shape.distance_m <= 0.0 || (gap - shape.distance_m).abs() < 1e-9, "{shape:?}");
        }
        let least = |pairs: &[armada_model::PairDistance]| {
            pairs.iter().map(|pair| pair.distance_m).fold(f64::INFINITY, f64::min)
        };
        let near = placed.minimum(Accuracy::Shapes).expect("pairs").distance_m;
        assert!((near - least(&all)).abs() < 1e-12, "case {case}: {near} {}", least(&all));
        let near = placed.minimum(Accuracy::Capsules).expect("pairs").distance_m;
        assert!((near - least(&capsules)).abs() < 1e-12, "case {case}");
        let parts = [
            placed.self_distance(left, Accuracy::Shapes),
            placed.self_distance(right, Accuracy::Shapes),
            placed.cross_distance((left, right), Accuracy::Shapes),
            placed.fixed_distance(left, Accuracy::Shapes),
            placed.fixed_distance(right, Accuracy::Shapes),
        ];
        let parts: Vec<_> = parts.into_iter().flatten().collect();
        assert_eq!(parts.len(), 5);
        assert!((least(&parts) - least(&all)).abs() < 1e-12, "case {case}");
        let mut near_ones = 0;
        placed.pairs_below(0.2, Accuracy::Shapes, |_| near_ones += 1);
        assert_eq!(near_ones, all.iter().filter(|pair| pair.distance_m < 0.2).count());
    }
}

/// A sphere of 0.1 m that a slide carries along z.
const LIFT: &str = r#"<robot name="lift"><link name="base"/><link name="ball">
  <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="z" type="prismatic"><parent link="base"/><child link="ball"/><axis xyz="0 0 1"/>
  <limit lower="-2" upper="2" velocity="1" effort="1"/></joint></robot>"#;

fn lift() -> RobotModel {
    RobotModel::from_urdf(LIFT, "lift.urdf").expect("a robot")
}

#[test]
fn distances_to_primitives_are_those_of_geometry() {
    let turned = |x: f64| {
        Pose::from_isometry(Isometry3::new(
            Vector3::new(x, 0.0, 0.0),
            Vector3::new(0.0, FRAC_PI_2, 0.0),
        ))
    };
    let cases = [
        (Shape::Box { size: [0.4, 1.0, 1.0] }, Pose::from_translation(1.0, 0.0, 0.0), 0.7),
        (Shape::Box { size: [0.4, 1.0, 1.0] }, turned(1.0), 0.4),
        (Shape::Cylinder { radius: 0.2, length: 3.0 }, Pose::from_translation(1.0, 0.0, 0.5), 0.7),
        (Shape::Cylinder { radius: 0.2, length: 0.6 }, turned(1.0), 0.6),
        (Shape::Capsule { radius: 0.2, length: 0.6 }, turned(1.0), 0.4),
        (Shape::Sphere { radius: 0.2 }, Pose::from_translation(0.6, 0.8, 0.0), 0.7),
        // The centre in the box, and as a sphere in a sphere.
        (Shape::Box { size: [3.0; 3] }, Pose::default(), -0.1),
        (Shape::Sphere { radius: 0.2 }, Pose::default(), -0.3),
    ];
    for (shape, pose, expected) in cases {
        let mut builder = SceneBuilder::new();
        add(&mut builder, "lift", &lift(), at(0.0, 0.0, 0.0));
        builder.add_fixed("shape", &shape, &pose).expect("a shape");
        let scene = builder.build();
        let mut workspace = scene.workspace();
        let mut placed = scene.place(&[0.0], &mut workspace).expect("positions fit");
        let near = placed.minimum(Accuracy::Shapes).expect("a pair");
        assert!((near.distance_m - expected).abs() < 2e-8, "{shape:?}: {}", near.distance_m);
        assert_eq!(near.accuracy, Accuracy::Shapes);
        let bound = placed.minimum(Accuracy::Capsules).expect("a pair");
        assert!(bound.distance_m <= near.distance_m + 1e-9, "{shape:?}");
    }
}

#[test]
fn a_mesh_is_as_far_away_as_its_hull() {
    let urdf = LIFT.replace(
        r#"<sphere radius="0.1"/>"#,
        r#"<mesh filename="package://lift/cube.stl" scale="0.1 0.1 0.1"/>"#,
    );
    let model = RobotModel::from_urdf(&urdf, "lift.urdf").expect("a robot");
    let corner = |n: u32, bit: u32| if n & (1 << bit) == 0 { -1.0 } else { 1.0 };
    let mut cube: Vec<_> =
        (0..8).map(|n| Point3::new(corner(n, 0), corner(n, 1), corner(n, 2))).collect();
    cube.push(Point3::origin());
    let mut asked = Vec::new();
    let mut mesh = |file: &str| {
        asked.push(file.to_owned());
        Some(cube.clone())
    };
    let mut builder = SceneBuilder::new();
    let robot = builder.add_robot("lift", &model, at(0.0, 0.0, 0.0), &mut mesh).expect("a robot");
    let ball = Shape::Sphere { radius: 0.1 };
    builder.add_fixed("ball", &ball, &Pose::from_translation(0.4, 0.5, 0.0)).expect("a sphere");
    let scene = builder.build();
    assert_eq!(asked, ["package://lift/cube.stl"]);
    let mut workspace = scene.workspace();
    let mut placed = scene.place(&[0.0], &mut workspace).expect("positions fit");
    let near = placed.fixed_distance(robot, Accuracy::Shapes).expect("a pair");
    // From the edge at (0.1, 0.1) to the centre at (0.4, 0.5).
    assert!((near.distance_m - 0.4).abs() < 1e-9, "{near:?}");
    // Anywhere along the edge.
    assert!((near.point_b.xy() - Point2::new(0.34, 0.42)).norm() < 1e-7, "{near:?}");
}

/// Largest gap between two cuboids of that size in any direction that can separate them: not above
/// their distance, and not above zero if they overlap.
fn gap_of_boxes(size: [f64; 3], X_WA: &Isometry3<f64>, X_WB: &Isometry3<f64>) -> f64 {
    let axes = |pose: &Isometry3<f64>| [Vector3::x(), Vector3::y(), Vector3::z()].map(|v| pose * v);
    let (a, b) = (axes(X_WA), axes(X_WB));
    let crossed = a.iter().flat_map(|u| b.iter().map(move |v| u.cross(v)));
    let normals = crossed.filter(|normal| normal.norm() > 1e-6).map(|normal| normal.normalize());
    let apart = X_WB.translation.vector - X_WA.translation.vector;
    let gap = |normal: Vector3<f64>| {
        let extent = |axes: &[Vector3<f64>; 3]| -> f64 {
            axes.iter().zip(size).map(|(axis, edge)| 0.5 * edge * axis.dot(&normal).abs()).sum()
        };
        apart.dot(&normal).abs() - extent(&a) - extent(&b)
    };
    a.into_iter().chain(b).chain(normals).map(gap).fold(f64::NEG_INFINITY, f64::max)
}

/// The same cuboid as primitive and as the hull of its corners, in any pose: one distance.
#[test]
fn a_box_of_vertices_is_as_far_away_as_a_box() {
    let size = [0.2, 0.3, 0.7];
    let shape = |inner: &str| {
        let urdf = LIFT.replace(r#"<sphere radius="0.1"/>"#, inner);
        RobotModel::from_urdf(&urdf, "box.urdf").expect("a robot")
    };
    let (solid, mesh) = (shape(r#"<box size="0.2 0.3 0.7"/>"#), shape(r#"<mesh filename="m"/>"#));
    let corner = |n: u32, axis: u32| {
        let half = 0.5 * size[usize::try_from(axis).expect("small")];
        if n & (1 << axis) == 0 { -half } else { half }
    };
    let corners: Vec<_> =
        (0..8).map(|n| Point3::new(corner(n, 0), corner(n, 1), corner(n, 2))).collect();
    let mut random = Random(11);
    let mut overlapping = 0;
    for case in 0..300 {
        let mut vector = |most: f64| {
            Vector3::new(
                random.next(-most, most),
                random.next(-most, most),
                random.next(-most, most),
            )
        };
        let (X_WA, X_WB) =
            (Isometry3::new(vector(0.6), vector(3.0)), Isometry3::new(vector(0.6), vector(3.0)));
        let distance = |a: &RobotModel, b: &RobotModel| {
            let mut builder = SceneBuilder::new();
            for (name, model, X_WR) in [("a", a, X_WA), ("b", b, X_WB)] {
                let mount = Mount::World(Pose::from_isometry(X_WR));
                builder
                    .add_robot(name, model, mount, &mut |_| Some(corners.clone()))
                    .expect("valid");
            }
            let scene = builder.build();
            let mut workspace = scene.workspace();
            let mut placed = scene.place(&[0.1, -0.1], &mut workspace).expect("positions fit");
            placed.minimum(Accuracy::Shapes).expect("a pair").distance_m
        };
        let (both, one, none) =
            (distance(&solid, &solid), distance(&solid, &mesh), distance(&mesh, &mesh));
        assert!(
            (both - one).abs() < 1e-7 && (both - none).abs() < 1e-7,
            "{case}: {both} {one} {none}"
        );
        // The slides shift them by 0.1 m along their own axes.
        let slid = |X_WR: Isometry3<f64>, z: f64| X_WR * Translation3::new(0.0, 0.0, z);
        let gap = gap_of_boxes(size, &slid(X_WA, 0.1), &slid(X_WB, -0.1));
        assert!(both >= gap - 1e-9 && (both <= 0.0) == (gap <= 0.0), "{case}: {both}, gap {gap}");
        overlapping += u32::from(both <= 0.0);
    }
    assert!((30..270).contains(&overlapping), "{overlapping} of 300 overlap");
}

#[test]
fn links_without_a_mesh_are_listed_until_they_get_a_capsule() {
    let urdf = LIFT.replace(r#"<sphere radius="0.1"/>"#, r#"<mesh filename="ball.stl"/>"#);
    let model = RobotModel::from_urdf(&urdf, "lift.urdf").expect("a robot");
    let mut builder = SceneBuilder::new();
    let robot = add(&mut builder, "lift", &model, at(0.0, 0.0, 0.0));
    let bare = builder.clone().build();
    assert_eq!(bare.bodies().len(), 0);
    let missing = &bare.without_shape()[0];
    assert_eq!((missing.robot, missing.link, &*missing.file), (robot, 1, "ball.stl"));
    let mut workspace = bare.workspace();
    let mut placed = bare.place(&[0.0], &mut workspace).expect("positions fit");
    assert_eq!(placed.minimum(Accuracy::Shapes), None);

    let capsule = Capsule::new(Point3::origin(), Point3::new(0.0, 0.0, 0.5), 0.1).expect("valid");
    builder.add_capsule((robot, 1), "ball", capsule).expect("the link exists");
    let tool = Shape::Sphere { radius: 0.05 };
    let tip = Pose::from_translation(0.0, 0.0, 0.7);
    builder.add_shape((robot, 1), "gripper", &tool, &tip).expect("the link exists");
    builder.add_fixed("wall", &tool, &Pose::from_translation(0.0, 0.0, 2.0)).expect("a sphere");
    let scene = builder.build();
    assert_eq!(scene.without_shape(), []);
    let mut workspace = scene.workspace();
    let mut placed = scene.place(&[1.0], &mut workspace).expect("positions fit");
    let near = placed.minimum(Accuracy::Shapes).expect("a pair");
    let names = [near.a, near.b].map(|body| scene.body(body).expect("a body").name());
    assert_eq!(names, ["lift/gripper", "wall"]);
    assert!((near.distance_m - 0.2).abs() < 1e-12, "{near:?}");
}

#[test]
fn a_robot_on_another_moves_with_it() {
    let mut builder = SceneBuilder::new();
    let carrier = add(&mut builder, "carrier", &lift(), at(0.0, 0.0, 0.0));
    let pose = Pose::from_translation(0.5, 0.0, 0.0);
    let mount = Mount::Link { robot: carrier, link: 1, pose };
    let rider = add(&mut builder, "rider", &lift(), mount);
    let scene = builder.build();
    let mut workspace = scene.workspace();
    let mut placed = scene.place(&[0.7, 1.2], &mut workspace).expect("positions fit");
    let ball = placed.link_pose(rider, 1).expect("a link").translation.vector;
    assert!((ball - Vector3::new(0.5, 0.0, 1.9)).norm() < 1e-12, "{ball}");
    let near = placed.cross_distance((carrier, rider), Accuracy::Shapes).expect("a pair");
    assert!((near.distance_m - (0.5_f64.hypot(1.2) - 0.2)).abs() < 1e-12, "{near:?}");
    assert_eq!((scene.variables_of(rider), scene.variable_count()), (Some(1..2), 2));
}

/// Five links with a sphere each: base -turn- one -fixed- two -turn- three -turn- four.
const CHAIN: &str = r#"<robot name="chain">
  <link name="base"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="one"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="two"><collision><geometry><sphere radius="0.1"/></geometry></collision>
    <collision><geometry><sphere radius="0.2"/></geometry></collision></link>
  <link name="three"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="four"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="a" type="continuous"><parent link="base"/><child link="one"/></joint>
  <joint name="b" type="fixed"><parent link="one"/><child link="two"/></joint>
  <joint name="c" type="continuous"><parent link="two"/><child link="three"/></joint>
  <joint name="d" type="continuous"><parent link="three"/><child link="four"/></joint></robot>"#;

fn pair_names(scene: &CollisionScene) -> Vec<String> {
    let name = |id| scene.body(id).expect("a body").name().to_owned();
    let mut names: Vec<_> =
        scene.pairs().map(|(a, b)| format!("{} {}", name(a), name(b))).collect();
    names.sort();
    names.dedup();
    names
}

#[test]
fn rigid_adjacent_disabled_and_allowed_pairs_are_not_checked() {
    let model = RobotModel::from_urdf(CHAIN, "chain.urdf").expect("a robot");
    let mut builder = SceneBuilder::new();
    let robot = add(&mut builder, "r", &model, at(0.0, 0.0, 0.0));
    let wall = builder
        .add_fixed("wall", &Shape::Sphere { radius: 1.0 }, &Pose::default())
        .expect("a sphere");
    let floor = builder
        .add_fixed("floor", &Shape::Sphere { radius: 1.0 }, &Pose::default())
        .expect("a sphere");
    let with_walls = ["r/four", "r/one", "r/three", "r/two"]
        .iter()
        .flat_map(|link| [format!("{link} floor"), format!("{link} wall")]);
    let own = ["r/base r/four", "r/base r/three", "r/one r/four", "r/two r/four"];
    let mut expected: Vec<_> = own.map(str::to_owned).into_iter().chain(with_walls).collect();
    expected.sort();
    // Not base with what is fixed, one and two as one body, neighbours by one joint.
    assert_eq!(pair_names(&builder.clone().build()), expected);

    let srdf = r#"<robot name="chain"><disable_collisions link1="four" link2="base"/>
      <disable_default_collisions link="two"/>
      <enable_collisions link1="two" link2="three"/></robot>"#;
    let (srdf, problems) = Srdf::read(srdf, "chain.srdf", &model).expect("an SRDF");
    assert_eq!(problems, []);
    builder.apply_srdf(robot, &srdf).expect("the robot exists");
    builder.allow(wall, Owner::Link { robot, link: 4 }).expect("both exist");
    builder.allow(Owner::Link { robot, link: 3 }, floor).expect("both exist");
    let names = pair_names(&builder.build());
    for gone in ["r/base r/four", "r/two r/four", "r/four wall", "r/three floor"] {
        assert!(!names.contains(&gone.to_owned()), "{gone}");
    }
    assert!(names.contains(&"r/two r/three".to_owned()), "enabled by name: {names:?}");
    assert!(names.contains(&"r/four floor".to_owned()));
}

#[test]
fn what_does_not_fit_is_refused() {
    let mut builder = SceneBuilder::new();
    let robot = add(&mut builder, "lift", &lift(), at(0.0, 0.0, 0.0));
    let ball = Shape::Sphere { radius: 0.1 };
    let repeated = ClearanceError::RepeatedName { name: "lift".into() };
    assert_eq!(builder.add_fixed("lift", &ball, &Pose::default()), Err(repeated.clone()));
    let again = builder.add_robot("lift", &lift(), at(0.0, 0.0, 0.0), &mut |_| None);
    assert_eq!(again, Err(repeated));
    let unknown = ClearanceError::UnknownLink { robot: "lift".into(), link: 2, links: 2 };
    assert_eq!(builder.add_shape((robot, 2), "x", &ball, &Pose::default()), Err(unknown));
    let missing = Owner::Fixed { fixed: 0 };
    let unknown = ClearanceError::UnknownFixed { fixed: 0, count: 0 };
    assert_eq!(builder.allow(missing, missing), Err(unknown));
    let bad = Shape::Box { size: [1.0, f64::NAN, 1.0] };
    assert!(matches!(
        builder.add_fixed("bad", &bad, &Pose::default()),
        Err(ClearanceError::Length { field: "length of a shape", .. })
    ));
    let mesh = Shape::Mesh { file: "a.stl".into(), scale: [1.0; 3] };
    assert_eq!(
        builder.add_fixed("mesh", &mesh, &Pose::default()),
        Err(ClearanceError::MeshFile { file: "a.stl".into() })
    );
    let urdf = LIFT.replace(r#"<sphere radius="0.1"/>"#, r#"<mesh filename="ball.stl"/>"#);
    let meshed = RobotModel::from_urdf(&urdf, "lift.urdf").expect("a robot");
    let empty = builder.add_robot("m", &meshed, at(0.0, 0.0, 0.0), &mut |_| Some(Vec::new()));
    assert_eq!(empty, Err(ClearanceError::NoVertices));
    let (other, scene) = (SceneBuilder::new().build(), builder.clone().build());
    assert_eq!(other.place(&[], &mut scene.workspace()).err(), Some(ClearanceError::Workspace));
    let mut workspace = scene.workspace();
    let count = ClearanceError::PositionCount { expected: 1, given: 2 };
    assert_eq!(scene.place(&[0.0, 0.0], &mut workspace).err(), Some(count));
    assert!(matches!(
        scene.place(&[f64::NAN], &mut workspace),
        Err(ClearanceError::Kinematics { robot: 0, .. })
    ));
    let far = scene.place(&[2e6], &mut workspace).err();
    assert_eq!(far, Some(ClearanceError::TooFar { body: 0 }));
    let other_robot = builder.add_robot("second", &lift(), at(0.0, 0.0, 0.0), &mut |_| None);
    let stranger = other_robot.expect("a robot");
    let error = SceneBuilder::new().apply_srdf(stranger, &Srdf::default());
    assert_eq!(error, Err(ClearanceError::UnknownRobot { robot: 1, robots: 0 }));
}

#[test]
fn scenes_of_real_robots_list_what_has_no_shape() {
    let Some(robots) = common::shared("robots") else { return };
    for (name, has_primitives) in
        [("pr2/pr2", true), ("panda/panda", false), ("fr3/dual_fr3", true)]
    {
        let path = robots.join(name);
        let model = common::load(&path.with_extension("urdf"));
        let text = std::fs::read_to_string(path.with_extension("srdf")).expect("readable");
        let (srdf, _) = Srdf::read(&text, name, &model).expect("an SRDF");
        let mut builder = SceneBuilder::new();
        let robot = add(&mut builder, name, &model, at(0.0, 0.0, 0.0));
        builder.apply_srdf(robot, &srdf).expect("the robot exists");
        let scene = builder.build();
        println!("{name}: {} bodies, {} pairs", scene.bodies().len(), scene.pair_count());
        let shapes: usize = model.links().iter().map(|link| link.collisions.len()).sum();
        assert_eq!(scene.bodies().len() + scene.without_shape().len(), shapes, "{name}");
        assert_eq!(!scene.bodies().is_empty(), has_primitives, "{name}");
        let mut workspace = scene.workspace();
        let positions = vec![0.0; model.variable_count()];
        let mut placed = scene.place(&positions, &mut workspace).expect("positions fit");
        assert_eq!(placed.minimum(Accuracy::Shapes).is_some(), scene.pair_count() > 0, "{name}");
    }
}
