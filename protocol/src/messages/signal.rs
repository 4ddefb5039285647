//! Signals and parameters of a controller.

use serde::{Deserialize, Serialize};

use super::request::is_false;

/// An input, an output or a group of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SignalInfo {
    /// Name.
    pub name: String,
    /// What kind of value.
    #[serde(rename = "type")]
    pub signal_type: SignalType,
    /// Who may write it.
    pub access: AccessLevel,
    /// Unit of its numbers, such as `V`; empty if they have none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// Lowest value; none for digital signals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// Highest value; none for digital signals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// How many values: 1, 3 for a vector, 6 for a wrench, the number of bits of a port.
    pub size: u8,
    /// Whether it may be written while a stop is latched: a lamp, but nothing that moves.
    #[serde(default, skip_serializing_if = "is_false")]
    pub while_stopped: bool,
    /// For people.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
}

/// Kind of a signal.
///
/// Source: Robot Raconteur `com.robotraconteur.signal`, `SignalType`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SignalType {
    /// On or off.
    Digital,
    /// A number.
    Analog,
    /// Several digital signals together.
    DigitalPort,
    /// Several numbers together.
    AnalogPort,
    /// Three numbers.
    Vector3,
    /// Force \[N\] and torque \[Nm\], six numbers.
    Wrench,
}

/// Who may write a signal or parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AccessLevel {
    /// It can only be read.
    ReadOnly,
    /// It can be written while the robot does not move.
    Restricted,
    /// It can be written at any time.
    All,
}

/// Value of a signal or parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum SignalValue {
    /// On or off.
    Bool(bool),
    /// A number.
    Number(f64),
    /// Several digital signals.
    Bools(Vec<bool>),
    /// Several numbers.
    Numbers(Vec<f64>),
    /// A text.
    Text(String),
}

/// A setting of a controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterInfo {
    /// Name.
    pub name: String,
    /// What kind of value.
    #[serde(rename = "type")]
    pub parameter_type: ParameterType,
    /// Who may write it.
    pub access: AccessLevel,
    /// Unit of its numbers; empty if they have none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// Lowest value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// Highest value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// The values there are, in the order of their numbers; empty if any text or number is one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub choices: Vec<String>,
    /// Value after the controller's start.
    pub default: SignalValue,
    /// For people.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
}

/// Kind of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterType {
    /// On or off.
    Bool,
    /// A number.
    Number,
    /// A whole number.
    Integer,
    /// One of `choices`.
    Choice,
}

/// Parameters of `get_signal` and `get_param`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NameParams {
    /// Name of the signal or parameter.
    pub name: String,
}

/// Parameters of `set_signal` and `set_param`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetValueParams {
    /// Name of the signal or parameter.
    pub name: String,
    /// Its new value.
    pub value: SignalValue,
}

/// Answer of `get_signal`, `set_signal`, `get_param` and `set_param`: the value as the controller
/// has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NamedValue {
    /// Name of the signal or parameter.
    pub name: String,
    /// Its value.
    pub value: SignalValue,
}

/// Answer of `save_recording`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordingAnswer {
    /// The file, on the agent's machine.
    pub file: String,
    /// Ticks in it.
    pub ticks: u64,
}
