//! Straight lines with parabolic blends.

use proptest::prelude::*;

use super::*;

fn linear(times: &[f64], positions: &[&[f64]]) -> JointTrajectory {
    let interpolation = Interpolation::JointLinear;
    JointTrajectory { interpolation, ..trajectory(times, positions, &[]) }
}

fn limits(joints: usize, acceleration: f64) -> MotionLimits {
    MotionLimits::new(&vec![joint_limits(10.0, 10.0, acceleration); joints]).expect("complete")
}

#[test]
fn two_waypoints_give_a_trapezoid() {
    // a tb (T - tb) = 1 with a = 2, T = 2.
    let compiled =
        compile(&linear(&[0.0, 2.0], &[&[0.0], &[1.0]]), &limits(1, 2.0)).expect("legal");
    assert_smooth(&compiled);
    let blend = 1.0 - 0.5_f64.sqrt();
    let cruise = 1.0 / (2.0 - blend);
    let at = |t: f64| compiled.state_at(t, &mut 0);
    for t in [0.0, 0.1, 0.2] {
        assert!((at(t).position[0] - t * t).abs() < 1e-15);
        assert!((at(t).velocity[0] - 2.0 * t).abs() < 1e-14);
        assert!((at(2.0 - t).position[0] - (1.0 - t * t)).abs() < 1e-15);
    }
    for t in [0.3, 1.0, 1.7] {
        assert!((at(t).position[0] - 0.5 - cruise * (t - 1.0)).abs() < 1e-15);
        assert!((at(t).velocity[0] - cruise).abs() < 1e-15);
        assert_eq!(at(t).acceleration[0], 0.0);
    }
    assert_eq!((at(2.0).position, at(2.0).velocity), (vector(&[1.0]), vector(&[0.0])));
    assert_eq!(compiled.segment_count(), 3);
}

#[test]
fn an_inner_waypoint_is_blended_about_its_time() {
    // To 1 and back with a = 4, T = 2: t1 = 2 - √3.5, then velocity 4 t1 and a blend of 2 t1.
    let asked = linear(&[0.0, 2.0, 4.0], &[&[0.0], &[1.0], &[0.0]]);
    let compiled = compile(&asked, &limits(1, 4.0)).expect("legal");
    assert_smooth(&compiled);
    let t1 = 2.0 - 3.5_f64.sqrt();
    let cruise = 4.0 * t1;
    let at = |t: f64| compiled.state_at(t, &mut 0);
    assert!((at(1.0).position[0] - (1.0 - cruise)).abs() < 1e-14, "the line ends at 1");
    assert!((at(3.0).position[0] - (1.0 - cruise)).abs() < 1e-14);
    // Half of 2 cruise lost over 2 t1, so 2 cruise (2 t1) / 8 short of the waypoint.
    assert!((at(2.0).position[0] - (1.0 - 0.5 * cruise * t1)).abs() < 1e-14);
    assert!(at(2.0).velocity[0].abs() < 1e-14);
    assert!((at(2.0).acceleration[0] + 4.0).abs() < 1e-13);
    assert!((at(2.0 - t1 + 1e-9).acceleration[0] + 4.0).abs() < 1e-13);
    assert_eq!(at(2.0 - t1 - 1e-9).acceleration[0], 0.0);
    assert_eq!([1.9, 2.0, 2.1].map(|t| at(t).waypoint), [0, 1, 1]);
    assert_eq!(at(4.0).waypoint, 2);
}

#[test]
fn all_joints_blend_as_long_as_the_slowest_and_go_straight() {
    let rows: [&[f64]; 3] = [&[0.0, 0.0], &[1.0, 0.5], &[1.0, 2.0]];
    let limits =
        MotionLimits::new(&[joint_limits(10.0, 10.0, 2.0), joint_limits(10.0, 10.0, 50.0)])
            .expect("complete");
    let compiled = compile(&linear(&[0.0, 4.0, 8.0], &rows), &limits).expect("legal");
    assert_smooth(&compiled);
    for tick in 0..350 {
        let first = compiled.sample(f64::from(tick) * 0.01, &mut 0).position;
        assert!((first[0] - 2.0 * first[1]).abs() < 1e-14, "off the first line: {first:?}");
        let second = compiled.sample(8.0 - f64::from(tick) * 0.01, &mut 0).position;
        assert!((second[0] - 1.0).abs() < 1e-14, "off the second line: {second:?}");
    }
}

#[test]
fn standing_still_is_a_line_too() {
    let rows: [&[f64]; 4] = [&[0.3], &[0.3], &[0.8], &[0.8]];
    let compiled = compile(&linear(&[0.0, 1.0, 2.0, 3.0], &rows), &limits(1, 10.0)).expect("legal");
    assert_smooth(&compiled);
    assert_eq!(compiled.sample(0.5, &mut 0).position, vector(&[0.3]));
    assert!((compiled.sample(2.5, &mut 0).position[0] - 0.8).abs() < 1e-15);
}

#[test]
fn blends_may_touch() {
    // All acceleration, no cruise: a tb² = 1 with tb = T / 2.
    let asked = linear(&[0.0, 2.0], &[&[0.0], &[1.0]]);
    let compiled = compile(&asked, &limits(1, 1.0)).expect("just possible");
    assert_smooth(&compiled);
    assert!((compiled.sample(1.0, &mut 0).velocity[0] - 1.0).abs() < 1e-7);
    // From rest to 1/s to -1/s: blends of 1 / a and 2 / a, half of each in the second between.
    let rows: [&[f64]; 5] = [&[0.0], &[0.0], &[1.0], &[0.0], &[0.0]];
    let zigzag = linear(&[0.0, 10.0, 11.0, 12.0, 22.0], &rows);
    assert_smooth(&compile(&zigzag, &limits(1, 1.5)).expect("just possible"));
    assert_eq!(
        compile(&zigzag, &limits(1, 1.4)).expect_err("1.5 / 1.4 s").to_string(),
        "waypoint 1: from here to waypoint 2 the blends of a need 1.071428571 s within its \
         acceleration limit, but there are 1 s: give it more time"
    );
}

#[test]
fn an_end_without_time_to_speed_up_is_refused() {
    let refusal = |times: &[f64], rows: &[&[f64]]| {
        compile(&linear(times, rows), &limits(2, 2.0)).expect_err("too fast").to_string()
    };
    // At least √(4 / a) from rest to rest, √(2 / a) from rest to motion.
    assert_eq!(
        refusal(&[0.0, 1.0], &[&[0.0, 0.0], &[0.1, -1.0]]),
        "waypoint 0: from here to waypoint 1 the blends of b need 1.414213562 s within its \
         acceleration limit, but there are 1 s: give it more time"
    );
    assert_eq!(
        refusal(&[0.0, 0.5, 5.0], &[&[0.0, 0.0], &[1.0, 0.0], &[0.0; 2]]),
        "waypoint 0: from here to waypoint 1 the blends of a need 1 s within its acceleration \
         limit, but there are 0.5 s: give it more time"
    );
    assert_eq!(
        refusal(&[0.0, 5.0, 5.5], &[&[0.0, 0.0], &[1.0, 0.0], &[0.0; 2]]),
        "waypoint 1: from here to waypoint 2 the blends of a need 1 s within its acceleration \
         limit, but there are 0.5 s: give it more time"
    );
}

#[test]
fn a_blend_keeps_the_tolerance_of_its_waypoint() {
    // The deviation is cruise t1 / 2 with the numbers of the blend above.
    let t1 = 2.0 - 3.5_f64.sqrt();
    let deviation = 2.0 * t1 * t1;
    let ask = |tolerance: f64| {
        let mut asked = linear(&[0.0, 2.0, 4.0], &[&[0.0], &[1.0], &[0.0]]);
        asked.waypoints[1].position_tolerance = vec![tolerance];
        compile(&asked, &limits(1, 4.0))
    };
    ask(deviation * 1.001).expect("within the tolerance");
    let error = ask(0.03).expect_err("passes at more");
    let TrajectoryError::BlendTolerance { waypoint: 1, ref joint, needed, available } = error
    else {
        panic!("not a tolerance: {error}");
    };
    assert_eq!((joint.as_str(), available), ("a", 0.03));
    assert!((needed - deviation).abs() < 1e-14, "{needed}, exact {deviation}");
    assert_eq!(
        error.to_string(),
        "waypoint 1: the blend passes at 0.033370453 from the position of a, but \
         position_tolerance is 0.03: be slower there or widen it"
    );
}

#[test]
fn dense_samples_of_a_smooth_motion_can_be_followed() {
    // 0.1 ms apart; 5.77 is the highest acceleration of the smooth step of fifth degree.
    let times: Vec<f64> = (0..10_001).map(|index| f64::from(index) * 1e-4).collect();
    let exact = |t: f64| t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
    let rows: Vec<[f64; 1]> = times.iter().map(|&t| [exact(t)]).collect();
    let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
    let compiled = compile(&linear(&times, &rows), &limits(1, 7.0)).expect("legal");
    let mut hint = 0;
    for sample in 0..1000 {
        let t = f64::from(sample) * 1e-3 + 3e-5;
        assert!((compiled.sample(t, &mut hint).position[0] - exact(t)).abs() < 1e-7);
    }
    compile(&linear(&times, &rows), &limits(1, 5.0)).expect_err("faster than 5.77 allows");
}

proptest! {
    #![proptest_config(seeded(128))]

    #[test]
    fn what_is_taken_is_legal_and_keeps_tolerances(
        rows in prop::collection::vec((0.3..2.0_f64, prop::array::uniform2(-1.0..1.0_f64)), 2..8),
        acceleration in 5.0..60.0_f64,
        tolerance in 0.001..0.2_f64,
        period_s in 1e-3..0.02_f64,
    ) {
        let mut time_s = -rows[0].0;
        let times: Vec<f64> = rows.iter().map(|(s, _)| { time_s += s; time_s }).collect();
        let positions: Vec<&[f64]> = rows.iter().map(|(_, row)| &row[..]).collect();
        let mut asked = linear(&times, &positions);
        for waypoint in &mut asked.waypoints {
            waypoint.position_tolerance = vec![tolerance; 2];
        }
        let limits = limits(2, acceleration);
        match compile(&asked, &limits) {
            Ok(compiled) => {
                assert_smooth(&compiled);
                for waypoint in &asked.waypoints {
                    let at = compiled.sample(waypoint.time_from_start_s, &mut 0).position;
                    let off = at.max_abs_difference(&vector(&waypoint.joint_position));
                    prop_assert!(off <= tolerance + 1e-12);
                }
                let ticks = (compiled.duration_s() / period_s) as u32 + 4;
                let sent: Vec<JointVector> = (0..ticks)
                    .map(|tick| (f64::from(tick) - 1.5) * period_s)
                    .map(|t_s| compiled.sample(t_s, &mut 0).position)
                    .collect();
                assert_legal(&sent, period_s, &limits);
            }
            Err(TrajectoryError::BlendTolerance { waypoint, needed, available, .. }) => {
                prop_assert!(needed > available && available == tolerance);
                // The next best blend, of a higher limit, comes nearer.
                let nearer = compile(&asked, &limits_of(&limits_with(&limits, 1e6)));
                prop_assert!(nearer.is_ok(), "waypoint {waypoint}: {nearer:?}");
            }
            Err(TrajectoryError::BlendsOverlap { needed_s, available_s, .. }) => {
                prop_assert!(needed_s > available_s);
                let quicker = compile(&asked, &limits_of(&limits_with(&limits, 1e6)));
                prop_assert!(quicker.is_ok(), "{quicker:?}");
            }
            Err(other) => prop_assert!(false, "{other}"),
        }
    }
}

fn limits_with(limits: &[AxisLimits], acceleration: f64) -> Vec<AxisLimits> {
    limits.iter().map(|axis| AxisLimits { acceleration, ..*axis }).collect()
}
