//! `armada lease`: who may command a robot.

use std::time::{Duration, Instant};

use anyhow::bail;
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError};
use armada_protocol::messages::{
    AcquireLeaseParams, Lease, LeaseGrant, LeaseParams, RenewLeaseParams,
};
use armada_protocol::method::robot::{AcquireLease, ReleaseLease, RenewLease};
use clap::{Args, Subcommand};
use serde_json::{Map, Value};
use tokio::time::sleep;

use super::modes::robots_or_all;
use crate::cell_address::CellArgs;
use crate::clock;
use crate::exit::Exit;
use crate::output::note;
use crate::signals::Signals;
use crate::table::Table;

/// Times that a lease is renewed while it lasts.
const RENEWALS: u32 = 3;

/// Arguments of `armada lease`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada lease show                     who may command which robot
  armada lease hold left_arm            keep others from commanding it, until Ctrl-C
  armada lease hold left_arm --ttl 5    if this program dies, for 5 s at most
  armada move left_arm --home --lease 0192f0c5-0000-7000-8000-000000000004

While nobody holds a lease, everybody may command. While somebody does, only who knows the lease:
`hold` prints it, other commands take it with --lease. Stop, halt, cancel and disable never need one.")]
pub(crate) struct LeaseArgs {
    #[command(subcommand)]
    command: LeaseCommand,
}

#[derive(Debug, Subcommand)]
enum LeaseCommand {
    /// Show who holds which robot
    Show(ShowArgs),
    /// Acquire the lease of a robot and keep it until Ctrl-C
    Hold(HoldArgs),
}

#[derive(Args, Debug)]
struct ShowArgs {
    /// Robots; every robot of the cell if left out
    #[arg(value_name = "ROBOT")]
    robots: Vec<RobotName>,
    #[command(flatten)]
    cell: CellArgs,
}

#[derive(Args, Debug)]
struct HoldArgs {
    /// Which robot
    #[arg(value_name = "ROBOT")]
    robot: RobotName,
    /// How long it lasts without being renewed, 0.2 to 60
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = parse_ttl)]
    ttl: Duration,
    #[command(flatten)]
    cell: CellArgs,
}

fn parse_ttl(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.2..=60.0).contains(&seconds) => Ok(Duration::from_secs_f64(seconds)),
        _ => Err("must be a number of seconds from 0.2 to 60".to_owned()),
    }
}

/// Shows or holds leases.
pub(crate) async fn run(args: LeaseArgs) -> anyhow::Result<Exit> {
    match args.command {
        LeaseCommand::Show(args) => show(args).await,
        LeaseCommand::Hold(args) => hold(args).await,
    }
}

async fn show(args: ShowArgs) -> anyhow::Result<Exit> {
    let (client, address) = args.cell.connect().await?;
    let robots = robots_or_all(&client, &address, args.robots).await?;
    let mut leases = Vec::new();
    for robot in robots {
        let lease = client.robot_status(&robot).await?.lease;
        leases.push((robot, lease));
    }
    let out = args.cell.output();
    if out.is_json() {
        let rows: Result<Map<String, Value>, _> = leases
            .iter()
            .map(|(robot, lease)| Ok((robot.to_string(), serde_json::to_value(lease)?)))
            .collect::<Result<_, serde_json::Error>>();
        out.json(&rows?)?;
    } else {
        out.line(table(&leases))?;
    }
    Ok(Exit::Success)
}

fn table(leases: &[(RobotName, Option<Lease>)]) -> Table {
    let mut table = Table::new(&["robot", "holder", "time left"]);
    for (robot, lease) in leases {
        let (holder, left) = match lease {
            None => ("nobody".to_owned(), "-".to_owned()),
            Some(lease) if lease.stale => (lease.holder.clone(), "has run out".to_owned()),
            Some(lease) => {
                (lease.holder.clone(), format!("{:.1} s", lease.remaining_ms as f64 / 1e3))
            }
        };
        table.row(vec![robot.to_string(), holder, left]);
    }
    table
}

async fn hold(args: HoldArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let mut signals = Signals::new()?;
    let ttl_ms = u64::try_from(args.ttl.as_millis()).unwrap_or(u64::MAX);
    let asked = clock::now();
    let grant = client
        .call::<AcquireLease>(&args.robot, AcquireLeaseParams { ttl_ms, ..Default::default() })
        .await?;
    let out = args.cell.output();
    if out.is_json() {
        out.json_line(&grant)?;
    } else {
        out.line(format_args!("{}: lease {}, epoch {}", args.robot, grant.lease, grant.epoch))?;
    }
    note("held until Ctrl-C");
    let held = Held { client: &client, robot: &args.robot, grant };
    tokio::select! {
        signal = signals.next() => note(format_args!("{signal}: giving the lease back")),
        lost = held.renew(asked) => return lost,
    }
    let epoch = held.release().await?;
    note(format_args!("{}: given back, epoch {epoch}", args.robot));
    Ok(Exit::Success)
}

struct Held<'a> {
    client: &'a Client,
    robot: &'a RobotName,
    grant: LeaseGrant,
}

impl Held<'_> {
    const fn renewal(&self) -> RenewLeaseParams {
        RenewLeaseParams { lease: self.grant.lease, ttl_ms: None }
    }

    const fn params(&self) -> LeaseParams {
        LeaseParams { lease: self.grant.lease }
    }

    /// Renews the lease until it is lost; `renewed` is when it was last asked for.
    async fn renew(&self, mut renewed: Instant) -> anyhow::Result<Exit> {
        let ttl = Duration::from_millis(self.grant.ttl_ms);
        loop {
            sleep(ttl / RENEWALS).await;
            let asked = clock::now();
            match self.client.call::<RenewLease>(self.robot, self.renewal()).await {
                Ok(_) => renewed = asked,
                // The agent or the link may be back before the lease has run out.
                Err(ClientError::NoReply { .. } | ClientError::Timeout { .. })
                    if clock::now().saturating_duration_since(renewed) < ttl => {}
                Err(error) => bail!("{}: the lease is lost: {error}", self.robot),
            }
        }
    }

    async fn release(&self) -> Result<u64, ClientError> {
        Ok(self.client.call::<ReleaseLease>(self.robot, self.params()).await?.epoch)
    }
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

    #[test]
    fn a_lease_that_has_run_out_is_told_as_such() {
        let name = |text: &str| text.parse::<RobotName>().expect("a name");
        let lease = |remaining_ms, stale| {
            Some(Lease {
                holder: "planner".to_owned(),
                remaining_ms,
                stale,
                role: Default::default(),
                reason: None,
                delegates: Vec::new(),
            })
        };
        let rows = [(name("a"), None), (name("b"), lease(800, false)), (name("c"), lease(0, true))];
        let expected = "\
robot  holder   time left
a      nobody   -
b      planner  0.8 s
c      planner  has run out";
        assert_eq!(table(&rows).to_string(), expected);
    }
}
