//! With which code the program ends: part of its contract with scripts.

use std::process::ExitCode;

use armada_protocol::client::ClientError;

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// Done; for `status`: ready or moving.
    Success,
    /// Refused or failed.
    Failure,
    /// Wrong arguments, or nobody answers.
    NobodyThere,
    /// A stop is latched.
    Stopped,
    /// A robot has a fault, cannot be commanded or is not there.
    Degraded,
    /// Not every robot is known to stand still.
    StopIncomplete,
    /// Ended early by Ctrl-C.
    Interrupted,
}

/// The codes in words, for `--help`.
pub(crate) const HELP: &str = "Exit codes:
  0  done; for `status`: ready or moving
  1  refused or failed; the reason is on standard error
  2  wrong arguments, or nobody answers
  3  status: a stop is latched
  4  status: a robot has a fault, cannot be commanded or is not there
  5  stop: not every robot is known to stand still: go and look
130  ended early by Ctrl-C";

impl Exit {
    const fn code(self) -> u8 {
        match self {
            Self::Success => 0,
            Self::Failure => 1,
            Self::NobodyThere => 2,
            Self::Stopped => 3,
            Self::Degraded => 4,
            Self::StopIncomplete => 5,
            Self::Interrupted => 130,
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit.code())
    }
}

/// Something is wrong with the arguments that only the robot or a file could tell.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct UsageError(pub(crate) String);

/// The code for an error.
pub(crate) fn of_error(error: &anyhow::Error) -> Exit {
    let nobody = error.chain().any(|cause| {
        cause.is::<UsageError>()
            || matches!(
                cause.downcast_ref::<ClientError>(),
                Some(ClientError::NobodyThere { .. } | ClientError::NoReply { .. })
            )
    });
    if nobody { Exit::NobodyThere } else { Exit::Failure }
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::{Denial, DenialCode};

    use super::*;

    #[test]
    fn a_missing_cell_and_a_refusal_have_different_codes() {
        let nobody = anyhow::Error::new(ClientError::NobodyThere { endpoints: vec![] });
        assert_eq!(of_error(&nobody.context("status")), Exit::NobodyThere);
        let denial = Denial::new(DenialCode::Stopped, "a stop is latched");
        assert_eq!(of_error(&ClientError::Denied(denial).into()), Exit::Failure);
    }

    #[test]
    fn every_code_of_the_help_is_used() {
        let all = [
            Exit::Success,
            Exit::Failure,
            Exit::NobodyThere,
            Exit::Stopped,
            Exit::Degraded,
            Exit::StopIncomplete,
            Exit::Interrupted,
        ];
        for (exit, line) in all.into_iter().zip(HELP.lines().skip(1)) {
            let code = line.split_whitespace().next().expect("a code");
            assert_eq!(code, exit.code().to_string());
        }
    }
}
