//! A gateway and an agent without a robot, on real Zenoh over loopback.

#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests, not only tests")]

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use armada_gateway::config::CellConfig;
use armada_gateway::{GatewayError, GatewayOptions, run};
use armada_model::{MonoTime, Pose};
use armada_protocol::client::{Client, ClientOptions};
use armada_protocol::codec::WireEncoding;
use armada_protocol::messages::{
    Accepted, ActionStatus, ClockSample, CommandMode, Denial, DenialCode, Empty, Event,
    GroupReadiness, LeaseGrant, LeaseReleased, ModeAnswer, MotionStatus, Prepared, ResetAnswer,
    RobotInfo, RobotState, RobotStatus, StopAck, StopLatch, StopRequest, StopStage,
};
use armada_protocol::method::{Method, robot};
use armada_protocol::serve::{self, Call, Handler, RpcServer};
use armada_protocol::session::{self, Role, SessionOptions};
use armada_protocol::{RobotName, keys};
use serde::Serialize;
use serde_json::Value;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use uuid::Uuid;
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;
use zenoh::query::Queryable;

/// Longest that any test waits for anything.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);
pub(crate) const JOINTS: [&str; 2] = ["turn", "spin"];

const URDF: &str = r#"<robot name="two">
  <link name="root"/><link name="middle"/><link name="hand"/>
  <joint name="turn" type="continuous">
    <parent link="root"/><child link="middle"/><origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
    <limit velocity="1" effort="1"/>
  </joint>
  <joint name="spin" type="continuous">
    <parent link="middle"/><child link="hand"/><origin xyz="0 0 0.5"/><axis xyz="0 0 1"/>
    <limit velocity="1" effort="1"/>
  </joint>
</robot>"#;

pub(crate) struct TestCell {
    pub(crate) endpoint: String,
    pub(crate) config: CellConfig,
    shutdown: Option<oneshot::Sender<()>>,
    gateway: JoinHandle<Result<(), GatewayError>>,
}

/// An endpoint on loopback that was free a moment ago.
pub(crate) fn free_endpoint() -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    format!("tcp/{}", listener.local_addr().expect("bound"))
}

#[expect(clippy::disallowed_methods, reason = "tests run the gateway beside themselves")]
fn start<T: Send + 'static>(task: impl Future<Output = T> + Send + 'static) -> JoinHandle<T> {
    tokio::spawn(task)
}

impl TestCell {
    /// A running gateway of these robots.
    pub(crate) async fn start(robots: &[&str]) -> Self {
        let endpoint = free_endpoint();
        let entry = |(index, robot): (usize, &&str)| {
            format!("  {robot}: {{file: x.yaml, endpoint: tcp/127.0.0.1:{}}}\n", index + 1)
        };
        let entries: String = robots.iter().enumerate().map(entry).collect();
        let text = format!("cell: test\ngateway: {{listen: [{endpoint}]}}\nrobots:\n{entries}");
        let config = CellConfig::parse(&text, "test.yaml".as_ref()).expect("valid");
        let (ready, is_ready) = oneshot::channel();
        let (shutdown, ends) = oneshot::channel::<()>();
        let options = GatewayOptions { config: config.clone(), listen: None, insecure_lan: false };
        let gateway = start(run(options, ready, async move { drop(ends.await) }));
        tokio::time::timeout(PATIENCE, is_ready).await.expect("in time").expect("is ready");
        Self { endpoint, config, shutdown: Some(shutdown), gateway }
    }

    pub(crate) async fn client(&self) -> Client {
        let connect = vec![self.endpoint.clone()];
        let options = ClientOptions { name: "tester".to_owned(), connect, namespace: None };
        Client::connect(options).await.expect("connects")
    }

    /// Ends the gateway as Ctrl-C does.
    pub(crate) async fn shut_down(mut self) {
        drop(self.shutdown.take());
        let ended = tokio::time::timeout(PATIENCE, self.gateway).await.expect("in time");
        ended.expect("no panic").expect("no error");
    }
}

/// Waits until `look` finds what it looks for.
pub(crate) async fn eventually<T>(what: &str, mut look: impl AsyncFnMut() -> Option<T>) -> T {
    let found = async {
        loop {
            if let Some(found) = look().await {
                return found;
            }
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    match tokio::time::timeout(PATIENCE, found).await {
        Ok(found) => found,
        Err(_) => panic!("not in time: {what}"),
    }
}

/// Answers and publishes as an agent does; its motions take no time.
pub(crate) struct TestAgent {
    pub(crate) session: Session,
    pub(crate) shared: Arc<Shared>,
    _token: LivelinessToken,
    _servers: Vec<RpcServer>,
    _stop: Queryable<()>,
}

pub(crate) struct Shared {
    session: Session,
    robot: RobotName,
    boot_id: Uuid,
    status: Mutex<RobotStatus>,
    /// Starts it was given, on the machine's clock.
    pub(crate) starts: Mutex<Vec<MonoTime>>,
    /// Its lease, or the refusal of one.
    pub(crate) lease: Mutex<Result<Option<Uuid>, Denial>>,
}

fn golden<T: serde::de::DeserializeOwned>(text: &str) -> T {
    serde_json::from_str(text).expect("golden sample")
}

pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn monotonic() -> MonoTime {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    let nanos = now.tv_sec * 1_000_000_000 + now.tv_nsec;
    MonoTime::from_nanos(u64::try_from(nanos).expect("after boot"))
}

impl TestAgent {
    pub(crate) async fn start(cell: &TestCell, robot: &str) -> Self {
        let session = session::open(&SessionOptions {
            role: Role::Agent,
            listen: Vec::new(),
            connect: vec![cell.endpoint.clone()],
            namespace: None,
            insecure_lan: false,
        })
        .await
        .expect("opens");
        let robot: RobotName = robot.parse().expect("a name");
        let boot_id = Uuid::now_v7();
        let mut status: RobotStatus =
            golden(include_str!("../../../protocol/golden/robot_status.json"));
        (status.robot, status.boot_id) = (robot.clone(), boot_id);
        (status.command_mode, status.stop, status.motion) = (CommandMode::Halt, None, None);
        status.faults.clear();
        let shared = Arc::new(Shared {
            session: session.clone(),
            robot: robot.clone(),
            boot_id,
            status: Mutex::new(status),
            starts: Mutex::default(),
            lease: Mutex::new(Ok(None)),
        });
        let servers = shared.serve().await;
        let stop = shared.serve_stop().await;
        let token = keys::ROBOT_ALIVE.of(&robot);
        let token = session.liveliness().declare_token(token).await.expect("declared");
        Self { session, shared, _token: token, _servers: servers, _stop: stop }
    }

    /// Publishes an event with this number.
    pub(crate) async fn publish_event(&self, seqno: u64) {
        let mut event: Event = golden(include_str!("../../../protocol/golden/event.json"));
        event.robot = Some(self.shared.robot.clone());
        (event.boot_id, event.seqno) = (self.shared.boot_id, seqno);
        self.shared.publish(keys::ROBOT_EVENTS.of(&self.shared.robot), &event).await;
    }

    /// Publishes that the joints are here \[rad\].
    pub(crate) async fn publish_state(&self, positions: &[f64]) {
        let mut state: RobotState =
            golden(include_str!("../../../protocol/golden/robot_state.json"));
        state.boot_id = self.shared.boot_id;
        state.joint_position_rad = positions.to_vec().try_into().expect("finite");
        self.shared.publish(keys::ROBOT_STATE.of(&self.shared.robot), &state).await;
    }
}

impl Shared {
    async fn publish<T: Serialize>(&self, key: String, message: &T) {
        let bytes = WireEncoding::Json.encode(message).expect("encodes");
        self.session.put(key, bytes).await.expect("published");
    }

    fn info(&self) -> RobotInfo {
        let mut info: RobotInfo = golden(include_str!("../../../protocol/golden/robot_info.json"));
        (info.robot, info.boot_id) = (self.robot.clone(), self.boot_id);
        for (joint, name) in info.joints.iter_mut().zip(JOINTS) {
            name.clone_into(&mut joint.name);
        }
        URDF.clone_into(&mut info.urdf);
        info
    }

    async fn serve(self: &Arc<Self>) -> Vec<RpcServer> {
        let (info, status, clock) = (Arc::clone(self), Arc::clone(self), Arc::clone(self));
        let sample = move || {
            let (boot_id, stamp_ns) = (clock.boot_id, monotonic());
            Ok(ClockSample { boot_id, stamp_ns, utc_ns: 0 })
        };
        let (session, robot) = (&self.session, &self.robot);
        let current = move || Ok(locked(&status.status).clone());
        let rpc = keys::ROBOT_RPC.of(robot);
        let prefix = rpc.trim_end_matches("/*");
        vec![
            serve::value(session, keys::ROBOT_INFO.of(robot), move || Ok(info.info()))
                .await
                .expect("declared"),
            serve::value(session, keys::ROBOT_STATUS.of(robot), current).await.expect("declared"),
            serve::value(session, keys::ROBOT_CLOCK.of(robot), sample).await.expect("declared"),
            serve::rpc(session, prefix, Arc::clone(self)).await.expect("declared"),
        ]
    }

    async fn serve_stop(self: &Arc<Self>) -> Queryable<()> {
        let shared = Arc::clone(self);
        let stop = move |query: zenoh::query::Query| {
            let shared = Arc::clone(&shared);
            start(async move {
                let bytes = query.payload().expect("a request").to_bytes().into_owned();
                let request: StopRequest = serde_json::from_slice(&bytes).expect("a stop");
                let ack = shared.stopped(&request, StopStage::Received);
                let key = keys::ROBOT_STOP.of(&shared.robot);
                serve::reply(&query, &key, WireEncoding::Json, &ack).await;
                let ack = shared.stopped(&request, StopStage::Standstill);
                shared.publish(keys::ROBOT_STOP_ACK.of(&shared.robot), &ack).await;
            });
        };
        let key = keys::ROBOT_STOP.of(&self.robot);
        self.session.declare_queryable(key).complete(true).callback(stop).await.expect("declared")
    }

    fn stopped(&self, request: &StopRequest, stage: StopStage) -> StopAck {
        let StopRequest { stop_id, source, level, reason, .. } = request.clone();
        let stop = armada_protocol::messages::LatchedStop { stop_id, source, level, reason };
        locked(&self.status).stop =
            Some(StopLatch { level, stops: vec![stop], stage, reset: Default::default() });
        StopAck {
            stop_id,
            robot: self.robot.clone(),
            boot_id: self.boot_id,
            stage,
            stamp_ns: monotonic(),
            since_received_ms: 0.0,
        }
    }

    async fn publish_motion(&self, id: Uuid, seqno: u64, start: MonoTime, status: ActionStatus) {
        let mut motion: MotionStatus =
            golden(include_str!("../../../protocol/golden/motion_status.json"));
        (motion.id, motion.robot, motion.boot_id) = (id, self.robot.clone(), self.boot_id);
        (motion.seqno, motion.started_ns) = (seqno, Some(start));
        (motion.status, motion.reason) = (status, None);
        let key = keys::ROBOT_MOTION.with(&[self.robot.as_str(), &id.to_string()]);
        self.publish(key, &motion).await;
    }
}

impl Handler for Shared {
    async fn handle(&self, call: Call) -> Result<Value, Denial> {
        match call.method() {
            robot::SetMode::NAME => {
                call.run::<robot::SetMode, _, _>(async |request| {
                    locked(&self.status).command_mode = request.params.mode;
                    Ok(ModeAnswer { command_mode: request.params.mode, epoch: 1 })
                })
                .await
            }
            robot::Prepare::NAME => {
                call.run::<robot::Prepare, _, _>(async |request| {
                    let motion_id = request.params.motion_id.expect("given");
                    assert_eq!(request.params.trajectory.joint_names, JOINTS);
                    let group = request.params.group.map(|_| GroupReadiness {
                        stop_time_s: 0.1,
                        rate_slope_s: 1.0,
                        start_travel: 0.001,
                        controller_lag_ms: 0.0,
                        model_rev: self.info().model_rev,
                    });
                    Ok(Prepared { motion_id, duration_s: 1.0, epoch: 1, ttl_ms: 5_000, group })
                })
                .await
            }
            robot::Commit::NAME => {
                call.run::<robot::Commit, _, _>(async |request| {
                    let (motion_id, start) = (request.params.motion_id, request.params.start_ns);
                    assert_eq!(request.params.boot_id, self.boot_id);
                    locked(&self.starts).push(start);
                    self.publish_motion(motion_id, 0, start, ActionStatus::Running).await;
                    self.publish_motion(motion_id, 1, start, ActionStatus::Complete).await;
                    Ok(Accepted { motion_id, duration_s: 1.0, epoch: 1, status: None })
                })
                .await
            }
            robot::Reset::NAME => {
                call.run::<robot::Reset, _, _>(async |request| {
                    locked(&self.status).stop = None;
                    Ok(ResetAnswer { cleared: request.params.stop_ids, epoch: 2 })
                })
                .await
            }
            robot::AcquireLease::NAME => {
                call.run::<robot::AcquireLease, _, _>(async |request| {
                    let (lease, ttl_ms) = (Uuid::now_v7(), request.params.ttl_ms);
                    let mut held = locked(&self.lease);
                    held.clone()?;
                    *held = Ok(Some(lease));
                    Ok(LeaseGrant { lease, epoch: 1, ttl_ms })
                })
                .await
            }
            robot::RenewLease::NAME => {
                call.run::<robot::RenewLease, _, _>(async |request| {
                    let (lease, ttl_ms) = (request.params.lease, request.params.ttl_ms);
                    assert_eq!(*locked(&self.lease), Ok(Some(lease)));
                    Ok(LeaseGrant { lease, epoch: 1, ttl_ms: ttl_ms.expect("given") })
                })
                .await
            }
            robot::ReleaseLease::NAME => {
                call.run::<robot::ReleaseLease, _, _>(async |request| {
                    assert_eq!(*locked(&self.lease), Ok(Some(request.params.lease)));
                    *locked(&self.lease) = Ok(None);
                    Ok(LeaseReleased { epoch: 1 })
                })
                .await
            }
            robot::Abort::NAME => call.run::<robot::Abort, _, _>(async |_| Ok(Empty {})).await,
            _ => Err(Denial::new(DenialCode::UnknownMethod, "not in this test")),
        }
    }
}

/// Where the hand is if both joints are at zero and the robot stands in the world's origin.
pub(crate) fn hand_at_zero() -> Pose {
    Pose::from_translation(0.5, 0.0, 0.5)
}
