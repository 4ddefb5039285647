"""One robot, as asyncio calls."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from uuid import UUID

from armada import methods
from armada._connection import STOP_TIMEOUT_S
from armada._signature import SigningKey, reset_params
from armada.messages import (
    Empty,
    ModeAnswer,
    ResetAnswer,
    StopLevel,
    StopReport,
    StopScopeRobots,
)

from .robot_equipment import RobotEquipment
from .robot_moves import RobotMoves
from .robot_streams import RobotStreams


class Robot(RobotMoves, RobotStreams, RobotEquipment):
    """One robot of a cell."""

    async def enable(self) -> ModeAnswer:
        """Switches the drives on; returns when the controller reports them on."""
        return await self.call(methods.ENABLE, Empty())

    async def disable(self) -> ModeAnswer:
        """Ramps to standstill and switches the drives off."""
        return await self.call(methods.DISABLE, Empty())

    async def reset_errors(self) -> ModeAnswer:
        """Clears latched faults whose cause is gone, here and at the controller."""
        return await self.call(methods.RESET_ERRORS, Empty())

    async def reset(
        self,
        stop_ids: Collection[UUID] | None = None,
        *,
        key_file: str | Path | None = None,
    ) -> ResetAnswer:
        """Clears the latched stop; never moves, never enables.

        `stop_ids` must list every latched stop; if left out, those of the status are taken. A robot
        that asks for a signature gets one made with the key in `key_file`. Raises `DeniedError` if
        a stop has come meanwhile, or if something else still keeps the robot stopped.
        """
        key = SigningKey.read(key_file)
        status = await self.status()
        params = reset_params(status.stop, stop_ids)
        if key is not None:
            params = key.signed(self.name, status.boot_id, params)
        return await self.call(methods.RESET, params)

    async def stop(
        self,
        reason: str = "",
        *,
        level: StopLevel = StopLevel.L2,
        timeout_s: float = STOP_TIMEOUT_S,
    ) -> StopReport:
        """Stops this robot, gateway alive or not, and waits until it is measured to stand still.

        It stays stopped until `reset`.
        """
        scope = StopScopeRobots(robots=(self.name,))
        return await self._connection.stop(scope, reason, level, timeout_s)
