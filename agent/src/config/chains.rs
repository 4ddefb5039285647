//! Chains, tools and the place of the robot, as a robot file gives them.

use armada_model::{JointLimits, Pose, RobotModel};
use armada_protocol::messages::{ChainInfo, JointInfo};
use serde::Deserialize;

use super::{ConfigError, Problem, RobotConfig, check_text};
use crate::control::{EquippedChain, MAX_CHAINS};
use crate::equipment::{EquipmentBook, check_tool};

/// Most tools of a robot file.
const MAX_TOOLS: usize = 64;

/// A chain of a robot file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChainConfig {
    /// Name of the chain, such as `arm`.
    pub name: String,
    /// Link the tip's pose is given in.
    pub base_link: String,
    /// Link at the end: the flange.
    pub tip_link: String,
    /// Name of the tool that it carries when the agent starts, one of `tools`; none by default.
    #[serde(default)]
    pub tool: Option<String>,
}

impl ChainConfig {
    /// The chain as clients are told of it.
    #[must_use]
    pub fn info(&self) -> ChainInfo {
        let (base_link, tip_link) = (self.base_link.clone(), self.tip_link.clone());
        ChainInfo { name: self.name.clone(), base_link, tip_link }
    }
}

impl RobotConfig {
    /// What the robot's chains carry at the start, and the tools it knows.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if the links of a chain are not ones of `model` with a driven
    /// joint of this robot between them, or a tool makes no sense.
    pub fn equipment(&self, model: &RobotModel) -> Result<EquipmentBook, ConfigError> {
        self.chain_infos(model)?;
        let joints = self.joint_infos(model)?;
        let joints: Vec<_> = joints.iter().map(limits_of).collect();
        let mut chains = Vec::new();
        for (index, chain) in self.chains.iter().enumerate() {
            let at = |text: String| {
                Problem::new("tip_link", text).under(&index.to_string()).under("chains")
            };
            let links = (chain.base_link.as_str(), chain.tip_link.as_str());
            let base = base_in_world(model, &chain.base_link, &self.mount);
            let equipped = EquippedChain::new(model, links, &joints, base)
                .map_err(|error| self.error(at(error.to_string())))?;
            chains.push((chain.name.clone(), equipped));
        }
        let mut book = EquipmentBook::new(chains, self.tools.clone());
        for (index, chain) in self.chains.iter().enumerate() {
            let Some(tool) = &chain.tool else { continue };
            book = book.with_tool(&chain.name, tool).map_err(|error| {
                let problem = Problem::new("tool", error.to_string());
                self.error(problem.under(&index.to_string()).under("chains"))
            })?;
        }
        Ok(book)
    }

    pub(super) fn check_chains(&self) -> Result<(), Problem> {
        if self.chains.len() > MAX_CHAINS {
            let text = format!("{} chains, limit {MAX_CHAINS}", self.chains.len());
            return Err(Problem::new("chains", text));
        }
        for (index, chain) in self.chains.iter().enumerate() {
            let at = |problem: Problem| problem.under(&index.to_string()).under("chains");
            check_text("name", &chain.name, 1).map_err(at)?;
            if self.chains.iter().take(index).any(|earlier| earlier.name == chain.name) {
                return Err(at(Problem::new("name", format!("{:?} is given twice", chain.name))));
            }
        }
        Ok(())
    }

    pub(super) fn check_tools(&self) -> Result<(), Problem> {
        if self.tools.len() > MAX_TOOLS {
            let text = format!("{} tools, limit {MAX_TOOLS}", self.tools.len());
            return Err(Problem::new("tools", text));
        }
        for (index, tool) in self.tools.iter().enumerate() {
            let at = |text: String| Problem::new(format!("tools.{index}"), text);
            check_tool(tool).map_err(|error| at(error.to_string()))?;
            if self.tools.iter().take(index).any(|earlier| earlier.name == tool.name) {
                return Err(at(format!("name {:?} is given twice", tool.name)));
            }
        }
        Ok(())
    }
}

fn limits_of(joint: &JointInfo) -> (&str, JointLimits) {
    (joint.name.as_str(), joint.limits)
}

/// Pose of a link in the world while every joint is at zero; the root stands at `mount`.
fn base_in_world(model: &RobotModel, link: &str, mount: &Pose) -> Pose {
    let zero = vec![0.0; model.variable_count()];
    let pose = model.link_index(link).and_then(|link| model.link_pose(&zero, link).ok());
    *mount * pose.map_or_else(Pose::default, Pose::from_isometry)
}
