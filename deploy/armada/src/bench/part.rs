//! One process of a measurement: it sets up, says that it is ready, answers what it is asked, and
//! ends when its standard input ends, as it does however its parent ends.

use std::fmt;
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use anyhow::{Context as _, bail};
use armada_agent::config::{RealtimeConfig, RobotConfig};
use armada_agent::runtime::{Agent, AgentOptions, Emulation, WakeReader, wake_log};
use armada_protocol::RobotName;
use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};
use tokio::io::{AsyncBufReadExt as _, BufReader};

use super::flood::Flood;
use super::raw;
use super::wakes::{BareLoop, Regularity};
use crate::output::Output;

/// Wake-ups between two looks at the log.
const LOG: usize = 8192;
/// Pause between two looks.
const LOOK: Duration = Duration::from_millis(100);

/// What a process is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum Part {
    /// The emulated controllers of robots.
    Emulator {
        /// Robot files.
        robots: Vec<PathBuf>,
    },
    /// The agent of robots with loops of one period.
    Agent {
        /// Robot files.
        robots: Vec<PathBuf>,
        /// Zenoh endpoint to listen on.
        endpoint: String,
        /// Zenoh endpoints of other agents to dial.
        connect: Vec<String>,
    },
    /// Somebody who sends to robots what they do not want.
    Flood {
        /// Zenoh endpoints of the agents.
        endpoints: Vec<String>,
        /// The robots.
        robots: Vec<RobotName>,
        /// Messages a second, to all robots together.
        rate_hz: u32,
    },
    /// Loops that do nothing.
    BareLoops {
        /// How many.
        loops: u32,
        /// Their period.
        period: Duration,
        /// Their priority under SCHED_FIFO.
        priority: Option<u8>,
    },
    /// A loop that puts a payload as often as an agent puts its state.
    RawState {
        /// Its period.
        period: Duration,
        /// Its priority under SCHED_FIFO.
        priority: Option<u8>,
        /// Zenoh endpoint to listen on.
        endpoint: String,
        /// Size of the payload.
        bytes: usize,
    },
    /// Somebody who answers queries at once.
    RawReply {
        /// Zenoh endpoint to listen on.
        endpoint: String,
        /// Size of the answer.
        bytes: usize,
    },
    /// Threads that never rest.
    Busy {
        /// How many.
        threads: usize,
    },
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Emulator { robots } => write!(f, "emulators of {} robots", robots.len()),
            Self::Agent { robots, .. } => write!(f, "agent of {} robots", robots.len()),
            Self::Flood { rate_hz, .. } => write!(f, "flood of {rate_hz} messages a second"),
            Self::BareLoops { loops, .. } => write!(f, "{loops} bare loops"),
            Self::RawState { .. } => f.write_str("raw publisher"),
            Self::RawReply { .. } => f.write_str("raw answerer"),
            Self::Busy { threads } => write!(f, "{threads} busy threads"),
        }
    }
}

impl FromStr for Part {
    type Err = serde_json::Error;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        serde_json::from_str(text)
    }
}

/// What a process says first.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Ready {
    /// How its loop is scheduled; empty if it has none.
    pub(super) scheduling: String,
}

/// What a process can be asked.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) enum Ask {
    /// Its processor time so far, in seconds.
    CpuTime,
    /// The [`Regularity`] of its loops over this time from now.
    Wakes(Duration),
    /// How many messages it has sent.
    Sent,
}

/// What a process can tell besides its processor time.
enum Source {
    Nothing,
    /// Of loops of this period.
    Wakes(Vec<WakeReader>, Duration),
    Sent(Arc<AtomicU64>),
}

/// Is `part` until standard input ends.
pub(super) async fn run(part: Part) -> anyhow::Result<()> {
    match part {
        Part::Emulator { robots } => {
            let emulations: anyhow::Result<Vec<_>> =
                robots.iter().map(|robot| emulate(robot)).collect();
            let _emulations = emulations?;
            serve(Ready::default(), Source::Nothing).await
        }
        Part::Agent { robots, endpoint, connect } => serve_agent(robots, endpoint, connect).await,
        Part::Flood { endpoints, robots, rate_hz } => {
            let flood = Flood::start(endpoints, &robots, rate_hz).await?;
            serve(Ready::default(), Source::Sent(flood.sent())).await
        }
        Part::BareLoops { loops, period, priority } => {
            let (mut bare, mut readers, mut ready) = (Vec::new(), Vec::new(), Ready::default());
            for _ in 0..loops {
                let (log, reader) = wake_log(LOG);
                let one = BareLoop::noting(period, priority, log)?;
                ready.scheduling.clone_from(&one.scheduling);
                bare.push(one);
                readers.push(reader);
            }
            serve(ready, Source::Wakes(readers, period)).await
        }
        Part::RawState { period, priority, endpoint, bytes } => {
            let bare = raw::publish(&endpoint, period, priority, bytes).await?;
            serve(Ready { scheduling: bare.scheduling.clone() }, Source::Nothing).await
        }
        Part::RawReply { endpoint, bytes } => {
            let _queryable = raw::reply(&endpoint, bytes).await?;
            serve(Ready::default(), Source::Nothing).await
        }
        Part::Busy { threads } => {
            for _ in 0..threads {
                std::thread::Builder::new().spawn(|| {
                    loop {
                        std::hint::spin_loop();
                    }
                })?;
            }
            serve(Ready::default(), Source::Nothing).await
        }
    }
}

fn emulate(robot: &Path) -> anyhow::Result<Emulation> {
    let config = RobotConfig::load(robot)?;
    let (_, model) = config.read_urdf()?;
    let nonce = NonZeroU64::MIN.saturating_add(uuid::Uuid::new_v4().as_u64_pair().0 >> 1);
    let setup = config.driver_setup(&model, nonce)?;
    // Below the control loops, so that it cannot hold up what is measured.
    let priority = config.control.realtime.priority.map(|priority| priority.saturating_sub(10));
    let realtime = RealtimeConfig { priority, cpu: None, lock_memory: false };
    Ok(Emulation::start(config.driver.emulator(&setup)?, realtime)?)
}

async fn serve_agent(
    robots: Vec<PathBuf>,
    endpoint: String,
    connect: Vec<String>,
) -> anyhow::Result<()> {
    let first = robots.first().context("no robot")?;
    let period = RobotConfig::load(first)?.control.period_ms / 1e3;
    let (logs, readers) = robots.iter().map(|_| wake_log(LOG)).unzip();
    let options = AgentOptions {
        robot_files: robots,
        listen: Some(vec![endpoint]),
        connect: Some(connect),
        namespace: None,
        insecure_lan: false,
        state_dir: None,
    };
    let agent = Agent::start_measured(options, logs).await?;
    let scheduling = agent.realtime().next().map(|(_, how)| how.to_string());
    let ready = Ready { scheduling: scheduling.unwrap_or_default() };
    let source = Source::Wakes(readers, Duration::from_secs_f64(period));
    let served = serve(ready, source).await;
    agent.shut_down().await;
    served
}

/// Says that the process is ready and answers until standard input ends.
async fn serve(ready: Ready, mut source: Source) -> anyhow::Result<()> {
    let output = Output::new(true);
    output.json_line(&ready)?;
    let mut asks = BufReader::new(tokio::io::stdin()).lines();
    while let Some(line) = asks.next_line().await? {
        match (serde_json::from_str(&line)?, &mut source) {
            (Ask::CpuTime, _) => output.json_line(&cpu_time())?,
            (Ask::Wakes(time), Source::Wakes(readers, period)) => {
                output.json_line(&collect(readers, *period, time).await)?;
            }
            (Ask::Sent, Source::Sent(sent)) => output.json_line(&sent.load(Ordering::Relaxed))?,
            (ask, _) => bail!("this part cannot tell {ask:?}"),
        }
    }
    Ok(())
}

fn cpu_time() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    Duration::try_from(time).unwrap_or_default().as_secs_f64()
}

/// How regularly all loops woke over `time` from now.
async fn collect(readers: &mut [WakeReader], period: Duration, time: Duration) -> Regularity {
    for reader in &mut *readers {
        while reader.pop().is_some() {}
    }
    let mut wakes = vec![Vec::new(); readers.len()];
    let end = tokio::time::sleep(time);
    tokio::pin!(end);
    let mut look = tokio::time::interval(LOOK);
    loop {
        let ended = tokio::select! {
            () = &mut end => true,
            _ = look.tick() => false,
        };
        for (reader, wakes) in readers.iter_mut().zip(&mut wakes) {
            wakes.extend(std::iter::from_fn(|| reader.pop()));
        }
        if ended {
            return Regularity::of_all(&wakes, period, time);
        }
    }
}
