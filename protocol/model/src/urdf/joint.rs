//! First pass over one joint: type, links, axis, limits and mimicry.

use super::error::{UrdfError, UrdfProblem};
use super::link::scan_origin;
use super::scan::{JointSite, Named, Names, Version};
use super::source::Element;
use super::writer::{Value, Writer};

/// Axes shorter than this have no direction.
const MIN_AXIS_NORM: f64 = 1e-9;

pub(super) fn scan_joint<'d>(
    joint: Named<'d>,
    names: &Names<'d>,
    writer: &mut Writer,
) -> Result<JointSite<'d>, UrdfError> {
    let Named { element, name } = joint;
    let joint_type = type_of(&element)?;
    let (parent, parent_name) = end_of(&element, "parent", names)?;
    let (child, child_name) = end_of(&element, "child", names)?;
    writer.open("joint", &[("name", Value::Text(name)), ("type", Value::Text(joint_type))]);
    scan_origin(&element, names.version, writer)?;
    writer.empty("parent", &[("link", Value::Text(parent_name))]);
    writer.empty("child", &[("link", Value::Text(child_name))]);
    let moves = joint_type != "fixed";
    // A fixed joint has a place and nothing else: exporters write zero axes and limits into it.
    let master = if moves { scan_motion(&element, joint_type, names, writer)? } else { None };
    writer.close("joint");
    Ok(JointSite { element, name, parent, child, moves, master })
}

fn type_of<'d>(joint: &Element<'d>) -> Result<&'d str, UrdfError> {
    let (subject, joint_type) = (joint.subject(), joint.required_attribute("type")?);
    match joint_type {
        "revolute" | "continuous" | "prismatic" | "fixed" => Ok(joint_type),
        "floating" | "planar" | "spherical" => {
            let joint_type = joint_type.to_owned();
            Err(joint.error(UrdfProblem::UnsupportedJointType { subject, joint_type }))
        }
        _ => {
            let joint_type = joint_type.to_owned();
            Err(joint.error(UrdfProblem::UnknownJointType { subject, joint_type }))
        }
    }
}

fn end_of<'d>(
    joint: &Element<'d>,
    end: &'static str,
    names: &Names<'d>,
) -> Result<(usize, &'d str), UrdfError> {
    let element = joint.required_child(end)?;
    let link = element.required_attribute("link")?;
    match names.links.get(link) {
        Some(&index) => Ok((index, link)),
        None => Err(element.error(UrdfProblem::UnknownLink {
            subject: joint.subject(),
            end,
            link: link.to_owned(),
        })),
    }
}

/// Writes what describes the motion; index of the joint that it mimics.
fn scan_motion(
    joint: &Element<'_>,
    joint_type: &str,
    names: &Names<'_>,
    writer: &mut Writer,
) -> Result<Option<usize>, UrdfError> {
    scan_axis(joint, writer)?;
    match joint.child("limit")? {
        Some(limit) => scan_limit(&limit, joint_type, names.version, writer)?,
        None if joint_type == "continuous" => {}
        None => {
            let (subject, joint_type) = (joint.subject(), joint_type.to_owned());
            return Err(joint.error(UrdfProblem::MissingLimit { subject, joint_type }));
        }
    }
    scan_soft_limits(joint, writer)?;
    scan_mimic(joint, names, writer)
}

fn scan_axis(joint: &Element<'_>, writer: &mut Writer) -> Result<(), UrdfError> {
    let Some(axis) = joint.child("axis")? else {
        return Ok(());
    };
    let xyz = axis.required_numbers::<3>("xyz")?;
    let largest = xyz.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    if largest < MIN_AXIS_NORM {
        return Err(axis.error(UrdfProblem::ZeroAxis { subject: axis.subject() }));
    }
    // Scaled first, so that squares neither overflow nor vanish when the axis is normalised.
    let scaled = xyz.map(|value| value / largest);
    writer.empty("axis", &[("xyz", Value::Numbers(&scaled))]);
    Ok(())
}

/// Writes the limits, infinite where there is none.
fn scan_limit(
    limit: &Element<'_>,
    joint_type: &str,
    version: Version,
    writer: &mut Writer,
) -> Result<(), UrdfError> {
    let turns_freely = joint_type == "continuous";
    let (lower, upper) = position_limits(limit, turns_freely, version)?;
    let velocity = match limit.non_negative("velocity")? {
        None if turns_freely => 0.0,
        None => limit.required_non_negative("velocity")?,
        Some(velocity) => velocity,
    };
    let effort = limit.non_negative("effort")?.unwrap_or(f64::INFINITY);
    let (acceleration, deceleration, jerk) = if version >= Version::WITH_OPEN_LIMITS {
        let acceleration = limit.non_negative("acceleration")?.unwrap_or(f64::INFINITY);
        let deceleration = limit.non_negative("deceleration")?.unwrap_or(acceleration);
        (acceleration, deceleration, limit.non_negative("jerk")?.unwrap_or(f64::INFINITY))
    } else {
        (f64::INFINITY, f64::INFINITY, f64::INFINITY)
    };
    writer.empty(
        "limit",
        &[
            ("lower", Value::Numbers(&[lower])),
            ("upper", Value::Numbers(&[upper])),
            ("velocity", Value::Numbers(&[velocity])),
            ("effort", Value::Numbers(&[effort])),
            ("acceleration", Value::Numbers(&[acceleration])),
            ("deceleration", Value::Numbers(&[deceleration])),
            ("jerk", Value::Numbers(&[jerk])),
        ],
    );
    Ok(())
}

/// Lower and upper limit, infinite where there is none.
fn position_limits(
    limit: &Element<'_>,
    turns_freely: bool,
    version: Version,
) -> Result<(f64, f64), UrdfError> {
    let (lower, upper) = (limit.number("lower")?, limit.number("upper")?);
    if turns_freely {
        return Ok((f64::NEG_INFINITY, f64::INFINITY));
    }
    let open = version >= Version::WITH_OPEN_LIMITS;
    let lower = lower.unwrap_or(if open { f64::NEG_INFINITY } else { 0.0 });
    let upper = upper.unwrap_or(if open { f64::INFINITY } else { 0.0 });
    if lower > upper {
        let (subject, kind) = (limit.subject(), "limit");
        return Err(limit.error(UrdfProblem::LimitOrder { subject, kind, lower, upper }));
    }
    Ok((lower, upper))
}

fn scan_soft_limits(joint: &Element<'_>, writer: &mut Writer) -> Result<(), UrdfError> {
    let Some(controller) = joint.child("safety_controller")? else {
        return Ok(());
    };
    let lower = controller.number("soft_lower_limit")?.unwrap_or(f64::NEG_INFINITY);
    let upper = controller.number("soft_upper_limit")?.unwrap_or(f64::INFINITY);
    if lower > upper {
        let (subject, kind) = (controller.subject(), "soft limit");
        return Err(controller.error(UrdfProblem::LimitOrder { subject, kind, lower, upper }));
    }
    let k_position = controller.non_negative("k_position")?.unwrap_or(0.0);
    let k_velocity = controller.required_non_negative("k_velocity")?;
    writer.empty(
        "safety_controller",
        &[
            ("soft_lower_limit", Value::Numbers(&[lower])),
            ("soft_upper_limit", Value::Numbers(&[upper])),
            ("k_position", Value::Numbers(&[k_position])),
            ("k_velocity", Value::Numbers(&[k_velocity])),
        ],
    );
    Ok(())
}

fn scan_mimic(
    joint: &Element<'_>,
    names: &Names<'_>,
    writer: &mut Writer,
) -> Result<Option<usize>, UrdfError> {
    let Some(mimic) = joint.child("mimic")? else {
        return Ok(None);
    };
    let master = mimic.required_attribute("joint")?;
    let Some(&index) = names.joints.get(master) else {
        let (subject, master) = (mimic.subject(), master.to_owned());
        return Err(mimic.error(UrdfProblem::UnknownMaster { subject, master }));
    };
    let multiplier = mimic.number("multiplier")?.unwrap_or(1.0);
    let offset = mimic.number("offset")?.unwrap_or(0.0);
    writer.empty(
        "mimic",
        &[
            ("joint", Value::Text(master)),
            ("multiplier", Value::Numbers(&[multiplier])),
            ("offset", Value::Numbers(&[offset])),
        ],
    );
    Ok(Some(index))
}
