"""How long a move of several robots takes, and the trajectory it becomes.

This is the only robot arithmetic in this package; agents check every trajectory themselves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .messages import (
    JointLimits,
    JointTrajectory,
    JointUnit,
    JointVector,
    RobotInfo,
    RobotState,
    Waypoint,
    joint_vector,
)

SHORTEST_S = 0.1
"""Shortest move [s]; also how long a move takes that goes nowhere."""


@dataclass(frozen=True)
class Part:
    """What one robot does in a move."""

    info: RobotInfo
    """The robot."""
    start: JointVector
    """Where it begins [rad or m]."""
    goal: JointVector
    """Where it ends [rad or m]."""

    @classmethod
    def from_state(cls, info: RobotInfo, state: RobotState, goal: ArrayLike) -> Part:
        """A part that begins at the commanded position, or the measured one if there is none.

        Raises `ValueError` if `goal` is not one finite number per joint.
        """
        commanded = state.joint_position_command_rad
        start = commanded if len(commanded) else state.joint_position_rad
        row = joint_vector(goal, info.robot)
        for field, values in (("goal", row), ("state", start)):
            if len(values) != len(info.joints):
                raise ValueError(
                    f"{info.robot}: {field} has {len(values)} values, expected one for each of "
                    f"{len(info.joints)} joints"
                )
        return cls(info=info, start=start, goal=row)

    def duration(self, speed: float) -> tuple[float, str]:
        """The shortest time at this share of the limits [s], and the joint that needs it."""
        shortest, slowest = SHORTEST_S, ""
        for joint, start, goal in zip(self.info.joints, self.start, self.goal, strict=True):
            needed = joint_duration(abs(float(goal - start)), joint.limits, speed)
            if needed > shortest:
                shortest, slowest = needed, f"{self.info.robot}/{joint.name}"
        return shortest, slowest


def joint_duration(distance: float, limits: JointLimits, speed: float) -> float:
    """Time of a cubic from rest to rest [s], at a share `speed` of the limits.

    Over a distance d in a time T, velocity peaks at 1.5 d / T and acceleration at 6 d / T^2.
    """
    by_velocity = 1.5 * distance / (speed * limits.velocity) if distance > 0.0 else 0.0
    if limits.acceleration is None:
        return by_velocity
    return max(by_velocity, math.sqrt(6.0 * distance / (speed * limits.acceleration)))


def check_speed(speed: float) -> float:
    """The speed itself; raises `ValueError` if it is not above 0 and at most 1."""
    if not 0.0 < speed <= 1.0:
        raise ValueError(f"speed is {speed}, expected a share of the limits above 0 and up to 1")
    return speed


def cell_move(
    parts: Sequence[Part], speed: float, duration_s: float | None = None
) -> JointTrajectory:
    """A trajectory that takes all robots from their starts to their goals in the same time.

    The slowest joint decides how long, at a share `speed` of every joint's limits of velocity and
    acceleration; or `duration_s` does. Raises `ValueError` if that is too short at full speed.
    """
    if not parts:
        raise ValueError("a move needs at least one robot")
    if duration_s is None:
        check_speed(speed)
        duration = max(part.duration(speed)[0] for part in parts)
    else:
        duration = _check_duration(parts, duration_s)
    names = [f"{part.info.robot}/{name}" for part in parts for name in part.info.joint_names]
    rows = np.stack(
        [
            np.concatenate([part.start for part in parts]),
            np.concatenate([part.goal for part in parts]),
        ]
    )
    return JointTrajectory.from_arrays(names, (0.0, duration), rows, np.zeros_like(rows))


def _check_duration(parts: Sequence[Part], duration_s: float) -> float:
    shortest, slowest = max(part.duration(1.0) for part in parts)
    if not shortest <= duration_s < math.inf:
        needs = f" because of {slowest}" if slowest else ""
        raise ValueError(f"duration_s is {duration_s}, expected at least {shortest:.3f}{needs}")
    return duration_s


def for_cell(trajectories: Mapping[str, JointTrajectory]) -> JointTrajectory:
    """One trajectory of several robots from one per robot; joints become `robot/joint`.

    Raises `ValueError` if the waypoints are not at equal times, not all are interpolated alike, or
    at one waypoint some have velocities, accelerations or tolerances and some have not.
    """
    if not trajectories:
        raise ValueError("a trajectory needs at least one robot")
    robots = ", ".join(trajectories)
    parts = list(trajectories.values())
    times = [[point.time_from_start_s for point in part.waypoints] for part in parts]
    if any(row != times[0] for row in times):
        raise ValueError(f"{robots}: waypoints must be at equal times")
    if any(part.interpolation != parts[0].interpolation for part in parts):
        raise ValueError(f"{robots}: all must have the same interpolation")
    units: list[JointUnit] = []
    if any(part.joint_units for part in parts):
        for part in parts:
            units += part.joint_units or [JointUnit.IMPLICIT] * len(part.joint_names)
    rows = zip(*(part.waypoints for part in parts), strict=True)
    return JointTrajectory(
        joint_names=tuple(
            f"{robot}/{joint}" for robot, part in trajectories.items() for joint in part.joint_names
        ),
        joint_units=tuple(units),
        waypoints=tuple(_side_by_side(row, robots) for row in rows),
        interpolation=parts[0].interpolation,
    )


def _side_by_side(points: Sequence[Waypoint], robots: str) -> Waypoint:
    def joined(what: str, rows: Sequence[JointVector | None]) -> JointVector | None:
        given = [row for row in rows if row is not None]
        if given and len(given) < len(rows):
            raise ValueError(f"{robots}: all must have {what}, or none")
        return joint_vector(np.concatenate(given), what) if given else None

    return Waypoint(
        time_from_start_s=points[0].time_from_start_s,
        joint_position=joint_vector(np.concatenate([point.joint_position for point in points])),
        joint_velocity=joined("velocities", [point.joint_velocity for point in points]),
        joint_acceleration=joined("accelerations", [point.joint_acceleration for point in points]),
        position_tolerance=joined("position_tolerance", [p.position_tolerance for p in points]),
        velocity_tolerance=joined("velocity_tolerance", [p.velocity_tolerance for p in points]),
    )
