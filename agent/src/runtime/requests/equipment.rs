//! Tools and payloads.

use armada_protocol::messages::{
    AttachPayloadParams, AttachToolParams, Denial, DenialCode, DetachParams, EquipmentAnswer,
    EventKind, Severity,
};
use serde_json::{Map, Value};

use super::{Asker, LOOP_PATIENCE, Requests};
use crate::control::Order;
use crate::equipment::{EquipmentBook, EquipmentChange, EquipmentError};
use crate::runtime::desk::Remark;
use crate::runtime::equipment::SharedEquipment;

impl Requests {
    pub(super) async fn attach_tool(
        &self,
        asker: Asker,
        params: AttachToolParams,
    ) -> Result<EquipmentAnswer, Denial> {
        self.change_equipment(&asker, |book| book.attach_tool(&params)).await
    }

    pub(super) async fn detach_tool(
        &self,
        asker: Asker,
        params: DetachParams,
    ) -> Result<EquipmentAnswer, Denial> {
        self.change_equipment(&asker, |book| book.detach_tool(&params)).await
    }

    pub(super) async fn attach_payload(
        &self,
        asker: Asker,
        params: AttachPayloadParams,
    ) -> Result<EquipmentAnswer, Denial> {
        self.change_equipment(&asker, |book| book.attach_payload(&params)).await
    }

    pub(super) async fn detach_payload(
        &self,
        asker: Asker,
        params: DetachParams,
    ) -> Result<EquipmentAnswer, Denial> {
        self.change_equipment(&asker, |book| book.detach_payload(&params)).await
    }

    /// Checks a change, has the loop make it, and enters it: all of it or nothing.
    async fn change_equipment(
        &self,
        asker: &Asker,
        make: impl FnOnce(&EquipmentBook) -> Result<EquipmentChange, EquipmentError>,
    ) -> Result<EquipmentAnswer, Denial> {
        let in_force = self.board.lock().snapshot.config_seqno;
        let mut ledger = self.equipment.ledger(in_force).await;
        let change = make(&ledger.book).map_err(|error| equipment_denial(&error))?;
        self.equipment.offer(&change);
        let order = Order::SetEquipment(change.order.clone());
        if let Err(denial) = self.ask(asker, order, LOOP_PATIENCE).await {
            if denial.code == DenialCode::Timeout {
                SharedEquipment::doubt(&mut ledger, change);
            }
            return Err(denial);
        }
        let equipment = change.carries().clone();
        let config_seqno = change.config_seqno();
        self.equipment.enter(&mut ledger, change).await;
        drop(ledger);
        let answer = EquipmentAnswer { equipment, config_seqno, model_rev: config_seqno };
        self.say_what_is_carried(asker, &answer);
        Ok(answer)
    }

    fn say_what_is_carried(&self, asker: &Asker, answer: &EquipmentAnswer) {
        let carries = &answer.equipment;
        let tool = carries.tool.as_ref().map_or("no tool", |tool| tool.name.as_str());
        let payload = carries
            .payload
            .as_ref()
            .map_or_else(String::new, |held| format!(" with payload {}", held.payload.name));
        let message = format!("{}: chain {} carries {tool}{payload}", asker.client, carries.chain);
        let details = Map::from_iter([
            ("chain".to_owned(), Value::from(carries.chain.as_str())),
            ("config_seqno".to_owned(), Value::from(answer.config_seqno)),
        ]);
        self.tell(Remark {
            severity: Severity::Info,
            kind: EventKind::EquipmentChanged,
            message,
            details,
        });
    }
}

/// The denial that an error of the book means.
pub(super) fn equipment_denial(error: &EquipmentError) -> Denial {
    use EquipmentError as E;
    let code = match error {
        E::NoChains => DenialCode::NotSupported,
        E::ToolAttached { .. } | E::PayloadAttached { .. } | E::HoldsPayload { .. } => {
            DenialCode::AlreadyAttached
        }
        E::NoTool { .. } | E::NoPayload { .. } | E::OtherName { .. } => DenialCode::NotAttached,
        E::WhichChain { .. }
        | E::UnknownChain { .. }
        | E::ToolOrName
        | E::UnknownTool { .. }
        | E::Name { .. }
        | E::Body { .. } => DenialCode::InvalidArgument,
    };
    let denial = Denial::new(code, error.to_string());
    match error.field() {
        Some(field) => denial.with("field", field),
        None => denial,
    }
}
