//! First pass over one joint: type, links, axis, limits and mimicry.

use super::error::UrdfProblem;
use super::findings::{Fault, Problems};
use super::link::scan_origin;
use super::scan::{Index, JointSite, MimicRule, Named, Names, Out, Version};
use super::source::Element;
use super::writer::Value;

/// Axes shorter than this have no direction.
const MIN_AXIS_NORM: f64 = 1e-9;

pub(super) fn scan_joint<'d>(joint: Named<'d>, names: &Names<'d>, out: &mut Out) -> JointSite<'d> {
    let Named { element, name } = joint;
    let joint_type = out.problems.keep(type_of(&element));
    let (parent, parent_name) = end_of(&element, "parent", &names.links, &mut out.problems);
    let (child, child_name) = end_of(&element, "child", &names.links, &mut out.problems);
    let type_text = joint_type.unwrap_or_default();
    out.copy.open("joint", &[("name", Value::Text(name)), ("type", Value::Text(type_text))]);
    scan_origin(&element, names.version, out);
    out.copy.empty("parent", &[("link", Value::Text(parent_name))]);
    out.copy.empty("child", &[("link", Value::Text(child_name))]);
    let mimic = match joint_type {
        // A fixed joint has a place and nothing else: exporters write zero axes and limits into it.
        Some("fixed") => None,
        Some(joint_type) => {
            scan_motion(&element, joint_type, names.version, out);
            scan_mimic(&element, names, out)
        }
        // What else it needs is not known.
        None => None,
    };
    out.copy.close("joint");
    JointSite { element, name, parent, child, moves: joint_type != Some("fixed"), mimic }
}

fn type_of<'d>(joint: &Element<'d>) -> Result<&'d str, Fault> {
    let (subject, joint_type) = (joint.subject(), joint.required_attribute("type")?);
    match joint_type {
        "revolute" | "continuous" | "prismatic" | "fixed" => Ok(joint_type),
        "floating" | "planar" | "spherical" => {
            let joint_type = joint_type.to_owned();
            Err(joint.fault(UrdfProblem::UnsupportedJointType { subject, joint_type }))
        }
        _ => {
            let joint_type = joint_type.to_owned();
            Err(joint.fault(UrdfProblem::UnknownJointType { subject, joint_type }))
        }
    }
}

/// Index and name of the link at an end of the joint.
fn end_of<'d>(
    joint: &Element<'d>,
    end: &'static str,
    links: &Index<'d>,
    problems: &mut Problems,
) -> (Option<usize>, &'d str) {
    let Some(element) = joint.required_child(end, problems) else { return (None, "") };
    let Some(link) = problems.keep(element.required_attribute("link")) else { return (None, "") };
    let index = links.find(link);
    if index.is_none() && links.is_sound {
        let (subject, link) = (joint.subject(), link.to_owned());
        problems.report(element.fault(UrdfProblem::UnknownLink { subject, end, link }));
    }
    (index, link)
}

/// Writes axis and limits.
fn scan_motion(joint: &Element<'_>, joint_type: &str, version: Version, out: &mut Out) {
    if let Some(axis) = joint.child("axis", &mut out.problems)
        && let Some(xyz) = out.problems.keep(direction(&axis))
    {
        out.copy.empty("axis", &[("xyz", Value::Numbers(&xyz))]);
    }
    match joint.child("limit", &mut out.problems) {
        Some(limit) => scan_limit(&limit, joint_type == "continuous", version, out),
        None if joint_type == "continuous" => {}
        None => {
            let (subject, joint_type) = (joint.subject(), joint_type.to_owned());
            let problem = UrdfProblem::MissingLimit { subject, joint_type };
            out.problems.report(joint.fault(problem));
        }
    }
    if let Some(controller) = joint.child("safety_controller", &mut out.problems) {
        scan_soft_limits(&controller, out);
    }
}

/// The axis, scaled so that its squares neither overflow nor vanish when it is normalised.
fn direction(axis: &Element<'_>) -> Result<[f64; 3], Fault> {
    let xyz = axis.required_numbers::<3>("xyz")?;
    let largest = xyz.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    if largest < MIN_AXIS_NORM {
        return Err(axis.fault(UrdfProblem::ZeroAxis { subject: axis.subject() }));
    }
    Ok(xyz.map(|value| value / largest))
}

/// Writes the limits, infinite where there is none.
fn scan_limit(limit: &Element<'_>, turns_freely: bool, version: Version, out: &mut Out) {
    let Out { copy, problems } = out;
    let (lower, upper) =
        problems.keep(position_limits(limit, turns_freely, version)).unwrap_or_default();
    let velocity = if turns_freely {
        limit.non_negative("velocity").map(Option::unwrap_or_default)
    } else {
        limit.required_non_negative("velocity")
    };
    let velocity = problems.keep(velocity).unwrap_or_default();
    let mut optional = |name| problems.keep(limit.non_negative(name)).flatten();
    let effort = optional("effort").unwrap_or(f64::INFINITY);
    let [acceleration, deceleration, jerk] = if version >= Version::WITH_OPEN_LIMITS {
        ["acceleration", "deceleration", "jerk"].map(optional)
    } else {
        [None; 3]
    };
    let acceleration = acceleration.unwrap_or(f64::INFINITY);
    let values = [
        ("lower", lower),
        ("upper", upper),
        ("velocity", velocity),
        ("effort", effort),
        ("acceleration", acceleration),
        ("deceleration", deceleration.unwrap_or(acceleration)),
        ("jerk", jerk.unwrap_or(f64::INFINITY)),
    ]
    .map(|(name, value)| (name, [value]));
    copy.empty("limit", &values.each_ref().map(|(name, value)| (*name, Value::Numbers(value))));
}

/// Lower and upper limit, infinite where there is none.
fn position_limits(
    limit: &Element<'_>,
    turns_freely: bool,
    version: Version,
) -> Result<(f64, f64), Fault> {
    let (lower, upper) = (limit.number("lower")?, limit.number("upper")?);
    if turns_freely {
        return Ok((f64::NEG_INFINITY, f64::INFINITY));
    }
    let open = version >= Version::WITH_OPEN_LIMITS;
    let lower = lower.unwrap_or(if open { f64::NEG_INFINITY } else { 0.0 });
    let upper = upper.unwrap_or(if open { f64::INFINITY } else { 0.0 });
    in_order(limit, "limit", (lower, upper))
}

fn scan_soft_limits(controller: &Element<'_>, out: &mut Out) {
    let Out { copy, problems } = out;
    let (lower, upper) = problems.keep(soft_limits(controller)).unwrap_or_default();
    let k_position = problems.keep(controller.non_negative("k_position")).flatten();
    let k_velocity = problems.keep(controller.required_non_negative("k_velocity"));
    let values = [
        ("soft_lower_limit", lower),
        ("soft_upper_limit", upper),
        ("k_position", k_position.unwrap_or_default()),
        ("k_velocity", k_velocity.unwrap_or_default()),
    ]
    .map(|(name, value)| (name, [value]));
    let attributes = values.each_ref().map(|(name, value)| (*name, Value::Numbers(value)));
    copy.empty("safety_controller", &attributes);
}

fn soft_limits(controller: &Element<'_>) -> Result<(f64, f64), Fault> {
    let lower = controller.number("soft_lower_limit")?.unwrap_or(f64::NEG_INFINITY);
    let upper = controller.number("soft_upper_limit")?.unwrap_or(f64::INFINITY);
    in_order(controller, "soft limit", (lower, upper))
}

fn in_order(
    element: &Element<'_>,
    kind: &'static str,
    (lower, upper): (f64, f64),
) -> Result<(f64, f64), Fault> {
    if lower <= upper {
        return Ok((lower, upper));
    }
    let subject = element.subject();
    Err(element.fault(UrdfProblem::LimitOrder { subject, kind, lower, upper }))
}

fn scan_mimic(joint: &Element<'_>, names: &Names<'_>, out: &mut Out) -> Option<MimicRule> {
    let Out { copy, problems } = out;
    let mimic = joint.child("mimic", problems)?;
    let name = problems.keep(mimic.required_attribute("joint"));
    let master = name.and_then(|name| names.joints.find(name));
    if let Some(name) = name
        && master.is_none()
        && names.joints.is_sound
    {
        let (subject, master) = (mimic.subject(), name.to_owned());
        problems.report(mimic.fault(UrdfProblem::UnknownMaster { subject, master }));
    }
    let mut number = |name, other| {
        problems.keep(mimic.number(name)).map(|number: Option<f64>| number.unwrap_or(other))
    };
    let (multiplier, offset) = (number("multiplier", 1.0), number("offset", 0.0));
    let sound = multiplier.is_some() && offset.is_some();
    let (multiplier, offset) = (multiplier.unwrap_or(1.0), offset.unwrap_or(0.0));
    copy.empty(
        "mimic",
        &[
            ("joint", Value::Text(name.unwrap_or_default())),
            ("multiplier", Value::Numbers(&[multiplier])),
            ("offset", Value::Numbers(&[offset])),
        ],
    );
    Some(MimicRule { master: master.filter(|_| sound), multiplier, offset })
}
