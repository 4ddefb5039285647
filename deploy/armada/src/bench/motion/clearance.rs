//! Distances of two seven-axis arms. No peer of the same kind is a Python package.

use std::hint::black_box;

use anyhow::Context as _;
use armada_agent::runtime::monotonic;
use armada_model::{Accuracy, CollisionScene, Mount, Pose, RobotId, SceneBuilder};

use super::robots::Robot;
use super::{Bench, CONFIGURATIONS, TARGET, per_call};
use crate::bench::report::Section;

/// Distance of the bases \[m\].
const APART: f64 = 0.8;
/// What a state shall cost at most \[µs\].
const TARGET_US: f64 = 5.0;

/// Two of one arm, and positions of both.
struct Pair {
    scene: CollisionScene,
    arms: (RobotId, RobotId),
    states: Vec<Vec<f64>>,
}

/// Measures two of `robot`, one of our own.
pub(super) fn measure(bench: &mut Bench<'_>, robot: &Robot) -> anyhow::Result<Section> {
    let pair = Pair::new(robot)?;
    let (mut all, mut alone, mut shapes) = (Vec::new(), Vec::new(), Vec::new());
    let calls = bench.args.calls;
    for _ in bench.rounds("clearance") {
        all.push([pair.time(calls, Accuracy::Capsules)?]);
        alone.push([pair.time_alone(calls)?]);
        shapes.push([pair.time((calls / 10).max(10), Accuracy::Shapes)?]);
    }
    let bodies = pair.scene.bodies().len();
    let title = format!("clearance: two of {}, {APART} m apart, {bodies} bodies", robot.name);
    Ok(Section::new(title, ["µs a state"])
        .row("armada, poses and cross_distance of capsules", &all)
        .row(TARGET, &[[TARGET_US]])
        .row("armada, cross_distance of capsules alone", &alone)
        .row("armada, poses and cross_distance of shapes", &shapes))
}

impl Pair {
    fn new(robot: &Robot) -> anyhow::Result<Self> {
        let mut builder = SceneBuilder::new();
        let mut add = |name, y| {
            let mount = Mount::World(Pose::from_translation(0.0, y, 0.0));
            builder.add_robot(name, &robot.model, mount, &mut |_| None)
        };
        let arms = (add("left", 0.5 * APART)?, add("right", -0.5 * APART)?);
        let configurations = robot.configurations(2 * CONFIGURATIONS);
        let states = configurations.chunks_exact(2).map(<[_]>::concat).collect();
        Ok(Self { scene: builder.build(), arms, states })
    }

    /// Time of one state, poses of links included \[µs\].
    fn time(&self, calls: u32, accuracy: Accuracy) -> anyhow::Result<f64> {
        let mut workspace = self.scene.workspace();
        let begin = monotonic();
        for positions in self.states.iter().cycle().take(calls as usize) {
            let mut placed = self.scene.place(black_box(positions), &mut workspace)?;
            black_box(placed.cross_distance(self.arms, accuracy).context("no pair")?);
        }
        Ok(1e-3 * per_call(monotonic().saturating_since(begin), calls))
    }

    /// Time of the distances of one state by capsules, without poses \[µs\].
    fn time_alone(&self, calls: u32) -> anyhow::Result<f64> {
        let mut workspace = self.scene.workspace();
        let each = (calls as usize).div_ceil(self.states.len());
        let mut total = 0.0;
        for positions in &self.states {
            let mut placed = self.scene.place(positions, &mut workspace)?;
            let begin = monotonic();
            for _ in 0..each {
                let found = black_box(&mut placed).cross_distance(self.arms, Accuracy::Capsules);
                black_box(found.context("no pair")?);
            }
            total += per_call(monotonic().saturating_since(begin), u32::try_from(each)?);
        }
        #[expect(clippy::cast_precision_loss, reason = "a small count")]
        let states = self.states.len() as f64;
        Ok(1e-3 * total / states)
    }
}

#[cfg(test)]
mod tests {
    use super::super::robots::load;
    use super::*;

    #[test]
    fn arms_come_near_and_go_apart() {
        let robots = load(None).expect("our own robots are sound");
        let pair = Pair::new(&robots[1]).expect("two arms");
        let mut workspace = pair.scene.workspace();
        let mut distance = |positions: &Vec<f64>| {
            let mut placed = pair.scene.place(positions, &mut workspace).expect("positions fit");
            placed.cross_distance(pair.arms, Accuracy::Capsules).expect("a pair").distance_m
        };
        let distances: Vec<_> = pair.states.iter().map(&mut distance).collect();
        assert_eq!(distances.len(), CONFIGURATIONS);
        assert!(distances.iter().any(|&m| m < 0.1) && distances.iter().any(|&m| m > 0.3));
    }
}
