"""Modes, controller states and flags of a robot."""

from __future__ import annotations

from enum import IntFlag

from ._base import OpenEnum


class CommandMode(OpenEnum):
    """What kind of command the robot's agent follows."""

    INVALID_STATE = "invalid_state"
    """No motion is possible: a fault, no communication, or not ready."""
    HALT = "halt"
    """Standing still; the mode from which all others are entered."""
    JOG = "jog"
    """Point-to-point moves of single joints."""
    TRAJECTORY = "trajectory"
    """Timed trajectories."""
    POSITION_COMMAND = "position_command"
    """Streamed joint positions."""
    VELOCITY_COMMAND = "velocity_command"
    """Streamed joint velocities."""
    HOMING = "homing"
    """Searching the joints' reference positions."""


class OperationalMode(OpenEnum):
    """Where the controller's key switch stands."""

    UNDEFINED = "undefined"
    """Not known."""
    MANUAL_REDUCED_SPEED = "manual_reduced_speed"
    """By hand, at reduced speed."""
    MANUAL_FULL_SPEED = "manual_full_speed"
    """By hand, at full speed."""
    AUTO = "auto"
    """Automatic operation."""
    COBOT = "cobot"
    """Collaborative operation."""


class ControllerState(OpenEnum):
    """What the robot's controller does."""

    UNDEFINED = "undefined"
    """Not known: no communication."""
    INIT = "init"
    """Starting up."""
    MOTOR_ON = "motor_on"
    """Drives are on."""
    MOTOR_OFF = "motor_off"
    """Drives are off."""
    GUARD_STOP = "guard_stop"
    """Stopped by a safeguard or an error."""
    EMERGENCY_STOP = "emergency_stop"
    """Stopped by an emergency stop."""
    EMERGENCY_STOP_RESET = "emergency_stop_reset"
    """The emergency stop is being reset."""


class RobotFlags(IntFlag):
    """Conditions of a robot as a bit set; bits that this version does not know are kept."""

    NONE = 0
    """No bit set."""
    ERROR = 0x1
    """An error is present or latched."""
    FATAL_ERROR = 0x2
    """An error that no reset clears."""
    ESTOP = 0x4
    """An emergency stop or a latched stop is in force."""
    ESTOP_SOFTWARE = 0x800
    """The stop was asked for by software: Armada's own latch."""
    ESTOP_INTERNAL = 0x2000
    """The emergency stop came from the controller's own circuit."""
    ENABLED = 0x2_0000
    """Drives are on."""
    READY = 0x4_0000
    """The controller takes commands."""
    COMMUNICATION_FAILURE = 0x20_0000
    """No feedback has come for longer than the allowed time."""
    TRAJECTORY_RUNNING = 0x400_0000
    """A trajectory is in progress."""

    def names(self) -> list[str]:
        """Names on the wire of the bits that are set, lowest bit first."""
        return [name for name, bit in FLAG_NAMES if self & bit]


FLAG_NAMES: tuple[tuple[str, RobotFlags], ...] = tuple(
    (flag.name.lower(), flag)
    for flag in sorted(RobotFlags.__members__.values())
    if flag and flag.name
)
"""Every bit with its name on the wire, lowest bit first."""
