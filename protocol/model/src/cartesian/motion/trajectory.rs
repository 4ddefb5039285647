//! Motions of the tool in time.

use nalgebra::Vector3;

use super::error::CartesianError as Error;
use super::planner::{CartesianMotion, CartesianPlanner};
use super::speed::{SpeedLimited, speed_share};
use crate::{
    AxisLimits, CartesianPath, JointTrajectory, JointVector, MotionLimits, Pose, RetimeError,
    RetimeOptions, TimedPath, retime, retime_jerk_limited,
};

/// Time between waypoints of a trajectory \[s\], longer if there would be more than so many in a leg.
const SPACING_S: f64 = 0.01;
const MAX_STEPS: f64 = 20_000.0;

impl CartesianPlanner {
    /// The straight motion of the tool from where `start` puts it to `to`, in the least time that
    /// `limits` allow; one set of limits per variable of the chain.
    ///
    /// ```
    /// use armada_model::{
    ///     CartesianError, CartesianOptions, CartesianPlanner, Chain, JointLimits, JointVector,
    ///     MotionLimits, Pose, RobotModel,
    /// };
    ///
    /// // A gantry with a turning tool reaches every pose whose tool hangs down.
    /// # let link = |name: &str| format!(r#"<link name="{name}"/>"#);
    /// # let joint = |name: &str, kind: &str, parent: &str, child: &str, axis: &str| format!(
    /// #     r#"<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
    /// #     <axis xyz="{axis}"/><limit lower="-1" upper="1" velocity="2" effort="1"/></joint>"#);
    /// # let urdf = [
    /// #     r#"<robot name="gantry">"#.to_owned(), link("base"), link("a"), link("b"), link("c"),
    /// #     link("tool"), joint("x", "prismatic", "base", "a", "1 0 0"),
    /// #     joint("y", "prismatic", "a", "b", "0 1 0"), joint("z", "prismatic", "b", "c", "0 0 1"),
    /// #     joint("turn", "revolute", "c", "tool", "0 0 1"), "</robot>".to_owned()].concat();
    /// let model = RobotModel::from_urdf(&urdf, "gantry.urdf")?;
    /// let chain = Chain::new(&model, "base", "tool")?;
    /// let joint = JointLimits { velocity: 2.0, acceleration: Some(4.0), ..JointLimits::default() };
    /// let limits = MotionLimits::new(&[joint; 4])?;
    ///
    /// let options = CartesianOptions { max_linear_speed: 0.25, ..CartesianOptions::default() };
    /// let planner = CartesianPlanner::new(&chain, &options)?;
    /// let start = JointVector::from_slice(&[0.0; 4])?;
    /// let trajectory = planner.line(&start, &Pose::from_translation(0.3, 0.4, 0.0), &limits)?;
    /// let duration_s = trajectory.waypoints.last().map_or(0.0, |last| last.time_from_start_s);
    /// assert!(duration_s > 0.5 / 0.25 && duration_s < 2.2);
    ///
    /// // The gantry ends at 1 m, 80 % of the way, less a margin of 0.1 mm.
    /// match planner.line(&start, &Pose::from_translation(1.25, 0.0, 0.0), &limits) {
    ///     Err(CartesianError::Blocked(block)) => assert!((block.fraction - 0.8).abs() < 1e-4),
    ///     other => unreachable!("{other:?}"),
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// A [`CartesianError`](Error): the line cannot be followed, or `limits` or `start` do not fit.
    pub fn line(
        &self,
        start: &JointVector,
        to: &Pose,
        limits: &MotionLimits,
    ) -> Result<JointTrajectory, Error> {
        let path = CartesianPath::line(&self.pose(start)?, to)?;
        self.follow(&path, start)?.trajectory(limits)
    }

    /// The motion of the tool on the circle from where `start` puts it through `via` \[m\] to `to`,
    /// in the least time that `limits` allow; one set of limits per variable of the chain.
    ///
    /// # Errors
    /// A [`CartesianError`](Error): the arc cannot be followed, or `limits` or `start` do not fit.
    pub fn arc(
        &self,
        start: &JointVector,
        (via, to): (&Vector3<f64>, &Pose),
        limits: &MotionLimits,
    ) -> Result<JointTrajectory, Error> {
        let path = CartesianPath::arc(&self.pose(start)?, via, to)?;
        self.follow(&path, start)?.trajectory(limits)
    }
}

impl CartesianMotion {
    /// The motion in the least time that `limits` and the tool's limits of speed allow, at rest at
    /// both ends and at every stop; one set of limits per variable of the chain. Jerk is not limited.
    ///
    /// # Errors
    /// [`CartesianError::LimitCount`](Error::LimitCount) if `limits` do not fit,
    /// [`CartesianError::Retime`](Error::Retime) if they allow no motion.
    pub fn trajectory(&self, limits: &MotionLimits) -> Result<JointTrajectory, Error> {
        self.timed(limits, |leg, axes| retime(leg, axes, &RetimeOptions::default()))
    }

    /// As [`trajectory`](Self::trajectory), but within the limits of jerk too, which is gentler to
    /// arm and load: somewhat slower, and some hundred times the work.
    ///
    /// # Errors
    /// Those of [`trajectory`](Self::trajectory).
    pub fn trajectory_jerk_limited(&self, limits: &MotionLimits) -> Result<JointTrajectory, Error> {
        self.timed(limits, |leg, axes| retime_jerk_limited(leg, axes, &RetimeOptions::default()))
    }

    fn timed<'m>(
        &'m self,
        limits: &MotionLimits,
        retime: impl Fn(SpeedLimited<'m>, &[AxisLimits]) -> Timed<'m>,
    ) -> Result<JointTrajectory, Error> {
        let joints = self.chain().len();
        if limits.len() != joints {
            return Err(Error::LimitCount { limits: limits.len(), joints });
        }
        let axes: Vec<_> = limits.iter().copied().chain([speed_share(limits)]).collect();
        let names = self.chain().variables().iter().map(|variable| variable.name.clone());
        let mut whole =
            JointTrajectory { joint_names: names.collect(), ..JointTrajectory::default() };
        let mut names = whole.joint_names.clone();
        names.push("speed of the tool".to_owned());
        for leg in self.legs() {
            let timed = retime(SpeedLimited::new(leg, self.chain(), self.options()), &axes)?;
            let spacing_s = SPACING_S.max(timed.duration_s() / MAX_STEPS);
            append(&mut whole, timed.to_trajectory(&names, spacing_s)?.trajectory);
        }
        Ok(whole)
    }
}

type Timed<'m> = Result<TimedPath<SpeedLimited<'m>>, RetimeError>;

/// Adds a leg to the joints of a trajectory, which is at rest at its end.
fn append(whole: &mut JointTrajectory, leg: JointTrajectory) {
    let joints = whole.joint_names.len();
    let start_s = whole.waypoints.last().map(|waypoint| waypoint.time_from_start_s);
    // Every leg but the first begins with the waypoint that the one before it ends with.
    for mut waypoint in leg.waypoints.into_iter().skip(usize::from(start_s.is_some())) {
        waypoint.time_from_start_s += start_s.unwrap_or_default();
        waypoint.joint_position.truncate(joints);
        waypoint.joint_velocity.truncate(joints);
        whole.waypoints.push(waypoint);
    }
}
