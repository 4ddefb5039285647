//! `armada model info`.

use armada_model::{Joint, JointLimits, Motion, PositionSource, RobotModel};
use clap::Args;
use serde::Serialize;

use super::file::FileArgs;
use super::joints::unit;
use crate::exit::Exit;
use crate::output::Output;
use crate::words;

/// Arguments of `armada model info`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada model info arm.urdf
  armada model info arm.urdf --json | jq '.joints[] | select(.variable != null) | .name'

Each line is a link, with the joint that leads to it in brackets: name, type, position limits, and
limit of the velocity. Driven joints have their number in a position vector.

With --json: {\"robot\": NAME, \"links\": [NAME], \"joints\": [{\"name\", \"parent\", \"child\", \"type\",
\"variable\": NUMBER or null, \"mimic\": null or {\"joint\", \"multiplier\", \"offset\"}, \"limits\": null
or {\"lower\", \"upper\", \"velocity\", …} in rad, m and s}]}; a limit that does not exist is left out.")]
pub(super) struct InfoArgs {
    #[command(flatten)]
    file: FileArgs,
}

/// Prints the tree.
pub(super) fn run(args: &InfoArgs) -> anyhow::Result<Exit> {
    let model = args.file.model()?;
    let out = Output::new(args.file.json);
    if out.is_json() {
        out.json(&Answer::of(&model))?;
        return Ok(Exit::Success);
    }
    out.line(format_args!("{}: {} driven joints", model.name(), model.variable_count()))?;
    for line in tree(&model) {
        out.line(line)?;
    }
    Ok(Exit::Success)
}

#[derive(Debug, Serialize)]
struct Answer<'m> {
    robot: &'m str,
    links: Vec<&'m str>,
    joints: Vec<JointAnswer<'m>>,
}

#[derive(Debug, Serialize)]
struct JointAnswer<'m> {
    name: &'m str,
    parent: &'m str,
    child: &'m str,
    r#type: &'static str,
    variable: Option<usize>,
    mimic: Option<Mimic<'m>>,
    limits: Option<JointLimits>,
}

#[derive(Debug, Serialize)]
struct Mimic<'m> {
    joint: &'m str,
    multiplier: f64,
    offset: f64,
}

impl<'m> Answer<'m> {
    fn of(model: &'m RobotModel) -> Self {
        let joint = |joint: &'m Joint| JointAnswer {
            name: &joint.name,
            parent: link_name(model, joint.parent),
            child: link_name(model, joint.child),
            r#type: joint.motion.as_ref().map_or("fixed", |m| words::joint_type(m.joint_type)),
            variable: joint.variable(),
            mimic: joint.motion.as_ref().and_then(|motion| mimic(model, motion)),
            limits: joint.motion.as_ref().map(|motion| motion.limits),
        };
        Self {
            robot: model.name(),
            links: model.links().iter().map(|link| link.name.as_str()).collect(),
            joints: model.joints().iter().map(joint).collect(),
        }
    }
}

fn link_name(model: &RobotModel, link: usize) -> &str {
    model.links().get(link).map_or("", |link| &link.name)
}

fn mimic<'m>(model: &'m RobotModel, motion: &Motion) -> Option<Mimic<'m>> {
    let PositionSource::Mimic { variable, multiplier, offset } = motion.position else {
        return None;
    };
    let joint = model.variables().nth(variable)?.name;
    Some(Mimic { joint, multiplier, offset })
}

/// One line per link, children under their parents.
fn tree(model: &RobotModel) -> Vec<String> {
    let mut children: Vec<Vec<&Joint>> = vec![Vec::new(); model.links().len()];
    for joint in model.joints() {
        if let Some(of_parent) = children.get_mut(joint.parent) {
            of_parent.push(joint);
        }
    }
    let mut lines = vec![link_name(model, 0).to_owned()];
    // Joints whose children are still to be drawn, the next one last, with what stands before them.
    let mut open: Vec<(&Joint, String, bool)> = Vec::new();
    let push = |open: &mut Vec<_>, link: usize, before: &str| {
        let joints = children.get(link).into_iter().flatten().copied();
        let joints = joints.rev().enumerate().map(|(at, j)| (j, before.to_owned(), at == 0));
        open.extend(joints);
    };
    push(&mut open, 0, "");
    while let Some((joint, before, is_last)) = open.pop() {
        let (branch, below) = if is_last { ("└─ ", "   ") } else { ("├─ ", "│  ") };
        let child = link_name(model, joint.child);
        lines.push(format!("{before}{branch}{child}  ({})", describe(model, joint)));
        push(&mut open, joint.child, &format!("{before}{below}"));
    }
    lines
}

fn describe(model: &RobotModel, joint: &Joint) -> String {
    let name = &joint.name;
    let Some(motion) = &joint.motion else { return format!("{name}: fixed") };
    let joint_type = words::joint_type(motion.joint_type);
    if let Some(Mimic { joint, multiplier, offset }) = mimic(model, motion) {
        return format!("{name}: {joint_type}, {multiplier} * {joint} + {offset}");
    }
    let unit = unit(motion.joint_type);
    let limits = &motion.limits;
    let range = match (limits.lower, limits.upper) {
        (None, None) => "no position limits".to_owned(),
        (lower, upper) => {
            let bound = |limit: Option<f64>| limit.map_or_else(|| "-".to_owned(), short);
            format!("{} to {} {unit}", bound(lower), bound(upper))
        }
    };
    let number = joint.variable().unwrap_or_default();
    format!("#{number} {name}: {joint_type}, {range}, {} {unit}/s", short(limits.velocity))
}

/// At most four decimals.
fn short(value: f64) -> String {
    ((value * 1e4).round() / 1e4).to_string()
}

#[cfg(test)]
mod tests {
    use super::super::own_robot;
    use super::*;

    #[test]
    fn the_tree_has_a_line_for_each_link_under_its_parent() {
        let text = r#"<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
            <link name="d"/>
            <joint name="x" type="prismatic"><parent link="a"/><child link="b"/>
              <limit lower="-0.5" upper="1" velocity="0.1"/></joint>
            <joint name="y" type="continuous"><parent link="b"/><child link="c"/>
              <mimic joint="x" multiplier="-2"/></joint>
            <joint name="z" type="fixed"><parent link="a"/><child link="d"/></joint></robot>"#;
        let model = RobotModel::from_urdf(text, "r.urdf").expect("sound");
        assert_eq!(
            tree(&model),
            [
                "a",
                "├─ b  (#0 x: prismatic, -0.5 to 1 m, 0.1 m/s)",
                "│  └─ c  (y: continuous, -2 * x + 0)",
                "└─ d  (z: fixed)",
            ]
        );
    }

    #[test]
    fn json_has_every_joint_with_its_links_and_limits() {
        let model = own_robot("lift_torso.urdf");
        let answer = serde_json::to_value(Answer::of(&model)).expect("JSON");
        assert_eq!(answer["links"].as_array().map(Vec::len), Some(model.links().len()));
        let joints = answer["joints"].as_array().expect("a list");
        let lift = joints.iter().find(|joint| joint["name"] == "lift_joint").expect("a lift");
        assert_eq!((&lift["variable"], &lift["limits"]["upper"]), (&0.into(), &0.5.into()));
        assert_eq!((&lift["type"], &lift["child"]), (&"prismatic".into(), &"carriage".into()));
    }
}
