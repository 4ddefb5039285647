//! SRDF files that are read beside a robot description.

use anyhow::Context as _;
use armada_model::{RobotModel, Severity, Srdf};
use serde::Serialize;

use super::input::{STDIN, stdin};
use crate::output::Output;

/// The text of the file, or of standard input.
///
/// # Errors
/// If it cannot be read.
pub(super) fn text_of(file: &str) -> anyhow::Result<String> {
    if file == STDIN {
        return stdin();
    }
    std::fs::read_to_string(file).with_context(|| file.to_owned())
}

/// The file's label in messages.
pub(super) fn label(file: &str) -> &str {
    if file == STDIN { "standard input" } else { file }
}

/// What is to be said about an SRDF.
#[derive(Debug, Serialize)]
pub(super) struct SrdfAnswer<'r> {
    pub(super) file: &'r str,
    pub(super) readable: bool,
    pub(super) problems: Vec<SrdfFinding>,
}

/// One entry that is wrong, or why the text is no SRDF at all.
#[derive(Debug, Serialize)]
pub(super) struct SrdfFinding {
    pub(super) severity: String,
    pub(super) line: u32,
    pub(super) column: u32,
    pub(super) element: Option<String>,
    pub(super) message: String,
    pub(super) remedy: Option<&'static str>,
}

impl<'r> SrdfAnswer<'r> {
    /// Reads `text`, which `file` labels, for the robot.
    pub(super) fn of(file: &'r str, text: &str, model: &RobotModel) -> Self {
        let problems = match Srdf::read(text, file, model) {
            Ok((_, problems)) => problems,
            Err(error) => {
                let finding = SrdfFinding {
                    severity: Severity::Error.to_string(),
                    line: error.place.line,
                    column: error.place.column,
                    element: None,
                    message: error.kind.to_string(),
                    remedy: None,
                };
                return Self { file, readable: false, problems: vec![finding] };
            }
        };
        let finding = |problem: &armada_model::SrdfProblem| SrdfFinding {
            severity: problem.severity.to_string(),
            line: problem.place.line,
            column: problem.place.column,
            element: Some(problem.element.clone()),
            message: problem.fault.to_string(),
            remedy: Some(problem.fault.remedy()),
        };
        Self { file, readable: true, problems: problems.iter().map(finding).collect() }
    }

    /// Whether nothing that the file means is lost.
    pub(super) fn is_usable(&self) -> bool {
        self.readable && self.count(Severity::Error) == 0
    }

    fn count(&self, severity: Severity) -> usize {
        let name = severity.to_string();
        self.problems.iter().filter(|problem| problem.severity == name).count()
    }

    /// Tells people, each problem like a compiler's message.
    pub(super) fn print(&self, out: &Output) -> anyhow::Result<()> {
        out.line("")?;
        for SrdfFinding { severity, line, column, element, message, remedy } in &self.problems {
            let element = element.as_ref().map(|name| format!("<{name}>: ")).unwrap_or_default();
            let file = self.file;
            out.line(format_args!("{file}:{line}:{column}: {severity}: {element}{message}"))?;
            if let Some(remedy) = remedy {
                out.line(format_args!("    {remedy}"))?;
            }
        }
        let can = if self.readable { "can be used" } else { "CANNOT BE USED" };
        let (errors, warnings) = (self.count(Severity::Error), self.count(Severity::Warning));
        out.line(format_args!("{} {can}: errors {errors}, warnings {warnings}", self.file))
    }
}

#[cfg(test)]
mod tests {
    use super::super::own_robot;
    use super::*;

    #[test]
    fn entries_that_are_wrong_are_listed_and_a_urdf_is_no_srdf() {
        let model = own_robot("six_axis_arm.urdf");
        let name = model.name();
        let text = format!(
            "<robot name='{name}'>\n<disable_collisions link1='base_link' link2='hand'/></robot>"
        );
        let answer = SrdfAnswer::of("a.srdf", &text, &model);
        let json = serde_json::to_value(&answer).expect("JSON");
        assert_eq!(json["readable"], true);
        assert_eq!(json["problems"][0]["severity"], "warning");
        assert_eq!(json["problems"][0]["line"], 2);
        assert_eq!(json["problems"][0]["message"], "link \"hand\" does not exist");
        let answer = SrdfAnswer::of("a.srdf", "<robot name='r'><link name='a'/></robot>", &model);
        assert!(!answer.readable);
        assert!(answer.problems[0].message.contains("this is a URDF"));
    }
}
