//! First pass over one link: mass, shapes and their poses.

use nalgebra::{Quaternion, UnitQuaternion};

use super::error::{QuaternionFault, UrdfError, UrdfProblem};
use super::scan::{Named, Names, Version};
use super::source::Element;
use super::writer::{Value, Writer};

/// Quaternions shorter than this hold no direction.
const MIN_QUATERNION_NORM: f64 = 1e-6;

pub(super) fn scan_link(
    link: &Named<'_>,
    names: &Names<'_>,
    writer: &mut Writer,
) -> Result<(), UrdfError> {
    writer.open("link", &[("name", Value::Text(link.name))]);
    if let Some(inertial) = link.element.child("inertial")? {
        scan_inertial(&inertial, names.version, writer)?;
    }
    for visual in link.element.children_named("visual") {
        writer.open("visual", &[]);
        scan_shape(&visual, names.version, writer)?;
        scan_material(&visual, names, writer)?;
        writer.close("visual");
    }
    for collision in link.element.children_named("collision") {
        writer.open("collision", &[]);
        scan_shape(&collision, names.version, writer)?;
        writer.close("collision");
    }
    writer.close("link");
    Ok(())
}

/// Writes the element's `<origin>`, if it has one, with the orientation as roll, pitch, yaw.
pub(super) fn scan_origin(
    element: &Element<'_>,
    version: Version,
    writer: &mut Writer,
) -> Result<(), UrdfError> {
    let Some(origin) = element.child("origin")? else {
        return Ok(());
    };
    let xyz = origin.numbers::<3>("xyz")?.unwrap_or_default();
    let rpy = match origin.numbers::<4>("quat_xyzw")? {
        Some(quaternion) => rpy_of(&origin, quaternion, version)?,
        None => origin.numbers::<3>("rpy")?.unwrap_or_default(),
    };
    writer.empty("origin", &[("xyz", Value::Numbers(&xyz)), ("rpy", Value::Numbers(&rpy))]);
    Ok(())
}

/// Roll, pitch and yaw of the quaternion.
///
/// The URDF reader could convert it, but snaps pitch to a right angle within 0.26 degrees of it.
fn rpy_of(
    origin: &Element<'_>,
    [x, y, z, w]: [f64; 4],
    version: Version,
) -> Result<[f64; 3], UrdfError> {
    let fail =
        |fault| Err(origin.error(UrdfProblem::Quaternion { subject: origin.subject(), fault }));
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

fn scan_inertial(
    inertial: &Element<'_>,
    version: Version,
    writer: &mut Writer,
) -> Result<(), UrdfError> {
    const MOMENTS: [&str; 6] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
    let mass = inertial.required_child("mass")?.required_non_negative("value")?;
    let inertia = inertial.required_child("inertia")?;
    writer.open("inertial", &[]);
    scan_origin(inertial, version, writer)?;
    writer.empty("mass", &[("value", Value::Numbers(&[mass]))]);
    let mut values = [[0.0]; 6];
    for (name, value) in MOMENTS.into_iter().zip(&mut values) {
        *value = inertia.required_numbers::<1>(name)?;
    }
    let attributes: Vec<_> = MOMENTS
        .into_iter()
        .zip(&values)
        .map(|(name, value)| (name, Value::Numbers(value)))
        .collect();
    writer.empty("inertia", &attributes);
    writer.close("inertial");
    Ok(())
}

fn scan_shape(
    element: &Element<'_>,
    version: Version,
    writer: &mut Writer,
) -> Result<(), UrdfError> {
    scan_origin(element, version, writer)?;
    let geometry = element.required_child("geometry")?;
    let shapes: Vec<_> = geometry.children().collect();
    let [shape] = shapes.as_slice() else {
        let (subject, count) = (geometry.subject(), shapes.len());
        return Err(geometry.error(UrdfProblem::ShapeCount { subject, count }));
    };
    writer.open("geometry", &[]);
    scan_geometry(shape, writer)?;
    writer.close("geometry");
    Ok(())
}

fn scan_geometry(shape: &Element<'_>, writer: &mut Writer) -> Result<(), UrdfError> {
    match shape.name() {
        "box" => {
            let size = shape.required_numbers::<3>("size")?;
            if let Some(&value) = size.iter().find(|&&value| value < 0.0) {
                return Err(shape.negative("size", value));
            }
            writer.empty("box", &[("size", Value::Numbers(&size))]);
        }
        name @ ("cylinder" | "capsule") => {
            let radius = [shape.required_non_negative("radius")?];
            let length = [shape.required_non_negative("length")?];
            let attributes =
                [("radius", Value::Numbers(&radius)), ("length", Value::Numbers(&length))];
            writer.empty(name, &attributes);
        }
        "sphere" => {
            let radius = [shape.required_non_negative("radius")?];
            writer.empty("sphere", &[("radius", Value::Numbers(&radius))]);
        }
        "mesh" => {
            let filename = shape.required_attribute("filename")?;
            let scale = shape.numbers::<3>("scale")?.unwrap_or([1.0; 3]);
            let attributes =
                [("filename", Value::Text(filename)), ("scale", Value::Numbers(&scale))];
            writer.empty("mesh", &attributes);
        }
        other => {
            let (subject, shape_name) = (shape.subject(), other.to_owned());
            return Err(shape.error(UrdfProblem::UnknownShape { subject, shape: shape_name }));
        }
    }
    Ok(())
}

/// Writes the colour that the visual's material has, here or where it is defined.
fn scan_material(
    visual: &Element<'_>,
    names: &Names<'_>,
    writer: &mut Writer,
) -> Result<(), UrdfError> {
    let Some(material) = visual.child("material")? else {
        return Ok(());
    };
    let name = material.attribute("name").unwrap_or_default();
    let own = material.child("color")?.map(|colour| colour.required_numbers::<4>("rgba"));
    let Some(rgba) = own.transpose()?.or_else(|| names.colours.get(name).copied()) else {
        return Ok(());
    };
    writer.open("material", &[("name", Value::Text(name))]);
    writer.empty("color", &[("rgba", Value::Numbers(&rgba))]);
    writer.close("material");
    Ok(())
}
