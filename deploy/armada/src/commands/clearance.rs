//! `armada check-clearance`: how near robots come to each other on a trajectory.

use std::path::PathBuf;

use armada_protocol::messages::{CheckClearanceParams, ClearanceAnswer};
use armada_protocol::method::cell::CheckClearance;
use clap::{Args, ValueHint};

use crate::cell_address::CellArgs;
use crate::commands::run::Plan;
use crate::exit::Exit;
use crate::words;

/// Links without a shape that are named; of more their number is told.
const NAMED: usize = 6;

/// Arguments of `armada check-clearance`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada check-clearance config/motions/handover.json
  armada check-clearance lift.json --offset-ms 60    with one robot up to 60 ms ahead of another

The file is one of `armada run`, with joints named ROBOT/JOINT. Nothing moves.
Exit code 0: clear. 1: too near, or nothing is known of any two robots.")]
pub(crate) struct ClearanceArgs {
    /// Trajectory
    #[arg(value_name = "FILE.json", value_hint = ValueHint::FilePath)]
    file: PathBuf,
    /// How far the phases of two robots may be apart, 0 to 10000; what lies between is checked too
    #[arg(long, value_name = "MILLISECONDS", default_value = "0",
        allow_hyphen_values = true, value_parser = parse_offset)]
    offset_ms: f64,
    #[command(flatten)]
    cell: CellArgs,
}

fn parse_offset(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(offset) if (0.0..=10_000.0).contains(&offset) => Ok(offset),
        _ => Err("must be a number of milliseconds from 0 to 10000".to_owned()),
    }
}

/// Has the gateway check a trajectory.
pub(crate) async fn run(args: ClearanceArgs) -> anyhow::Result<Exit> {
    let plan = Plan::load(&args.file, None)?;
    let (client, _) = args.cell.connect().await?;
    let trajectory = plan.trajectory().clone();
    let params = CheckClearanceParams { trajectory, offset_ms: args.offset_ms };
    let answer = client.call_cell::<CheckClearance>(params).await?;
    let out = args.cell.output();
    if out.is_json() {
        out.json(&answer)?;
    } else {
        out.line(told(&plan.title(), &answer))?;
    }
    let is_known = answer.distance_m.is_some();
    Ok(if answer.clear && is_known { Exit::Success } else { Exit::Failure })
}

fn told(title: &str, answer: &ClearanceAnswer) -> String {
    let required = format!("{} m", words::tidy(answer.required_m, 3));
    let mut lines = vec![match answer.distance_m {
        None => format!("{title}: NOT KNOWN: no two robots have shapes"),
        Some(distance) => {
            let verdict = if answer.clear { "clear" } else { "TOO NEAR" };
            let distance = words::tidy(distance, 4);
            format!("{title}: {verdict}: at least {distance} m apart, {required} are required")
        }
    }];
    if let Some((a, b)) = &answer.links {
        let at = answer.at_s.map_or_else(String::new, |at| format!(", at {at:.2} s"));
        lines.push(format!("  nearest: {a} and {b}{at}"));
    }
    let unknown = answer.without_shape.len();
    if unknown > 0 {
        let mut named = answer.without_shape.iter().take(NAMED).cloned().collect::<Vec<_>>();
        if unknown > NAMED {
            named.push(format!("and {} more", unknown - NAMED));
        }
        lines.push(format!("  without a shape, so nothing is known of: {}", named.join(", ")));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn golden() -> ClearanceAnswer {
        let text = include_str!("../../../../protocol/golden/answer_clearance.json");
        serde_json::from_str(text).expect("the golden sample")
    }

    #[test]
    fn robots_that_come_too_near_are_told_with_links_distance_and_time() {
        let expected = "\
lift: TOO NEAR: at least 0.0075 m apart, 0.010 m are required
  nearest: left_arm/forearm_link and right_arm/wrist_1_link, at 1.25 s
  without a shape, so nothing is known of: torso/lift_link";
        assert_eq!(told("lift", &golden()), expected);
    }

    #[test]
    fn robots_without_shapes_are_never_told_to_be_clear() {
        let shapeless = ClearanceAnswer {
            clear: true,
            distance_m: None,
            links: None,
            without_shape: (0..9).map(|link| format!("torso/link_{link}")).collect(),
            ..golden()
        };
        let text = told("lift", &shapeless);
        assert!(text.starts_with("lift: NOT KNOWN"), "{text}");
        assert!(text.ends_with("torso/link_5, and 3 more"), "{text}");
    }

    #[test]
    fn an_offset_is_from_zero_to_ten_seconds() {
        assert_eq!(parse_offset("60"), Ok(60.0));
        for bad in ["-1", "10001", "NaN", "some"] {
            assert!(parse_offset(bad).is_err(), "{bad}");
        }
    }
}
