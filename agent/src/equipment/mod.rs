//! What the chains of a robot carry: the book outside the control loop.
//!
//! ```text
//!            attach tool         attach payload
//! nothing -------------> tool ------------------> tool and payload
//!         <-------------      <------------------
//!            detach tool         detach payload
//! ```
//!
//! A change is made in two steps: [`EquipmentBook`] checks it and says what the loop is to be
//! handed, and only when the loop has granted it is it entered. So book and loop cannot differ,
//! whoever else asks at the same time, and a refused change leaves no trace.

mod body;
mod error;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use armada_model::Pose;
use armada_protocol::messages::{
    AttachPayloadParams, AttachToolParams, AttachedPayload, ChainEquipment, DetachParams, ToolInfo,
};

pub use error::EquipmentError;

use crate::control::{Equipment, EquipmentOrder, EquippedChain};
use body::{check_name, combined, load_of};

/// Checks a tool of a robot file.
///
/// # Errors
/// [`EquipmentError::Name`] and [`EquipmentError::Body`].
pub fn check_tool(tool: &ToolInfo) -> Result<(), EquipmentError> {
    check_name("tool.name", &tool.name)?;
    load_of("tool.inertia", &tool.inertia).map(drop)
}

/// What the chains of one robot carry, and the tools it knows.
#[derive(Clone, Debug, Default)]
pub struct EquipmentBook {
    /// Name, chain without tool, and what it carries, in the order of the robot file.
    chains: Vec<Entry>,
    catalogue: Vec<ToolInfo>,
    config_seqno: u64,
    /// Highest revision that was handed to the loop, which may not have granted it.
    newest: u64,
}

#[derive(Clone, Debug)]
struct Entry {
    bare: EquippedChain,
    carries: ChainEquipment,
}

/// A change that was checked and not yet entered.
#[derive(Clone, Debug)]
pub struct EquipmentChange {
    chain: usize,
    carries: ChainEquipment,
    /// What the loop is to be handed.
    pub order: EquipmentOrder,
}

impl EquipmentBook {
    /// A book of these chains, each with its name and without a tool, and of the tools that can be
    /// attached by their names.
    #[must_use]
    pub fn new(chains: Vec<(String, EquippedChain)>, catalogue: Vec<ToolInfo>) -> Self {
        let entry = |(chain, bare)| Entry {
            bare,
            carries: ChainEquipment { chain, tool: None, payload: None },
        };
        let chains = chains.into_iter().map(entry).collect();
        Self { chains, catalogue, config_seqno: 1, newest: 1 }
    }

    /// The same with a tool of the catalogue on a chain from the start.
    ///
    /// # Errors
    /// As [`Self::attach_tool`].
    pub fn with_tool(mut self, chain: &str, tool: &str) -> Result<Self, EquipmentError> {
        let params = AttachToolParams {
            chain: Some(chain.to_owned()),
            tool: None,
            name: Some(tool.to_owned()),
        };
        let change = self.attach_tool(&params)?;
        if let Some(entry) = self.chains.get_mut(change.chain) {
            entry.carries = change.carries;
        }
        Ok(self)
    }

    /// What each chain carries, in the order of the robot file.
    #[must_use]
    pub fn equipment(&self) -> Vec<ChainEquipment> {
        self.chains.iter().map(|entry| entry.carries.clone()).collect()
    }

    /// Tools that can be attached by their names.
    #[must_use]
    pub fn catalogue(&self) -> &[ToolInfo] {
        &self.catalogue
    }

    /// Revision of tools and payloads, from 1.
    #[must_use]
    pub const fn config_seqno(&self) -> u64 {
        self.config_seqno
    }

    /// The chains with what they carry, for the control loop.
    #[must_use]
    pub fn for_loop(&self) -> Equipment {
        let chains = self.chains.iter().map(|entry| entry.bare.carrying(&entry.carries));
        Equipment { config_seqno: self.config_seqno, chains: chains.collect() }
    }

    /// Index of the chain of this name, or of the only one.
    ///
    /// # Errors
    /// [`EquipmentError::NoChains`], [`EquipmentError::WhichChain`] if there are several and none
    /// is named, [`EquipmentError::UnknownChain`].
    pub fn chain(&self, name: Option<&str>) -> Result<usize, EquipmentError> {
        let names = || self.chains.iter().map(|entry| entry.carries.chain.clone()).collect();
        match (name, self.chains.len()) {
            (_, 0) => Err(EquipmentError::NoChains),
            (None, 1) => Ok(0),
            (None, _) => Err(EquipmentError::WhichChain { chains: names() }),
            (Some(name), _) => {
                let found = self.chains.iter().position(|entry| entry.carries.chain == name);
                found.ok_or_else(|| EquipmentError::UnknownChain {
                    given: name.to_owned(),
                    chains: names(),
                })
            }
        }
    }

    /// Name of a chain; empty if there is no such.
    #[must_use]
    pub fn chain_name(&self, index: usize) -> &str {
        self.chains.get(index).map_or("", |entry| &entry.carries.chain)
    }

    /// Checks that a tool may be attached.
    ///
    /// # Errors
    /// [`EquipmentError`]: no such chain, not exactly one of tool and name, a tool that is not
    /// known or makes no sense, or a chain that has one.
    pub fn attach_tool(
        &self,
        params: &AttachToolParams,
    ) -> Result<EquipmentChange, EquipmentError> {
        let (index, carries) = self.carried(params.chain.as_deref())?;
        let tool = self.tool(params)?;
        check_tool(&tool)?;
        if let Some(tool) = &carries.tool {
            let (chain, name) = (carries.chain.clone(), tool.name.clone());
            return Err(EquipmentError::ToolAttached { chain, name });
        }
        self.change(index, ChainEquipment { tool: Some(tool), ..carries.clone() })
    }

    /// Checks that the tool of a chain may be detached.
    ///
    /// # Errors
    /// [`EquipmentError`]: no such chain, no tool, one of another name, or one that holds a
    /// payload.
    pub fn detach_tool(&self, params: &DetachParams) -> Result<EquipmentChange, EquipmentError> {
        let (index, carries) = self.carried(params.chain.as_deref())?;
        let chain = || carries.chain.clone();
        let tool =
            carries.tool.as_ref().ok_or_else(|| EquipmentError::NoTool { chain: chain() })?;
        check_named("tool", params.name.as_deref(), &tool.name)?;
        if let Some(held) = &carries.payload {
            let name = held.payload.name.clone();
            return Err(EquipmentError::HoldsPayload { chain: chain(), name });
        }
        self.change(index, ChainEquipment { tool: None, ..carries.clone() })
    }

    /// Checks that a payload may be attached.
    ///
    /// # Errors
    /// [`EquipmentError`]: no such chain, no tool to hold it, another payload, or one that makes
    /// no sense.
    pub fn attach_payload(
        &self,
        params: &AttachPayloadParams,
    ) -> Result<EquipmentChange, EquipmentError> {
        let (index, carries) = self.carried(params.chain.as_deref())?;
        check_name("payload.name", &params.payload.name)?;
        load_of("payload.inertia", &params.payload.inertia)?;
        let chain = || carries.chain.clone();
        if carries.tool.is_none() {
            return Err(EquipmentError::NoTool { chain: chain() });
        }
        if let Some(held) = &carries.payload {
            let name = held.payload.name.clone();
            return Err(EquipmentError::PayloadAttached { chain: chain(), name });
        }
        let payload = AttachedPayload { payload: params.payload.clone(), pose: params.pose };
        self.change(index, ChainEquipment { payload: Some(payload), ..carries.clone() })
    }

    /// Checks that the payload of a chain may be detached.
    ///
    /// # Errors
    /// [`EquipmentError`]: no such chain, no payload, or one of another name.
    pub fn detach_payload(&self, params: &DetachParams) -> Result<EquipmentChange, EquipmentError> {
        let (index, carries) = self.carried(params.chain.as_deref())?;
        let none = || EquipmentError::NoPayload { chain: carries.chain.clone() };
        let held = carries.payload.as_ref().ok_or_else(none)?;
        check_named("payload", params.name.as_deref(), &held.payload.name)?;
        self.change(index, ChainEquipment { payload: None, ..carries.clone() })
    }

    /// Notes that `change` is on its way to the loop: its revision is never given again, even if
    /// nobody ever learns whether the loop granted it.
    pub fn hand_over(&mut self, change: &EquipmentChange) {
        self.newest = self.newest.max(change.order.equipment.config_seqno);
    }

    /// Enters a change that the loop has granted; returns what the chain carries now.
    pub fn enter(&mut self, change: EquipmentChange) -> ChainEquipment {
        self.hand_over(&change);
        self.config_seqno = change.config_seqno();
        if let Some(entry) = self.chains.get_mut(change.chain) {
            entry.carries = change.carries.clone();
        }
        change.carries
    }

    fn carried(&self, chain: Option<&str>) -> Result<(usize, &ChainEquipment), EquipmentError> {
        let index = self.chain(chain)?;
        let entry = self.chains.get(index).ok_or(EquipmentError::NoChains)?;
        Ok((index, &entry.carries))
    }

    fn tool(&self, params: &AttachToolParams) -> Result<ToolInfo, EquipmentError> {
        let name = match (&params.tool, &params.name) {
            (Some(tool), None) => return Ok(tool.clone()),
            (None, Some(name)) => name,
            (Some(_), Some(_)) | (None, None) => return Err(EquipmentError::ToolOrName),
        };
        let found = self.catalogue.iter().find(|tool| tool.name == *name);
        found.cloned().ok_or_else(|| EquipmentError::UnknownTool {
            given: name.clone(),
            tools: self.catalogue.iter().map(|tool| tool.name.clone()).collect(),
        })
    }

    fn change(
        &self,
        chain: usize,
        carries: ChainEquipment,
    ) -> Result<EquipmentChange, EquipmentError> {
        let mut equipment = self.for_loop();
        let entry = self.chains.get(chain).ok_or(EquipmentError::NoChains)?;
        let equipped = entry.bare.carrying(&carries);
        let told = u8::try_from(chain).ok().map(|chain| (chain, equipped.load));
        if let Some(slot) = equipment.chains.get_mut(chain) {
            *slot = equipped;
        }
        equipment.config_seqno = self.newest + 1;
        let order = EquipmentOrder {
            equipment: Arc::new(equipment),
            replaces: self.config_seqno,
            load: told,
        };
        Ok(EquipmentChange { chain, carries, order })
    }
}

impl EquipmentChange {
    /// Revision that it leads to.
    #[must_use]
    pub fn config_seqno(&self) -> u64 {
        self.order.equipment.config_seqno
    }

    /// What the chain carries after it.
    #[must_use]
    pub const fn carries(&self) -> &ChainEquipment {
        &self.carries
    }
}

impl EquippedChain {
    /// The chain with this tool and payload instead of its own.
    fn carrying(&self, carries: &ChainEquipment) -> Self {
        let tcp = carries.tool.as_ref().map_or_else(Pose::default, |tool| tool.tcp);
        Self { tcp, load: combined(carries), ..self.clone() }
    }
}

fn check_named(what: &'static str, given: Option<&str>, is: &str) -> Result<(), EquipmentError> {
    match given {
        Some(given) if given != is => {
            Err(EquipmentError::OtherName { what, given: given.to_owned(), is: is.to_owned() })
        }
        _ => Ok(()),
    }
}
