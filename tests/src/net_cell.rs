//! A cell whose robots, gateway and client are on hosts of their own.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result};
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientOptions};
use armada_protocol::messages::{CellStatus, CellVerdict, RobotStatus};
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
    /// Text to add to every robot file.
    pub robot_extra: String,
    /// Text to add to the cell file.
    pub cell_extra: String,
}

impl Default for NetCellOptions {
    /// The two arms, as they are.
    fn default() -> Self {
        let robots = vec!["left_arm", "right_arm"];
        Self { robots, robot_extra: String::new(), cell_extra: String::new() }
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
    /// Starts the cell and waits until every robot is ready.
    ///
    /// # Errors
    /// If it does not come up in time; the error holds what was printed.
    pub async fn start(mut network: Network, options: NetCellOptions) -> Result<Self> {
        let folder = tempfile::tempdir()?;
        network.add_host("gateway")?;
        for robot in &options.robots {
            network.add_host(robot)?;
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
            let emulator =
                host.spawn(folder.path(), &format!("{robot}.emulator"), &["emulator", &file])?;
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
        cell.wait_until_ready().await.with_context(|| cell.printed())?;
        Ok(cell)
    }

    async fn wait_until_ready(&self) -> Result<()> {
        let look = async || {
            let client = self.client().await.ok()?;
            let status = client.cell_status().await.ok();
            client.close();
            let ready = |status: &CellStatus| {
                matches!(status.verdict, CellVerdict::Ready | CellVerdict::Moving)
            };
            status.filter(ready)
        };
        wait_for("every robot is ready", DEADLINE, look).await.map(drop)
    }

    /// A client on the client's host, of the gateway and every agent.
    ///
    /// # Errors
    /// If nobody answers.
    pub async fn client(&self) -> Result<Client> {
        let mut connect = vec![endpoint(&self.network, "gateway")?];
        for robot in self.agents.keys() {
            connect.push(endpoint(&self.network, robot)?);
        }
        let options = ClientOptions { name: "test".to_owned(), connect, namespace: None };
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

    /// Runs a command of the program on the client's host; returns what it printed and its exit
    /// code.
    ///
    /// # Errors
    /// If the program cannot be started or is ended by a signal.
    pub fn run(&self, arguments: &[&str]) -> Result<(String, i32)> {
        // The calling thread is in the client's namespace, and so is what it starts.
        let output = std::process::Command::new(crate::process::armada()?)
            .args(arguments)
            .arg("--cell")
            .arg(self.folder.path().join("cell.yaml"))
            .stdin(std::process::Stdio::null())
            .output()?;
        let printed = [output.stdout, output.stderr].concat();
        let code = output.status.code().context("ended by a signal")?;
        Ok((String::from_utf8_lossy(&printed).into_owned(), code))
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
        let file = fs::read_to_string(config.join(format!("robots/{robot}.yaml")))?
            .replace("urdf: ", &format!("urdf: {}/robots/", config.display()));
        fs::write(folder.join(format!("{robot}.yaml")), file + &options.robot_extra)?;
    }
    cell.push_str(&options.cell_extra);
    fs::write(folder.join("cell.yaml"), cell)?;
    Ok(())
}
