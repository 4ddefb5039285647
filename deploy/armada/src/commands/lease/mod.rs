//! `armada lease`: who may command a robot.

mod keep;
mod show;

use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::client::GroupLeaseKeeper;
use armada_protocol::messages::{LeaseScope, Role};
use clap::{Args, Subcommand};

use self::keep::{acquire_all, until_ended};
use self::show::ShowArgs;
use crate::cell_address::CellArgs;
use crate::choice::one_of;
use crate::exit::{Exit, UsageError};
use crate::signals::Signals;

/// Arguments of `armada lease`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada lease show                     who may command which robot
  armada lease hold left_arm            keep others from commanding it, until Ctrl-C
  armada lease hold left_arm --ttl 5    if this program dies, for 5 s at most
  armada lease hold left_arm right_arm  both or none
  armada lease take left_arm --role operator --reason \"planner hangs\"
  armada lease delegate left_arm --lease UUID --to gripper-ui --scope end-effector
  armada move left_arm --home --lease 0192f0c5-0000-7000-8000-000000000004
  armada run lift.json --leases left_arm=UUID --leases right_arm=UUID

While nobody holds a lease, everybody may command. While somebody does, only who knows the lease:
`hold`, `take` and `delegate` print it and keep it, other commands take it with --lease. Stop, halt,
cancel and disable never need one.")]
pub(crate) struct LeaseArgs {
    #[command(subcommand)]
    command: LeaseCommand,
}

#[derive(Debug, Subcommand)]
enum LeaseCommand {
    /// Show who holds which robot
    Show(ShowArgs),
    /// Acquire the lease of a robot, or of several at once, and keep it until Ctrl-C
    Hold(HoldArgs),
    /// Take the lease of a robot from whoever holds it, and keep it until Ctrl-C
    Take(TakeArgs),
    /// Let somebody else command as well, under a lease that is held, until Ctrl-C
    Delegate(DelegateArgs),
}

#[derive(Args, Debug)]
struct HoldArgs {
    /// Which robots; of several all are held, or none
    #[arg(value_name = "ROBOT", required = true)]
    robots: Vec<RobotName>,
    /// As what: nobody of a lower role can take it away
    #[arg(long, value_name = "ROLE", default_value = "program",
          value_parser = one_of::<Role>(&["program", "operator", "supervisor"]))]
    role: Role,
    #[command(flatten)]
    lasting: LastingArgs,
    #[command(flatten)]
    cell: CellArgs,
}

#[derive(Args, Debug)]
struct TakeArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// As what; not below the role of the holder, whose motion ends
    #[arg(long, value_name = "ROLE", value_parser = one_of::<Role>(&["operator", "supervisor"]))]
    role: Role,
    /// Why, for the holder and the audit trail
    #[arg(long, value_name = "TEXT")]
    reason: String,
    #[command(flatten)]
    lasting: LastingArgs,
    #[command(flatten)]
    cell: CellArgs,
}

#[derive(Args, Debug)]
struct DelegateArgs {
    /// Which robot, whose lease --lease is
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// Name of the client that is to command as well
    #[arg(long, value_name = "CLIENT")]
    to: String,
    /// What it gets the right to: everything, tools and what they hold, or signals and parameters
    #[arg(long, value_name = "SCOPE", default_value = "arm",
          value_parser = one_of::<LeaseScope>(&["arm", "end-effector", "io"]))]
    scope: LeaseScope,
    #[command(flatten)]
    lasting: LastingArgs,
    #[command(flatten)]
    cell: CellArgs,
}

#[derive(Args, Clone, Copy, Debug)]
struct LastingArgs {
    /// How long it lasts without being renewed, 0.2 to 60
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = parse_ttl)]
    ttl: Duration,
}

fn parse_ttl(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.2..=60.0).contains(&seconds) => Ok(Duration::from_secs_f64(seconds)),
        _ => Err("must be a number of seconds from 0.2 to 60".to_owned()),
    }
}

/// Shows, holds, takes or delegates leases.
pub(crate) async fn run(args: LeaseArgs) -> anyhow::Result<Exit> {
    match args.command {
        LeaseCommand::Show(args) => show::run(args).await,
        LeaseCommand::Hold(args) => hold(args).await,
        LeaseCommand::Take(args) => take(args).await,
        LeaseCommand::Delegate(args) => delegate(args).await,
    }
}

async fn hold(args: HoldArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let mut signals = Signals::new()?;
    let kept = acquire_all(&client, &args.robots, args.lasting.ttl, args.role).await?;
    until_ended(kept, &args.cell.output(), &mut signals).await
}

async fn take(args: TakeArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let mut signals = Signals::new()?;
    let TakeArgs { robot, role, reason, lasting, cell } = args;
    let keeper = client.take_lease(&robot, lasting.ttl, role, reason).await?;
    until_ended(GroupLeaseKeeper::of(robot, keeper), &cell.output(), &mut signals).await
}

async fn delegate(args: DelegateArgs) -> anyhow::Result<Exit> {
    let DelegateArgs { robot, to, scope, lasting, cell } = args;
    let Some(lease) = cell.lease else {
        let why = "delegate needs the lease of the holder: --lease, as `armada lease hold` prints";
        return Err(UsageError(why.to_owned()).into());
    };
    let (client, _) = cell.connect().await?;
    let mut signals = Signals::new()?;
    let grant = client.delegate_lease(&robot, lease, (&to, scope, lasting.ttl)).await?;
    let keeper = client.keep_lease(&robot, grant.lease).await?;
    until_ended(GroupLeaseKeeper::of(robot, keeper), &cell.output(), &mut signals).await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lease_lasts_from_a_fifth_of_a_second_to_a_minute() {
        assert_eq!(parse_ttl("0.2"), Ok(Duration::from_millis(200)));
        for bad in ["0.1", "61", "NaN", "-1", "long"] {
            assert!(parse_ttl(bad).is_err(), "{bad}");
        }
    }
}
