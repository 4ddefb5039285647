//! Robots to calculate with, and where their joints are.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use armada_model::{Chain, JointLimits, RobotModel};

use super::random::SplitMix;

/// Our own robots, part of this program.
const OWN: [(&str, &str); 2] = [
    ("six_axis_arm", include_str!("../../../../../config/robots/six_axis_arm.urdf")),
    ("seven_axis_arm", include_str!("../../../../../config/robots/seven_axis_arm.urdf")),
];

/// Arms that are known by the names of their files: file, base link, tip link.
const ARMS: [(&str, &str, &str); 7] = [
    ("panda", "panda_link0", "panda_hand"),
    ("ur5e", "base_link", "tool0"),
    ("iiwa14", "base", "iiwa_link_ee"),
    ("rm_75", "base_link", "Link7"),
    ("fr3", "fr3_link0", "fr3_hand_tcp"),
    ("six_axis_arm", "base_link", "tool0"),
    ("seven_axis_arm", "base_link", "tool0"),
];

/// A robot to calculate with.
#[derive(Debug)]
pub(super) struct Robot {
    pub(super) name: String,
    pub(super) urdf: String,
    pub(super) model: RobotModel,
}

/// The descriptions below a folder, in the order of their paths; our own robots without one.
pub(super) fn load(folder: Option<&Path>) -> anyhow::Result<Vec<Robot>> {
    let Some(folder) = folder else {
        return OWN.into_iter().map(|(name, urdf)| robot(name, urdf.to_owned())).collect();
    };
    let mut files = Vec::new();
    descriptions(folder, &mut files)?;
    files.sort();
    ensure!(!files.is_empty(), "{}: there is no file NAME.urdf", folder.display());
    let load = |file: PathBuf| {
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        let urdf = std::fs::read_to_string(&file).with_context(|| file.display().to_string())?;
        robot(&name, urdf).with_context(|| file.display().to_string())
    };
    files.into_iter().map(load).collect()
}

/// The arms among `robots` that are known, Panda first.
pub(super) fn arms(robots: &[Robot]) -> anyhow::Result<Vec<Arm<'_>>> {
    let mut arms = Vec::new();
    for (name, base, tip) in ARMS {
        for robot in robots.iter().filter(|robot| robot.name == name) {
            let chain = Chain::new(&robot.model, base, tip).with_context(|| name.to_owned())?;
            arms.push(Arm { robot, chain });
        }
    }
    Ok(arms)
}

fn robot(name: &str, urdf: String) -> anyhow::Result<Robot> {
    let model = RobotModel::from_urdf(&urdf, name)?;
    Ok(Robot { name: name.to_owned(), urdf, model })
}

fn descriptions(folder: &Path, files: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    for entry in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let entry = entry?;
        // Links are not followed, so that a folder within itself ends.
        if entry.file_type()?.is_dir() {
            descriptions(&entry.path(), files)?;
        } else if entry.path().extension().is_some_and(|extension| extension == "urdf") {
            files.push(entry.path());
        }
    }
    Ok(())
}

/// A chain of links of a robot.
#[derive(Debug)]
pub(super) struct Arm<'a> {
    pub(super) robot: &'a Robot,
    pub(super) chain: Chain,
}

impl Arm<'_> {
    /// A random posture within the limits, and within half a turn from zero.
    pub(super) fn posture(&self, random: &mut SplitMix) -> Vec<f64> {
        let position = |limits: &JointLimits, random: &mut SplitMix| {
            let (lower, upper) = (limits.lower.unwrap_or(-PI), limits.upper.unwrap_or(PI));
            random.between(lower.max(-PI), upper.min(PI))
        };
        self.chain.variables().iter().map(|v| position(&v.limits, random)).collect()
    }
}

impl Robot {
    /// Position vectors within the limits, spread evenly, the same each time.
    pub(super) fn configurations(&self, count: usize) -> Vec<Vec<f64>> {
        let mut random = SplitMix::new(0x41_52_4d_41_44_41);
        let mut position = |limits: &JointLimits| {
            let (lower, upper) = (limits.lower.unwrap_or(-PI), limits.upper.unwrap_or(PI));
            random.between(lower, upper)
        };
        (0..count)
            .map(|_| self.model.variables().map(|v| position(&v.motion.limits)).collect())
            .collect()
    }

    /// Positions of all joints that move, those that mimic others too, by name.
    pub(super) fn named(&self, positions: &[f64]) -> BTreeMap<&str, f64> {
        let moving = self.model.joints().iter().filter_map(|joint| {
            let motion = joint.motion.as_ref()?;
            Some((joint.name.as_str(), motion.position.evaluate(positions)))
        });
        moving.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn configurations_lie_within_limits_and_are_the_same_each_time() {
        for robot in load(None).expect("our own robots are sound") {
            let configurations = robot.configurations(20);
            assert_eq!(configurations, robot.configurations(20), "{}", robot.name);
            for positions in &configurations {
                let fits = |(variable, &position): (armada_model::Variable<'_>, &f64)| {
                    variable.motion.limits.contains(position)
                };
                assert!(robot.model.variables().zip(positions).all(fits), "{}", robot.name);
            }
            assert_ne!(configurations[0], configurations[1]);
        }
    }

    #[test]
    fn our_own_arms_are_known_and_their_postures_lie_within_limits() {
        let robots = load(None).expect("our own robots are sound");
        let arms = arms(&robots).expect("their links are known");
        assert_eq!(arms.iter().map(|arm| arm.chain.len()).collect::<Vec<_>>(), [6, 7]);
        let mut random = SplitMix::new(1);
        for arm in &arms {
            for _ in 0..20 {
                let posture = arm.posture(&mut random);
                let fits = |(v, &q): (&armada_model::ChainVariable, &f64)| v.limits.contains(q);
                assert!(arm.chain.variables().iter().zip(&posture).all(fits));
            }
        }
    }

    #[test]
    fn a_folder_is_searched_to_its_depth() {
        let folder = tempfile::tempdir().expect("a directory");
        assert!(load(Some(folder.path())).is_err(), "there is none");
        let below = folder.path().join("a/b");
        std::fs::create_dir_all(&below).expect("made");
        std::fs::write(below.join("x.urdf"), OWN[0].1).expect("written");
        std::fs::write(below.join("x.srdf"), "").expect("written");
        let names: Vec<_> =
            load(Some(folder.path())).expect("one").into_iter().map(|robot| robot.name).collect();
        assert_eq!(names, ["x"]);
    }
}
