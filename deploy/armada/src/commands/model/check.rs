//! `armada model check`.

use armada_model::{Place, RobotModel, UrdfReport};
use clap::Args;
use serde::Serialize;

use super::file::FileArgs;
use super::input::one_stdin;
use super::srdf::{self, SrdfAnswer};
use crate::exit::Exit;
use crate::output::Output;
use crate::table::Table;

/// Arguments of `armada model check`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada model check arm.urdf
  armada model check arm.urdf arm.srdf
  armada model check arm.urdf --json | jq '.problems[] | .line, .remedy'
  xacro arm.urdf.xacro | armada model check -

Problems make the file unusable, and the exit code 1; warnings do not. Mesh files are counted, not
opened. With an SRDF, exit code 1 also if it cannot be read, or an entry of it cannot be used.

With --json: {\"file\", \"usable\": BOOL, \"problems\" and \"warnings\": [{\"line\", \"column\", \"message\",
\"remedy\"}], \"omitted_problems\", \"omitted_warnings\": NUMBER, \"robot\": null or {\"name\", \"links\",
\"joints\", \"driven\": NUMBER, \"mass_kg\", \"chains\": [{\"root\", \"tip\", \"driven\": [NAME]}]}, \"srdf\": null or
{\"file\", \"readable\": BOOL, \"problems\": [{\"severity\": \"warning\" or \"error\", \"line\", \"column\",
\"element\", \"message\", \"remedy\"}]}}; an SRDF is read only if the URDF can be used.")]
pub(super) struct CheckArgs {
    #[command(flatten)]
    file: FileArgs,
    /// SRDF of the robot, or - for standard input
    #[arg(value_name = "FILE.srdf")]
    srdf: Option<String>,
}

/// Tells everything that is to be said about the files.
pub(super) fn run(args: &CheckArgs) -> anyhow::Result<Exit> {
    one_stdin(&[Some(&args.file.file), args.srdf.as_deref()])?;
    let report = args.file.report()?;
    let mut answer = Answer::of(args.file.label(), &report);
    if let (Some(file), Some(model)) = (&args.srdf, &report.model) {
        answer.srdf = Some(SrdfAnswer::of(srdf::label(file), &srdf::text_of(file)?, model));
    }
    let out = Output::new(args.file.json);
    if out.is_json() {
        out.json(&answer)?;
    } else {
        print(&answer, &out)?;
    }
    let is_sound = answer.usable && answer.srdf.as_ref().is_none_or(SrdfAnswer::is_usable);
    Ok(if is_sound { Exit::Success } else { Exit::Failure })
}

#[derive(Debug, Serialize)]
struct Answer<'r> {
    file: &'r str,
    usable: bool,
    problems: Vec<Finding>,
    warnings: Vec<Finding>,
    omitted_problems: usize,
    omitted_warnings: usize,
    robot: Option<Summary<'r>>,
    srdf: Option<SrdfAnswer<'r>>,
}

#[derive(Debug, Serialize)]
struct Finding {
    line: u32,
    column: u32,
    message: String,
    remedy: String,
}

#[derive(Debug, Serialize)]
struct Summary<'r> {
    name: &'r str,
    links: usize,
    joints: usize,
    driven: usize,
    mass_kg: f64,
    chains: Vec<Chain<'r>>,
}

/// From the root to a link that carries no other, over at least one driven joint.
#[derive(Debug, Serialize)]
struct Chain<'r> {
    root: &'r str,
    tip: &'r str,
    driven: Vec<&'r str>,
}

impl<'r> Answer<'r> {
    fn of(file: &'r str, report: &'r UrdfReport) -> Self {
        let finding = |place: &Place, message: String, remedy: String| Finding {
            line: place.line,
            column: place.column,
            message,
            remedy,
        };
        Self {
            file,
            usable: report.model.is_some(),
            problems: report
                .problems
                .iter()
                .map(|found| finding(&found.place, found.problem.to_string(), found.remedy()))
                .collect(),
            warnings: report
                .warnings
                .iter()
                .map(|found| finding(&found.place, found.doubt.to_string(), found.remedy()))
                .collect(),
            omitted_problems: report.omitted_problems,
            omitted_warnings: report.omitted_warnings,
            robot: report.model.as_ref().map(Summary::of),
            srdf: None,
        }
    }
}

impl<'r> Summary<'r> {
    fn of(model: &'r RobotModel) -> Self {
        let masses = model.links().iter().filter_map(|link| link.inertial.as_ref());
        Self {
            name: model.name(),
            links: model.links().len(),
            joints: model.joints().len(),
            driven: model.variable_count(),
            mass_kg: masses.map(|inertial| inertial.mass).sum(),
            chains: chains(model),
        }
    }
}

fn chains(model: &RobotModel) -> Vec<Chain<'_>> {
    let mut is_leaf = vec![true; model.links().len()];
    for joint in model.joints() {
        if let Some(leaf) = is_leaf.get_mut(joint.parent) {
            *leaf = false;
        }
    }
    let root = model.links().first().map_or("", |root| root.name.as_str());
    let leaves = model.links().iter().zip(is_leaf).filter(|(_, is_leaf)| *is_leaf);
    let chain = |(link, _): (&'_ armada_model::Link, bool)| {
        let tip = model.link_index(&link.name)?;
        let driven = driven_to(model, tip);
        let tip = model.links().get(tip)?.name.as_str();
        (!driven.is_empty()).then_some(Chain { root, tip, driven })
    };
    leaves.filter_map(chain).collect()
}

/// Driven joints on the way to a link, from the root.
fn driven_to(model: &RobotModel, link: usize) -> Vec<&str> {
    let mut names = Vec::new();
    let mut at = model.links().get(link);
    while let Some(joint) =
        at.and_then(|link| link.parent_joint).and_then(|joint| model.joints().get(joint))
    {
        if joint.variable().is_some() {
            names.push(joint.name.as_str());
        }
        at = model.links().get(joint.parent);
    }
    names.reverse();
    names
}

fn print(answer: &Answer<'_>, out: &Output) -> anyhow::Result<()> {
    let kinds = [
        ("problem", &answer.problems, answer.omitted_problems),
        ("warning", &answer.warnings, answer.omitted_warnings),
    ];
    for (kind, findings, omitted) in kinds {
        for Finding { line, column, message, remedy } in findings {
            out.line(format_args!("{}:{line}:{column}: {kind}: {message}", answer.file))?;
            out.line(format_args!("    {remedy}"))?;
        }
        if omitted > 0 {
            out.line(format_args!("{omitted} more {kind}s are left out"))?;
        }
    }
    let total = |findings: &Vec<Finding>, omitted| findings.len() + omitted;
    let (problems, warnings) = (
        total(&answer.problems, answer.omitted_problems),
        total(&answer.warnings, answer.omitted_warnings),
    );
    if problems + warnings > 0 {
        out.line("")?;
    }
    let can = if answer.usable { "can be used" } else { "CANNOT BE USED" };
    out.line(format_args!("{} {can}: problems {problems}, warnings {warnings}", answer.file))?;
    if let Some(robot) = &answer.robot {
        print_robot(robot, out)?;
    }
    match &answer.srdf {
        Some(srdf) => srdf.print(out),
        None => Ok(()),
    }
}

fn print_robot(robot: &Summary<'_>, out: &Output) -> anyhow::Result<()> {
    let mut table = Table::new(&["robot", "links", "joints", "driven", "mass [kg]"]);
    table.row(vec![
        robot.name.to_owned(),
        robot.links.to_string(),
        robot.joints.to_string(),
        robot.driven.to_string(),
        format!("{:.3}", robot.mass_kg),
    ]);
    out.line(format_args!("\n{table}"))?;
    let mut table = Table::new(&["chain from", "to", "driven"]);
    for chain in &robot.chains {
        let driven = chain.driven.len().to_string();
        table.row(vec![chain.root.to_owned(), chain.tip.to_owned(), driven]);
    }
    if robot.chains.is_empty() { Ok(()) } else { out.line(format_args!("\n{table}")) }
}

#[cfg(test)]
mod tests {
    use super::super::own_robot;
    use super::*;

    #[test]
    fn chains_lead_to_every_tip_over_the_joints_that_drive_it() {
        let model = own_robot("six_axis_arm.urdf");
        let names: Vec<_> = model.variables().map(|variable| variable.name).collect();
        let chains = chains(&model);
        let to_tool = chains.iter().find(|chain| chain.tip == "tool0").expect("a tool");
        assert_eq!((to_tool.root, &to_tool.driven), ("base_link", &names));
    }

    #[test]
    fn a_file_that_cannot_be_used_has_no_summary_and_places_of_all_problems() {
        let text = "<robot name='r'>\n  <link name='a'/>\n  <link name='a'/>\n  <link/></robot>";
        let report = RobotModel::check_urdf(text, "r.urdf");
        let answer = serde_json::to_value(Answer::of("r.urdf", &report)).expect("JSON");
        assert_eq!((&answer["usable"], &answer["robot"]), (&false.into(), &().into()));
        let places: Vec<_> = answer["problems"]
            .as_array()
            .expect("a list")
            .iter()
            .map(|problem| (problem["line"].as_u64(), problem["column"].as_u64()))
            .collect();
        assert_eq!(places, [(Some(3), Some(3)), (Some(4), Some(3))]);
    }
}
