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
    ESTOP_BUTTON1 = 0x8
    """The first emergency stop button is pressed."""
    ESTOP_BUTTON2 = 0x10
    """The second emergency stop button is pressed."""
    ESTOP_BUTTON3 = 0x20
    """The third emergency stop button is pressed."""
    ESTOP_BUTTON4 = 0x40
    """The fourth emergency stop button is pressed."""
    ESTOP_GUARD1 = 0x80
    """The first guard is open."""
    ESTOP_GUARD2 = 0x100
    """The second guard is open."""
    ESTOP_GUARD3 = 0x200
    """The third guard is open."""
    ESTOP_GUARD4 = 0x400
    """The fourth guard is open."""
    ESTOP_SOFTWARE = 0x800
    """The stop was asked for by software: Armada's own latch."""
    ESTOP_FAULT = 0x1000
    """The emergency stop came from a fault of the controller."""
    ESTOP_INTERNAL = 0x2000
    """The emergency stop came from the controller's own circuit."""
    ESTOP_OTHER = 0x4000
    """The emergency stop came from elsewhere."""
    ESTOP_RELEASED = 0x8000
    """The emergency stop is released, and waits for the reset of its fault."""
    ENABLING_SWITCH = 0x1_0000
    """The enabling switch is held."""
    ENABLED = 0x2_0000
    """Drives are on."""
    READY = 0x4_0000
    """The controller takes commands."""
    HOMED = 0x8_0000
    """Every joint knows its reference."""
    HOMING_REQUIRED = 0x10_0000
    """A joint does not know its reference."""
    COMMUNICATION_FAILURE = 0x20_0000
    """No feedback has come for longer than the allowed time."""
    VALID_POSITION_COMMAND = 0x100_0000
    """A streamed position was followed in this tick."""
    VALID_VELOCITY_COMMAND = 0x200_0000
    """A streamed velocity was followed in this tick."""
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
