//! What is to be checked: made where the world is, solved somewhere else.

use std::collections::BTreeSet;
use std::sync::Arc;

use armada_model::{CompiledTrajectory, JointTrajectory, Pose, RobotModel};
use armada_protocol::RobotName;
use armada_protocol::messages::{ClearanceAnswer, Denial, DenialCode};

use super::prove::{Near, Outcome, Prover};
use super::scene::PairScene;
use super::{ClearanceReport, ClearanceRequest};
use crate::world::World;
use crate::world::body::{Body, Joints};

/// A motion whose clearances can be checked without the world, on another thread.
#[derive(Debug)]
pub struct ClearanceProblem {
    /// Each after the one it stands on.
    drafts: Vec<Draft>,
    offset_s: f64,
    required_m: f64,
    without_shape: BTreeSet<String>,
}

/// A robot and what it is asked to do.
#[derive(Debug)]
struct Draft {
    name: RobotName,
    model: Arc<RobotModel>,
    carrier: Option<(usize, usize)>,
    pose: Pose,
    variables: Vec<usize>,
    way: Way,
}

/// What a robot is asked to do.
#[derive(Debug)]
enum Way {
    /// To follow a trajectory within the limits of these joints, or within the reduced ones.
    Follow { trajectory: JointTrajectory, joints: Joints, reduced: bool },
    /// To stay at these positions of the model's variables \[rad or m\].
    Stand(Vec<f64>),
}

/// The robots, with trajectories that were interpolated.
#[derive(Debug)]
pub(super) struct Solids {
    /// Each after the one it stands on.
    pub(super) solids: Vec<Solid>,
    required_m: f64,
}

/// A robot and what it does.
#[derive(Debug)]
pub(super) struct Solid {
    pub(super) name: RobotName,
    pub(super) model: Arc<RobotModel>,
    /// Index of the robot it stands on, its link, and the pose there; the world's if `None`.
    pub(super) carrier: Option<(usize, usize)>,
    pub(super) pose: Pose,
    /// Variable of the model for each joint of the trajectory.
    pub(super) variables: Vec<usize>,
    pub(super) course: Course,
}

/// Where a robot is.
#[derive(Debug)]
pub(super) enum Course {
    /// On its trajectory.
    Follows(Box<CompiledTrajectory>),
    /// At these positions of the model's variables \[rad or m\].
    Stands(Vec<f64>),
}

impl World {
    /// The problem of a motion; quick, whatever its length.
    ///
    /// # Errors
    /// A denial that names a robot that is to move and of which nothing is known.
    pub fn clearance(&self, request: &ClearanceRequest) -> Result<ClearanceProblem, Denial> {
        let mut problem = ClearanceProblem {
            drafts: Vec::new(),
            offset_s: request.offset_s,
            required_m: request.required_m,
            without_shape: BTreeSet::new(),
        };
        for (name, placed) in &self.robots {
            let carrier = match placed.parent() {
                None => None,
                Some((robot, link)) => {
                    let found = problem.drafts.iter().position(|s| s.name.as_str() == robot);
                    let found = found.and_then(|index| {
                        let link = problem.drafts.get(index)?.model.link_index(link)?;
                        Some((index, link))
                    });
                    if found.is_none() {
                        known_or_still(name, request)?;
                        problem.without_shape.insert(name.to_string());
                        continue;
                    }
                    found
                }
            };
            let way = match (&placed.body, request.parts.get(name)) {
                (Some(body), Some(part)) => Way::Follow {
                    trajectory: part.clone(),
                    joints: body.joints.clone(),
                    reduced: request.reduced.contains(name),
                },
                (Some(Body { positions: Some(positions), .. }), None) => {
                    Way::Stand(positions.clone())
                }
                // Nothing is known of it, or not where it is.
                (Some(_) | None, _) => {
                    known_or_still(name, request)?;
                    problem.without_shape.insert(name.to_string());
                    continue;
                }
            };
            let Some(body) = &placed.body else { continue };
            problem.without_shape.extend(body.without_shape());
            problem.drafts.push(Draft {
                name: name.clone(),
                model: Arc::clone(&body.model),
                carrier,
                pose: placed.mount.pose,
                variables: body.variables.clone(),
                way,
            });
        }
        Ok(problem)
    }
}

/// A robot of which nothing is known must not be one that moves.
fn known_or_still(name: &RobotName, request: &ClearanceRequest) -> Result<(), Denial> {
    if !request.parts.contains_key(name) {
        return Ok(());
    }
    let message = format!("{name}: its description cannot be used, so its clearance is not known");
    Err(Denial::new(DenialCode::NotReady, message).with("robot", name.as_str()))
}

impl ClearanceProblem {
    /// Interpolates the trajectories and looks at every two robots of which at least one moves. This
    /// takes up to some seconds.
    ///
    /// # Errors
    /// A denial that names the robot if its trajectory cannot be followed within its limits, or if
    /// shapes or speeds make a statement impossible.
    pub fn solve(self) -> Result<ClearanceReport, Denial> {
        let Self { drafts, offset_s, required_m, without_shape } = self;
        let solids = drafts.into_iter().map(Draft::solid).collect::<Result<_, _>>()?;
        Solids { solids, required_m }.solve(offset_s, without_shape)
    }
}

impl Draft {
    fn solid(self) -> Result<Solid, Denial> {
        let Self { name, model, carrier, pose, variables, way } = self;
        let course = match way {
            Way::Stand(positions) => Course::Stands(positions),
            Way::Follow { trajectory, joints, reduced } => {
                let compiled = joints.compile(&trajectory, reduced).map_err(|cause| {
                    let message = format!("{name}: {cause}");
                    Denial::new(DenialCode::InvalidArgument, message).with("robot", name.as_str())
                })?;
                Course::Follows(Box::new(compiled))
            }
        };
        Ok(Solid { name, model, carrier, pose, variables, course })
    }
}

impl Solids {
    fn solve(
        &self,
        offset_s: f64,
        without_shape: BTreeSet<String>,
    ) -> Result<ClearanceReport, Denial> {
        let mut prover = Prover::new(self.required_m);
        let mut lowest: Option<f64> = None;
        let mut nearest: Option<Near> = None;
        let mut refusal = None;
        for second in 0..self.solids.len() {
            for first in 0..second {
                let Some(scene) = PairScene::new(self, first, second)? else { continue };
                let outcome = prover.prove(&scene, offset_s)?;
                let bound = outcome.lower_bound(self.required_m);
                lowest = Some(lowest.map_or(bound, |lowest| lowest.min(bound)));
                if refusal.is_none() {
                    refusal = self.refusal(&outcome, prover.states());
                }
                let near = outcome.near();
                if nearest.as_ref().is_none_or(|least| near.distance_m < least.distance_m) {
                    nearest = Some(near);
                }
            }
        }
        let complete = self.solids.iter().all(Solid::has_shape_or_stands);
        let answer = ClearanceAnswer {
            clear: refusal.is_none() && lowest.is_some() && complete,
            required_m: self.required_m,
            distance_m: lowest.filter(|distance| distance.is_finite()),
            links: nearest.as_ref().map(|near| near.links.clone()),
            at_s: nearest.as_ref().map(|near| near.at_s),
            without_shape: without_shape.into_iter().collect(),
        };
        Ok(ClearanceReport { answer, refusal, states: prover.states() })
    }

    fn refusal(&self, outcome: &Outcome, states: usize) -> Option<Denial> {
        let required = self.required_m;
        let (near, what) = match outcome {
            Outcome::Clear { .. } => return None,
            Outcome::Near(near) => {
                let what = format!(
                    "come within {:.4} m of each other at {:.3} s{}, required are {required} m",
                    near.distance_m.max(0.0),
                    near.at_s,
                    near.ahead()
                );
                (near, what)
            }
            Outcome::Open(near) => {
                let what = format!(
                    "are {:.4} m apart at {:.3} s{}, and it could not be shown that they keep \
                     {required} m ({states} configurations)",
                    near.distance_m,
                    near.at_s,
                    near.ahead()
                );
                (near, what)
            }
        };
        let (a, b) = &near.links;
        Some(
            Denial::new(DenialCode::Collision, format!("{a} and {b} {what}"))
                .with("links", vec![a.clone(), b.clone()])
                .with("distance_m", near.distance_m)
                .with("required_m", required)
                .with("at_s", near.at_s)
                .with("ahead_s", near.ahead_s),
        )
    }
}

impl Solid {
    fn has_shape_or_stands(&self) -> bool {
        matches!(self.course, Course::Stands(_))
            || self.model.links().iter().any(|link| !link.collisions.is_empty())
    }
}
