//! `armada payload`: what a tool holds.

use armada_protocol::RobotName;
use armada_protocol::messages::{AttachPayloadParams, DetachParams, Inertia, PayloadInfo};
use armada_protocol::method::robot::{AttachPayload, DetachPayload};
use clap::{Args, Subcommand};

use super::tool::{DetachArgs, is_json, report};
use crate::cell_address::CellArgs;
use crate::commands::model::input::text_of;
use crate::exit::{Exit, UsageError};
use crate::pose_arg;

/// Arguments of `armada payload`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada payload attach left_arm box --mass 2.5
  armada payload attach left_arm box --mass 2.5 --com 0,0,0.1 --pose 0,0,0.05,0,0,0
  armada payload attach left_arm @box.json         name and inertia
  armada payload detach left_arm")]
pub(crate) struct PayloadArgs {
    #[command(subcommand)]
    command: PayloadCommand,
}

#[derive(Debug, Subcommand)]
enum PayloadCommand {
    /// Attach a payload to a chain with a tool
    Attach(AttachPayloadArgs),
    /// Detach the payload of a chain
    Detach(DetachArgs),
}

#[derive(Args, Debug)]
struct AttachPayloadArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Name; or a payload as JSON, @FILE that holds it, or -
    #[arg(value_name = "PAYLOAD")]
    payload: String,
    /// Mass (kg), with a name
    #[arg(long, value_name = "KG", value_parser = parse_mass)]
    mass: Option<f64>,
    /// Centre of mass in the payload's frame (m), with a mass
    #[arg(long, value_name = "X,Y,Z", requires = "mass", allow_hyphen_values = true,
        value_parser = parse_triple)]
    com: Option<[f64; 3]>,
    /// Pose in the tool centre point; X,Y,Z,ROLL,PITCH,YAW in m and degrees, or JSON
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<String>,
    /// Chain; not needed if the robot has one only
    #[arg(long, value_name = "CHAIN")]
    chain: Option<String>,
    #[command(flatten)]
    cell: CellArgs,
}

fn parse_mass(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(mass) if mass.is_finite() && mass >= 0.0 => Ok(mass),
        _ => Err("must be a number of kg, not negative".to_owned()),
    }
}

fn parse_triple(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| part.trim().parse::<f64>().ok().filter(|value| value.is_finite()))
        .collect();
    numbers
        .and_then(|numbers| <[f64; 3]>::try_from(numbers).ok())
        .ok_or_else(|| "expected three numbers X,Y,Z".to_owned())
}

/// Attaches or detaches payloads.
pub(crate) async fn run(args: PayloadArgs) -> anyhow::Result<Exit> {
    match args.command {
        PayloadCommand::Attach(args) => {
            let params = args.params()?;
            let (client, _) = args.cell.connect().await?;
            let answer = client.call::<AttachPayload>(&args.robot, params).await?;
            report(&args.robot, &answer, &args.cell.output())
        }
        PayloadCommand::Detach(args) => {
            let (client, _) = args.cell.connect().await?;
            let params = DetachParams { chain: args.chain, name: args.name };
            let answer = client.call::<DetachPayload>(&args.robot, params).await?;
            report(&args.robot, &answer, &args.cell.output())
        }
    }
}

impl AttachPayloadArgs {
    fn params(&self) -> anyhow::Result<AttachPayloadParams> {
        let payload = match (is_json(&self.payload), self.mass) {
            (true, Some(_)) => {
                let why = "the mass is in the payload's JSON: leave --mass out";
                return Err(UsageError(why.to_owned()).into());
            }
            (true, None) => {
                let text = text_of(&self.payload)?;
                serde_json::from_str(&text)
                    .map_err(|error| UsageError(format!("not a payload: {error}")))?
            }
            (false, mass) => PayloadInfo {
                name: self.payload.clone(),
                uuid: None,
                inertia: Inertia {
                    mass_kg: mass.ok_or_else(|| UsageError("give its --mass".to_owned()))?,
                    com_m: self.com.unwrap_or_default(),
                    ..Inertia::default()
                },
                description: String::new(),
            },
        };
        let pose = self.pose.as_deref().map(|pose| pose_arg::of_argument("--pose", pose));
        let pose = pose.transpose()?.unwrap_or_default();
        Ok(AttachPayloadParams { chain: self.chain.clone(), payload, pose })
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Typed {
        #[command(flatten)]
        args: AttachPayloadArgs,
    }

    fn payload(text: &str) -> anyhow::Result<AttachPayloadParams> {
        Typed::try_parse_from(["attach", "left_arm"].into_iter().chain(text.split(' ')))?
            .args
            .params()
    }

    #[test]
    fn a_payload_is_typed_with_its_mass() {
        let params = payload("box --mass 2.5 --com 0,0,-0.1 --pose 0,0,0.05,0,0,0").expect("good");
        assert_eq!(params.payload.inertia.mass_kg, 2.5);
        assert_eq!(params.payload.inertia.com_m, [0.0, 0.0, -0.1]);
        assert_eq!(params.pose.position().z, 0.05);
        for bad in ["box", "box --mass -1", "box --mass 1 --com 1,2", "@x.json --mass 1"] {
            assert!(payload(bad).is_err(), "{bad}");
        }
    }
}
