"""What messages do beyond the golden samples."""

from __future__ import annotations

import json
from pathlib import Path
from uuid import UUID

import msgspec
import numpy as np
import pytest

from armada import CodecError, codec
from armada._ids import new_id
from armada.codec import WireEncoding
from armada.messages import (
    CommandMode,
    Denial,
    DenialCode,
    Interpolation,
    JogFreespaceParams,
    JointTrajectory,
    JointUnit,
    RobotFlags,
    RobotState,
    StopAck,
    StopRequest,
    joint_vector,
)

GOLDEN = Path(__file__).resolve().parents[2] / "golden"


def golden_state() -> dict[str, object]:
    state: dict[str, object] = json.loads((GOLDEN / "robot_state.json").read_text())
    return state


def decode_state(**changes: object) -> RobotState:
    return codec.decode(RobotState, json.dumps(golden_state() | changes).encode())


def test_arrays_are_numpy_arrays_that_cannot_be_changed() -> None:
    state = decode_state()
    assert (state.joint_position_rad + 1.0).tolist() == [1.5, -0.25]
    with pytest.raises(ValueError, match="read-only"):
        state.joint_position_rad[0] = 0.0


def test_values_of_a_newer_agent_are_kept_as_they_are() -> None:
    state = decode_state(command_mode="dance")
    assert state.command_mode == "dance"
    assert state.command_mode not in list(CommandMode)
    assert json.loads(codec.encode(state))["command_mode"] == "dance"


def test_flags_that_are_not_known_are_kept() -> None:
    state = decode_state(flags=int(RobotFlags.ENABLED) | 1 << 62)
    assert state.flags & RobotFlags.ENABLED
    assert state.flags.names() == ["enabled"]
    assert json.loads(codec.encode(state))["flags"] == (1 << 62) + 0x2_0000


@pytest.mark.parametrize("bad", [["0.5", 1.0], [None], "0.5", {"a": 1}, [[0.5]]])
def test_an_array_of_anything_but_numbers_is_refused_by_field(bad: object) -> None:
    with pytest.raises(CodecError, match=r"joint_position_rad|Expected"):
        decode_state(joint_position_rad=bad)


def test_a_number_that_is_not_finite_is_refused_in_both_directions() -> None:
    payload = msgspec.msgpack.encode(golden_state() | {"joint_position_rad": [float("nan")]})
    with pytest.raises(CodecError, match=r"joint_position_rad\[0\] is nan"):
        codec.decode(RobotState, payload, WireEncoding.MESSAGE_PACK.value)
    params = JogFreespaceParams(joint_position_rad=np.array([0.0, np.inf]))
    with pytest.raises(ValueError, match="value 1 is inf"):
        codec.encode(params)


def test_a_field_that_is_missing_is_refused_by_name() -> None:
    payload = (GOLDEN / "stop_ack.json").read_bytes().replace(b'"stage"', b'"phase"')
    with pytest.raises(CodecError, match=r"StopAck.*stage"):
        codec.decode(StopAck, payload)


def test_a_robot_name_with_a_wildcard_is_refused() -> None:
    payload = (GOLDEN / "stop_ack.json").read_bytes().replace(b'"left_arm"', b'"left/**"')
    with pytest.raises(CodecError, match="robot"):
        codec.decode(StopAck, payload)


def test_an_encoding_that_is_not_known_is_refused_by_its_name() -> None:
    with pytest.raises(CodecError, match="image/png"):
        codec.decode(Denial, b"{}", "image/png")


def test_a_payload_above_the_limit_is_refused_with_both_sizes() -> None:
    with pytest.raises(CodecError, match="1048577 bytes is above the limit of 1048576"):
        codec.decode(Denial, b" " * (codec.MAX_MESSAGE_BYTES + 1))


def test_a_bare_sender_without_an_encoding_means_json() -> None:
    denial = codec.decode(Denial, b'{"code":"busy","message":"m"}', "zenoh/bytes")
    assert denial == Denial(code=DenialCode.BUSY, message="m")


def test_optional_fields_of_a_stop_may_be_left_out() -> None:
    text = b'{"stop_id":"0192f0c3-0000-7000-8000-000000000002","source":"x","level":"L1"}'
    request = codec.decode(StopRequest, text)
    assert (request.scope, request.reason, request.seq) == ("cell", "", 0)


def test_messages_with_equal_arrays_are_equal() -> None:
    assert decode_state() == decode_state()
    assert decode_state() != decode_state(joint_position_rad=[0.5, -1.26])


def test_ids_sort_by_time_and_are_of_version_seven() -> None:
    ids = [new_id() for _ in range(100)]
    assert len(set(ids)) == 100
    assert {made.version for made in ids} == {7}
    assert {made.variant for made in ids} == {UUID(int=0x8 << 60).variant}
    assert [made.int >> 80 for made in ids] == sorted(made.int >> 80 for made in ids)


def test_a_trajectory_from_arrays_has_a_row_per_waypoint() -> None:
    trajectory = JointTrajectory.from_arrays(["a", "b"], [0.0, 2.0], [[0.0, 1.0], [2.0, 3.0]])
    assert trajectory.duration_s == 2.0
    assert json.loads(codec.encode(trajectory)) == {
        "joint_names": ["a", "b"],
        "waypoints": [
            {"time_from_start_s": 0.0, "joint_position": [0.0, 1.0]},
            {"time_from_start_s": 2.0, "joint_position": [2.0, 3.0]},
        ],
        "interpolation": "cubic_spline",
    }


def test_units_and_tolerances_are_written_only_where_they_are_given() -> None:
    text = b"""{"joint_names":["a"],"joint_units":["degree"],"waypoints":[{"time_from_start_s":0.0,
        "joint_position":[1.0],"joint_acceleration":[2.0],"position_tolerance":[3.0],
        "velocity_tolerance":[4.0]}],"interpolation":"quintic_hermite"}"""
    trajectory = codec.decode(JointTrajectory, text)
    assert trajectory.joint_units == (JointUnit.DEGREE,)
    assert trajectory.interpolation is Interpolation.QUINTIC_HERMITE
    assert json.loads(codec.encode(trajectory)) == json.loads(text)


def test_a_trajectory_of_the_wrong_shape_is_refused_with_both_shapes() -> None:
    with pytest.raises(ValueError, match=r"joint_velocity has shape \(1, 2\), expected \(2, 2\)"):
        JointTrajectory.from_arrays(["a", "b"], [0.0, 1.0], np.zeros((2, 2)), np.zeros((1, 2)))


def test_a_trajectory_with_a_nan_is_refused_by_waypoint_and_joint() -> None:
    with pytest.raises(ValueError, match="joint_position of waypoint 1, joint 0 is nan"):
        JointTrajectory.from_arrays(["a"], [0.0, 1.0], [[0.0], [np.nan]])


def test_a_vector_with_two_rows_is_refused() -> None:
    with pytest.raises(ValueError, match=r"goal has shape \(1, 2\)"):
        joint_vector([[1.0, 2.0]], "goal")
