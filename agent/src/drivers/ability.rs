//! What a controller can do besides following set-points.

use armada_protocol::messages::{ParameterInfo, SignalInfo};

/// Most values of all signals of a controller together.
pub const MAX_SIGNAL_VALUES: usize = 32;
/// Most parameters of a controller.
pub const MAX_PARAMETERS: usize = 16;

/// What a controller can do besides following set-points; capabilities are derived from it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Abilities {
    /// It can search the references of its joints.
    pub homing: bool,
    /// It makes moves of its own to joint positions.
    pub move_joint: bool,
    /// It makes moves of its own to poses.
    pub move_pose: bool,
    /// It makes straight moves of its own.
    pub move_linear: bool,
    /// Its own moves can be paused and slowed down.
    pub pause: bool,
    /// It takes the load of tool and payload.
    pub load: bool,
    /// Its inputs and outputs; their sizes sum up to [`MAX_SIGNAL_VALUES`] at most.
    pub signals: Vec<SignalInfo>,
    /// Its settings, [`MAX_PARAMETERS`] at most.
    pub parameters: Vec<ParameterInfo>,
}
