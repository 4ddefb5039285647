"""Numbers, poses and trajectories: what `armada-model` puts on the wire."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from ._base import JointVector, Message, OpenEnum, joint_vector


class JointType(OpenEnum):
    """How a joint moves."""

    REVOLUTE = "revolute"
    """Turns between limits [rad]."""
    CONTINUOUS = "continuous"
    """Turns without limits [rad]."""
    PRISMATIC = "prismatic"
    """Slides between limits [m]."""


class JointLimits(Message, frozen=True, kw_only=True, omit_defaults=True):
    """What a joint may do, in rad or, for joints that slide, in m."""

    lower: float | None = None
    """Lowest position; None if there is none."""
    upper: float | None = None
    """Highest position; None if there is none."""
    velocity: float
    """Highest speed [1/s]."""
    acceleration: float | None = None
    """Highest acceleration and deceleration [1/s^2]; None if there is none."""
    jerk: float | None = None
    """Highest jerk [1/s^3]; None if there is none."""
    effort: float | None = None
    """Highest torque [Nm] or force [N]; None if there is none."""


class Xyz(Message, frozen=True, kw_only=True):
    """A position [m]."""

    x: float
    y: float
    z: float

    def to_array(self) -> JointVector:
        """The three numbers as an array [x, y, z]."""
        return joint_vector((self.x, self.y, self.z))


class Wxyz(Message, frozen=True, kw_only=True):
    """An orientation: a unit quaternion w + xi + yj + zk."""

    w: float
    x: float
    y: float
    z: float

    def to_array(self) -> JointVector:
        """The four numbers as an array [w, x, y, z]."""
        return joint_vector((self.w, self.x, self.y, self.z))


class Pose(Message, frozen=True, kw_only=True):
    """A rigid transform: where a frame is in another one."""

    position_m: Xyz = Xyz(x=0.0, y=0.0, z=0.0)
    """Origin [m]."""
    orientation: Wxyz = Wxyz(w=1.0, x=0.0, y=0.0, z=0.0)
    """Rotation."""

    @classmethod
    def from_arrays(
        cls, position_m: ArrayLike, orientation_wxyz: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    ) -> Pose:
        """A pose from [x, y, z] and a unit quaternion [w, x, y, z].

        Raises `ValueError` if they are not three and four finite numbers.
        """
        x, y, z = _row_of(3, position_m, "position_m").tolist()
        qw, qx, qy, qz = _row_of(4, orientation_wxyz, "orientation_wxyz").tolist()
        return cls(position_m=Xyz(x=x, y=y, z=z), orientation=Wxyz(w=qw, x=qx, y=qy, z=qz))


class Twist(Message, frozen=True, kw_only=True):
    """Speed of a frame: of its origin, and of its turning."""

    linear_mps: JointVector = msgspec.field(default_factory=lambda: joint_vector((0.0, 0.0, 0.0)))
    """Velocity of the frame's origin, x y z [m/s]."""
    angular_radps: JointVector = msgspec.field(
        default_factory=lambda: joint_vector((0.0, 0.0, 0.0))
    )
    """Angular velocity, x y z [rad/s]."""

    @classmethod
    def from_arrays(
        cls, linear_mps: ArrayLike = (0.0, 0.0, 0.0), angular_radps: ArrayLike = (0.0, 0.0, 0.0)
    ) -> Twist:
        """A twist from two rows of three numbers; raises `ValueError` if they are none."""
        return cls(
            linear_mps=_row_of(3, linear_mps, "linear_mps"),
            angular_radps=_row_of(3, angular_radps, "angular_radps"),
        )

    @classmethod
    def of(cls, value: Twist | ArrayLike) -> Twist:
        """A twist as it is, or from six numbers: linear [m/s], then angular [rad/s]."""
        if isinstance(value, Twist):
            return value
        row = _row_of(6, value, "twist")
        return cls.from_arrays(row[:3], row[3:])

    def to_array(self) -> JointVector:
        """The six numbers as an array: linear [m/s], then angular [rad/s]."""
        return joint_vector(np.concatenate((self.linear_mps, self.angular_radps)), "twist")


class Interpolation(OpenEnum):
    """How to move between waypoints."""

    CUBIC_SPLINE = "cubic_spline"
    """One cubic polynomial per joint between two waypoints. With velocities given, the one that
    has them at both ends; without, the spline that starts and ends at rest."""
    CUBIC_SPLINE_NATURAL = "cubic_spline_natural"
    """The cubic spline without acceleration at both ends. It hardly ever rests there, so a robot
    refuses it as a motion of its own. Takes no velocities."""
    JOINT_LINEAR = "joint_linear"
    """Straight lines in joint space with parabolic blends, as short as the acceleration limits
    allow; inner waypoints are passed within their `position_tolerance`. Takes no velocities."""
    QUINTIC_HERMITE = "quintic_hermite"
    """One polynomial of fifth degree per joint between two waypoints, with continuous acceleration.
    Velocities and accelerations that are not given follow from the cubic spline."""


class JointUnit(OpenEnum):
    """Unit of one joint's positions; its velocities are per second, and so on."""

    IMPLICIT = "implicit"
    """The joint's own: rad if it turns, m if it slides."""
    RADIAN = "radian"
    """Radians, of a joint that turns."""
    DEGREE = "degree"
    """Degrees, of a joint that turns."""
    METER = "meter"
    """Metres, of a joint that slides."""
    TICKS_ROT = "ticks_rot"
    """Revolutions / 2^20, of a joint that turns."""
    NANOTICKS_ROT = "nanoticks_rot"
    """Revolutions / 2^20 / 10^9, of a joint that turns."""
    TICKS_LIN = "ticks_lin"
    """Metres / 2^20, of a joint that slides."""
    NANOTICKS_LIN = "nanoticks_lin"
    """Metres / 2^20 / 10^9, of a joint that slides."""


class Waypoint(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Where all joints are at one time."""

    time_from_start_s: float
    """Time since the start of the trajectory [s]; zero at the first waypoint."""
    joint_position: JointVector
    """Positions in the order of `joint_names` [rad or m, if `joint_units` has nothing else]."""
    joint_velocity: JointVector | None = None
    """Velocities in the order of `joint_names` [1/s]; every waypoint has them or none."""
    joint_acceleration: JointVector | None = None
    """Accelerations in the order of `joint_names` [1/s^2], only for `quintic_hermite`; every
    waypoint has them or none."""
    position_tolerance: JointVector | None = None
    """How far the robot may be from the set-point, above zero, from this waypoint's time until the
    next one's; None if the waypoint asks for nothing."""
    velocity_tolerance: JointVector | None = None
    """How far its velocity may be from the set-point's [1/s], as long."""


class JointTrajectory(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Positions to pass at given times; `joint_names` gives the order of every row."""

    joint_names: tuple[str, ...]
    """Names of the joints; for a cell each is `robot/joint`."""
    joint_units: tuple[JointUnit, ...] = ()
    """Unit of each joint, in the order of `joint_names`; empty if all are implicit."""
    waypoints: tuple[Waypoint, ...]
    """What to pass, in the order of time."""
    # Made by a function, so that it is written also where it is the default.
    interpolation: Interpolation = msgspec.field(default_factory=lambda: Interpolation.CUBIC_SPLINE)
    """How to move between the waypoints."""

    @classmethod
    def from_arrays(
        cls,
        joint_names: Sequence[str],
        time_from_start_s: ArrayLike,
        joint_position: ArrayLike,
        joint_velocity: ArrayLike | None = None,
    ) -> JointTrajectory:
        """A trajectory from arrays: one row per waypoint, one column per joint.

        Raises `ValueError` if the shapes do not fit together or a number is not finite.
        """
        times = joint_vector(time_from_start_s, "time_from_start_s")
        shape = (len(times), len(joint_names))
        positions = _rows(joint_position, shape, "joint_position")
        velocities: Sequence[JointVector | None] = [None] * len(times)
        if joint_velocity is not None:
            velocities = _rows(joint_velocity, shape, "joint_velocity")
        rows = zip(times.tolist(), positions, velocities, strict=True)
        return cls(
            joint_names=tuple(joint_names),
            waypoints=tuple(
                Waypoint(time_from_start_s=time, joint_position=position, joint_velocity=velocity)
                for time, position, velocity in rows
            ),
        )

    @property
    def duration_s(self) -> float:
        """Time of the last waypoint [s]; zero if there is none."""
        return self.waypoints[-1].time_from_start_s if self.waypoints else 0.0


def _row_of(length: int, values: ArrayLike, field: str) -> JointVector:
    row = joint_vector(values, field)
    if len(row) != length:
        raise ValueError(f"{field} has {len(row)} numbers, expected {length}")
    return row


def _rows(values: ArrayLike, shape: tuple[int, int], field: str) -> list[JointVector]:
    rows = np.array(values, dtype=np.float64)
    if rows.shape != shape:
        raise ValueError(
            f"{field} has shape {rows.shape}, expected {shape}: one row per waypoint, one column "
            "per joint"
        )
    if not np.isfinite(rows).all():
        waypoint, joint = np.argwhere(~np.isfinite(rows))[0]
        value = rows[waypoint, joint]
        raise ValueError(f"{field} of waypoint {waypoint}, joint {joint} is {value}")
    rows.setflags(write=False)
    return list(rows)
