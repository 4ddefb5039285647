//! URDF text to [`RobotModel`].
//!
//! ```text
//! text --source--> XML with positions --scan--> names, checked copy --urdf-rs--> typed robot
//!      --tree--> order, mimic rules --convert--> links and joints --> RobotModel
//!      --review--> doubts about what can be used
//! ```
//!
//! Everything that can be wrong is found before `urdf-rs` reads, because it gives no positions,
//! accepts revolute joints without limits, and ignores words that are not numbers. Each pass goes
//! on after a problem and reports it once: what only follows from a problem is left out.

mod convert;
mod error;
mod findings;
mod joint;
mod link;
mod remedy;
mod report;
mod review;
mod scan;
mod source;
mod tree;
mod warning;
mod writer;

pub use error::{Place, QuaternionFault, UrdfError, UrdfProblem};
pub use report::UrdfReport;
pub use warning::{UrdfDoubt, UrdfWarning};
