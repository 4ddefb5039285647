//! First pass over one link: mass, shapes and their poses.

use nalgebra::{Quaternion, UnitQuaternion};

use super::error::{QuaternionFault, UrdfProblem};
use super::findings::Fault;
use super::scan::{Named, Names, Out, Version};
use super::source::Element;
use super::writer::Value;

/// Quaternions shorter than this hold no direction.
const MIN_QUATERNION_NORM: f64 = 1e-6;
/// Attributes of `<inertia>`.
pub(super) const MOMENTS: [&str; 6] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];

pub(super) fn scan_link(link: &Named<'_>, names: &Names<'_>, out: &mut Out) {
    out.copy.open("link", &[("name", Value::Text(link.name))]);
    if let Some(inertial) = link.element.child("inertial", &mut out.problems) {
        scan_inertial(&inertial, names.version, out);
    }
    for visual in link.element.children_named("visual") {
        out.copy.open("visual", &[]);
        scan_shape(&visual, names.version, out);
        scan_material(&visual, names, out);
        out.copy.close("visual");
    }
    for collision in link.element.children_named("collision") {
        out.copy.open("collision", &[]);
        scan_shape(&collision, names.version, out);
        out.copy.close("collision");
    }
    out.copy.close("link");
}

/// Writes the element's `<origin>`, if it has one, with the orientation as roll, pitch, yaw.
pub(super) fn scan_origin(element: &Element<'_>, version: Version, out: &mut Out) {
    let Some(origin) = element.child("origin", &mut out.problems) else { return };
    let xyz = out.problems.keep(origin.numbers::<3>("xyz")).flatten().unwrap_or_default();
    let rpy = out.problems.keep(orientation(&origin, version)).unwrap_or_default();
    out.copy.empty("origin", &[("xyz", Value::Numbers(&xyz)), ("rpy", Value::Numbers(&rpy))]);
}

/// Roll, pitch and yaw of an `<origin>`.
fn orientation(origin: &Element<'_>, version: Version) -> Result<[f64; 3], Fault> {
    match origin.numbers::<4>("quat_xyzw")? {
        Some(quaternion) => rpy_of(origin, quaternion, version),
        None => Ok(origin.numbers::<3>("rpy")?.unwrap_or_default()),
    }
}

/// Roll, pitch and yaw of the quaternion.
///
/// The URDF reader could convert it, but snaps pitch to a right angle within 0.26 degrees of it.
fn rpy_of(
    origin: &Element<'_>,
    [x, y, z, w]: [f64; 4],
    version: Version,
) -> Result<[f64; 3], Fault> {
    let fail =
        |fault| Err(origin.fault(UrdfProblem::Quaternion { subject: origin.subject(), fault }));
    if version < Version::WITH_QUATERNIONS {
        return fail(QuaternionFault::Version);
    }
    if origin.attribute("rpy").is_some() {
        return fail(QuaternionFault::WithRpy);
    }
    let quaternion = Quaternion::new(w, x, y, z);
    let Some(unit) = UnitQuaternion::try_new(quaternion, MIN_QUATERNION_NORM) else {
        return fail(QuaternionFault::ZeroLength);
    };
    let r = unit.to_rotation_matrix();
    let cos_pitch = r[(0, 0)].hypot(r[(1, 0)]);
    let pitch = (-r[(2, 0)]).atan2(cos_pitch);
    let yaw = r[(1, 0)].atan2(r[(0, 0)]);
    // Roll is what remains after yaw is undone; this stays exact where yaw is arbitrary.
    let (sin, cos) = yaw.sin_cos();
    let roll = (sin * r[(0, 2)] - cos * r[(1, 2)]).atan2(cos * r[(1, 1)] - sin * r[(0, 1)]);
    Ok([roll, pitch, yaw])
}

fn scan_inertial(inertial: &Element<'_>, version: Version, out: &mut Out) {
    out.copy.open("inertial", &[]);
    scan_origin(inertial, version, out);
    if let Some(mass) = inertial.required_child("mass", &mut out.problems) {
        let value = out.problems.keep(mass.required_non_negative("value")).unwrap_or_default();
        out.copy.empty("mass", &[("value", Value::Numbers(&[value]))]);
    }
    if let Some(inertia) = inertial.required_child("inertia", &mut out.problems) {
        let values = MOMENTS
            .map(|name| out.problems.keep(inertia.required_numbers::<1>(name)).unwrap_or_default());
        let attributes: Vec<_> = MOMENTS
            .into_iter()
            .zip(&values)
            .map(|(name, value)| (name, Value::Numbers(value)))
            .collect();
        out.copy.empty("inertia", &attributes);
    }
    out.copy.close("inertial");
}

fn scan_shape(element: &Element<'_>, version: Version, out: &mut Out) {
    scan_origin(element, version, out);
    let Some(geometry) = element.required_child("geometry", &mut out.problems) else { return };
    let shapes: Vec<_> = geometry.children().collect();
    let [shape] = shapes.as_slice() else {
        let (subject, count) = (geometry.subject(), shapes.len());
        out.problems.report(geometry.fault(UrdfProblem::ShapeCount { subject, count }));
        return;
    };
    out.copy.open("geometry", &[]);
    scan_geometry(shape, out);
    out.copy.close("geometry");
}

fn scan_geometry(shape: &Element<'_>, out: &mut Out) {
    let Out { copy, problems } = out;
    let mut length = |name| [problems.keep(shape.required_non_negative(name)).unwrap_or_default()];
    match shape.name() {
        "box" => {
            let size = problems.keep(box_size(shape)).unwrap_or_default();
            copy.empty("box", &[("size", Value::Numbers(&size))]);
        }
        name @ ("cylinder" | "capsule") => {
            let (radius, length) = (length("radius"), length("length"));
            let attributes =
                [("radius", Value::Numbers(&radius)), ("length", Value::Numbers(&length))];
            copy.empty(name, &attributes);
        }
        "sphere" => copy.empty("sphere", &[("radius", Value::Numbers(&length("radius")))]),
        "mesh" => {
            let filename = problems.keep(shape.required_attribute("filename")).unwrap_or_default();
            let scale = problems.keep(shape.numbers::<3>("scale")).flatten().unwrap_or([1.0; 3]);
            let attributes =
                [("filename", Value::Text(filename)), ("scale", Value::Numbers(&scale))];
            copy.empty("mesh", &attributes);
        }
        other => {
            let (subject, shape_name) = (shape.subject(), other.to_owned());
            problems.report(shape.fault(UrdfProblem::UnknownShape { subject, shape: shape_name }));
        }
    }
}

fn box_size(shape: &Element<'_>) -> Result<[f64; 3], Fault> {
    let size = shape.required_numbers::<3>("size")?;
    match size.iter().find(|&&value| value < 0.0) {
        Some(&value) => Err(shape.negative("size", value)),
        None => Ok(size),
    }
}

/// Writes the colour that the visual's material has, here or where it is defined.
fn scan_material(visual: &Element<'_>, names: &Names<'_>, out: &mut Out) {
    let Some(material) = visual.child("material", &mut out.problems) else { return };
    let name = material.attribute("name").unwrap_or_default();
    let rgba = match material.child("color", &mut out.problems) {
        Some(colour) => out.problems.keep(colour.required_numbers::<4>("rgba")),
        None => names.colours.get(name).copied(),
    };
    let Some(rgba) = rgba else { return };
    out.copy.open("material", &[("name", Value::Text(name))]);
    out.copy.empty("color", &[("rgba", Value::Numbers(&rgba))]);
    out.copy.close("material");
}
