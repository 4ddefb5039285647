//! `armada tool`: what a flange carries.

use armada_protocol::RobotName;
use armada_protocol::messages::{
    AttachToolParams, ChainEquipment, DetachParams, EquipmentAnswer, Inertia, RobotInfo, ToolInfo,
};
use armada_protocol::method::robot::{AttachTool, DetachTool};
use clap::{Args, Subcommand};

use crate::cell_address::CellArgs;
use crate::commands::model::input::text_of;
use crate::exit::{Exit, UsageError};
use crate::output::Output;
use crate::table::Table;
use crate::words;

/// Arguments of `armada tool`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada tool list left_arm                        what it carries, and which tools it knows
  armada tool attach left_arm gripper              a tool of the robot file
  armada tool attach left_arm @probe.json          another one: name, tcp, inertia
  armada tool detach left_arm

Poses of tools count at once: in the state, in moves to poses and in what is checked.")]
pub(crate) struct ToolArgs {
    #[command(subcommand)]
    command: ToolCommand,
}

#[derive(Debug, Subcommand)]
enum ToolCommand {
    /// Show what each chain carries, and the tools of the robot file
    List(ListArgs),
    /// Attach a tool to a chain that has none
    Attach(AttachArgs),
    /// Detach the tool of a chain that holds no payload
    Detach(DetachArgs),
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
struct AttachArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Name of a tool of the robot file; or a tool as JSON, @FILE that holds it, or -
    #[arg(value_name = "TOOL")]
    tool: String,
    /// Chain; not needed if the robot has one only
    #[arg(long, value_name = "CHAIN")]
    chain: Option<String>,
    #[command(flatten)]
    cell: CellArgs,
}

/// Arguments of detaching a tool or payload.
#[derive(Args, Debug)]
pub(super) struct DetachArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    pub(super) robot: RobotName,
    /// Name of what is to be detached; whatever is there if left out
    #[arg(value_name = "NAME")]
    pub(super) name: Option<String>,
    /// Chain; not needed if the robot has one only
    #[arg(long, value_name = "CHAIN")]
    pub(super) chain: Option<String>,
    #[command(flatten)]
    pub(super) cell: CellArgs,
}

/// Lists, attaches or detaches tools.
pub(crate) async fn run(args: ToolArgs) -> anyhow::Result<Exit> {
    match args.command {
        ToolCommand::List(args) => list(args).await,
        ToolCommand::Attach(args) => {
            let AttachArgs { robot, tool, chain, cell } = args;
            let params = tool_params(&tool, chain)?;
            let (client, _) = cell.connect().await?;
            report(&robot, &client.call::<AttachTool>(&robot, params).await?, &cell.output())
        }
        ToolCommand::Detach(args) => {
            let (client, _) = args.cell.connect().await?;
            let params = DetachParams { chain: args.chain, name: args.name };
            let answer = client.call::<DetachTool>(&args.robot, params).await?;
            report(&args.robot, &answer, &args.cell.output())
        }
    }
}

/// Whether an argument is JSON or tells where it is, and not a name.
pub(super) fn is_json(argument: &str) -> bool {
    argument == "-" || argument.starts_with(['@', '{'])
}

fn tool_params(argument: &str, chain: Option<String>) -> anyhow::Result<AttachToolParams> {
    if !is_json(argument) {
        return Ok(AttachToolParams { chain, tool: None, name: Some(argument.to_owned()) });
    }
    let text = text_of(argument)?;
    let problem = |error| UsageError(format!("not a tool: {error}"));
    let tool: ToolInfo = serde_json::from_str(&text).map_err(problem)?;
    Ok(AttachToolParams { chain, tool: Some(tool), name: None })
}

async fn list(args: ListArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let info = client.robot_info(&args.robot).await?;
    let out = args.cell.output();
    if out.is_json() {
        out.json(&serde_json::json!({ "equipment": info.equipment, "tools": info.tools }))?;
    } else {
        for equipment in &info.equipment {
            out.line(format_args!("{}: {}", info.robot, carried(equipment)))?;
        }
        out.line(tools(&info))?;
    }
    Ok(Exit::Success)
}

fn tools(info: &RobotInfo) -> String {
    if info.tools.is_empty() {
        return "the robot file has no tools".to_owned();
    }
    let mut table = Table::new(&["tool", "type", "mass [kg]", "tcp: x y z  roll pitch yaw"]);
    for tool in &info.tools {
        table.row(vec![
            tool.name.clone(),
            words::wire_name(tool.tool_type),
            words::tidy(tool.inertia.mass_kg, 3),
            words::pose(&tool.tcp),
        ]);
    }
    table.to_string()
}

/// Prints what a chain carries now.
pub(super) fn report(
    robot: &RobotName,
    answer: &EquipmentAnswer,
    out: &Output,
) -> anyhow::Result<Exit> {
    if out.is_json() {
        out.json(answer)?;
    } else {
        out.line(format_args!("{robot}: {}", carried(&answer.equipment)))?;
    }
    Ok(Exit::Success)
}

/// What a chain carries: `arm carries gripper (1.25 kg) with box (2 kg)`.
pub(crate) fn carried(equipment: &ChainEquipment) -> String {
    let named = |name: &str, inertia: &Inertia| format!("{name} ({} kg)", inertia.mass_kg);
    let mut parts = Vec::new();
    if let Some(tool) = &equipment.tool {
        parts.push(named(&tool.name, &tool.inertia));
    }
    if let Some(held) = &equipment.payload {
        parts.push(named(&held.payload.name, &held.payload.inertia));
    }
    let what = if parts.is_empty() { "nothing".to_owned() } else { parts.join(" with ") };
    format!("{} carries {what}", equipment.chain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn golden_info() -> RobotInfo {
        let text = include_str!("../../../../protocol/golden/robot_info.json");
        serde_json::from_str(text).expect("the golden sample")
    }

    #[test]
    fn a_tool_is_a_name_or_json() {
        let named = tool_params("gripper", None).expect("a name");
        assert_eq!((named.name.as_deref(), named.tool), (Some("gripper"), None));
        let given = tool_params(r#"{"name":"probe","tcp":{}}"#, None).expect("a tool");
        assert_eq!((given.name, given.tool.map(|tool| tool.name)), (None, Some("probe".into())));
        let error = tool_params(r#"{"name":"probe"}"#, None).expect_err("no tcp").to_string();
        assert!(error.contains("tcp"), "{error}");
    }

    #[test]
    fn what_a_chain_carries_is_told_with_its_masses() {
        let mut info = golden_info();
        let equipment = info.equipment.pop().expect("one chain");
        assert_eq!(carried(&equipment), "arm carries gripper (1.25 kg) with box (2 kg)");
        let bare = ChainEquipment { tool: None, payload: None, ..equipment };
        assert_eq!(carried(&bare), "arm carries nothing");
    }

    #[test]
    fn tools_of_the_robot_file_are_a_table() {
        let expected = "\
tool     type              mass [kg]  tcp: x y z  roll pitch yaw
gripper  electric gripper  1.250      0.000 0.000 0.125 m  0.0 0.0 0.0°
probe    other             0.000      0.000 0.000 0.250 m  0.0 0.0 0.0°";
        assert_eq!(tools(&golden_info()), expected);
    }
}
