//! Why tools and payloads are not changed.

use armada_model::LoadError;

use super::body::MAX_NAME;

/// Why tools and payloads are not changed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EquipmentError {
    /// The robot file gives no chains.
    #[error("the robot file gives no chains")]
    NoChains,
    /// There are several chains.
    #[error("chain is missing: it is one of {}", chains.join(", "))]
    WhichChain {
        /// Their names.
        chains: Vec<String>,
    },
    /// There is no such chain.
    #[error("there is no chain {given:?}: it is one of {}", chains.join(", "))]
    UnknownChain {
        /// The name given.
        given: String,
        /// Names of the chains.
        chains: Vec<String>,
    },
    /// Both or neither of a tool and a name were given.
    #[error("exactly one of tool and name must be given")]
    ToolOrName,
    /// The robot file has no such tool.
    #[error("the robot file has no tool {given:?}, it has {}", listed(tools))]
    UnknownTool {
        /// The name given.
        given: String,
        /// Names of its tools.
        tools: Vec<String>,
    },
    /// A name is empty or too long.
    #[error("{field} has {len} characters, expected 1 to {MAX_NAME}")]
    Name {
        /// Which name.
        field: &'static str,
        /// Its length.
        len: usize,
    },
    /// Mass, centre or inertia are those of no body.
    #[error("{field}: {error}")]
    Body {
        /// Of what.
        field: &'static str,
        /// What is wrong.
        error: LoadError,
    },
    /// The chain has a tool.
    #[error("chain {chain} has the tool {name} already: detach it first")]
    ToolAttached {
        /// Name of the chain.
        chain: String,
        /// Name of its tool.
        name: String,
    },
    /// The chain has no tool.
    #[error("chain {chain} has no tool")]
    NoTool {
        /// Name of the chain.
        chain: String,
    },
    /// The tool holds a payload.
    #[error("the tool of chain {chain} holds {name}: detach the payload first")]
    HoldsPayload {
        /// Name of the chain.
        chain: String,
        /// Name of the payload.
        name: String,
    },
    /// The chain has a payload.
    #[error("chain {chain} has the payload {name} already: detach it first")]
    PayloadAttached {
        /// Name of the chain.
        chain: String,
        /// Name of its payload.
        name: String,
    },
    /// The chain has no payload.
    #[error("chain {chain} has no payload")]
    NoPayload {
        /// Name of the chain.
        chain: String,
    },
    /// Something of another name is attached.
    #[error("the {what} is {is:?}, not {given:?}")]
    OtherName {
        /// Tool or payload.
        what: &'static str,
        /// The name given.
        given: String,
        /// Its name.
        is: String,
    },
}

impl EquipmentError {
    /// The field that is wrong, if one is.
    #[must_use]
    pub const fn field(&self) -> Option<&'static str> {
        match self {
            Self::WhichChain { .. } | Self::UnknownChain { .. } => Some("chain"),
            Self::ToolOrName => Some("tool"),
            Self::UnknownTool { .. } | Self::OtherName { .. } => Some("name"),
            Self::Name { field, .. } | Self::Body { field, .. } => Some(field),
            Self::NoChains
            | Self::ToolAttached { .. }
            | Self::NoTool { .. }
            | Self::HoldsPayload { .. }
            | Self::PayloadAttached { .. }
            | Self::NoPayload { .. } => None,
        }
    }
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
