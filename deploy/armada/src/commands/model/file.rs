//! The robot description that is asked about.

use anyhow::Context as _;
use armada_model::{RobotModel, UrdfReport};
use clap::Args;

use super::input::{STDIN, stdin};

/// Which robot description, and in which form the answer.
#[derive(Args, Clone, Debug)]
pub(super) struct FileArgs {
    /// Robot description, or - for standard input
    #[arg(value_name = "FILE.urdf")]
    pub(super) file: String,
    /// Print JSON, for scripts
    #[arg(long)]
    pub(super) json: bool,
}

/// The robot description cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{first}\n  {remedy}{}", more(*.others))]
pub(super) struct Unusable {
    first: String,
    remedy: String,
    others: usize,
}

fn more(others: usize) -> String {
    match others {
        0 => String::new(),
        1 => "\n1 more problem: `armada model check` tells it".to_owned(),
        _ => format!("\n{others} more problems: `armada model check` tells them"),
    }
}

impl FileArgs {
    /// The file's label in messages.
    pub(super) fn label(&self) -> &str {
        if self.file == STDIN { "standard input" } else { &self.file }
    }

    /// Everything that is to be said about the description.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub(super) fn report(&self) -> anyhow::Result<UrdfReport> {
        let text = if self.file == STDIN {
            stdin()?
        } else {
            std::fs::read_to_string(&self.file).with_context(|| self.file.clone())?
        };
        Ok(RobotModel::check_urdf(&text, self.label()))
    }

    /// The robot.
    ///
    /// # Errors
    /// If the file cannot be read; [`Unusable`] with the first problem if it cannot be used.
    pub(super) fn model(&self) -> anyhow::Result<RobotModel> {
        let report = self.report()?;
        if let Some(model) = report.model {
            return Ok(model);
        }
        let first = report.problems.first().context("the description cannot be used")?;
        let others = report.problems.len() + report.omitted_problems - 1;
        Err(Unusable { first: first.to_string(), remedy: first.remedy(), others }.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_description_that_cannot_be_used_is_told_with_its_first_problem_and_the_count() {
        let file = tempfile::NamedTempFile::new().expect("a file");
        std::fs::write(file.path(), "<robot>\n<link/>\n<link/></robot>").expect("written");
        let args = FileArgs { file: file.path().display().to_string(), json: false };
        let error = args.model().expect_err("no names").to_string();
        let expected = format!(
            "{}:1: robot: <robot> has no attribute \"name\"\n  give <robot> the attribute \
             name=\"…\"\n2 more problems: `armada model check` tells them",
            file.path().display()
        );
        assert_eq!(error, expected);
    }
}
