//! The emulated controller's own planning of moves.
//!
//! ```text
//! batch --groups--> moves blended into one another --joint path or tool path--> q(s)
//!                                        --retime--> trajectory at rest at both ends
//! ```
//!
//! A group ends where there is no blend, or where moves in joint space meet straight ones: there the
//! robot stops. A group runs at the lowest speed of its moves. Planning allocates.

use armada_model::{
    CartesianMove, CartesianOptions, CartesianPath, CartesianPlanner, Chain, CompiledTrajectory,
    DEFAULT_ROTATION_WEIGHT, InverseKinematics, InverseOptions, InverseTarget, JointCorner,
    JointLimits, JointTrajectory, JointVector, MotionLimits, Pose, RetimeOptions,
    TrajectoryOptions, Waypoint, blended_legs, retime,
};
use armada_protocol::messages::{JointInfo, ReducedLimits};

use super::EmulatorConfig;
use super::error_code;
use crate::drivers::{DelegatedGoal, DelegatedMove, DriverSetup};

/// Goals nearer than this are the same \[rad or m\].
const SAME: f64 = 1e-6;
/// Time between waypoints of a planned trajectory \[s\].
const SPACING_S: f64 = 0.01;
/// Highest speed of the tool in mode manual reduced speed \[m/s\].
///
/// Source: ISO 10218-1:2011, 5.6.2, reduced speed control.
const REDUCED_TOOL_SPEED: f64 = 0.25;
/// Highest angular speed of the tool \[rad/s\].
const TOOL_TURN_SPEED: f64 = 3.0;

/// Plans moves of a robot.
#[derive(Debug)]
pub(super) struct Planner {
    names: Vec<String>,
    limits: Vec<JointLimits>,
    reduced: Vec<ReducedLimits>,
    arms: Vec<Option<Arm>>,
    tool_speed: f64,
}

/// A chain all of whose variables are joints of the robot.
#[derive(Debug)]
struct Arm {
    flange: Chain,
    tool: Pose,
    /// The joint of each variable.
    joints: Vec<usize>,
}

/// Moves blended into one another, with their goals.
struct Group<'a> {
    moves: &'a [DelegatedMove],
    limits: MotionLimits,
    tool_speed: f64,
    speed: f64,
}

impl Planner {
    pub(super) fn new(config: &EmulatorConfig, setup: &DriverSetup) -> Self {
        let joints = &setup.joints;
        let arm = |chain: &Option<Chain>| Arm::new(chain.as_ref()?, joints);
        Self {
            names: joints.iter().map(|joint| joint.name.clone()).collect(),
            limits: joints.iter().map(|joint| joint.limits).collect(),
            reduced: joints.iter().map(|joint| joint.reduced).collect(),
            arms: setup.chains.iter().map(arm).collect(),
            tool_speed: config.tool_speed_m_s,
        }
    }

    /// Takes a tool; says whether there is such a chain.
    pub(super) fn set_tool(&mut self, chain: u8, tool: &Pose) -> bool {
        match self.arms.get_mut(usize::from(chain)) {
            Some(Some(arm)) => arm.tool = *tool,
            _ => return false,
        }
        true
    }

    /// Pose of the flange of a chain, and its tool; `None` if there is no such chain.
    pub(super) fn flange_and_tool(&self, chain: u8, joints: &JointVector) -> Option<(Pose, Pose)> {
        let arm = self.arm(chain).ok()?;
        let flange = arm.flange.forward(&arm.own(joints)).ok()?;
        Some((Pose::from_isometry(flange), arm.tool))
    }

    /// Adds what the weight of `mass` \[kg\] at the flange of a chain asks of each joint
    /// \[Nm or N\]; the base of the chain stands upright.
    pub(super) fn add_weight(
        &self,
        chain: u8,
        mass: f64,
        joints: &JointVector,
        effort: &mut JointVector,
    ) {
        const GRAVITY: f64 = 9.81;
        let Ok(arm) = self.arm(chain) else { return };
        let Ok((_, jacobian)) = arm.flange.forward_and_jacobian(&arm.own(joints)) else { return };
        for (column, &joint) in arm.joints.iter().enumerate() {
            if let (Some(lift), Some(slot)) = (jacobian.element(2, column), effort.get_mut(joint)) {
                *slot += mass * GRAVITY * lift;
            }
        }
    }

    /// Trajectories to be run one after another from `start`, each from rest to rest; none if the
    /// robot is at the goal.
    ///
    /// # Errors
    /// One of [`error_code`]: why it cannot be done.
    pub(super) fn plan(
        &self,
        start: &JointVector,
        batch: &[DelegatedMove],
        is_reduced: bool,
    ) -> Result<Vec<CompiledTrajectory>, u32> {
        let mut at = *start;
        let mut pieces = Vec::new();
        let mut rest = batch;
        while let Some(length) = group_length(rest) {
            let (moves, others) = rest.split_at(length);
            rest = others;
            let group = self.group(moves, is_reduced)?;
            let piece = match moves.first().map(|first| &first.goal) {
                Some(&DelegatedGoal::Linear { chain, .. }) => {
                    self.straight(&group, self.arm(chain)?, &at)?
                }
                _ => self.by_joints(&group, &at)?,
            };
            if let Some(piece) = piece {
                at = piece.end();
                pieces.push(piece);
            }
        }
        Ok(pieces)
    }

    fn arm(&self, chain: u8) -> Result<&Arm, u32> {
        let arm = self.arms.get(usize::from(chain)).and_then(Option::as_ref);
        arm.ok_or(error_code::NO_CHAIN)
    }

    fn group<'a>(&self, moves: &'a [DelegatedMove], is_reduced: bool) -> Result<Group<'a>, u32> {
        let speed = moves.iter().fold(1.0_f64, |lowest, wanted| lowest.min(wanted.speed));
        let limits: Vec<_> = self
            .limits
            .iter()
            .zip(&self.reduced)
            .map(|(limits, reduced)| {
                let slow = is_reduced && reduced.velocity > 0.0 && reduced.acceleration > 0.0;
                let least = |limit: f64, reduced: f64| if slow { limit.min(reduced) } else { limit };
                JointLimits {
                    velocity: speed * least(limits.velocity, reduced.velocity),
                    acceleration: limits.acceleration.map(|a| least(a, reduced.acceleration)),
                    ..*limits
                }
            })
            .collect();
        let limits = MotionLimits::new(&limits).map_err(|_| error_code::NO_MOTION)?;
        let highest = if is_reduced { REDUCED_TOOL_SPEED } else { f64::INFINITY };
        Ok(Group { moves, limits, tool_speed: (speed * self.tool_speed).min(highest), speed })
    }

    /// Straight in joint space from goal to goal.
    fn by_joints(
        &self,
        group: &Group<'_>,
        start: &JointVector,
    ) -> Result<Option<CompiledTrajectory>, u32> {
        let mut points = vec![*start];
        let mut radii = Vec::new();
        for wanted in group.moves {
            let from = points.last().unwrap_or(start);
            let goal = self.joint_goal(&wanted.goal, from)?;
            if goal.max_abs_difference(from) >= SAME {
                points.push(goal);
                radii.push(wanted.blend_radius_m);
            }
        }
        if points.len() < 2 {
            return Ok(None);
        }
        let corners: Vec<_> = points
            .windows(3)
            .zip(&radii)
            .map(|(corner, &radius)| JointCorner::Radius(self.joint_radius(corner, radius)))
            .collect();
        let rows: Vec<&[f64]> = points.iter().map(|point| &**point).collect();
        let legs = blended_legs(&rows, &corners).map_err(|_| error_code::NO_MOTION)?;
        let mut whole = JointTrajectory::default();
        for leg in legs {
            let timed = retime(leg, &group.limits, &RetimeOptions::default())
                .map_err(|_| error_code::NO_MOTION)?;
            let made = timed
                .to_trajectory(&self.names, SPACING_S)
                .map_err(|_| error_code::OUT_OF_LIMITS)?;
            append(&mut whole, made.trajectory);
        }
        self.compile(&whole, group).map(Some)
    }

    /// Straight for the tool from pose to pose.
    fn straight(
        &self,
        group: &Group<'_>,
        arm: &Arm,
        start: &JointVector,
    ) -> Result<Option<CompiledTrajectory>, u32> {
        let chain = arm.tcp();
        let own = arm.own(start);
        let from = chain.forward(&own).map_err(|_| error_code::NO_MOTION)?;
        let from = Pose::from_isometry(from);
        let mut at = from;
        let mut moves: Vec<CartesianMove> = Vec::new();
        for wanted in group.moves {
            let DelegatedGoal::Linear { pose, .. } = &wanted.goal else { continue };
            let (distance, angle) = at.distance(pose);
            if distance < SAME && angle < SAME {
                continue;
            }
            let radius = wanted.blend_radius_m;
            let radius = if radius < SAME { 0.0 } else { radius };
            moves.push(CartesianMove::line(*pose).blended(radius));
            at = *pose;
        }
        let Some(last) = moves.last_mut() else { return Ok(None) };
        last.blend_radius = 0.0;
        let options = CartesianOptions {
            max_linear_speed: group.tool_speed,
            max_angular_speed: group.speed * TOOL_TURN_SPEED,
            ..CartesianOptions::default()
        };
        let path = CartesianPath::new(&from, &moves, DEFAULT_ROTATION_WEIGHT)
            .map_err(|_| error_code::NO_MOTION)?;
        let planner =
            CartesianPlanner::new(&chain, &options).map_err(|_| error_code::NO_MOTION)?;
        let motion = planner.follow(&path, &own).map_err(|_| error_code::UNREACHABLE)?;
        let limits = self.limits_of(arm, group)?;
        let own = motion.trajectory(&limits).map_err(|_| error_code::NO_MOTION)?;
        self.compile(&self.spread(arm, &own, start), group).map(Some)
    }

    fn joint_goal(&self, goal: &DelegatedGoal, seed: &JointVector) -> Result<JointVector, u32> {
        let goal = match goal {
            DelegatedGoal::Joint(goal) => *goal,
            DelegatedGoal::Pose { chain, pose } | DelegatedGoal::Linear { chain, pose } => {
                let arm = self.arm(*chain)?;
                let solver = InverseKinematics::new(&arm.tcp(), InverseOptions::default());
                let target = InverseTarget::Pose(*pose.isometry());
                let solution = solver
                    .solve(&arm.own(seed), &target)
                    .map_err(|_| error_code::UNREACHABLE)?;
                arm.put(&solution.positions, seed)
            }
        };
        let fits = goal.len() == self.limits.len()
            && goal.iter().zip(&self.limits).all(|(&value, limits)| limits.contains(value));
        if fits { Ok(goal) } else { Err(error_code::OUT_OF_LIMITS) }
    }

    /// The radius of a blend in joint space for that of the tool: in the measure of the leg beside
    /// the corner in which the tool moves more. Without a chain both are the same number.
    fn joint_radius(&self, corner: &[JointVector], radius: f64) -> f64 {
        let Some(arm) = self.arms.iter().flatten().next() else { return radius };
        let tool = |joints: &JointVector| arm.tcp().forward(&arm.own(joints)).ok();
        corner
            .windows(2)
            .filter_map(|leg| {
                let [from, to] = leg else { return None };
                let way = (tool(to)?.translation.vector - tool(from)?.translation.vector).norm();
                let turns = from.iter().zip(to.iter()).map(|(a, b)| (b - a) * (b - a)).sum::<f64>();
                Some(radius * turns.sqrt() / way.max(SAME))
            })
            .fold(f64::INFINITY, f64::min)
            .clamp(SAME, 1e3)
    }

    fn limits_of(&self, arm: &Arm, group: &Group<'_>) -> Result<MotionLimits, u32> {
        let limits: Vec<_> = arm
            .joints
            .iter()
            .filter_map(|&joint| {
                let axis = group.limits.get(joint)?;
                Some(JointLimits {
                    velocity: axis.velocity,
                    acceleration: Some(axis.acceleration),
                    jerk: Some(axis.jerk),
                    ..*self.limits.get(joint)?
                })
            })
            .collect();
        MotionLimits::new(&limits).map_err(|_| error_code::NO_MOTION)
    }

    /// A trajectory of the chain's joints as one of the whole robot, the others standing still.
    fn spread(&self, arm: &Arm, own: &JointTrajectory, start: &JointVector) -> JointTrajectory {
        let zeros = start.map_indexed(|_, _| 0.0);
        let waypoints = own.waypoints.iter().map(|waypoint| Waypoint {
            joint_position: arm.put(&waypoint.joint_position, start).to_vec(),
            joint_velocity: arm.put(&waypoint.joint_velocity, &zeros).to_vec(),
            ..waypoint.clone()
        });
        JointTrajectory {
            joint_names: self.names.clone(),
            waypoints: waypoints.collect(),
            ..own.clone()
        }
    }

    fn compile(
        &self,
        trajectory: &JointTrajectory,
        group: &Group<'_>,
    ) -> Result<CompiledTrajectory, u32> {
        let options = TrajectoryOptions::default();
        CompiledTrajectory::compile(trajectory, &self.names, &group.limits, &options)
            .map_err(|_| error_code::OUT_OF_LIMITS)
    }
}

impl Arm {
    /// `None` if a variable of the chain is no joint of the robot.
    fn new(chain: &Chain, joints: &[JointInfo]) -> Option<Self> {
        let place = |name: &str| joints.iter().position(|joint| joint.name == name);
        let joints = chain.variables().iter().map(|variable| place(&variable.name));
        let joints = joints.collect::<Option<Vec<_>>>()?;
        Some(Self { flange: chain.clone(), tool: Pose::default(), joints })
    }

    fn tcp(&self) -> Chain {
        self.flange.clone().with_tool(&self.tool)
    }

    /// The chain's part of a vector of the robot.
    fn own(&self, robot: &JointVector) -> JointVector {
        let zeros = JointVector::zeros(self.joints.len()).unwrap_or_default();
        let of = |variable: usize| robot.get(*self.joints.get(variable)?).copied();
        zeros.map_indexed(|variable, _| of(variable).unwrap_or_default())
    }

    /// `robot` with the chain's part replaced.
    fn put(&self, own: &[f64], robot: &JointVector) -> JointVector {
        let mut all = *robot;
        for (&joint, &value) in self.joints.iter().zip(own) {
            if let Some(slot) = all.get_mut(joint) {
                *slot = value;
            }
        }
        all
    }
}

/// How many of the first moves are blended into one another; `None` if there is none left.
fn group_length(moves: &[DelegatedMove]) -> Option<usize> {
    moves.first()?;
    let blends = moves.windows(2).take_while(|pair| match pair {
        [one, next] => one.blend_radius_m >= SAME && same_way(&one.goal, &next.goal),
        _ => false,
    });
    Some(1 + blends.count())
}

/// Whether both are straight moves of one chain, or both are moves in joint space.
fn same_way(one: &DelegatedGoal, other: &DelegatedGoal) -> bool {
    match (one, other) {
        (DelegatedGoal::Linear { chain: a, .. }, DelegatedGoal::Linear { chain: b, .. }) => a == b,
        (DelegatedGoal::Linear { .. }, _) | (_, DelegatedGoal::Linear { .. }) => false,
        _ => true,
    }
}

/// Adds a leg that begins where the one before ends, both at rest there.
fn append(whole: &mut JointTrajectory, leg: JointTrajectory) {
    let Some(end_s) = whole.waypoints.last().map(|last| last.time_from_start_s) else {
        *whole = leg;
        return;
    };
    for mut waypoint in leg.waypoints.into_iter().skip(1) {
        waypoint.time_from_start_s += end_s;
        whole.waypoints.push(waypoint);
    }
}
