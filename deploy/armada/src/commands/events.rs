//! `armada events`.

use armada_protocol::messages::{Event, Severity};
use armada_protocol::{RobotName, keys};
use clap::Args;
use uuid::Uuid;

use crate::cell_address::CellArgs;
use crate::exit::Exit;
use crate::output::{Output, note};
use crate::words;

/// Events kept while the printer is slow.
const CAPACITY: usize = 4096;

/// Arguments of `armada events`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada events                     everything, until Ctrl-C
  armada events left_arm            one robot
  armada events --json | jq .kind   one JSON object a line

Events of a sender are numbered without gaps: a missing number is told.")]
pub(crate) struct EventsArgs {
    /// Robots to follow; all and the gateway if left out
    #[arg(value_name = "ROBOT")]
    robots: Vec<RobotName>,
    #[command(flatten)]
    cell: CellArgs,
}

/// Prints events until Ctrl-C, or until nobody reads.
pub(crate) async fn run(args: EventsArgs) -> anyhow::Result<Exit> {
    let (client, _) = args.cell.connect().await?;
    let out = args.cell.output();
    let robots = client.subscribe::<Event>(&keys::ROBOT_EVENTS.any(), CAPACITY).await?;
    let gateway = client.subscribe::<Event>(&keys::CELL_EVENTS.any(), CAPACITY).await?;
    let mut seen = Seen::default();
    let interrupted = tokio::signal::ctrl_c();
    tokio::pin!(interrupted);
    while !out.is_closed() {
        let event = tokio::select! {
            _ = &mut interrupted => break,
            event = robots.next() => event?.1,
            event = gateway.next() => event?.1,
        };
        let wanted = args.robots.is_empty()
            || event.robot.as_ref().is_some_and(|robot| args.robots.contains(robot));
        if wanted {
            print(&event, &mut seen, &out)?;
        }
    }
    Ok(Exit::Success)
}

fn print(event: &Event, seen: &mut Seen, out: &Output) -> anyhow::Result<()> {
    match seen.take(event) {
        Order::Repeated => return Ok(()),
        Order::Next => {}
        Order::After(missing) => {
            note(format_args!("{}: {missing} events were lost", sender(event)));
        }
    }
    if out.is_json() { out.json_line(event) } else { out.line(text(event)) }
}

fn sender(event: &Event) -> String {
    event.robot.as_ref().map_or_else(|| "gateway".to_owned(), ToString::to_string)
}

fn text(event: &Event) -> String {
    let severity = match event.severity {
        Severity::Info => "info",
        Severity::Warning => "WARNING",
        Severity::Error => "ERROR",
    };
    format!(
        "{} {:<7} {} #{} {}: {}",
        time_of_day(event.utc_ns),
        severity,
        sender(event),
        event.seqno,
        words::wire_name(event.kind),
        event.message
    )
}

/// Time of day in UTC: `14:03:07.125`.
fn time_of_day(utc_ns: u64) -> String {
    let ms = utc_ns / 1_000_000;
    let (hours, minutes, seconds) = (ms / 3_600_000 % 24, ms / 60_000 % 60, ms / 1000 % 60);
    format!("{hours:02}:{minutes:02}:{seconds:02}.{:03}Z", ms % 1000)
}

/// Last number of each run of each sender.
#[derive(Debug, Default)]
struct Seen(Vec<(Option<RobotName>, Uuid, u64)>);

/// How an event's number follows the last one.
#[derive(Debug, PartialEq, Eq)]
enum Order {
    Next,
    After(u64),
    Repeated,
}

impl Seen {
    fn take(&mut self, event: &Event) -> Order {
        let known = self.0.iter_mut().find(|(robot, _, _)| robot == &event.robot);
        match known {
            Some((_, boot, last)) if *boot == event.boot_id => {
                let order = match event.seqno.checked_sub(*last) {
                    None | Some(0) => return Order::Repeated,
                    Some(1) => Order::Next,
                    Some(more) => Order::After(more - 1),
                };
                *last = event.seqno;
                order
            }
            Some((_, boot, last)) => {
                (*boot, *last) = (event.boot_id, event.seqno);
                Order::Next
            }
            None => {
                self.0.push((event.robot.clone(), event.boot_id, event.seqno));
                Order::Next
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use armada_model::MonoTime;
    use armada_protocol::messages::EventKind;

    use super::*;

    fn event(seqno: u64) -> Event {
        Event {
            robot: Some("torso".parse().expect("a name")),
            boot_id: Uuid::nil(),
            seqno,
            stamp_ns: MonoTime::ZERO,
            utc_ns: 50_587_125_000_000,
            severity: Severity::Warning,
            kind: EventKind::FaultLatched,
            message: "no feedback for 105 ms".to_owned(),
            details: serde_json::Map::new(),
        }
    }

    #[test]
    fn a_gap_in_the_numbers_is_told() {
        let mut seen = Seen::default();
        assert_eq!(seen.take(&event(7)), Order::Next);
        assert_eq!(seen.take(&event(8)), Order::Next);
        assert_eq!(seen.take(&event(8)), Order::Repeated);
        assert_eq!(seen.take(&event(12)), Order::After(3));
    }

    #[test]
    fn a_new_run_of_the_sender_begins_anew() {
        let mut seen = Seen::default();
        seen.take(&event(7));
        let restarted = Event { boot_id: Uuid::max(), ..event(0) };
        assert_eq!(seen.take(&restarted), Order::Next);
    }

    #[test]
    fn an_event_is_one_line() {
        let expected = "14:03:07.125Z WARNING torso #7 fault latched: no feedback for 105 ms";
        assert_eq!(text(&event(7)), expected);
    }
}
