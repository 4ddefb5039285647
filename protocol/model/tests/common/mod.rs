//! Where test data lies, and what several tests need.

#![allow(clippy::print_stdout, reason = "a skipped test says so")]
#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]
#![allow(dead_code, reason = "each test binary uses a part of this module")]

use std::path::{Path, PathBuf};

use armada_model::RobotModel;
use nalgebra::Isometry3;

/// The folder `path` beside the checkout; `None`, and a printed line, where it is absent.
pub(crate) fn shared(path: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared").join(path);
    if folder.is_dir() {
        return Some(folder);
    }
    println!("SKIPPED: ../shared/{path} is not beside the checkout");
    None
}

/// One of our own robots, from `config/robots`.
pub(crate) fn own_robot(file: &str) -> RobotModel {
    load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/robots").join(file))
}

pub(crate) fn load(path: &Path) -> RobotModel {
    let text = std::fs::read_to_string(path).expect("the file is readable");
    let file = path.file_name().expect("a file").to_string_lossy();
    RobotModel::from_urdf(&text, &file).unwrap_or_else(|error| panic!("{error}"))
}

pub(crate) fn link_poses(model: &RobotModel, positions: &[f64]) -> Vec<Isometry3<f64>> {
    let mut poses = vec![Isometry3::identity(); model.links().len()];
    model.link_poses(positions, &mut poses).expect("positions fit the robot");
    poses
}

/// Largest difference of two transforms, element by element.
pub(crate) fn difference(a: &Isometry3<f64>, b: &nalgebra::Matrix4<f64>) -> f64 {
    (a.to_homogeneous() - b).amax()
}
