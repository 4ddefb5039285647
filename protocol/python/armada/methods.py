"""The methods under `rpc/`, as in `protocol/src/method.rs`; a test compares the two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

from .messages import (
    Accepted,
    CancelParams,
    CellExecuteTrajectory,
    CellResetAnswer,
    CellResetParams,
    CommitParams,
    Empty,
    ExecuteTrajectoryParams,
    HaltAnswer,
    JogFreespaceParams,
    ModeAnswer,
    Prepared,
    ResetAnswer,
    ResetParams,
    SetModeParams,
    StopReport,
    StopRequest,
)

P = TypeVar("P")
A = TypeVar("A")


@dataclass(frozen=True)
class Method(Generic[P, A]):
    """A method: one query, one answer."""

    name: str
    """Last part of its key."""
    timeout_s: float
    """How long an asker waits; longer than the answerer ever takes."""
    params: type[P]
    """What is asked, inside a `Request`."""
    answer: type[A]
    """What is answered."""


SET_MODE: Final = Method("set_mode", 2.0, SetModeParams, ModeAnswer)
"""Changes the command mode; every mode but `halt` is entered from `halt`."""
HALT: Final = Method("halt", 2.0, Empty, HaltAnswer)
"""Ramps to standstill and stays in `halt`; ends every motion."""
ENABLE: Final = Method("enable", 8.0, Empty, ModeAnswer)
"""Switches the drives on; answered when the controller reports them on."""
DISABLE: Final = Method("disable", 8.0, Empty, ModeAnswer)
"""Ramps to standstill and switches the drives off."""
RESET_ERRORS: Final = Method("reset_errors", 8.0, Empty, ModeAnswer)
"""Clears latched faults whose cause is gone, here and at the controller."""
RESET: Final = Method("reset", 2.0, ResetParams, ResetAnswer)
"""Clears the latched stop; never moves, never enables."""
JOG_FREESPACE: Final = Method("jog_freespace", 2.0, JogFreespaceParams, Accepted)
"""Moves all joints to a position, in mode `jog`; a new goal replaces the old one."""
EXECUTE_TRAJECTORY: Final = Method("execute_trajectory", 4.0, ExecuteTrajectoryParams, Accepted)
"""Follows a trajectory at once, in mode `trajectory`."""
CANCEL: Final = Method("cancel", 2.0, CancelParams, Empty)
"""Ends a motion with a ramp to standstill; the mode stays."""
PREPARE: Final = Method("prepare", 4.0, ExecuteTrajectoryParams, Prepared)
"""Validates a trajectory and keeps it for `commit`."""
COMMIT: Final = Method("commit", 2.0, CommitParams, Accepted)
"""Starts a prepared trajectory at an instant of the agent's clock."""
ABORT: Final = Method("abort", 2.0, CancelParams, Empty)
"""Forgets a prepared trajectory, or ends it with a ramp if it runs."""

ROBOT_METHODS: Final[tuple[Method[Any, Any], ...]] = (
    SET_MODE,
    HALT,
    ENABLE,
    DISABLE,
    RESET_ERRORS,
    RESET,
    JOG_FREESPACE,
    EXECUTE_TRAJECTORY,
    CANCEL,
    PREPARE,
    COMMIT,
    ABORT,
)
"""Every method of an agent, under `robots/{robot}/rpc/`."""

CELL_STOP: Final = Method("stop", 5.0, StopRequest, StopReport)
"""Stops the robots in scope and reports how far each has come."""
CELL_RESET: Final = Method("reset", 4.0, CellResetParams, CellResetAnswer)
"""Clears the latched stops of robots; never moves, never enables."""
CELL_EXECUTE_TRAJECTORY: Final = Method("execute_trajectory", 8.0, CellExecuteTrajectory, Accepted)
"""Follows a trajectory with several robots that start at one instant."""
CELL_CANCEL: Final = Method("cancel", 4.0, CancelParams, Empty)
"""Ends a motion of several robots, each with a ramp to standstill."""

CELL_METHODS: Final[tuple[Method[Any, Any], ...]] = (
    CELL_STOP,
    CELL_RESET,
    CELL_EXECUTE_TRAJECTORY,
    CELL_CANCEL,
)
"""Every method of the gateway, under `cell/rpc/`."""
