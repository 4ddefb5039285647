"""Leases of several robots: all or none; and motions of several robots under them."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
import pytest

import armada
from armada import (
    ActionStatus,
    Coupling,
    DenialCode,
    DeniedError,
    JointTrajectory,
    LeaseLost,
    LeaseScope,
    Role,
    aio,
)
from armada.messages import LeaseLossContinueS

from .fleet import DEADLINE_S, LEASE, SUB_LEASE, Agent, Gateway, Json, Refused, golden

BOTH = ["left_arm/elbow_joint", "right_arm/elbow_joint"]


def trajectory() -> JointTrajectory:
    return JointTrajectory.from_arrays(BOTH, [0.0, 1.0], np.zeros((2, 2)))


def refuse(code: str, message: str, **details: object) -> Callable[[Json], Json]:
    def handler(_: Json) -> Json:
        raise Refused(code, message, **details)

    return handler


def lease_steps(agent: Agent) -> list[tuple[str, Json]]:
    """What was asked of a lease, in its order, without its renewals at the same length."""
    return [
        (method, envelope["params"])
        for method, envelope in agent.requests
        if "lease" in method and (method != "renew_lease" or "ttl_ms" in envelope["params"])
    ]


def test_all_are_held_and_given_back(cell: armada.Cell, left: Agent, right: Agent) -> None:
    with cell.leases(["right_arm", "left_arm"], ttl_s=5.0) as leases:
        assert leases.robots == ("left_arm", "right_arm")
        assert {robot: str(lease) for robot, lease in leases.ids.items()} == {
            "left_arm": LEASE,
            "right_arm": LEASE,
        }
        assert leases.lease("left_arm").ttl_s == 5.0
        cell.robot("left_arm").set_mode(armada.CommandMode.JOG)
    assert not leases.is_held
    assert left.of_method("set_mode")[0]["lease"] == LEASE
    for agent in (left, right):
        # Each lasts half a second only until all are there.
        assert lease_steps(agent) == [
            ("acquire_lease", {"ttl_ms": 500}),
            ("renew_lease", {"lease": LEASE, "ttl_ms": 5000}),
            ("release_lease", {"lease": LEASE}),
        ]


def test_without_names_it_is_every_robot_of_the_cell(cell: armada.Cell) -> None:
    with cell.leases() as leases:
        assert leases.robots == ("left_arm", "right_arm")


def test_if_one_is_refused_none_is_kept(cell: armada.Cell, left: Agent, right: Agent) -> None:
    right.handlers["acquire_lease"] = refuse("lease_required", "held by panel", holder="panel")
    with pytest.raises(DeniedError, match=r"right_arm.*held by panel") as caught:
        cell.leases(["left_arm", "right_arm"])
    assert caught.value.details["holder"] == "panel"
    assert len(left.of_method("release_lease")) == 1
    assert right.of_method("release_lease") == []
    assert cell.robot("left_arm").held is None


def test_one_that_cannot_be_made_longer_gives_all_back(
    cell: armada.Cell, left: Agent, right: Agent
) -> None:
    right.handlers["renew_lease"] = refuse("lease_stale", "panel has acquired it")
    with pytest.raises(DeniedError, match="panel has acquired it"):
        cell.leases(["left_arm", "right_arm"])
    assert len(left.of_method("release_lease")) == len(right.of_method("release_lease")) == 1


def test_each_is_renewed_beside_the_program(cell: armada.Cell, left: Agent, right: Agent) -> None:
    with cell.leases(ttl_s=1.5):
        assert left.wait_for("renew_lease", 4)
        assert right.wait_for("renew_lease", 4)


def test_the_loss_of_one_is_told_and_ends_what_is_asked_of_both(
    cell: armada.Cell, gateway: Gateway, left: Agent, right: Agent
) -> None:
    told: list[LeaseLost] = []
    heard = threading.Event()

    def lost(what: LeaseLost) -> None:
        told.append(what)
        heard.set()

    leases = cell.leases(ttl_s=1.5, on_lost=lost)
    right.handlers["renew_lease"] = refuse("lease_stale", "panel took it: planner hangs")
    assert heard.wait(DEADLINE_S)
    assert [what.robot for what in told] == ["right_arm"]
    with pytest.raises(LeaseLost, match="right_arm"):
        cell.execute_trajectory(trajectory())
    assert gateway.of_method("execute_trajectory") == []
    # The other one is held still.
    cell.robot("left_arm").set_mode(armada.CommandMode.JOG)
    with pytest.raises(LeaseLost, match="planner hangs"), leases:
        pass
    assert len(left.of_method("release_lease")) == 1
    assert right.of_method("release_lease") == []


def test_a_robot_that_is_held_already_is_told_before_any_is_asked(
    cell: armada.Cell, left: Agent
) -> None:
    with cell.robot("right_arm").lease():
        with pytest.raises(ValueError, match="the lease of right_arm is held already"):
            cell.leases()
        assert left.of_method("acquire_lease") == []


async def test_in_a_loop_they_are_renewed_by_tasks(acell: aio.Cell, left: Agent) -> None:
    async with acell.leases(ttl_s=1.5) as leases:
        while len(left.of_method("renew_lease")) < 3:
            await acell.robot("left_arm").status()
        leases.check()
    assert len(left.of_method("release_lease")) == 1


def test_a_motion_of_several_goes_under_the_leases_that_are_held(
    cell: armada.Cell, gateway: Gateway
) -> None:
    with cell.leases():
        cell.execute_trajectory(
            trajectory(),
            coupling=Coupling.RIGID,
            on_lease_loss=LeaseLossContinueS(continue_s=0.5),
            model_revs={"left_arm": 3},
        )
    [sent] = [row["params"] for row in gateway.of_method("execute_trajectory")]
    assert sent["coupling"] == "rigid"
    assert sent["leases"] == {"left_arm": LEASE, "right_arm": LEASE}
    assert sent["on_lease_loss"] == {"continue_s": 0.5}
    assert sent["model_revs"] == {"left_arm": 3}


def test_without_leases_none_is_sent(cell: armada.Cell, gateway: Gateway) -> None:
    cell.execute_trajectory(trajectory())
    [sent] = [row["params"] for row in gateway.of_method("execute_trajectory")]
    assert sent.keys() == {"motion_id", "trajectory"}


def test_a_move_is_coupled_as_asked(
    cell: armada.Cell, gateway: Gateway, left: Agent, right: Agent
) -> None:
    left.publish_states()
    right.publish_states()
    goals = {"left_arm": [0.1, 0.0], "right_arm": [0.1, 0.0]}
    motion = cell.move(goals, coupling=Coupling.INDEPENDENT, on_lease_loss="finish")
    assert motion.status().status is ActionStatus.COMPLETE
    [sent] = [row["params"] for row in gateway.of_method("execute_trajectory")]
    assert (sent["coupling"], sent["on_lease_loss"]) == ("independent", "finish")


def test_what_changes_a_motion_shows_a_lease_that_is_held_of_one_of_its_robots(
    cell: armada.Cell, gateway: Gateway, left: Agent
) -> None:
    assert left.name == "left_arm"
    gateway.motions.ends_as = None
    motion = cell.execute_trajectory(trajectory())
    motion.pause()
    with cell.robot("left_arm").lease(ttl_s=5.0):
        motion.resume()
        assert motion.set_speed(0.5) == 0.5
    [without] = gateway.of_method("pause")
    [under] = gateway.of_method("resume")
    assert "lease" not in without
    assert under["lease"] == LEASE
    assert gateway.of_method("set_speed_ratio")[0]["lease"] == LEASE


def test_a_motion_of_several_is_paused_slowed_and_resumed(
    cell: armada.Cell, gateway: Gateway
) -> None:
    gateway.motions.ends_as = None
    motion = cell.execute_trajectory(trajectory())
    motion.pause()
    assert motion.status().status is ActionStatus.PAUSED
    assert motion.set_speed(0.25) == 0.25
    motion.resume()
    assert motion.status().status is ActionStatus.RUNNING
    [sent] = gateway.of_method("set_speed_ratio")
    assert sent["params"] == {"motion_id": str(motion.id), "ratio": 0.25}


def test_a_motion_that_cannot_be_paused_says_so(cell: armada.Cell, gateway: Gateway) -> None:
    gateway.handlers["pause"] = refuse("not_supported", "left_arm: not while it is blended")
    with pytest.raises(DeniedError, match="left_arm: not while it is blended"):
        cell.execute_trajectory(trajectory()).pause()


def test_clearance_is_what_the_gateway_found(cell: armada.Cell, gateway: Gateway) -> None:
    answer = cell.check_clearance(trajectory(), offset_ms=60.0)
    assert (answer.clear, answer.distance_m, answer.at_s) == (False, 0.0075, 1.25)
    assert answer.links == ("left_arm/forearm_link", "right_arm/wrist_1_link")
    assert answer.without_shape == ("torso/lift_link",)
    assert gateway.of_method("check_clearance")[0]["params"]["offset_ms"] == 60.0


def test_a_person_takes_a_lease_with_a_role_and_a_reason(cell: armada.Cell, left: Agent) -> None:
    with cell.robot("left_arm").take_lease(Role.OPERATOR, "planner hangs", ttl_s=5.0) as lease:
        assert str(lease.id) == LEASE
    [sent] = left.of_method("take_lease")
    assert sent["params"] == {"ttl_ms": 5000, "role": "operator", "reason": "planner hangs"}
    assert len(left.of_method("release_lease")) == 1


def test_a_role_that_is_too_low_takes_nothing(cell: armada.Cell, left: Agent) -> None:
    left.handlers["take_lease"] = refuse("lease_required", "panel is supervisor", role="supervisor")
    with pytest.raises(DeniedError) as caught:
        cell.robot("left_arm").take_lease(Role.OPERATOR, "mine")
    assert caught.value.code is DenialCode.LEASE_REQUIRED
    assert cell.robot("left_arm").held is None


def test_a_holder_lets_another_command_as_well(
    cell: armada.Cell, gateway: Gateway, left: Agent
) -> None:
    with cell.robot("left_arm").lease(ttl_s=5.0, role=Role.OPERATOR) as lease:
        grant = lease.delegate("gripper-ui", scope=LeaseScope.END_EFFECTOR, ttl_s=2.0)
        assert str(grant.lease) == SUB_LEASE
        with armada.connect(gateway.endpoint, name="gripper-ui") as other:
            robot = other.robot("left_arm")
            with robot.use_lease(grant.lease) as used:
                assert str(used.id) == SUB_LEASE
                robot.set_signal("lamp", True)
    assert left.of_method("acquire_lease")[0]["params"] == {"ttl_ms": 5000, "role": "operator"}
    [asked] = left.of_method("delegate_lease")
    assert (asked["lease"], asked["params"]) == (
        LEASE,
        {"lease": LEASE, "to": "gripper-ui", "scope": "end_effector", "ttl_ms": 2000},
    )
    [signal] = left.of_method("set_signal")
    assert (signal["client"], signal["lease"]) == ("gripper-ui", SUB_LEASE)
    released = [row["params"]["lease"] for row in left.of_method("release_lease")]
    assert released == [SUB_LEASE, LEASE]


def test_one_that_is_lost_cannot_be_delegated(cell: armada.Cell, left: Agent) -> None:
    left.handlers["renew_lease"] = refuse("lease_stale", golden("denial")["message"])
    told = threading.Event()
    lease = cell.robot("left_arm").lease(ttl_s=0.2, on_lost=lambda _: told.set())
    assert told.wait(DEADLINE_S)
    with pytest.raises(LeaseLost):
        lease.delegate("gripper-ui")
    assert left.of_method("delegate_lease") == []
