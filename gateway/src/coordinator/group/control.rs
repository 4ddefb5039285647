//! Who is asked to change a motion that goes on.

use std::collections::BTreeMap;

use armada_protocol::RobotName;
use armada_protocol::messages::{Coupling, Denial, DenialCode};
use uuid::Uuid;

use super::{Group, Phase};
use crate::coordinator::io::Control;

impl Group {
    /// The robots that are to be asked, each with the lease under which: those of the motion, if
    /// the client shows one of them, else none; then the agents decide.
    ///
    /// # Errors
    /// A denial if the motion does not run, has no common phase to change, or the lease is not one
    /// of its.
    pub(in crate::coordinator) fn controlled(
        &self,
        lease: Option<Uuid>,
        control: Control,
    ) -> Result<BTreeMap<RobotName, Option<Uuid>>, Denial> {
        if self.phase != Phase::Running || self.outcome.is_some() {
            let message = format!("motion {} has not begun, or comes to its end", self.id);
            return Err(Denial::new(DenialCode::NotReady, message));
        }
        if self.has_partners() && self.coupling == Coupling::Independent {
            let message = "robots that are independent of each other have no common phase: \
                           cancel the motion, or couple them as time_synced";
            return Err(Denial::new(DenialCode::NotSupported, message).with("field", "coupling"));
        }
        if let Control::SpeedRatio(ratio) = control
            && !(0.01..=1.0).contains(&ratio)
        {
            let message = format!("ratio is {ratio}, expected 0.01 to 1");
            return Err(Denial::new(DenialCode::OutOfRange, message).with("field", "ratio"));
        }
        let holds = |lease| self.parts.values().any(|part| part.lease == Some(lease));
        if lease.is_some_and(|lease| !holds(lease)) {
            let message = format!("lease is none of those that motion {} goes on under", self.id);
            return Err(Denial::new(DenialCode::LeaseStale, message).with("field", "lease"));
        }
        // A name proves nothing: whoever knows one of the leases is lent the others.
        let open = self.parts.iter().filter(|(_, part)| part.is_open());
        Ok(open.map(|(r, part)| (r.clone(), part.lease.filter(|_| lease.is_some()))).collect())
    }
}
