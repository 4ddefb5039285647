//! What is to be checked: made where the world is, solved somewhere else.

use std::collections::BTreeSet;
use std::sync::Arc;

use armada_model::{CompiledTrajectory, Pose, RobotModel};
use armada_protocol::RobotName;
use armada_protocol::messages::{ClearanceAnswer, Denial, DenialCode};

use super::prove::{Near, Outcome, Prover};
use super::scene::PairScene;
use super::{ClearanceReport, ClearanceRequest};
use crate::world::World;
use crate::world::body::Body;

/// A motion whose clearances can be checked without the world, on another thread.
#[derive(Debug)]
pub struct ClearanceProblem {
    /// Each after the one it stands on.
    pub(super) solids: Vec<Solid>,
    offset_s: f64,
    required_m: f64,
    without_shape: BTreeSet<String>,
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
    /// The problem of a motion; quick, but for the interpolation of the trajectories.
    ///
    /// # Errors
    /// A denial that names the robot if its trajectory cannot be followed within its limits.
    pub fn clearance(&self, request: &ClearanceRequest) -> Result<ClearanceProblem, Denial> {
        let mut problem = ClearanceProblem {
            solids: Vec::new(),
            offset_s: request.offset_s,
            required_m: request.required_m,
            without_shape: BTreeSet::new(),
        };
        for (name, placed) in &self.robots {
            let carrier = match placed.parent() {
                None => None,
                Some((robot, link)) => {
                    let found = problem.solids.iter().position(|s| s.name.as_str() == robot);
                    let found = found.and_then(|index| {
                        let link = problem.solids.get(index)?.model.link_index(link)?;
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
            let course = match (&placed.body, request.parts.get(name)) {
                (Some(body), Some(part)) => {
                    let reduced = request.reduced.contains(name);
                    let compiled = body.compile(part, reduced).map_err(|cause| {
                        let message = format!("{name}: {cause}");
                        Denial::new(DenialCode::InvalidArgument, message)
                            .with("robot", name.as_str())
                    })?;
                    Course::Follows(Box::new(compiled))
                }
                (Some(Body { positions: Some(positions), .. }), None) => {
                    Course::Stands(positions.clone())
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
            problem.solids.push(Solid {
                name: name.clone(),
                model: Arc::clone(&body.model),
                carrier,
                pose: placed.mount.pose,
                variables: body.variables.clone(),
                course,
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
    /// Looks at every two robots of which at least one moves. This takes up to some seconds.
    ///
    /// # Errors
    /// A denial if shapes or speeds make a statement impossible.
    pub fn solve(&self) -> Result<ClearanceReport, Denial> {
        let mut prover = Prover::new(self.required_m);
        let mut lowest: Option<f64> = None;
        let mut nearest: Option<Near> = None;
        let mut refusal = None;
        for second in 0..self.solids.len() {
            for first in 0..second {
                let Some(scene) = PairScene::new(self, first, second)? else { continue };
                let outcome = prover.prove(&scene, self.offset_s)?;
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
            without_shape: self.without_shape.iter().cloned().collect(),
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
