//! Values of signals and settings as they are typed and printed.

use armada_protocol::messages::{ParameterType, SignalType, SignalValue};

use crate::exit::UsageError;

/// What kind of value is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Switch,
    Number,
    Switches,
    Numbers,
    Text,
}

impl Kind {
    /// The kind of a signal's value.
    pub(super) const fn of_signal(signal: SignalType) -> Self {
        match signal {
            SignalType::Digital => Self::Switch,
            SignalType::Analog => Self::Number,
            SignalType::DigitalPort => Self::Switches,
            SignalType::AnalogPort | SignalType::Vector3 | SignalType::Wrench => Self::Numbers,
        }
    }

    /// The kind of a setting's value.
    pub(super) const fn of_parameter(parameter: ParameterType) -> Self {
        match parameter {
            ParameterType::Bool => Self::Switch,
            ParameterType::Number | ParameterType::Integer => Self::Number,
            ParameterType::Choice => Self::Text,
        }
    }

    /// The value that a text means.
    pub(super) fn parse(self, text: &str) -> Result<SignalValue, UsageError> {
        let each = || text.split(',').map(str::trim);
        Ok(match self {
            Self::Switch => SignalValue::Bool(switch(text)?),
            Self::Number => SignalValue::Number(number(text)?),
            Self::Switches => SignalValue::Bools(each().map(switch).collect::<Result<_, _>>()?),
            Self::Numbers => SignalValue::Numbers(each().map(number).collect::<Result<_, _>>()?),
            Self::Text => SignalValue::Text(text.to_owned()),
        })
    }
}

fn switch(text: &str) -> Result<bool, UsageError> {
    match text {
        "on" | "true" | "1" => Ok(true),
        "off" | "false" | "0" => Ok(false),
        _ => Err(UsageError(format!("{text:?} is neither on nor off"))),
    }
}

fn number(text: &str) -> Result<f64, UsageError> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| UsageError(format!("{text:?} is not a number")))
}

/// The value for people.
pub(super) fn text(value: &SignalValue) -> String {
    const fn switch(on: bool) -> &'static str {
        if on { "on" } else { "off" }
    }
    match value {
        SignalValue::Bool(on) => switch(*on).to_owned(),
        SignalValue::Number(value) => value.to_string(),
        SignalValue::Bools(values) => {
            values.iter().map(|&on| switch(on)).collect::<Vec<_>>().join(" ")
        }
        SignalValue::Numbers(values) => {
            values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
        }
        SignalValue::Text(text) => text.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_read_as_its_kind() {
        for (kind, text, value) in [
            (Kind::Switch, "on", SignalValue::Bool(true)),
            (Kind::Number, "-2.5", SignalValue::Number(-2.5)),
            (Kind::Switches, "1, 0", SignalValue::Bools(vec![true, false])),
            (Kind::Numbers, "1,0", SignalValue::Numbers(vec![1.0, 0.0])),
            (Kind::Text, "1", SignalValue::Text("1".to_owned())),
        ] {
            assert_eq!(kind.parse(text).expect(text), value);
        }
        assert!(Kind::Switch.parse("maybe").is_err());
        assert!(Kind::Number.parse("NaN").is_err());
    }

    #[test]
    fn a_value_is_printed_as_it_is_typed() {
        for (kind, typed) in [(Kind::Switch, "on"), (Kind::Number, "-2.5"), (Kind::Text, "low")] {
            assert_eq!(text(&kind.parse(typed).expect(typed)), typed);
        }
        assert_eq!(text(&SignalValue::Bools(vec![true, false])), "on off");
        assert_eq!(text(&SignalValue::Numbers(vec![0.5, -1.0])), "0.5 -1");
    }
}
