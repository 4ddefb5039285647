//! The methods under `rpc/` with the types of their parameters and answers.

use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::messages::{
    Accepted, CancelParams, CellExecuteTrajectory, CellResetAnswer, CellResetParams, CommitParams,
    Empty, ExecuteTrajectoryParams, HaltAnswer, JogFreespaceParams, ModeAnswer, Prepared,
    ResetAnswer, ResetParams, SetModeParams, StopReport, StopRequest,
};

/// A method: one query, one answer.
pub trait Method {
    /// Last part of its key.
    const NAME: &'static str;
    /// How long an asker waits; longer than the answerer ever takes.
    const TIMEOUT: Duration;
    /// What is asked, inside a [`Request`](crate::messages::Request).
    type Params: Serialize + DeserializeOwned + Send;
    /// What is answered.
    type Answer: Serialize + DeserializeOwned + Send;
}

/// A row of the list of methods, for documentation and other languages.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MethodRow {
    /// Last part of its key.
    pub name: &'static str,
    /// Name of the type of its parameters.
    pub params: &'static str,
    /// Name of the type of its answer.
    pub answer: &'static str,
    /// How long an asker waits for the answer \[ms\].
    pub timeout_ms: u64,
    /// What it does.
    pub notes: &'static str,
}

macro_rules! methods {
    ($(#[$list_doc:meta])* $list:ident: $($(#[doc = $doc:literal])* $method:ident = $name:literal, $timeout_ms:literal, $params:ident -> $answer:ident;)+) => {
        $($(#[doc = $doc])*
        #[derive(Clone, Copy, Debug)]
        pub struct $method;

        impl Method for $method {
            const NAME: &'static str = $name;
            const TIMEOUT: Duration = Duration::from_millis($timeout_ms);
            type Params = $params;
            type Answer = $answer;
        })+

        $(#[$list_doc])*
        pub const $list: &[MethodRow] = &[$(MethodRow {
            name: $name,
            params: stringify!($params),
            answer: stringify!($answer),
            timeout_ms: $timeout_ms,
            notes: concat!($($doc),*),
        }),+];
    };
}

/// Methods of an agent, under `robots/{robot}/rpc/`.
pub mod robot {
    use super::*;

    methods! {
        /// Every method of an agent.
        ALL:
        /// Changes the command mode; every mode but `halt` is entered from `halt`.
        SetMode = "set_mode", 2000, SetModeParams -> ModeAnswer;
        /// Ramps to standstill and stays in `halt`; ends every motion.
        Halt = "halt", 2000, Empty -> HaltAnswer;
        /// Switches the drives on; answered when the controller reports them on.
        Enable = "enable", 8000, Empty -> ModeAnswer;
        /// Ramps to standstill and switches the drives off.
        Disable = "disable", 8000, Empty -> ModeAnswer;
        /// Clears latched faults whose cause is gone, here and at the controller.
        ResetErrors = "reset_errors", 8000, Empty -> ModeAnswer;
        /// Clears the latched stop; never moves, never enables.
        Reset = "reset", 2000, ResetParams -> ResetAnswer;
        /// Moves all joints to a position, in mode `jog`; a new goal replaces the old one.
        JogFreespace = "jog_freespace", 2000, JogFreespaceParams -> Accepted;
        /// Follows a trajectory at once, in mode `trajectory`.
        ExecuteTrajectory = "execute_trajectory", 4000, ExecuteTrajectoryParams -> Accepted;
        /// Ends a motion with a ramp to standstill; the mode stays.
        Cancel = "cancel", 2000, CancelParams -> Empty;
        /// Validates a trajectory and keeps it for `commit`.
        Prepare = "prepare", 4000, ExecuteTrajectoryParams -> Prepared;
        /// Starts a prepared trajectory at an instant of the agent's clock.
        Commit = "commit", 2000, CommitParams -> Accepted;
        /// Forgets a prepared trajectory, or ends it with a ramp if it runs.
        Abort = "abort", 2000, CancelParams -> Empty;
    }
}

/// Methods of the gateway, under `cell/rpc/`.
pub mod cell {
    use super::*;

    methods! {
        /// Every method of the gateway.
        ALL:
        /// Stops the robots in scope and reports how far each has come.
        Stop = "stop", 5000, StopRequest -> StopReport;
        /// Clears the latched stops of robots; never moves, never enables.
        Reset = "reset", 4000, CellResetParams -> CellResetAnswer;
        /// Follows a trajectory with several robots that start at one instant.
        ExecuteTrajectory = "execute_trajectory", 8000, CellExecuteTrajectory -> Accepted;
        /// Ends a motion of several robots, each with a ramp to standstill.
        Cancel = "cancel", 4000, CancelParams -> Empty;
    }
}
