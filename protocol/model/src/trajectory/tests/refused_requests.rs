//! What a request may not ask of an interpolation: rows, units, tolerances.

use super::*;
use crate::{JointType, JointUnit};

const REST: &[f64] = &[0.0, 0.0];

fn good(interpolation: Interpolation) -> JointTrajectory {
    let asked = trajectory(&[0.0, 1.0, 2.0], &[REST, &[0.5, 0.5], REST], &[]);
    JointTrajectory { interpolation, ..asked }
}

fn refusal(interpolation: Interpolation, change: impl FnOnce(&mut JointTrajectory)) -> String {
    let mut changed = good(interpolation);
    change(&mut changed);
    compile(&changed, &generous(2)).expect_err("the change is not allowed").to_string()
}

#[test]
fn rows_that_an_interpolation_does_not_take_are_refused_by_name() {
    type Row = fn(&mut Waypoint) -> &mut Vec<f64>;
    let velocity: Row = |waypoint| &mut waypoint.joint_velocity;
    let acceleration: Row = |waypoint| &mut waypoint.joint_acceleration;
    for (interpolation, field, row) in [
        (Interpolation::CubicSpline, "joint_acceleration", acceleration),
        (Interpolation::CubicSplineNatural, "joint_acceleration", acceleration),
        (Interpolation::CubicSplineNatural, "joint_velocity", velocity),
        (Interpolation::JointLinear, "joint_acceleration", acceleration),
        (Interpolation::JointLinear, "joint_velocity", velocity),
    ] {
        for waypoint in [0, 2] {
            assert_eq!(
                refusal(interpolation, |t| *row(&mut t.waypoints[waypoint]) = REST.to_vec()),
                format!("waypoint {waypoint}: {interpolation} takes no {field}, leave it out")
            );
        }
    }
}

#[test]
fn accelerations_come_with_every_waypoint_or_with_none() {
    assert_eq!(
        refusal(Interpolation::QuinticHermite, |t| {
            t.waypoints[2].joint_acceleration = REST.to_vec();
        }),
        "waypoint 2: joint_acceleration must be given at every waypoint or at none, waypoint 0 is \
         different"
    );
}

#[test]
fn every_row_has_one_finite_value_per_joint() {
    assert_eq!(
        refusal(Interpolation::QuinticHermite, |t| {
            t.waypoints[1].joint_acceleration = vec![0.0];
        }),
        "waypoint 1: joint_acceleration has 1 values, expected one for each of 2 joints"
    );
    assert_eq!(
        refusal(Interpolation::CubicSpline, |t| t.waypoints[1].position_tolerance = vec![0.1; 3]),
        "waypoint 1: position_tolerance has 3 values, expected one for each of 2 joints"
    );
    assert_eq!(
        refusal(Interpolation::QuinticHermite, |t| {
            t.waypoints.iter_mut().for_each(|w| w.joint_acceleration = REST.to_vec());
            t.waypoints[1].joint_acceleration[1] = f64::INFINITY;
        }),
        "waypoint 1: joint_acceleration of b is inf, which is not finite"
    );
}

#[test]
fn tolerances_are_finite_and_above_zero() {
    for (value, text) in [(0.0, "0"), (-1.0, "-1"), (f64::NAN, "NaN"), (f64::INFINITY, "inf")] {
        assert_eq!(
            refusal(Interpolation::CubicSpline, |t| {
                t.waypoints[2].position_tolerance = vec![0.1, value];
            }),
            format!(
                "waypoint 2: position_tolerance of b is {text}, expected a finite number above 0"
            )
        );
        assert_eq!(
            refusal(Interpolation::CubicSpline, |t| {
                t.waypoints[0].velocity_tolerance = vec![value, 0.1];
            }),
            format!(
                "waypoint 0: velocity_tolerance of a is {text}, expected a finite number above 0"
            )
        );
    }
}

#[test]
fn a_natural_spline_that_ends_in_motion_is_refused_with_what_to_do() {
    // Velocity 3/4 at both ends, as over the tip.
    assert_eq!(
        refusal(Interpolation::CubicSplineNatural, |t| t.waypoints[1].joint_position[0] = 0.0),
        "waypoint 0: cubic_spline_natural passes b at velocity 0.75, but a trajectory starts and \
         ends at rest: use cubic_spline or quintic_hermite"
    );
}

fn compile_types(
    asked: &JointTrajectory,
    joint_types: Option<&[JointType]>,
) -> Result<CompiledTrajectory, TrajectoryError> {
    let limits = &generous(2);
    let context = TrajectoryContext { joint_order: &["a", "b"], joint_types, limits };
    CompiledTrajectory::compile_for(asked, &context, &TrajectoryOptions::default())
}

#[test]
fn units_must_fit_the_joints() {
    let types = [JointType::Revolute, JointType::Prismatic];
    let refusal = |units: &[JointUnit], types: Option<&[JointType]>| {
        let joint_units = units.to_vec();
        let asked = JointTrajectory { joint_units, ..good(Interpolation::CubicSpline) };
        compile_types(&asked, types).expect_err("does not fit").to_string()
    };
    let implicit = JointUnit::Implicit;
    for unit in [JointUnit::Radian, JointUnit::Degree, JointUnit::TicksRot, JointUnit::NanoticksRot]
    {
        assert_eq!(
            refusal(&[implicit, unit], Some(&types)),
            format!("joint_units has {unit} for b, which slides")
        );
    }
    for unit in [JointUnit::Meter, JointUnit::TicksLin, JointUnit::NanoticksLin] {
        assert_eq!(
            refusal(&[unit, implicit], Some(&types)),
            format!("joint_units has {unit} for a, which turns")
        );
    }
    assert_eq!(
        refusal(&[implicit, JointUnit::Degree], None),
        "joint_units has degree for b, but whether that turns or slides is not known here: use \
         rad or m"
    );
    assert_eq!(
        refusal(&[implicit], None),
        "joint_units has 1 values, expected none or one for each of 2 joints"
    );
    let error =
        compile_types(&good(Interpolation::CubicSpline), Some(&types[..1])).expect_err("one type");
    assert_eq!(error.to_string(), "2 joints, but types of 1");
}

#[test]
fn units_that_need_no_conversion_need_no_joint_types() {
    let joint_units = vec![JointUnit::Radian, JointUnit::Meter];
    let asked = JointTrajectory { joint_units, ..good(Interpolation::CubicSpline) };
    assert_eq!(
        compile_types(&asked, None).expect("SI"),
        compile_types(&good(Interpolation::CubicSpline), None).expect("implicit")
    );
}
