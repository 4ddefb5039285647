//! The emulated controller's inputs, outputs and settings.

use armada_model::MAX_JOINTS;
use armada_protocol::messages::{AccessLevel, ParameterInfo, SignalInfo, SignalType};

use super::EmulatorConfig;
use super::settings::{allows, lies_within, number_of, parameter_infos, signal_infos};
use crate::drivers::{MAX_PARAMETERS, MAX_SIGNAL_VALUES, Values};

/// Inputs, outputs and settings with their values.
#[derive(Debug)]
pub(super) struct Board {
    signals: Vec<SignalInfo>,
    signal_values: Values<MAX_SIGNAL_VALUES>,
    parameters: Vec<ParameterInfo>,
    parameter_values: Values<MAX_PARAMETERS>,
}

impl Board {
    /// All signals at zero, or the value next to it; parameters at their defaults.
    pub(super) fn new(config: &EmulatorConfig) -> Self {
        let signals = signal_infos(&config.signals);
        let parameters = parameter_infos(&config.parameters);
        let of_signal = |signal: &SignalInfo| {
            let least = signal.min.unwrap_or(f64::NEG_INFINITY);
            let rest = 0.0_f64.max(least).min(signal.max.unwrap_or(f64::INFINITY));
            std::iter::repeat_n(rest, usize::from(signal.size))
        };
        let values: Vec<f64> = signals.iter().flat_map(of_signal).collect();
        let settings: Vec<f64> =
            parameters.iter().map(|info| number_of(info).unwrap_or_default()).collect();
        Self {
            // The checked file has no more values than there is room for.
            signal_values: Values::from_slice(&values).unwrap_or_default(),
            parameter_values: Values::from_slice(&settings).unwrap_or_default(),
            signals,
            parameters,
        }
    }

    pub(super) const fn signals(&self) -> Values<MAX_SIGNAL_VALUES> {
        self.signal_values
    }

    pub(super) const fn parameters(&self) -> Values<MAX_PARAMETERS> {
        self.parameter_values
    }

    /// Sets an output; says whether it is one and takes these values now.
    pub(super) fn set_signal(
        &mut self,
        index: u8,
        values: &Values<MAX_JOINTS>,
        moving: bool,
    ) -> bool {
        let index = usize::from(index);
        let values = values.as_slice();
        let Some(info) = self.signals.get(index) else { return false };
        let writable = may_write(info.access, moving)
            && values.len() == usize::from(info.size)
            && values.iter().all(|&value| takes(info, value));
        let begin = self.begin(index);
        match self.signal_values.as_mut_slice().get_mut(begin..begin + values.len()) {
            Some(slots) if writable => slots.copy_from_slice(values),
            _ => return false,
        }
        true
    }

    /// Sets one value of an input from outside; says whether there is one that takes it.
    pub(super) fn set_input(&mut self, name: &str, element: u8, value: f64) -> bool {
        let Some(index) = self.signals.iter().position(|signal| signal.name == name) else {
            return false;
        };
        let begin = self.begin(index);
        let fits = self.signals.get(index).is_some_and(|info| {
            info.access == AccessLevel::ReadOnly && element < info.size && takes(info, value)
        });
        match self.signal_values.as_mut_slice().get_mut(begin + usize::from(element)) {
            Some(slot) if fits => *slot = value,
            _ => return false,
        }
        true
    }

    /// Sets a parameter; says whether it is one and takes this value now.
    pub(super) fn set_parameter(&mut self, index: u8, value: f64, moving: bool) -> bool {
        let index = usize::from(index);
        let fits = self
            .parameters
            .get(index)
            .is_some_and(|info| may_write(info.access, moving) && allows(info, value));
        match self.parameter_values.as_mut_slice().get_mut(index) {
            Some(slot) if fits => *slot = value,
            _ => return false,
        }
        true
    }

    fn begin(&self, index: usize) -> usize {
        self.signals.iter().take(index).map(|signal| usize::from(signal.size)).sum()
    }
}

fn may_write(access: AccessLevel, moving: bool) -> bool {
    match access {
        AccessLevel::ReadOnly => false,
        AccessLevel::Restricted => !moving,
        AccessLevel::All => true,
    }
}

fn takes(info: &SignalInfo, value: f64) -> bool {
    match info.signal_type {
        SignalType::Digital | SignalType::DigitalPort => value == 0.0 || value == 1.0,
        SignalType::Analog | SignalType::AnalogPort | SignalType::Vector3 | SignalType::Wrench => {
            lies_within(info.min, info.max, value)
        }
    }
}
