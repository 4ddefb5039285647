//! Faults that can be injected into the emulated controller.

use std::fmt;
use std::str::FromStr;

use armada_model::MAX_JOINTS;
use armada_protocol::messages::OperationalMode;
use arrayvec::ArrayString;

use super::wire::{MAX_VALUE, mode_to_wire};

/// Longest silence that can be asked for \[ms\].
const MAX_SILENCE_MS: u32 = 60_000;
/// Largest extra latency in each direction \[ms\].
const MAX_LATENCY_MS: u32 = 500;
/// Longest name of a signal \[bytes\].
pub(super) const MAX_NAME: usize = 32;

/// A fault of the emulated controller, its robot or its network, or what a person does to it.
///
/// As text: `estop`, `estop_button=2`, `estop_fault`, `estop_other`, `estop_release`,
/// `guard_open=1`, `guard_close=1`, `enabling_hold`, `enabling_release`, `key_switch=auto`,
/// `local_on`, `local_off`,
/// `error=17`, `fatal_error=18`, `fatal_clear`, `homing_failure`, `homing_repair`,
/// `input=DI1:1`, `input=FT1[2]:-9.5`, `silence_ms=500`, `freeze`, `unfreeze`, `drives_off`,
/// `block_joint=2`, `unblock`, `latency_ms=30`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// The controller's own emergency stop acts: drives off, brakes.
    EmergencyStop,
    /// All emergency stops are released; drives stay off.
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
    /// This emergency stop button, 1 to 4, is pressed.
    EmergencyStopButton(u8),
    /// The emergency stop acts because of a fault in its circuit.
    EmergencyStopFault,
    /// The emergency stop acts because of something outside, such as another machine.
    EmergencyStopOther,
    /// This guard, 1 to 4, is opened.
    GuardOpen(u8),
    /// This guard is closed; the guard stop stays until it is reset.
    GuardClose(u8),
    /// The enabling switch is held.
    EnablingHold,
    /// The enabling switch is let go.
    EnablingRelease,
    /// The key switch is turned; it is never undefined.
    KeySwitch(OperationalMode),
    /// The pendant takes control: the robot stops, set-points are not taken any more.
    LocalOn,
    /// The pendant gives control back.
    LocalOff,
    /// An error of this number that no reset clears: drives off.
    FatalError(u32),
    /// The cause of the fatal error is gone; the error itself is still to be reset.
    FatalClear,
    /// Searches of references fail from now on, and one in progress.
    HomingFailure,
    /// Ends [`Fault::HomingFailure`].
    HomingRepair,
    /// An input gets a value.
    Input {
        /// Name of the signal.
        signal: ArrayString<MAX_NAME>,
        /// Which of its values, counted from 0.
        element: u8,
        /// The value; 0 or 1 for digital ones.
        value: f64,
    },
}

/// A text that is not a [`Fault`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FaultParseError {
    /// No fault has this form.
    #[error(
        "{text:?} is not a fault: give estop, estop_button=N, estop_fault, estop_other, \
         estop_release, guard_open=N, guard_close=N, enabling_hold, enabling_release, \
         key_switch=MODE, local_on, local_off, error=CODE, fatal_error=CODE, fatal_clear, homing_failure, \
         homing_repair, input=NAME:VALUE, silence_ms=MS, freeze, unfreeze, drives_off, \
         block_joint=INDEX, unblock or latency_ms=MS"
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
    /// The key switch has no such position.
    #[error(
        "key_switch={value}: expected manual_reduced_speed, manual_full_speed, auto or cobot"
    )]
    Mode {
        /// What stood after `=`, cut after 80 characters.
        value: String,
    },
    /// What is said of an input has another form.
    #[error("input={value}: expected NAME:VALUE or NAME[ELEMENT]:VALUE with a name of at most 32 bytes")]
    Input {
        /// What stood after `=`, cut after 80 characters.
        value: String,
    },
}

/// A fault as its fields on the wire; those that it does not use are zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct WireFault {
    pub(super) tag: u8,
    pub(super) number: u32,
    pub(super) value: f64,
    pub(super) name: ArrayString<MAX_NAME>,
}

/// What stands after the `=` of a fault.
#[derive(Clone, Copy)]
enum Argument {
    Nothing,
    Whole { min: u32, max: u32 },
    Mode,
}

/// Form of a fault as text and on the wire: name, tag, argument, and the fault of a number.
struct Form {
    name: &'static str,
    tag: u8,
    argument: Argument,
    make: fn(u32) -> Fault,
}

impl Form {
    const fn plain(name: &'static str, tag: u8, make: fn(u32) -> Fault) -> Self {
        Self { name, tag, argument: Argument::Nothing, make }
    }

    const fn whole(
        name: &'static str,
        tag: u8,
        (min, max): (u32, u32),
        make: fn(u32) -> Fault,
    ) -> Self {
        Self { name, tag, argument: Argument::Whole { min, max }, make }
    }
}

const MAX_JOINT_INDEX: u32 = MAX_JOINTS as u32 - 1;
const BUTTONS: (u32, u32) = (1, 4);
/// Name and tag of [`Fault::Input`], which alone has a name.
const INPUT: (&str, u8) = ("input", 23);
/// Positions of the key switch, as they are named and numbered.
const MODES: [(&str, OperationalMode); 4] = [
    ("manual_reduced_speed", OperationalMode::ManualReducedSpeed),
    ("manual_full_speed", OperationalMode::ManualFullSpeed),
    ("auto", OperationalMode::Auto),
    ("cobot", OperationalMode::Cobot),
];

/// Every fault there is but the input; the tags are part of the wire protocol and never reused. A
/// range holds the numbers of joints, buttons and guards below 256.
const FORMS: [Form; 24] = [
    Form::plain("estop", 1, |_| Fault::EmergencyStop),
    Form::plain("estop_release", 2, |_| Fault::EmergencyStopRelease),
    Form::whole("error", 3, (1, u32::MAX), Fault::ControllerError),
    Form::whole("silence_ms", 4, (1, MAX_SILENCE_MS), Fault::SilenceMs),
    Form::plain("freeze", 5, |_| Fault::Freeze),
    Form::plain("unfreeze", 6, |_| Fault::Unfreeze),
    Form::plain("drives_off", 7, |_| Fault::DrivesOff),
    Form::whole("block_joint", 8, (0, MAX_JOINT_INDEX), |n| Fault::BlockJoint(n as u8)),
    Form::plain("unblock", 9, |_| Fault::Unblock),
    Form::whole("latency_ms", 10, (0, MAX_LATENCY_MS), Fault::LatencyMs),
    Form::whole("estop_button", 11, BUTTONS, |n| Fault::EmergencyStopButton(n as u8)),
    Form::plain("estop_fault", 12, |_| Fault::EmergencyStopFault),
    Form::plain("estop_other", 13, |_| Fault::EmergencyStopOther),
    Form::whole("guard_open", 14, BUTTONS, |n| Fault::GuardOpen(n as u8)),
    Form::whole("guard_close", 15, BUTTONS, |n| Fault::GuardClose(n as u8)),
    Form::plain("enabling_hold", 16, |_| Fault::EnablingHold),
    Form::plain("enabling_release", 17, |_| Fault::EnablingRelease),
    Form { name: "key_switch", tag: 18, argument: Argument::Mode, make: key_switch },
    Form::whole("fatal_error", 19, (1, u32::MAX), Fault::FatalError),
    Form::plain("fatal_clear", 20, |_| Fault::FatalClear),
    Form::plain("homing_failure", 21, |_| Fault::HomingFailure),
    Form::plain("homing_repair", 22, |_| Fault::HomingRepair),
    Form::plain("local_on", 24, |_| Fault::LocalOn),
    Form::plain("local_off", 25, |_| Fault::LocalOff),
];

fn key_switch(number: u32) -> Fault {
    let of_number = |(_, mode): &&(&str, OperationalMode)| u32::from(mode_to_wire(*mode)) == number;
    Fault::KeySwitch(MODES.iter().find(of_number).map_or(OperationalMode::Undefined, |m| m.1))
}

impl Fault {
    /// Its fields on the wire.
    pub(super) fn to_wire(self) -> WireFault {
        let (tag, number) = match self {
            Self::EmergencyStop => (1, 0),
            Self::EmergencyStopRelease => (2, 0),
            Self::ControllerError(code) => (3, code),
            Self::SilenceMs(ms) => (4, ms),
            Self::Freeze => (5, 0),
            Self::Unfreeze => (6, 0),
            Self::DrivesOff => (7, 0),
            Self::BlockJoint(index) => (8, u32::from(index)),
            Self::Unblock => (9, 0),
            Self::LatencyMs(ms) => (10, ms),
            Self::EmergencyStopButton(button) => (11, u32::from(button)),
            Self::EmergencyStopFault => (12, 0),
            Self::EmergencyStopOther => (13, 0),
            Self::GuardOpen(guard) => (14, u32::from(guard)),
            Self::GuardClose(guard) => (15, u32::from(guard)),
            Self::EnablingHold => (16, 0),
            Self::EnablingRelease => (17, 0),
            Self::KeySwitch(mode) => (18, u32::from(mode_to_wire(mode))),
            Self::FatalError(code) => (19, code),
            Self::FatalClear => (20, 0),
            Self::HomingFailure => (21, 0),
            Self::HomingRepair => (22, 0),
            Self::LocalOn => (24, 0),
            Self::LocalOff => (25, 0),
            Self::Input { signal, element, value } => {
                let number = u32::from(element);
                return WireFault { tag: INPUT.1, number, value, name: signal };
            }
        };
        WireFault { tag, number, ..WireFault::default() }
    }

    /// The fault with these fields, if there is one and they lie in their ranges.
    pub(super) fn from_wire(wire: &WireFault) -> Option<Self> {
        let WireFault { tag, number, value, name } = *wire;
        if tag == INPUT.1 {
            let element = u8::try_from(number).ok()?;
            return (!name.is_empty()).then_some(Self::Input { signal: name, element, value });
        }
        let form = FORMS.iter().find(|form| form.tag == tag)?;
        let (min, max) = match form.argument {
            Argument::Nothing => (0, 0),
            Argument::Whole { min, max } => (min, max),
            Argument::Mode => BUTTONS, // positions count from 1 to 4 too
        };
        let unused = value.to_bits() == 0 && name.is_empty();
        ((min..=max).contains(&number) && unused).then(|| (form.make)(number))
    }
}

impl FromStr for Fault {
    type Err = FaultParseError;

    fn from_str(text: &str) -> Result<Self, FaultParseError> {
        let (name, value) = match text.split_once('=') {
            Some((name, value)) => (name, Some(value)),
            None => (text, None),
        };
        let unknown = || FaultParseError::Unknown { text: cut(text) };
        if name == INPUT.0 {
            let value = value.unwrap_or_default();
            return input(value).ok_or_else(|| FaultParseError::Input { value: cut(value) });
        }
        let form = FORMS.iter().find(|form| form.name == name).ok_or_else(unknown)?;
        let given = value.unwrap_or_default();
        match form.argument {
            Argument::Nothing if value.is_some() => Err(unknown()),
            Argument::Nothing => Ok((form.make)(0)),
            Argument::Mode => match MODES.iter().find(|(name, _)| *name == given) {
                Some(&(_, mode)) => Ok(Self::KeySwitch(mode)),
                None => Err(FaultParseError::Mode { value: cut(given) }),
            },
            Argument::Whole { min, max } => match given.parse() {
                Ok(number) if (min..=max).contains(&number) => Ok((form.make)(number)),
                _ => Err(FaultParseError::Value { name: form.name, value: cut(given), min, max }),
            },
        }
    }
}

/// `NAME:VALUE` or `NAME[ELEMENT]:VALUE`.
fn input(text: &str) -> Option<Fault> {
    let (place, value) = text.rsplit_once(':')?;
    let value: f64 = value.parse().ok()?;
    let (name, element) = match place.strip_suffix(']') {
        Some(place) => {
            let (name, element) = place.rsplit_once('[')?;
            (name, element.parse().ok()?)
        }
        None => (place, 0),
    };
    let signal = ArrayString::from(name).ok()?;
    let usable = !name.is_empty() && (-MAX_VALUE..=MAX_VALUE).contains(&value);
    usable.then_some(Fault::Input { signal, element, value })
}

fn cut(text: &str) -> String {
    text.chars().take(80).collect()
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Input { signal, element: 0, value } => return write!(f, "input={signal}:{value}"),
            Self::Input { signal, element, value } => {
                return write!(f, "input={signal}[{element}]:{value}");
            }
            Self::KeySwitch(mode) => {
                let name = MODES.iter().find(|known| known.1 == mode).map_or("undefined", |m| m.0);
                return write!(f, "key_switch={name}");
            }
            _ => {}
        }
        let WireFault { tag, number, .. } = self.to_wire();
        match FORMS.iter().find(|form| form.tag == tag) {
            Some(Form { name, argument: Argument::Nothing, .. }) => f.write_str(name),
            Some(Form { name, .. }) => write!(f, "{name}={number}"),
            None => write!(f, "fault {tag}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn survives(fault: Fault) {
        assert_eq!(fault.to_string().parse(), Ok(fault));
        assert_eq!(Fault::from_wire(&fault.to_wire()), Some(fault));
    }

    #[test]
    fn every_fault_survives_text_and_wire() {
        for form in &FORMS {
            let number = match form.argument {
                Argument::Nothing => 0,
                Argument::Whole { max, .. } => max,
                Argument::Mode => 4,
            };
            let fault = (form.make)(number);
            assert_eq!(fault.to_wire().tag, form.tag, "{fault}");
            survives(fault);
        }
        let signal = ArrayString::from("FT1").expect("short");
        survives(Fault::Input { signal, element: 0, value: 1.0 });
        survives(Fault::Input { signal, element: 2, value: -9.5 });
    }

    #[test]
    fn an_unknown_fault_is_answered_with_the_known_forms() {
        let message = "explode".parse::<Fault>().expect_err("no such fault").to_string();
        assert!(message.starts_with("\"explode\" is not a fault: give estop, "), "{message}");
        for name in FORMS.iter().map(|form| form.name).chain([INPUT.0]) {
            assert!(message.contains(name), "{name} is not listed in {message}");
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
            ("estop_button=5", "from 1 to 4"),
            ("guard_open=0", "from 1 to 4"),
            ("key_switch=off", "manual_reduced_speed, manual_full_speed, auto or cobot"),
            ("input=DI1", "NAME:VALUE"),
            ("input=:1", "NAME:VALUE"),
            ("input=DI1:nan", "NAME:VALUE"),
            ("input=DI1[x]:1", "NAME:VALUE"),
        ] {
            let message = text.parse::<Fault>().expect_err(text).to_string();
            assert!(message.contains(range), "{text}: {message}");
        }
    }

    #[test]
    fn fields_outside_their_range_are_no_fault_on_the_wire_either() {
        let wire = |tag, number| WireFault { tag, number, ..WireFault::default() };
        for refused in [
            wire(8, 16),
            wire(1, 1),
            wire(0, 0),
            wire(26, 0),
            wire(18, 0),
            wire(18, 5),
            wire(INPUT.1, 0),
            WireFault { value: 1.0, ..wire(1, 0) },
            WireFault { value: -0.0, ..wire(1, 0) },
        ] {
            assert_eq!(Fault::from_wire(&refused), None, "{refused:?}");
        }
    }
}
