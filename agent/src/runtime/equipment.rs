//! Tools and payloads as the agent's threads share them, and the info that tells of them.

use std::sync::{Arc, Mutex, PoisonError};

use armada_protocol::messages::RobotInfo;
use armada_protocol::publish::Cached;
use tokio::sync::MutexGuard;
use tracing::debug;

use crate::control::Equipment;
use crate::equipment::{EquipmentBook, EquipmentChange, EquipmentError};

/// What the chains carry: the book, what of it the loop may have in force, and the info.
pub(super) struct SharedEquipment {
    /// Held from the check of a change until the loop has answered: changes come one by one.
    ledger: tokio::sync::Mutex<Ledger>,
    /// The equipment in force and what is offered to the loop; told apart by their revisions.
    offered: Mutex<Vec<Arc<Equipment>>>,
    info: Mutex<RobotInfo>,
    /// As it was at the start, to find chains by their names.
    first: EquipmentBook,
    publisher: Cached,
}

/// The book, with changes of which nobody knows whether the loop made them.
pub(super) struct Ledger {
    pub(super) book: EquipmentBook,
    doubtful: Vec<EquipmentChange>,
}

impl SharedEquipment {
    pub(super) fn new(book: EquipmentBook, info: RobotInfo, publisher: Cached) -> Self {
        let in_force = Arc::new(book.for_loop());
        let first = book.clone();
        Self {
            ledger: tokio::sync::Mutex::new(Ledger { book, doubtful: Vec::new() }),
            offered: Mutex::new(vec![in_force]),
            info: Mutex::new(info),
            first,
            publisher,
        }
    }

    /// The robot's description as it is now.
    pub(super) fn info(&self) -> RobotInfo {
        self.info.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Number and name of the chain of this name, or of the only one.
    pub(super) fn chain(&self, name: Option<&str>) -> Result<(usize, String), EquipmentError> {
        let chain = self.first.chain(name)?;
        Ok((chain, self.first.chain_name(chain).to_owned()))
    }

    /// The chains with their tools of this revision, if the loop can have it.
    pub(super) fn of_revision(&self, config_seqno: u64) -> Option<Arc<Equipment>> {
        let offered = self.offered.lock().unwrap_or_else(PoisonError::into_inner);
        offered.iter().find(|equipment| equipment.config_seqno == config_seqno).cloned()
    }

    /// The book, to be read or changed; `in_force` is the revision that the loop reports.
    pub(super) async fn ledger(&self, in_force: u64) -> MutexGuard<'_, Ledger> {
        let mut ledger = self.ledger.lock().await;
        let made = ledger.doubtful.iter().position(|change| change.config_seqno() == in_force);
        if let Some(made) = made {
            // The loop did it after all, only too late for whoever asked.
            let change = ledger.doubtful.remove(made);
            self.enter(&mut ledger, change).await;
        }
        ledger
    }

    /// Makes a change known to those who follow the loop, before the loop is asked for it.
    pub(super) fn offer(&self, change: &EquipmentChange) {
        let equipment = Arc::clone(&change.order.equipment);
        let mut offered = self.offered.lock().unwrap_or_else(PoisonError::into_inner);
        offered.retain(|other| other.config_seqno != equipment.config_seqno);
        offered.push(equipment);
    }

    /// Keeps a change that the loop may still make.
    pub(super) fn doubt(ledger: &mut Ledger, change: EquipmentChange) {
        ledger.book.hand_over(&change);
        ledger.doubtful.push(change);
    }

    /// Enters a change that the loop has made, and publishes the info anew.
    pub(super) async fn enter(&self, ledger: &mut Ledger, change: EquipmentChange) {
        let config_seqno = change.config_seqno();
        ledger.book.hand_over(&change);
        ledger.book.enter(change);
        // Those that were offered before can never be granted any more.
        ledger.doubtful.clear();
        {
            let mut offered = self.offered.lock().unwrap_or_else(PoisonError::into_inner);
            offered.retain(|equipment| equipment.config_seqno >= config_seqno);
        }
        let info = {
            let mut info = self.info.lock().unwrap_or_else(PoisonError::into_inner);
            info.equipment = ledger.book.equipment();
            info.model_rev = config_seqno;
            info.seqno += 1;
            info.clone()
        };
        self.publish(&info).await;
    }

    /// Publishes the info as it is.
    pub(super) async fn announce(&self) {
        self.publish(&self.info()).await;
    }

    async fn publish(&self, info: &RobotInfo) {
        if let Err(error) = self.publisher.put(info).await {
            debug!(%error, "info not published");
        }
    }
}
