//! A cell whose robots, gateway and client are on hosts of their own.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientOptions};
use armada_protocol::messages::{CellVerdict, RobotStatus};
use tempfile::TempDir;

use crate::net::{HostProcess, Network};
use crate::wait::{DEADLINE, wait_for};

/// Port of every agent, each on its own host.
const AGENT_PORT: u16 = 7451;
/// Port of the gateway.
const GATEWAY_PORT: u16 = 7447;

/// How a cell on several hosts is made.
#[derive(Clone, Debug)]
pub struct NetCellOptions {
    /// The robots, of the default cell.
    pub robots: Vec<&'static str>,
    /// How often each robot publishes its state \[Hz\].
    pub state_rate_hz: u32,
    /// What else every robot file says.
    pub edit_robot: fn(String) -> String,
    /// Text to add to the cell file.
    pub cell_extra: String,
    /// Hosts with nothing on them yet, besides those of the cell.
    pub hosts: Vec<&'static str>,
    /// Whether the robots come up stopped, so that the cell is not ready by itself.
    pub stopped_at_start: bool,
}

impl Default for NetCellOptions {
    /// The two arms, with states every 4 ms.
    fn default() -> Self {
        let robots = vec!["left_arm", "right_arm"];
        let (edit_robot, cell_extra) = (std::convert::identity as fn(_) -> _, String::new());
        Self {
            robots,
            state_rate_hz: 250,
            edit_robot,
            cell_extra,
            hosts: Vec::new(),
            stopped_at_start: false,
        }
    }
}

/// A cell on several hosts; each robot's agent and emulator share one.
#[derive(Debug)]
pub struct NetCell {
    /// The agents; before the network, so that they end first.
    pub agents: BTreeMap<String, HostProcess>,
    /// The emulators of the robots' controllers.
    pub emulators: BTreeMap<String, HostProcess>,
    /// The gateway.
    pub gateway: HostProcess,
    /// The network.
    pub network: Network,
    folder: TempDir,
}

impl NetCell {
    /// Starts the cell and waits until every robot is ready, or stopped.
    ///
    /// # Errors
    /// If it does not come up in time; the error holds what was printed.
    pub async fn start(mut network: Network, options: NetCellOptions) -> Result<Self> {
        let folder = tempfile::tempdir()?;
        network.add_host("gateway")?;
        for host in options.robots.iter().chain(&options.hosts) {
            network.add_host(host)?;
        }
        write_files(folder.path(), &network, &options)?;
        let path = |name: &str| folder.path().join(name).display().to_string();
        let (mut agents, mut emulators) = (BTreeMap::new(), BTreeMap::new());
        let gateway = network.host("gateway")?.spawn(
            folder.path(),
            "gateway",
            &["gateway", &path("cell.yaml"), "--insecure-lan"],
        )?;
        for (index, &robot) in options.robots.iter().enumerate() {
            let (host, file) = (network.host(robot)?, path(&format!("{robot}.yaml")));
            let emulator = host.spawn(
                folder.path(),
                &format!("{robot}.emulator"),
                &["emulator", "sim", &file],
            )?;
            emulators.insert(robot.to_owned(), emulator);
            // One side of each pair dials, the earlier one.
            let others = options.robots.iter().skip(index + 1);
            let mut dialled = vec![endpoint(&network, "gateway")?];
            for other in others {
                dialled.push(endpoint(&network, other)?);
            }
            let listen = endpoint(&network, robot)?;
            let mut arguments = vec!["agent", &file, "--insecure-lan", "--listen", &listen];
            for other in &dialled {
                arguments.extend(["--connect", other]);
            }
            agents.insert(robot.to_owned(), host.spawn(folder.path(), robot, &arguments)?);
        }
        let cell = Self { agents, emulators, gateway, network, folder };
        let up = cell.wait_until_up(options.stopped_at_start).await;
        up.with_context(|| cell.printed())?;
        Ok(cell)
    }

    async fn wait_until_up(&self, stopped: bool) -> Result<()> {
        let client = async || self.client().await.ok();
        let client = wait_for("the cell answers", DEADLINE, client).await?;
        let ready = wait_for("the cell is up", DEADLINE, async || {
            let status = client.cell_status().await.ok()?;
            let up = match stopped {
                true => status.robots.values().all(|robot| robot.stop.is_some()),
                false => status.verdict == CellVerdict::Ready,
            };
            up.then_some(())
        });
        let ready = ready.await;
        client.close();
        ready
    }

    /// A client on the client's host, of the gateway and every agent.
    ///
    /// # Errors
    /// If nobody answers.
    pub async fn client(&self) -> Result<Client> {
        let robots = self.agents.keys().map(String::as_str);
        let all: Vec<_> = std::iter::once("gateway").chain(robots).collect();
        self.client_of("test", &all).await
    }

    /// A client on the client's host with a name, of these hosts only: of one, it reaches what that
    /// one reaches.
    ///
    /// # Errors
    /// If nobody answers.
    pub async fn client_of(&self, name: &str, hosts: &[&str]) -> Result<Client> {
        let connect =
            hosts.iter().map(|host| endpoint(&self.network, host)).collect::<Result<_>>()?;
        let options = ClientOptions { name: name.to_owned(), connect, namespace: None };
        Ok(Client::connect(options).await?)
    }

    /// The names of the robots.
    ///
    /// # Errors
    /// Never: they are names of the default cell.
    pub fn robots(&self) -> Result<Vec<RobotName>> {
        self.agents.keys().map(|name| Ok(name.parse()?)).collect()
    }

    /// The agent of a robot.
    ///
    /// # Errors
    /// If there is no such robot.
    pub fn agent(&mut self, robot: &str) -> Result<&mut HostProcess> {
        self.agents.get_mut(robot).context("a robot of the cell")
    }

    /// The emulator of a robot.
    ///
    /// # Errors
    /// If there is no such robot.
    pub fn emulator(&mut self, robot: &str) -> Result<&mut HostProcess> {
        self.emulators.get_mut(robot).context("a robot of the cell")
    }

    /// A robot's status as soon as it satisfies `condition`.
    ///
    /// # Errors
    /// If that does not come in time; the error holds the last status.
    pub async fn status_when(
        &self,
        client: &Client,
        robot: &RobotName,
        what: &str,
        condition: impl Fn(&RobotStatus) -> bool,
    ) -> Result<RobotStatus> {
        let last = std::sync::Mutex::new(None);
        let look = async || {
            let status = client.robot_status(robot).await.ok()?;
            let fits = condition(&status);
            if let Ok(mut last) = last.lock() {
                *last = Some(status.clone());
            }
            fits.then_some(status)
        };
        let found = wait_for(what, PATIENCE, look).await;
        found.with_context(|| format!("last status of {robot}: {last:#?}"))
    }

    /// Runs a command of the program on the client's host, for this cell; returns what it printed
    /// and its exit code.
    ///
    /// # Errors
    /// If the program cannot be started or is ended by a signal.
    pub fn run(&self, arguments: &[&str]) -> Result<(String, i32)> {
        let cell = self.cell_file();
        self.network.host("client")?.run(&[arguments, &["--cell", &cell]].concat())
    }

    /// Starts a command of the program on a host, for this cell; it runs until it is killed or
    /// dropped.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn spawn(&self, host: &str, name: &str, arguments: &[&str]) -> Result<HostProcess> {
        let cell = self.cell_file();
        let arguments = [arguments, &["--cell", &cell]].concat();
        self.network.host(host)?.spawn(self.folder.path(), name, &arguments)
    }

    /// Does something to the emulated controller of a robot, such as `estop`.
    ///
    /// # Errors
    /// If the emulator does not take it.
    pub fn inject(&self, robot: &str, fault: &str) -> Result<()> {
        let file = fs::read_to_string(self.folder.path().join(format!("{robot}.yaml")))?;
        let address = file.lines().find_map(|line| line.trim().strip_prefix("address: "));
        let address = address.context("a robot file with an address")?;
        let arguments = ["emulator", "inject", address, fault];
        let (printed, code) = self.network.host(robot)?.run(&arguments)?;
        ensure!(code == 0, "{robot}: {fault}: {printed}");
        Ok(())
    }

    fn cell_file(&self) -> String {
        self.folder.path().join("cell.yaml").display().to_string()
    }

    /// What all processes have printed.
    #[must_use]
    pub fn printed(&self) -> String {
        let agents = self.agents.iter().chain(&self.emulators);
        let agents = agents.map(|(robot, process)| format!("{robot}:\n{}", process.printed()));
        let gateway = format!("gateway:\n{}", self.gateway.printed());
        agents.chain([gateway]).collect::<Vec<_>>().join("\n")
    }

    /// The folder of its files.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }
}

/// How long a condition may take when links are bad and processes restart.
const PATIENCE: Duration = Duration::from_secs(40);

fn endpoint(network: &Network, host: &str) -> Result<String> {
    let port = if host == "gateway" { GATEWAY_PORT } else { AGENT_PORT };
    Ok(format!("tcp/{}:{port}", network.host(host)?.address()))
}

fn write_files(folder: &Path, network: &Network, options: &NetCellOptions) -> Result<()> {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config").canonicalize()?;
    let mut cell =
        format!("cell: matrix\ngateway:\n  listen: [{}]\nrobots:\n", endpoint(network, "gateway")?);
    for (index, robot) in options.robots.iter().enumerate() {
        let side = if index % 2 == 0 { 1.0 } else { -1.0 };
        cell.push_str(&format!(
            "  {robot}:\n    file: {robot}.yaml\n    endpoint: {}\n    mount:\n      pose:\n        \
             position_m: {{ x: {}, y: {}, z: 0.75 }}\n        \
             orientation: {{ w: 0, x: 0, y: 0, z: 1 }}\n",
            endpoint(network, robot)?,
            -1.5 * f64::from(u32::try_from(index / 2)?),
            side * 0.45,
        ));
        let rate = format!("state_rate_hz: {}", options.state_rate_hz);
        let file = fs::read_to_string(config.join(format!("robots/{robot}.yaml")))?
            .replace("state_rate_hz: 100", &rate)
            .replace("urdf: ", &format!("urdf: {}/robots/", config.display()));
        fs::write(folder.join(format!("{robot}.yaml")), (options.edit_robot)(file))?;
    }
    cell.push_str(&options.cell_extra);
    fs::write(folder.join("cell.yaml"), cell)?;
    Ok(())
}
