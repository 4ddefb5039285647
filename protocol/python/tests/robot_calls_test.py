"""Calls of the whole contract: what they send, and what they return."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import armada
from armada import ActionStatus, DeniedError, JogFrame, MoveOptions, Pose, Queue
from armada.messages import HomeMethod, LeaseLossContinueS, PayloadInfo, ToolInfo, WhyCode

from .fleet import DEADLINE_S, Agent, Json, Refused
from .motions_test import modes, trajectory

POSE = Pose.from_arrays([0.5, -0.25, 1.0])
POSE_ON_THE_WIRE = {
    "position_m": {"x": 0.5, "y": -0.25, "z": 1.0},
    "orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
}


def params(agent: Agent, method: str) -> Json:
    """Parameters of the only request of a method, without the identity of the motion."""
    [request] = agent.of_method(method)
    return {name: value for name, value in request["params"].items() if name != "motion_id"}


def test_single_moves_enter_trajectory_and_wait_for_the_end(cell: armada.Cell, left: Agent) -> None:
    robot = cell.robot("left_arm")
    options = MoveOptions(speed=0.5, queue=Queue.APPEND)
    assert robot.move_joint(np.array([0.5, -1.0]), options=options).status().status == "complete"
    robot.move_pose(POSE)
    robot.move_linear(POSE, chain="arm")
    robot.move_home()
    assert modes(left) == ["trajectory"]
    plain = {"speed": 1.0, "blend_radius_m": 0.0, "connect": False, "executor": "auto"}
    assert params(left, "move_joint") == {
        "joint_position_rad": [0.5, -1.0],
        "options": plain | {"speed": 0.5, "queue": "append"},
    }
    assert params(left, "move_pose") == {"pose": POSE_ON_THE_WIRE, "options": plain}
    assert params(left, "move_linear")["chain"] == "arm"
    assert params(left, "move_home") == {"options": plain}


def test_homing_enters_its_mode_and_names_groups_of_joints(cell: armada.Cell, left: Agent) -> None:
    cell.robot("left_arm").home([["a"], ["b", "c"]], method=HomeMethod.MOVE_TO_HOME)
    assert modes(left) == ["homing"]
    assert params(left, "home") == {"order": [["a"], ["b", "c"]], "method": "move_to_home"}


def test_a_trajectory_says_what_to_do_with_others_and_without_the_lease(
    cell: armada.Cell, left: Agent
) -> None:
    cell.robot("left_arm").execute_trajectory(
        trajectory(),
        queue=Queue.APPEND_BLENDED,
        on_lease_loss=LeaseLossContinueS(continue_s=1.5),
    )
    sent = params(left, "execute_trajectory")
    assert (sent["queue"], sent["on_lease_loss"]) == ("append_blended", {"continue_s": 1.5})


def test_a_motion_is_paused_and_resumed(cell: armada.Cell, left: Agent) -> None:
    left.motions.ends_as = None
    motion = cell.robot("left_arm").execute_trajectory(trajectory())
    motion.pause()
    assert motion.status().status is ActionStatus.PAUSED
    motion.resume()
    assert motion.status().status is ActionStatus.RUNNING


def test_the_speed_ratio_is_the_one_in_force(cell: armada.Cell, left: Agent) -> None:
    assert cell.robot("left_arm").set_speed_ratio(0.25) == 0.25
    assert cell.robot("left_arm").execute_trajectory(trajectory()).set_speed(0.5) == 0.5
    sent = [row["params"] for row in left.of_method("set_speed_ratio")]
    assert sent == [{"ratio": 0.25}, {"ratio": 0.5}]


def test_a_robot_tells_why_it_does_not_move(cell: armada.Cell) -> None:
    [why] = cell.robot("left_arm").why()
    assert (why.code, why.who) == (WhyCode.STOPPED, "door_1")
    assert str(why) == "stop L1 by door_1: door opened"


def test_a_jog_moves_for_a_time(cell: armada.Cell, left: Agent) -> None:
    robot = cell.robot("left_arm")
    motion = robot.jog_joint([0.1, 0.0], 0.5, wait=True)
    assert motion.status().status is ActionStatus.COMPLETE
    robot.jog_cartesian("arm", [0.02, 0, 0, 0, 0, 0], frame=JogFrame.TOOL)
    assert modes(left) == ["jog"]
    assert params(left, "jog_joint") == {"joint_velocity_rad_s": [0.1, 0.0], "timeout_s": 0.5}
    [chain] = params(left, "jog_cartesian")["chains"]
    assert (chain["chain"], chain["frame"]) == ("arm", "tool")


def test_a_jog_that_is_kept_going_repeats_its_motion_and_ends_with_a_ramp(
    cell: armada.Cell, left: Agent
) -> None:
    left.motions.ends_as = None
    with cell.robot("left_arm").keep_jogging([0.1, 0.0]) as jog:
        assert left.wait_for("jog_joint", 2)
        jog.set([0.2, 0.0])
        already = len(left.of_method("jog_joint"))
        assert left.wait_for("jog_joint", already + 2)
    sent = [row["params"] for row in left.of_method("jog_joint")]
    assert {row["motion_id"] for row in sent} == {str(jog.motion.id)}
    assert {row["timeout_s"] for row in sent} == {0.2}
    assert sent[-1]["joint_velocity_rad_s"] == [0.2, 0.0]
    assert jog.motion.status().status is ActionStatus.CANCELLED


def test_what_ends_a_jog_is_raised_at_its_end(cell: armada.Cell, left: Agent) -> None:
    left.motions.ends_as = None
    refused = threading.Event()

    def once(request: Json) -> Json:
        if len(left.of_method("jog_cartesian")) > 1:
            refused.set()
            raise Refused("stopped", "a stop came")
        return left.motions.accept(request["motion_id"])

    left.handlers["jog_cartesian"] = once
    jog = cell.robot("left_arm").keep_jogging_tool("arm", [0.01, 0, 0, 0, 0, 0])
    with pytest.raises(DeniedError, match="a stop came"), jog:
        assert refused.wait(DEADLINE_S)


def test_tools_are_attached_by_name_or_as_they_are(cell: armada.Cell, left: Agent) -> None:
    robot = cell.robot("left_arm")
    answer = robot.attach_tool("gripper", chain="arm")
    assert answer.equipment.tool is not None
    assert answer.equipment.tool.name == "gripper"
    robot.attach_tool(ToolInfo(name="probe", tcp=POSE))
    robot.detach_tool()
    named, given = (row["params"] for row in left.of_method("attach_tool"))
    assert named == {"chain": "arm", "name": "gripper"}
    assert given["tool"]["tcp"] == POSE_ON_THE_WIRE
    assert params(left, "detach_tool") == {}


def test_payloads_are_attached_at_a_pose(cell: armada.Cell, left: Agent) -> None:
    robot = cell.robot("left_arm")
    robot.attach_payload(PayloadInfo(name="box"), POSE)
    robot.detach_payload("box")
    assert params(left, "attach_payload")["pose"] == POSE_ON_THE_WIRE
    assert params(left, "detach_payload") == {"name": "box"}


@pytest.mark.parametrize(
    ("value", "sent"),
    [
        (True, True),
        (3, 3.0),
        (0.5, 0.5),
        ("high", "high"),
        ([1.0, 2.0], [1.0, 2.0]),
        (np.array([0.5, 1.0]), [0.5, 1.0]),
        (np.array([True, False]), [True, False]),
        (np.float64(2.0), 2.0),
        (np.bool_(True), True),
    ],
)
def test_values_are_sent_as_what_they_are(
    cell: armada.Cell, left: Agent, value: armada.messages.SignalValue, sent: object
) -> None:
    cell.robot("left_arm").set_signal("out", value)
    [request] = left.of_method("set_signal")
    assert request["params"] == {"name": "out", "value": sent}
    assert type(request["params"]["value"]) is type(sent)


@pytest.mark.parametrize("value", [None, [[1.0]], float("nan"), ["a"]])
def test_what_is_no_value_is_refused_before_anything_is_asked(
    cell: armada.Cell, left: Agent, value: armada.messages.SignalValue
) -> None:
    with pytest.raises(ValueError, match=r"neither|not finite"):
        cell.robot("left_arm").set_param("filter_hz", value)
    assert left.requests == []


def test_values_of_a_controller_are_read(cell: armada.Cell) -> None:
    robot = cell.robot("left_arm")
    assert robot.get_signal("wrist_wrench") == (0.5, 0.0, -9.5, 0.0, 0.0, 0.125)
    assert robot.get_param("filter_hz") == 100.0
    info = robot.info()
    assert [signal.name for signal in info.signals][-1] == "wrist_wrench"
    assert info.parameters[-1].choices == ("low", "high")


def test_kinematics_are_asked_of_the_robot(cell: armada.Cell, left: Agent) -> None:
    robot = cell.robot("left_arm")
    assert robot.forward_kinematics().tcp.position_m.x == 0.5
    solution = robot.inverse_kinematics(POSE, np.zeros(2), chain="arm")
    assert solution.tolist() == [0.5, -1.25]
    assert params(left, "forward_kinematics") == {}
    assert params(left, "inverse_kinematics")["seed_rad"] == [0.0, 0.0]


def test_a_recording_is_named(cell: armada.Cell) -> None:
    recording = cell.robot("left_arm").save_recording()
    assert recording.ticks == 10000
    assert recording.file.endswith(".rec")


def test_poses_and_twists_come_from_rows_of_the_right_length() -> None:
    assert armada.Twist.of([1, 2, 3, 4, 5, 6]).to_array().tolist() == [1, 2, 3, 4, 5, 6]
    with pytest.raises(ValueError, match="twist has 5 numbers, expected 6"):
        armada.Twist.of([1, 2, 3, 4, 5])
    with pytest.raises(ValueError, match="orientation_wxyz has 3 numbers"):
        Pose.from_arrays([0, 0, 0], [1, 0, 0])
