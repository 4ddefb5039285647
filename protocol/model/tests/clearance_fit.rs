//! Capsules fitted to shapes contain them, and are not much larger than they need be.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(non_snake_case, reason = "X_WA is the pose of frame A in frame W")]

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use armada_model::{Capsule, Collision, Link, Mount, Pose, RobotModel, SceneBuilder, Shape};
use nalgebra::{Isometry3, Point3, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// The capsule fitted to a shape that is fixed in the world.
fn fitted(shape: &Shape, pose: &Pose) -> Capsule {
    let mut builder = SceneBuilder::new();
    builder.add_fixed("shape", shape, pose).expect("a shape");
    *builder.build().bodies()[0].capsule()
}

/// The capsule fitted to the vertices of a mesh.
fn fitted_mesh(vertices: &[Point3<f64>], scale: [f64; 3]) -> Capsule {
    let [x, y, z] = scale;
    let urdf = format!(
        r#"<robot name="r"><link name="l"><collision><geometry>
        <mesh filename="m.stl" scale="{x} {y} {z}"/></geometry></collision></link></robot>"#
    );
    let model = RobotModel::from_urdf(&urdf, "r.urdf").expect("a robot");
    let mut builder = SceneBuilder::new();
    let mut mesh = |file: &str| (file == "m.stl").then(|| vertices.to_vec());
    let mount = Mount::World(Pose::default());
    builder.add_robot("r", &model, mount, &mut mesh).expect("a robot");
    *builder.build().bodies()[0].capsule()
}

/// Points of the shape's surface that are farthest out, in its frame.
fn extreme_points(shape: &Shape) -> Vec<Point3<f64>> {
    let signs = [-1.0, 1.0];
    let turns = (0..96).map(|n| TAU * f64::from(n) / 96.0);
    match *shape {
        Shape::Box { size: [x, y, z] } => signs
            .iter()
            .flat_map(|a| signs.iter().flat_map(move |b| signs.map(|c| [*a, *b, c])))
            .map(|[a, b, c]| Point3::new(0.5 * a * x, 0.5 * b * y, 0.5 * c * z))
            .collect(),
        Shape::Cylinder { radius, length } => turns
            .flat_map(|turn| signs.map(|end| (turn, end)))
            .map(|(turn, end)| {
                Point3::new(radius * turn.cos(), radius * turn.sin(), 0.5 * end * length)
            })
            .collect(),
        Shape::Sphere { radius } => vec![Point3::new(0.0, radius, 0.0)],
        Shape::Capsule { radius, length } => vec![Point3::new(0.0, 0.0, 0.5 * length + radius)],
        Shape::Mesh { .. } => Vec::new(),
    }
}

#[test]
fn capsules_and_spheres_are_their_own() {
    let pose = Pose::from_isometry(Isometry3::new(
        Vector3::new(1.0, 2.0, 3.0),
        Vector3::new(0.0, FRAC_PI_2, 0.0),
    ));
    let found = fitted(&Shape::Capsule { radius: 0.1, length: 0.5 }, &pose);
    let [a, b] = found.ends();
    assert!((a - Point3::new(0.75, 2.0, 3.0)).norm() < 1e-15, "{a}");
    assert!((b - Point3::new(1.25, 2.0, 3.0)).norm() < 1e-15, "{b}");
    assert!((found.radius() - 0.1).abs() < f64::EPSILON);
    let found = fitted(&Shape::Sphere { radius: 0.3 }, &pose);
    assert!((found.volume() - 4.0 / 3.0 * PI * 0.3_f64.powi(3)).abs() < 1e-15);
}

/// The best possible for three boxes: of a long one the axis is the longest edge; the cube's is the
/// sphere of its diagonal or better.
#[test]
fn fitted_capsules_are_small() {
    let volume = |size| fitted(&Shape::Box { size }, &Pose::default()).volume();
    let capsule = |radius: f64, length: f64| PI * radius.powi(2) * (length + 4.0 / 3.0 * radius);
    let sphere_of_cube = 4.0 / 3.0 * PI * (0.75_f64).sqrt().powi(3);
    assert!(volume([1.0; 3]) <= sphere_of_cube * (1.0 + 1e-9));
    // Any capsule around a bar has at least the radius of the bar's end face and its length.
    let bar = 0.5 * 0.1_f64.hypot(0.1);
    assert!(volume([0.1, 1.0, 0.1]) <= capsule(bar, 1.0));
    let can = fitted(&Shape::Cylinder { radius: 0.05, length: 0.4 }, &Pose::default());
    assert!(can.volume() < capsule(0.05, 0.4) && can.radius() >= 0.05);
    assert!(can.volume() > PI * 0.05 * 0.05 * 0.4);
}

#[test]
fn the_axis_of_a_mesh_is_found() {
    // A tube across the coordinate axes, of 24 corners at each end.
    let X_LS = Isometry3::new(Vector3::new(0.1, -0.2, 0.3), Vector3::new(0.4, 0.5, -0.6));
    let tube = extreme_points(&Shape::Cylinder { radius: 0.05, length: 0.6 });
    let points: Vec<_> = tube.iter().map(|point| X_LS * point).collect();
    let exact = fitted(&Shape::Cylinder { radius: 0.05, length: 0.6 }, &Pose::default());
    let found = fitted_mesh(&points, [1.0; 3]);
    let ratio = found.volume() / exact.volume();
    assert!((0.95..1.02).contains(&ratio), "{ratio}");
}

#[test]
fn meshes_without_volume_have_capsules() {
    let flat: Vec<_> =
        (0..9).map(|n| Point3::new(f64::from(n % 3), f64::from(n / 3), 0.5)).collect();
    let line: Vec<_> = (0..5).map(|n| Point3::new(f64::from(n), 0.0, 0.0)).collect();
    for points in [flat, line, vec![Point3::new(1.0, 2.0, 3.0); 3], vec![Point3::origin()]] {
        let found = fitted_mesh(&points, [1.0; 3]);
        for point in &points {
            assert!(found.distance_to_point(point) <= 0.0, "{point} is outside {found:?}");
        }
    }
}

#[test]
fn a_mesh_is_scaled_and_mirrored() {
    let points = [[0.0, 0.0, 0.0], [1000.0, 0.0, 0.0], [0.0, 20.0, 0.0], [0.0, 0.0, 20.0]];
    let found = fitted_mesh(&points.map(Point3::from), [-0.001, 0.001, 0.001]);
    assert!(found.distance_to_point(&Point3::new(-1.0, 0.0, 0.0)) <= 0.0);
    assert!(found.distance_to_point(&Point3::new(0.0, 0.0, 0.02)) <= 0.0);
    assert!(found.radius() < 0.05, "{found:?}");
}

#[test]
fn each_collision_of_a_link_has_its_body() {
    let arm = include_str!("../../../config/robots/seven_axis_arm.urdf");
    let model = RobotModel::from_urdf(arm, "arm.urdf").expect("a robot");
    let count: usize = model.links().iter().map(|link: &Link| link.collisions.len()).sum();
    let mut builder = SceneBuilder::new();
    builder
        .add_robot("arm", &model, Mount::World(Pose::default()), &mut |_| None)
        .expect("a robot");
    let scene = builder.build();
    assert_eq!(scene.bodies().len(), count);
    let shapes = model.links().iter().flat_map(|link| &link.collisions);
    for (Collision { shape, origin }, body) in shapes.zip(scene.bodies()) {
        for point in extreme_points(shape) {
            let outside = body.capsule().distance_to_point(&(origin.isometry() * point));
            assert!(outside <= 0.0, "{}: {outside:e} outside", body.name());
        }
    }
}

fn config(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(20_261_122);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

fn any_shape() -> impl Strategy<Value = Shape> {
    let length = || prop_oneof![Just(0.0), 1e-4..2.0_f64];
    prop_oneof![
        [length(), length(), length()].prop_map(|size| Shape::Box { size }),
        (length(), length()).prop_map(|(radius, length)| Shape::Cylinder { radius, length }),
    ]
}

fn any_pose() -> impl Strategy<Value = Pose> {
    let number = || -3.0..3.0_f64;
    ([number(), number(), number()], [number(), number(), number()]).prop_map(|(shift, turn)| {
        Pose::from_isometry(Isometry3::new(Vector3::from(shift), Vector3::from(turn)))
    })
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn a_fitted_capsule_contains_the_shape(shape in any_shape(), pose in any_pose()) {
        let capsule = fitted(&shape, &pose);
        for point in extreme_points(&shape) {
            let outside = capsule.distance_to_point(&(pose.isometry() * point));
            prop_assert!(outside <= 0.0, "{outside:e} outside of {capsule:?}");
        }
    }
}

/// Coordinates on a coarse grid, beside it by rounding, and free: flat and repeated vertices.
fn awkward() -> impl Strategy<Value = f64> {
    let grid = || (-2..=2_i32).prop_map(|n| 0.1 * f64::from(n));
    prop_oneof![4 => grid(), 1 => grid().prop_map(|x| x + 1e-15), 1 => -0.2..0.2_f64]
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn an_awkward_mesh_has_a_capsule_around_it(
        points in prop::collection::vec([awkward(), awkward(), awkward()], 1..40)
    ) {
        let points: Vec<_> = points.into_iter().map(Point3::from).collect();
        let capsule = fitted_mesh(&points, [1.0; 3]);
        for point in &points {
            prop_assert!(capsule.distance_to_point(point) <= 0.0, "{point} of {points:?}");
        }
    }
}

proptest! {
    #![proptest_config(config(40))]

    #[test]
    fn a_capsule_around_a_mesh_contains_every_vertex(
        points in prop::collection::vec([-1.0..1.0, -0.5..0.5, -0.1..0.1_f64], 1..60)
    ) {
        let points: Vec<_> = points.into_iter().map(Point3::from).collect();
        let capsule = fitted_mesh(&points, [1.0; 3]);
        for point in &points {
            let outside = capsule.distance_to_point(point);
            prop_assert!(outside <= 0.0, "{outside:e} outside of {capsule:?}");
        }
    }
}
