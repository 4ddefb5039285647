//! What the form of the cell file alone does not say.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::messages::Mount;
use armada_protocol::session::DEFAULT_GATEWAY_ENDPOINT;
use serde_saphyr::{Location, Spanned};

use super::error::CellProblem;
use super::file::{CellFile, ClearanceSection, MountSection, RobotSection};
use super::{CellConfig, CellConfigError, ClearanceConfig, Excerpt, MotionTimers, RobotEntry};

/// Most robots one cell may have.
const MAX_ROBOTS: usize = 64;
/// Name, least and greatest value \[ms\] of each timer.
const TIMERS: [(&str, f64, f64); 4] = [
    ("start_lead_ms", 20.0, 5_000.0),
    ("silence_ms", 200.0, 10_000.0),
    ("ending_ms", 500.0, 30_000.0),
    ("clock_budget_ms", 0.1, 50.0),
];
/// Least and greatest distance that can be required \[m\].
const REQUIRED_M: (f64, f64) = (0.001, 1.0);

/// A problem and where it is.
type At<T> = Result<T, (Location, CellProblem)>;

pub(super) fn checked(
    file: CellFile,
    text: &str,
    path: &Path,
) -> Result<CellConfig, CellConfigError> {
    let folder = path.parent().unwrap_or_else(|| Path::new(""));
    config(file, folder).map_err(|(location, problem)| {
        let index = usize::try_from(location.line().saturating_sub(1)).unwrap_or_default();
        let excerpt = Excerpt {
            line: location.line(),
            column: location.column(),
            text: text.lines().nth(index).unwrap_or_default().to_owned(),
            problem,
        };
        CellConfigError::Invalid { path: path.to_owned(), excerpt: Box::new(excerpt) }
    })
}

fn config(file: CellFile, folder: &Path) -> At<CellConfig> {
    let at_cell = file.cell.referenced;
    if file.cell.value.parse::<RobotName>().is_err() {
        return Err((at_cell, CellProblem::CellName(file.cell.value)));
    }
    let namespace = file.namespace.map(checked_namespace).transpose()?;
    let mut endpoints = Endpoints::default();
    let listen = listeners(file.gateway.listen, at_cell, &mut endpoints)?;
    let count = file.robots.0.len();
    if count == 0 || count > MAX_ROBOTS {
        return Err((at_cell, CellProblem::RobotCount { count, limit: MAX_ROBOTS }));
    }
    let parents = file
        .robots
        .0
        .iter()
        .map(|(name, section)| Ok((robot_name(name)?, section.mount.parent.clone())))
        .collect::<At<BTreeMap<_, _>>>()?;
    let mut robots = Vec::with_capacity(count);
    for (name, section) in file.robots.0 {
        let name = robot_name(&name)?;
        endpoints.take(&section.endpoint, name.as_str())?;
        check_mount(&name, &parents)?;
        robots.push(robot(name, section, folder));
    }
    let motion = timers(file.motion)?;
    let clearance = clearance(file.clearance)?;
    Ok(CellConfig { cell: file.cell.value, namespace, listen, robots, motion, clearance })
}

fn robot(name: RobotName, section: RobotSection, folder: &Path) -> RobotEntry {
    let MountSection { parent, pose } = section.mount;
    let parent = parent.map_or_else(|| Mount::default().parent, |parent| parent.value);
    RobotEntry {
        name,
        file: folder.join(section.file),
        endpoint: section.endpoint.value,
        emulate: section.emulate,
        mount: Mount { parent, pose },
    }
}

fn robot_name(name: &Spanned<String>) -> At<RobotName> {
    name.value.parse().map_err(|error| (name.referenced, CellProblem::RobotName(error)))
}

fn checked_namespace(namespace: Spanned<String>) -> At<String> {
    let allowed = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'-' | b'.');
    let is_key =
        |text: &str| text.split('/').all(|chunk| !chunk.is_empty() && chunk.bytes().all(allowed));
    if is_key(&namespace.value) {
        Ok(namespace.value)
    } else {
        Err((namespace.referenced, CellProblem::Namespace(namespace.value)))
    }
}

fn listeners(
    given: Option<Vec<Spanned<String>>>,
    at_cell: Location,
    endpoints: &mut Endpoints,
) -> At<Vec<String>> {
    let Some(listen) = given else {
        endpoints.users.insert(DEFAULT_GATEWAY_ENDPOINT.to_owned(), "the gateway".to_owned());
        return Ok(vec![DEFAULT_GATEWAY_ENDPOINT.to_owned()]);
    };
    if listen.is_empty() {
        return Err((at_cell, CellProblem::NoListener));
    }
    for endpoint in &listen {
        endpoints.take(endpoint, "the gateway")?;
    }
    Ok(listen.into_iter().map(|endpoint| endpoint.value).collect())
}

/// Who listens where.
#[derive(Default)]
struct Endpoints {
    users: BTreeMap<String, String>,
}

impl Endpoints {
    fn take(&mut self, endpoint: &Spanned<String>, user: &str) -> At<()> {
        let refuse = |problem| Err((endpoint.referenced, problem));
        if !can_be_dialled(&endpoint.value) {
            return refuse(CellProblem::Endpoint(endpoint.value.clone()));
        }
        match self.users.insert(endpoint.value.clone(), user.to_owned()) {
            None => Ok(()),
            Some(user) => {
                refuse(CellProblem::EndpointTaken { endpoint: endpoint.value.clone(), user })
            }
        }
    }
}

/// Whether others can be told this endpoint: a port chosen by the system is of no use to them.
fn can_be_dialled(endpoint: &str) -> bool {
    if let Some(path) = endpoint.strip_prefix("unixsock-stream/") {
        return !path.is_empty();
    }
    let Some(address) = endpoint.strip_prefix("tcp/") else { return false };
    let Some((host, port)) = address.rsplit_once(':') else { return false };
    !host.is_empty() && port.parse::<u16>().is_ok_and(|port| port != 0)
}

/// Follows the mounts from `robot` to the world.
fn check_mount(
    robot: &RobotName,
    parents: &BTreeMap<RobotName, Option<Spanned<String>>>,
) -> At<()> {
    let mut current = robot;
    let mut at = Location::UNKNOWN;
    // As many steps as there are robots reach the world, or there is a circle.
    for _ in 0..=parents.len() {
        let Some(Some(parent)) = parents.get(current) else { return Ok(()) };
        at = parent.referenced;
        match robot_of_parent(parent, parents)? {
            Some(next) => current = next,
            None => return Ok(()),
        }
    }
    let at = parents.get(robot).and_then(Option::as_ref).map_or(at, |parent| parent.referenced);
    Err((at, CellProblem::MountCycle(robot.to_string())))
}

fn robot_of_parent<'p>(
    parent: &Spanned<String>,
    parents: &'p BTreeMap<RobotName, Option<Spanned<String>>>,
) -> At<Option<&'p RobotName>> {
    let text = &parent.value;
    if text == "world" {
        return Ok(None);
    }
    let (robot, link) = text.split_once('/').unwrap_or((text, ""));
    if robot.is_empty() || link.is_empty() {
        return Err((parent.referenced, CellProblem::MountForm(text.clone())));
    }
    let found = parents.keys().find(|name| name.as_str() == robot);
    found.map(Some).ok_or_else(|| {
        let known = parents.keys().map(RobotName::as_str).collect::<Vec<_>>().join(", ");
        let (parent_text, robot) = (text.clone(), robot.to_owned());
        (parent.referenced, CellProblem::MountRobot { parent: parent_text, robot, known })
    })
}

fn timers(given: BTreeMap<String, Spanned<f64>>) -> At<MotionTimers> {
    let mut timers = MotionTimers::default();
    for (name, value) in given {
        let Some((_, low, high)) = TIMERS.into_iter().find(|(known, ..)| *known == name) else {
            let known = TIMERS.map(|(known, ..)| known).join(", ");
            return Err((value.referenced, CellProblem::TimerUnknown { name, known }));
        };
        if !(low..=high).contains(&value.value) {
            let problem = CellProblem::TimerRange { name, value: value.value, low, high };
            return Err((value.referenced, problem));
        }
        let duration = Duration::from_secs_f64(1e-3 * value.value);
        match name.as_str() {
            "start_lead_ms" => timers.start_lead = duration,
            "silence_ms" => timers.silence = duration,
            "clock_budget_ms" => timers.clock_budget = duration,
            _ => timers.ending = duration,
        }
    }
    Ok(timers)
}

fn clearance(section: ClearanceSection) -> At<ClearanceConfig> {
    let mut clearance = ClearanceConfig::default();
    if let Some(required) = section.required_m {
        let ((low, high), value) = (REQUIRED_M, required.value);
        if !(low..=high).contains(&value) {
            return Err((required.referenced, CellProblem::RequiredRange { value, low, high }));
        }
        clearance.required_m = value;
    }
    clearance.check = section.check.unwrap_or(clearance.check);
    Ok(clearance)
}
