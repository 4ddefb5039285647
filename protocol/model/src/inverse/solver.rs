//! The solver.

#![allow(clippy::result_large_err, reason = "a failure holds the best positions, without heap")]

use super::bounds::{Bounds, Keep};
use super::descent::{Descent, Positions, Search};
use super::diagnosis::Unlimited;
use super::options::InverseOptions;
use super::outcome::{InverseCause, InverseFailure, InverseSolution};
use super::reach::Reach;
use super::seeds::{Random, SeedTable};
use super::target::{InverseTarget, Residual, Task};
use crate::{Chain, JointVector, KinematicsError, MAX_JOINTS};

/// Most iterations of one start of a cold solution.
const ITERATIONS: u32 = 60;

/// Steps towards the preferred posture, warm and cold.
const POSTURE_STEPS: [u32; 2] = [2, 30];

/// Postures of the table from which a search without limits looks for the joint that is in the way.
const UNLIMITED_STARTS: usize = 8;

/// Numerical inverse kinematics of one [`Chain`].
///
/// It finds joint positions inside the limits that bring the tool centre point to a target, or says
/// what is in the way. The same seed and target give the same answer, always. Making a solver
/// allocates and takes about a tenth of a millisecond, solving does not allocate.
///
/// ```
/// use armada_model::{Chain, InverseKinematics, InverseOptions, InverseTarget, RobotModel};
///
/// let urdf = r#"<robot name="arm"><link name="base"/><link name="upper"/><link name="fore"/>
///   <link name="hand"/>
///   <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/>
///     <axis xyz="0 0 1"/></joint>
///   <joint name="elbow" type="revolute"><origin xyz="0.4 0 0"/>
///     <parent link="upper"/><child link="fore"/><axis xyz="0 0 1"/>
///     <limit lower="-2.5" upper="2.5" velocity="1"/></joint>
///   <joint name="wrist" type="fixed"><origin xyz="0.3 0 0"/>
///     <parent link="fore"/><child link="hand"/></joint></robot>"#;
/// let model = RobotModel::from_urdf(urdf, "arm.urdf")?;
/// let chain = Chain::new(&model, "base", "hand")?;
/// let solver = InverseKinematics::new(&chain, InverseOptions::default());
///
/// let target = InverseTarget::Position([0.4, 0.3, 0.0].into());
/// let solution = solver.solve(&[0.1, 0.8], &target)?;
/// let reached = chain.forward(&solution.positions)?;
/// assert!((reached.translation.vector - nalgebra::Vector3::new(0.4, 0.3, 0.0)).norm() < 1e-6);
///
/// let far = InverseTarget::Position([0.8, 0.0, 0.0].into());
/// let failure = solver.solve(&[0.1, 0.8], &far).unwrap_err();
/// assert!(failure.to_string().contains("0.1"), "{failure}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct InverseKinematics {
    chain: Chain,
    bounds: Bounds,
    reach: Reach,
    seeds: SeedTable,
    options: InverseOptions,
}

/// Where a solution begins and how much is spent on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Effort {
    Warm,
    Cold,
}

impl InverseKinematics {
    /// A solver for `chain`, tool and limits included.
    #[must_use]
    pub fn new(chain: &Chain, options: InverseOptions) -> Self {
        let bounds = Bounds::new(chain, options.limit_margin);
        Self {
            reach: Reach::new(chain, &bounds),
            seeds: SeedTable::new(chain, &bounds, options.random_seed),
            chain: chain.clone(),
            bounds,
            options,
        }
    }

    /// The chain.
    #[must_use]
    pub const fn chain(&self) -> &Chain {
        &self.chain
    }

    /// The solution that is found going down from `seed`, for a target near it: one start and at
    /// most [`InverseOptions::warm_iterations`] iterations, then at most as much to find the cause
    /// of a failure. No joint turns a whole turn away. For control loops; a cold solution may find
    /// one where this fails.
    ///
    /// # Errors
    /// [`InverseFailure`] with the cause and the best positions found.
    pub fn solve_warm(
        &self,
        seed: &[f64],
        target: &InverseTarget,
    ) -> Result<InverseSolution, InverseFailure> {
        self.check(seed, target)?;
        let task = Task::new(target);
        let search = self.search(&task);
        let start = padded(seed);
        let end = search.descend(&start, Keep::Inside, self.options.warm_iterations);
        if end.converged {
            return Ok(self.finish(&search, end, Effort::Warm, 1));
        }
        let cause = self
            .reach
            .excess(&task, &search.tolerance)
            .map(|excess| InverseCause::OutOfReach { excess });
        let cause = cause.or_else(|| match search.unlimited([&start].into_iter()) {
            Unlimited::Beyond(cause) => Some(cause),
            Unlimited::Inside(_) | Unlimited::Nothing => search.singular(&end),
        });
        Err(self.failure(&end, cause, 1))
    }

    /// A solution, searched from `seed`, then from up to [`InverseOptions::starts`] other postures.
    ///
    /// Joints that can turn more than a whole turn end as near to `seed` as their limits allow.
    ///
    /// # Errors
    /// [`InverseFailure`] with the cause and the best positions found.
    pub fn solve(
        &self,
        seed: &[f64],
        target: &InverseTarget,
    ) -> Result<InverseSolution, InverseFailure> {
        self.check(seed, target)?;
        let task = Task::new(target);
        let search = self.search(&task);
        let start = padded(seed);
        let excess = self.reach.excess(&task, &search.tolerance);
        let mut best = search.descend(&start, Keep::Wrapping, ITERATIONS);
        let mut starts = 1;
        if !best.converged && excess.is_none() {
            (best, starts) = self.restart(&search, best, seed);
        }
        if best.converged {
            self.bounds.bring_near(&mut best.q, seed);
            return Ok(self.finish(&search, best, Effort::Cold, starts));
        }
        let cause = match excess {
            Some(excess) => Some(InverseCause::OutOfReach { excess }),
            None => {
                let table = self.seeds.nearest(&task, search.length);
                let others = table.iter().copied().take(UNLIMITED_STARTS);
                match search.unlimited([&best.q, &start].into_iter().chain(others)) {
                    Unlimited::Inside(mut end) => {
                        end.iterations += best.iterations;
                        self.bounds.bring_near(&mut end.q, seed);
                        return Ok(self.finish(&search, end, Effort::Cold, starts));
                    }
                    Unlimited::Beyond(cause) => Some(cause),
                    Unlimited::Nothing => search.singular(&best),
                }
            }
        };
        Err(self.failure(&best, cause, starts))
    }

    /// Searches from the table's nearest postures, then from random ones; number of starts.
    fn restart(&self, search: &Search<'_>, first: Descent, seed: &[f64]) -> (Descent, u32) {
        let mut table = self.seeds.nearest(search.task, search.length).into_iter();
        let mut random = Random::new(self.options.random_seed);
        let (mut best, mut starts) = (first, 1);
        while !best.converged && starts < self.options.starts {
            let from = table.next().copied();
            let from = from.unwrap_or_else(|| random.posture(&self.bounds, seed));
            best = better(best, search.descend(&from, Keep::Wrapping, ITERATIONS));
            starts += 1;
        }
        (best, starts)
    }

    fn search<'s>(&'s self, task: &'s Task) -> Search<'s> {
        Search {
            chain: &self.chain,
            bounds: &self.bounds,
            task,
            length: self.reach.length(),
            tolerance: Residual {
                position: self.options.position_tolerance,
                orientation: self.options.orientation_tolerance,
            },
        }
    }

    fn check(&self, seed: &[f64], target: &InverseTarget) -> Result<(), InverseFailure> {
        let (expected, given) = (self.chain.len(), seed.len());
        let fault = if expected != given {
            Some(InverseCause::Seed(KinematicsError::PositionCount { expected, given }))
        } else if let Some(joint) = seed.iter().position(|value| !value.is_finite()) {
            let value = seed.get(joint).copied().unwrap_or_default();
            Some(InverseCause::Seed(KinematicsError::NotFinite { joint, value }))
        } else {
            (!target.is_finite()).then_some(InverseCause::Target)
        };
        fault.map_or(Ok(()), |cause| {
            Err(InverseFailure {
                cause,
                positions: JointVector::EMPTY,
                residual: Residual { position: f64::INFINITY, orientation: f64::INFINITY },
                iterations: 0,
                starts: 0,
            })
        })
    }

    fn finish(
        &self,
        search: &Search<'_>,
        end: Descent,
        effort: Effort,
        starts: u32,
    ) -> InverseSolution {
        let steps = POSTURE_STEPS[effort as usize];
        let end = match &self.options.preferred {
            Some(preferred) => search.approach(end, preferred, steps),
            None => end,
        };
        InverseSolution {
            positions: self.positions(&end),
            residual: end.residual,
            iterations: end.iterations,
            starts,
        }
    }

    fn failure(&self, end: &Descent, cause: Option<InverseCause>, starts: u32) -> InverseFailure {
        let iterations = end.iterations;
        InverseFailure {
            cause: cause.unwrap_or(InverseCause::Iterations { iterations }),
            positions: self.positions(end),
            residual: end.residual,
            iterations,
            starts,
        }
    }

    fn positions(&self, end: &Descent) -> JointVector {
        let zeros = JointVector::zeros(self.chain.len()).unwrap_or_default();
        zeros.map_indexed(|k, _| end.q.get(k).copied().unwrap_or_default())
    }
}

/// The end with the smaller error, having taken the iterations of both.
fn better(one: Descent, other: Descent) -> Descent {
    let iterations = one.iterations + other.iterations;
    let other_wins = other.converged || other.error < one.error;
    Descent { iterations, ..if other_wins { other } else { one } }
}

fn padded(values: &[f64]) -> Positions {
    let mut positions = [0.0; MAX_JOINTS];
    for (slot, &value) in positions.iter_mut().zip(values) {
        *slot = value;
    }
    positions
}
