"""Times other libraries for `armada bench motion`.

Says first what is installed, then answers one JSON question a line with one JSON object a line:
{"error": TEXT} where it cannot.
"""

import importlib.metadata
import json
import math
import sys
import time


def version(package):
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def timed(calls, inputs, call):
    """Nanoseconds a call, over `calls` calls that go through `inputs`."""
    rounds = max(1, calls // len(inputs))
    for given in inputs:
        call(given)
    begin = time.perf_counter_ns()
    for _ in range(rounds):
        for given in inputs:
            call(given)
    return (time.perf_counter_ns() - begin) / (rounds * len(inputs))


def configuration(pin, model, positions):
    """Configuration vector of named positions; joints without limits have sine and cosine."""
    q = pin.neutral(model)
    for name, position in positions.items():
        if not model.existJointName(name):
            raise ValueError(f"joint {name} is missing")
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 2:
            q[joint.idx_q : joint.idx_q + 2] = math.cos(position), math.sin(position)
        else:
            q[joint.idx_q] = position
    return q


def fk(ask):
    """Poses of all links, in one call a configuration."""
    import pinocchio as pin

    model = pin.buildModelFromXML(ask["urdf"])
    data = model.createData()
    inputs = [configuration(pin, model, positions) for positions in ask["configurations"]]
    ns = timed(ask["calls"], inputs, lambda q: pin.framesForwardKinematics(model, data, q))
    pin.framesForwardKinematics(model, data, inputs[0])
    links = {}
    for index, frame in enumerate(model.frames):
        if frame.type == pin.FrameType.BODY:
            links[frame.name] = data.oMf[index].homogeneous.flatten().tolist()
    return {"ns": ns, "links": links}


def jacobian(ask):
    """Jacobian of one link in another, with the pose of the link."""
    import pinocchio as pin

    model = pin.buildModelFromXML(ask["urdf"])
    data = model.createData()
    tip, base = model.getFrameId(ask["tip"]), model.getFrameId(ask["base"])
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def call(q):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacement(model, data, tip)
        return pin.getFrameJacobian(model, data, tip, axes)

    inputs = [configuration(pin, model, positions) for positions in ask["configurations"]]
    ns = timed(ask["calls"], inputs, call)
    rows = call(inputs[0])
    turn = pin.updateFramePlacement(model, data, base).rotation.T
    columns = {}
    for name in ask["configurations"][0]:
        column = rows[:, model.joints[model.getJointId(name)].idx_v]
        columns[name] = [*(turn @ column[:3]).tolist(), *(turn @ column[3:]).tolist()]
    return {"ns": ns, "columns": columns}


def clocked(call):
    """What `call` returns, and the microseconds it takes."""
    begin = time.perf_counter_ns()
    found = call()
    return found, (time.perf_counter_ns() - begin) / 1000.0


def quantiles(times):
    """Median and 99th percentile, by the nearest rank."""
    times = sorted(times)
    return [times[max(math.ceil(q * len(times)), 1) - 1] for q in (0.5, 0.99)]


def retime(ask):
    """Time-optimal motions along splines; splines and limits are made before."""
    import logging

    import numpy as np
    import toppra
    import toppra.algorithm
    import toppra.constraint as constraint

    logging.getLogger("toppra").setLevel(logging.ERROR)
    scheme = constraint.DiscretizationType.Interpolation
    cases = []
    for path in ask["paths"]:
        s = np.array(path["parameters"])
        spline = toppra.SplineInterpolator(s, np.array(path["waypoints"]), bc_type="not-a-knot")
        limits = [
            constraint.JointVelocityConstraint(np.array(path["velocity"])),
            constraint.JointAccelerationConstraint(np.array(path["acceleration"]), scheme),
        ]
        cases.append((spline, limits, np.linspace(s[0], s[-1], ask["points"])))

    def call(spline, limits, grid):
        solver = toppra.algorithm.TOPPRA(limits, spline, gridpoints=grid, solver_wrapper="seidel")
        _, speeds, _ = solver.compute_parameterization(0.0, 0.0)
        return float(np.sum(2.0 * np.diff(grid) / (speeds[1:] + speeds[:-1])))

    durations = [call(*case) for case in cases]
    times = [clocked(lambda: call(*case))[1] for _ in range(ask["rounds"]) for case in cases]
    return {"us": quantiles(times), "durations_s": durations}


def retarget(ask):
    """Jerk-limited motions from states in motion to rest."""
    import ruckig

    joints = len(ask["cases"][0]["target"])
    solver, trajectory = ruckig.Ruckig(joints), ruckig.Trajectory(joints)
    durations, times = [], []
    for case in ask["cases"]:
        request = ruckig.InputParameter(joints)
        request.current_position = case["position"]
        request.current_velocity = case["velocity"]
        request.current_acceleration = case["acceleration"]
        request.target_position = case["target"]
        request.max_velocity, request.max_acceleration, request.max_jerk = case["limits"]
        result, took = clocked(lambda: solver.calculate(request, trajectory))
        if result != ruckig.Result.Working:
            raise ValueError(f"ruckig answers {result}")
        durations.append(trajectory.duration)
        times.append(took)
    return {"us": quantiles(times), "durations_s": durations}


KINDS = {"fk": fk, "jacobian": jacobian, "retime": retime, "retarget": retarget}


def main():
    packages = {name: version(name) for name in ("pin", "toppra", "ruckig")}
    print(json.dumps({"python": sys.version.split()[0], "packages": packages}), flush=True)
    for line in sys.stdin:
        ask = json.loads(line)
        try:
            answer = KINDS[ask["kind"]](ask)
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), flush=True)


main()
