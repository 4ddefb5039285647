//! Pose and Jacobian of the tool of a seven-axis arm, against pinocchio.

use std::collections::BTreeMap;
use std::hint::black_box;

use anyhow::{Context as _, ensure};
use armada_agent::runtime::monotonic;
use armada_model::{Chain, JointVector};
use serde::Deserialize;
use serde_json::json;

use super::robots::Arm;
use super::{Bench, COLUMN, CONFIGURATIONS, TARGET, per_call};
use crate::bench::Side;
use crate::bench::report::Section;

/// What a call shall cost at most \[ns\].
const TARGET_NS: f64 = 300.0;
/// How far the answers of both may differ in any element.
const TOLERANCE: f64 = 1e-6;

#[derive(Debug, Deserialize)]
struct Answer {
    ns: f64,
    /// Linear, then angular velocity for each joint.
    columns: BTreeMap<String, Vec<f64>>,
}

/// Measures one arm.
pub(super) async fn measure(bench: &mut Bench<'_>, arm: &Arm<'_>) -> anyhow::Result<Section> {
    let (robot, chain) = (arm.robot, &arm.chain);
    let configurations = robot.configurations(CONFIGURATIONS);
    let named: Vec<_> = configurations.iter().map(|positions| robot.named(positions)).collect();
    let ask = json!({
        "kind": "jacobian",
        "urdf": robot.urdf,
        "base": chain.base(),
        "tip": chain.tip(),
        "configurations": named,
        "calls": bench.args.calls,
    });
    let own: Result<Vec<_>, _> = configurations.iter().map(|all| chain.gather(all)).collect();
    let own = own?;
    let (mut ours, mut peers) = (Vec::new(), Vec::new());
    for turn in bench.turns("jacobian") {
        match turn {
            Side::Ours => ours.push([time(chain, &own, bench.args.calls)?]),
            Side::Reference => {
                let Some(answer) = bench.ask::<Answer>("pin", &ask).await? else { continue };
                peers.push([answer.ns]);
                agree(chain, own.first().context("no configuration")?, &answer.columns)?;
            }
        }
    }
    let title = format!("pose and jacobian: {}, {}, {} axes", robot.name, chain.tip(), chain.len());
    let section = Section::new(title, [COLUMN]).row("armada, forward_and_jacobian", &ours);
    let section = section.row("pinocchio, computeJointJacobians and its frame", &peers).ratio();
    Ok(section.row(TARGET, &[[TARGET_NS]]))
}

/// Time of one call of ours \[ns\].
fn time(chain: &Chain, configurations: &[JointVector], calls: u32) -> anyhow::Result<f64> {
    for positions in configurations {
        black_box(chain.forward_and_jacobian(positions)?);
    }
    let begin = monotonic();
    for positions in configurations.iter().cycle().take(calls as usize) {
        black_box(chain.forward_and_jacobian(black_box(positions))?);
    }
    Ok(per_call(monotonic().saturating_since(begin), calls))
}

/// Whether both calculate the same.
fn agree(
    chain: &Chain,
    positions: &[f64],
    columns: &BTreeMap<String, Vec<f64>>,
) -> anyhow::Result<()> {
    let (_, jacobian) = chain.forward_and_jacobian(positions)?;
    for (index, variable) in chain.variables().iter().enumerate() {
        let column = columns.get(&variable.name).filter(|column| column.len() == 6);
        let column =
            column.with_context(|| format!("the peer knows no joint {:?}", variable.name))?;
        for (row, theirs) in column.iter().enumerate() {
            let ours = jacobian.element(row, index).context("no such element")?;
            let off = (ours - theirs).abs();
            ensure!(off <= TOLERANCE, "joint {:?}: both differ by {off:e}", variable.name);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::robots::{arms, load};
    use super::*;

    #[test]
    fn a_peer_that_calculates_something_else_is_noticed() {
        let robots = load(None).expect("our own robots are sound");
        let chain = arms(&robots).expect("known").remove(1).chain;
        let positions = [0.1, 0.2, 0.3, -0.4, 0.5, 0.6, 0.7];
        let (_, jacobian) = chain.forward_and_jacobian(&positions).expect("positions fit");
        let column = |index| (0..6).filter_map(|row| jacobian.element(row, index)).collect();
        let names = chain.variables().iter().enumerate();
        let mut columns: BTreeMap<String, Vec<f64>> =
            names.map(|(index, variable)| (variable.name.clone(), column(index))).collect();
        agree(&chain, &positions, &columns).expect("the same");
        let name = chain.variables()[3].name.clone();
        columns.get_mut(&name).expect("a joint")[5] += 1e-3;
        let error = agree(&chain, &positions, &columns).expect_err("off").to_string();
        assert!(error.contains(&name), "{error}");
        columns.remove(&name);
        assert!(agree(&chain, &positions, &columns).is_err(), "a joint is missing");
    }
}
