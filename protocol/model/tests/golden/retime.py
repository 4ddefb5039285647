"""Makes retime.json: durations of time-optimal motions along 200 splines of 7 joints.

Peer: toppra 0.6.10 (PyPI), TOPP-RA with the solver `seidel` on 201 grid points, for both of its
discretisation schemes. Run with numpy 2.4, scipy 1.17:  python retime.py > retime.json
"""

import json
import logging
from importlib.metadata import version

import numpy as np
import toppra
import toppra.algorithm
import toppra.constraint as constraint

JOINTS, POINTS, PATHS, SEED = 7, 201, 200, 20180613
ENDS = {"not_a_knot": "not-a-knot", "natural": "natural", "clamped": "clamped"}
logging.getLogger("toppra").setLevel(logging.ERROR)


def parameters(kind, rows):
    """Path parameter at each waypoint: length of the chords, or equal steps from 0 to 1."""
    if kind == "uniform":
        return np.linspace(0.0, 1.0, len(rows))
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rows, axis=0), axis=1))])


def duration(case, scheme):
    """Sum of the times between grid points, acceleration along the path being constant there."""
    rows = np.array(case["waypoints"])
    s = parameters(case["parameter"], rows)
    path = toppra.SplineInterpolator(s, rows, bc_type=ENDS[case["ends"]])
    limits = [
        constraint.JointVelocityConstraint(np.array(case["velocity"])),
        constraint.JointAccelerationConstraint(np.array(case["acceleration"]), scheme),
    ]
    grid = np.linspace(s[0], s[-1], POINTS)
    solver = toppra.algorithm.TOPPRA(limits, path, gridpoints=grid, solver_wrapper="seidel")
    _, speeds, _ = solver.compute_parameterization(case["start"], case["end"])
    assert speeds is not None and not np.isnan(speeds).any(), case
    return float(np.sum(2.0 * np.diff(grid) / (speeds[1:] + speeds[:-1])))


def case(random, index):
    """One path: 2 to 9 waypoints within a quarter of a turn to either side of rest."""
    count = 2 + index % 8
    velocity = random.uniform(0.8, 3.0, JOINTS)
    acceleration = random.uniform(2.0, 15.0, JOINTS)
    rows = random.uniform(-1.6, 1.6, (count, JOINTS))
    found = {
        "ends": "natural" if index % 5 == 3 else "clamped" if index % 20 == 4 else "not_a_knot",
        "parameter": "uniform" if index % 4 == 2 else "chord",
        "velocity": [round(v, 3) for v in velocity],
        "acceleration": [round(a, 3) for a in acceleration],
        "waypoints": [[round(q, 4) for q in row] for row in rows],
        "start": 0.0,
        "end": 0.0,
    }
    if index % 10 == 1:
        found["start"], found["end"] = 0.05, 0.1
    found["collocation_s"] = duration(found, constraint.DiscretizationType.Collocation)
    found["interpolation_s"] = duration(found, constraint.DiscretizationType.Interpolation)
    return found


def main():
    random = np.random.default_rng(SEED)
    cases = [case(random, index) for index in range(PATHS)]
    print('{"toppra": "%s", "grid_points": %d, "cases": [' % (version("toppra"), POINTS))
    print(",\n".join(json.dumps(one) for one in cases))
    print("]}")


if __name__ == "__main__":
    main()
