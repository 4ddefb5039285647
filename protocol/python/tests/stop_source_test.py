"""Sources of stops: what they answer, and when they answer nothing."""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path

import pytest
import zenoh

import armada
from armada import NotConnected, aio, codec
from armada._signature import SigningKey
from armada.messages import StopCheckIn

from .fleet import DEADLINE_S, Agent, Gateway, golden

KEY = "cell/stop_sources/door_1"
CHALLENGE = golden("stop_challenge")


def ask(agent: Agent, payload: bytes = json.dumps(CHALLENGE).encode()) -> list[StopCheckIn]:
    """What the source answers to an agent, which asks all that have its name."""
    replies = agent.session.get(
        KEY,
        payload=payload,
        encoding="application/json",
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
        timeout=2.0,
    )
    found = [
        codec.decode(StopCheckIn, reply.ok.payload.to_bytes()) for reply in replies if reply.ok
    ]
    return list({str(check_in.pressed): check_in for check_in in found}.values())


def answers(agent: Agent) -> list[StopCheckIn]:
    """What it answers as soon as the agent's link knows of it."""
    deadline = time.monotonic() + DEADLINE_S
    while not (found := ask(agent)):
        assert time.monotonic() < deadline
    return found


def test_it_answers_each_question_from_its_input(cell: armada.Cell, left: Agent) -> None:
    pressed = False
    with cell.stop_source("door_1", lambda: pressed) as source:
        [released] = answers(left)
        pressed = True
        [now] = answers(left)
        assert (released.pressed, now.pressed) == (False, True)
        assert (now.source, str(now.nonce), now.signature) == ("door_1", CHALLENGE["nonce"], None)
        assert list(source.asking()) == ["left_arm"]


def test_a_source_that_is_closed_answers_nothing(cell: armada.Cell, left: Agent) -> None:
    source = cell.stop_source("door_1", lambda: False)
    assert len(answers(left)) == 1
    source.close()
    source.close()
    assert ask(left) == []


def test_an_input_that_fails_is_pressed_and_told(cell: armada.Cell, left: Agent) -> None:
    def broken() -> bool:
        raise OSError("no such line")

    source = cell.stop_source("door_1", broken)
    [check_in] = answers(left)
    assert check_in.pressed
    with pytest.raises(OSError, match="no such line"), source:
        pass


@pytest.mark.parametrize("value", [None, 0, "", True])
def test_only_false_is_released(cell: armada.Cell, left: Agent, value: object) -> None:
    with cell.stop_source("door_1", lambda: value):  # type: ignore[arg-type,return-value]
        [check_in] = answers(left)
        assert check_in.pressed


def test_an_input_that_does_not_return_is_silence(cell: armada.Cell, left: Agent) -> None:
    asked, done = threading.Event(), threading.Event()

    def hang() -> bool:
        asked.set()
        return done.wait(10.0)

    with cell.stop_source("door_1", hang):
        heard: list[StopCheckIn] = []

        def ask_until_asked() -> None:
            while not asked.is_set():
                heard.extend(ask(left))

        asking = threading.Thread(target=ask_until_asked)
        asking.start()
        assert asked.wait(DEADLINE_S)
        # The connection is not held up by it.
        assert cell.robot("left_arm").halt().epoch == 5
        asking.join(DEADLINE_S)
        assert heard == []
        done.set()


def test_with_a_key_its_answer_is_signed_for_who_asked(
    cell: armada.Cell, left: Agent, tmp_path: Path
) -> None:
    path = tmp_path / "door.key"
    path.write_text("secret\n")
    with cell.stop_source("door_1", lambda: True, key_file=path):
        [check_in] = answers(left)
    text = f"armada-check-in\ndoor_1\nleft_arm\n{CHALLENGE['nonce']}\npressed"
    assert check_in.signature == SigningKey(b"secret")._sign(text)


def test_what_is_no_challenge_gets_no_answer(cell: armada.Cell, left: Agent) -> None:
    with cell.stop_source("door_1", lambda: False) as source:
        assert ask(left, b"not json") == []
        assert source.asking() == {}


def test_it_answers_agents_also_without_the_gateway(
    cell: armada.Cell, gateway: Gateway, left: Agent
) -> None:
    with cell.stop_source("door_1", lambda: False):
        assert len(answers(left)) == 1
        gateway.die()
        # The direct link is made in the background, as an agent asks again and again.
        assert len(answers(left)) == 1


@pytest.mark.parametrize("name", ["", "Door", "a/b", "*"])
def test_a_name_that_could_leave_its_key_chunk_is_refused(cell: armada.Cell, name: str) -> None:
    with pytest.raises(ValueError, match="is not the name of a stop source"):
        cell.stop_source(name, lambda: False)


def test_a_connection_that_is_closed_has_no_source(gateway: Gateway) -> None:
    cell = armada.connect(gateway.endpoint)
    cell.close()
    with pytest.raises(NotConnected):
        cell.stop_source("door_1", lambda: False)


async def test_in_a_loop_it_is_used_in_the_same_way(acell: aio.Cell, left: Agent) -> None:
    async with acell.stop_source("door_1", lambda: False):
        [check_in] = answers(left)
        assert not check_in.pressed
