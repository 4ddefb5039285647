"""Resets: with what a robot asks for, and signed where it has a key."""

from __future__ import annotations

import threading
from pathlib import Path
from uuid import UUID

import pytest

import armada
from armada import DenialCode, DeniedError, LeaseLost
from armada._signature import SigningKey
from armada.messages import StopChallenge

from .fleet import DEADLINE_S, Agent, Gateway, Json, Refused, golden

STOP_IDS = [f"00000000-0000-0000-0000-00000000000{i}" for i in (2, 1)]
KEY = "golden reset key"
"""The key that the signatures of the golden samples are made with."""


LATCHED = golden("robot_status")["stop"]["stops"][0]["stop_id"]
"""The stop of the golden status."""


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    path = tmp_path / "reset.key"
    path.write_text(f" {KEY}\r\n")
    return path


def latch(*stop_ids: str) -> Json:
    """The stop of the golden status, with other stops in it."""
    sample: Json = golden("robot_status")["stop"]
    stops = [sample["stops"][0] | {"stop_id": stop_id} for stop_id in stop_ids]
    return sample | ({"stops": stops} if stop_ids else {})


def test_it_lists_every_latched_stop_and_returns_the_nonce(cell: armada.Cell, left: Agent) -> None:
    left.status["stop"] = latch(*STOP_IDS)
    answer = cell.robot("left_arm").reset()
    assert [str(stop_id) for stop_id in answer.cleared] == STOP_IDS
    [sent] = left.of_method("reset")
    assert sent["params"] == {"stop_ids": STOP_IDS, "nonce": latch()["reset"]["nonce"]}


def test_one_that_is_signed_is_that_of_the_golden_sample(
    cell: armada.Cell, left: Agent, key_file: Path
) -> None:
    left.status["stop"] = latch()
    cell.robot("left_arm").reset(key_file=key_file)
    [sent] = left.of_method("reset")
    assert sent["params"] == golden("request_reset")["params"]


def test_the_order_of_stops_is_not_in_the_signature() -> None:
    key, some, nonce = SigningKey(b"k"), UUID(STOP_IDS[0]), UUID(int=3)
    ids = [UUID(stop_id) for stop_id in STOP_IDS]
    signature = key.sign_reset("left_arm", some, nonce, ids)
    assert signature == key.sign_reset("left_arm", some, nonce, ids[::-1])
    assert signature != key.sign_reset("right_arm", some, nonce, ids)


def test_a_key_does_not_show_and_the_function_is_hmac_sha256() -> None:
    # Source: RFC 4231, test case 2, whose text has no line feed.
    key = SigningKey(b"Jefe")
    told = "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843"
    assert key._sign("what do ya want for nothing?") == told
    assert "Jefe" not in repr(key)


def test_a_check_in_that_is_released_is_not_signed_as_one_that_is_pressed() -> None:
    key, challenge = SigningKey(b"k"), StopChallenge(robot="left_arm", nonce=UUID(int=3))
    pressed = key.sign_check_in("door_1", challenge, pressed=True)
    assert pressed != key.sign_check_in("door_1", challenge, pressed=False)


def test_a_stop_that_came_meanwhile_is_not_cleared_without_being_seen(
    cell: armada.Cell, left: Agent
) -> None:
    def refuse(_: Json) -> Json:
        raise Refused("stale_sequence", "another stop has come")

    left.status["stop"] = latch()
    left.handlers["reset"] = refuse
    with pytest.raises(DeniedError) as caught:
        cell.robot("left_arm").reset()
    assert caught.value.code is DenialCode.STALE_SEQUENCE
    assert len(left.of_method("reset")) == 1


def test_an_empty_key_file_is_told_before_anything_is_asked(
    cell: armada.Cell, left: Agent, tmp_path: Path
) -> None:
    empty = tmp_path / "empty.key"
    empty.write_text("\n")
    with pytest.raises(ValueError, match=r"empty\.key is empty"):
        cell.robot("left_arm").reset(key_file=empty)
    assert left.of_method("reset") == []


def test_it_needs_no_lease_that_the_stop_took_away(cell: armada.Cell, left: Agent) -> None:
    def refuse(_: Json) -> Json:
        raise Refused("lease_stale", "a stop is latched")

    left.handlers["renew_lease"] = refuse
    left.status["stop"] = latch()
    robot = cell.robot("left_arm")
    told = threading.Event()
    lease = robot.lease(ttl_s=0.2, on_lost=lambda _: told.set())
    assert told.wait(DEADLINE_S)
    with pytest.raises(LeaseLost):
        robot.reset_errors()
    robot.reset()
    lease.release()
    assert len(left.of_method("reset")) == 1


def test_the_cell_is_reset_by_the_gateway(cell: armada.Cell, gateway: Gateway, left: Agent) -> None:
    left.status["stop"] = latch()
    answer = cell.reset(["left_arm"])
    assert answer.reset[0][0] == "left_arm"
    assert answer.refused[0][1].code is DenialCode.OUT_OF_RANGE
    shown = {"stop_ids": [LATCHED], "nonce": latch()["reset"]["nonce"]}
    assert gateway.of_method("reset")[0]["params"] == {"resets": {"left_arm": shown}}


def test_of_a_cell_those_that_ask_for_a_signature_get_one(
    cell: armada.Cell, gateway: Gateway, left: Agent, right: Agent, key_file: Path
) -> None:
    left.status["stop"] = latch()
    right.status["stop"] = latch() | {"reset": latch()["reset"] | {"signed": False}}
    cell.reset(["left_arm", "right_arm"], key_file=key_file)
    sample = golden("request_cell_reset")["params"]["resets"]
    shown = {"stop_ids": [LATCHED], "nonce": latch()["reset"]["nonce"]}
    expected = {"resets": sample | {"right_arm": shown}}
    assert gateway.of_method("reset")[0]["params"] == expected


def test_without_names_those_that_are_stopped_are_reset(
    cell: armada.Cell, gateway: Gateway, left: Agent, right: Agent, key_file: Path
) -> None:
    left.status["stop"], right.status["stop"] = latch(), None
    cell.reset(key_file=key_file)
    [sent] = gateway.of_method("reset")
    assert (
        sent["params"]["resets"]["left_arm"]
        == (golden("request_cell_reset")["params"]["resets"]["left_arm"])
    )
    assert "right_arm" not in sent["params"]["resets"]


def test_a_robot_whose_agent_is_gone_does_not_keep_the_others_stopped(
    cell: armada.Cell, gateway: Gateway, left: Agent, right: Agent, key_file: Path
) -> None:
    left.status["stop"] = right.status["stop"] = latch()
    right.close()
    cell.reset(key_file=key_file)
    [sent] = gateway.of_method("reset")
    assert "signature" in sent["params"]["resets"]["left_arm"]
    assert "signature" not in sent["params"]["resets"]["right_arm"]
