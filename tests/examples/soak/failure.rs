//! What fails, and how it is put right.

use std::fmt;
use std::time::Duration;

use anyhow::Result;
use armada_tests::{NetCell, Quality};

use crate::chance::Chance;

/// The arms.
pub(crate) const ARMS: [&str; 2] = ["left_arm", "right_arm"];

/// Something that fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Failure {
    /// Nothing: the motion comes to its end.
    Nothing,
    AgentKilled(&'static str),
    AgentFrozen(&'static str),
    ControllerFrozen(&'static str),
    GatewayKilled,
    GatewayFrozen,
    /// The direct link of the two agents.
    LinkCut,
    /// Every link of an arm's host.
    HostCut(&'static str),
    /// A link that loses frames, in percent.
    LinkLossy(u8),
    /// The link of the program that holds the leases, which it cannot renew meanwhile.
    ClientCut(&'static str),
}

/// How often each kind comes, in parts of the sum.
const WEIGHTS: [u64; 10] = [3, 2, 2, 1, 1, 1, 2, 2, 2, 2];

impl Failure {
    /// One at random; of the agents only that of `mortal` is killed, so that the other's memory can
    /// be watched for long.
    pub(crate) fn random(chance: &mut Chance, mortal: &'static str) -> Self {
        let mut place = chance.below(WEIGHTS.iter().sum());
        let kind = WEIGHTS.iter().position(|weight| {
            let here = place < *weight;
            place = place.saturating_sub(*weight);
            here
        });
        let arm = chance.of_these(&ARMS);
        match kind.unwrap_or_default() {
            0 => Self::Nothing,
            1 => Self::AgentKilled(mortal),
            2 => Self::AgentFrozen(arm),
            3 => Self::ControllerFrozen(arm),
            4 => Self::GatewayKilled,
            5 => Self::GatewayFrozen,
            6 => Self::LinkCut,
            7 => Self::HostCut(arm),
            8 => Self::LinkLossy(chance.of_these(&[1, 5, 20])),
            _ => Self::ClientCut(arm),
        }
    }

    /// Lets it happen.
    pub(crate) fn begin(self, cell: &mut NetCell) -> Result<()> {
        let [left, right] = ARMS;
        match self {
            Self::Nothing => Ok(()),
            Self::AgentKilled(arm) => cell.agent(arm)?.kill(),
            Self::AgentFrozen(arm) => cell.agent(arm)?.freeze(),
            Self::ControllerFrozen(arm) => cell.emulator(arm)?.freeze(),
            Self::GatewayKilled => cell.gateway.kill(),
            Self::GatewayFrozen => cell.gateway.freeze(),
            Self::LinkCut => cell.network.set_link(left, right, Quality::CUT),
            Self::HostCut(arm) => cell.network.set_host(arm, Quality::CUT),
            Self::LinkLossy(percent) => {
                cell.network.set_link(left, right, Quality::losing(percent))
            }
            Self::ClientCut(arm) => cell.network.set_link("client", arm, Quality::CUT),
        }
    }

    /// Puts it right.
    pub(crate) fn end(self, cell: &mut NetCell) -> Result<()> {
        let [left, right] = ARMS;
        match self {
            Self::Nothing => Ok(()),
            Self::AgentKilled(arm) => cell.agent(arm)?.start(),
            Self::AgentFrozen(arm) => cell.agent(arm)?.thaw(),
            Self::ControllerFrozen(arm) => cell.emulator(arm)?.thaw(),
            Self::GatewayKilled => cell.gateway.start(),
            Self::GatewayFrozen => cell.gateway.thaw(),
            Self::LinkCut | Self::LinkLossy(_) => {
                cell.network.set_link(left, right, Quality::default())
            }
            Self::HostCut(arm) => cell.network.set_host(arm, Quality::default()),
            Self::ClientCut(arm) => cell.network.set_link("client", arm, Quality::default()),
        }
    }

    /// How long it lasts: some are over before anybody notices, most are not.
    pub(crate) fn duration(chance: &mut Chance) -> Duration {
        Duration::from_millis(chance.of_these(&[20, 100, 300, 800, 1500]))
    }

    /// Whether this arm hears nothing of its partner any more.
    pub(crate) fn silences_partner_of(self, robot: &str) -> bool {
        match self {
            Self::AgentKilled(arm) | Self::AgentFrozen(arm) => arm != robot,
            Self::LinkCut | Self::HostCut(_) => true,
            Self::Nothing
            | Self::ControllerFrozen(_)
            | Self::GatewayKilled
            | Self::GatewayFrozen
            | Self::LinkLossy(_)
            | Self::ClientCut(_) => false,
        }
    }

    /// The arm whose agent forgets what it did.
    pub(crate) const fn forgets(self) -> Option<&'static str> {
        match self {
            Self::AgentKilled(arm) => Some(arm),
            _ => None,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nothing => f.write_str("nothing fails"),
            Self::AgentKilled(_) => f.write_str("agent killed"),
            Self::AgentFrozen(_) => f.write_str("agent frozen"),
            Self::ControllerFrozen(_) => f.write_str("controller frozen"),
            Self::GatewayKilled => f.write_str("gateway killed"),
            Self::GatewayFrozen => f.write_str("gateway frozen"),
            Self::LinkCut => f.write_str("link cut"),
            Self::HostCut(_) => f.write_str("host cut"),
            Self::LinkLossy(percent) => write!(f, "link loses {percent} %"),
            Self::ClientCut(_) => f.write_str("holder of the leases cut off"),
        }
    }
}
