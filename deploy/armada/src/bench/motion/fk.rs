//! Poses of all links of a robot, against pinocchio.

use std::collections::BTreeMap;
use std::hint::black_box;

use anyhow::{Context as _, ensure};
use armada_agent::runtime::monotonic;
use armada_model::RobotModel;
use nalgebra::{Isometry3, Matrix4};
use serde::Deserialize;
use serde_json::json;

use super::robots::Robot;
use super::{Bench, COLUMN, CONFIGURATIONS, TARGET, per_call};
use crate::bench::Side;
use crate::bench::report::Section;

/// Library that is the reference.
const PACKAGE: &str = "pin";
/// How far the answers of both may differ in any element of a transform.
const TOLERANCE: f64 = 1e-6;

/// What a call shall cost at most for all links of PR2 \[ns\].
const PR2_NS: f64 = 2100.0;

#[derive(Debug, Deserialize)]
struct Answer {
    ns: f64,
    links: BTreeMap<String, Vec<f64>>,
}

/// Measures one robot.
pub(super) async fn measure(bench: &mut Bench<'_>, robot: &Robot) -> anyhow::Result<Section> {
    let configurations = robot.configurations(CONFIGURATIONS);
    let named: Vec<_> = configurations.iter().map(|positions| robot.named(positions)).collect();
    let ask = json!({
        "kind": "fk",
        "urdf": robot.urdf,
        "configurations": named,
        "calls": bench.args.calls,
    });
    let mut agreed = true;
    let (mut ours, mut peers) = (Vec::new(), Vec::new());
    for turn in bench.turns(&robot.name) {
        match turn {
            Side::Ours => ours.push([time(&robot.model, &configurations, bench.args.calls)?]),
            Side::Reference => {
                let Some(answer) = bench.ask::<Answer>(PACKAGE, &ask).await? else { continue };
                peers.push([answer.ns]);
                if std::mem::take(&mut agreed) {
                    let first = configurations.first().context("no configuration")?;
                    agree(&robot.model, first, &answer.links)?;
                }
            }
        }
    }
    let (links, driven) = (robot.model.links().len(), robot.model.variable_count());
    let title = format!("fk of all links: {}, {links} links, {driven} driven joints", robot.name);
    let section = Section::new(title, [COLUMN]).row("armada, link_poses", &ours);
    let section = section.row("pinocchio, framesForwardKinematics", &peers).ratio();
    Ok(if robot.name == "pr2" { section.row(TARGET, &[[PR2_NS]]) } else { section })
}

/// Time of one call of ours \[ns\].
fn time(model: &RobotModel, configurations: &[Vec<f64>], calls: u32) -> anyhow::Result<f64> {
    let mut poses = vec![Isometry3::identity(); model.links().len()];
    for positions in configurations {
        model.link_poses(positions, &mut poses)?;
    }
    let begin = monotonic();
    for positions in configurations.iter().cycle().take(calls as usize) {
        model.link_poses(black_box(positions), black_box(&mut poses))?;
    }
    Ok(per_call(monotonic().saturating_since(begin), calls))
}

/// Whether both calculate the same.
fn agree(
    model: &RobotModel,
    positions: &[f64],
    links: &BTreeMap<String, Vec<f64>>,
) -> anyhow::Result<()> {
    let mut poses = vec![Isometry3::identity(); model.links().len()];
    model.link_poses(positions, &mut poses)?;
    for (link, pose) in model.links().iter().zip(&poses) {
        let cells = links.get(&link.name).filter(|cells| cells.len() == 16);
        let cells = cells.with_context(|| format!("the peer knows no link {:?}", link.name))?;
        let off = (pose.to_homogeneous() - Matrix4::from_row_slice(cells)).amax();
        ensure!(off <= TOLERANCE, "link {:?}: both differ by {off:e}", link.name);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::robots::load;
    use super::*;

    #[test]
    fn a_peer_that_calculates_something_else_is_noticed() {
        let robots = load(None).expect("our own robots are sound");
        let robot = &robots[0];
        let positions = robot.configurations(1).remove(0);
        let mut poses = vec![Isometry3::identity(); robot.model.links().len()];
        robot.model.link_poses(&positions, &mut poses).expect("positions fit");
        let rows = |pose: &Isometry3<f64>| pose.to_homogeneous().transpose().as_slice().to_vec();
        let names = robot.model.links().iter().map(|link| link.name.clone());
        let mut links: BTreeMap<_, _> = names.zip(poses.iter().map(rows)).collect();
        agree(&robot.model, &positions, &links).expect("the same");
        links.get_mut("tool0").expect("a tool")[3] += 1e-3;
        let error = agree(&robot.model, &positions, &links).expect_err("off").to_string();
        assert!(error.contains("tool0"), "{error}");
        links.remove("tool0");
        assert!(agree(&robot.model, &positions, &links).is_err(), "a link is missing");
    }

    #[test]
    fn a_call_takes_some_time() {
        let robots = load(None).expect("our own robots are sound");
        let configurations = robots[0].configurations(4);
        assert!(time(&robots[0].model, &configurations, 1000).expect("measured") > 0.0);
    }
}
