//! The processes of a cell: started from the main thread, their log lines, their ends.

use std::ffi::OsString;
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::process::{ExitStatus, Stdio};
use std::time::Duration;

use anyhow::Context as _;
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};
use tokio::io::{AsyncBufReadExt as _, AsyncRead, BufReader};
use tokio::process::{Child, Command};
use tokio::sync::mpsc;
use tokio::time::{Instant, timeout_at};

use super::preflight::Cell;
use crate::clock;
use crate::logging::LogFormat;
use crate::output::note;

/// What a process of a cell is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The controller's side of a robot.
    Emulator,
    /// A robot's agent.
    Agent,
    /// The gateway.
    Gateway,
}

/// A process that has ended.
#[derive(Clone, Debug)]
pub(super) struct Ended {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// Its exit status in words.
    pub(super) how: String,
}

/// The processes of a cell.
#[derive(Debug)]
pub(super) struct Children {
    running: Vec<Running>,
    log_dir: Option<PathBuf>,
    log_format: LogFormat,
    report: mpsc::Sender<(u32, String)>,
    ends: mpsc::Receiver<(u32, String)>,
}

#[derive(Debug)]
struct Running {
    name: String,
    kind: Kind,
    pid: u32,
    /// Means this process for ever, where the number may come to mean another one.
    handle: OwnedFd,
}

impl Children {
    /// No process yet. Logs go into files in `log_dir`, or else to standard error.
    ///
    /// # Errors
    /// If the folder cannot be made.
    pub(super) fn new(log_dir: Option<PathBuf>, log_format: LogFormat) -> anyhow::Result<Self> {
        if let Some(folder) = &log_dir {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("cannot make {}", folder.display()))?;
        }
        let (report, ends) = mpsc::channel(64);
        Ok(Self { running: Vec::new(), log_dir, log_format, report, ends })
    }

    /// Starts every process of the cell. Call it on the main thread: the kernel ties the children
    /// to the thread that starts them.
    ///
    /// # Errors
    /// If one cannot be started; those before it run.
    pub(super) fn start(&mut self, cell: &Cell, insecure_lan: bool) -> anyhow::Result<()> {
        for (robot, vendor) in cell.config.robots.iter().zip(&cell.vendors) {
            if robot.emulate {
                let name = format!("{}-emulator", robot.name);
                let args = ["emulator".into(), (*vendor).into(), robot.file.clone().into()];
                self.spawn(name, Kind::Emulator, args.to_vec())?;
            }
        }
        let mut gateway = vec!["gateway".into(), cell.path.clone().into()];
        gateway.extend(insecure_lan.then(|| "--insecure-lan".into()));
        self.spawn("gateway".to_owned(), Kind::Gateway, gateway)?;
        for index in 0..cell.config.robots.len() {
            let Some((name, args)) = agent_args(cell, index, insecure_lan) else { continue };
            self.spawn(name, Kind::Agent, args)?;
        }
        Ok(())
    }

    fn spawn(&mut self, name: String, kind: Kind, args: Vec<OsString>) -> anyhow::Result<()> {
        let program = std::env::current_exe().context("cannot find this program")?;
        let log_format = match self.log_format {
            LogFormat::Text => "text",
            LogFormat::Json => "json",
        };
        let mut child = Command::new(program)
            .args(["--log-format", log_format])
            .args(args)
            .arg("--parent")
            .arg(std::process::id().to_string())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(self.log_of(&name)?)
            // Ctrl-C on the terminal is for the supervisor, which ends the children in order.
            .process_group(0)
            .kill_on_drop(true)
            .spawn()
            .with_context(|| format!("cannot start {name}"))?;
        let pid = child.id().unwrap_or_default();
        let known = i32::try_from(pid).ok().and_then(Pid::from_raw);
        let known = known.with_context(|| format!("{name} has no process number"))?;
        let handle = pidfd_open(known, PidfdFlags::empty())
            .with_context(|| format!("cannot hold on to {name}"))?;
        let prefix = match self.log_format {
            LogFormat::Text => format!("{name:<18}| "),
            LogFormat::Json => String::new(),
        };
        let lines = [
            child.stdout.take().map(|pipe| copy_lines(pipe, prefix.clone())).map(start),
            child.stderr.take().map(|pipe| copy_lines(pipe, prefix)).map(start),
        ];
        start(wait_for(child, pid, lines, self.report.clone()));
        self.running.push(Running { name, kind, pid, handle });
        Ok(())
    }

    fn log_of(&self, name: &str) -> anyhow::Result<Stdio> {
        let Some(folder) = &self.log_dir else { return Ok(Stdio::piped()) };
        let path = folder.join(format!("{name}.log"));
        let file = std::fs::File::create(&path)
            .with_context(|| format!("cannot write {}", path.display()))?;
        Ok(file.into())
    }

    /// Waits for the next process that ends; forever if none runs.
    pub(super) async fn next_end(&mut self) -> Ended {
        loop {
            let Some((pid, how)) = self.ends.recv().await else { std::future::pending().await };
            let index = self.running.iter().position(|child| child.pid == pid);
            if let Some(index) = index {
                let Running { name, kind, .. } = self.running.swap_remove(index);
                return Ended { name, kind, how };
            }
        }
    }

    /// Whether every process has ended.
    pub(super) fn none_left(&self) -> bool {
        self.running.is_empty()
    }

    /// Whether the process of this name has not ended.
    pub(super) fn is_running(&self, name: &str) -> bool {
        self.running.iter().any(|child| child.name == name)
    }

    /// The process of this name, for people.
    pub(super) fn pid_of(&self, name: &str) -> String {
        let found = self.running.iter().find(|child| child.name == name);
        found.map_or_else(|| "ended".to_owned(), |child| child.pid.to_string())
    }

    /// Asks every process of a kind to end, and waits for it; returns those that have not.
    pub(super) async fn end(&mut self, kind: Kind, patience: Duration) -> Vec<String> {
        self.signal(|child| child.kind == kind, Signal::TERM);
        let deadline = Instant::from_std(clock::now() + patience);
        while self.running.iter().any(|child| child.kind == kind) {
            let Ok(ended) = timeout_at(deadline, self.next_end()).await else { break };
            if ended.how != EXIT_0 {
                note(format_args!("{}: {}", ended.name, ended.how));
            }
        }
        let left = self.running.iter().filter(|child| child.kind == kind);
        left.map(|child| child.name.clone()).collect()
    }

    /// Kills every process that is left and waits for it.
    pub(super) async fn kill(&mut self) {
        self.signal(|_| true, Signal::KILL);
        while !self.none_left() {
            self.next_end().await;
        }
    }

    fn signal(&self, which: impl Fn(&Running) -> bool, signal: Signal) {
        for child in self.running.iter().filter(|child| which(child)) {
            // One that has just ended cannot be signalled, and need not be.
            pidfd_send_signal(&child.handle, signal).ok();
        }
    }
}

/// An end that needs no words.
const EXIT_0: &str = "exit code 0";

fn agent_args(cell: &Cell, index: usize, insecure_lan: bool) -> Option<(String, Vec<OsString>)> {
    let robot = cell.config.robots.get(index)?;
    let mut args: Vec<OsString> = vec![
        "agent".into(),
        robot.file.clone().into(),
        "--listen".into(),
        (&robot.endpoint).into(),
        "--state-dir".into(),
        cell.state_dir.clone().into(),
    ];
    // Agents are linked to each other so that a stop needs no gateway; the smaller name dials.
    let partners = cell.config.robots.iter().filter(|other| other.name > robot.name);
    let dialled = cell.config.listen.iter().chain(partners.map(|partner| &partner.endpoint));
    for endpoint in dialled {
        args.extend(["--connect".into(), endpoint.into()]);
    }
    if let Some(namespace) = &cell.config.namespace {
        args.extend(["--namespace".into(), namespace.into()]);
    }
    args.extend(insecure_lan.then(|| "--insecure-lan".into()));
    Some((robot.name.to_string(), args))
}

/// Waits for the process and then for its last lines, so that they come before its end is told.
async fn wait_for(
    mut child: Child,
    pid: u32,
    lines: [Option<tokio::task::JoinHandle<()>>; 2],
    report: mpsc::Sender<(u32, String)>,
) {
    let status = child.wait().await;
    for copied in lines.into_iter().flatten() {
        drop(copied.await);
    }
    let how = match status {
        Ok(status) => in_words(status),
        Err(error) => format!("its end cannot be seen: {error}"),
    };
    // When nobody takes it, the supervisor itself is ending.
    drop(report.send((pid, how)).await);
}

fn in_words(status: ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt as _;
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("exit code {code}"),
        (None, Some(signal)) => format!("killed by signal {signal}"),
        (None, None) => status.to_string(),
    }
}

async fn copy_lines(pipe: impl AsyncRead + Unpin, prefix: String) {
    let mut lines = BufReader::new(pipe);
    let mut line = Vec::new();
    while matches!(lines.read_until(b'\n', &mut line).await, Ok(read) if read > 0) {
        note(format_args!("{prefix}{}", String::from_utf8_lossy(&line).trim_end()));
        line.clear();
    }
}

#[expect(clippy::disallowed_methods, reason = "a command line is runtime code")]
fn start<F: Future<Output = ()> + Send + 'static>(task: F) -> tokio::task::JoinHandle<()> {
    tokio::spawn(task)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exit_status_is_told_in_words() {
        use std::os::unix::process::ExitStatusExt as _;
        assert_eq!(in_words(ExitStatus::from_raw(0)), EXIT_0);
        assert_eq!(in_words(ExitStatus::from_raw(3 << 8)), "exit code 3");
        assert_eq!(in_words(ExitStatus::from_raw(9)), "killed by signal 9");
    }

    #[test]
    fn each_pair_of_agents_is_linked_by_the_smaller_name_only() {
        let text = "cell: test\nrobots:\n  b: {file: b.yaml, endpoint: tcp/127.0.0.1:2}\n  \
                    a: {file: a.yaml, endpoint: tcp/127.0.0.1:1}\n";
        let path = PathBuf::from("cell.yaml");
        let config = armada_gateway::config::CellConfig::parse(text, &path).expect("valid");
        let (state_dir, vendors) = (PathBuf::from("state"), vec!["sim", "sim"]);
        let cell = Cell { path, config, vendors, state_dir, demo: None };
        let dialled = |index| {
            let (_, args) = agent_args(&cell, index, false).expect("a robot");
            let text: Vec<_> = args.iter().map(|arg| arg.to_string_lossy().into_owned()).collect();
            let connects = text.windows(2).filter(|pair| pair[0] == "--connect");
            connects.map(|pair| pair[1].clone()).collect::<Vec<_>>()
        };
        assert_eq!(dialled(0), ["tcp/127.0.0.1:7447"]);
        assert_eq!(dialled(1), ["tcp/127.0.0.1:7447", "tcp/127.0.0.1:2"]);
    }
}
