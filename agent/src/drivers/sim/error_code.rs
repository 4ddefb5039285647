//! Errors the emulated controller makes itself; injected ones may have any number.

/// Commands went silent in motion.
pub const WATCHDOG: u32 = 101;
/// A joint went, or was commanded, past its position limit.
pub const JOINT_LIMIT: u32 = 102;
/// A joint was too far from its reference.
pub const FOLLOWING_ERROR: u32 = 103;
/// A joint did not find its reference.
pub const HOMING: u32 = 104;
/// A move of its own goes where the arm cannot reach, or not on this way.
pub const UNREACHABLE: u32 = 201;
/// A move of its own leaves the limits of a joint.
pub const OUT_OF_LIMITS: u32 = 202;
/// A move of its own came while drives were off or a stop or error was in force.
pub const NOT_READY: u32 = 203;
/// A move of its own came while something else moved the robot.
pub const NOT_AT_REST: u32 = 204;
/// There is no chain of this number, or it has joints that the robot does not drive.
pub const NO_CHAIN: u32 = 205;
/// A move of its own came before all joints were homed.
pub const NOT_HOMED: u32 = 206;
/// No motion was found for a move of its own.
pub const NO_MOTION: u32 = 207;
/// A move of its own was cut off: drives went off, or a guard was opened.
pub const INTERRUPTED: u32 = 208;
/// More moves of its own than it keeps.
pub const TOO_MANY_MOVES: u32 = 209;
/// It makes no moves of its own.
pub const NOT_OFFERED: u32 = 210;
