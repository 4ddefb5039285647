//! Leases that are kept until somebody ends this program, or one of them is lost.

use std::time::Duration;

use anyhow::bail;
use armada_protocol::RobotName;
use armada_protocol::client::{Client, GroupLeaseKeeper, LeaseKeeper};
use armada_protocol::messages::{LeaseGrant, Role};

use crate::commands::modes::words_of;
use crate::exit::Exit;
use crate::output::{Output, note};
use crate::signals::Signals;

/// Acquires the leases of robots, all or none.
///
/// # Errors
/// What the first that is refused says, with its name; those before it are given back.
pub(super) async fn acquire_all(
    client: &Client,
    robots: &[RobotName],
    ttl: Duration,
    role: Role,
) -> anyhow::Result<GroupLeaseKeeper> {
    client.acquire_group_as(robots, ttl, role).await.map_err(|refused| {
        let robot = refused.robot;
        let context =
            if robots.len() > 1 { format!("{robot}, so none is held") } else { robot.to_string() };
        anyhow::Error::new(refused.error).context(context)
    })
}

/// Prints the leases, and keeps them until a signal comes or one is lost; then gives them back.
///
/// # Errors
/// If one was lost, with its robot and why.
pub(super) async fn until_ended(
    kept: GroupLeaseKeeper,
    out: &Output,
    signals: &mut Signals,
) -> anyhow::Result<Exit> {
    for (robot, grant) in kept.keepers().iter().map(|(robot, keeper)| (robot, keeper.grant())) {
        if out.is_json() {
            out.json_line(&line(robot, grant))?;
        } else {
            out.line(format_args!("{robot}: lease {}, epoch {}", grant.lease, grant.epoch))?;
        }
    }
    note("held until Ctrl-C");
    tokio::select! {
        signal = signals.next() => note(format_args!("{signal}: giving back")),
        () = kept.lost() => {}
    }
    let is_kept = |(_, keeper): &(&RobotName, &LeaseKeeper)| !keeper.is_lost();
    let given: Vec<_> =
        kept.keepers().iter().filter(is_kept).map(|(robot, _)| robot.clone()).collect();
    let losses = kept.losses();
    let failed = kept.release().await;
    for robot in given {
        match failed.iter().find(|(of, _)| *of == robot) {
            Some((_, error)) => note(format_args!("{robot}: {}", words_of(error))),
            None => note(format_args!("{robot}: given back")),
        }
    }
    match losses.first() {
        Some((robot, why)) => bail!("{robot}: the lease is lost: {}", words_of(why)),
        None => Ok(Exit::Success),
    }
}

/// The grant with its robot.
fn line(robot: &RobotName, grant: &LeaseGrant) -> serde_json::Value {
    let LeaseGrant { lease, epoch, ttl_ms } = grant;
    serde_json::json!({ "robot": robot, "lease": lease, "epoch": epoch, "ttl_ms": ttl_ms })
}
