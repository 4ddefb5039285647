//! `armada emulator`: the controller's side of a vendor's protocol, with a robot behind it.

use std::net::SocketAddr;
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context as _, bail};
use armada_agent::config::RobotConfig;
use armada_agent::drivers::sim::{Fault, decode_inject_answer, encode_inject};
use armada_agent::drivers::{Emulator, MAX_PACKET};
use armada_agent::runtime::Emulation;
use clap::{Args, Subcommand, ValueHint};
use tokio::net::UdpSocket;
use tokio::time::timeout;
use tracing::info;
use uuid::Uuid;

use super::ParentArgs;
use crate::exit::{Exit, UsageError};
use crate::output::Output;
use crate::signals::Signals;

/// Pause before an injected fault is sent again.
const INJECT_PAUSE: Duration = Duration::from_millis(200);
/// How often an injected fault is sent.
const INJECT_TRIES: u32 = 10;

/// Arguments of `armada emulator`.
#[derive(Args, Debug)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:
  armada emulator sim config/robots/left_arm.yaml
  armada emulator inject 127.0.0.1:47101 estop
  armada emulator inject 127.0.0.1:47101 silence_ms=500
  armada emulator inject 127.0.0.1:47101 key_switch=auto
  armada emulator inject 127.0.0.1:47101 input=DI1:1

The agent cannot tell it from a controller: it crosses the same sockets."
)]
pub(crate) struct EmulatorArgs {
    /// Vendor whose controller to emulate, as in the robot file
    #[arg(value_name = "VENDOR", required = true, value_parser = vendors())]
    vendor: Option<String>,
    /// Robot file
    #[arg(value_name = "ROBOT.yaml", required = true, value_hint = ValueHint::FilePath)]
    robot: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) parent: ParentArgs,
    #[command(subcommand)]
    command: Option<EmulatorCommand>,
}

#[derive(Debug, Subcommand)]
enum EmulatorCommand {
    /// Inject a fault into a running emulator of vendor sim
    Inject {
        /// Address of the emulator, as in the robot file
        #[arg(value_name = "HOST:PORT")]
        address: SocketAddr,
        /// What to inject, NAME or NAME=VALUE
        ///
        /// Emergency stop: estop, estop_button=1..4, estop_fault, estop_other, estop_release.
        /// Guards and switches: guard_open=1..4, guard_close=1..4, enabling_hold, enabling_release,
        /// key_switch=MODE (manual_reduced_speed, manual_full_speed, auto, cobot), local_on, local_off.
        /// Errors: error=CODE, fatal_error=CODE, fatal_clear, homing_failure, homing_repair,
        /// drives_off, block_joint=INDEX, unblock.
        /// Inputs: input=NAME:VALUE, or `input=NAME[ELEMENT]:VALUE` of one with several values.
        /// Link: silence_ms=MS, latency_ms=MS, freeze, unfreeze.
        #[arg(value_name = "FAULT")]
        fault: Fault,
    },
}

fn vendors() -> clap::builder::PossibleValuesParser {
    armada_agent::drivers::VENDORS.into()
}

/// Runs an emulator until a signal, or injects a fault into one.
pub(crate) async fn run(args: EmulatorArgs) -> anyhow::Result<Exit> {
    match (args.command, args.vendor, args.robot) {
        (Some(EmulatorCommand::Inject { address, fault }), ..) => inject(address, fault).await,
        (None, Some(vendor), Some(robot)) => emulate(&vendor, &robot).await,
        _ => Err(UsageError("give a vendor and a robot file".to_owned()).into()),
    }
}

async fn emulate(vendor: &str, robot: &Path) -> anyhow::Result<Exit> {
    let mut signals = Signals::new()?;
    let config = RobotConfig::load(robot)?;
    if config.driver.vendor() != vendor {
        let text =
            format!("{} is for vendor {}, not {vendor}", robot.display(), config.driver.vendor());
        return Err(UsageError(text).into());
    }
    let emulation = Emulation::start(build(&config)?, config.control.realtime)
        .with_context(|| format!("the emulator of {} cannot start", config.robot))?;
    info!(robot = %config.robot, addresses = ?emulation.addresses(), "emulator runs");
    let signal = signals.next().await;
    info!(signal, "emulator ends");
    drop(emulation);
    Ok(Exit::Success)
}

/// The emulator of a robot file.
///
/// # Errors
/// If the robot description cannot be read or does not fit.
pub(crate) fn build(config: &RobotConfig) -> anyhow::Result<Box<dyn Emulator>> {
    let (_, model) = config.read_urdf()?;
    let (high, low) = Uuid::now_v7().as_u64_pair();
    let boot_nonce = NonZeroU64::new(high ^ low).unwrap_or(NonZeroU64::MIN);
    let setup = config.driver_setup(&model, boot_nonce)?;
    config.driver.emulator(&setup).with_context(|| config.robot.to_string())
}

async fn inject(address: SocketAddr, fault: Fault) -> anyhow::Result<Exit> {
    let local: SocketAddr = match address {
        SocketAddr::V4(_) => ([0, 0, 0, 0], 0).into(),
        SocketAddr::V6(_) => ([0_u16; 8], 0).into(),
    };
    let socket = UdpSocket::bind(local).await?;
    socket.connect(address).await?;
    let mut packet = [0; MAX_PACKET];
    let len = encode_inject(&fault, &mut packet);
    for _ in 0..INJECT_TRIES {
        let sent = socket.send(packet.get(..len).unwrap_or_default()).await;
        if sent.is_ok()
            && let Ok(Ok(accepted)) = timeout(INJECT_PAUSE, answer(&socket, fault)).await
        {
            if !accepted {
                bail!("{address}: the emulated robot cannot have the fault {fault}");
            }
            Output::new(false).line(format_args!("{address}: {fault}"))?;
            return Ok(Exit::Success);
        }
    }
    Err(UsageError(format!("no emulator answers at {address}")).into())
}

async fn answer(socket: &UdpSocket, fault: Fault) -> std::io::Result<bool> {
    let mut packet = [0; MAX_PACKET];
    loop {
        let len = socket.recv(&mut packet).await?;
        match decode_inject_answer(packet.get(..len).unwrap_or_default()) {
            Ok((answered, accepted)) if answered == fault => return Ok(accepted),
            // Something else came to this port.
            Ok(_) | Err(_) => {}
        }
    }
}
