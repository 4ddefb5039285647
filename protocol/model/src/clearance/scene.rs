//! Robots and surroundings as bodies and pairs.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::Isometry3;

use super::body::{Body, BodyId, Owner};
use super::builder::{MissingShape, Mount, Robot, RobotId, SceneBuilder};
use super::capsule::Placed;
use super::error::{ClearanceError, MAX_LENGTH_M};
use super::hull::{Hull, Scratch};
use super::pairs::{self, Pair, PairGroup};
use super::query::Placement;
use super::reach::{Lever, stroke};

/// One or several robots and what is fixed around them, ready for distance queries.
///
/// A position vector of the scene holds the positions of the first robot's driven joints, then
/// those of the second, and so on.
///
/// Every two bodies are a pair that is checked, but for those
/// * that no joint moves against each other, such as shapes of one link, a robot's base and the
///   table it stands on, and two fixed shapes;
/// * of one robot whose links are connected by one moving joint, or that the robot's SRDF disables,
///   unless the SRDF enables them by name;
/// * that were [allowed](SceneBuilder::allow) to touch.
#[derive(Clone, Debug)]
pub struct CollisionScene {
    pub(super) robots: Vec<Robot>,
    /// Where each robot's variables begin in a position vector, and its links among all.
    variable_offsets: Vec<usize>,
    link_offsets: Vec<usize>,
    variables: usize,
    links: usize,
    bodies: Vec<Body>,
    hulls: Vec<Arc<Hull>>,
    /// Index, half edges, and pose in the link of each body that is a box.
    pub(super) boxes: Vec<(usize, [f64; 3], Isometry3<f64>)>,
    /// Link of each body among all links.
    body_links: Vec<Option<usize>>,
    pub(super) pairs: Vec<Pair>,
    groups: Vec<PairGroup>,
    levers: Vec<Lever>,
    lever_ends: Vec<usize>,
    /// Robot and joint of each slide with limits, and how far it may go.
    strokes: Vec<(usize, usize, f64)>,
    missing: Vec<MissingShape>,
}

/// Memory for queries on one scene, used again from call to call.
#[derive(Clone, Debug)]
pub struct ClearanceWorkspace {
    /// Poses of all links in the world.
    pub(super) poses: Vec<Isometry3<f64>>,
    pub(super) placed: Vec<Placed>,
    /// Pose of the world in each box.
    pub(super) boxes: Vec<Isometry3<f64>>,
    /// Distance of each pair, or a bound on it.
    pub(super) distances: Vec<f64>,
    pub(super) scratch: Scratch,
    pub(super) previous: Vec<f64>,
    /// Whether the distance is that of the shapes.
    pub(super) measured: Vec<bool>,
    /// Highest rate at which the distance of each pair can change \[m/s\].
    pub(super) rates: Vec<f64>,
    pub(super) positions: Vec<f64>,
    pub(super) last_positions: Vec<f64>,
}

impl CollisionScene {
    pub(super) fn new(builder: SceneBuilder) -> Self {
        let offsets = |count: fn(&Robot) -> usize| {
            let mut total = 0;
            let starts = builder.robots.iter().map(|robot| {
                let start = total;
                total += count(robot);
                start
            });
            let starts: Vec<usize> = starts.collect();
            (starts, total)
        };
        let (variable_offsets, variables) = offsets(|robot| robot.model.variable_count());
        let (link_offsets, links) = offsets(|robot| robot.model.links().len());
        let table = pairs::table(&builder, &variable_offsets);
        let global = |body: &Body| match body.owner {
            Owner::Link { robot, link } => link_offsets.get(robot.0).map(|start| start + link),
            Owner::Fixed { .. } => None,
        };
        let hull = |body: &Body| {
            let capsule = || Arc::new(Hull::capsule(body.capsule.ends(), body.capsule.radius()));
            body.hull.clone().unwrap_or_else(capsule)
        };
        let boxed = |(index, body): (usize, &Body)| {
            let (half, X_LB) = body.hull.as_ref()?.as_box()?;
            Some((index, half, X_LB))
        };
        let boxes: Vec<_> = builder.bodies.iter().enumerate().filter_map(boxed).collect();
        let mut pairs = table.pairs;
        for pair in &mut pairs {
            let of = |body| boxes.iter().position(|&(boxed, _, _)| boxed == body);
            pair.boxes = [of(pair.a), of(pair.b)];
        }
        Self {
            boxes,
            body_links: builder.bodies.iter().map(global).collect(),
            hulls: builder.bodies.iter().map(hull).collect(),
            strokes: strokes(&builder.robots),
            robots: builder.robots,
            bodies: builder.bodies,
            missing: builder.missing,
            variable_offsets,
            link_offsets,
            variables,
            links,
            pairs,
            groups: table.groups,
            levers: table.levers,
            lever_ends: table.ends,
        }
    }

    /// All bodies: those of the robots in the order they were added, link by link, and others.
    #[must_use]
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// The body; `None` if it is one of another scene.
    #[must_use]
    pub fn body(&self, id: BodyId) -> Option<&Body> {
        self.bodies.get(id.0)
    }

    /// Number of pairs that are checked.
    #[must_use]
    pub const fn pair_count(&self) -> usize {
        self.pairs.len()
    }

    /// The pairs that are checked.
    pub fn pairs(&self) -> impl Iterator<Item = (BodyId, BodyId)> + '_ {
        self.pairs.iter().map(|pair| (BodyId(pair.a), BodyId(pair.b)))
    }

    /// Links with meshes whose vertices are not known; they are checked only as far as they have
    /// other shapes.
    #[must_use]
    pub fn without_shape(&self) -> &[MissingShape] {
        &self.missing
    }

    /// Length of a position vector of the scene.
    #[must_use]
    pub const fn variable_count(&self) -> usize {
        self.variables
    }

    /// Where the robot's positions stand in a position vector of the scene.
    #[must_use]
    pub fn variables_of(&self, robot: RobotId) -> Option<Range<usize>> {
        let start = *self.variable_offsets.get(robot.0)?;
        Some(start..start + self.robots.get(robot.0)?.model.variable_count())
    }

    /// Memory for queries; the only call that allocates.
    #[must_use]
    pub fn workspace(&self) -> ClearanceWorkspace {
        let pairs = self.pairs.len();
        ClearanceWorkspace {
            poses: vec![Isometry3::identity(); self.links],
            placed: self.bodies.iter().map(|body| Placed::new(&body.capsule)).collect(),
            boxes: self.boxes.iter().map(|(_, _, X_WB)| X_WB.inverse()).collect(),
            distances: vec![0.0; pairs],
            scratch: Scratch::default(),
            previous: vec![0.0; pairs],
            measured: vec![false; pairs],
            rates: vec![0.0; pairs],
            positions: vec![0.0; self.variables],
            last_positions: vec![0.0; self.variables],
        }
    }

    /// The scene with all robots at `positions`, for queries. Allocates nothing.
    ///
    /// # Errors
    /// [`ClearanceError::PositionCount`] if the length does not fit,
    /// [`ClearanceError::Kinematics`] if a position is not finite, [`ClearanceError::TooFar`] if a
    /// body is more than 1e6 m away, [`ClearanceError::Workspace`] if another scene made the
    /// workspace.
    pub fn place<'w>(
        &'w self,
        positions: &[f64],
        workspace: &'w mut ClearanceWorkspace,
    ) -> Result<Placement<'w>, ClearanceError> {
        self.check_workspace(workspace)?;
        self.place_bodies(positions, workspace)?;
        Ok(Placement { scene: self, workspace })
    }

    pub(super) fn check_workspace(
        &self,
        workspace: &ClearanceWorkspace,
    ) -> Result<(), ClearanceError> {
        let fits = workspace.poses.len() == self.links
            && workspace.placed.len() == self.bodies.len()
            && workspace.distances.len() == self.pairs.len()
            && workspace.boxes.len() == self.boxes.len()
            && workspace.positions.len() == self.variables;
        if fits { Ok(()) } else { Err(ClearanceError::Workspace) }
    }

    pub(super) fn place_bodies(
        &self,
        positions: &[f64],
        workspace: &mut ClearanceWorkspace,
    ) -> Result<(), ClearanceError> {
        let ClearanceWorkspace { poses, placed, boxes, .. } = workspace;
        if positions.len() != self.variables {
            let (expected, given) = (self.variables, positions.len());
            return Err(ClearanceError::PositionCount { expected, given });
        }
        for index in 0..self.robots.len() {
            self.place_robot(index, positions, poses)?;
        }
        let links = self.bodies.iter().zip(&self.body_links).zip(placed).enumerate();
        for (index, ((body, link), placed)) in links {
            let Some(X_WL) = link.and_then(|link| poses.get(link)) else { continue };
            *placed = Placed::new(&body.capsule.transformed(X_WL));
            let extent = placed.extent();
            if extent.is_nan() || extent > MAX_LENGTH_M {
                return Err(ClearanceError::TooFar { body: index });
            }
        }
        for ((body, _, X_LB), X_BW) in self.boxes.iter().zip(boxes) {
            let link = self.body_links.get(*body).copied().flatten();
            if let Some(X_WL) = link.and_then(|link| poses.get(link)) {
                *X_BW = (X_WL * X_LB).inverse();
            }
        }
        Ok(())
    }

    fn place_robot(
        &self,
        index: usize,
        positions: &[f64],
        poses: &mut [Isometry3<f64>],
    ) -> Result<(), ClearanceError> {
        let (Some(robot), Some(&start)) = (self.robots.get(index), self.link_offsets.get(index))
        else {
            return Ok(());
        };
        let X_WR = match robot.mount {
            Mount::World(pose) => *pose.isometry(),
            Mount::Link { robot: carrier, link, .. } => {
                let carrier = self.link_offsets.get(carrier.0).map(|start| start + link);
                carrier.and_then(|link| poses.get(link)).copied().unwrap_or_default()
                    * robot.mount.isometry()
            }
        };
        let variables = self.variables_of(RobotId(index)).unwrap_or_default();
        let own = positions.get(variables).unwrap_or_default();
        let slots = poses.get_mut(start..start + robot.model.links().len()).unwrap_or_default();
        robot
            .model
            .link_poses(own, slots)
            .map_err(|source| ClearanceError::Kinematics { robot: index, source })?;
        for pose in slots {
            *pose = X_WR * *pose;
        }
        Ok(())
    }

    /// Pairs of two robots, or of a robot and what is fixed.
    pub(super) fn range_of(&self, a: Option<RobotId>, b: Option<RobotId>) -> Range<usize> {
        let key = |robot: Option<RobotId>| robot.map_or(usize::MAX, |robot| robot.0);
        let wanted = [key(a).min(key(b)), key(a).max(key(b))];
        let of = |group: &&PairGroup| group.robots.map(|r| r.unwrap_or(usize::MAX)) == wanted;
        self.groups.iter().find(of).map_or(0..0, |group| group.range.clone())
    }

    /// The body's shape, and its link among all links.
    pub(super) fn hull(&self, body: usize) -> Option<(&Hull, Option<usize>)> {
        Some((self.hulls.get(body)?, self.body_links.get(body).copied()?))
    }

    pub(super) fn is_capsule(&self, body: usize) -> bool {
        self.bodies.get(body).is_some_and(Body::is_capsule)
    }

    /// Joints that move the bodies of the pair against each other.
    pub(super) fn levers_of(&self, pair: usize) -> &[Lever] {
        let end = self.lever_ends.get(pair).copied().unwrap_or_default();
        let start = pair.checked_sub(1).and_then(|last| self.lever_ends.get(last)).copied();
        self.levers.get(start.unwrap_or(0)..end).unwrap_or_default()
    }

    /// Whether all slides are where the bound on speeds holds.
    pub(super) fn check_strokes(&self, positions: &[f64]) -> Result<(), ClearanceError> {
        for &(robot, joint, stroke) in &self.strokes {
            let variables = self.variables_of(RobotId(robot)).unwrap_or_default();
            let own = positions.get(variables).unwrap_or_default();
            let joints = self.robots.get(robot).map(|robot| robot.model.joints());
            let motion = joints.and_then(|joints| joints.get(joint)?.motion.as_ref());
            let position = motion.map_or(0.0, |motion| motion.position.evaluate(own));
            if position.abs() > stroke + 1e-9 {
                return Err(ClearanceError::OutsideTravel { robot, joint, position });
            }
        }
        Ok(())
    }
}

fn strokes(robots: &[Robot]) -> Vec<(usize, usize, f64)> {
    let of = |(index, robot): (usize, &Robot)| {
        let model = Arc::clone(&robot.model);
        let joints = robot.model.joints().iter().enumerate();
        let strokes = joints.map(|(joint, known)| (index, joint, stroke(known, &model)));
        strokes.filter(|(_, _, stroke)| *stroke > 0.0 && stroke.is_finite()).collect::<Vec<_>>()
    };
    robots.iter().enumerate().flat_map(of).collect()
}
