"""The tables of keys, methods, denials and flags are those of Rust."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from armada import keys, methods
from armada.messages import FLAG_NAMES, DenialCode

CONTRACT: dict[str, Any] = json.loads(
    (Path(__file__).resolve().parents[2] / "keys.json").read_text()
)


def test_keys_are_those_of_the_contract() -> None:
    ours = [
        {
            "name": key.name,
            "pattern": key.pattern,
            "kinds": list(key.kinds),
            "owner": key.owner,
            "message": key.message,
            "channel": key.channel.value,
        }
        for key in keys.ALL
    ]
    theirs = [{name: row[name] for name in ours[0]} for row in CONTRACT["keys"]]
    assert ours == theirs


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [(methods.ROBOT_METHODS, "robot_methods"), (methods.CELL_METHODS, "cell_methods")],
)
def test_methods_are_those_of_the_contract(
    ours: tuple[methods.Method[Any, Any], ...], theirs: str
) -> None:
    rows = [(row.name, row.params.__name__, row.answer.__name__) for row in ours]
    assert rows == [(row["name"], row["params"], row["answer"]) for row in CONTRACT[theirs]]
    for row, told in zip(ours, CONTRACT[theirs], strict=True):
        assert row.timeout_s * 1000 == told.get("timeout_ms", row.timeout_s * 1000), row.name


def test_denial_codes_are_those_of_the_contract() -> None:
    assert [code.value for code in DenialCode] == CONTRACT["denial_codes"]


def test_flags_are_those_of_the_contract() -> None:
    assert [[name, int(bit)] for name, bit in FLAG_NAMES] == CONTRACT["robot_flags"]


def test_placeholders_are_filled_in_order_and_the_rest_stays_open() -> None:
    assert keys.ROBOT_RPC.with_("left_arm", "halt") == "robots/left_arm/rpc/halt"
    assert keys.ROBOT_RPC.with_("left_arm") == "robots/left_arm/rpc/*"
    assert keys.ROBOT_STATE.any() == "robots/*/state"
    assert keys.CELL_STOP.any() == "cell/stop"


def test_the_robot_of_a_key_is_its_second_chunk() -> None:
    assert keys.robot_of("robots/torso/state") == "torso"
    assert keys.robot_of("cell/stop") is None
    assert keys.robot_of("robots/*/state") is None


@pytest.mark.parametrize(
    "bad", ["", "Left", "a/b", "a*", "1arm", "_a", "a b", "ä", "$x", "a\n", "a" * 65]
)
def test_a_name_that_could_leave_its_key_chunk_is_refused(bad: str) -> None:
    with pytest.raises(ValueError, match="is not a robot name"):
        keys.check_robot_name(bad)
