"""Streams of commands to a robot."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from armada._waiting import run
from armada.messages import CommandMode

from .opened import opened
from .robot_base import RobotBase
from .stream import CommandStream, PositionStream, TwistStream, VelocityStream


class RobotStreams(RobotBase):
    """Streams of commands: to be used in a `with`, inside that of a lease.

    They enter their mode when they are opened, through halt where needed, and raise `ValueError` if
    no lease is held.
    """

    def stream_position(self) -> PositionStream:
        """A stream of the positions of all joints, in mode `position_command`."""
        return PositionStream(run(opened(self._inner.stream_position())))

    def stream_velocity(self) -> VelocityStream:
        """A stream of the speeds of all joints, in mode `velocity_command`."""
        return VelocityStream(run(opened(self._inner.stream_velocity())))

    def stream_twist(self) -> TwistStream:
        """A stream of speeds of tools, in mode `velocity_command`."""
        return TwistStream(run(opened(self._inner.stream_twist())))

    def stream_command(self, mode: CommandMode = CommandMode.POSITION_COMMAND) -> CommandStream:
        """A stream of commands to any joints by name.

        In mode `position_command` positions count, in mode `velocity_command` velocities.
        """
        return CommandStream(run(opened(self._inner.stream_command(mode))))

    def command(
        self,
        name: Sequence[str],
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
    ) -> None:
        """Sends one command to joints by name, entering the mode for it where needed.

        That is `position_command` if there are positions, else `velocity_command`. To send many,
        use `stream_command`.
        """
        run(self._inner.command(name, position, velocity))
