//! A robot description from text, and everything that is to be said about the text.

use super::convert::{Structure, convert};
use super::error::{UrdfError, UrdfProblem};
use super::findings::Problems;
use super::review::{self, Doubts};
use super::scan::{self, Scan};
use super::source::{self, Element};
use super::tree;
use super::warning::UrdfWarning;
use crate::robot_model::RobotModel;
use crate::xml::Source;

/// Everything that is to be said about a robot description, in the order of its text.
///
/// Of either kind the first 200 are kept.
#[derive(Clone, Debug, Default)]
pub struct UrdfReport {
    /// The robot; there if and only if there are no problems.
    pub model: Option<RobotModel>,
    /// Why the text cannot be used. A problem that only follows from another is left out.
    pub problems: Vec<UrdfError>,
    /// What can be used, but is doubtful. Where there are problems, doubts about the robot as a
    /// whole are left out.
    pub warnings: Vec<UrdfWarning>,
    /// Number of problems beyond those kept.
    pub omitted_problems: usize,
    /// Number of warnings beyond those kept.
    pub omitted_warnings: usize,
}

impl RobotModel {
    /// The robot that the URDF `text` describes; `file` labels the text in errors.
    ///
    /// Meshes are named, never opened. Elements of foreign namespaces and those that URDF does not
    /// know, such as `<gazebo>` and `<transmission>`, are passed over. A fixed joint keeps nothing
    /// but its origin. [`check_urdf`](Self::check_urdf) tells all problems of a text, and warns.
    ///
    /// # Errors
    /// The first problem in the text, with the line of the element that has it;
    /// [`UrdfProblem`] lists them.
    pub fn from_urdf(text: &str, file: &str) -> Result<Self, UrdfError> {
        let source = Source::new(text, file);
        let document = source::parse(&source)?;
        let mut problems = Problems::default();
        let loaded = load(Element::root(&document, &source), &mut problems);
        let first = problems.in_order().next();
        match (loaded.and_then(|(_, model)| model), first) {
            (Some(model), None) => Ok(model),
            (_, Some((offset, problem))) => Err(UrdfError { place: source.place(offset), problem }),
            // Cannot be: what makes no model reports why.
            (None, None) => {
                let reason = "no model could be made".to_owned();
                let problem = Box::new(UrdfProblem::Reader { reason });
                Err(UrdfError { place: source.place(0), problem })
            }
        }
    }

    /// Everything that is to be said about the URDF `text`; `file` labels the text.
    ///
    /// The model is there exactly where [`from_urdf`](Self::from_urdf) gives one.
    ///
    /// ```
    /// use armada_model::RobotModel;
    ///
    /// let text = r#"<robot name="arm">
    ///   <link name="base"/>
    ///   <link name="tip"/>
    ///   <joint name="turn" type="revolute">
    ///     <parent link="base"/><child link="tipp"/>
    ///     <limit lower="1" upper="-1" velocity="2"/>
    ///   </joint>
    /// </robot>"#;
    /// let report = RobotModel::check_urdf(text, "arm.urdf");
    /// let told: Vec<_> = report.problems.iter().map(ToString::to_string).collect();
    /// assert_eq!(
    ///     told,
    ///     [
    ///         r#"arm.urdf:5: joint "turn": child link "tipp" does not exist"#,
    ///         r#"arm.urdf:6: joint "turn": limit lower 1 is above upper -1"#,
    ///     ]
    /// );
    /// assert_eq!(report.problems[1].remedy(), "swap lower and upper, or correct one of them");
    /// ```
    #[must_use]
    pub fn check_urdf(text: &str, file: &str) -> UrdfReport {
        let source = Source::new(text, file);
        let document = match source::parse(&source) {
            Ok(document) => document,
            Err(error) => return UrdfReport { problems: vec![error], ..UrdfReport::default() },
        };
        let (mut problems, mut doubts) = (Problems::default(), Doubts::default());
        let loaded = load(Element::root(&document, &source), &mut problems);
        if let Some((scan, model)) = &loaded {
            review::review(scan, model.as_ref(), &mut doubts);
        }
        UrdfReport {
            model: loaded.and_then(|(_, model)| model),
            omitted_problems: problems.omitted(),
            omitted_warnings: doubts.omitted(),
            problems: problems
                .in_order()
                .map(|(offset, problem)| UrdfError { place: source.place(offset), problem })
                .collect(),
            warnings: doubts
                .in_order()
                .map(|(offset, doubt)| UrdfWarning { place: source.place(offset), doubt })
                .collect(),
        }
    }
}

/// What was read, and the model if there is no problem; nothing if it is no robot description.
fn load<'d>(root: Element<'d>, problems: &mut Problems) -> Option<(Scan<'d>, Option<RobotModel>)> {
    problems.keep(scan::check_root(&root))?;
    let scan = scan::scan(root, problems);
    let parents = tree::parent_joints(&scan, problems);
    let follows = tree::resolve_mimics(&scan, problems);
    if !problems.is_empty() {
        return Some((scan, None));
    }
    let order = tree::topological_order(&scan, &parents);
    let model = urdf_rs::read_from_string(&scan.copy)
        .map_err(|error| UrdfProblem::Reader { reason: error.to_string() })
        .and_then(|robot| convert(&scan, &Structure { parents, order, follows }, robot));
    let model = problems.keep(model.map_err(|problem| scan.root.fault(problem)));
    Some((scan, model))
}
