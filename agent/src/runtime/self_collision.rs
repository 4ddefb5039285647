//! Whether a trajectory brings a robot's own links together.
//!
//! Shapes are those of the robot description; links with meshes have none here, and nothing is known
//! of them.

use armada_model::{
    ClearanceError, CollisionScene, CompiledTrajectory, MotionCheck, MotionVerdict, Mount, Owner,
    Pose, RobotModel, SceneBuilder,
};
use armada_protocol::messages::{Denial, DenialCode};

/// Distance that links have to keep \[m\].
const THRESHOLD_M: f64 = 1e-3;
/// How closely a doubtful place is looked at \[s\].
const RESOLUTION_S: f64 = 5e-4;
/// Most configurations that are looked at.
const MAX_STATES: usize = 20_000;
/// By how much a joint may be faster than the trajectory's peak: rounding.
const ROUNDING: f64 = 1.0 + 1e-6;

/// A robot's own links.
#[derive(Debug)]
pub(super) struct SelfCollision {
    scene: CollisionScene,
    links: Vec<String>,
    /// Which joint of the robot each variable of the scene is.
    joints: Vec<Option<usize>>,
}

impl SelfCollision {
    /// Of a robot whose joints have these names, in its order; none if it has no two links with
    /// shapes that could meet.
    ///
    /// # Errors
    /// [`ClearanceError`] if a shape of the model cannot be used.
    pub(super) fn of(
        model: &RobotModel,
        joints: &[String],
    ) -> Result<Option<Self>, ClearanceError> {
        let mut builder = SceneBuilder::new();
        let mount = Mount::World(Pose::default());
        builder.add_robot(model.name(), model, mount, &mut |_| None)?;
        let scene = builder.build();
        if scene.pair_count() == 0 {
            return Ok(None);
        }
        let place = |name: &str| joints.iter().position(|joint| joint == name);
        let joints = model.variables().map(|variable| place(variable.name)).collect();
        let links = model.links().iter().map(|link| link.name.clone()).collect();
        Ok(Some(Self { scene, links, joints }))
    }

    /// Refuses a trajectory on which two links come together, or might.
    pub(super) fn check(&self, trajectory: &CompiledTrajectory) -> Result<(), Denial> {
        let peak = trajectory.peak_velocity();
        let of = |joint: &Option<usize>| joint.and_then(|joint| peak.get(joint)).copied();
        let speeds: Vec<f64> =
            self.joints.iter().map(|joint| of(joint).unwrap_or_default() * ROUNDING).collect();
        let check = MotionCheck {
            duration_s: trajectory.duration_s(),
            resolution_s: RESOLUTION_S,
            threshold_m: THRESHOLD_M,
            speeds: Some(&speeds),
            max_states: MAX_STATES,
        };
        let mut hint = 0;
        let sample = |time_s: f64, positions: &mut [f64]| {
            let at = trajectory.sample(time_s, &mut hint).position;
            for (position, joint) in positions.iter_mut().zip(&self.joints) {
                *position = joint.and_then(|joint| at.get(joint)).copied().unwrap_or_default();
            }
        };
        let report = self.scene.check_motion(&check, sample, &mut self.scene.workspace());
        let report = report.map_err(|error| {
            Denial::new(DenialCode::Internal, format!("own links could not be checked: {error}"))
        })?;
        let nearest = match report.verdict {
            MotionVerdict::Clear => return Ok(()),
            MotionVerdict::Violation => report.first_violation,
            MotionVerdict::Undecided { from_s, .. } => {
                return Err(undecided(from_s, "move slower"));
            }
            MotionVerdict::OutOfStates { until_s } => {
                return Err(undecided(until_s, "split the trajectory"));
            }
            MotionVerdict::ClearAtSamples => None,
        };
        let Some(nearest) = nearest else {
            let text = format!("own links were checked with no result: {:?}", report.verdict);
            return Err(Denial::new(DenialCode::Internal, text));
        };
        let [a, b] = [nearest.pair.a, nearest.pair.b].map(|body| self.link(body));
        let (distance_m, at_s) = (nearest.pair.distance_m, nearest.time_s);
        Err(Denial::new(
            DenialCode::Collision,
            format!(
                "links {a} and {b} are {distance_m:.4} m apart at {at_s:.2} s of the trajectory, \
                 {THRESHOLD_M} m are required"
            ),
        )
        .with("links", vec![a.to_owned(), b.to_owned()])
        .with("value", distance_m)
        .with("limit", THRESHOLD_M)
        .with("at_s", at_s))
    }

    fn link(&self, body: armada_model::BodyId) -> &str {
        let link = match self.scene.body(body).map(|body| body.owner()) {
            Some(Owner::Link { link, .. }) => self.links.get(link),
            _ => None,
        };
        link.map_or("unknown", String::as_str)
    }
}

/// Nothing is known to be too near, and from a time on nothing is known at all.
fn undecided(from_s: f64, remedy: &str) -> Denial {
    let text = format!(
        "own links could not be shown to keep {THRESHOLD_M} m after {from_s:.2} s of the \
         trajectory: {remedy}"
    );
    Denial::new(DenialCode::Collision, text).with("at_s", from_s).with("limit", THRESHOLD_M)
}

#[cfg(test)]
mod tests {
    use armada_model::{
        Interpolation, JointLimits, JointTrajectory, MotionLimits, TrajectoryOptions, Waypoint,
    };

    use super::*;

    /// The arm of the default cell, which folds its elbow from `from` to `to`.
    fn fold(from: f64, to: f64) -> Result<(), Denial> {
        elbow_at(&[(0.0, from), (4.0, to)])
    }

    /// The same arm, with its elbow at these places at these times \[s\].
    fn elbow_at(places: &[(f64, f64)]) -> Result<(), Denial> {
        let text = include_str!("../../../config/robots/six_axis_arm.urdf");
        let model = RobotModel::from_urdf(text, "arm.urdf").expect("a robot description");
        let names: Vec<String> = model.variables().map(|v| v.name.to_owned()).collect();
        let own = SelfCollision::of(&model, &names).expect("usable").expect("it has shapes");
        let limits =
            JointLimits { velocity: 2.0, acceleration: Some(10.0), ..JointLimits::default() };
        let limits = MotionLimits::new(&vec![limits; names.len()]).expect("complete");
        let waypoint = |time_from_start_s, elbow| Waypoint {
            time_from_start_s,
            joint_position: vec![0.0, -1.57, elbow, -1.57, -1.57, 0.0],
            ..Waypoint::default()
        };
        let wanted = JointTrajectory {
            joint_names: names.clone(),
            waypoints: places.iter().map(|&(time_s, elbow)| waypoint(time_s, elbow)).collect(),
            // It does not overshoot.
            interpolation: Interpolation::JointLinear,
            ..JointTrajectory::default()
        };
        let options = TrajectoryOptions::default();
        let compiled = CompiledTrajectory::compile(&wanted, &names, &limits, &options);
        own.check(&compiled.expect("legal"))
    }

    #[test]
    fn an_arm_that_folds_onto_itself_is_refused_with_both_links_and_the_distance() {
        fold(1.57, 1.0).expect("clear");
        let refused = fold(1.57, 3.1).expect_err("the forearm meets the upper arm");
        assert_eq!(refused.code, DenialCode::Collision);
        assert_eq!(refused.details["links"].as_array().map(Vec::len), Some(2), "{refused}");
        assert!(refused.details["value"].as_f64().is_some_and(|d| d < 1e-3), "{refused}");
    }

    /// How far the elbow folds at least until links are too near, to a nanoradian \[rad\].
    fn nearest_fold() -> f64 {
        let is_too_near = |to| {
            let refused = fold(1.57, to).err();
            refused.is_some_and(|denial| denial.details.contains_key("links"))
        };
        let (mut clear, mut too_near) = (1.57, 3.1);
        while too_near - clear > 1e-9 {
            let middle = 0.5 * (clear + too_near);
            if is_too_near(middle) { too_near = middle } else { clear = middle }
        }
        clear
    }

    #[test]
    fn what_cannot_be_shown_to_be_clear_is_refused_with_its_time_and_a_remedy() {
        let nearest = nearest_fold();
        // Between two looks it could come nearer, as far as its speed tells.
        let refused = fold(1.57, nearest).expect_err("in doubt");
        assert_eq!(refused.code, DenialCode::Collision);
        assert!(refused.message.ends_with("move slower"), "{refused}");
        assert!(refused.details["at_s"].as_f64().is_some_and(|at| at > 3.5), "{refused}");
        fold(1.57, nearest - 0.01).expect("clear");
        // So near for so long that it would have to be looked at for ever.
        let near = nearest - 0.002;
        let refused = elbow_at(&[(0.0, 1.57), (4.0, near), (3000.0, near)]).expect_err("in doubt");
        assert!(refused.message.ends_with("split the trajectory"), "{refused}");
        assert!(refused.details["at_s"].as_f64().is_some_and(|at| at > 4.0), "{refused}");
    }
}
