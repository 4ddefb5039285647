"""Streams of commands to a robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from numpy.typing import ArrayLike

from armada import keys
from armada.errors import RequestTimeout
from armada.messages import CommandMode

from .lease import HeldLease
from .opening import Opening
from .robot_base import RobotBase
from .stream import CommandStream, PositionStream, Stream, TwistStream, VelocityStream

S = TypeVar("S", bound=Stream)

_STATE_S = 1.0
"""How long to wait for a state of the new epoch [s]."""


class RobotStreams(RobotBase):
    """Streams of commands: to be used in a `with`, inside that of a lease.

    They enter their mode when they are opened, through halt where needed, and raise `ValueError` if
    no lease is held.
    """

    def stream_position(self) -> Opening[PositionStream]:
        """A stream of the positions of all joints, in mode `position_command`."""
        key = keys.ROBOT_STREAM_POSITION.of(self.name)
        return Opening(lambda: self._stream(PositionStream, key, CommandMode.POSITION_COMMAND))

    def stream_velocity(self) -> Opening[VelocityStream]:
        """A stream of the speeds of all joints, in mode `velocity_command`."""
        key = keys.ROBOT_STREAM_VELOCITY.of(self.name)
        return Opening(lambda: self._stream(VelocityStream, key, CommandMode.VELOCITY_COMMAND))

    def stream_twist(self) -> Opening[TwistStream]:
        """A stream of speeds of tools, in mode `velocity_command`."""
        key = keys.ROBOT_STREAM_TWIST.of(self.name)
        return Opening(lambda: self._stream(TwistStream, key, CommandMode.VELOCITY_COMMAND))

    def stream_command(
        self, mode: CommandMode = CommandMode.POSITION_COMMAND
    ) -> Opening[CommandStream]:
        """A stream of commands to any joints by name.

        In mode `position_command` positions count, in mode `velocity_command` velocities.
        """
        key = keys.ROBOT_COMMAND.of(self.name)
        return Opening(lambda: self._stream(CommandStream, key, mode))

    async def command(
        self,
        name: Sequence[str],
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
    ) -> None:
        """Sends one command to joints by name, entering the mode for it where needed.

        That is `position_command` if there are positions, else `velocity_command`. To send many,
        use `stream_command`.
        """
        mode = CommandMode.VELOCITY_COMMAND if position is None else CommandMode.POSITION_COMMAND
        async with self.stream_command(mode) as stream:
            stream.send(name, position, velocity)

    async def _stream(self, stream_type: type[S], key: str, mode: CommandMode) -> S:
        lease = self._held_lease()
        # The first call subscribes: states are on their way while the mode is entered.
        latest = self._latest_state()
        await self.enter_mode(mode)
        epoch = (await self.status()).epoch
        for _ in range(100):
            await latest.read(_STATE_S)
            seen = latest.newest_seen()
            if seen is not None and seen.epoch >= epoch:
                return stream_type(self._bus, key, lease, latest, seen)
            await self._bus.waiting.pause(0.01)
        raise RequestTimeout(keys.ROBOT_STATE.of(self.name), _STATE_S)

    def _held_lease(self) -> HeldLease:
        held = self.held
        if held is None:
            raise ValueError(f"a stream needs the lease of {self.name}: with robot.lease()")
        held.check()
        return held
