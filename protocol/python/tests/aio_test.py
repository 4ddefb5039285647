"""The asyncio API does what the blocking one does."""

from __future__ import annotations

import asyncio
import inspect
import threading
from typing import Any
from uuid import UUID

import pytest

import armada
from armada import ActionStatus, DeniedError, NoReply, RequestTimeout, StopVerdict, aio
from armada.messages import Empty, HaltAnswer
from armada.methods import Method

from .fleet import DEADLINE_S, Agent, Gateway, Json, Refused


@pytest.mark.parametrize(
    "name",
    [
        "Cell",
        "Robot",
        "Motion",
        "Subscription",
        "HeldLease",
        "HeldLeases",
        "Jogging",
        "PositionStream",
        "VelocityStream",
        "TwistStream",
        "CommandStream",
    ],
)
def test_both_apis_have_the_same_names_arguments_and_docs(name: str) -> None:
    blocking, suspending = getattr(armada, name), getattr(aio, name)

    def public(api: Any) -> dict[str, tuple[list[str], str | None]]:
        return {
            method: (list(inspect.signature(value).parameters), value.__doc__)
            for method, value in inspect.getmembers(api, inspect.isfunction)
            if not method.startswith("_")
        }

    assert public(blocking) == public(suspending)


async def test_values_and_refusals(acell: aio.Cell, left: Agent) -> None:
    assert await acell.robots() == ["left_arm", "right_arm"]
    assert await acell.robots_alive() == ["left_arm", "right_arm"]

    def refuse(_: object) -> dict[str, object]:
        raise Refused("busy", "wait")

    left.handlers["halt"] = refuse
    with pytest.raises(DeniedError, match="busy: wait"):
        await acell.robot("left_arm").halt()


async def test_nobody_and_nothing(acell: aio.Cell, left: Agent) -> None:
    with pytest.raises(NoReply):
        await acell.robot("torso").halt()
    left.raw["halt"] = left.hold
    with pytest.raises(RequestTimeout):
        await acell.robot("left_arm").call(Method("halt", 0.2, Empty, HaltAnswer), Empty())


async def test_requests_to_several_robots_wait_side_by_side(
    acell: aio.Cell, left: Agent, right: Agent
) -> None:
    both = threading.Barrier(2, timeout=DEADLINE_S)

    def meet(_: object) -> dict[str, object]:
        both.wait()
        return {"epoch": 1}

    left.handlers["halt"] = right.handlers["halt"] = meet
    answers = await asyncio.gather(*(acell.robot(name).halt() for name in await acell.robots()))
    assert [answer.epoch for answer in answers] == [1, 1]


async def test_states_are_an_async_iterator(acell: aio.Cell, left: Agent) -> None:
    left.publish_states()
    seen = []
    async with acell.robot("left_arm").states(timeout_s=DEADLINE_S) as states:
        async for state in states:
            seen.append(state.seqno)
            if len(seen) == 10:
                break
    assert seen == sorted(set(seen))
    assert (await acell.robot("left_arm").state()).seqno > seen[0]


async def test_a_move_of_both_arms(
    acell: aio.Cell, gateway: Gateway, left: Agent, right: Agent
) -> None:
    left.publish_states()
    right.publish_states()
    motion = await acell.move({"left_arm": [1.0, 0.0], "right_arm": [0.0, 0.0]})
    assert (await motion.status()).status is ActionStatus.COMPLETE
    assert len(gateway.of_method("execute_trajectory")) == 1


async def cancel_move(acell: aio.Cell, moving: asyncio.Task[object], left: Agent) -> ActionStatus:
    moving.cancel()
    with pytest.raises(asyncio.CancelledError):
        await moving
    motion = acell.robot("left_arm").motion(UUID(left.motions.last))
    return (await motion.status()).status


async def test_a_move_whose_task_is_cancelled_is_cancelled(acell: aio.Cell, left: Agent) -> None:
    left.motions.ends_as = None
    moving = asyncio.create_task(acell.robot("left_arm").move_joints([0.0, 0.0]))
    # The first question for its status says that the answer has come and it waits for the end.
    assert await asyncio.to_thread(left.motions.asked.wait, DEADLINE_S)
    assert await cancel_move(acell, moving, left) is ActionStatus.CANCELLED


async def test_a_move_cancelled_before_its_answer_has_come_is_cancelled(
    acell: aio.Cell, left: Agent
) -> None:
    left.motions.ends_as = None
    interrupted = threading.Event()
    accept = left.handlers["jog_freespace"]

    def answer_late(params: Json) -> Json:
        left.motions.last = params["motion_id"]
        left.motions.asked.set()
        assert interrupted.wait(DEADLINE_S)
        return accept(params)

    def refuse_until_accepted(_: Json) -> Json:
        interrupted.set()
        if not left.motions.accepted.is_set():
            raise Refused("not_attached", "there is no such motion")
        left.motions.set("cancelled")
        return {}

    left.handlers["jog_freespace"] = answer_late
    left.handlers["cancel"] = refuse_until_accepted
    moving = asyncio.create_task(acell.robot("left_arm").move_joints([0.0, 0.0]))
    assert await asyncio.to_thread(left.motions.asked.wait, DEADLINE_S)
    assert await cancel_move(acell, moving, left) is ActionStatus.CANCELLED


async def test_progress_is_an_async_iterator(acell: aio.Cell, left: Agent) -> None:
    left.motions.ends_as = None
    motion = await acell.robot("left_arm").move_joints([0.0, 0.0], wait=False)
    seen: list[ActionStatus] = []
    async for status in motion.progress(DEADLINE_S):
        if not seen:
            left.motions.set("complete")
        seen.append(status.status)
    assert seen == [ActionStatus.RUNNING, ActionStatus.COMPLETE]


async def test_a_stop_without_a_gateway(acell: aio.Cell, gateway: Gateway) -> None:
    gateway.die()
    assert (await acell.stop()).verdict is StopVerdict.COMPLETE


async def test_connect_can_be_awaited(gateway: Gateway) -> None:
    cell = await aio.connect(gateway.endpoint)
    await cell.close()
    with pytest.raises(armada.NotConnected):
        await cell.status()


async def test_the_loop_runs_on_while_a_stop_waits(acell: aio.Cell, left: Agent) -> None:
    left.stages = ["received"]
    ticks = 0

    async def tick() -> None:
        nonlocal ticks
        while True:
            await asyncio.sleep(0)
            ticks += 1

    ticking = asyncio.create_task(tick())
    report = await acell.stop(timeout_s=1.5)
    ticking.cancel()
    assert report.missing == ("left_arm",)
    assert ticks > 10
