//! `armada call`: a method by its name, as it is on the wire.

use std::time::Duration;

use anyhow::Context as _;
use armada_protocol::RobotName;
use armada_protocol::client::ClientError;
use clap::Args;
use serde_json::Value;

use crate::cell_address::CellArgs;
use crate::exit::{Exit, UsageError};
use crate::output::report_error;

/// Time to wait for an answer; some methods wait for the controller.
const TIMEOUT: Duration = Duration::from_secs(8);

/// Arguments of `armada call`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada call left_arm halt
  armada call left_arm set_mode '{\"mode\":\"jog\"}'
  armada call cell reset '{\"robots\":[\"left_arm\"]}'
  armada call left_arm prepare @trajectory.json

The answer is printed as JSON. A refusal is printed as JSON as well, with exit code 1.
`armada info ROBOT` lists the methods of a robot; protocol/KEYS.md has their parameters.")]
pub(crate) struct CallArgs {
    /// Robot to ask, or `cell` for the gateway
    #[arg(value_name = "ROBOT|cell")]
    target: String,
    /// Name of the method
    #[arg(value_name = "METHOD")]
    method: String,
    /// Parameters, or @FILE that holds them
    #[arg(value_name = "JSON", default_value = "{}")]
    params: String,
    #[command(flatten)]
    cell: CellArgs,
}

/// Calls it and prints the answer.
pub(crate) async fn run(args: CallArgs) -> anyhow::Result<Exit> {
    let robot = match args.target.as_str() {
        "cell" => None,
        name => Some(name.parse::<RobotName>().map_err(|error| UsageError(error.to_string()))?),
    };
    let params = read_params(&args.params)?;
    let (client, _) = args.cell.connect().await?;
    let out = args.cell.output();
    let limit = args.cell.timeout_or(TIMEOUT);
    match client.call_by_name(robot.as_ref(), &args.method, params, limit).await {
        Ok(answer) => {
            out.json(&answer)?;
            Ok(Exit::Success)
        }
        Err(ClientError::Denied(denial)) => {
            out.json(&denial)?;
            report_error(&denial.into());
            Ok(Exit::Failure)
        }
        Err(error) => Err(error.into()),
    }
}

fn read_params(text: &str) -> anyhow::Result<Value> {
    let json = match text.strip_prefix('@') {
        Some(path) => std::fs::read_to_string(path).with_context(|| path.to_owned())?,
        None => text.to_owned(),
    };
    let problem = |error| UsageError(format!("parameters are not JSON: {error}"));
    Ok(serde_json::from_str(&json).map_err(problem)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_json_or_a_file_of_it() {
        assert_eq!(read_params("{\"mode\":\"jog\"}").expect("json")["mode"], "jog");
        let file = tempfile::NamedTempFile::new().expect("a file");
        std::fs::write(file.path(), "[1]").expect("written");
        let from_file = read_params(&format!("@{}", file.path().display())).expect("json");
        assert_eq!(from_file, serde_json::json!([1]));
    }

    #[test]
    fn parameters_that_are_not_json_are_a_usage_error() {
        let error = read_params("{mode: jog}").expect_err("no quotes");
        assert!(error.is::<UsageError>(), "{error}");
    }
}
