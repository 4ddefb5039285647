//! `armada events`.

use armada_protocol::messages::{Event, Severity};
use armada_protocol::{RobotName, keys};
use clap::Args;
use uuid::Uuid;

use crate::cell_address::CellArgs;
use crate::exit::Exit;
use crate::output::{Output, note};
use crate::words;

/// Detail of an event that the gateway passes on: its number at the robot.
const PASSED_ON: &str = "robot_seqno";
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
        let (from, event) = tokio::select! {
            _ = &mut interrupted => break,
            event = robots.next() => {
                let event = event?.1;
                (event.robot.clone(), event)
            }
            event = gateway.next() => (None, event?.1),
        };
        print(&event, from, &mut seen, is_about(&event, &args.robots).then_some(&out))?;
    }
    Ok(Exit::Success)
}

/// Whether an event is about one of these robots; with none named every event is wanted.
fn is_about(event: &Event, robots: &[RobotName]) -> bool {
    robots.is_empty() || event.robot.as_ref().is_some_and(|robot| robots.contains(robot))
}

/// Whether the gateway passes on what a robot has told, which is heard from the robot itself.
fn is_passed_on(from: Option<&RobotName>, event: &Event) -> bool {
    from.is_none() && event.details.contains_key(PASSED_ON)
}

/// Prints an event from a robot, or from the gateway; without `out` it is only counted.
fn print(
    event: &Event,
    from: Option<RobotName>,
    seen: &mut Seen,
    out: Option<&Output>,
) -> anyhow::Result<()> {
    let is_passed_on = is_passed_on(from.as_ref(), event);
    let name = from.as_ref().map_or_else(|| "gateway".to_owned(), ToString::to_string);
    let order = seen.take(from, event);
    if let Order::After(missing) = order {
        note(format_args!("{name}: {missing} events were lost"));
    }
    let Some(out) = out.filter(|_| !is_passed_on && order != Order::Repeated) else {
        return Ok(());
    };
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    Next,
    After(u64),
    Repeated,
}

impl Seen {
    /// Takes an event from a robot, or from the gateway, which numbers all that it sends.
    fn take(&mut self, from: Option<RobotName>, event: &Event) -> Order {
        let known = self.0.iter_mut().find(|(robot, _, _)| *robot == from);
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
                self.0.push((from, event.boot_id, event.seqno));
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

    fn torso() -> Option<RobotName> {
        Some("torso".parse().expect("a name"))
    }

    fn event(seqno: u64) -> Event {
        Event {
            robot: torso(),
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
        assert_eq!(seen.take(torso(), &event(7)), Order::Next);
        assert_eq!(seen.take(torso(), &event(8)), Order::Next);
        assert_eq!(seen.take(torso(), &event(8)), Order::Repeated);
        assert_eq!(seen.take(torso(), &event(12)), Order::After(3));
    }

    #[test]
    fn what_the_gateway_passes_on_counts_in_its_numbers_but_is_told_once() {
        let mut passed_on = event(7);
        passed_on.details.insert(PASSED_ON.to_owned(), 3.into());
        assert!(is_passed_on(None, &passed_on));
        assert!(!is_passed_on(torso().as_ref(), &passed_on));
        assert!(!is_passed_on(None, &event(7)));
        let mut seen = Seen::default();
        assert_eq!(seen.take(torso(), &event(3)), Order::Next);
        assert_eq!(seen.take(None, &passed_on), Order::Next);
        assert_eq!(seen.take(None, &event(8)), Order::Next);
        assert_eq!(seen.take(torso(), &event(4)), Order::Next);
    }

    #[test]
    fn those_who_ask_for_robots_are_told_of_these_only_whoever_tells_it() {
        let of_gateway = Event { robot: None, ..event(1) };
        let other: RobotName = "left_arm".parse().expect("a name");
        let asked = [other, torso().expect("named")];
        assert!(is_about(&event(1), &asked) && !is_about(&event(1), &asked[..1]));
        assert!(!is_about(&of_gateway, &asked) && is_about(&of_gateway, &[]));
    }

    #[test]
    fn a_new_run_of_the_sender_begins_anew() {
        let mut seen = Seen::default();
        seen.take(torso(), &event(7));
        let restarted = Event { boot_id: Uuid::max(), ..event(0) };
        assert_eq!(seen.take(torso(), &restarted), Order::Next);
    }

    #[test]
    fn an_event_is_one_line() {
        let expected = "14:03:07.125Z WARNING torso #7 fault latched: no feedback for 105 ms";
        assert_eq!(text(&event(7)), expected);
    }
}
