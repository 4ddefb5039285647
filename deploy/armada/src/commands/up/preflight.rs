//! Everything that can be known before anything starts.

use std::net::{TcpListener, UdpSocket};
use std::path::PathBuf;

use armada_agent::config::RobotConfig;
use armada_agent::drivers::Endpoint;
use armada_gateway::config::{CellConfig, RobotEntry};
use armada_model::RobotModel;

use super::UpArgs;
use crate::commands::process::emulator;
use crate::commands::run::Plan;
use crate::exit::UsageError;
use crate::state_dir;

/// A cell whose files are valid and whose ports are free.
#[derive(Debug)]
pub(super) struct Cell {
    /// The cell file's path, absolute.
    pub(super) path: PathBuf,
    /// What it says.
    pub(super) config: CellConfig,
    /// Vendor of each robot, in the order of the cell file.
    pub(super) vendors: Vec<&'static str>,
    /// Where its agents keep latched stops.
    pub(super) state_dir: PathBuf,
    /// The motion to run again and again.
    pub(super) demo: Option<Plan>,
}

/// A robot whose files are valid.
struct Robot {
    entry: RobotEntry,
    config: RobotConfig,
    model: RobotModel,
}

/// Reads every file and tries every port.
///
/// # Errors
/// One error that tells every problem.
pub(super) fn check(args: &UpArgs) -> anyhow::Result<Cell> {
    let config = CellConfig::load(&args.cell)?;
    let path = std::path::absolute(&args.cell)?;
    let mut problems = Vec::new();
    let mut robots = Vec::new();
    for entry in &config.robots {
        match load(entry) {
            Ok(robot) => robots.push(robot),
            Err(error) => problems.push(format!("robot {}: {error:#}", entry.name)),
        }
    }
    let demo = args.demo.as_deref().map(|file| Plan::load(file, None)).transpose();
    let demo = demo.unwrap_or_else(|error| {
        problems.push(format!("{error:#}"));
        None
    });
    problems.extend(robots.iter().filter_map(|robot| mount_problem(robot, &robots)));
    if let Some(plan) = &demo
        && robots.len() == config.robots.len()
    {
        problems.extend(demo_problems(plan, &robots));
    }
    problems.extend(taken_ports(&config, &robots));
    if !problems.is_empty() {
        return Err(UsageError(in_words(&problems)).into());
    }
    let vendors = robots.iter().map(|robot| robot.config.driver.vendor()).collect();
    let state_dir = state_dir::or_default(args.state_dir.clone())?;
    let state_dir = std::path::absolute(state_dir::of_cell(&state_dir, &config.cell))?;
    Ok(Cell { path, config, vendors, state_dir, demo })
}

fn in_words(problems: &[String]) -> String {
    let list = problems.join("\n  ");
    format!("nothing was started, for {} problem(s):\n  {list}", problems.len())
}

fn load(entry: &RobotEntry) -> anyhow::Result<Robot> {
    let config = RobotConfig::load(&entry.file)?;
    if config.robot != entry.name {
        anyhow::bail!("{} is the file of robot {}", entry.file.display(), config.robot);
    }
    let (_, model) = config.read_urdf()?;
    config.joint_infos(&model)?;
    config.chain_infos(&model)?;
    Ok(Robot { entry: entry.clone(), config, model })
}

fn mount_problem(robot: &Robot, robots: &[Robot]) -> Option<String> {
    let parent = &robot.entry.mount.parent;
    let (carrier, link) = parent.split_once('/')?;
    let carrier = robots.iter().find(|robot| robot.entry.name.as_str() == carrier)?;
    let unknown = carrier.model.link_index(link).is_none();
    unknown.then(|| {
        format!("robot {}: mount parent {parent}: there is no such link", robot.entry.name)
    })
}

fn demo_problems(plan: &Plan, robots: &[Robot]) -> Vec<String> {
    let known = |robot: &armada_protocol::RobotName, joint: &str| {
        let found = robots.iter().find(|known| &known.entry.name == robot);
        found.is_some_and(|found| found.config.joints.iter().any(|known| known.name == joint))
    };
    let mut problems = Vec::new();
    for part in plan.parts() {
        for joint in part.joints().filter(|joint| !known(&part.robot, joint)) {
            problems.push(format!("demo: the cell has no joint {}/{joint}", part.robot));
        }
    }
    problems
}

fn taken_ports(config: &CellConfig, robots: &[Robot]) -> Vec<String> {
    let mut problems = Vec::new();
    let mut try_tcp = |endpoint: &str, user: &str| {
        let Some(address) = endpoint.strip_prefix("tcp/") else { return };
        if let Err(error) = TcpListener::bind(address) {
            problems.push(format!("{endpoint} of {user} cannot be listened on: {error}"));
        }
    };
    config.listen.iter().for_each(|endpoint| try_tcp(endpoint, "the gateway"));
    for robot in &config.robots {
        try_tcp(&robot.endpoint, &format!("agent {}", robot.name));
    }
    for robot in robots.iter().filter(|robot| robot.entry.emulate) {
        problems.extend(emulator_problem(robot));
    }
    problems
}

fn emulator_problem(robot: &Robot) -> Option<String> {
    let emulator = match emulator::build(&robot.config) {
        Ok(emulator) => emulator,
        Err(error) => return Some(format!("emulator of {}: {error:#}", robot.entry.name)),
    };
    emulator.endpoints().iter().find_map(|endpoint| match endpoint {
        Endpoint::UdpAt { local } => UdpSocket::bind(local).err().map(|error| {
            let name = &robot.entry.name;
            format!("udp {local} of the emulator of {name} cannot be listened on: {error}")
        }),
        Endpoint::UdpTo { .. } => None,
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::time::Duration;

    use super::*;

    fn args(cell: &Path) -> UpArgs {
        UpArgs {
            cell: cell.to_owned(),
            demo: None,
            log_dir: None,
            ready_timeout: Duration::from_secs(1),
            insecure_lan: false,
            state_dir: Some(cell.with_extension("state")),
        }
    }

    #[test]
    fn every_problem_is_told_at_once() {
        let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
        let port = taken.local_addr().expect("bound").port();
        let folder = tempfile::tempdir().expect("a directory");
        let path = folder.path().join("cell.yaml");
        let text = format!(
            "cell: test\ngateway: {{listen: [tcp/127.0.0.1:{port}]}}\nrobots:\n  \
             arm: {{file: missing.yaml, endpoint: unixsock-stream//nowhere/a.sock}}\n"
        );
        std::fs::write(&path, text).expect("written");
        let error = check(&args(&path)).expect_err("two problems").to_string();
        assert!(error.starts_with("nothing was started, for 2 problem(s)"), "{error}");
        assert!(error.contains("robot arm: ") && error.contains("missing.yaml"), "{error}");
        assert!(error.contains(&format!("tcp/127.0.0.1:{port} of the gateway")), "{error}");
    }
}
