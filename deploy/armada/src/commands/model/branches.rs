//! All postures for one pose in closed form: `armada model ik --all`.

#![allow(non_snake_case, reason = "X_BT is the pose of frame T in frame B")]

use anyhow::Context as _;
use armada_model::{
    AnalyticArm, AnalyticError, ArmFamily, BeyondLimit, Branch, Chain, Pose, RobotModel,
    SevenAxisArm, Singularities,
};
use serde::Serialize;

use super::ik::of_tip;
use super::joints::as_map;
use crate::exit::Exit;
use crate::output::{self, Output};
use crate::table::Table;

#[derive(Debug, Serialize)]
struct Answer<'m> {
    robot: &'m str,
    base: &'m str,
    tip: &'m str,
    family: &'static str,
    arm_angle_rad: Option<f64>,
    branches: Vec<Posture>,
    out_of_reach_m: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Posture {
    configuration: String,
    #[serde(serialize_with = "owned_map")]
    joints: Vec<(String, f64)>,
    within_limits: bool,
    beyond: Option<String>,
    singular: Vec<&'static str>,
}

fn owned_map<S: serde::Serializer>(
    entries: &[(String, f64)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let entries: Vec<_> = entries.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    as_map(&entries, serializer)
}

/// Why there are no postures in closed form.
#[derive(Debug, thiserror::Error)]
pub(super) enum BranchesError {
    #[error("--all: {0}; without --all the arm is solved by search")]
    NotRecognised(AnalyticError),
    #[error("--all: the seed has no arm angle: the wrist is in the shoulder")]
    NoArmAngle,
}

/// Prints all postures that bring the tool centre point to `X_BT`.
pub(super) fn run(
    model: &RobotModel,
    chain: &Chain,
    seed: &[f64],
    X_BT: &Pose,
    out: &Output,
) -> anyhow::Result<Exit> {
    let answer = solve(model, chain, seed, &of_tip(chain, X_BT))?;
    if out.is_json() {
        out.json_line(&answer)?;
    } else if !answer.branches.is_empty() {
        print(&answer, out)?;
    }
    if answer.branches.iter().any(|posture| posture.within_limits) {
        return Ok(Exit::Success);
    }
    output::note(match (answer.branches.is_empty(), answer.out_of_reach_m) {
        (true, Some(excess)) => format!("error: the pose is out of reach by {excess} m"),
        (true, None) => "error: no posture reaches the pose".to_owned(),
        (false, _) => "error: every posture is beyond a limit".to_owned(),
    });
    Ok(Exit::Failure)
}

fn solve<'m>(
    model: &'m RobotModel,
    chain: &'m Chain,
    seed: &[f64],
    X_BL: &Pose,
) -> anyhow::Result<Answer<'m>> {
    let answer = |family, arm_angle_rad, branches, out_of_reach_m: Option<f64>| Answer {
        robot: model.name(),
        base: chain.base(),
        tip: chain.tip(),
        family,
        arm_angle_rad,
        branches,
        out_of_reach_m: out_of_reach_m.filter(|excess| excess.is_finite()),
    };
    match AnalyticArm::recognise(model, chain.base(), chain.tip()) {
        Ok(arm) => {
            let reference = gather(arm.variables(), seed)?;
            let found = arm.solve_near(X_BL.isometry(), &reference);
            let within = |branch: &Branch| arm.within_limits(branch, &reference);
            let postures = found.iter().map(|branch| posture(arm.joint_names(), branch, within));
            let family = match arm.family() {
                ArmFamily::ThreeParallelAxes => "three_parallel_axes",
                ArmFamily::SphericalWrist => "spherical_wrist",
            };
            Ok(answer(family, None, postures.collect(), found.out_of_reach_m()))
        }
        Err(AnalyticError::JointCount { given: 7, .. }) => {
            let arm = SevenAxisArm::recognise(model, chain.base(), chain.tip())
                .map_err(BranchesError::NotRecognised)?;
            let reference = gather(arm.variables(), seed)?;
            let angle = arm.arm_angle(&reference).ok_or(BranchesError::NoArmAngle)?;
            let found = arm.solve_near(X_BL.isometry(), angle, &reference);
            let within = |branch: &Branch| arm.within_limits(branch, &reference);
            let postures = found.iter().map(|branch| posture(arm.joint_names(), branch, within));
            Ok(answer("seven_axes", Some(angle), postures.collect(), found.out_of_reach_m()))
        }
        Err(error) => Err(BranchesError::NotRecognised(error).into()),
    }
}

fn gather(variables: &[usize], seed: &[f64]) -> anyhow::Result<Vec<f64>> {
    let position = |&index: &usize| seed.get(index).copied().context("the seed is too short");
    variables.iter().map(position).collect()
}

fn posture(
    names: &[String],
    branch: &Branch,
    within: impl Fn(&Branch) -> Result<Branch, BeyondLimit>,
) -> Posture {
    let (shown, beyond) = match within(branch) {
        Ok(inside) => (inside, None),
        Err(beyond) => {
            let BeyondLimit { joint, value_rad, limit_rad } = beyond;
            let name = names.get(joint).map_or("", String::as_str);
            let text =
                format!("joint {name:?}: {value_rad} rad is beyond the limit {limit_rad} rad");
            (*branch, Some(text))
        }
    };
    Posture {
        configuration: branch.configuration.to_string(),
        joints: names.iter().cloned().zip(shown.joint_position.iter().copied()).collect(),
        within_limits: beyond.is_none(),
        beyond,
        singular: parts(branch.singular),
    }
}

fn parts(singular: Singularities) -> Vec<&'static str> {
    let all =
        [(singular.shoulder, "shoulder"), (singular.elbow, "elbow"), (singular.wrist, "wrist")];
    all.into_iter().filter_map(|(is_singular, name)| is_singular.then_some(name)).collect()
}

fn print(answer: &Answer<'_>, out: &Output) -> anyhow::Result<()> {
    let names = answer.branches.iter().take(1).flat_map(|posture| &posture.joints);
    let mut titles = vec!["configuration"];
    titles.extend(names.map(|(name, _)| name.as_str()));
    titles.push("within limits");
    let mut table = Table::new(&titles);
    for posture in &answer.branches {
        let mut cells = vec![posture.configuration.clone()];
        cells.extend(posture.joints.iter().map(|(_, value)| format!("{value:>9.6}")));
        cells.push(posture.beyond.clone().unwrap_or_else(|| "yes".to_owned()));
        table.row(cells);
    }
    out.line(table)
}

#[cfg(test)]
mod tests {
    use super::super::own_robot;
    use super::*;

    #[test]
    fn every_posture_of_an_arm_reaches_the_pose() {
        let model = own_robot("six_axis_arm.urdf");
        let chain = Chain::from_root(&model, "tool0").expect("a chain");
        let q = [0.3, -1.2, 1.9, -2.4, -1.1, 0.5];
        let goal = Pose::from_isometry(chain.forward(&q).expect("fits"));
        let answer = solve(&model, &chain, &q, &goal).expect("recognised");
        assert_eq!(answer.branches.len(), 8);
        for posture in &answer.branches {
            let positions: Vec<f64> = posture.joints.iter().map(|(_, value)| *value).collect();
            let reached = Pose::from_isometry(chain.forward(&positions).expect("fits"));
            let (distance, angle) = reached.distance(&goal);
            assert!(distance < 1e-9 && angle < 1e-7, "{posture:?}: {distance} {angle}");
        }
    }

    fn chain_to_last(model: &RobotModel) -> Chain {
        let tip = &model.links().last().expect("a link").name;
        Chain::from_root(model, tip).expect("a chain")
    }

    #[test]
    fn a_robot_without_closed_form_is_refused_with_the_reason() {
        for (file, reason) in [
            ("lift_torso.urdf", "--all: joint lift_joint slides"),
            ("seven_axis_arm.urdf", "--all: not an arm with spherical shoulder and wrist: axes"),
        ] {
            let model = own_robot(file);
            let chain = chain_to_last(&model);
            let seed = vec![0.0; model.variable_count()];
            let error = solve(&model, &chain, &seed, &Pose::default()).expect_err(file);
            assert!(error.to_string().starts_with(reason), "{error}");
        }
    }
}
