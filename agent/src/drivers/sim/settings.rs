//! Signals, parameters and homing of the emulated controller, as the robot file gives them.

use armada_protocol::messages::{
    AccessLevel, ParameterInfo, ParameterType, SignalInfo, SignalType, SignalValue,
};
use serde::Deserialize;

use super::fault::MAX_NAME;
use super::wire::MAX_VALUE;
use crate::config::{Problem, check_range};
use crate::drivers::{MAX_PARAMETERS, MAX_SIGNAL_VALUES};
use armada_model::MAX_JOINTS;

/// An input or output of the emulated controller.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SignalConfig {
    /// Name, at most 32 bytes.
    pub name: String,
    /// What kind of value.
    #[serde(rename = "type")]
    pub signal_type: SignalType,
    /// `read_only` for an input, the default; `restricted` and `all` for an output.
    #[serde(default = "read_only")]
    pub access: AccessLevel,
    /// Unit of its numbers; none by default.
    #[serde(default)]
    pub unit: String,
    /// Lowest number; none by default.
    #[serde(default)]
    pub min: Option<f64>,
    /// Highest number; none by default.
    #[serde(default)]
    pub max: Option<f64>,
    /// Number of values of a port, 1 to 16; the other types have one of their own.
    #[serde(default)]
    pub size: Option<u8>,
    /// Whether an output may be written while a stop is latched, such as a lamp; false by default.
    #[serde(default)]
    pub while_stopped: bool,
    /// For people.
    #[serde(default)]
    pub description: String,
}

/// A setting of the emulated controller.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterConfig {
    /// Name.
    pub name: String,
    /// What kind of value.
    #[serde(rename = "type")]
    pub parameter_type: ParameterType,
    /// Value at the controller's start.
    pub default: SignalValue,
    /// Who may write it; `all` by default.
    #[serde(default = "all")]
    pub access: AccessLevel,
    /// Unit of its numbers; none by default.
    #[serde(default)]
    pub unit: String,
    /// Lowest number; none by default.
    #[serde(default)]
    pub min: Option<f64>,
    /// Highest number; none by default.
    #[serde(default)]
    pub max: Option<f64>,
    /// The texts there are, for a choice.
    #[serde(default)]
    pub choices: Vec<String>,
    /// For people.
    #[serde(default)]
    pub description: String,
}

/// How the emulated joints get to know where they are.
///
/// Until a joint is homed its encoder is off by `offset_rad` or `offset_m`. Reported positions and
/// set-points are off by the same, so an arm that is not homed can be moved by set-points; it makes
/// no moves of its own. When a joint finds its reference, its reported position jumps by the offset.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HomingConfig {
    /// Whether joints must be homed after the controller's start; default false.
    pub required: bool,
    /// Speed of the search over the joint's limit, 0.001 to 1; default 0.1.
    pub speed_share: f64,
    /// Distance between reference marks of joints that turn \[rad\], above 0; default 0.2. A joint
    /// goes to the next mark above, or below if that is beyond its limit.
    pub spacing_rad: f64,
    /// The same for joints that slide \[m\]; default 0.02.
    pub spacing_m: f64,
    /// Error of the position of a joint that turns and is not homed \[rad\]; default 0.002.
    pub offset_rad: f64,
    /// The same for joints that slide \[m\]; default 0.0005.
    pub offset_m: f64,
}

impl Default for HomingConfig {
    fn default() -> Self {
        Self {
            required: false,
            speed_share: 0.1,
            spacing_rad: 0.2,
            spacing_m: 0.02,
            offset_rad: 0.002,
            offset_m: 0.0005,
        }
    }
}

impl HomingConfig {
    pub(super) fn check(&self) -> Result<(), Problem> {
        check_range("speed_share", self.speed_share, 1e-3..=1.0)?;
        check_range("spacing_rad", self.spacing_rad, 1e-3..=10.0)?;
        check_range("spacing_m", self.spacing_m, 1e-4..=10.0)?;
        check_range("offset_rad", self.offset_rad, -0.1..=0.1)?;
        check_range("offset_m", self.offset_m, -0.1..=0.1)
    }
}

const fn read_only() -> AccessLevel {
    AccessLevel::ReadOnly
}

const fn all() -> AccessLevel {
    AccessLevel::All
}

impl SignalConfig {
    fn new(name: &str, signal_type: SignalType, access: AccessLevel) -> Self {
        let analog = signal_type == SignalType::Analog;
        Self {
            name: name.to_owned(),
            signal_type,
            access,
            unit: if analog { "V".to_owned() } else { String::new() },
            min: analog.then_some(0.0),
            max: analog.then_some(10.0),
            size: None,
            while_stopped: false,
            description: String::new(),
        }
    }

    /// Number of its values.
    fn size(&self) -> u8 {
        match self.signal_type {
            SignalType::Digital | SignalType::Analog => 1,
            SignalType::Vector3 => 3,
            SignalType::Wrench => 6,
            SignalType::DigitalPort | SignalType::AnalogPort => self.size.unwrap_or(1),
        }
    }

    fn check(&self) -> Result<(), Problem> {
        check_name(&self.name)?;
        let port = matches!(self.signal_type, SignalType::DigitalPort | SignalType::AnalogPort);
        match self.size {
            Some(size) if port => check_range("size", f64::from(size), 1.0..=MAX_JOINTS as f64)?,
            Some(_) => return Err(Problem::new("size", "is for ports only")),
            None if port => return Err(Problem::new("size", "is missing, a port needs it")),
            None => {}
        }
        check_bounds(self.min, self.max)
    }

    fn info(&self) -> SignalInfo {
        SignalInfo {
            name: self.name.clone(),
            signal_type: self.signal_type,
            access: self.access,
            unit: self.unit.clone(),
            min: self.min,
            max: self.max,
            size: self.size(),
            while_stopped: self.while_stopped,
            description: self.description.clone(),
        }
    }
}

impl ParameterConfig {
    fn check(&self) -> Result<(), Problem> {
        check_name(&self.name)?;
        check_bounds(self.min, self.max)?;
        if (self.parameter_type == ParameterType::Choice) == self.choices.is_empty() {
            return Err(Problem::new("choices", "are for a choice, which needs them"));
        }
        let info = self.info();
        match number_of(&info).filter(|&value| allows(&info, value)) {
            Some(_) => Ok(()),
            None => Err(Problem::new("default", "is not a value that the parameter may have")),
        }
    }

    fn info(&self) -> ParameterInfo {
        ParameterInfo {
            name: self.name.clone(),
            parameter_type: self.parameter_type,
            access: self.access,
            unit: self.unit.clone(),
            min: self.min,
            max: self.max,
            choices: self.choices.clone(),
            default: self.default.clone(),
            description: self.description.clone(),
        }
    }
}

/// The default of a parameter as a number; `None` if it is of another type.
pub(super) fn number_of(info: &ParameterInfo) -> Option<f64> {
    match (info.parameter_type, &info.default) {
        (ParameterType::Bool, SignalValue::Bool(on)) => Some(f64::from(u8::from(*on))),
        (ParameterType::Number | ParameterType::Integer, SignalValue::Number(value)) => {
            Some(*value)
        }
        (ParameterType::Choice, SignalValue::Text(text)) => {
            info.choices.iter().position(|choice| choice == text).map(|place| place as f64)
        }
        _ => None,
    }
}

/// Whether a parameter may have this value.
pub(super) fn allows(info: &ParameterInfo, value: f64) -> bool {
    let whole = value.fract() == 0.0;
    match info.parameter_type {
        ParameterType::Bool => value == 0.0 || value == 1.0,
        ParameterType::Number => lies_within(info.min, info.max, value),
        ParameterType::Integer => whole && lies_within(info.min, info.max, value),
        ParameterType::Choice => whole && (0.0..info.choices.len() as f64).contains(&value),
    }
}

pub(super) fn lies_within(min: Option<f64>, max: Option<f64>, value: f64) -> bool {
    (min.unwrap_or(-MAX_VALUE)..=max.unwrap_or(MAX_VALUE)).contains(&value)
}

/// Four digital inputs and outputs, and an analogue one of each.
pub(super) fn default_signals() -> Vec<SignalConfig> {
    let digital = |(name, access)| SignalConfig::new(name, SignalType::Digital, access);
    let (read, write) = (AccessLevel::ReadOnly, AccessLevel::All);
    let inputs = ["DI1", "DI2", "DI3", "DI4"].map(|name| (name, read));
    let outputs = ["DO1", "DO2", "DO3", "DO4"].map(|name| (name, write));
    let analog = [
        SignalConfig::new("AI1", SignalType::Analog, read),
        SignalConfig::new("AO1", SignalType::Analog, write),
    ];
    inputs.into_iter().chain(outputs).map(digital).chain(analog).collect()
}

/// One parameter of each type.
pub(super) fn default_parameters() -> Vec<ParameterConfig> {
    let parameter = |name: &str, parameter_type, default| ParameterConfig {
        name: name.to_owned(),
        parameter_type,
        default,
        access: AccessLevel::All,
        unit: String::new(),
        min: None,
        max: None,
        choices: Vec::new(),
        description: String::new(),
    };
    let number = SignalValue::Number;
    vec![
        parameter("collision_detection", ParameterType::Bool, SignalValue::Bool(true)),
        ParameterConfig {
            min: Some(0.0),
            max: Some(1.0),
            ..parameter("collision_sensitivity", ParameterType::Number, number(0.5))
        },
        ParameterConfig {
            choices: ["stop", "retract", "ignore"].map(str::to_owned).to_vec(),
            access: AccessLevel::Restricted,
            ..parameter(
                "collision_response",
                ParameterType::Choice,
                SignalValue::Text("stop".to_owned()),
            )
        },
        ParameterConfig {
            min: Some(1.0),
            max: Some(8.0),
            access: AccessLevel::Restricted,
            ..parameter("payload_slot", ParameterType::Integer, number(1.0))
        },
    ]
}

/// The signals as the robot's description has them.
pub(super) fn signal_infos(signals: &[SignalConfig]) -> Vec<SignalInfo> {
    signals.iter().map(SignalConfig::info).collect()
}

/// The parameters likewise.
pub(super) fn parameter_infos(parameters: &[ParameterConfig]) -> Vec<ParameterInfo> {
    parameters.iter().map(ParameterConfig::info).collect()
}

pub(super) fn check_signals(signals: &[SignalConfig]) -> Result<(), Problem> {
    check_each("signals", signals, |signal| &signal.name, SignalConfig::check)?;
    let values: usize = signals.iter().map(|signal| usize::from(signal.size())).sum();
    if values > MAX_SIGNAL_VALUES {
        let text = format!("{values} values together, above the limit {MAX_SIGNAL_VALUES}");
        return Err(Problem::new("signals", text));
    }
    Ok(())
}

pub(super) fn check_parameters(parameters: &[ParameterConfig]) -> Result<(), Problem> {
    check_each("parameters", parameters, |parameter| &parameter.name, ParameterConfig::check)?;
    if parameters.len() > MAX_PARAMETERS {
        let text = format!("{}, above the limit {MAX_PARAMETERS}", parameters.len());
        return Err(Problem::new("parameters", text));
    }
    Ok(())
}

/// Checks each entry of a list, and that no name is given twice.
fn check_each<T>(
    list: &str,
    entries: &[T],
    name: impl Fn(&T) -> &str,
    check: impl Fn(&T) -> Result<(), Problem>,
) -> Result<(), Problem> {
    for (index, entry) in entries.iter().enumerate() {
        let at = |problem: Problem| problem.under(&index.to_string()).under(list);
        check(entry).map_err(at)?;
        if entries.iter().take(index).any(|earlier| name(earlier) == name(entry)) {
            return Err(at(Problem::new("name", format!("{:?} is given twice", name(entry)))));
        }
    }
    Ok(())
}

fn check_name(name: &str) -> Result<(), Problem> {
    if (1..=MAX_NAME).contains(&name.len()) {
        return Ok(());
    }
    Err(Problem::new("name", format!("{} bytes long, outside 1 to {MAX_NAME}", name.len())))
}

fn check_bounds(min: Option<f64>, max: Option<f64>) -> Result<(), Problem> {
    for (field, value) in [("min", min), ("max", max)] {
        if let Some(value) = value {
            check_range(field, value, -MAX_VALUE..=MAX_VALUE)?;
        }
    }
    match (min, max) {
        (Some(min), Some(max)) if min > max => {
            Err(Problem::new("min", format!("{min} is above max {max}")))
        }
        _ => Ok(()),
    }
}
