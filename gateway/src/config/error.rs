//! What can be wrong with a cell file.

use std::fmt;
use std::path::PathBuf;

use armada_protocol::RobotNameError;

/// Why a cell file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CellConfigError {
    /// The file cannot be read.
    #[error("cannot read the cell file {}: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The reason.
        cause: std::io::Error,
    },
    /// The text is not YAML of the form of a cell file.
    #[error("{}: {cause}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// What is wrong, with line, column and the line itself.
        cause: Box<serde_saphyr::Error>,
    },
    /// A value makes no sense.
    #[error("{}:{excerpt}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Where in it, and what is wrong.
        excerpt: Box<Excerpt>,
    },
}

/// A place in a text and what is wrong there.
#[derive(Clone, Debug, PartialEq)]
pub struct Excerpt {
    /// Line, counted from 1; 0 if the place is not known.
    pub line: u64,
    /// Column, counted from 1.
    pub column: u64,
    /// The line.
    pub text: String,
    /// What is wrong.
    pub problem: CellProblem,
}

impl fmt::Display for Excerpt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { line, column, text, problem } = self;
        write!(f, "{line}:{column}: {problem}")?;
        let caret = usize::try_from(*column).unwrap_or_default();
        write!(f, "\n{line:5} | {text}\n      | {:>caret$}", "^")
    }
}

/// What makes no sense in a cell file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CellProblem {
    /// The name of the cell is not one chunk of a key.
    #[error("cell {0:?} is not a name: 1 to 64 of a-z, 0-9 and _, beginning with a letter")]
    CellName(String),
    /// The name of a robot is not one chunk of a key.
    #[error(transparent)]
    RobotName(#[from] RobotNameError),
    /// The namespace is not a key.
    #[error("namespace {0:?} is not a key: chunks of letters, digits, _, - and . between /")]
    Namespace(String),
    /// The cell has too few or too many robots.
    #[error("{count} robots, expected 1 to {limit}")]
    RobotCount {
        /// How many.
        count: usize,
        /// The most.
        limit: usize,
    },
    /// The gateway listens nowhere.
    #[error("gateway.listen is empty, expected at least one endpoint")]
    NoListener,
    /// An endpoint is not of the form that can be dialled.
    #[error("endpoint {0:?} cannot be dialled: expected tcp/HOST:PORT or unixsock-stream/PATH")]
    Endpoint(String),
    /// Two programs would listen on one endpoint.
    #[error("endpoint {endpoint} is already used by {user}")]
    EndpointTaken {
        /// The endpoint.
        endpoint: String,
        /// Who has it.
        user: String,
    },
    /// A mount parent is neither the world nor a link of a robot.
    #[error("mount parent {0:?} is neither world nor ROBOT/LINK")]
    MountForm(String),
    /// A mount parent is on a robot that the cell does not have.
    #[error("mount parent {parent:?}: the cell has no robot {robot:?}, it has {known}")]
    MountRobot {
        /// The parent.
        parent: String,
        /// Its robot.
        robot: String,
        /// The robots of the cell.
        known: String,
    },
    /// Robots carry each other in a circle.
    #[error("mount of {0} never reaches the world: the robots carry each other")]
    MountCycle(String),
    /// A timer has a name that is not known.
    #[error("motion has no timer {name:?}, it has {known}")]
    TimerUnknown {
        /// The name.
        name: String,
        /// The timers there are.
        known: String,
    },
    /// A timer lies outside its range.
    #[error("motion.{name} is {value} ms, expected {low} to {high}")]
    TimerRange {
        /// The timer.
        name: String,
        /// Its value \[ms\].
        value: f64,
        /// Lowest value \[ms\].
        low: f64,
        /// Highest value \[ms\].
        high: f64,
    },
    /// The distance that robots must keep lies outside its range.
    #[error("clearance.required_m is {value} m, expected {low} to {high}")]
    RequiredRange {
        /// Its value \[m\].
        value: f64,
        /// Lowest value \[m\].
        low: f64,
        /// Highest value \[m\].
        high: f64,
    },
}
