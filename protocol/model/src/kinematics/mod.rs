//! Serial chains of a robot: pose, Jacobian and twist of a tool centre point, and what it carries.
//!
//! ```text
//! RobotModel --Chain::new(base, tip)--> Chain --forward_and_jacobian(q)--> X_BT, Jacobian
//!                                                                            |
//!                        joint velocities <--joint_velocity-- Twist <--twist-+
//! ```

mod chain;
mod extent;
mod forward;
mod jacobian;
mod load;
mod reduce;
mod singular;
mod trigonometry;
mod twist;
mod velocity;

pub use chain::{Chain, ChainError, ChainVariable};
pub(crate) use extent::Extent;
pub use jacobian::{Jacobian, Wrench};
pub use load::{Load, LoadError, Payload};
pub use singular::SingularValues;
pub(crate) use trigonometry::{sin_cos, sin_cos_of};
pub use twist::Twist;
pub use velocity::{Damping, ResolvedVelocity};
