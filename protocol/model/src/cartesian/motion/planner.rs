//! Following a path with an arm.

use super::error::{CartesianError as Error, PathBlock};
use super::fit::{FitError, fit};
use super::options::CartesianOptions;
use super::solve::{Follower, solver};
use super::walk::{Leg, walk};
use crate::{
    CartesianPath, Chain, GeometricPath, InverseKinematics, JointLimits, JointPath, JointVector,
    KinematicsError, PathError, Pose,
};

/// How often a leg is cut where its curve is blocked, before half of it is.
const FIT_ATTEMPTS: usize = 4;

/// Follows Cartesian paths with the tool of a chain.
///
/// Poses are solved one from another, so that posture stays on the branch on which it begins, and
/// 1e-4 rad or m inside the limits of every joint. Making a planner takes about a tenth of a
/// millisecond, for the solver that it holds.
#[derive(Clone, Debug)]
pub struct CartesianPlanner {
    inverse: InverseKinematics,
    options: CartesianOptions,
}

/// How the joints move along a path, without time.
///
/// Between two stops every joint is a smooth function of the path's parameter `s`, with continuous
/// second derivative; the tool is within tolerance of the path all the way, every joint within its
/// limits.
#[derive(Clone, Debug)]
pub struct CartesianMotion {
    chain: Chain,
    path: CartesianPath,
    options: CartesianOptions,
    legs: Vec<JointPath>,
}

/// As much of a path as can be followed.
#[derive(Clone, Debug)]
pub struct ReachableMotion {
    /// The motion along the first part of the path, `None` if not even its beginning can be
    /// followed.
    pub motion: Option<CartesianMotion>,
    /// How much of the path that is, from 0 to 1; that of `block`, or a little less where no curve
    /// could be drawn up to there.
    pub fraction: f64,
    /// Why it is not the whole, `None` if it is.
    pub block: Option<Box<PathBlock>>,
}

impl CartesianPlanner {
    /// A planner for the tool centre point of `chain`. Paths are in the chain's base.
    ///
    /// # Errors
    /// [`CartesianError::Option`](Error::Option) and [`CartesianError::Tolerance`](Error::Tolerance)
    /// if an option is out of range.
    pub fn new(chain: &Chain, options: &CartesianOptions) -> Result<Self, Error> {
        options.check()?;
        Ok(Self { inverse: solver(chain), options: *options })
    }

    /// The motion along the whole of `path` from the joint positions `start` \[rad or m\], which put
    /// the tool at its beginning.
    ///
    /// # Errors
    /// [`CartesianError::Blocked`](Error::Blocked) if the path cannot be followed to its end, with
    /// the place and the reason; [`CartesianError::Kinematics`](Error::Kinematics) and
    /// [`CartesianError::Start`](Error::Start) if `start` is not at its beginning.
    pub fn follow(
        &self,
        path: &CartesianPath,
        start: &JointVector,
    ) -> Result<CartesianMotion, Error> {
        match self.follow_reachable(path, start)? {
            ReachableMotion { motion: Some(motion), block: None, .. } => Ok(motion),
            ReachableMotion { block: Some(block), .. } => Err(Error::Blocked(block)),
            // A path without block has a leg, for it has a length.
            ReachableMotion { .. } => Err(Error::Curve(PathError::NoCoordinates)),
        }
    }

    /// The motion along as much of `path` as can be followed from the joint positions `start`.
    ///
    /// # Errors
    /// As [`follow`](Self::follow), but for a path that is blocked, which is no error here.
    pub fn follow_reachable(
        &self,
        path: &CartesianPath,
        start: &JointVector,
    ) -> Result<ReachableMotion, Error> {
        self.check_start(path, start)?;
        let follower = Follower { inverse: &self.inverse, path, options: &self.options };
        let (mut solved, mut block) = walk(&follower, start);
        let mut legs = Vec::with_capacity(solved.len());
        for leg in &mut solved {
            let (curve, blocked) = fit_reachable(&follower, leg)?;
            legs.extend(curve);
            if blocked.is_some() {
                block = blocked;
                break;
            }
        }
        let end = legs.last().map_or(0.0, |leg| leg.range().1);
        let fraction = if block.is_none() { 1.0 } else { end / path.length() };
        let motion = (!legs.is_empty()).then(|| CartesianMotion {
            chain: self.inverse.chain().clone(),
            path: path.clone(),
            options: self.options,
            legs,
        });
        Ok(ReachableMotion { motion, fraction, block })
    }

    /// Pose of the tool.
    pub(super) fn pose(&self, positions: &JointVector) -> Result<Pose, KinematicsError> {
        self.inverse.chain().forward(positions).map(Pose::from_isometry)
    }

    fn check_start(&self, path: &CartesianPath, start: &JointVector) -> Result<(), Error> {
        let (distance, angle) = self.pose(start)?.distance(&path.pose_at(0.0));
        let CartesianOptions { position_tolerance, angle_tolerance, .. } = self.options;
        if distance > position_tolerance || angle > angle_tolerance {
            return Err(Error::Start { distance, angle });
        }
        for (joint, (variable, &value)) in
            self.inverse.chain().variables().iter().zip(start.iter()).enumerate()
        {
            let JointLimits { lower, upper, .. } = variable.limits;
            let (lower, upper) = (lower.filter(|&l| value < l), upper.filter(|&u| value > u));
            if let Some(limit) = lower.or(upper) {
                return Err(Error::StartLimit { joint, value, limit });
            }
        }
        Ok(())
    }
}

impl CartesianMotion {
    /// The chain that moves; its variables are the coordinates of [`legs`](Self::legs).
    #[must_use]
    pub const fn chain(&self) -> &Chain {
        &self.chain
    }

    /// How exactly the path is followed, and how fast the tool may go.
    #[must_use]
    pub const fn options(&self) -> &CartesianOptions {
        &self.options
    }

    /// The path that is followed.
    #[must_use]
    pub const fn path(&self) -> &CartesianPath {
        &self.path
    }

    /// The motion from stop to stop: positions of the chain's variables as functions of the path's
    /// parameter `s` \[m\], each over its part of the path; one at least.
    #[must_use]
    pub fn legs(&self) -> &[JointPath] {
        &self.legs
    }
}

/// The curve through as much of `leg` as is possible, and what blocks the rest.
fn fit_reachable(
    follower: &Follower<'_>,
    leg: &mut Leg,
) -> Result<(Option<JointPath>, Option<Box<PathBlock>>), Error> {
    let mut block = None;
    for attempt in 0.. {
        match fit(follower, leg) {
            Ok(curve) => return Ok((Some(curve), block)),
            Err(FitError::Path(error)) => return Err(error.into()),
            Err(FitError::Blocked(blocked)) => block = Some(blocked),
        }
        if attempt >= FIT_ATTEMPTS {
            // No curve ends well near the block: let go of more.
            leg.truncate(leg.len() / 2);
        }
        if leg.len() < 2 {
            break;
        }
    }
    Ok((None, block))
}
