"""Stops: who is reached, and what is known of them."""

from __future__ import annotations

import time
from uuid import UUID

import pytest

import armada
from armada import StopLevel, StopStage, StopVerdict, codec
from armada._stop import Ladder
from armada.messages import StopAck

from .fleet import DEADLINE_S, Agent, Gateway, golden

STOP_ID = UUID(golden("stop_ack")["stop_id"])


def ack(robot: str, stage: StopStage, stop_id: UUID = STOP_ID) -> StopAck:
    sample = golden("stop_ack") | {"robot": robot, "stage": stage, "stop_id": str(stop_id)}
    return codec.decode(StopAck, codec.encode(sample))


def test_a_robot_that_never_answers_makes_the_verdict_incomplete_by_name() -> None:
    ladder = Ladder(STOP_ID, ["left_arm", "right_arm"])
    ladder.take(ack("left_arm", StopStage.STANDSTILL))
    report = ladder.report()
    assert report.verdict is StopVerdict.INCOMPLETE
    assert report.missing == ("right_arm",)


def test_a_late_lower_stage_takes_nothing_back() -> None:
    ladder = Ladder(STOP_ID, ["left_arm"])
    ladder.take(ack("left_arm", StopStage.STANDSTILL))
    ladder.take(ack("left_arm", StopStage.RECEIVED))
    assert ladder.report().verdict is StopVerdict.COMPLETE


def test_a_stop_that_nobody_was_asked_to_follow_is_not_complete() -> None:
    assert Ladder(STOP_ID, []).report().verdict is StopVerdict.INCOMPLETE


def test_an_answer_to_another_stop_proves_nothing() -> None:
    ladder = Ladder(STOP_ID, ["left_arm"])
    ladder.take(ack("left_arm", StopStage.STANDSTILL, UUID(int=1)))
    assert ladder.report().verdict is StopVerdict.INCOMPLETE


def test_a_stage_that_is_not_known_proves_nothing() -> None:
    ladder = Ladder(STOP_ID, ["left_arm"])
    ladder.take(ack("left_arm", StopStage("levitating")))
    assert ladder.report().verdict is StopVerdict.INCOMPLETE


def test_a_stop_reaches_every_robot_and_reports_standstill(
    cell: armada.Cell, left: Agent, right: Agent
) -> None:
    report = cell.stop("person in the cell", level=StopLevel.L1)
    assert report.verdict is StopVerdict.COMPLETE
    assert [(a.robot, a.stage) for a in report.acks] == [
        ("left_arm", StopStage.STANDSTILL),
        ("right_arm", StopStage.STANDSTILL),
    ]
    assert report.missing == ()
    for agent in (left, right):
        first = agent.stops[0]
        assert {stop["stop_id"] for stop in agent.stops} == {str(report.stop_id)}
        assert first["source"] == "test"
        assert first["level"] == "L1"
        assert first["scope"] == "cell"
        assert first["reason"] == "person in the cell"


def test_a_stop_is_repeated_until_every_robot_has_it(
    cell: armada.Cell, left: Agent, gateway: Gateway
) -> None:
    # Deaf to queries as well, so that only repetition can reach it.
    left.answers_stop_queries = False
    left.deaf_for = 8
    report = cell.stop()
    assert report.verdict is StopVerdict.COMPLETE
    assert left.stops[0]["seq"] >= 3
    assert gateway.agents[0] is left


def test_an_acknowledgement_that_was_lost_is_asked_for_again(
    cell: armada.Cell, left: Agent
) -> None:
    left.publishes_acks = False
    left.query_stages = ["received", "commanded", "standstill"]
    report = cell.stop()
    assert report.verdict is StopVerdict.COMPLETE


def test_a_robot_that_does_not_come_to_rest_is_missing_and_asked_to_stop_harder(
    cell: armada.Cell, left: Agent, right: Agent
) -> None:
    left.stages = ["received", "commanded"]
    report = cell.stop(timeout_s=1.5)
    deadline = time.monotonic() + DEADLINE_S
    while not any(stop["level"] == "L1" for stop in left.stops):
        assert time.monotonic() < deadline, left.stops
        time.sleep(0.01)
    harder = next(stop for stop in left.stops if stop["level"] == "L1")
    assert harder["scope"] == {"robots": ["left_arm"]}
    assert harder["stop_id"] == str(report.stop_id)
    assert all(stop["level"] == "L2" for stop in right.stops)
    assert report.verdict is StopVerdict.INCOMPLETE
    assert report.missing == ("left_arm",)
    assert next(a for a in report.acks if a.robot == "left_arm").stage is StopStage.COMMANDED


def test_a_robot_of_the_cell_that_is_not_there_is_missing(
    cell: armada.Cell, gateway: Gateway, right: Agent
) -> None:
    right.close()
    gateway.agents.remove(right)
    report = cell.stop(timeout_s=1.5)
    assert report.verdict is StopVerdict.INCOMPLETE
    assert report.missing == ("right_arm",)


def test_a_stop_needs_no_gateway(
    cell: armada.Cell, gateway: Gateway, left: Agent, right: Agent
) -> None:
    gateway.die()
    report = cell.stop()
    assert report.verdict is StopVerdict.COMPLETE
    assert left.stops
    assert right.stops


def test_a_stop_of_one_robot_leaves_the_others_alone(
    cell: armada.Cell, left: Agent, right: Agent
) -> None:
    report = cell.robot("left_arm").stop("too close")
    assert report.verdict is StopVerdict.COMPLETE
    assert [a.robot for a in report.acks] == ["left_arm"]
    assert left.stops[0]["scope"] == {"robots": ["left_arm"]}
    assert right.stops == []


def test_what_cannot_be_read_is_no_acknowledgement(cell: armada.Cell, left: Agent) -> None:
    left.stages = ["received", "commanded", "levitating"]
    left.session.put("robots/left_arm/stop/ack", b"not json")
    report = cell.stop(timeout_s=1.5)
    assert report.missing == ("left_arm",)


@pytest.mark.parametrize("name", ["left/arm", "*"])
def test_a_robot_with_a_wildcard_in_its_name_cannot_be_asked_for(
    cell: armada.Cell, name: str
) -> None:
    with pytest.raises(ValueError, match="is not a robot name"):
        cell.robot(name)
