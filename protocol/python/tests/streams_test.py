"""Streams of commands: numbered samples under a lease."""

from __future__ import annotations

import time

import numpy as np
import pytest

import armada
from armada import JogFrame, StreamEnded, aio
from armada.messages import CommandMode

from .fleet import DEADLINE_S, LEASE, Agent


def test_samples_are_numbered_and_name_lease_epoch_and_state(
    cell: armada.Cell, left: Agent
) -> None:
    left.publish_states()
    robot = cell.robot("left_arm")
    with robot.lease(), robot.stream_position() as stream:
        for step in range(3):
            stream.send(np.array([0.1 * step, 0.0]), velocity=[0.1, 0.0])
    samples = left.samples("stream/position", 3)
    assert [row["seq"] for row in samples] == [1, 2, 3]
    assert {row["lease"] for row in samples} == {LEASE}
    assert {row["epoch"] for row in samples} == {left.status["epoch"]}
    assert samples[0]["state_seqno"] > 5000
    assert (samples[0]["values"], samples[0]["velocity"]) == ([0.0, 0.0], [0.1, 0.0])
    assert left.status["command_mode"] == "position_command"


def test_numbers_go_on_from_one_stream_to_the_next_of_a_lease(
    cell: armada.Cell, left: Agent
) -> None:
    left.publish_states()
    robot = cell.robot("left_arm")
    with robot.lease():
        with robot.stream_velocity() as speeds:
            speeds.send([0.1, 0.2])
        with robot.stream_twist() as twists:
            twists.send("arm", [0.02, 0, 0, 0, 0, 0.1], JogFrame.TOOL)
    [speed] = left.samples("stream/velocity", 1)
    [twist] = left.samples("stream/twist", 1)
    assert (speed["seq"], twist["seq"]) == (1, 2)
    assert speed["values"] == [0.1, 0.2]
    assert twist["twist"] == {"linear_mps": [0.02, 0.0, 0.0], "angular_radps": [0.0, 0.0, 0.1]}
    assert twist["frame"] == "tool"
    assert left.status["command_mode"] == "velocity_command"


def test_a_command_names_some_joints(cell: armada.Cell, left: Agent) -> None:
    left.publish_states()
    robot = cell.robot("left_arm")
    with robot.lease():
        robot.command(["spin_joint"], position=[0.5])
        with pytest.raises(ValueError, match="position has 1 values, expected one for each of 2"):
            robot.command(["elbow_joint", "spin_joint"], position=[0.5])
        with pytest.raises(ValueError, match="needs positions or velocities"):
            robot.command(["spin_joint"])
    sample = left.samples("command", 1)[0]
    assert (sample["name"], sample["position"]) == (["spin_joint"], [0.5])
    assert "velocity" not in sample


def test_a_stream_ends_when_a_state_says_so(cell: armada.Cell, left: Agent) -> None:
    left.publish_states()
    robot = cell.robot("left_arm")
    deadline = time.monotonic() + DEADLINE_S
    with robot.lease(), robot.stream_position() as stream:
        stream.send([0.0, 0.0])
        left.state = left.state | {"epoch": stream.epoch + 1, "command_mode": "halt"}
        while robot.state().epoch == stream.epoch:
            assert time.monotonic() < deadline
        with pytest.raises(StreamEnded, match="mode halt, epoch"):
            stream.send([0.0, 0.0])


def test_a_stream_without_a_lease_is_refused_before_anything_is_asked(
    cell: armada.Cell, left: Agent
) -> None:
    with pytest.raises(ValueError, match="needs the lease of left_arm"):
        cell.robot("left_arm").stream_position()
    assert left.requests == []


def test_ticks_keep_their_rate_and_leave_out_what_was_missed(
    cell: armada.Cell, left: Agent
) -> None:
    left.publish_states()
    robot = cell.robot("left_arm")
    with robot.lease(), robot.stream_position() as stream:
        begin = time.monotonic()
        times = list(stream.ticks(100.0, duration_s=1.0))
        assert time.monotonic() - begin >= 1.0
        assert 2 <= len(times) <= 101
        assert times == sorted(times)
        with pytest.raises(ValueError, match="rate_hz is 0"):
            next(stream.ticks(0.0))


def test_states_come_at_a_lower_rate_too(cell: armada.Cell) -> None:
    with cell.robot("left_arm").states(rate_hz=10) as states:
        assert states.key == "robots/left_arm/state/10"


async def test_a_stream_in_a_loop(acell: aio.Cell, left: Agent) -> None:
    left.publish_states()
    robot = acell.robot("left_arm")
    async with robot.lease(), robot.stream_command(CommandMode.VELOCITY_COMMAND) as stream:
        async for _ in stream.ticks(200.0, duration_s=1.0):
            stream.send(["elbow_joint"], velocity=[0.1])
    samples = left.samples("command", 2)
    assert samples[0]["velocity"] == [0.1]
    assert left.status["command_mode"] == "velocity_command"
