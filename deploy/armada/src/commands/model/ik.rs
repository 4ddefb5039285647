//! `armada model ik`.

#![allow(non_snake_case, reason = "X_BT is the pose of frame T in frame B")]

use armada_model::{
    Chain, InverseCause, InverseKinematics, InverseOptions, InverseTarget, JointVector, Pose,
    Residual, RobotModel,
};
use clap::Args;
use serde::Serialize;

use super::branches;
use super::file::FileArgs;
use super::input::{one_stdin, text_of};
use super::joints::{self, as_map, outside_limits, unit};
use super::pose;
use super::tip::TipArgs;
use crate::exit::{Exit, UsageError};
use crate::output::{self, Output};
use crate::table::Table;

/// Arguments of `armada model ik`.
#[derive(Args, Debug)]
#[command(after_help = format!("{AFTER_HELP}\n\n{}", pose::HELP))]
pub(super) struct IkArgs {
    #[command(flatten)]
    file: FileArgs,
    #[command(flatten)]
    tip: TipArgs,
    /// Pose that the tool centre point is to reach, in the base
    #[arg(long, value_name = "POSE")]
    pose: String,
    /// Positions to start from, as for `fk --joints`; at 0, or the limit nearest to it, if left out
    #[arg(long, value_name = "JSON")]
    seed: Option<String>,
    /// Reach the position, in any orientation
    #[arg(long, conflicts_with = "all")]
    position_only: bool,
    /// All postures that reach the pose, in closed form; of seven joints at the seed's arm angle
    #[arg(long)]
    all: bool,
}

const AFTER_HELP: &str = "Examples:
  armada model ik arm.urdf --tip tool0 --pose @goal.json
  armada model ik arm.urdf --tip tool0 --pose @goal.json --seed @now.json --json | jq .joints
  armada model ik arm.urdf --tip tool0 --pose @goal.json --all

The same seed and pose always give the same answer. Exit code 1: the pose is not reached; the cause
and the best positions found are told.

With --json, one line: {\"robot\", \"base\", \"tip\": NAME, \"solved\": BOOL, \"joints\": {NAME: POSITION},
\"residual\": {\"position_m\", \"orientation_rad\"}, \"iterations\", \"starts\": NUMBER, \"cause\": null or
{\"kind\": \"seed\", \"target\", \"out_of_reach\", \"joint_limit\", \"singular\" or \"iterations\",
\"message\": TEXT, …}}; where it is not solved, joints and residual are the best found.
With --json --all: {\"robot\", \"base\", \"tip\", \"family\": NAME, \"arm_angle_rad\": NUMBER or null,
\"branches\": [{\"configuration\": \"front-up-no-flip\", \"joints\": {NAME: POSITION}, \"within_limits\":
BOOL, \"beyond\": null or TEXT, \"singular\": [NAME]}], \"out_of_reach_m\": NUMBER or null}.";

#[derive(Debug, Serialize)]
struct Answer<'m> {
    robot: &'m str,
    base: &'m str,
    tip: &'m str,
    solved: bool,
    #[serde(serialize_with = "as_map")]
    joints: Vec<(&'m str, f64)>,
    residual: Off,
    iterations: u32,
    starts: u32,
    cause: Option<Cause<'m>>,
}

#[derive(Debug, Serialize)]
struct Off {
    position_m: f64,
    orientation_rad: f64,
}

#[derive(Debug, Serialize)]
struct Cause<'m> {
    #[serde(flatten)]
    kind: Kind<'m>,
    message: String,
}

#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Kind<'m> {
    Seed,
    Target,
    OutOfReach { excess_m: f64 },
    JointLimit { joint: &'m str, side: String, value: f64, limit: f64 },
    Singular { smallest: f64, linear: [f64; 3], angular: [f64; 3] },
    Iterations { iterations: u32 },
}

impl<'m> Cause<'m> {
    fn of(cause: &InverseCause, chain: &'m Chain) -> Self {
        let plain = |kind| Self { kind, message: cause.to_string() };
        match *cause {
            InverseCause::Seed(_) => plain(Kind::Seed),
            InverseCause::Target => plain(Kind::Target),
            InverseCause::OutOfReach { excess } => plain(Kind::OutOfReach { excess_m: excess }),
            InverseCause::JointLimit { joint, side, value, limit } => {
                let Some(variable) = chain.variables().get(joint) else {
                    let side = side.to_string();
                    return plain(Kind::JointLimit { joint: "", side, value, limit });
                };
                let (joint, unit) = (variable.name.as_str(), unit(variable.joint_type));
                let message = format!(
                    "joint {joint:?} would stand at {value} {unit}, beyond its {side} limit {limit} {unit}"
                );
                let side = side.to_string();
                Self { kind: Kind::JointLimit { joint, side, value, limit }, message }
            }
            InverseCause::Singular { smallest, direction } => {
                let (linear, angular) = (direction.linear.into(), direction.angular.into());
                let message = format!(
                    "{cause}: the tool cannot move along {linear:.3?} m/s turning {angular:.3?} rad/s"
                );
                Self { kind: Kind::Singular { smallest, linear, angular }, message }
            }
            InverseCause::Iterations { iterations } => plain(Kind::Iterations { iterations }),
        }
    }
}

/// Positions from a seed, or all zero and inside the limits.
fn seed(model: &RobotModel, argument: Option<&str>) -> anyhow::Result<Vec<f64>> {
    let Some(argument) = argument else {
        let inside = |limits: &armada_model::JointLimits| {
            0.0_f64.min(limits.upper.unwrap_or(0.0)).max(limits.lower.unwrap_or(f64::MIN))
        };
        return Ok(model.variables().map(|variable| inside(&variable.motion.limits)).collect());
    };
    let text = text_of(argument)?;
    Ok(joints::parse(model, &text).map_err(|error| UsageError(format!("--seed: {error}")))?)
}

/// Prints joint positions that reach the pose.
pub(super) fn run(args: &IkArgs) -> anyhow::Result<Exit> {
    let (seed_text, tool) = (args.seed.as_deref(), args.tip.tool.as_deref());
    one_stdin(&[Some(&args.file.file), Some(&args.pose), seed_text, tool])?;
    let model = args.file.model()?;
    let chain = args.tip.chain(&model)?;
    let seed = seed(&model, seed_text)?;
    let X_BT = pose::of_argument("--pose", &args.pose)?;
    for warning in outside_limits(&model, &seed) {
        output::note(format_args!("warning: seed: {warning}"));
    }
    let out = Output::new(args.file.json);
    if args.all {
        return branches::run(&model, &chain, &seed, &X_BT, &out);
    }
    let target = if args.position_only {
        InverseTarget::Position(*X_BT.position())
    } else {
        InverseTarget::Pose(*X_BT.isometry())
    };
    let answer = solve(&model, &chain, &seed, &target)?;
    if out.is_json() {
        out.json_line(&answer)?;
    } else {
        print(&answer, &chain, &out)?;
    }
    let Some(cause) = &answer.cause else { return Ok(Exit::Success) };
    output::note(format_args!("error: no solution: {}", cause.message));
    Ok(Exit::Failure)
}

fn solve<'m>(
    model: &'m RobotModel,
    chain: &'m Chain,
    seed: &[f64],
    target: &InverseTarget,
) -> anyhow::Result<Answer<'m>> {
    let own = chain.gather(seed)?;
    let answer = |positions: &JointVector, residual: &Residual, (iterations, starts)| Answer {
        robot: model.name(),
        base: chain.base(),
        tip: chain.tip(),
        solved: true,
        joints: named(chain, positions),
        residual: Off { position_m: residual.position, orientation_rad: residual.orientation },
        iterations,
        starts,
        cause: None,
    };
    let solver = InverseKinematics::new(chain, InverseOptions::default());
    Ok(match solver.solve(&own, target) {
        Ok(found) => answer(&found.positions, &found.residual, (found.iterations, found.starts)),
        Err(failure) => Answer {
            solved: false,
            cause: Some(Cause::of(&failure.cause, chain)),
            ..answer(&failure.positions, &failure.residual, (failure.iterations, failure.starts))
        },
    })
}

fn named<'m>(chain: &'m Chain, positions: &[f64]) -> Vec<(&'m str, f64)> {
    let names = chain.variables().iter().map(|variable| variable.name.as_str());
    names.zip(positions.iter().copied()).collect()
}

fn print(answer: &Answer<'_>, chain: &Chain, out: &Output) -> anyhow::Result<()> {
    let title = if answer.solved { "position" } else { "best position found" };
    let mut table = Table::new(&["joint", title, ""]);
    for ((name, position), variable) in answer.joints.iter().zip(chain.variables()) {
        let unit = unit(variable.joint_type).to_owned();
        table.row(vec![(*name).to_owned(), format!("{position:>9.6}"), unit]);
    }
    out.line(table)?;
    let Off { position_m, orientation_rad } = answer.residual;
    out.line(format_args!("\noff by {position_m:.2e} m and {orientation_rad:.2e} rad"))
}

/// The pose of the tip link for that of the tool centre point.
pub(super) fn of_tip(chain: &Chain, X_BT: &Pose) -> Pose {
    *X_BT * chain.tool().inverse()
}

#[cfg(test)]
mod tests {
    use armada_model::LimitSide;

    use super::super::own_robot;
    use super::*;

    #[test]
    fn the_default_seed_is_inside_the_limits() {
        for robot in ["six_axis_arm.urdf", "seven_axis_arm.urdf", "lift_torso.urdf"] {
            let model = own_robot(robot);
            let seed = seed(&model, None).expect("no seed to read");
            assert_eq!(outside_limits(&model, &seed), Vec::<String>::new(), "{robot}");
        }
    }

    #[test]
    fn causes_name_the_joint_and_its_unit() {
        let model = own_robot("six_axis_arm.urdf");
        let chain = Chain::from_root(&model, "tool0").expect("a chain");
        let side = LimitSide::Upper;
        let cause = InverseCause::JointLimit { joint: 2, side, value: 3.5, limit: 3.1 };
        let cause = Cause::of(&cause, &chain);
        assert_eq!(
            cause.message,
            "joint \"elbow_joint\" would stand at 3.5 rad, beyond its upper limit 3.1 rad"
        );
        let json = serde_json::to_value(cause).expect("JSON");
        assert_eq!((&json["kind"], &json["joint"]), (&"joint_limit".into(), &"elbow_joint".into()));
    }

    #[test]
    fn a_pose_too_far_away_is_told_by_how_much_at_least() {
        let model = own_robot("six_axis_arm.urdf");
        let chain = Chain::from_root(&model, "tool0").expect("a chain");
        let target = InverseTarget::Position([9.0, 0.0, 0.0].into());
        let answer = solve(&model, &chain, &[0.0; 6], &target).expect("an answer");
        let cause = answer.cause.expect("too far");
        let Kind::OutOfReach { excess_m } = cause.kind else { panic!("{cause:?}") };
        assert!(excess_m > 6.0 && excess_m < 9.0, "{excess_m}");
        assert!(!answer.solved && answer.residual.position_m >= excess_m);
    }
}
