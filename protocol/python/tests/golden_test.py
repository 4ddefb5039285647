"""Every golden sample goes through its struct and comes out as it was."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from armada import CodecError, codec, messages, methods
from armada.codec import WireEncoding

GOLDEN = Path(__file__).resolve().parents[2] / "golden"
SAMPLES = sorted(GOLDEN.glob("*.json"))

IRREGULAR: dict[str, Any] = {
    "answer_accepted": messages.Accepted,
    "answer_accepted_and_ended": messages.Accepted,
    "answer_group_lease": messages.GroupLease,
    "answer_group_lease_released": messages.GroupLeaseReleased,
    "answer_lease": messages.LeaseGrant,
    "answer_lease_released": messages.LeaseReleased,
    "answer_param": messages.NamedValue,
    "answer_prepared": messages.Prepared,
    "answer_signal": messages.NamedValue,
    "stream_position": messages.StreamCommand,
    "stream_velocity": messages.StreamCommand,
}


def type_of(stem: str) -> Any:
    """The type that golden/README.md gives to a file."""
    if stem == "request_empty":
        return messages.Request[messages.Empty]
    for prefix, rows in (
        ("request_cell_", methods.CELL_METHODS),
        ("request_", methods.ROBOT_METHODS),
    ):
        if stem.startswith(prefix):
            name = stem.removeprefix(prefix)
            params: Any = next(row.params for row in rows if row.name == name)
            return messages.Request[params]
    if stem in IRREGULAR:
        return IRREGULAR[stem]
    name = stem.removeprefix("answer_") + ("_answer" if stem.startswith("answer_") else "")
    return getattr(messages, "".join(part.capitalize() for part in name.split("_")))


def test_golden_samples_are_there() -> None:
    assert len(SAMPLES) == 85, f"samples in {GOLDEN}: {len(SAMPLES)}"


@pytest.mark.parametrize("encoding", list(WireEncoding))
@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_sample_is_the_same_after_decoding_and_encoding(path: Path, encoding: WireEncoding) -> None:
    sample = json.loads(path.read_text())
    message_type = type_of(path.stem)
    message = codec.decode(message_type, path.read_bytes())
    again = codec.decode(message_type, codec.encode(message, encoding), encoding.value)
    assert again == message
    assert json.loads(codec.encode(again)) == sample


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_fields_of_newer_senders_are_passed_over(path: Path) -> None:
    sample = json.loads(path.read_text())
    message = codec.decode(type_of(path.stem), json.dumps(sample | {"added_later": 1}).encode())
    assert json.loads(codec.encode(message)) == sample


def spoilt(value: Any, bad: float, path: str = "") -> Iterator[tuple[str, Any]]:
    """The value with each of its numbers in turn replaced, and where that was."""
    if isinstance(value, dict):
        for key, inner in value.items():
            for where, other in spoilt(inner, bad, f"{path}.{key}" if path else key):
                yield where, value | {key: other}
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            for where, other in spoilt(inner, bad, f"{path}[{index}]"):
                yield where, [*value[:index], other, *value[index + 1 :]]
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield path, bad


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_no_number_of_any_message_may_be_infinite_or_none(path: Path, bad: float) -> None:
    for where, sample in spoilt(json.loads(path.read_text()), bad):
        payload = msgspec.msgpack.encode(sample)
        with pytest.raises(CodecError, match=re.escape(f"{where} is {bad}")):
            codec.decode(type_of(path.stem), payload, WireEncoding.MESSAGE_PACK.value)
