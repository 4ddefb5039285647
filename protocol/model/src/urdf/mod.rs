//! URDF text to [`RobotModel`].
//!
//! ```text
//! text --source--> XML with positions --scan--> names, checked copy --urdf-rs--> typed robot
//!      --tree--> order, mimic rules --convert--> links and joints --> RobotModel
//! ```
//!
//! Everything that can be wrong is found before `urdf-rs` reads, because it gives no positions,
//! accepts revolute joints without limits, and ignores words that are not numbers.

mod convert;
mod error;
mod guard;
mod joint;
mod link;
mod scan;
mod source;
mod tree;
mod writer;

pub use error::{Place, QuaternionFault, UrdfError, UrdfProblem};

use crate::robot_model::RobotModel;
use source::{Element, Label};

impl RobotModel {
    /// The robot that the URDF `text` describes; `file` labels the text in errors.
    ///
    /// Meshes are named, never opened. Elements of foreign namespaces and those that URDF does not
    /// know, such as `<gazebo>` and `<transmission>`, are passed over. A fixed joint keeps nothing
    /// but its origin.
    ///
    /// # Errors
    /// The first problem found, with the line of the element that has it; [`UrdfProblem`] lists
    /// them.
    pub fn from_urdf(text: &str, file: &str) -> Result<Self, UrdfError> {
        let label = Label::new(file);
        let document = label.parse(text)?;
        let scan = scan::scan(Element::root(&document, &label))?;
        let parents = tree::parent_joints(&scan)?;
        let order = tree::topological_order(&scan, &parents);
        let robot = urdf_rs::read_from_string(&scan.copy)
            .map_err(|error| scan.root.error(UrdfProblem::Reader { reason: error.to_string() }))?;
        convert::convert(&scan, &parents, &order, robot)
    }
}
