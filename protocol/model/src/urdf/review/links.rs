//! Doubts about one link, and about the files that links need.

use std::collections::BTreeSet;

use nalgebra::Matrix3;

use super::Doubts;
use crate::urdf::link::MOMENTS;
use crate::urdf::scan::{Named, Scan};
use crate::urdf::source::Element;
use crate::urdf::warning::UrdfDoubt;

/// What rounding in a file may do to principal moments, relative to the largest.
const MOMENT_TOLERANCE: f64 = 1e-3;

/// Doubts a link that can be seen and cannot touch.
pub(super) fn review_shapes(link: &Named<'_>, doubts: &mut Doubts) {
    if has(link, "visual") && !has(link, "collision") {
        let subject = link.element.subject();
        doubts.about(&link.element, UrdfDoubt::NoCollision { subject });
    }
}

/// Doubts a link without mass, unless it is a mere frame.
pub(super) fn review_missing_inertial(link: &Named<'_>, doubts: &mut Doubts) {
    if has(link, "visual") || has(link, "collision") {
        let subject = link.element.subject();
        doubts.about(&link.element, UrdfDoubt::NoInertial { subject });
    }
}

fn has(link: &Named<'_>, element: &'static str) -> bool {
    link.element.children_named(element).next().is_some()
}

pub(super) fn review_inertial(inertial: &Element<'_>, doubts: &mut Doubts) {
    let child = |name| inertial.children_named(name).next();
    let mass = child("mass").and_then(|mass| mass.number("value").ok().flatten());
    let (Some(mass), Some(inertia)) = (mass, child("inertia")) else { return };
    let Some(matrix) = matrix_of(&inertia) else { return };
    let subject = inertia.subject();
    if mass == 0.0 {
        if matrix != Matrix3::zeros() {
            doubts.about(inertial, UrdfDoubt::NoMass { subject });
        }
        return;
    }
    let mut moments = matrix.symmetric_eigenvalues();
    moments.as_mut_slice().sort_unstable_by(f64::total_cmp);
    let [smallest, middle, largest] = *moments.as_ref();
    let tolerance = MOMENT_TOLERANCE * largest;
    let doubt = if smallest <= 0.0 {
        UrdfDoubt::InertiaNotPositive { subject, moment: smallest }
    } else if largest > smallest + middle + tolerance {
        UrdfDoubt::InertiaTriangle { subject, largest, others: smallest + middle }
    } else {
        return;
    };
    doubts.about(&inertia, doubt);
}

fn matrix_of(inertia: &Element<'_>) -> Option<Matrix3<f64>> {
    let moment = |name| inertia.number(name).ok().flatten();
    let [ixx, ixy, ixz, iyy, iyz, izz] = MOMENTS.map(moment);
    let (xy, xz, yz) = (ixy?, ixz?, iyz?);
    Some(Matrix3::new(ixx?, xy, xz, xy, iyy?, yz, xz, yz, izz?))
}

/// Tells once how many mesh files there are.
pub(super) fn review_meshes(scan: &Scan<'_>, doubts: &mut Doubts) {
    let links = scan.links.iter().map(|link| &link.element);
    let shapes = links
        .flat_map(|link| link.children_named("visual").chain(link.children_named("collision")))
        .flat_map(|shape| shape.children_named("geometry"));
    let mut first = None;
    let mut files = BTreeSet::new();
    for mesh in shapes.flat_map(|geometry| geometry.children_named("mesh")) {
        if let Some(file) = mesh.attribute("filename") {
            files.insert(file);
            first.get_or_insert((mesh, file));
        }
    }
    if let Some((mesh, file)) = first {
        let (files, first) = (files.len(), file.to_owned());
        doubts.about(&mesh, UrdfDoubt::Meshes { files, first });
    }
}
