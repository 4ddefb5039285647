"""States, events and other samples as they come."""

from __future__ import annotations

import json
import threading
import time

import pytest
from zenoh import ext

import armada
from armada import CodecError, NotConnected, RequestTimeout
from armada.messages import CommandMode

from .fleet import DEADLINE_S, Agent, Gateway, golden


def publish_until_seen(agent: Agent, key: str, message: object, seen: threading.Event) -> None:
    """Repeats a sample until it has arrived: a subscription takes a moment to get there."""
    deadline = time.monotonic() + DEADLINE_S
    while not seen.wait(0.005) and time.monotonic() < deadline:
        agent.session.put(key, json.dumps(message), encoding="application/json")


def test_the_state_is_the_newest_one(cell: armada.Cell, left: Agent) -> None:
    left.publish_states()
    robot = cell.robot("left_arm")
    first = robot.state()
    assert first.joint_position_rad.tolist() == [0.5, -1.25]
    deadline = time.monotonic() + DEADLINE_S
    while robot.state().seqno < first.seqno + 3:
        assert time.monotonic() < deadline


def test_no_state_is_a_timeout_and_never_an_old_one(cell: armada.Cell, left: Agent) -> None:
    left.publish_states()
    robot = cell.robot("left_arm")
    robot.state()
    left.stop_publishing()
    deadline = time.monotonic() + DEADLINE_S

    def read_until_silent() -> None:
        while time.monotonic() < deadline:
            robot.state(0.1)

    with pytest.raises(RequestTimeout, match="robots/left_arm/state"):
        read_until_silent()


def test_states_come_in_order_and_a_slow_reader_gets_the_newest(
    cell: armada.Cell, left: Agent
) -> None:
    left.publish_states(0.001)
    with cell.robot("left_arm").states(timeout_s=DEADLINE_S) as states:
        seen = [next(states).seqno for _ in range(20)]
        assert seen == sorted(set(seen))
        before = left.state["seqno"]
        deadline = time.monotonic() + DEADLINE_S
        while left.state["seqno"] < before + 50:
            assert time.monotonic() < deadline
            time.sleep(0.001)
        left.stop_publishing()
        newest = left.state["seqno"]
        # What came in while nobody read is the newest alone, and one may have been taken before.
        later = [next(states).seqno]
        while later[-1] < newest:
            later.append(next(states).seqno)
        assert len(later) < 45, later


def test_a_silence_is_a_timeout_after_which_reading_goes_on(cell: armada.Cell, left: Agent) -> None:
    states = cell.robot("left_arm").states(timeout_s=0.05)
    with pytest.raises(RequestTimeout):
        next(states)
    left.publish_states()
    assert states.next(DEADLINE_S).command_mode is CommandMode.TRAJECTORY


def test_a_sample_that_is_none_is_a_codec_error_after_which_reading_goes_on(
    cell: armada.Cell, left: Agent
) -> None:
    states = cell.robot("left_arm").states(timeout_s=DEADLINE_S)
    seen = threading.Event()
    sender = threading.Thread(
        target=publish_until_seen, args=(left, "robots/left_arm/state", [], seen)
    )
    sender.start()
    with pytest.raises(CodecError, match="RobotState"):
        next(states)
    seen.set()
    sender.join()
    left.publish_states()
    deadline = time.monotonic() + DEADLINE_S
    while time.monotonic() < deadline:
        try:
            assert next(states).command_mode is CommandMode.TRAJECTORY
        except CodecError:
            continue  # one of the bad ones was still on its way
        break


def test_reading_ends_when_the_connection_is_closed(gateway: Gateway) -> None:
    cell = armada.connect(gateway.endpoint)
    states = cell.robot("left_arm").states()
    cell.close()
    assert list(states) == []
    with pytest.raises(NotConnected):
        states.next(0.1)
    states.close()


def test_events_before_the_subscription_are_recovered_with_history(
    cell: armada.Cell, left: Agent
) -> None:
    publisher = ext.declare_advanced_publisher(
        left.session,
        "robots/left_arm/events",
        cache=ext.CacheConfig(256),
        publisher_detection=True,
        sample_miss_detection=ext.MissDetectionConfig(heartbeat=0.5, sporadic_heartbeat=None),
    )
    for seqno in range(3):
        publisher.put(json.dumps(golden("event") | {"seqno": seqno}), encoding="application/json")
    with cell.robot("left_arm").events(history=True, timeout_s=DEADLINE_S) as events:
        assert [next(events).seqno for _ in range(3)] == [0, 1, 2]
        publisher.put(json.dumps(golden("event") | {"seqno": 3}), encoding="application/json")
        assert next(events).seqno == 3
    with cell.robot("left_arm").events() as events:
        assert events.try_next() is None


def test_frames_and_statuses_of_the_cell_come_as_their_types(
    cell: armada.Cell, gateway: Gateway
) -> None:
    with (
        cell.frames(timeout_s=DEADLINE_S) as frames,
        cell.statuses(timeout_s=DEADLINE_S) as statuses,
    ):
        # A query behind the subscriptions on the same link: when it is answered, they are there.
        cell.info()
        gateway.publish("cell/frames", golden("cell_frames"))
        gateway.publish("cell/status", golden("cell_status"))
        assert next(frames).frames["left_arm/tool0"].position_m.to_array().tolist() == [
            0.5,
            -0.25,
            1.125,
        ]
        assert next(statuses).robots["right_arm"].command_mode is None
