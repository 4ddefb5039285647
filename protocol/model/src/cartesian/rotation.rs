//! Rotation vectors and how they turn.

use nalgebra::{UnitQuaternion, Vector3};

use super::path::MIN_TURN_MARGIN;

/// Below this angle \[rad\] the series are used; their next terms are below rounding.
const SMALL_ANGLE: f64 = 1e-4;

/// The rotation vector \[rad\] of the shortest way from `from` to `to`, in the frame of `from`, so
/// `to = from * exp(vector)`. The signs of the quaternions do not matter.
///
/// # Errors
/// The angle, if it is half a turn within [`MIN_TURN_MARGIN`]: there the axis hangs on rounding.
pub(super) fn shortest(
    from: &UnitQuaternion<f64>,
    to: &UnitQuaternion<f64>,
) -> Result<Vector3<f64>, f64> {
    let vector = (from.inverse() * to).scaled_axis();
    let angle = vector.norm();
    if std::f64::consts::PI - angle < MIN_TURN_MARGIN { Err(angle) } else { Ok(vector) }
}

/// Angular velocity, in the frame that `exp(vector)` turns in, of `exp(vector)` while `vector`
/// changes at `rate`: the left Jacobian of the rotation group times `rate`.
///
/// Source: Chirikjian, Stochastic Models, Information Theory, and Lie Groups, vol. 2, eq. 10.86.
pub(super) fn angular_velocity(vector: &Vector3<f64>, rate: &Vector3<f64>) -> Vector3<f64> {
    let angle = vector.norm();
    let (first, second) = if angle < SMALL_ANGLE {
        let square = angle * angle;
        (0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0)
    } else {
        // 1 - cos(x) = 2 sin²(x/2), without its cancellation.
        let half_sine = (0.5 * angle).sin();
        let square = angle * angle;
        (2.0 * half_sine * half_sine / square, (angle - angle.sin()) / (square * angle))
    };
    let across = vector.cross(rate);
    rate + across * first + vector.cross(&across) * second
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_way_does_not_depend_on_the_signs_of_quaternions() {
        let from = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.0);
        let to = UnitQuaternion::from_euler_angles(-0.5, 0.4, 2.0);
        let way = shortest(&from, &to).expect("less than half a turn");
        let other = UnitQuaternion::new_unchecked(-to.into_inner());
        assert!((way - shortest(&from, &other).expect("same rotation")).norm() < 1e-15);
        assert!((from * UnitQuaternion::from_scaled_axis(way)).angle_to(&to) < 1e-15);
        assert!(way.norm() < std::f64::consts::PI);
    }

    #[test]
    fn half_a_turn_is_ambiguous_and_a_little_less_is_not() {
        let turn = |angle: f64| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), angle);
        let pi = std::f64::consts::PI;
        assert!(shortest(&turn(0.0), &turn(pi)).is_err());
        assert!(shortest(&turn(0.0), &turn(pi - 0.5 * MIN_TURN_MARGIN)).is_err());
        let way = shortest(&turn(0.0), &turn(pi - 1e-3)).expect("less than half a turn");
        assert!((way - Vector3::x() * (pi - 1e-3)).norm() < 1e-12);
        let back = shortest(&turn(0.0), &turn(pi + 1e-3)).expect("the other way round");
        assert!((back + Vector3::x() * (pi - 1e-3)).norm() < 1e-12);
    }

    #[test]
    fn angular_velocity_equals_the_finite_difference_at_all_angles() {
        let rate = Vector3::new(0.3, -0.7, 0.2);
        for length in [0.0, 1e-9, 0.9e-4, 1.1e-4, 0.1, 1.0, 3.0] {
            let vector = Vector3::new(0.6, 0.0, -0.8) * length;
            let at = |t: f64| UnitQuaternion::from_scaled_axis(vector + rate * t);
            let step = 1e-6;
            let difference = (at(step) * at(-step).inverse()).scaled_axis() / (2.0 * step);
            let exact = angular_velocity(&vector, &rate);
            assert!((difference - exact).norm() < 1e-9, "{length}: {difference} {exact}");
        }
    }
}
