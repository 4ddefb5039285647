//! Distances with the robots in one configuration.

use std::ops::Range;

use nalgebra::{Isometry3, Point3};

use super::body::BodyId;
use super::builder::RobotId;
use super::capsule::{Nearest, Placed};
use super::hull::Scratch;
use super::pairs::Pair;
use super::scene::{ClearanceWorkspace, CollisionScene};

/// What a distance was measured between.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Accuracy {
    /// The capsules around the shapes: never above the distance of the shapes, and far below it
    /// for flat ones, such as a table's top.
    Capsules,
    /// The shapes themselves, of a mesh its convex hull: relative accuracy 5e-8.
    #[default]
    Shapes,
}

/// A pair of bodies and its distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairDistance {
    /// First body.
    pub a: BodyId,
    /// Second body.
    pub b: BodyId,
    /// Distance \[m\].
    ///
    /// Below zero capsules overlap; where their segments cross it is minus the sum of the radii.
    /// Shapes other than capsules and spheres have no depth: overlapping each other they are at
    /// zero, overlapping a capsule's segment at minus its radius.
    pub distance_m: f64,
    /// Point of the first body nearest to the second, in the world.
    pub point_a: Point3<f64>,
    /// Point of the second body nearest to the first, in the world; of overlapping shapes without
    /// a depth both are some point between the two.
    pub point_b: Point3<f64>,
    /// What was measured: [`Accuracy::Capsules`] as well where the search between the shapes did
    /// not end.
    pub accuracy: Accuracy,
}

/// A scene with its robots in one configuration; made by [`CollisionScene::place`].
///
/// Queries allocate nothing.
#[derive(Debug)]
pub struct Placement<'w> {
    pub(super) scene: &'w CollisionScene,
    pub(super) workspace: &'w mut ClearanceWorkspace,
}

impl Placement<'_> {
    /// The nearest of all pairs; `None` if there are none.
    pub fn minimum(&mut self, accuracy: Accuracy) -> Option<PairDistance> {
        self.nearest_in(0..self.scene.pairs.len(), accuracy)
    }

    /// The nearest pair within the robot; `None` if there is none.
    pub fn self_distance(&mut self, robot: RobotId, accuracy: Accuracy) -> Option<PairDistance> {
        self.nearest_in(self.scene.range_of(Some(robot), Some(robot)), accuracy)
    }

    /// The nearest pair of the two robots; `None` if there is none.
    pub fn cross_distance(
        &mut self,
        (a, b): (RobotId, RobotId),
        accuracy: Accuracy,
    ) -> Option<PairDistance> {
        self.nearest_in(self.scene.range_of(Some(a), Some(b)), accuracy)
    }

    /// The nearest pair of the robot and what is fixed; `None` if there is none.
    pub fn fixed_distance(&mut self, robot: RobotId, accuracy: Accuracy) -> Option<PairDistance> {
        self.nearest_in(self.scene.range_of(Some(robot), None), accuracy)
    }

    /// Calls `found` with every pair nearer than `threshold_m`, in no special order.
    ///
    /// Overlapping shapes are found by thresholds above zero: their distance is zero.
    pub fn pairs_below(
        &mut self,
        threshold_m: f64,
        accuracy: Accuracy,
        mut found: impl FnMut(PairDistance),
    ) {
        for pair in 0..self.scene.pairs.len() {
            if self.capsules_are_beyond(pair, threshold_m) {
                continue;
            }
            if self.capsule_distance(pair).is_some_and(|distance| distance < threshold_m) {
                let near = self.measure(pair, accuracy);
                near.filter(|near| near.distance_m < threshold_m).into_iter().for_each(&mut found);
            }
        }
    }

    /// Pose in the world of a robot's link.
    #[must_use]
    pub fn link_pose(&self, robot: RobotId, link: usize) -> Option<&Isometry3<f64>> {
        let links: usize =
            self.scene.robots.iter().take(robot.0).map(|robot| robot.model.links().len()).sum();
        let own = self.scene.robots.get(robot.0)?.model.links().len();
        self.workspace.poses.get(links + link).filter(|_| link < own)
    }

    fn nearest_in(&mut self, range: Range<usize>, accuracy: Accuracy) -> Option<PairDistance> {
        match accuracy {
            Accuracy::Capsules => {
                let pair = self.nearest_capsules(range)?;
                self.measure(pair, Accuracy::Capsules)
            }
            Accuracy::Shapes => self.nearest_shapes(range),
        }
    }

    fn nearest_capsules(&self, range: Range<usize>) -> Option<usize> {
        let mut best = (f64::INFINITY, None);
        for pair in range {
            if !self.capsules_are_beyond(pair, best.0)
                && let Some(distance) = self.capsule_distance(pair)
                && distance < best.0
            {
                best = (distance, Some(pair));
            }
        }
        best.1
    }

    /// Measures shapes in the order of their bounds until no other can be nearer.
    fn nearest_shapes(&mut self, range: Range<usize>) -> Option<PairDistance> {
        self.workspace.bound_distances(self.scene, range.clone());
        let mut best: Option<PairDistance> = None;
        loop {
            let bounds = self.workspace.distances.get(range.clone())?;
            let limit = best.map_or(f64::INFINITY, |best| best.distance_m);
            let mut next = (limit, None);
            for (index, &bound) in bounds.iter().enumerate() {
                if bound < next.0 {
                    next = (bound, Some(range.start + index));
                }
            }
            let Some(pair) = next.1 else { return best };
            if let Some(measured) = self.measure(pair, Accuracy::Shapes)
                && measured.distance_m < limit
            {
                best = Some(measured);
            }
            *self.workspace.distances.get_mut(pair)? = f64::INFINITY;
        }
    }

    fn capsules_are_beyond(&self, pair: usize, distance: f64) -> bool {
        let placed = self.workspace.placed_pair(self.scene, pair);
        placed.is_none_or(|(a, b)| a.is_beyond(b, distance))
    }

    fn capsule_distance(&self, pair: usize) -> Option<f64> {
        let (a, b) = self.workspace.placed_pair(self.scene, pair)?;
        Some(a.distance(b))
    }

    fn measure(&mut self, pair: usize, accuracy: Accuracy) -> Option<PairDistance> {
        self.workspace.measure(self.scene, pair, accuracy)
    }
}

impl ClearanceWorkspace {
    #[inline]
    fn placed_pair(&self, scene: &CollisionScene, pair: usize) -> Option<(&Placed, &Placed)> {
        let pair = scene.pairs.get(pair)?;
        Some((self.placed.get(pair.a)?, self.placed.get(pair.b)?))
    }

    /// Bounds from below on the distances of all pairs in the range: those of the capsules, and
    /// where one of a pair is a box, of the box, whose capsule may be far larger.
    pub(super) fn bound_distances(&mut self, scene: &CollisionScene, range: Range<usize>) {
        let pairs = scene.pairs.get(range.clone()).unwrap_or_default();
        let distances = self.distances.get_mut(range).unwrap_or_default();
        for (pair, distance) in pairs.iter().zip(distances) {
            let (Some(a), Some(b)) = (self.placed.get(pair.a), self.placed.get(pair.b)) else {
                continue;
            };
            *distance = a.distance(b);
            for (index, other) in pair.boxes.into_iter().zip([b, a]) {
                let frame = index.and_then(|index| {
                    let (_, half, _) = scene.boxes.get(index)?;
                    Some((half, self.boxes.get(index)?))
                });
                if let Some((half, X_BW)) = frame {
                    *distance = distance.max(other.gap_to_box(half, X_BW));
                }
            }
        }
    }

    /// The pair, measured as asked for.
    pub(super) fn measure(
        &mut self,
        scene: &CollisionScene,
        pair: usize,
        accuracy: Accuracy,
    ) -> Option<PairDistance> {
        let &Pair { a, b, .. } = scene.pairs.get(pair)?;
        let both_capsules = [a, b].iter().all(|&body| scene.is_capsule(body));
        let shapes = match accuracy {
            Accuracy::Shapes if !both_capsules => {
                shape_distance(scene, [a, b], &self.poses, &mut self.scratch)
            }
            Accuracy::Shapes | Accuracy::Capsules => None,
        };
        let is_exact = accuracy == Accuracy::Shapes && (both_capsules || shapes.is_some());
        let (placed_a, placed_b) = self.placed_pair(scene, pair)?;
        let nearest = shapes.unwrap_or_else(|| placed_a.nearest(placed_b));
        let Nearest { distance_m, point_a, point_b } = nearest;
        let accuracy = if is_exact { Accuracy::Shapes } else { Accuracy::Capsules };
        Some(PairDistance { a: BodyId(a), b: BodyId(b), distance_m, point_a, point_b, accuracy })
    }
}

fn shape_distance(
    scene: &CollisionScene,
    [a, b]: [usize; 2],
    poses: &[Isometry3<f64>],
    scratch: &mut Scratch,
) -> Option<Nearest> {
    let identity = Isometry3::identity();
    let (hull_a, link_a) = scene.hull(a)?;
    let (hull_b, link_b) = scene.hull(b)?;
    let X_WA = link_a.map_or(Some(&identity), |link| poses.get(link))?;
    let X_WB = link_b.map_or(Some(&identity), |link| poses.get(link))?;
    hull_a.distance(X_WA, hull_b, X_WB, scratch)
}
