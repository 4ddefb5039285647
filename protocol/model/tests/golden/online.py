"""Durations of jerk-limited motions as PyPI ruckig finds them: writes online.json beside this file.

The inputs are not stored: they come from splitmix64 and the four basic operations, rounded alike in
every language, so tests/online_golden.rs makes the same ones. Run: python online.py
"""

import json
from math import sqrt
from pathlib import Path

import ruckig
from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization, Trajectory

MOVES = 20_000
STOPS = 2_000
MASK = (1 << 64) - 1


class Uniform:
    """splitmix64, as numbers from 0 to 1."""

    def __init__(self, seed: int) -> None:
        self.state = seed

    def next(self) -> float:
        self.state = (self.state + 0x9E3779B97F4A7C15) & MASK
        z = self.state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
        return float((z ^ (z >> 31)) >> 11) * 2.0**-53


def case(index: int) -> InputParameter:
    """Case `index`: 1 to 10 joints; every fourth kind starts or ends in another way."""
    random = Uniform(index * 1_000_003)
    joints = 1 + int(random.next() * 10.0)
    kind = int(random.next() * 4.0)
    is_free = random.next() < 0.25
    minimum = random.next() * 12.0 - 8.0
    rows: list[tuple[float, ...]] = []
    for _ in range(joints):
        velocity = 0.5 + 2.0 * random.next()
        acceleration = 2.0 + 8.0 * random.next()
        jerk = 10.0 + 190.0 * random.next()
        start = 6.0 * random.next() - 3.0
        end = 6.0 * random.next() - 3.0
        v0 = (2.0 * random.next() - 1.0) * velocity
        a0 = (2.0 * random.next() - 1.0) * acceleration
        vf = (2.0 * random.next() - 1.0) * velocity
        af = (2.0 * random.next() - 1.0) * min(
            acceleration, sqrt(2.0 * jerk * (velocity - abs(vf))) * 0.99
        )
        if kind == 0:
            v0, a0 = 0.0, 0.0
        if kind == 3:
            v0, a0 = v0 * 1.5, a0 * 1.5
        if kind != 2:
            vf, af = 0.0, 0.0
        rows.append((start, v0, a0, end, vf, af, velocity, acceleration, jerk))
    request = InputParameter(joints)
    columns = [list(column) for column in zip(*rows, strict=True)]
    request.current_position, request.current_velocity, request.current_acceleration = columns[:3]
    request.target_position, request.target_velocity, request.target_acceleration = columns[3:6]
    request.max_velocity, request.max_acceleration, request.max_jerk = columns[6:]
    if is_free:
        request.synchronization = Synchronization.No
    elif minimum > 0.0:
        request.minimum_duration = minimum
    return request


def duration(request: InputParameter) -> float:
    """Minus one where ruckig fails."""
    joints = request.degrees_of_freedom
    trajectory = Trajectory(joints)
    result = Ruckig(joints).calculate(request, trajectory)
    return trajectory.duration if result == Result.Working else -1.0


def stop(request: InputParameter) -> InputParameter:
    request.control_interface = ControlInterface.Velocity
    request.synchronization = Synchronization.No
    request.minimum_duration = None
    request.target_velocity = [0.0] * request.degrees_of_freedom
    request.target_acceleration = [0.0] * request.degrees_of_freedom
    return request


def rounded(values: list[float]) -> list[float]:
    return [float(f"{value:.11g}") for value in values]


moves = rounded([duration(case(index)) for index in range(MOVES)])
stops = rounded([duration(stop(case(index))) for index in range(STOPS)])
print(f"ruckig {ruckig.__version__}: {moves.count(-1.0)} moves and {stops.count(-1.0)} stops failed")
Path(__file__).with_name("online.json").write_text(
    json.dumps(
        {"ruckig": ruckig.__version__, "moves_s": moves, "stops_s": stops}, separators=(",", ":")
    )
    + "\n"
)
