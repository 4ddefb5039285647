//! `armada lease show`.

use armada_protocol::RobotName;
use armada_protocol::messages::{AuthorityState, Lease};
use clap::Args;
use serde_json::{Map, Value};

use crate::cell_address::CellArgs;
use crate::commands::modes::robots_or_all;
use crate::exit::Exit;
use crate::table::Table;
use crate::words;

/// Arguments of `armada lease show`.
#[derive(Args, Debug)]
pub(super) struct ShowArgs {
    /// Robots; every robot of the cell if left out
    #[arg(value_name = "ROBOT")]
    robots: Vec<RobotName>,
    #[command(flatten)]
    cell: CellArgs,
}

/// Who may command a robot.
type Row = (RobotName, AuthorityState, Option<Lease>);

/// Shows who may command which robot.
pub(super) async fn run(args: ShowArgs) -> anyhow::Result<Exit> {
    let (client, address) = args.cell.connect().await?;
    let robots = robots_or_all(&client, &address, args.robots).await?;
    let mut rows: Vec<Row> = Vec::new();
    for robot in robots {
        let status = client.robot_status(&robot).await?;
        rows.push((robot, status.authority, status.lease));
    }
    let out = args.cell.output();
    if out.is_json() {
        let leases: Result<Map<String, Value>, serde_json::Error> = rows
            .iter()
            .map(|(robot, _, lease)| Ok((robot.to_string(), serde_json::to_value(lease)?)))
            .collect();
        out.json(&leases?)?;
    } else {
        out.line(table(&rows))?;
    }
    Ok(Exit::Success)
}

fn table(rows: &[Row]) -> Table {
    let mut table = Table::new(&["robot", "holder", "role", "time left", "why, and who else"]);
    for (robot, authority, lease) in rows {
        let Some(lease) = lease else {
            let nobody = match authority {
                AuthorityState::Local => "the pendant",
                AuthorityState::Inhibited => "nobody, it is stopped",
                AuthorityState::Free | AuthorityState::Held | AuthorityState::Stale => "nobody",
            };
            table.row(vec![robot.to_string(), nobody.to_owned(), "-".into(), "-".into()]);
            continue;
        };
        let left = if lease.stale {
            "has run out".to_owned()
        } else {
            words::seconds_left(lease.remaining_ms)
        };
        let role = words::role(lease.role).to_owned();
        table.row(vec![robot.to_string(), lease.holder.clone(), role, left, more(lease)]);
    }
    table
}

/// Why it was taken, and whom the holder lets command as well.
fn more(lease: &Lease) -> String {
    let taken = lease.reason.iter().map(|reason| format!("took it: {reason}"));
    let delegates = lease.delegates.iter().map(|delegate| {
        let left = words::seconds_left(delegate.remaining_ms);
        format!("{} ({}) {left}", delegate.holder, words::wire_name(delegate.scope))
    });
    taken.chain(delegates).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::{Delegate, LeaseScope, Role};

    use super::*;

    #[test]
    fn holder_role_reason_and_delegates_are_told_and_who_else_keeps_a_robot() {
        let name = |text: &str| text.parse::<RobotName>().expect("a name");
        let lease = |remaining_ms, stale| Lease {
            holder: "planner".to_owned(),
            remaining_ms,
            stale,
            role: Role::Program,
            reason: None,
            delegates: Vec::new(),
        };
        let taken = Lease {
            role: Role::Operator,
            reason: Some("planner hangs".to_owned()),
            delegates: vec![Delegate {
                holder: "gripper-ui".to_owned(),
                scope: LeaseScope::EndEffector,
                remaining_ms: 900,
            }],
            ..lease(1500, false)
        };
        let rows = [
            (name("a"), AuthorityState::Free, None),
            (name("b"), AuthorityState::Held, Some(lease(800, false))),
            (name("c"), AuthorityState::Stale, Some(lease(0, true))),
            (name("d"), AuthorityState::Held, Some(taken)),
            (name("e"), AuthorityState::Local, None),
            (name("f"), AuthorityState::Inhibited, None),
        ];
        let expected = "\
robot  holder                 role      time left    why, and who else
a      nobody                 -         -
b      planner                program   0.8 s
c      planner                program   has run out
d      planner                operator  1.5 s        took it: planner hangs; gripper-ui (end effector) 0.9 s
e      the pendant            -         -
f      nobody, it is stopped  -         -";
        assert_eq!(table(&rows).to_string(), expected);
    }
}
