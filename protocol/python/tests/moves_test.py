"""The duration rule of moves of several robots."""

from __future__ import annotations

import numpy as np
import pytest

from armada import for_cell
from armada.messages import (
    Interpolation,
    JointInfo,
    JointLimits,
    JointTrajectory,
    JointType,
    JointUnit,
    JointVector,
    ReducedLimits,
    RobotInfo,
    Waypoint,
)
from armada.moves import SHORTEST_S, Part, cell_move, joint_duration

from .fleet import robot_info


def limits(velocity: float, acceleration: float | None) -> JointLimits:
    return JointLimits(velocity=velocity, acceleration=acceleration)


def part(name: str, start: list[float], goal: list[float], limit: JointLimits) -> Part:
    info: RobotInfo = robot_info(name, [f"j{i}" for i in range(len(start))], limit)
    return Part(info=info, start=np.array(start), goal=np.array(goal))


def peaks(distance: float, duration: float) -> tuple[float, float]:
    """Peak velocity and acceleration of the cubic from rest to rest, by differences."""
    t = np.linspace(0.0, duration, 20_001)
    s = t / duration
    x: JointVector = distance * (3 * s**2 - 2 * s**3)
    v = np.gradient(x, t)
    return float(np.abs(v).max()), float(np.abs(np.gradient(v, t)).max())


@pytest.mark.parametrize(("distance", "speed"), [(2.0, 1.0), (0.01, 1.0), (1.3, 0.2), (3.0, 0.05)])
def test_a_cubic_of_that_duration_just_reaches_its_share_of_a_limit(
    distance: float, speed: float
) -> None:
    limit = limits(2.0, 5.0)
    velocity, acceleration = peaks(distance, joint_duration(distance, limit, speed))
    assert velocity <= speed * 2.0 * 1.001
    assert acceleration <= speed * 5.0 * 1.001
    used = max(velocity / (speed * 2.0), acceleration / (speed * 5.0))
    assert used == pytest.approx(1.0, rel=1e-3)


def test_without_an_acceleration_limit_velocity_alone_decides() -> None:
    assert joint_duration(2.0, limits(1.0, None), 0.5) == pytest.approx(6.0)


def test_the_slowest_robot_decides_how_long_all_take() -> None:
    fast = part("fast", [0.0], [1.0], limits(10.0, 100.0))
    slow = part("slow", [0.0, 0.5], [0.0, -0.5], limits(0.5, 100.0))
    trajectory = cell_move([fast, slow], 1.0)
    assert trajectory.duration_s == pytest.approx(1.5 * 1.0 / 0.5)
    assert trajectory.joint_names == ("fast/j0", "slow/j0", "slow/j1")
    first, last = trajectory.waypoints
    assert first.joint_position.tolist() == [0.0, 0.0, 0.5]
    assert last.joint_position.tolist() == [1.0, 0.0, -0.5]
    assert first.joint_velocity is not None
    assert first.joint_velocity.tolist() == [0.0, 0.0, 0.0]


def test_a_move_to_where_the_robot_stands_takes_a_moment() -> None:
    still = part("still", [0.3], [0.3], limits(1.0, 1.0))
    assert cell_move([still], 1.0).duration_s == SHORTEST_S


def test_a_duration_that_no_joint_can_keep_is_refused_by_joint() -> None:
    slow = part("slow", [0.0, 0.0], [0.0, 1.0], limits(0.5, 100.0))
    with pytest.raises(ValueError, match=r"expected at least 3\.000 because of slow/j1"):
        cell_move([slow], 0.3, duration_s=2.9)
    assert cell_move([slow], 0.3, duration_s=3.1).duration_s == 3.1


@pytest.mark.parametrize("speed", [0.0, -0.1, 1.01, float("nan")])
def test_a_speed_that_is_no_share_is_refused(speed: float) -> None:
    with pytest.raises(ValueError, match="share of the limits"):
        cell_move([part("a", [0.0], [1.0], limits(1.0, 1.0))], speed)


def test_trajectories_of_robots_become_one_of_the_cell() -> None:
    left = JointTrajectory.from_arrays(["a"], [0.0, 1.0], [[0.0], [1.0]], [[0.0], [0.0]])
    right = JointTrajectory.from_arrays(["a"], [0.0, 1.0], [[2.0], [3.0]], [[0.0], [0.0]])
    both = for_cell({"left": left, "right": right})
    assert both.joint_names == ("left/a", "right/a")
    assert both.waypoints[1].joint_position.tolist() == [1.0, 3.0]


def test_trajectories_at_different_times_are_not_put_together() -> None:
    left = JointTrajectory.from_arrays(["a"], [0.0, 1.0], [[0.0], [1.0]])
    right = JointTrajectory.from_arrays(["a"], [0.0, 1.5], [[0.0], [1.0]])
    with pytest.raises(ValueError, match="equal times"):
        for_cell({"left": left, "right": right})


def test_trajectories_of_which_one_has_velocities_are_not_put_together() -> None:
    left = JointTrajectory.from_arrays(["a"], [0.0], [[0.0]])
    right = JointTrajectory.from_arrays(["a"], [0.0], [[0.0]], [[0.0]])
    with pytest.raises(ValueError, match="velocities, or none"):
        for_cell({"left": left, "right": right})


def test_units_and_tolerances_and_the_interpolation_stay_what_they_are() -> None:
    def one(*units: JointUnit) -> JointTrajectory:
        waypoint = Waypoint(
            time_from_start_s=0.0,
            joint_position=np.array([1.0]),
            joint_acceleration=np.array([2.0]),
            position_tolerance=np.array([3.0]),
        )
        return JointTrajectory(
            joint_names=("a",),
            joint_units=units,
            waypoints=(waypoint,),
            interpolation=Interpolation.QUINTIC_HERMITE,
        )

    both = for_cell({"left": one(), "right": one(JointUnit.DEGREE)})
    assert both.joint_units == (JointUnit.IMPLICIT, JointUnit.DEGREE)
    assert both.interpolation == Interpolation.QUINTIC_HERMITE
    [waypoint] = both.waypoints
    assert waypoint.joint_acceleration is not None
    assert waypoint.joint_acceleration.tolist() == [2.0, 2.0]
    assert waypoint.position_tolerance is not None
    assert waypoint.position_tolerance.tolist() == [3.0, 3.0]
    assert waypoint.velocity_tolerance is None


def test_trajectories_of_unlike_interpolation_are_not_put_together() -> None:
    left = JointTrajectory.from_arrays(["a"], [0.0], [[0.0]])
    right = JointTrajectory(
        joint_names=("a",), waypoints=left.waypoints, interpolation=Interpolation.JOINT_LINEAR
    )
    with pytest.raises(ValueError, match="same interpolation"):
        for_cell({"left": left, "right": right})


def test_the_joint_type_does_not_change_the_rule() -> None:
    sliding = JointInfo(
        name="lift",
        joint_type=JointType.PRISMATIC,
        limits=limits(0.1, 1.0),
        reduced=ReducedLimits(velocity=0.1, acceleration=0.1),
    )
    assert joint_duration(0.2, sliding.limits, 1.0) == pytest.approx(3.0)
