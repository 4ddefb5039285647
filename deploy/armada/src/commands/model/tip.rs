//! The chain that is asked about: from a base link to a tip link, with a tool.

use armada_model::{Chain, ChainError, RobotModel};
use clap::Args;

use super::pose;
use crate::exit::UsageError;

/// Most links that a message lists.
const MAX_NAMES: usize = 24;

/// Between which links, and with which tool.
#[derive(Args, Clone, Debug)]
pub(super) struct TipArgs {
    /// Link that the tool is fixed to
    #[arg(long, value_name = "LINK")]
    pub(super) tip: String,
    /// Link in which poses are told; the robot's root if left out
    #[arg(long, value_name = "LINK")]
    pub(super) base: Option<String>,
    /// Pose of the tool centre point in the tip link
    #[arg(long, value_name = "POSE")]
    pub(super) tool: Option<String>,
}

impl TipArgs {
    /// The chain of joints, its tool included.
    ///
    /// # Errors
    /// If a file cannot be read; [`UsageError`] if links or tool do not fit.
    pub(super) fn chain(&self, model: &RobotModel) -> anyhow::Result<Chain> {
        let chain = match &self.base {
            Some(base) => Chain::new(model, base, &self.tip),
            None => Chain::from_root(model, &self.tip),
        };
        let chain = chain.map_err(|error| UsageError(told(&error, model)))?;
        match &self.tool {
            Some(tool) => Ok(chain.with_tool(&pose::of_argument("--tool", tool)?)),
            None => Ok(chain),
        }
    }
}

fn told(error: &ChainError, model: &RobotModel) -> String {
    let ChainError::UnknownLink { .. } = error else { return error.to_string() };
    let links = model.links();
    let mut names: Vec<_> = links.iter().map(|link| link.name.as_str()).take(MAX_NAMES).collect();
    if links.len() > MAX_NAMES {
        names.push("…");
    }
    format!("{error}; there are {}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::super::own_robot;
    use super::*;

    fn chain(tip: &str, base: Option<&str>, tool: Option<&str>) -> anyhow::Result<Chain> {
        let args = TipArgs {
            tip: tip.to_owned(),
            base: base.map(str::to_owned),
            tool: tool.map(str::to_owned),
        };
        args.chain(&own_robot("six_axis_arm.urdf"))
    }

    #[test]
    fn links_that_make_no_chain_are_refused_by_name() {
        for (tip, base, reason) in [
            ("hand", None, "there is no link \"hand\"; there are base_link"),
            ("tool0", Some("floor"), "there is no link \"floor\"; there are base_link"),
            ("base_link", None, "no driven joint moves \"base_link\" relative to \"base_link\""),
        ] {
            let error = chain(tip, base, None).expect_err(tip);
            assert!(error.is::<UsageError>(), "{error}");
            assert!(error.to_string().contains(reason), "{error}");
        }
    }

    #[test]
    fn the_tool_moves_the_tool_centre_point() {
        let tool = "[[1,0,0,0],[0,1,0,0],[0,0,1,0.25],[0,0,0,1]]";
        let flange = chain("tool0", None, None).expect("a chain");
        let tipped = chain("tool0", None, Some(tool)).expect("a chain");
        let place = |chain: &Chain| chain.forward(&[0.1; 6]).expect("fits").translation.vector;
        let moved = (place(&tipped) - place(&flange)).norm();
        assert!((moved - 0.25).abs() < 1e-12, "{moved}");
    }
}
