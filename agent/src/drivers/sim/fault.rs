//! Faults that can be injected into the emulated controller.

use std::fmt;
use std::str::FromStr;

use armada_model::MAX_JOINTS;

/// Longest silence that can be asked for \[ms\].
const MAX_SILENCE_MS: u32 = 60_000;
/// Largest extra latency in each direction \[ms\].
const MAX_LATENCY_MS: u32 = 500;

/// A fault of the emulated controller, its robot or its network.
///
/// As text: `estop`, `estop_release`, `error=17`, `silence_ms=500`, `freeze`, `unfreeze`,
/// `drives_off`, `block_joint=2`, `unblock`, `latency_ms=30`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The emergency stop is pressed: drives off, brakes.
    EmergencyStop,
    /// The emergency stop is released; drives stay off.
    EmergencyStopRelease,
    /// The controller reports this error of its own numbering, above 0, and switches drives off.
    ControllerError(u32),
    /// No packet passes in either direction for this time \[ms\].
    SilenceMs(u32),
    /// The reported measurements stand still while the robot goes on.
    Freeze,
    /// Ends [`Fault::Freeze`].
    Unfreeze,
    /// Drives go off without an error, as if switched off at the controller.
    DrivesOff,
    /// This joint, counted from 0, is mechanically blocked.
    BlockJoint(u8),
    /// No joint is blocked any longer.
    Unblock,
    /// Extra latency in each direction from now on \[ms\]; 0 ends it.
    LatencyMs(u32),
}

/// A text that is not a [`Fault`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FaultParseError {
    /// No fault has this form.
    #[error(
        "{text:?} is not a fault: give estop, estop_release, error=CODE, silence_ms=MS, freeze, \
         unfreeze, drives_off, block_joint=INDEX, unblock or latency_ms=MS"
    )]
    Unknown {
        /// The text, cut after 80 characters.
        text: String,
    },
    /// The number after `=` is missing, is not whole or lies outside the range.
    #[error("{name}={value}: expected a whole number from {min} to {max}")]
    Value {
        /// Name of the fault.
        name: &'static str,
        /// What stood after `=`, cut after 80 characters.
        value: String,
        /// Least number.
        min: u32,
        /// Greatest number.
        max: u32,
    },
}

/// Form of a fault as text and on the wire: name, tag, range of its number (`None`: it has none).
struct Form {
    name: &'static str,
    tag: u8,
    range: Option<(u32, u32)>,
    make: fn(u32) -> Fault,
}

const MAX_JOINT_INDEX: u32 = MAX_JOINTS as u32 - 1;

/// Every fault there is; the tags are part of the wire protocol and never reused.
const FORMS: [Form; 10] = [
    Form { name: "estop", tag: 1, range: None, make: |_| Fault::EmergencyStop },
    Form { name: "estop_release", tag: 2, range: None, make: |_| Fault::EmergencyStopRelease },
    Form { name: "error", tag: 3, range: Some((1, u32::MAX)), make: Fault::ControllerError },
    Form { name: "silence_ms", tag: 4, range: Some((1, MAX_SILENCE_MS)), make: Fault::SilenceMs },
    Form { name: "freeze", tag: 5, range: None, make: |_| Fault::Freeze },
    Form { name: "unfreeze", tag: 6, range: None, make: |_| Fault::Unfreeze },
    Form { name: "drives_off", tag: 7, range: None, make: |_| Fault::DrivesOff },
    Form {
        name: "block_joint",
        tag: 8,
        range: Some((0, MAX_JOINT_INDEX)),
        make: |index| Fault::BlockJoint(index as u8), // the range holds it below 256
    },
    Form { name: "unblock", tag: 9, range: None, make: |_| Fault::Unblock },
    Form { name: "latency_ms", tag: 10, range: Some((0, MAX_LATENCY_MS)), make: Fault::LatencyMs },
];

impl Fault {
    /// Tag and number on the wire.
    pub(super) const fn to_wire(self) -> (u8, u32) {
        match self {
            Self::EmergencyStop => (1, 0),
            Self::EmergencyStopRelease => (2, 0),
            Self::ControllerError(code) => (3, code),
            Self::SilenceMs(ms) => (4, ms),
            Self::Freeze => (5, 0),
            Self::Unfreeze => (6, 0),
            Self::DrivesOff => (7, 0),
            Self::BlockJoint(index) => (8, index as u32),
            Self::Unblock => (9, 0),
            Self::LatencyMs(ms) => (10, ms),
        }
    }

    /// The fault with this tag, if there is one and the number lies in its range.
    pub(super) fn from_wire(tag: u8, value: u32) -> Option<Self> {
        let form = FORMS.iter().find(|form| form.tag == tag)?;
        let (min, max) = form.range.unwrap_or((0, 0));
        (min..=max).contains(&value).then(|| (form.make)(value))
    }
}

impl FromStr for Fault {
    type Err = FaultParseError;

    fn from_str(text: &str) -> Result<Self, FaultParseError> {
        let (name, value) = match text.split_once('=') {
            Some((name, value)) => (name, Some(value)),
            None => (text, None),
        };
        let unknown = || FaultParseError::Unknown { text: text.chars().take(80).collect() };
        let form = FORMS.iter().find(|form| form.name == name).ok_or_else(unknown)?;
        let Some((min, max)) = form.range else {
            return if value.is_none() { Ok((form.make)(0)) } else { Err(unknown()) };
        };
        let value = value.unwrap_or_default();
        match value.parse() {
            Ok(number) if (min..=max).contains(&number) => Ok((form.make)(number)),
            _ => Err(FaultParseError::Value {
                name: form.name,
                value: value.chars().take(80).collect(),
                min,
                max,
            }),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (tag, value) = self.to_wire();
        match FORMS.iter().find(|form| form.tag == tag) {
            Some(Form { name, range: Some(_), .. }) => write!(f, "{name}={value}"),
            Some(Form { name, range: None, .. }) => f.write_str(name),
            None => write!(f, "fault {tag}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_survives_text_and_wire() {
        for form in &FORMS {
            let fault = (form.make)(form.range.map_or(0, |(_, max)| max));
            assert_eq!(fault.to_string().parse(), Ok(fault));
            let (tag, value) = fault.to_wire();
            assert_eq!(tag, form.tag, "{fault}");
            assert_eq!(Fault::from_wire(tag, value), Some(fault));
        }
    }

    #[test]
    fn an_unknown_fault_is_answered_with_the_known_forms() {
        let message = "explode".parse::<Fault>().expect_err("no such fault").to_string();
        assert!(message.starts_with("\"explode\" is not a fault: give estop, "), "{message}");
        for form in &FORMS {
            assert!(message.contains(form.name), "{} is not listed in {message}", form.name);
        }
        assert!("estop=1".parse::<Fault>().is_err());
        assert!("".parse::<Fault>().is_err());
    }

    #[test]
    fn a_number_outside_its_range_is_refused_with_the_range() {
        for (text, range) in [
            ("error=0", "from 1 to 4294967295"),
            ("error", "from 1 to"),
            ("silence_ms=60001", "from 1 to 60000"),
            ("block_joint=16", "from 0 to 15"),
            ("block_joint=-1", "from 0 to 15"),
            ("latency_ms=1e3", "from 0 to 500"),
        ] {
            let message = text.parse::<Fault>().expect_err(text).to_string();
            assert!(message.contains(range), "{text}: {message}");
        }
    }

    #[test]
    fn numbers_outside_their_range_are_no_fault_on_the_wire_either() {
        assert_eq!(Fault::from_wire(8, 16), None);
        assert_eq!(Fault::from_wire(1, 1), None);
        assert_eq!(Fault::from_wire(0, 0), None);
        assert_eq!(Fault::from_wire(11, 0), None);
    }
}
