//! Signals and parameters of the controller.

mod convert;

use armada_protocol::messages::{
    AccessLevel, Denial, DenialCode, EventKind, NameParams, NamedValue, ParameterInfo,
    SetValueParams, Severity, SignalInfo, SignalValue,
};
use serde_json::{Map, Value};

use self::convert::{number_of, numbers_of, parameter_value, signal_value};
use super::{Asker, Requests};
use crate::control::{Order, ValueSlot};
use crate::drivers::Values;
use crate::runtime::desk::Remark;

impl Requests {
    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn get_param(
        &self,
        _: Asker,
        params: NameParams,
    ) -> Result<NamedValue, Denial> {
        let (index, info) = self.parameter(&params.name)?;
        self.read_parameter(index, info)
    }

    pub(super) async fn set_param(
        &self,
        asker: Asker,
        params: SetValueParams,
    ) -> Result<NamedValue, Denial> {
        let (index, info) = self.parameter(&params.name)?;
        let restricted = check_access(&info.name, info.access)?;
        let value = number_of(info, &params.value)?;
        let parameter = u8::try_from(index).unwrap_or(u8::MAX);
        let order = Order::SetParameter { parameter, value, restricted };
        self.ask(&asker, order, self.patience()).await?;
        self.say_what_was_set(&asker, &params);
        self.read_parameter(index, info)
    }

    #[expect(clippy::unused_async, reason = "one form for all methods")]
    pub(super) async fn get_signal(
        &self,
        _: Asker,
        params: NameParams,
    ) -> Result<NamedValue, Denial> {
        let (index, info) = self.signal(&params.name)?;
        self.read_signal(index, info)
    }

    pub(super) async fn set_signal(
        &self,
        asker: Asker,
        params: SetValueParams,
    ) -> Result<NamedValue, Denial> {
        let (index, info) = self.signal(&params.name)?;
        let restricted = check_access(&info.name, info.access)?;
        let numbers = numbers_of(info, &params.value)?;
        let values = Values::from_slice(&numbers).ok_or_else(|| {
            Denial::new(DenialCode::TooLarge, format!("{} values", numbers.len()))
        })?;
        let signal = u8::try_from(index).unwrap_or(u8::MAX);
        let while_stopped = info.while_stopped;
        let order = Order::SetSignal { signal, values, restricted, while_stopped };
        self.ask(&asker, order, self.patience()).await?;
        self.say_what_was_set(&asker, &params);
        self.read_signal(index, info)
    }

    fn signal(&self, name: &str) -> Result<(usize, &SignalInfo), Denial> {
        let signals = &self.abilities.signals;
        let found = signals.iter().enumerate().find(|(_, info)| info.name == name);
        found.ok_or_else(|| self.unknown("signal", name, signals.iter().map(|info| &*info.name)))
    }

    fn parameter(&self, name: &str) -> Result<(usize, &ParameterInfo), Denial> {
        let parameters = &self.abilities.parameters;
        let found = parameters.iter().enumerate().find(|(_, info)| info.name == name);
        let names = || parameters.iter().map(|info| &*info.name);
        found.ok_or_else(|| self.unknown("parameter", name, names()))
    }

    fn unknown<'n>(&self, what: &str, name: &str, names: impl Iterator<Item = &'n str>) -> Denial {
        let names: Vec<_> = names.collect();
        let robot = self.board.lock().vocabulary.robot.clone();
        if names.is_empty() {
            let text = format!("the controller of {robot} has no {what}s");
            return Denial::new(DenialCode::NotSupported, text);
        }
        let text = format!("{robot} has no {what} {name:?}, it has {}", names.join(", "));
        Denial::new(DenialCode::InvalidArgument, text).with("field", "name").with("names", names)
    }

    fn read_signal(&self, index: usize, info: &SignalInfo) -> Result<NamedValue, Denial> {
        let all = self.board.lock().snapshot.signals;
        let numbers = self.reported(all.as_slice(), self.params.signals.get(index))?;
        Ok(NamedValue { name: info.name.clone(), value: signal_value(info, numbers) })
    }

    fn read_parameter(&self, index: usize, info: &ParameterInfo) -> Result<NamedValue, Denial> {
        let all = self.board.lock().snapshot.parameters;
        let numbers = self.reported(all.as_slice(), self.params.parameters.get(index))?;
        let number = numbers.first().copied().unwrap_or_default();
        Ok(NamedValue { name: info.name.clone(), value: parameter_value(info, number) })
    }

    /// The part of a report that shows a value.
    fn reported<'v>(&self, all: &'v [f64], slot: Option<&ValueSlot>) -> Result<&'v [f64], Denial> {
        slot.and_then(|slot| all.get(slot.first..slot.first + slot.len)).ok_or_else(|| {
            let robot = self.board.lock().vocabulary.robot.clone();
            let text = format!("the controller of {robot} does not report it");
            Denial::new(DenialCode::CommunicationLost, text)
        })
    }

    /// The loop answers when the controller shows the value, or its time is up.
    fn patience(&self) -> std::time::Duration {
        self.params.request_timeout + super::LOOP_PATIENCE
    }

    fn say_what_was_set(&self, asker: &Asker, params: &SetValueParams) {
        let value = text_of(&params.value);
        let details = Map::from_iter([
            ("name".to_owned(), Value::from(params.name.as_str())),
            ("value".to_owned(), serde_json::to_value(&params.value).unwrap_or_default()),
        ]);
        self.tell(Remark {
            severity: Severity::Info,
            kind: EventKind::ValueSet,
            message: format!("{}: {} = {value}", asker.client, params.name),
            details,
        });
    }
}

/// Whether it may be written only while the robot does not move; an error if it may never be.
fn check_access(name: &str, access: AccessLevel) -> Result<bool, Denial> {
    match access {
        AccessLevel::All => Ok(false),
        AccessLevel::Restricted => Ok(true),
        AccessLevel::ReadOnly => {
            let text = format!("{name} can only be read");
            Err(Denial::new(DenialCode::NotSupported, text).with("field", "name"))
        }
    }
}

fn text_of(value: &SignalValue) -> String {
    serde_json::to_string(value).unwrap_or_default()
}
