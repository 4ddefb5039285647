//! Values as clients write them, and as the numbers that a controller takes.

use armada_protocol::messages::{
    Denial, DenialCode, ParameterInfo, ParameterType, SignalInfo, SignalType, SignalValue,
};

/// The numbers of a signal's value, if it is of the signal's type, size and range.
pub(super) fn numbers_of(info: &SignalInfo, value: &SignalValue) -> Result<Vec<f64>, Denial> {
    let on_off = |on: &bool| if *on { 1.0 } else { 0.0 };
    let numbers: Vec<f64> = match (info.signal_type, value) {
        (SignalType::Digital, SignalValue::Bool(on)) => vec![on_off(on)],
        (SignalType::Analog, SignalValue::Number(number)) => vec![*number],
        (SignalType::DigitalPort, SignalValue::Bools(all)) => all.iter().map(on_off).collect(),
        (
            SignalType::AnalogPort | SignalType::Vector3 | SignalType::Wrench,
            SignalValue::Numbers(all),
        ) => all.clone(),
        // An empty list is of no type.
        (_, SignalValue::Bools(all)) if all.is_empty() => Vec::new(),
        _ => return Err(wrong_type(&info.name, signal_form(info))),
    };
    if numbers.len() != usize::from(info.size) {
        return Err(wrong_type(&info.name, signal_form(info)));
    }
    for &number in &numbers {
        check_range(&info.name, number, (info.min, info.max))?;
    }
    Ok(numbers)
}

/// A signal's value, from the numbers that the controller reports.
pub(super) fn signal_value(info: &SignalInfo, numbers: &[f64]) -> SignalValue {
    let first = numbers.first().copied().unwrap_or_default();
    match info.signal_type {
        SignalType::Digital => SignalValue::Bool(first != 0.0),
        SignalType::Analog => SignalValue::Number(first),
        SignalType::DigitalPort => {
            SignalValue::Bools(numbers.iter().map(|number| *number != 0.0).collect())
        }
        SignalType::AnalogPort | SignalType::Vector3 | SignalType::Wrench => {
            SignalValue::Numbers(numbers.to_vec())
        }
    }
}

/// The number of a parameter's value, if it is of the parameter's type and range.
pub(super) fn number_of(info: &ParameterInfo, value: &SignalValue) -> Result<f64, Denial> {
    let number = match (info.parameter_type, value) {
        (ParameterType::Bool, SignalValue::Bool(on)) => return Ok(f64::from(u8::from(*on))),
        (ParameterType::Number, SignalValue::Number(number)) => *number,
        (ParameterType::Integer, SignalValue::Number(number)) if number.fract() == 0.0 => *number,
        (ParameterType::Choice, SignalValue::Text(text)) => {
            let place = info.choices.iter().position(|choice| choice == text);
            let place = place.and_then(|place| u32::try_from(place).ok());
            return place.map(f64::from).ok_or_else(|| wrong_choice(info, text));
        }
        _ => return Err(wrong_type(&info.name, parameter_form(info.parameter_type).to_owned())),
    };
    check_range(&info.name, number, (info.min, info.max))?;
    Ok(number)
}

/// A parameter's value, from the number that the controller reports.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
pub(super) fn parameter_value(info: &ParameterInfo, number: f64) -> SignalValue {
    match info.parameter_type {
        ParameterType::Bool => SignalValue::Bool(number != 0.0),
        ParameterType::Number | ParameterType::Integer => SignalValue::Number(number),
        ParameterType::Choice => match info.choices.get(number as usize) {
            Some(choice) => SignalValue::Text(choice.clone()),
            None => SignalValue::Number(number),
        },
    }
}

fn check_range(
    name: &str,
    number: f64,
    (min, max): (Option<f64>, Option<f64>),
) -> Result<(), Denial> {
    if !number.is_finite() {
        return Err(wrong_type(name, "a finite number".to_owned()));
    }
    let below = min.filter(|&min| number < min);
    let above = max.filter(|&max| number > max);
    let Some(limit) = below.or(above) else {
        return Ok(());
    };
    let side = if below.is_some() { "below" } else { "above" };
    let text = format!("{name}: {number} is {side} the limit {limit}");
    Err(Denial::new(DenialCode::OutOfRange, text)
        .with("field", "value")
        .with("value", number)
        .with("limit", limit))
}

fn wrong_type(name: &str, form: String) -> Denial {
    Denial::new(DenialCode::InvalidArgument, format!("{name}: expected {form}"))
        .with("field", "value")
        .with("expected", form)
}

fn wrong_choice(info: &ParameterInfo, text: &str) -> Denial {
    let choices = info.choices.join(", ");
    Denial::new(
        DenialCode::InvalidArgument,
        format!("{}: {text:?} is not one of {choices}", info.name),
    )
    .with("field", "value")
    .with("choices", info.choices.clone())
}

fn signal_form(info: &SignalInfo) -> String {
    match info.signal_type {
        SignalType::Digital => "true or false".to_owned(),
        SignalType::Analog => "a number".to_owned(),
        SignalType::DigitalPort => format!("{} times true or false", info.size),
        SignalType::AnalogPort | SignalType::Vector3 | SignalType::Wrench => {
            format!("{} numbers", info.size)
        }
    }
}

const fn parameter_form(parameter_type: ParameterType) -> &'static str {
    match parameter_type {
        ParameterType::Bool => "true or false",
        ParameterType::Number => "a number",
        ParameterType::Integer => "a whole number",
        ParameterType::Choice => "a text",
    }
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::AccessLevel;

    use super::*;

    fn signal(signal_type: SignalType, size: u8, range: Option<(f64, f64)>) -> SignalInfo {
        SignalInfo {
            name: "io".to_owned(),
            signal_type,
            access: AccessLevel::All,
            unit: String::new(),
            min: range.map(|(min, _)| min),
            max: range.map(|(_, max)| max),
            size,
            while_stopped: false,
            description: String::new(),
        }
    }

    fn parameter(parameter_type: ParameterType) -> ParameterInfo {
        ParameterInfo {
            name: "setting".to_owned(),
            parameter_type,
            access: AccessLevel::All,
            unit: String::new(),
            min: Some(0.0),
            max: Some(5.0),
            choices: vec!["soft".to_owned(), "hard".to_owned()],
            default: SignalValue::Number(0.0),
            description: String::new(),
        }
    }

    #[test]
    fn a_value_comes_back_as_it_was_written() {
        for (info, value) in [
            (signal(SignalType::Digital, 1, None), SignalValue::Bool(true)),
            (signal(SignalType::Analog, 1, None), SignalValue::Number(2.5)),
            (signal(SignalType::DigitalPort, 2, None), SignalValue::Bools(vec![true, false])),
            (signal(SignalType::Vector3, 3, None), SignalValue::Numbers(vec![1.0, 2.0, 3.0])),
        ] {
            let numbers = numbers_of(&info, &value).expect("of its type");
            assert_eq!(signal_value(&info, &numbers), value);
        }
        for (kind, value) in [
            (ParameterType::Bool, SignalValue::Bool(true)),
            (ParameterType::Number, SignalValue::Number(2.5)),
            (ParameterType::Integer, SignalValue::Number(3.0)),
            (ParameterType::Choice, SignalValue::Text("hard".to_owned())),
        ] {
            let info = parameter(kind);
            let number = number_of(&info, &value).expect("of its type");
            assert_eq!(parameter_value(&info, number), value);
        }
    }

    #[test]
    fn values_of_another_type_size_or_range_are_refused_by_name() {
        let port = signal(SignalType::DigitalPort, 3, None);
        let short = numbers_of(&port, &SignalValue::Bools(vec![true])).expect_err("too short");
        assert_eq!(short.message, "io: expected 3 times true or false");
        let digital = signal(SignalType::Digital, 1, None);
        let number = numbers_of(&digital, &SignalValue::Number(1.0)).expect_err("a number");
        assert_eq!(number.code, DenialCode::InvalidArgument);
        let analog = signal(SignalType::Analog, 1, Some((0.0, 10.0)));
        let high = numbers_of(&analog, &SignalValue::Number(10.5)).expect_err("too high");
        assert_eq!(high.code, DenialCode::OutOfRange);
        assert_eq!(high.message, "io: 10.5 is above the limit 10");
        let fraction = number_of(&parameter(ParameterType::Integer), &SignalValue::Number(0.5));
        assert!(fraction.is_err());
        let text = SignalValue::Text("medium".to_owned());
        let other = number_of(&parameter(ParameterType::Choice), &text).expect_err("no choice");
        assert!(other.message.contains("soft, hard"), "{other}");
    }
}
