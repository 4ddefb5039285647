//! A cell of real processes.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientOptions};
use armada_protocol::messages::{CellStatus, CellVerdict};
use tempfile::TempDir;

use crate::ports::Ports;
use crate::process::{armada, children_of, is_running, kill, terminate};
use crate::wait::{DEADLINE, wait_for};

const ROBOTS: [&str; 3] = ["left_arm", "right_arm", "torso"];

/// How a cell is started.
#[derive(Clone, Debug, Default)]
pub struct CellOptions {
    /// Whether the demo motion runs.
    pub demo: bool,
    /// What is replaced in the robot files, and with what; each must be in one of them.
    pub robot_files: &'static [(&'static str, &'static str)],
}

/// The default cell on ports of its own, started by `armada up`.
#[derive(Debug)]
pub struct Cell {
    folder: TempDir,
    ports: Ports,
    up: Child,
}

impl Cell {
    /// Starts the cell and waits until every robot is ready.
    ///
    /// # Errors
    /// If it does not come up in time; the error holds what it printed.
    pub async fn start(options: CellOptions) -> Result<Self> {
        let folder = tempfile::tempdir()?;
        let ports = Ports::free(ROBOTS.len())?;
        write_files(folder.path(), &ports, &options)?;
        let up = spawn_up(folder.path(), &options)?;
        let cell = Self { folder, ports, up };
        let ready = cell.wait_until_online().await;
        ready.with_context(|| format!("armada up printed:\n{}", cell.printed()))?;
        Ok(cell)
    }

    async fn wait_until_online(&self) -> Result<()> {
        let client = wait_for("the gateway answers", DEADLINE, || self.try_client()).await?;
        let ready = |status: &CellStatus| {
            matches!(status.verdict, CellVerdict::Ready | CellVerdict::Moving)
        };
        self.status_when(&client, "every robot is ready", DEADLINE, ready).await?;
        client.close();
        // Before it says so, the supervisor takes the end of a process for a failed start.
        let told = async || self.printed().contains("is ready").then_some(());
        wait_for("armada up says that the cell is ready", DEADLINE, told).await
    }

    async fn try_client(&self) -> Option<Client> {
        Client::connect(self.client_options()).await.ok()
    }

    /// A client of the gateway and every agent.
    ///
    /// # Errors
    /// If nobody answers.
    pub async fn client(&self) -> Result<Client> {
        Ok(Client::connect(self.client_options()).await?)
    }

    /// A client that knows only the gateway.
    ///
    /// # Errors
    /// If it does not answer.
    pub async fn routed_client(&self) -> Result<Client> {
        let mut options = self.client_options();
        options.connect.truncate(1);
        Ok(Client::connect(options).await?)
    }

    fn client_options(&self) -> ClientOptions {
        let connect = self.endpoints();
        ClientOptions { name: "test".to_owned(), connect, namespace: None }
    }

    /// Endpoints of the gateway and the agents.
    #[must_use]
    pub fn endpoints(&self) -> Vec<String> {
        let ports = std::iter::once(self.ports.gateway).chain(self.ports.agents.iter().copied());
        ports.map(|port| format!("tcp/127.0.0.1:{port}")).collect()
    }

    /// The cell's status as soon as it satisfies `condition`.
    ///
    /// # Errors
    /// If the deadline passes; the error holds the last status.
    pub async fn status_when(
        &self,
        client: &Client,
        what: &str,
        deadline: Duration,
        condition: impl Fn(&CellStatus) -> bool,
    ) -> Result<CellStatus> {
        let last = std::sync::Mutex::new(None);
        let look = async || {
            let status = client.cell_status().await.ok()?;
            let fits = condition(&status);
            if let Ok(mut last) = last.lock() {
                *last = Some(status.clone());
            }
            fits.then_some(status)
        };
        let found = wait_for(what, deadline, look).await;
        found.with_context(|| format!("last status: {last:#?}"))
    }

    /// Names of the robots.
    ///
    /// # Errors
    /// Never: the names are fixed.
    pub fn robots(&self) -> Result<Vec<RobotName>> {
        ROBOTS.iter().map(|name| Ok(name.parse()?)).collect()
    }

    /// Process id of `armada up`.
    #[must_use]
    pub fn up_pid(&self) -> u32 {
        self.up.id()
    }

    /// Process ids of everything `armada up` has started.
    ///
    /// # Errors
    /// If the list of processes cannot be read.
    pub fn processes(&self) -> Result<Vec<u32>> {
        Ok(children_of(self.up.id())?.into_iter().map(|(pid, _)| pid).collect())
    }

    /// Process id of the gateway.
    ///
    /// # Errors
    /// If it does not run.
    pub fn gateway_pid(&self) -> Result<u32> {
        self.find(&[" gateway "])
    }

    /// Process id of a robot's agent.
    ///
    /// # Errors
    /// If it does not run.
    pub fn agent_pid(&self, robot: &str) -> Result<u32> {
        self.find(&[" agent ", &format!("{robot}.yaml")])
    }

    /// Process id of a robot's emulator.
    ///
    /// # Errors
    /// If it does not run.
    pub fn emulator_pid(&self, robot: &str) -> Result<u32> {
        self.find(&[" emulator ", &format!("{robot}.yaml")])
    }

    fn find(&self, words: &[&str]) -> Result<u32> {
        let children = children_of(self.up.id())?;
        let fits = |command: &str| words.iter().all(|word| command.contains(word));
        match children.iter().find(|(_, command)| fits(command)) {
            Some((pid, _)) => Ok(*pid),
            None => bail!("no process with {words:?} among {children:#?}"),
        }
    }

    /// Runs a command of the program against this cell; returns what it printed and its exit code.
    ///
    /// # Errors
    /// If the program cannot be started or is ended by a signal.
    pub fn run(&self, arguments: &[&str]) -> Result<(String, i32)> {
        let output = Command::new(armada()?)
            .args(arguments)
            .arg("--cell")
            .arg(self.cell_file())
            .stdin(Stdio::null())
            .output()?;
        let printed = [output.stdout, output.stderr].concat();
        let code = output.status.code().context("ended by a signal")?;
        Ok((String::from_utf8_lossy(&printed).into_owned(), code))
    }

    /// The cell file.
    #[must_use]
    pub fn cell_file(&self) -> PathBuf {
        self.folder.path().join("cell.yaml")
    }

    /// What `armada up` and its processes have printed.
    #[must_use]
    pub fn printed(&self) -> String {
        fs::read_to_string(self.folder.path().join("printed")).unwrap_or_default()
    }

    /// Asks `armada up` to end, as Ctrl-C or a service manager would, and waits for it.
    ///
    /// # Errors
    /// If it does not end in time.
    pub async fn end(&mut self, signal: rustix::process::Signal) -> Result<i32> {
        crate::process::signal(self.up.id(), signal)?;
        let up = &mut self.up;
        let mut look = || up.try_wait().ok().flatten();
        let status = wait_for("armada up ends", DEADLINE, || std::future::ready(look())).await?;
        Ok(status.code().unwrap_or(-1))
    }
}

impl Drop for Cell {
    fn drop(&mut self) {
        let left = self.processes().unwrap_or_default();
        if is_running(self.up.id()) {
            // What cannot be ended now is ended by force below.
            let _ = terminate(self.up.id());
            let deadline = Duration::from_secs(10);
            let waited = std::iter::repeat_n((), 1000).any(|()| {
                std::thread::park_timeout(deadline / 1000);
                matches!(self.up.try_wait(), Ok(Some(_)))
            });
            if !waited {
                let _ = self.up.kill();
            }
        }
        let _ = self.up.wait();
        for pid in left.into_iter().filter(|pid| is_running(*pid)) {
            let _ = kill(pid);
        }
    }
}

fn write_files(folder: &Path, ports: &Ports, options: &CellOptions) -> Result<()> {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config").canonicalize()?;
    let mut cell = fs::read_to_string(config.join("cells/dual_arm.yaml"))?
        .replace("tcp/127.0.0.1:7447", &format!("tcp/127.0.0.1:{}", ports.gateway))
        .replace("../robots/", "");
    let mut replaced = vec![false; options.robot_files.len()];
    for (index, robot) in ROBOTS.iter().enumerate() {
        let (agent, emulator) = (7451 + index, 47101 + index);
        let agent_port = ports.agents.get(index).context("a port")?;
        let emulator_port = ports.emulators.get(index).context("a port")?;
        cell =
            cell.replace(&format!("tcp/127.0.0.1:{agent}"), &format!("tcp/127.0.0.1:{agent_port}"));
        let mut file = fs::read_to_string(config.join(format!("robots/{robot}.yaml")))?
            .replace(&format!("127.0.0.1:{emulator}"), &format!("127.0.0.1:{emulator_port}"))
            .replace("urdf: ", &format!("urdf: {}/robots/", config.display()));
        for ((what, with), replaced) in options.robot_files.iter().zip(&mut replaced) {
            *replaced |= file.contains(what);
            file = file.replace(what, with);
        }
        fs::write(folder.join(format!("{robot}.yaml")), file)?;
    }
    let missing = options.robot_files.iter().zip(replaced).find(|(_, replaced)| !replaced);
    if let Some(((what, _), _)) = missing {
        bail!("{what:?} is in no robot file");
    }
    fs::write(folder.join("cell.yaml"), cell)?;
    Ok(())
}

fn spawn_up(folder: &Path, options: &CellOptions) -> Result<Child> {
    let printed = File::create(folder.join("printed"))?;
    let mut command = Command::new(armada()?);
    command.arg("up").arg(folder.join("cell.yaml")).stdin(Stdio::null());
    command.arg("--state-dir").arg(folder.join("state"));
    command.stdout(printed.try_clone()?).stderr(printed);
    if options.demo {
        let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/motions/handover.json");
        command.arg("--demo").arg(demo);
    }
    Ok(command.spawn()?)
}
