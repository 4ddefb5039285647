"""Writes jacobian.json: geometric Jacobians by pinocchio of links of the shared robots.

Run in this folder with `pin` and `numpy` installed:

    python jacobian.py ../../../../../shared/robots > jacobian.json

Columns are in pinocchio's frame LOCAL_WORLD_ALIGNED: at the link's origin, in the root's axes,
linear rows first. The joints of a mimic are combined with the one they follow.
"""

import json
import pathlib
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin

CASES = {
    "pr2/pr2.urdf": ["r_gripper_tool_frame", "l_gripper_l_finger_tip_frame"],
    "vega/vega_1_gripper.urdf": ["L_ee", "R_gripper_l2", "head_l3"],
    "hsrb/hsrb4s.urdf": ["hand_l_finger_tip_frame", "head_tilt_link"],
    "stretch/stretch_se3_dw3_sg3.urdf": ["link_grasp_center"],
    "panda/panda.urdf": ["panda_hand", "panda_rightfinger"],
    "ur5e/ur5e.urdf": ["tool0"],
    "iiwa14/iiwa14.urdf": ["iiwa_link_ee"],
    "abb_yumi/yumi.urdf": ["yumi_link_7_r", "gripper_l_finger_l"],
}
POSTURES = 3


def followed(urdf):
    """Joint to (joint it follows in the end, multiplier, offset)."""
    direct = {}
    for joint in ET.parse(urdf).getroot().findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            factor = float(mimic.get("multiplier", 1))
            direct[joint.get("name")] = (mimic.get("joint"), factor, float(mimic.get("offset", 0)))
    ends = {}
    for name, (master, factor, offset) in direct.items():
        while master in direct:
            master, inner, shift = direct[master]
            factor, offset = factor * inner, factor * shift + offset
        ends[name] = (master, factor, offset)
    return ends


def case(robot, urdf, mimics, tip, random):
    data = robot.createData()
    names = [name for name in robot.names if name != "universe"]
    free = {n: float(random.uniform(-1.5, 1.5)) for n in names if n not in mimics}
    q = pin.neutral(robot)
    for name in names:
        master, factor, offset = mimics.get(name, (name, 1.0, 0.0))
        value = factor * free[master] + offset
        joint = robot.joints[robot.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = (
            [np.cos(value), np.sin(value)] if joint.nq == 2 else [value]
        )
    frame = robot.getFrameId(tip)
    J = pin.computeFrameJacobian(robot, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
    columns = {}
    for name in names:
        master, factor, _ = mimics.get(name, (name, 1.0, 0.0))
        column = factor * J[:, robot.joints[robot.getJointId(name)].idx_v]
        columns[master] = columns.get(master, np.zeros(6)) + column
    moving = {n: c.tolist() for n, c in columns.items() if np.abs(c).max() > 0}
    return {
        "urdf": urdf,
        "tip": tip,
        "joint_positions": {n: free[n] for n in moving},
        "columns": moving,
    }


def main():
    folder = pathlib.Path(sys.argv[1])
    random = np.random.default_rng(20261122)
    cases = []
    for urdf, tips in CASES.items():
        robot = pin.buildModelFromUrdf(str(folder / urdf))
        mimics = followed(folder / urdf)
        cases += [
            case(robot, urdf, mimics, tip, random) for tip in tips for _ in range(POSTURES)
        ]
    json.dump({"pinocchio": pin.__version__, "cases": cases}, sys.stdout, indent=1)


main()
