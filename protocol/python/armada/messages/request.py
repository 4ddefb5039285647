"""Requests and answers of the methods under `rpc/`."""

from __future__ import annotations

from typing import Generic, Literal, TypeAlias, TypeVar
from uuid import UUID

import msgspec

from ._base import JointVector, Message, MonoTime, OpenEnum, RobotName
from .denial import Denial
from .group import Coupling, GroupParams, GroupReadiness
from .mode import CommandMode
from .model import JointTrajectory
from .motion import ActionStatus

P = TypeVar("P")


class Request(Message, Generic[P], frozen=True, kw_only=True, omit_defaults=True):
    """Envelope of every request."""

    request_id: UUID | None = None
    """Identity: repeated with the same id it is answered again, not done again."""
    client: str
    """Who asks, for people and the audit trail."""
    lease: UUID | None = None
    """The lease under which it is asked; not needed while nobody holds one."""
    params: P
    """What is asked."""


class Empty(Message, frozen=True, kw_only=True):
    """No parameters, or nothing to say in an answer."""


class SetModeParams(Message, frozen=True, kw_only=True):
    """Parameters of `set_mode`."""

    mode: CommandMode
    """The mode to enter; every mode but `halt` is entered from `halt`."""


class ModeAnswer(Message, frozen=True, kw_only=True):
    """Answer of `set_mode`, `enable`, `disable` and `reset_errors`."""

    command_mode: CommandMode
    """The mode now in force."""
    epoch: int
    """The epoch now in force."""


class HaltAnswer(Message, frozen=True, kw_only=True):
    """Answer of `halt`: the ramp to standstill has begun, or the robot stood already."""

    epoch: int
    """The epoch now in force: motions of older epochs are over."""


class JogFreespaceParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `jog_freespace`: move all joints to a position."""

    motion_id: UUID | None = None
    """Identity the motion gets; a new one is made if left out."""
    joint_position_rad: JointVector
    """Goal of every joint, in the robot's joint order [rad or m]."""
    max_velocity_rad_s: JointVector | None = None
    """Highest speed of every joint [rad/s or m/s]; the joints' limits if left out."""
    wait: bool = False
    """Whether to be answered when the motion has ended."""


class Queue(OpenEnum):
    """What becomes of a trajectory that comes while another is in progress."""

    REFUSE = "refuse"
    """It is refused as busy."""
    APPEND = "append"
    """It waits for the end of the last one in the queue, where it must begin."""
    APPEND_BLENDED = "append_blended"
    """As `append`, and the robot does not come to rest in between where the limits allow: the
    way leaves the end of the one and the beginning of the other by their tolerances at most."""
    REPLACE = "replace"
    """It takes the place of what is in progress and in the queue, which end as cancelled; the
    robot goes over to it without a halt where the limits allow."""


class LeaseLossContinueS(Message, frozen=True, kw_only=True):
    """Go on for some time, then come to rest on the path; `LeaseLoss::ContinueS` in Rust."""

    continue_s: float
    """For how long [s], above 0 to 60."""


LeaseLoss: TypeAlias = Literal["stop_on_path", "finish"] | LeaseLossContinueS
"""What becomes of a motion whose lease runs out: it comes to rest on its path, at once or after
some time, or it goes on to its end and what is queued behind it is cancelled. Streams and jogs
always stop."""


class ExecuteTrajectoryParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of an agent's `execute_trajectory`."""

    motion_id: UUID | None = None
    """Identity the motion gets; a new one is made if left out."""
    trajectory: JointTrajectory
    """The trajectory; it names every joint of the robot."""
    queue: Queue = Queue.REFUSE
    """What to do if a motion is in progress."""
    on_lease_loss: LeaseLoss = "stop_on_path"
    """What to do if the lease is lost on the way."""
    wait: bool = False
    """Whether to be answered when the motion has ended."""


class PrepareParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `prepare`."""

    motion_id: UUID | None = None
    """Identity the motion gets; a new one is made if left out."""
    trajectory: JointTrajectory
    """The trajectory; it names every joint of the robot."""
    group: GroupParams | None = None
    """With whom it is to be followed; alone, at an instant, if left out."""
    on_lease_loss: LeaseLoss = "stop_on_path"
    """What to do if the lease is lost on the way."""


class Accepted(Message, frozen=True, kw_only=True, omit_defaults=True):
    """A motion was accepted; what becomes of it is published under `motions/{id}`."""

    motion_id: UUID
    """Identity of the motion."""
    duration_s: float
    """How long it takes [s]; 0 if that is not known."""
    epoch: int
    """Epoch it belongs to."""
    status: ActionStatus | None = None
    """How it ended, if the answer was to wait for that."""


class Prepared(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Answer of `prepare`: valid, and kept for a `commit`."""

    motion_id: UUID
    """Identity of the motion."""
    duration_s: float
    """How long it takes [s]."""
    epoch: int
    """Epoch it belongs to; any halt or stop makes the commit fail."""
    ttl_ms: int
    """How long it is kept [ms]."""
    group: GroupReadiness | None = None
    """What the others need to know of it, if it is to be followed with others."""


class CommitParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of `commit`: start a prepared motion at an instant."""

    motion_id: UUID
    """Which motion."""
    boot_id: UUID
    """Run of the agent whose clock `start_ns` is of."""
    start_ns: MonoTime
    """Start, agent's monotonic clock [ns]."""
    rate_slope_s: float | None = None
    """Fastest change of the rate of all robots [1/s]: the lowest of what they answered."""


class CancelParams(Message, frozen=True, kw_only=True):
    """Parameters of `cancel` and `abort`: end a motion with a ramp to standstill."""

    motion_id: UUID
    """Which motion."""


class ResetParams(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of an agent's `reset`."""

    stop_ids: tuple[UUID, ...]
    """The stops to clear; it must list every latched one."""
    nonce: UUID
    """The number that the robot's status asks for in `ResetNeeds`."""
    signature: str | None = None
    """Signature with the reset key, in hexadecimal, if the robot asks for one."""


class ResetAnswer(Message, frozen=True, kw_only=True):
    """Answer of an agent's `reset`: nothing moves and nothing is enabled by it."""

    cleared: tuple[UUID, ...]
    """The stops that were cleared."""
    epoch: int
    """The epoch now in force."""


class CellExecuteTrajectory(Message, frozen=True, kw_only=True, omit_defaults=True):
    """Parameters of the cell's `execute_trajectory`."""

    motion_id: UUID | None = None
    """Identity the motion gets; a new one is made if left out."""
    trajectory: JointTrajectory
    """Joints are named `robot/joint`; every joint of each robot that takes part is named."""
    coupling: Coupling = Coupling.TIME_SYNCED
    """How closely the robots are tied together."""
    leases: dict[RobotName, UUID] = msgspec.field(default_factory=dict)
    """The lease of each robot that somebody holds one of."""
    on_lease_loss: LeaseLoss = "stop_on_path"
    """What the whole does if a lease is lost on the way."""
    model_revs: dict[RobotName, int] = msgspec.field(default_factory=dict)
    """Revision of each robot's tools and payloads that it was made for; any if left out."""


class CellResetParams(Message, frozen=True, kw_only=True):
    """Parameters of the cell's `reset`."""

    resets: dict[RobotName, ResetParams]
    """What is to be cleared, by robot, as it was shown to whoever asks; signed where the robot asks
    for it. A stop that came since is not cleared."""


class CellResetAnswer(Message, frozen=True, kw_only=True):
    """Answer of the cell's `reset`."""

    reset: tuple[tuple[RobotName, tuple[UUID, ...]], ...]
    """Robots that are reset, with the stops that were cleared."""
    refused: tuple[tuple[RobotName, Denial], ...]
    """Robots that refused or did not answer, and why."""
