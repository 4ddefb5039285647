//! Inverse kinematics on random reachable poses. No peer has a solver of its own.

#![expect(clippy::result_large_err, reason = "a failure holds the best positions, without heap")]
#![allow(non_snake_case, reason = "X_BT is the pose of the tip T in the base B")]

use anyhow::Context as _;
use armada_model::{
    AnalyticArm, Branches, Chain, InverseKinematics, InverseOptions, InverseTarget, SevenAxisArm,
};
use nalgebra::Isometry3;

use super::random::SplitMix;
use super::robots::Arm;
use super::{Bench, TARGET, clocked};
use crate::bench::figures::quantiles;
use crate::bench::report::Section;

/// Largest error of position \[m\] and of orientation \[rad\] of a pose that counts as reached.
const TOLERANCE: f64 = 1e-5;
/// Deviation of the seeds of warm solutions from the posture, in each joint \[rad\].
const NEAR: f64 = 0.05;

/// A pose to be reached.
struct Case {
    posture: Vec<f64>,
    X_BT: Isometry3<f64>,
    /// Another posture.
    far: Vec<f64>,
    /// A posture nearby.
    near: Vec<f64>,
}

/// A closed form, where there is one.
enum Closed {
    Six(Box<AnalyticArm>),
    Seven(Box<SevenAxisArm>),
}

/// Measures one arm.
pub(super) fn measure(bench: &mut Bench<'_>, arm: &Arm<'_>) -> anyhow::Result<Section> {
    let count = (bench.args.calls / 20).clamp(10, 1000);
    let mut random = SplitMix::new(20_261_122);
    let cases: Result<Vec<_>, _> = (0..count).map(|_| case(arm, &mut random)).collect();
    let cases = cases?;
    let options = InverseOptions {
        // A little more precise than asked for, so that rounding does not matter.
        position_tolerance: 0.999 * TOLERANCE,
        orientation_tolerance: 0.999 * TOLERANCE,
        ..InverseOptions::default()
    };
    let solver = InverseKinematics::new(&arm.chain, options);
    let closed = closed(arm);
    let (mut cold, mut warm, mut analytic) = (Vec::new(), Vec::new(), Vec::new());
    for _ in bench.rounds(&arm.robot.name) {
        cold.push(row(&arm.chain, &cases, |case| {
            let target = InverseTarget::Pose(case.X_BT);
            let (found, time) = clocked(|| solver.solve(&case.far, &target));
            (found.ok().map(|solution| solution.positions.to_vec()), time)
        })?);
        warm.push(row(&arm.chain, &cases, |case| {
            let target = InverseTarget::Pose(case.X_BT);
            let (found, time) = clocked(|| solver.solve_warm(&case.near, &target));
            (found.ok().map(|solution| solution.positions.to_vec()), time)
        })?);
        if let Some(closed) = &closed {
            analytic.push(row(&arm.chain, &cases, |case| {
                let (branches, time) = clocked(|| closed.solve(case));
                (branches.first().map(|branch| branch.joint_position.to_vec()), time)
            })?);
        }
    }
    let title = format!("inverse kinematics: {}, {count} reachable poses", arm.robot.name);
    let section = Section::new(title, ["found, %", "p50, µs", "p99, µs"])
        .row("armada, cold", &cold)
        .row("  target: found at least, µs at most", &[[99.9, 20.0, 500.0]])
        .row("armada, warm", &warm)
        .row(format!("  {TARGET}"), &[[f64::NAN, f64::NAN, 5.0]]);
    Ok(if closed.is_some() { section.row("armada, closed form", &analytic) } else { section })
}

fn case(arm: &Arm<'_>, random: &mut SplitMix) -> anyhow::Result<Case> {
    let posture = arm.posture(random);
    let X_BT = arm.chain.forward(&posture)?;
    let far = arm.posture(random);
    let near = posture.iter().map(|position| position + NEAR * random.normal()).collect();
    Ok(Case { posture, X_BT, far, near })
}

/// Share of the cases that are solved \[%\], median and 99th percentile of the times \[µs\].
fn row(
    chain: &Chain,
    cases: &[Case],
    mut solve: impl FnMut(&Case) -> (Option<Vec<f64>>, f64),
) -> anyhow::Result<[f64; 3]> {
    let (mut found, mut times) = (0.0, Vec::with_capacity(cases.len()));
    for case in cases {
        let (positions, time) = solve(case);
        times.push(time);
        let Some(positions) = positions else { continue };
        let reached = chain.forward(&positions)?;
        let off = (reached.translation.vector - case.X_BT.translation.vector).norm();
        if off <= TOLERANCE && reached.rotation.angle_to(&case.X_BT.rotation) <= TOLERANCE {
            found += 1.0;
        }
    }
    let [p50, p99, ..] = quantiles(&mut times).context("no case")?;
    #[expect(clippy::cast_precision_loss, reason = "a small count")]
    let count = cases.len() as f64;
    Ok([100.0 * found / count, p50, p99])
}

fn closed(arm: &Arm<'_>) -> Option<Closed> {
    let (model, base, tip) = (&arm.robot.model, arm.chain.base(), arm.chain.tip());
    let six = AnalyticArm::recognise(model, base, tip).map(|arm| Closed::Six(Box::new(arm)));
    let seven = || SevenAxisArm::recognise(model, base, tip).map(|a| Closed::Seven(Box::new(a)));
    six.or_else(|_| seven()).ok()
}

impl Closed {
    /// All branches; of seven axes those at the arm angle of the posture.
    fn solve(&self, case: &Case) -> Branches {
        match self {
            Self::Six(arm) => arm.solve(&case.X_BT),
            Self::Seven(arm) => {
                let angle = arm.arm_angle(&case.posture).unwrap_or_default();
                arm.solve_near(&case.X_BT, angle, &case.posture)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::robots::{arms, load};
    use super::*;

    #[test]
    fn only_what_reaches_the_pose_counts_as_found() {
        let robots = load(None).expect("our own robots are sound");
        let arm = arms(&robots).expect("known").remove(0);
        let mut random = SplitMix::new(1);
        let cases: Vec<_> = (0..4).map(|_| case(&arm, &mut random).expect("reachable")).collect();
        let mut answers = 0.0;
        let [found, p50, p99] = row(&arm.chain, &cases, |case| {
            answers += 1.0;
            let positions = match answers {
                1.0 => Some(case.posture.clone()),
                2.0 => Some(case.far.clone()),
                3.0 => Some(case.near.clone()),
                _ => None,
            };
            (positions, answers)
        })
        .expect("positions fit");
        assert_eq!((found, p50, p99), (25.0, 2.0, 4.0));
    }
}
