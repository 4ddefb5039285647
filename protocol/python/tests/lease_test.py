"""The lease: acquired, renewed, lost, given back."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest

import armada
from armada import DenialCode, DeniedError, LeaseLost, aio

from .fleet import DEADLINE_S, LEASE, Agent, Json, Refused, golden


def refuse(code: str, message: str, **details: object) -> Callable[[Json], Json]:
    def handler(_: Json) -> Json:
        raise Refused(code, message, **details)

    return handler


def renewed(agent: Agent, times: int) -> bool:
    """Waits until the lease was renewed so often."""
    return agent.wait_for("renew_lease", times)


def test_requests_inside_are_asked_under_it_and_those_after_it_are_not(
    cell: armada.Cell, left: Agent
) -> None:
    robot = cell.robot("left_arm")
    with robot.lease(ttl_s=5.0) as lease:
        assert (str(lease.id), lease.epoch, lease.ttl_s) == (LEASE, 5, 5.0)
        robot.set_mode(armada.CommandMode.JOG)
    assert not lease.is_held
    robot.halt()
    [inside] = left.of_method("set_mode")
    [after] = left.of_method("halt")
    assert inside["lease"] == LEASE
    assert "lease" not in after
    assert left.of_method("acquire_lease")[0]["params"] == {"ttl_ms": 5000}
    assert left.of_method("release_lease")[0]["params"] == {"lease": LEASE}


def test_it_is_renewed_beside_the_program(cell: armada.Cell, left: Agent) -> None:
    with cell.robot("left_arm").lease(ttl_s=1.5):
        assert renewed(left, 3)
    assert {row["params"]["lease"] for row in left.of_method("renew_lease")} == {LEASE}


def test_that_somebody_took_it_is_known_long_before_the_next_renewal(
    cell: armada.Cell, left: Agent
) -> None:
    told = threading.Event()
    lease = cell.robot("left_arm").lease(ttl_s=60.0, on_lost=lambda _: told.set())
    news = {**golden("event"), "kind": "lease", "message": "hmi (operator) took it"}
    deadline = time.monotonic() + DEADLINE_S
    while not left.of_method("renew_lease") and time.monotonic() < deadline:
        # Until the subscription has come through.
        left.publish("robots/left_arm/events", news)
        time.sleep(0.02)
    assert lease.is_held, "another lease's news"
    left.handlers["renew_lease"] = refuse("lease_stale", "hmi (operator) has it")
    left.publish("robots/left_arm/events", news)
    assert told.wait(DEADLINE_S)
    with pytest.raises(LeaseLost, match="hmi"):
        lease.check()
    lease.release()


def test_one_that_was_taken_away_is_given_back_without_an_error(
    cell: armada.Cell, left: Agent
) -> None:
    left.handlers["release_lease"] = refuse("lease_stale", "not in force any more")
    lease = cell.robot("left_arm").lease(ttl_s=5.0)
    lease.release()
    assert not lease.is_held
    with pytest.raises(LeaseLost):
        lease.raise_if_lost()


def test_somebody_else_who_holds_it_is_named(cell: armada.Cell, left: Agent) -> None:
    left.handlers["acquire_lease"] = refuse("lease_required", "held by panel", holder="panel")
    with pytest.raises(DeniedError) as caught:
        cell.robot("left_arm").lease()
    assert caught.value.code is DenialCode.LEASE_REQUIRED
    assert caught.value.details["holder"] == "panel"


def test_one_that_is_lost_is_told_and_nothing_is_asked_any_more(
    cell: armada.Cell, left: Agent
) -> None:
    left.handlers["renew_lease"] = refuse("lease_stale", "panel holds it now")
    robot = cell.robot("left_arm")
    told = threading.Event()
    lease = robot.lease(ttl_s=0.2, on_lost=lambda _: told.set())
    assert told.wait(DEADLINE_S)
    assert not lease.is_held
    with pytest.raises(LeaseLost):
        robot.set_mode(armada.CommandMode.JOG)
    robot.halt()
    with pytest.raises(LeaseLost, match="panel holds it now") as at_the_end, lease:
        pass
    assert at_the_end.value.robot == "left_arm"
    assert left.of_method("set_mode") == []
    assert len(left.of_method("halt")) == 1
    assert left.of_method("release_lease") == []


def test_an_agent_that_is_silent_for_as_long_as_it_lasts_has_lost_it(
    cell: armada.Cell, left: Agent
) -> None:
    left.raw["renew_lease"] = left.hold
    told = threading.Event()
    lease = cell.robot("left_arm").lease(ttl_s=1.5, on_lost=lambda _: told.set())
    with pytest.raises(LeaseLost), lease:
        assert told.wait(DEADLINE_S)
    assert len(left.of_method("renew_lease")) > 1


def test_an_error_inside_is_not_hidden_by_the_loss(cell: armada.Cell, left: Agent) -> None:
    left.handlers["renew_lease"] = refuse("lease_stale", "gone")
    told = threading.Event()
    lease = cell.robot("left_arm").lease(ttl_s=0.2, on_lost=lambda _: told.set())
    assert told.wait(DEADLINE_S)
    with pytest.raises(ZeroDivisionError), lease:
        raise ZeroDivisionError


def test_it_is_not_acquired_twice(cell: armada.Cell) -> None:
    robot = cell.robot("left_arm")
    with robot.lease(), pytest.raises(ValueError, match="is held already"):
        robot.lease()


async def test_in_a_loop_it_is_renewed_by_a_task(acell: aio.Cell, left: Agent) -> None:
    async with acell.robot("left_arm").lease(ttl_s=1.5) as lease:
        while len(left.of_method("renew_lease")) < 2:
            await acell.robot("left_arm").status()
        assert lease.is_held
    assert len(left.of_method("release_lease")) == 1
