//! `armada signal` and `armada param`: inputs, outputs and settings of a controller.

use armada_protocol::RobotName;
use armada_protocol::messages::{
    NameParams, NamedValue, ParameterInfo, RobotInfo, SetValueParams, SignalInfo,
};
use armada_protocol::method::Method;
use armada_protocol::method::robot::{GetParam, GetSignal, SetParam, SetSignal};
use clap::{Args, Subcommand};
use serde::Serialize;

use super::typed_value::{Kind, text};
use crate::cell_address::CellArgs;
use crate::exit::{Exit, UsageError};
use crate::table::Table;
use crate::words;

/// Arguments of `armada signal`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada signal list left_arm
  armada signal get left_arm wrist_wrench
  armada signal set left_arm digital_out_0 on
  armada signal set left_arm digital_out_port 1,0,0,1")]
pub(crate) struct SignalArgs {
    #[command(subcommand)]
    command: ValueCommand,
}

/// Arguments of `armada param`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada param list left_arm
  armada param get left_arm filter_hz
  armada param set left_arm filter_hz 50")]
pub(crate) struct ParamArgs {
    #[command(subcommand)]
    command: ValueCommand,
}

#[derive(Debug, Subcommand)]
enum ValueCommand {
    /// Show which there are
    List(ListArgs),
    /// Show the value of one
    Get(GetArgs),
    /// Set one, and wait until the controller has it
    Set(SetArgs),
}

#[derive(Args, Debug)]
struct ListArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    #[command(flatten)]
    cell: CellArgs,
}

#[derive(Args, Debug)]
struct GetArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Name
    #[arg(value_name = "NAME")]
    name: String,
    #[command(flatten)]
    cell: CellArgs,
}

#[derive(Args, Debug)]
struct SetArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Name
    #[arg(value_name = "NAME")]
    name: String,
    /// Value: on or off, a number, several of them with commas, or one of its choices
    #[arg(value_name = "VALUE", allow_hyphen_values = true)]
    value: String,
    #[command(flatten)]
    cell: CellArgs,
}

/// Lists, gets or sets signals.
pub(crate) async fn run_signal(args: SignalArgs) -> anyhow::Result<Exit> {
    match args.command {
        ValueCommand::List(args) => list(args, |info| &info.signals, signals).await,
        ValueCommand::Get(args) => get::<GetSignal>(args).await,
        ValueCommand::Set(args) => set::<SetSignal>(args, signal_kind).await,
    }
}

/// Lists, gets or sets settings.
pub(crate) async fn run_param(args: ParamArgs) -> anyhow::Result<Exit> {
    match args.command {
        ValueCommand::List(args) => list(args, |info| &info.parameters, parameters).await,
        ValueCommand::Get(args) => get::<GetParam>(args).await,
        ValueCommand::Set(args) => set::<SetParam>(args, parameter_kind).await,
    }
}

fn signal_kind(info: &RobotInfo, name: &str) -> Result<Kind, UsageError> {
    let found = info.signals.iter().find(|signal| signal.name == name);
    let names = || info.signals.iter().map(|signal| signal.name.as_str());
    found
        .map(|signal| Kind::of_signal(signal.signal_type))
        .ok_or_else(|| unknown("signal", name, &names().collect::<Vec<_>>()))
}

fn parameter_kind(info: &RobotInfo, name: &str) -> Result<Kind, UsageError> {
    let found = info.parameters.iter().find(|parameter| parameter.name == name);
    let names = || info.parameters.iter().map(|parameter| parameter.name.as_str());
    found
        .map(|parameter| Kind::of_parameter(parameter.parameter_type))
        .ok_or_else(|| unknown("parameter", name, &names().collect::<Vec<_>>()))
}

fn unknown(what: &str, name: &str, there_are: &[&str]) -> UsageError {
    let there_are = if there_are.is_empty() { "none".to_owned() } else { there_are.join(", ") };
    UsageError(format!("there is no {what} {name:?}; there are {there_are}"))
}

async fn list<T: Serialize>(
    args: ListArgs,
    rows: impl Fn(&RobotInfo) -> &Vec<T>,
    table: impl Fn(&[T]) -> Table,
) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let info = client.robot_info(&args.robot).await?;
    let out = args.cell.output();
    let rows = rows(&info);
    if out.is_json() {
        out.json(rows)?;
    } else if rows.is_empty() {
        out.line(format_args!("{} has none", args.robot))?;
    } else {
        out.line(table(rows))?;
    }
    Ok(Exit::Success)
}

/// Signals as a table.
pub(crate) fn signals(rows: &[SignalInfo]) -> Table {
    let mut table = Table::new(&["signal", "type", "access", "values", "range", "description"]);
    for row in rows {
        table.row(vec![
            row.name.clone(),
            words::wire_name(row.signal_type),
            words::wire_name(row.access),
            row.size.to_string(),
            range(row.min, row.max, &row.unit),
            row.description.clone(),
        ]);
    }
    table
}

/// Settings as a table.
pub(crate) fn parameters(rows: &[ParameterInfo]) -> Table {
    let mut table = Table::new(&["parameter", "type", "access", "default", "range", "description"]);
    for row in rows {
        let values = if row.choices.is_empty() {
            range(row.min, row.max, &row.unit)
        } else {
            row.choices.join(" | ")
        };
        table.row(vec![
            row.name.clone(),
            words::wire_name(row.parameter_type),
            words::wire_name(row.access),
            text(&row.default),
            values,
            row.description.clone(),
        ]);
    }
    table
}

fn range(min: Option<f64>, max: Option<f64>, unit: &str) -> String {
    let end = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    let range = match (min, max) {
        (None, None) => unit.to_owned(),
        _ => format!("{}..{} {unit}", end(min), end(max)),
    };
    if range.is_empty() { "-".to_owned() } else { range.trim_end().to_owned() }
}

async fn get<M: Method<Params = NameParams, Answer = NamedValue>>(
    args: GetArgs,
) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let answer = client.call::<M>(&args.robot, NameParams { name: args.name }).await?;
    report(&answer, &args.cell)
}

async fn set<M: Method<Params = SetValueParams, Answer = NamedValue>>(
    args: SetArgs,
    kind: impl Fn(&RobotInfo, &str) -> Result<Kind, UsageError>,
) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let info = client.robot_info(&args.robot).await?;
    let value = kind(&info, &args.name)?.parse(&args.value)?;
    let params = SetValueParams { name: args.name, value };
    let answer = client.call::<M>(&args.robot, params).await?;
    report(&answer, &args.cell)
}

fn report(answer: &NamedValue, cell: &CellArgs) -> anyhow::Result<Exit> {
    let out = cell.output();
    if out.is_json() {
        out.json(answer)?;
    } else {
        out.line(format_args!("{}: {}", answer.name, text(&answer.value)))?;
    }
    Ok(Exit::Success)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info() -> RobotInfo {
        let text = include_str!("../../../../protocol/golden/robot_info.json");
        serde_json::from_str(text).expect("the golden sample")
    }

    #[test]
    fn the_kind_is_that_of_the_robots_own_list() {
        assert_eq!(signal_kind(&info(), "wrist_wrench").expect("there"), Kind::Numbers);
        assert_eq!(parameter_kind(&info(), "collision_level").expect("there"), Kind::Text);
        let error = signal_kind(&info(), "lamp").expect_err("not there").to_string();
        assert_eq!(
            error,
            "there is no signal \"lamp\"; there are digital_out_0, analog_in_1, wrist_wrench"
        );
    }

    #[test]
    fn both_lists_are_tables() {
        let expected = "\
signal         type     access     values  range    description
digital_out_0  digital  all        1       -        lamp
analog_in_1    analog   read only  1       0..10 V
wrist_wrench   wrench   read only  6       -";
        assert_eq!(signals(&info().signals).to_string(), expected);
        let expected = "\
parameter           type    access      default  range       description
payload_estimation  bool    restricted  off      -
filter_hz           number  restricted  100      1..500 Hz   low-pass filter of the wrench
collision_level     choice  all         low      low | high";
        assert_eq!(parameters(&info().parameters).to_string(), expected);
    }
}
