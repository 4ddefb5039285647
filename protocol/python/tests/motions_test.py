"""Motions: from the request to the terminal status."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import armada
from armada import (
    ActionStatus,
    CommandMode,
    DenialCode,
    DeniedError,
    JointTrajectory,
    MotionFailed,
    NoReply,
    RequestTimeout,
)

from .fleet import DEADLINE_S, Agent, Gateway, Json, Refused

JOINTS = ["elbow_joint", "spin_joint"]


def trajectory(names: list[str] = JOINTS) -> JointTrajectory:
    return JointTrajectory.from_arrays(names, [0.0, 1.0], np.zeros((2, len(names))))


def modes(agent: Agent) -> list[str]:
    """What was done to the mode, in order."""
    changes = [(name, row) for name, row in agent.requests if name in ("halt", "set_mode")]
    return [row["params"].get("mode", name) for name, row in changes]


def test_a_move_goes_from_halt_to_jog_and_waits_for_the_end(cell: armada.Cell, left: Agent) -> None:
    motion = cell.robot("left_arm").move_joints([0.5, -1.0], speed=0.5)
    assert motion.status().status is ActionStatus.COMPLETE
    assert modes(left) == ["jog"]
    [request] = left.of_method("jog_freespace")
    assert request["params"] == {
        "motion_id": str(motion.id),
        "joint_position_rad": [0.5, -1.0],
        "max_velocity_rad_s": [0.5 * 3.1416, 0.5 * 2.0],
    }


def test_a_move_in_jog_leaves_the_mode_alone(cell: armada.Cell, left: Agent) -> None:
    left.status["command_mode"] = "jog"
    cell.robot("left_arm").move_joints([0.0, 0.0])
    assert modes(left) == []


def test_a_move_from_another_mode_goes_through_halt(cell: armada.Cell, left: Agent) -> None:
    left.status["command_mode"] = "trajectory"
    cell.robot("left_arm").move_joints([0.0, 0.0])
    assert modes(left) == ["halt", "jog"]


def test_a_robot_that_still_decelerates_is_waited_for(cell: armada.Cell, left: Agent) -> None:
    enter = left.handlers["set_mode"]

    def still_moving(params: Json) -> Json:
        if len(left.of_method("set_mode")) < 3:
            raise Refused("busy", "still decelerating")
        return enter(params)

    left.handlers["set_mode"] = still_moving
    cell.robot("left_arm").move_joints([0.0, 0.0])
    ids = [row["request_id"] for row in left.of_method("set_mode")]
    assert len(ids) == len(set(ids)) == 3


def test_a_mode_that_is_refused_ends_the_move(cell: armada.Cell, left: Agent) -> None:
    def stopped(_: Json) -> Json:
        raise Refused("stopped", "a stop is latched")

    left.handlers["set_mode"] = stopped
    with pytest.raises(DeniedError) as caught:
        cell.robot("left_arm").move_joints([0.0, 0.0])
    assert caught.value.code is DenialCode.STOPPED
    assert left.of_method("jog_freespace") == []


def test_a_move_that_fails_is_raised_with_its_reason(cell: armada.Cell, left: Agent) -> None:
    left.motions.ends_as = None

    def fail() -> None:
        assert left.motions.accepted.wait(DEADLINE_S)
        left.motions.set("failed", reason={"code": "tolerance", "message": "left its path"})

    failing = threading.Thread(target=fail)
    failing.start()
    with pytest.raises(MotionFailed, match="failed: tolerance: left its path") as caught:
        cell.robot("left_arm").move_joints([0.0, 0.0])
    failing.join()
    assert caught.value.status.status is ActionStatus.FAILED


def test_wait_returns_a_bad_end_without_raising(cell: armada.Cell, left: Agent) -> None:
    left.motions.ends_as = "cancelled"
    motion = cell.robot("left_arm").execute_trajectory(trajectory())
    assert motion.wait(DEADLINE_S).status is ActionStatus.CANCELLED
    assert modes(left) == ["trajectory"]


def test_progress_yields_every_status_and_the_terminal_one_last(
    cell: armada.Cell, left: Agent
) -> None:
    left.motions.ends_as = None
    motion = cell.robot("left_arm").execute_trajectory(trajectory())
    seen = []
    for status in motion.progress(DEADLINE_S):
        seen.append((status.status.value, status.elapsed_s))
        if len(seen) == 1:
            left.motions.set("running", elapsed_s=1.0)
        elif len(seen) == 2:
            left.motions.set("complete", elapsed_s=2.0)
    assert seen == [("running", 0.456), ("running", 1.0), ("complete", 2.0)]


def test_an_end_whose_sample_was_lost_is_asked_for(cell: armada.Cell, left: Agent) -> None:
    left.motions.ends_as = None
    motion = cell.robot("left_arm").execute_trajectory(trajectory())
    statuses = motion.progress(DEADLINE_S)
    assert next(statuses).status is ActionStatus.RUNNING
    left.motions.lose("complete")
    assert next(statuses).status is ActionStatus.COMPLETE


def test_cancel_ends_a_motion(cell: armada.Cell, left: Agent) -> None:
    left.motions.ends_as = None
    motion = cell.robot("left_arm").execute_trajectory(trajectory())
    motion.cancel()
    assert motion.wait(DEADLINE_S).status is ActionStatus.CANCELLED


def test_an_interrupted_move_is_cancelled(
    cell: armada.Cell, left: Agent, monkeypatch: pytest.MonkeyPatch
) -> None:
    left.motions.ends_as = None
    robot = cell.robot("left_arm")
    motion = robot.move_joints([0.0, 0.0], wait=False)

    async def interrupted(_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(armada.aio.Motion, "wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        motion.arrive()
    assert motion.status().status is ActionStatus.CANCELLED


def test_a_motion_that_does_not_end_in_time_is_a_timeout(cell: armada.Cell, left: Agent) -> None:
    left.motions.ends_as = None
    motion = cell.robot("left_arm").execute_trajectory(trajectory())
    with pytest.raises(RequestTimeout):
        motion.wait(0.1)


def test_waiting_ends_when_the_agent_is_gone(
    cell: armada.Cell, gateway: Gateway, left: Agent
) -> None:
    left.motions.ends_as = None
    motion = cell.robot("left_arm").execute_trajectory(trajectory())
    left.close()
    gateway.agents.remove(left)
    with pytest.raises(NoReply):
        motion.wait(DEADLINE_S)


def test_prepare_and_commit_start_a_motion_at_an_instant(cell: armada.Cell, left: Agent) -> None:
    robot = cell.robot("left_arm")
    prepared = robot.prepare(trajectory())
    clock = robot.clock()
    motion = robot.commit(prepared.motion_id, clock.boot_id, clock.stamp_ns + 1)
    assert motion.wait(DEADLINE_S).status is ActionStatus.COMPLETE
    assert left.of_method("commit")[0]["params"]["start_ns"] == 123456789013
    robot.abort(prepared.motion_id)
    assert len(left.of_method("abort")) == 1


def test_both_arms_move_together_from_where_they_are_commanded(
    cell: armada.Cell, gateway: Gateway, left: Agent, right: Agent
) -> None:
    left.publish_states()
    right.publish_states()
    motion = cell.move({"left_arm": [1.0, 0.0], "right_arm": [0.501, -1.25]}, speed=0.5)
    assert motion.status().status is ActionStatus.COMPLETE
    assert (modes(left), modes(right)) == (["trajectory"], ["trajectory"])
    sent = gateway.of_method("execute_trajectory")[0]["params"]["trajectory"]
    assert sent["joint_names"] == [
        f"{robot}/{joint}" for robot in ("left_arm", "right_arm") for joint in JOINTS
    ]
    first, last = sent["waypoints"]
    assert first["joint_position"] == [0.501, -1.25, 0.501, -1.25]
    assert last["joint_position"] == [1.0, 0.0, 0.501, -1.25]
    assert first["joint_velocity"] == last["joint_velocity"] == [0.0] * 4
    # 1.25 rad of the spinning joint, at half of 2 rad/s and 5 rad/s^2.
    assert last["time_from_start_s"] == pytest.approx(1.875)


def test_a_goal_with_a_number_too_few_is_refused_before_anything_moves(
    cell: armada.Cell, gateway: Gateway, left: Agent
) -> None:
    left.publish_states()
    with pytest.raises(ValueError, match="left_arm: goal has 1 values, expected one for each of 2"):
        cell.move({"left_arm": [1.0]})
    assert gateway.requests == []


@pytest.mark.parametrize("speed", [0.0, 1.5])
def test_a_speed_that_is_no_share_is_refused_before_anything_is_asked(
    cell: armada.Cell, left: Agent, speed: float
) -> None:
    with pytest.raises(ValueError, match="share of the limits"):
        cell.robot("left_arm").move_joints([0.0, 0.0], speed=speed)
    assert left.requests == []


def test_a_cell_trajectory_puts_its_robots_into_the_mode(
    cell: armada.Cell, left: Agent, right: Agent
) -> None:
    names = [f"{robot}/{joint}" for robot in ("left_arm", "right_arm") for joint in JOINTS]
    motion = cell.execute_trajectory(trajectory(names))
    assert motion.wait(DEADLINE_S).status is ActionStatus.COMPLETE
    assert (modes(left), modes(right)) == (["trajectory"], ["trajectory"])


def test_a_cell_motion_is_cancelled_by_the_gateway(cell: armada.Cell, gateway: Gateway) -> None:
    gateway.motions.ends_as = None
    motion = cell.execute_trajectory(trajectory(["left_arm/elbow_joint"]), set_mode=False)
    motion.cancel()
    assert motion.wait(DEADLINE_S).status is ActionStatus.CANCELLED
    assert cell.motion(motion.id).status().status is ActionStatus.CANCELLED


def test_enable_disable_and_reset_errors_answer_with_the_mode(cell: armada.Cell) -> None:
    robot = cell.robot("left_arm")
    for answer in (robot.enable(), robot.disable(), robot.reset_errors()):
        assert answer.command_mode is CommandMode.HALT
