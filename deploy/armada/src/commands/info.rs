//! `armada info`.

use armada_model::{JointLimits, JointType};
use armada_protocol::RobotName;
use armada_protocol::messages::RobotInfo;
use clap::Args;

use super::tool::carried;
use super::values::{parameters, signals};
use crate::cell_address::CellArgs;
use crate::exit::Exit;
use crate::output::Output;
use crate::table::Table;
use crate::words;

/// Arguments of `armada info`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada info left_arm
  armada info left_arm --urdf > left_arm.urdf
  armada info left_arm --json | jq '.joints[].name'")]
pub(crate) struct InfoArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Print only the robot description, as URDF
    #[arg(long, conflicts_with = "json")]
    urdf: bool,
    #[command(flatten)]
    cell: CellArgs,
}

/// Prints what the robot is.
pub(crate) async fn run(args: InfoArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let info = client.robot_info(&args.robot).await?;
    let out = args.cell.output();
    if args.urdf {
        out.line(info.urdf.trim_end())?;
    } else if out.is_json() {
        out.json(&info)?;
    } else {
        print(&info, &out)?;
    }
    Ok(Exit::Success)
}

fn print(info: &RobotInfo, out: &Output) -> anyhow::Result<()> {
    let serial = if info.serial.is_empty() { "not known" } else { &info.serial };
    out.line(format_args!("{}: {} {}, serial {serial}", info.robot, info.vendor, info.model))?;
    out.line(format_args!("  uuid          {}", info.uuid))?;
    out.line(format_args!(
        "  control loop  {:.0} Hz, state published at {}",
        1000.0 / info.period_ms,
        state_rates(info)
    ))?;
    out.line(format_args!(
        "  software      {}, description revision {}",
        info.software_version, info.model_rev
    ))?;
    out.line(format_args!("\n{}", joint_table(info)))?;
    out.line("\nchains, whose tip poses are in the state:")?;
    for chain in &info.chains {
        out.line(format_args!("  {}: {} -> {}", chain.name, chain.base_link, chain.tip_link))?;
    }
    print_equipment(info, out)?;
    let capabilities: Vec<_> = info.capabilities.iter().map(words::wire_name).collect();
    out.line(format_args!("\ncapabilities: {}", capabilities.join(", ")))?;
    out.line(format_args!("methods: {}", info.methods.join(", ")))
}

/// How often the state is published: `100 Hz, also 10 and 30 Hz`.
fn state_rates(info: &RobotInfo) -> String {
    let classes: Vec<_> = info.state_classes_hz.iter().map(u32::to_string).collect();
    let also = match classes.as_slice() {
        [] => String::new(),
        rates => format!(", also {} Hz", rates.join(" and ")),
    };
    format!("{:.0} Hz{also}", info.state_rate_hz)
}

fn print_equipment(info: &RobotInfo, out: &Output) -> anyhow::Result<()> {
    for equipment in &info.equipment {
        out.line(format_args!("  {}", carried(equipment)))?;
    }
    let tools: Vec<_> = info.tools.iter().map(|tool| tool.name.as_str()).collect();
    if !tools.is_empty() {
        out.line(format_args!("tools that can be attached by name: {}", tools.join(", ")))?;
    }
    if !info.signals.is_empty() {
        out.line(format_args!("\n{}", signals(&info.signals)))?;
    }
    if !info.parameters.is_empty() {
        out.line(format_args!("\n{}", parameters(&info.parameters)))?;
    }
    Ok(())
}

fn joint_table(info: &RobotInfo) -> Table {
    let titles = [
        "#",
        "joint",
        "type",
        "lower",
        "upper",
        "home",
        "speed [1/s]",
        "reduced",
        "accel [1/s²]",
        "effort",
        "unit",
    ];
    let mut table = Table::new(&titles);
    for (index, joint) in info.joints.iter().enumerate() {
        let JointLimits { lower, upper, velocity, acceleration, effort, .. } = joint.limits;
        table.row(vec![
            index.to_string(),
            joint.name.clone(),
            words::joint_type(joint.joint_type).to_owned(),
            limit(lower),
            limit(upper),
            limit(joint.home),
            limit(Some(velocity)),
            limit(Some(joint.reduced.velocity)),
            limit(acceleration),
            effort.map_or_else(
                || "-".to_owned(),
                |effort| format!("{effort} {}", effort_unit(joint.joint_type)),
            ),
            words::unit(joint.joint_type).to_owned(),
        ]);
    }
    table
}

fn limit(value: Option<f64>) -> String {
    value.map_or_else(|| "none".to_owned(), |value| words::tidy(value, 4))
}

const fn effort_unit(joint: JointType) -> &'static str {
    match joint {
        JointType::Revolute | JointType::Continuous => "Nm",
        JointType::Prismatic => "N",
    }
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::{ChainInfo, JointInfo, ReducedLimits};
    use uuid::Uuid;

    use super::*;

    #[test]
    fn a_limit_that_does_not_exist_is_told_as_none() {
        let info = RobotInfo {
            robot: "torso".parse().expect("a name"),
            uuid: Uuid::nil(),
            boot_id: Uuid::nil(),
            seqno: 0,
            vendor: "sim".to_owned(),
            model: "lift".to_owned(),
            serial: String::new(),
            software_version: "0.1.0".to_owned(),
            model_rev: 1,
            joints: vec![JointInfo {
                name: "lift".to_owned(),
                joint_type: JointType::Prismatic,
                limits: JointLimits {
                    lower: Some(0.0),
                    velocity: 0.25,
                    effort: Some(800.0),
                    ..JointLimits::default()
                },
                reduced: ReducedLimits { velocity: 0.1, acceleration: 0.5 },
                home: Some(0.2),
            }],
            chains: vec![ChainInfo {
                name: "lift".to_owned(),
                base_link: "base".to_owned(),
                tip_link: "tip".to_owned(),
            }],
            equipment: vec![],
            tools: vec![],
            signals: vec![],
            parameters: vec![],
            capabilities: vec![],
            methods: vec![],
            flags: vec![],
            period_ms: 2.0,
            stop_time_s: 2.5,
            lease_required: false,
            state_rate_hz: 100.0,
            state_classes_hz: vec![],
            urdf: String::new(),
        };
        let table = joint_table(&info).to_string();
        let row = table.lines().nth(1).expect("one joint");
        let cells: Vec<_> = row.split_whitespace().collect();
        let expected = "0 lift prismatic 0.0000 none 0.2000 0.2500 0.1000 none 800 N m"
            .split(' ')
            .collect::<Vec<_>>();
        assert_eq!(cells, expected);
    }
}
