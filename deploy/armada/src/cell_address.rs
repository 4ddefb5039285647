//! Where the cell is: from arguments, a cell file, or the run file of `armada up`.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context as _;
use armada_gateway::config::CellConfig;
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError, ClientOptions};
use armada_protocol::session::DEFAULT_GATEWAY_ENDPOINT;
use clap::{Args, ValueHint};
use uuid::Uuid;

use crate::exit::UsageError;
use crate::output::{Output, note};
use crate::run_file::{self, RunFile};

/// Options of every command that uses a cell.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Cell")]
pub(crate) struct CellArgs {
    /// Zenoh endpoint of the gateway or of an agent, such as `tcp/192.168.1.20:7447`; repeat for
    /// several
    #[arg(long, value_name = "ENDPOINT", value_hint = ValueHint::Other)]
    pub(crate) connect: Vec<String>,
    /// Cell file whose endpoints to use
    #[arg(long, value_name = "CELL.yaml", value_hint = ValueHint::FilePath)]
    pub(crate) cell: Option<PathBuf>,
    /// Prefix of every key of the cell; as in the cell file
    #[arg(long, value_name = "PREFIX")]
    pub(crate) namespace: Option<String>,
    /// Print JSON, for scripts
    #[arg(long)]
    pub(crate) json: bool,
    /// Longest time to wait; each command's own if left out
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub(crate) timeout: Option<Duration>,
    /// Ask under this lease, as `armada lease hold` prints it
    #[arg(long, value_name = "UUID")]
    pub(crate) lease: Option<Uuid>,
}

/// A cell's endpoints.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct CellAddress {
    /// Dialled first.
    pub(crate) first: Vec<String>,
    /// The agents', for when nobody answers there.
    pub(crate) agents: Vec<String>,
    /// Robots the cell must have; empty if not known.
    pub(crate) robots: Vec<RobotName>,
    /// Prefix of every key.
    pub(crate) namespace: Option<String>,
    /// Where this is known from.
    pub(crate) source: Source,
}

/// Where a [`CellAddress`] is known from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// `--connect`.
    Arguments,
    /// `--cell`.
    CellFile(PathBuf),
    /// A cell that was started on this machine.
    Running(String),
    /// Nothing was said.
    Default,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Arguments => f.write_str("--connect"),
            Self::CellFile(path) => write!(f, "cell file {}", path.display()),
            Self::Running(cell) => write!(f, "running cell {cell}"),
            Self::Default => f.write_str("the default endpoint, for no cell runs on this machine"),
        }
    }
}

impl CellArgs {
    /// The output these arguments ask for.
    pub(crate) const fn output(&self) -> Output {
        Output::new(self.json)
    }

    /// `--timeout`, or else `default`.
    pub(crate) fn timeout_or(&self, default: Duration) -> Duration {
        self.timeout.unwrap_or(default)
    }

    /// Where the cell is: `--connect`, else `--cell`, else what runs here, else the default.
    pub(crate) fn address(&self) -> anyhow::Result<CellAddress> {
        let running = run_file::running(&run_file::directory());
        self.resolve(running, |path| Ok(CellAddress::of_cell(CellConfig::load(path)?, path)))
    }

    fn resolve(
        &self,
        running: Vec<RunFile>,
        load: impl FnOnce(&Path) -> anyhow::Result<CellAddress>,
    ) -> anyhow::Result<CellAddress> {
        let mut address = if !self.connect.is_empty() {
            CellAddress {
                first: self.connect.clone(),
                ..CellAddress::of_default(Source::Arguments)
            }
        } else if let Some(path) = &self.cell {
            load(path)?
        } else {
            match <[RunFile; 1]>::try_from(running) {
                Ok([run]) => run.into(),
                Err(none) if none.is_empty() => CellAddress::of_default(Source::Default),
                Err(several) => return Err(several_cells(&several).into()),
            }
        };
        if self.namespace.is_some() {
            address.namespace.clone_from(&self.namespace);
        }
        Ok(address)
    }

    /// Connects to the gateway, or to the agents if it does not answer.
    pub(crate) async fn connect(&self) -> anyhow::Result<(Client, CellAddress)> {
        let address = self.address()?;
        let client = match address.connect(address.first.clone()).await {
            Err(ClientError::NobodyThere { .. }) if !address.agents.is_empty() => {
                note(format_args!(
                    "no gateway at {}: asking the agents directly",
                    address.first.join(", ")
                ));
                address.connect(address.agents.clone()).await
            }
            other => other,
        };
        let client = client.with_context(|| format!("from {}", address.source));
        Ok((client?.under(self.lease), address))
    }
}

impl CellAddress {
    fn of_default(source: Source) -> Self {
        Self {
            first: vec![DEFAULT_GATEWAY_ENDPOINT.to_owned()],
            agents: Vec::new(),
            robots: Vec::new(),
            namespace: None,
            source,
        }
    }

    fn of_cell(config: CellConfig, path: &Path) -> Self {
        Self {
            first: config.listen,
            agents: config.robots.iter().map(|robot| robot.endpoint.clone()).collect(),
            robots: config.robots.into_iter().map(|robot| robot.name).collect(),
            namespace: config.namespace,
            source: Source::CellFile(path.to_owned()),
        }
    }

    /// Connects to the gateway and every agent, whoever answers first: the shortest path of a stop.
    pub(crate) async fn connect_for_stop(&self) -> Result<Client, ClientError> {
        let endpoints = self.first.iter().chain(&self.agents).cloned().collect();
        Client::connect_at_once(self.options(endpoints)).await.map(never_closed)
    }

    async fn connect(&self, endpoints: Vec<String>) -> Result<Client, ClientError> {
        Client::connect(self.options(endpoints)).await.map(never_closed)
    }

    fn options(&self, endpoints: Vec<String>) -> ClientOptions {
        ClientOptions { name: client_name(), connect: endpoints, namespace: self.namespace.clone() }
    }
}

impl From<RunFile> for CellAddress {
    fn from(run: RunFile) -> Self {
        Self {
            first: vec![run.gateway],
            agents: run.robots.iter().map(|robot| robot.endpoint.clone()).collect(),
            robots: run.robots.into_iter().map(|robot| robot.robot).collect(),
            namespace: run.namespace,
            source: Source::Running(run.cell),
        }
    }
}

/// Keeps the session open until the process ends. Closing it would wait up to ten seconds for an
/// endpoint that hangs, with the result printed long ago; whatever was asked has been answered.
fn never_closed(client: Client) -> Client {
    std::mem::forget(client.clone());
    client
}

fn several_cells(running: &[RunFile]) -> UsageError {
    let cells: Vec<_> =
        running.iter().map(|run| format!("{} (--connect {})", run.cell, run.gateway)).collect();
    UsageError(format!("several cells run here, choose one: {}", cells.join(", ")))
}

/// Who asks, for people and the audit trail: `cli-USER-PID`.
pub(crate) fn client_name() -> String {
    format!("cli-{}-{}", rustix::process::getuid().as_raw(), std::process::id())
}

/// Seconds, above zero and at most a day.
pub(crate) fn parse_seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected a number of seconds".to_owned())?;
    if seconds > 0.0 && seconds <= 86_400.0 {
        Ok(Duration::from_secs_f64(seconds))
    } else {
        Err("must be above 0 and at most 86400".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_file::RunRobot;

    fn run(cell: &str, port: u16) -> RunFile {
        RunFile {
            pid: 1,
            cell: cell.to_owned(),
            namespace: Some(cell.to_owned()),
            gateway: format!("tcp/127.0.0.1:{port}"),
            robots: vec![RunRobot {
                robot: "torso".parse().expect("a name"),
                endpoint: format!("tcp/127.0.0.1:{}", port + 1),
            }],
        }
    }

    fn from_file(path: &Path) -> anyhow::Result<CellAddress> {
        let source = Source::CellFile(path.to_owned());
        Ok(CellAddress { first: vec!["tcp/file:1".to_owned()], ..CellAddress::of_default(source) })
    }

    #[test]
    fn connect_comes_before_the_cell_file_and_that_before_what_runs() {
        let mut args = CellArgs {
            connect: vec!["tcp/far:1".to_owned()],
            cell: Some("cell.yaml".into()),
            ..CellArgs::default()
        };
        let resolve = |args: &CellArgs| args.resolve(vec![run("a", 10)], from_file).expect("one");
        assert_eq!(resolve(&args).first, ["tcp/far:1"]);
        args.connect.clear();
        assert_eq!(resolve(&args).first, ["tcp/file:1"]);
        args.cell = None;
        let address = resolve(&args);
        assert_eq!(address.first, ["tcp/127.0.0.1:10"]);
        assert_eq!(address.agents, ["tcp/127.0.0.1:11"]);
        assert_eq!(address.namespace.as_deref(), Some("a"));
    }

    #[test]
    fn without_anything_it_is_the_default_endpoint() {
        let address = CellArgs::default().resolve(vec![], from_file).expect("the default");
        assert_eq!(address.first, [DEFAULT_GATEWAY_ENDPOINT]);
        assert_eq!(address.source, Source::Default);
    }

    #[test]
    fn several_running_cells_are_named_and_none_is_guessed() {
        let error = CellArgs::default()
            .resolve(vec![run("a", 10), run("b", 20)], from_file)
            .expect_err("which?");
        let text = error.to_string();
        assert!(text.contains("a (--connect tcp/127.0.0.1:10)"), "{text}");
        assert!(text.contains("b (--connect tcp/127.0.0.1:20)"), "{text}");
    }

    #[test]
    fn an_explicit_namespace_wins() {
        let args = CellArgs { namespace: Some("twin".to_owned()), ..CellArgs::default() };
        let address = args.resolve(vec![run("a", 10)], from_file).expect("one");
        assert_eq!(address.namespace.as_deref(), Some("twin"));
    }

    #[test]
    fn a_time_out_is_a_positive_number_of_seconds() {
        assert_eq!(parse_seconds("0.5"), Ok(Duration::from_millis(500)));
        for bad in ["0", "-1", "NaN", "inf", "soon", "1e9"] {
            assert!(parse_seconds(bad).is_err(), "{bad}");
        }
    }
}
