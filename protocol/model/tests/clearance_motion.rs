//! Motions checked for their whole length.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::print_stdout, reason = "what a random test covered")]

mod common;

use std::f64::consts::{FRAC_PI_2, PI};

use armada_model::{
    Accuracy, ClearanceError, CollisionScene, MotionCheck, MotionVerdict, Mount, Pose, RobotModel,
    SceneBuilder, Shape,
};

/// A rod of 1 m along x that turns about z, 5 mm thick.
const ROD: &str = r#"<robot name="rod"><link name="base"/><link name="rod">
  <collision><origin xyz="0.5 0 0" rpy="0 1.5707963267948966 0"/>
  <geometry><capsule radius="0.005" length="1"/></geometry></collision></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/>
  </joint></robot>"#;

/// The rod and a post of 5 mm at 0.8 m, at a quarter turn.
fn rod_and_post() -> CollisionScene {
    let model = RobotModel::from_urdf(ROD, "rod.urdf").expect("a robot");
    let mut builder = SceneBuilder::new();
    builder
        .add_robot("rod", &model, Mount::World(Pose::default()), &mut |_| None)
        .expect("a robot");
    let post = Shape::Cylinder { radius: 0.005, length: 1.0 };
    builder.add_fixed("post", &post, &Pose::from_translation(0.0, 0.8, 0.0)).expect("a cylinder");
    builder.build()
}

fn check(duration_s: f64) -> MotionCheck<'static> {
    let (resolution_s, threshold_m) = (1e-3, 0.002);
    MotionCheck { duration_s, resolution_s, threshold_m, speeds: None, max_states: 100_000 }
}

#[test]
fn a_collision_between_two_samples_is_found() {
    let scene = rod_and_post();
    let mut workspace = scene.workspace();
    // Half a turn in a second past the post, with samples a quarter of a second off it.
    let swing = |time: f64, positions: &mut [f64]| positions[0] = PI * (time + 0.125) - 0.25 * PI;
    let coarse = MotionCheck { resolution_s: 0.25, ..check(1.0) };
    let report = scene.check_motion(&coarse, swing, &mut workspace).expect("checked");
    assert_eq!(report.verdict, MotionVerdict::ClearAtSamples, "{report:?}");
    assert_eq!((report.states, report.guaranteed_m), (5, None));

    let with_speeds = MotionCheck { speeds: Some(&[PI]), ..coarse };
    let report = scene.check_motion(&with_speeds, swing, &mut workspace).expect("checked");
    assert!(matches!(report.verdict, MotionVerdict::Undecided { .. }), "{report:?}");

    let fine = MotionCheck { resolution_s: 1e-4, ..with_speeds };
    let report = scene.check_motion(&fine, swing, &mut workspace).expect("checked");
    assert_eq!(report.verdict, MotionVerdict::Violation, "{report:?}");
    // The rod's surface is 2 mm from the post's 12 mm before the post's middle.
    let contact = (FRAC_PI_2 - (0.012_f64 / 0.8).asin() + 0.125 * PI) / PI;
    let first = report.first_violation.expect("a violation");
    assert!((first.time_s - contact).abs() <= 1.1e-4, "{} instead of {contact}", first.time_s);
    assert!(first.time_s >= contact && first.pair.distance_m < 0.002);
    let least = report.minimum.expect("a minimum");
    assert!(least.pair.distance_m <= -0.0049, "{least:?}");
    assert!(report.states < 1000, "{} states", report.states);
}

#[test]
fn a_clear_motion_keeps_what_is_guaranteed() {
    let scene = rod_and_post();
    let mut workspace = scene.workspace();
    // Stops short of the post.
    let swing = |time: f64, positions: &mut [f64]| positions[0] = 1.5 * (0.5 * PI * time).sin();
    let speeds = [1.5 * 0.5 * PI];
    let asked = MotionCheck { speeds: Some(&speeds), ..check(1.0) };
    let report = scene.check_motion(&asked, swing, &mut workspace).expect("checked");
    assert_eq!(report.verdict, MotionVerdict::Clear, "{report:?}");
    let guaranteed = report.guaranteed_m.expect("with speeds");
    let last = 0.8 * (FRAC_PI_2 - 1.5).sin() - 0.01;
    let least = report.minimum.expect("a minimum");
    assert!((least.pair.distance_m - last).abs() < 1e-6, "{} {last}", least.pair.distance_m);
    assert!((least.time_s - 1.0).abs() < 1e-12 && guaranteed >= 0.002 && guaranteed <= last);
    assert!(report.states < 60, "{} states", report.states);
}

#[test]
fn a_motion_that_grazes_the_threshold_is_undecided_or_decided_by_resolution() {
    let scene = rod_and_post();
    let mut workspace = scene.workspace();
    // Comes to rest 1 µm outside the threshold.
    let end = FRAC_PI_2 - (0.012_001_f64 / 0.8).asin();
    let swing = |time: f64, positions: &mut [f64]| positions[0] = end * (0.5 * PI * time).sin();
    let speeds = [end * 0.5 * PI];
    let asked = MotionCheck { speeds: Some(&speeds), ..check(1.0) };
    let report = scene.check_motion(&asked, swing, &mut workspace).expect("checked");
    let MotionVerdict::Undecided { from_s, to_s } = report.verdict else { panic!("{report:?}") };
    assert!(to_s - from_s <= 1.01e-3 && from_s > 0.9, "{from_s} {to_s}");
    assert_eq!(report.first_violation, None);
    assert!(report.states <= 2002, "{}", report.states);
}

#[test]
fn too_few_states_end_the_check() {
    let scene = rod_and_post();
    let mut workspace = scene.workspace();
    let still = |_: f64, positions: &mut [f64]| positions[0] = 0.0;
    let asked = MotionCheck { max_states: 10, ..check(1.0) };
    let report = scene.check_motion(&asked, still, &mut workspace).expect("checked");
    let MotionVerdict::OutOfStates { until_s } = report.verdict else { panic!("{report:?}") };
    assert!((until_s - 9e-3).abs() < 1e-12 && report.states == 10, "{report:?}");
    // At rest one step is enough, and a motion of no length is one state.
    let asked = MotionCheck { speeds: Some(&[0.0]), ..check(1.0) };
    let report = scene.check_motion(&asked, still, &mut workspace).expect("checked");
    assert_eq!((report.verdict, report.states), (MotionVerdict::Clear, 2));
    let asked = MotionCheck { speeds: Some(&[1.0]), ..check(0.0) };
    let report = scene.check_motion(&asked, still, &mut workspace).expect("checked");
    assert_eq!((report.verdict, report.states), (MotionVerdict::Clear, 1));
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let scene = rod_and_post();
    let mut workspace = scene.workspace();
    let mut ask = |asked: &MotionCheck<'_>| {
        scene.check_motion(asked, |_, positions| positions[0] = 0.0, &mut workspace)
    };
    let cases = [
        ("duration_s", MotionCheck { duration_s: -1.0, ..check(1.0) }),
        ("duration_s", MotionCheck { duration_s: f64::NAN, ..check(1.0) }),
        ("resolution_s", MotionCheck { resolution_s: 0.0, ..check(1.0) }),
        ("resolution_s", MotionCheck { resolution_s: 1e-10, ..check(1.0) }),
        ("threshold_m", MotionCheck { threshold_m: 0.0, ..check(1.0) }),
        ("threshold_m", MotionCheck { threshold_m: f64::INFINITY, ..check(1.0) }),
        ("max_states", MotionCheck { max_states: 0, ..check(1.0) }),
        ("speeds", MotionCheck { speeds: Some(&[-1.0]), ..check(1.0) }),
        ("speeds", MotionCheck { speeds: Some(&[f64::INFINITY]), ..check(1.0) }),
    ];
    for (expected, asked) in cases {
        match ask(&asked) {
            Err(ClearanceError::Option { field, .. }) => assert_eq!(field, expected),
            other => panic!("{asked:?}: {other:?}"),
        }
    }
    let count = ClearanceError::SpeedCount { expected: 1, given: 2 };
    let asked = MotionCheck { speeds: Some(&[1.0, 1.0]), ..check(1.0) };
    assert_eq!(ask(&asked), Err(count));
}

#[test]
fn a_motion_faster_than_its_speeds_is_refused() {
    let scene = rod_and_post();
    let mut workspace = scene.workspace();
    let swing = |time: f64, positions: &mut [f64]| positions[0] = time;
    let asked = MotionCheck { speeds: Some(&[0.9]), ..check(1.0) };
    let error = scene.check_motion(&asked, swing, &mut workspace).expect_err("too fast");
    assert!(matches!(error, ClearanceError::SpeedExceeded { variable: 0, .. }), "{error}");
}

#[test]
fn slides_need_limits_and_must_keep_them() {
    let slide = |limit: &str| {
        let urdf = format!(
            r#"<robot name="s" version="1.2"><link name="base"/><link name="arm"/><link name="tip">
            <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
            <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/></joint>
            <joint name="slide" type="prismatic"><parent link="arm"/><child link="tip"/>
            <axis xyz="0 1 0"/><limit {limit} velocity="1" effort="1"/></joint></robot>"#
        );
        let model = RobotModel::from_urdf(&urdf, "s.urdf").expect("a robot");
        let mut builder = SceneBuilder::new();
        let mount = Mount::World(Pose::default());
        builder.add_robot("s", &model, mount, &mut |_| None).expect("a robot");
        let ball = Shape::Sphere { radius: 0.1 };
        builder.add_fixed("ball", &ball, &Pose::from_translation(5.0, 0.0, 0.0)).expect("valid");
        builder.build()
    };
    let asked = MotionCheck { speeds: Some(&[1.0, 1.0]), ..check(1.0) };
    let (free, limited) = (slide(""), slide(r#"lower="-1" upper="1""#));
    let still = |_: f64, positions: &mut [f64]| positions.fill(0.0);
    let error = free.check_motion(&asked, still, &mut free.workspace()).expect_err("no bound");
    assert_eq!(error, ClearanceError::UnboundedReach { variable: 0 });
    let out = |time: f64, positions: &mut [f64]| positions.copy_from_slice(&[0.0, 0.5 + time]);
    let error = limited.check_motion(&asked, out, &mut limited.workspace()).expect_err("outside");
    assert!(matches!(error, ClearanceError::OutsideTravel { robot: 0, joint: 1, .. }), "{error}");
}

/// Two arms, each so far aside.
fn two_arms(aside: f64) -> CollisionScene {
    let arm = common::own_robot("seven_axis_arm.urdf");
    let mut builder = SceneBuilder::new();
    for (name, y) in [("left", aside), ("right", -aside)] {
        let mount = Mount::World(Pose::from_translation(0.0, y, 0.0));
        builder.add_robot(name, &arm, mount, &mut |_| None).expect("a robot");
    }
    builder.build()
}

/// Two arms that swing at random: what is called clear must be clear at every one of many samples.
#[test]
fn what_is_called_clear_is_clear_under_dense_sampling() {
    let scenes = [0.5, 0.2].map(two_arms);
    let mut counts = [0; 3];
    for seed in 1..=24_u32 {
        let scene = &scenes[usize::from(seed % 2 == 1)];
        let mut workspace = scene.workspace();
        let phase = |axis: usize| f64::from(seed * 7 + u32::try_from(axis).expect("small") * 13);
        let middle = |axis: usize| match axis % 7 {
            3 => -1.6,
            5 => 1.9,
            _ => 0.4 * phase(axis).sin(),
        };
        let reach = |axis: usize| if seed % 2 == 0 { 0.15 } else { 1.4 * phase(axis).cos() };
        let swing = |time: f64, positions: &mut [f64]| {
            for (axis, position) in positions.iter_mut().enumerate() {
                *position = middle(axis) + reach(axis) * (2.0 * time + phase(axis)).sin();
            }
        };
        let speeds: Vec<f64> = (0..14).map(|axis| 2.0 * reach(axis).abs()).collect();
        let asked = MotionCheck { threshold_m: 0.01, speeds: Some(&speeds), ..check(2.0) };
        let report = scene.check_motion(&asked, swing, &mut workspace).expect("checked");
        let mut least = f64::INFINITY;
        let mut positions = vec![0.0; 14];
        for step in 0..=400_u32 {
            swing(2.0 * f64::from(step) / 400.0, &mut positions);
            let mut placed = scene.place(&positions, &mut workspace).expect("positions fit");
            least = least.min(placed.minimum(Accuracy::Shapes).expect("pairs").distance_m);
        }
        let guaranteed = report.guaranteed_m.expect("with speeds");
        assert!(guaranteed <= least + 1e-7, "seed {seed}: {guaranteed} above {least}");
        match report.verdict {
            MotionVerdict::Clear => {
                counts[0] += 1;
                assert!(guaranteed >= 0.01 && least >= 0.01 - 1e-7, "seed {seed}: {least}");
            }
            MotionVerdict::Violation => counts[1] += 1,
            other => {
                counts[2] += 1;
                assert!(least < 0.03, "seed {seed}: {other:?} at {least}");
            }
        }
        let seen = report.minimum.expect("a minimum").pair.distance_m;
        assert!(report.verdict != MotionVerdict::Violation || seen <= least + 0.01, "seed {seed}");
    }
    println!("clear, violation, undecided: {counts:?}");
    assert!(counts[0] >= 3 && counts[1] >= 3, "{counts:?} say little");
}
