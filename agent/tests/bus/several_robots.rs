//! Several robots in one agent: one session, and otherwise nothing in common.

use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::net::TcpListener;
use std::path::{Path, PathBuf};

use armada_agent::runtime::{Agent, AgentError, AgentOptions, Emulation};
use armada_model::JointVector;
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError};
use armada_protocol::messages::*;
use armada_protocol::method::robot::{JogFreespace, SetMode};
use tempfile::TempDir;

use crate::common::{self, DEADLINE, denial, emulate, free_tcp_port, stop_options};
use crate::running::{goal, stop};

/// Two arms in one agent, and a client of it.
struct Pair {
    names: [RobotName; 2],
    emulations: [Option<Emulation>; 2],
    agent: Agent,
    client: Client,
    _folder: TempDir,
}

impl Pair {
    async fn start() -> Self {
        Self::start_with("").await
    }

    /// With more lines in the first robot file.
    async fn start_with(more: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let files = ["left_arm", "right_arm"].map(|name| common::robot_file(folder.path(), name));
        append(&files[0], more);
        let endpoint = free_endpoint();
        let emulations = files.each_ref().map(|file| Some(emulate(file)));
        let agent = Agent::start(options(&files, &endpoint)).await.expect("agent starts");
        let client = common::connect(&endpoint).await;
        let names = ["left_arm", "right_arm"].map(|name| name.parse().expect("a name"));
        let pair = Self { names, emulations, agent, client, _folder: folder };
        for name in &pair.names {
            let ready = |s: &RobotStatus| s.next.iter().any(|next| next.contains("move"));
            pair.status_when(name, ready).await;
        }
        pair
    }

    async fn status_when(
        &self,
        robot: &RobotName,
        condition: impl Fn(&RobotStatus) -> bool,
    ) -> RobotStatus {
        let mut last = None;
        let found = tokio::time::timeout(DEADLINE, async {
            loop {
                let status = self.client.robot_status(robot).await.expect("status");
                if condition(&status) {
                    return status;
                }
                last = Some(status);
                tokio::task::yield_now().await;
            }
        });
        found.await.unwrap_or_else(|_| panic!("{robot} never was as expected: {last:#?}"))
    }

    async fn jog(&self, robot: &RobotName, first: f64) -> Result<Accepted, ClientError> {
        self.client.call::<SetMode>(robot, SetModeParams { mode: CommandMode::Jog }).await?;
        // Slow, so that it has not ended before what is to be seen during it.
        let max_velocity_rad_s = JointVector::from_slice(&[0.4; 6]).ok();
        let params = JogFreespaceParams { max_velocity_rad_s, ..goal(first) };
        self.client.call::<JogFreespace>(robot, params).await
    }

    async fn end_of(&self, robot: &RobotName, motion: &Accepted) -> ActionStatus {
        let ended = |s: &RobotStatus| s.motion.is_none();
        self.status_when(robot, ended).await;
        self.client.motion(robot, motion.motion_id).await.expect("on record").status
    }
}

fn free_endpoint() -> String {
    format!("tcp/127.0.0.1:{}", free_tcp_port())
}

fn options(files: &[PathBuf], endpoint: &str) -> AgentOptions {
    AgentOptions {
        robot_files: files.to_vec(),
        listen: Some(vec![endpoint.to_owned()]),
        connect: Some(Vec::new()),
        namespace: None,
        insecure_lan: false,
        state_dir: None,
    }
}

fn append(file: &Path, text: &str) {
    let mut file = OpenOptions::new().append(true).open(file).expect("the file is there");
    file.write_all(text.as_bytes()).expect("written");
}

async fn refusal(options: AgentOptions) -> AgentError {
    match Agent::start(options).await {
        Err(error) => error,
        Ok(_) => panic!("the agent starts"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_of_one_robot_leaves_the_other_of_its_agent_moving() {
    let pair = Pair::start().await;
    let [left, right] = &pair.names;
    let stopped = pair.jog(left, 1.0).await.expect("jog");
    let moving = pair.jog(right, 0.5).await.expect("jog");
    let mut request = stop(StopLevel::L2);
    request.scope = StopScope::Robots(vec![left.clone()]);
    let report = pair.client.stop(request, stop_options()).await.expect("stop is sent");
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:?}");
    assert_eq!(pair.end_of(left, &stopped).await, ActionStatus::Failed);
    assert_eq!(pair.end_of(right, &moving).await, ActionStatus::Complete);
    assert_eq!(denial(pair.jog(left, 0.0).await).code, DenialCode::Stopped);
    pair.agent.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_of_the_cell_stops_every_robot_of_an_agent() {
    let pair = Pair::start().await;
    let report = pair.client.stop(stop(StopLevel::L2), stop_options()).await.expect("stop");
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:?}");
    for name in &pair.names {
        pair.status_when(name, |status| status.stop.is_some()).await;
    }
    pair.agent.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invariant_01_the_own_arm_is_stopped_before_the_cell_is_told() {
    let pair = Pair::start_with("\nstop: {estop_stops_cell: true}\n").await;
    let [left, right] = &pair.names;
    let acks = pair.client.subscribe::<StopAck>("robots/*/stop/ack", 1000).await.expect("acks");
    // What comes the other way tells that the agent knows of the subscription.
    pair.status_when(left, |_| true).await;
    common::inject(pair.emulations[0].as_ref().expect("it runs"), "estop");
    let stopped = pair.status_when(right, |status| status.stop.is_some()).await;
    let cell = stopped.stop.expect("waited for").stops.remove(0);
    assert_eq!((cell.source.as_str(), cell.level), ("left_arm", StopLevel::L1));
    let two = |s: &RobotStatus| s.stop.as_ref().is_some_and(|stop| stop.stops.len() == 2);
    let latch = pair.status_when(left, two).await.stop.expect("waited for");
    let [own, told] = latch.stops.try_into().expect("its own, and the one for the cell");
    assert_eq!((own.source.as_str(), told.stop_id), ("controller", cell.stop_id));
    assert!(cell.reason.contains(&own.stop_id.to_string()), "{cell:?} names its cause");
    let mut first = BTreeMap::new();
    // The own stop, and that of the cell at both; they are written down before they are acknowledged.
    while first.len() < 3 {
        let ack = tokio::time::timeout(DEADLINE, acks.next()).await.expect("acknowledged");
        let (_, ack) = ack.expect("an acknowledgement");
        if ack.stage == StopStage::Received {
            first.entry((ack.robot, ack.stop_id)).or_insert(ack.stamp_ns);
        }
    }
    // One process, so one clock.
    let at = |robot: &RobotName, stop: &LatchedStop| first[&(robot.clone(), stop.stop_id)];
    assert!(at(left, &own) < at(right, &told), "{first:?}");
    assert!(at(left, &own) < at(left, &told), "{first:?}");
    pair.agent.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_that_loses_its_controller_takes_no_other_along() {
    let mut pair = Pair::start().await;
    let moving = pair.jog(&pair.names[1], 0.5).await.expect("jog");
    pair.emulations[0] = None;
    let lost = pair.status_when(&pair.names[0], |status| !status.faults.is_empty()).await;
    assert_eq!(lost.faults[0].code, FaultCode::CommunicationLost);
    let right = &pair.names[1];
    assert_eq!(pair.end_of(right, &moving).await, ActionStatus::Complete);
    assert!(pair.status_when(right, |_| true).await.faults.is_empty());
    pair.agent.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_robot_of_an_agent_has_been_ramped_to_rest_when_it_has_ended() {
    let pair = Pair::start().await;
    let states = pair.client.subscribe::<RobotState>("robots/*/state", 1000).await.expect("states");
    let ends = pair.client.subscribe::<Event>("robots/*/events", 100).await.expect("events");
    for name in &pair.names {
        pair.jog(name, 1.5).await.expect("jog");
    }
    let speed_of = |state: &RobotState| {
        state.joint_velocity_command_rad_s.first().copied().unwrap_or_default().abs()
    };
    let mut rest = BTreeMap::new();
    let both_move = async {
        while rest.len() < 2 || rest.values().any(|&speed| speed <= 0.1) {
            let (key, state) = states.next().await.expect("a state");
            rest.insert(key, speed_of(&state));
        }
    };
    tokio::time::timeout(DEADLINE, both_move).await.expect("both move");
    pair.agent.shut_down().await;
    let both_end = async {
        let mut goodbyes: Vec<RobotName> = Vec::new();
        while goodbyes.len() < 2 {
            let (_, event) = ends.next().await.expect("an event");
            goodbyes.extend(event.robot.filter(|_| event.kind == EventKind::Ending));
        }
        goodbyes.sort();
        goodbyes
    };
    let goodbyes = tokio::time::timeout(DEADLINE, both_end).await.expect("both say goodbye");
    assert_eq!(goodbyes, pair.names);
    let both_rest = async {
        while !rest.values().all(|&speed| speed == 0.0) {
            let (key, state) = states.next().await.expect("a state");
            rest.insert(key, speed_of(&state));
        }
    };
    let told = tokio::time::timeout(DEADLINE, both_rest).await.is_ok();
    assert!(told, "the last that is told of each is that it rests: {rest:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_agent_listens_where_all_its_files_say_and_never_dials_itself() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = ["left_arm", "right_arm"].map(|name| common::robot_file(folder.path(), name));
    let endpoints = [free_endpoint(), free_endpoint()];
    append(&files[0], &format!("\nzenoh: {{ listen: ['{}'] }}\n", endpoints[0]));
    let dials = format!("connect: ['{}']", endpoints[0]);
    append(&files[1], &format!("\nzenoh: {{ listen: ['{}'], {dials} }}\n", endpoints[1]));
    let own = AgentOptions { listen: None, connect: None, ..options(&files, "") };
    let agent = Agent::start(own).await.expect("agent starts");
    for endpoint in &endpoints {
        let client = common::connect(endpoint).await;
        for name in ["left_arm", "right_arm"] {
            let name = name.parse().expect("a name");
            assert_eq!(client.robot_info(&name).await.expect("it answers").robot, name);
        }
        client.close();
    }
    agent.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_that_cannot_share_an_agent_are_told_apart_before_anything_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let endpoint = free_endpoint();
    let first = common::robot_file(folder.path(), "left_arm");
    let error = refusal(options(&[], &endpoint)).await;
    assert!(matches!(error, AgentError::NoRobot), "{error}");
    let roundabout = folder.path().join(".").join("left_arm.yaml");
    let error = refusal(options(&[first.clone(), roundabout.clone()], &endpoint)).await;
    assert!(matches!(&error, AgentError::SameFile(file) if *file == roundabout), "{error}");
    let copy = folder.path().join("copy.yaml");
    std::fs::copy(&first, &copy).expect("copied");
    let error = refusal(options(&[first.clone(), copy.clone()], &endpoint)).await;
    let AgentError::SameName { robot, files } = &error else { panic!("{error}") };
    assert_eq!((robot.as_str(), files), ("left_arm", &[first, copy]));
}

#[tokio::test(flavor = "multi_thread")]
async fn one_robot_that_cannot_start_leaves_none_running() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = ["sound", "unreachable"].map(|name| common::robot_file(folder.path(), name));
    let _controller = emulate(&files[0]);
    let text = std::fs::read_to_string(&files[1]).expect("the file is there");
    let address = text.lines().find(|line| line.trim().starts_with("address:")).expect("a line");
    // The system lets nobody send there who has not asked for broadcasts.
    let text = text.replace(address, "    address: 255.255.255.255:47101");
    std::fs::write(&files[1], text).expect("written");
    let port = free_tcp_port();
    let error = refusal(options(&files, &format!("tcp/127.0.0.1:{port}"))).await;
    let AgentError::Robot { robot, cause } = &error else { panic!("{error}") };
    assert_eq!(robot.as_str(), "unreachable");
    assert!(matches!(**cause, AgentError::Link(_)), "{error}");
    let left = || threads().into_iter().any(|name| name.contains("-sound"));
    let gone = async {
        while left() {
            tokio::task::yield_now().await;
        }
    };
    tokio::time::timeout(DEADLINE, gone).await.expect("its threads have ended");
    TcpListener::bind(("127.0.0.1", port)).expect("the session is closed");
}

/// Names of the threads of this process.
fn threads() -> Vec<String> {
    let tasks = std::fs::read_dir("/proc/self/task").expect("there is a /proc");
    let names = tasks.filter_map(Result::ok).map(|task| task.path().join("comm"));
    names.filter_map(|name| std::fs::read_to_string(name).ok()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_group_has_the_leases_of_all_its_robots_or_none() {
    let pair = Pair::start().await;
    let ttl = std::time::Duration::from_secs(60);
    let [left, right] = &pair.names;
    let held = |s: &RobotStatus| s.authority == AuthorityState::Held;
    let free = |s: &RobotStatus| s.authority == AuthorityState::Free;
    let other = Client::on_session(pair.client.session().clone(), "other");
    let single = other.acquire_lease(right, ttl).await.expect("free");
    let refused = pair.client.acquire_group(&pair.names, ttl).await.expect_err("one is held");
    assert_eq!((&refused.robot, refused.holder.as_deref()), (right, Some("other")), "{refused}");
    pair.status_when(left, free).await;
    single.release().await.expect("given back");
    let group = pair.client.acquire_group(&pair.names, ttl).await.expect("both are free");
    for robot in &pair.names {
        let lease = pair.status_when(robot, held).await.lease.expect("held");
        assert!(lease.remaining_ms > 30_000, "for the whole time: {lease:?}");
    }
    let mode = SetModeParams { mode: CommandMode::Jog };
    let under = pair.client.under(group.leases()[left]);
    under.call::<SetMode>(left, mode).await.expect("the holder may");
    assert!(group.release().await.is_empty(), "nobody refuses");
    for robot in &pair.names {
        pair.status_when(robot, free).await;
    }
    // The loss of one is known long before its next renewal, and the other is kept.
    let group = pair.client.acquire_group(&pair.names, ttl).await.expect("both are free");
    let taken = other.take_lease(right, ttl, Role::Operator, "test").await.expect("a person takes");
    tokio::time::timeout(DEADLINE, group.lost()).await.expect("told");
    let losses = group.losses();
    assert_eq!(losses.iter().map(|(robot, _)| robot).collect::<Vec<_>>(), [right]);
    assert!(
        matches!(&*losses[0].1, ClientError::Denied(denial) if denial.code == DenialCode::LeaseStale)
    );
    let lease = pair.status_when(left, held).await.lease.expect("kept");
    assert_eq!(lease.holder, "test");
    drop(group);
    pair.status_when(left, free).await;
    assert!(!taken.is_lost(), "what is another's is not given back");
    pair.agent.shut_down().await;
}
