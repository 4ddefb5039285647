"""Requests: answers, refusals, silence, and answers that are none."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable

import pytest
import zenoh

import armada
from armada import CodecError, DenialCode, DeniedError, NoReply, NotConnected, RequestTimeout
from armada.messages import CommandMode, Empty, HaltAnswer
from armada.methods import Method

from .fleet import Agent, Gateway, Refused

IMPATIENT = Method("halt", 0.2, Empty, HaltAnswer)


def test_robots_are_those_of_the_cell_in_its_order(cell: armada.Cell) -> None:
    assert cell.robots() == ["left_arm", "right_arm"]
    assert cell.robots_alive() == ["left_arm", "right_arm"]


def test_values_are_decoded_to_their_types(cell: armada.Cell) -> None:
    left = cell.robot("left_arm")
    assert left.info().joint_names == ("elbow_joint", "spin_joint")
    assert left.status().command_mode is CommandMode.HALT
    assert left.clock().stamp_ns == 123456789012
    assert cell.status().verdict == "stopped"


def test_a_request_carries_an_id_the_client_and_its_parameters(
    cell: armada.Cell, left: Agent
) -> None:
    answer = cell.robot("left_arm").set_mode(CommandMode.JOG)
    assert (answer.command_mode, answer.epoch) == (CommandMode.JOG, 5)
    [(method, envelope)] = left.requests
    assert method == "set_mode"
    assert envelope["client"] == "test"
    assert envelope["params"] == {"mode": "jog"}
    assert len(envelope["request_id"]) == 36


def test_a_refusal_is_raised_with_code_message_and_details(cell: armada.Cell, left: Agent) -> None:
    def refuse(_: object) -> dict[str, object]:
        raise Refused("not_enabled", "drives are off: enable first", drive=2)

    left.handlers["halt"] = refuse
    with pytest.raises(DeniedError) as caught:
        cell.robot("left_arm").halt()
    assert caught.value.code is DenialCode.NOT_ENABLED
    assert caught.value.message == "drives are off: enable first"
    assert caught.value.details == {"drive": 2}
    assert str(caught.value) == (
        "robots/left_arm/rpc/halt: not_enabled: drives are off: enable first"
    )
    assert len(left.of_method("halt")) == 1


def test_a_refusal_of_a_newer_agent_is_still_a_refusal(cell: armada.Cell, left: Agent) -> None:
    def refuse(_: object) -> dict[str, object]:
        raise Refused("out_of_coffee", "refill")

    left.handlers["halt"] = refuse
    with pytest.raises(DeniedError) as caught:
        cell.robot("left_arm").halt()
    assert caught.value.code == "out_of_coffee"


def test_nobody_at_the_key_is_a_failure_after_patience(cell: armada.Cell) -> None:
    begin = time.monotonic()
    with pytest.raises(NoReply, match="robots/torso/rpc/halt"):
        cell.robot("torso").halt()
    assert 0.3 <= time.monotonic() - begin < 2.0


def test_a_request_nobody_took_is_repeated_with_the_same_id(cell: armada.Cell, left: Agent) -> None:
    def drop_two(query: zenoh.Query) -> None:
        if len(left.of_method("halt")) == 3:
            del left.raw["halt"]
            with query:
                query.reply(str(query.key_expr), b'{"epoch":9}', encoding="application/json")
        else:
            query.drop()

    left.raw["halt"] = drop_two
    assert cell.robot("left_arm").halt().epoch == 9
    ids = {envelope["request_id"] for envelope in left.of_method("halt")}
    assert len(left.of_method("halt")) == 3
    assert len(ids) == 1


def test_an_agent_that_never_answers_is_a_timeout(cell: armada.Cell, left: Agent) -> None:
    left.raw["halt"] = left.hold
    with pytest.raises(RequestTimeout) as caught:
        cell.robot("left_arm").call(IMPATIENT, Empty())
    assert caught.value.key == "robots/left_arm/rpc/halt"
    assert isinstance(caught.value, TimeoutError)
    assert len(left.of_method("halt")) == 1


def replies_with(payload: bytes, encoding: str, *, error: bool) -> Callable[[zenoh.Query], None]:
    def answer(query: zenoh.Query) -> None:
        with query:
            if error:
                query.reply_err(payload, encoding=encoding)
            else:
                query.reply(str(query.key_expr), payload, encoding=encoding)

    return answer


@pytest.mark.parametrize("error", [False, True])
@pytest.mark.parametrize(
    ("payload", "encoding"),
    [
        (b"\xff\x00 not json", "application/json"),
        (b"[]", "application/json"),
        (b"{}", "application/json"),
        (b'{"epoch":"one"}', "application/json"),
        (b"", "application/json"),
        (b'{"epoch":1}', "image/png"),
        (b"\xc1", "application/msgpack"),
        (b" " * 1_048_577, "application/json"),
        (b"Timeout!", "zenoh/string"),
    ],
)
def test_an_answer_that_is_none_is_a_codec_error(
    cell: armada.Cell, left: Agent, payload: bytes, encoding: str, error: bool
) -> None:
    left.raw["halt"] = replies_with(payload, encoding, error=error)
    with pytest.raises(CodecError):
        cell.robot("left_arm").halt()


def test_an_answer_in_message_pack_is_read_too(cell: armada.Cell, left: Agent) -> None:
    left.raw["halt"] = replies_with(b"\x81\xa5epoch\x08", "application/msgpack", error=False)
    assert cell.robot("left_arm").halt().epoch == 8


def test_an_endpoint_where_nobody_listens_is_told() -> None:
    with socket.socket() as taken:
        # Bound, but not listening: nobody else can take the port meanwhile.
        taken.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(NotConnected, match=endpoint) as caught:
            armada.connect(endpoint, timeout_s=0.2)
    assert isinstance(caught.value, ConnectionError)
    assert "armada up" in str(caught.value)
    assert ".rs:" not in str(caught.value)


def test_an_endpoint_that_is_none_is_told() -> None:
    with pytest.raises(NotConnected, match="nonsense"):
        armada.connect("nonsense", timeout_s=0.2)


def test_a_closed_connection_is_told(gateway: Gateway) -> None:
    cell = armada.connect(gateway.endpoint)
    cell.close()
    cell.close()
    with pytest.raises(NotConnected, match="closed"):
        cell.status()
    with pytest.raises(NotConnected, match="closed"):
        cell.stop()


def test_a_cell_is_kept_apart_by_its_namespace(gateway: Gateway, left: Agent) -> None:
    assert left.name in {agent.name for agent in gateway.agents}
    with (
        armada.connect(gateway.endpoint, namespace="elsewhere") as cell,
        pytest.raises(NoReply),
    ):
        cell.status()


def test_without_a_gateway_robots_are_those_on_the_bus(gateway: Gateway, left: Agent) -> None:
    gateway.die()
    with armada.connect(left.endpoint) as cell:
        assert cell.robots() == ["left_arm"]
        assert cell.robot("left_arm").halt().epoch == 5


def test_when_the_gateway_dies_agents_are_asked_directly(
    cell: armada.Cell, gateway: Gateway, left: Agent
) -> None:
    gateway.die()
    assert cell.robot("left_arm").status().robot == left.name
