//! Two agents that follow a motion together, over real Zenoh.

use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;
use std::time::Duration;

use armada_agent::runtime::{Agent, AgentOptions, Emulation};
use armada_model::{JointTrajectory, Waypoint};
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError, ClientOptions};
use armada_protocol::messages::*;
use armada_protocol::method::robot::{Cancel, Commit, Pause, Prepare, Resume, SetMode};
use tempfile::TempDir;
use uuid::Uuid;

use crate::common::{self, DEADLINE, denial, emulate, free_tcp_port, stop_options};
use crate::running::stop;

const READY: [f64; 6] = [0.0, -FRAC_PI_2, FRAC_PI_2, -FRAC_PI_2, -FRAC_PI_2, 0.0];

/// How robots are shared out among agents.
#[derive(Clone, Copy, Debug)]
enum Share {
    /// Each in an agent of its own; the second one dials the first.
    Apart,
    /// Both in one agent.
    InOne,
}

/// Two arms, each with an agent of its own or both in one, and a client of them.
struct Team {
    names: [RobotName; 2],
    agents: Vec<Agent>,
    client: Client,
    _emulations: [Emulation; 2],
    _folder: TempDir,
}

impl Team {
    async fn start(share: Share) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let files = ["left_arm", "right_arm"].map(|name| common::robot_file(folder.path(), name));
        let emulations = files.each_ref().map(|file| emulate(file));
        let (mut agents, mut endpoints) = (Vec::new(), Vec::new());
        let shared: Vec<Vec<PathBuf>> = match share {
            Share::Apart => files.iter().map(|file| vec![file.clone()]).collect(),
            Share::InOne => vec![files.to_vec()],
        };
        for robot_files in shared {
            let endpoint = format!("tcp/127.0.0.1:{}", free_tcp_port());
            let options = AgentOptions {
                robot_files,
                listen: Some(vec![endpoint.clone()]),
                connect: Some(endpoints.clone()),
                namespace: None,
                insecure_lan: false,
                state_dir: None,
            };
            agents.push(Agent::start(options).await.expect("agent starts"));
            endpoints.push(endpoint);
        }
        let options =
            ClientOptions { name: "test".to_owned(), connect: endpoints, namespace: None };
        let client = Client::connect(options).await.expect("client connects");
        let names = ["left_arm", "right_arm"].map(|name| name.parse().expect("a name"));
        let team = Self { names, agents, client, _emulations: emulations, _folder: folder };
        for name in &team.names {
            team.status_when(name, |s| s.next.iter().any(|next| next.contains("move"))).await;
            let params = SetModeParams { mode: CommandMode::Trajectory };
            team.client.call::<SetMode>(name, params).await.expect("mode is granted");
        }
        team
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

    async fn prepare(&self, robot: usize, id: Uuid, coupling: Coupling) -> Prepared {
        let params = self.params(robot, id, coupling);
        self.client.call::<Prepare>(&self.names[robot], params).await.expect("prepared")
    }

    fn params(&self, robot: usize, id: Uuid, coupling: Coupling) -> PrepareParams {
        let group = GroupParams {
            partners: vec![self.names[1 - robot].clone()],
            coupling,
            // Tests share the machine.
            loss_ms: 150,
            max_divergence_ms: 500.0,
            model_rev: None,
        };
        PrepareParams { group: Some(group), ..PrepareParams::alone(Some(id), turn()) }
    }

    async fn commit(&self, robot: usize, prepared: &Prepared, start_in: Duration) {
        let clock = self.client.robot_clock(&self.names[robot]).await.expect("clock");
        let commit = CommitParams {
            motion_id: prepared.motion_id,
            boot_id: clock.boot_id,
            start_ns: clock.stamp_ns + start_in,
            rate_slope_s: prepared.group.map(|group| group.rate_slope_s),
        };
        self.client.call::<Commit>(&self.names[robot], commit).await.expect("committed");
    }

    /// Both prepared and committed to one start.
    async fn committed(&self, coupling: Coupling) -> Result<Uuid, Denial> {
        let id = Uuid::now_v7();
        let prepared = [0, 1].map(|robot| self.prepare(robot, id, coupling));
        let [left, right] = prepared;
        let prepared = [left.await, right.await];
        let clock = self.client.robot_clock(&self.names[0]).await.expect("clock");
        // Both agents are of one machine, and so have one clock.
        let start_ns = clock.stamp_ns + Duration::from_secs(2);
        for (robot, prepared) in prepared.iter().enumerate() {
            let own = self.client.robot_clock(&self.names[robot]).await.expect("clock");
            let commit = CommitParams {
                motion_id: id,
                boot_id: own.boot_id,
                start_ns,
                rate_slope_s: prepared.group.map(|group| group.rate_slope_s),
            };
            let committed = self.client.call::<Commit>(&self.names[robot], commit).await;
            committed.map_err(|error| match error {
                ClientError::Denied(denial) => denial,
                error => panic!("{error}"),
            })?;
        }
        Ok(id)
    }

    /// The motion as soon as it is as expected; its reason if it ends before that.
    async fn motion_when(
        &self,
        robot: usize,
        id: Uuid,
        condition: impl Fn(&MotionStatus) -> bool,
    ) -> Result<MotionStatus, Denial> {
        let mut last = None;
        let found = tokio::time::timeout(DEADLINE, async {
            loop {
                let motion = self.client.motion(&self.names[robot], id).await.expect("motion");
                if condition(&motion) {
                    return Ok(motion);
                }
                if let (true, Some(reason)) = (motion.status.is_terminal(), &motion.reason) {
                    return Err(reason.clone());
                }
                last = Some(motion);
                tokio::task::yield_now().await;
            }
        });
        found.await.unwrap_or_else(|_| panic!("the motion never was as expected: {last:#?}"))
    }

    async fn end(&self, robot: usize, id: Uuid) -> MotionStatus {
        let end = self.motion_when(robot, id, |motion| motion.status.is_terminal()).await;
        end.expect("any end is one")
    }

    /// Both at their goals, or why one is not.
    async fn goals(&self, id: Uuid) -> Result<[MotionStatus; 2], Denial> {
        let ends = [self.end(0, id).await, self.end(1, id).await];
        match ends.iter().find_map(|end| end.reason.clone()) {
            Some(reason) => Err(reason),
            None => Ok(ends),
        }
    }

    async fn shut_down(self) {
        for agent in self.agents {
            agent.shut_down().await;
        }
    }
}

/// What makes a group one that cannot be.
type Change = fn(&mut GroupParams);

/// Turns the first joint by half a radian in two seconds, softly.
fn turn() -> JointTrajectory {
    let names = [
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ];
    let waypoints = (0..=20).map(|k| {
        let share = f64::from(k) / 20.0;
        let mut joint_position = READY.to_vec();
        // Velocity, acceleration and jerk are zero at both ends.
        let soft =
            share.powi(4) * (35.0 - 84.0 * share + 70.0 * share.powi(2) - 20.0 * share.powi(3));
        joint_position[0] = 0.5 * soft;
        Waypoint { time_from_start_s: 2.0 * share, joint_position, ..Waypoint::default() }
    });
    JointTrajectory {
        joint_names: names.map(str::to_owned).to_vec(),
        waypoints: waypoints.collect(),
        ..JointTrajectory::default()
    }
}

/// Tells a story with two robots; once more if the machine, which tests share, stood still for so
/// long that loops, controllers or partners had to give up.
async fn tell(share: Share, story: impl AsyncFn(&Team) -> Result<(), Denial>) {
    let mut reasons = Vec::new();
    while reasons.len() < 5 {
        let team = Box::pin(Team::start(share)).await;
        let told = Box::pin(story(&team)).await;
        Box::pin(team.shut_down()).await;
        let Err(reason) = told else { return };
        use DenialCode::{CommunicationLost, Faulted, NotReady, Timeout};
        let stalls = [Timeout, CommunicationLost, Faulted, NotReady];
        assert!(stalls.contains(&reason.code), "{reason}");
        reasons.push(reason);
    }
    panic!("the story was never told to its end: {reasons:#?}");
}

async fn starts_and_ends(team: &Team) -> Result<(), Denial> {
    let id = team.committed(Coupling::TimeSynced).await?;
    let ends = team.goals(id).await?;
    let started = ends.each_ref().map(|end| end.started_ns.expect("it started"));
    let skew = started[0].saturating_since(started[1]) + started[1].saturating_since(started[0]);
    assert!(skew <= Duration::from_millis(500), "{skew:?}");
    for end in &ends {
        assert_eq!(end.status, ActionStatus::Complete, "{end:#?}");
        let quality = end.group.expect("it has a partner");
        assert!(quality.max_silence_ms > 0.0 && quality.max_silence_ms <= 150.0, "{quality:?}");
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn two_agents_start_at_one_instant_and_end_at_their_goals() {
    tell(Share::Apart, starts_and_ends).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn two_robots_of_one_agent_start_at_one_instant_and_end_at_their_goals() {
    tell(Share::InOne, starts_and_ends).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cancel_of_one_agents_part_ends_the_others_with_its_name() {
    tell(Share::Apart, async |team: &Team| {
        let id = team.committed(Coupling::TimeSynced).await?;
        team.motion_when(0, id, |motion| motion.elapsed_s > 0.5).await?;
        let cancel = CancelParams { motion_id: id };
        let cancelled = team.client.call::<Cancel>(&team.names[0], cancel).await;
        let [left, right] = [team.end(0, id).await, team.end(1, id).await];
        let reason = right.reason.expect("a reason");
        if cancelled.is_err() || reason.code == DenialCode::CommunicationLost {
            return Err(left.reason.unwrap_or(reason));
        }
        assert_eq!(left.status, ActionStatus::Cancelled);
        assert_eq!(right.status, ActionStatus::Failed);
        assert!(reason.message.contains("partner left_arm stopped"), "{reason}");
        Ok(())
    })
    .await;
}

async fn rests_and_goes_on(team: &Team) -> Result<(), Denial> {
    let id = team.committed(Coupling::TimeSynced).await?;
    team.motion_when(0, id, |motion| motion.elapsed_s > 0.3).await?;
    let params = MotionParams { motion_id: id };
    let paused = team.client.call::<Pause>(&team.names[1], params).await;
    if paused.is_err() {
        // It has ended before, for a reason that is told.
        return team.goals(id).await.map(|_| ());
    }
    let mut rests_s = Vec::new();
    for (robot, name) in team.names.iter().enumerate() {
        team.motion_when(robot, id, |motion| motion.status == ActionStatus::Paused).await?;
        let key = format!("robots/{name}/state");
        let states = team.client.subscribe::<RobotState>(&key, 1).await.expect("states");
        let rest = async {
            loop {
                let (_, state) = states.next().await.expect("a state");
                match state.motion {
                    Some(motion) if motion.rate == 0.0 => return Some(motion.elapsed_s),
                    Some(_) => {}
                    None => return None,
                }
            }
        };
        rests_s.extend(tokio::time::timeout(DEADLINE, rest).await.expect("it rests"));
    }
    if let [left_s, right_s] = rests_s[..] {
        assert!((left_s - right_s).abs() < 0.05, "{rests_s:?}");
    }
    let _ = team.client.call::<Resume>(&team.names[1], params).await;
    team.goals(id).await.map(|_| ())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pause_of_one_agents_part_rests_both_and_its_end_moves_both() {
    tell(Share::Apart, rests_and_goes_on).await;
}

async fn stops_as_one(team: &Team) -> Result<(), Denial> {
    let id = team.committed(Coupling::Rigid).await?;
    team.motion_when(0, id, |motion| motion.elapsed_s > 0.8).await?;
    let report = team.client.stop(stop(StopLevel::L2), stop_options()).await.expect("stop");
    assert_eq!(report.verdict, StopVerdict::Complete, "{report:?}");
    for end in [team.end(0, id).await, team.end(1, id).await] {
        let reason = end.reason.expect("a reason");
        if !matches!(reason.code, DenialCode::Stopped | DenialCode::NotReady) {
            return Err(reason);
        }
    }
    let mut rest = Vec::new();
    for name in &team.names {
        let key = format!("robots/{name}/state");
        let states = team.client.subscribe::<RobotState>(&key, 1).await.expect("states");
        let next = tokio::time::timeout(DEADLINE, states.next()).await.expect("states go on");
        rest.push(next.expect("a state").1.joint_position_command_rad[0]);
    }
    // What they move in 20 ms at most.
    assert!((rest[0] - rest[1]).abs() < 0.01, "they rest at one place: {rest:?}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_of_the_cell_brings_a_rigid_pair_to_rest_at_one_place() {
    tell(Share::Apart, stops_as_one).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn whoever_is_committed_alone_does_not_start() {
    let team = Box::pin(Team::start(Share::Apart)).await;
    let id = Uuid::now_v7();
    let prepared = team.prepare(0, id, Coupling::TimeSynced).await;
    team.prepare(1, id, Coupling::TimeSynced).await;
    team.commit(0, &prepared, Duration::from_secs(2)).await;
    let end = team.end(0, id).await;
    assert_eq!((end.status, end.started_ns), (ActionStatus::Failed, None));
    let reason = end.reason.expect("a reason");
    assert_eq!(reason.code, DenialCode::NotReady);
    assert!(reason.message.contains("right_arm"), "{reason}");
    Box::pin(team.shut_down()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_followed_together_is_refused_with_field_value_and_limit() {
    let team = Box::pin(Team::start(Share::Apart)).await;
    let id = Uuid::now_v7();
    let changes: [(&str, DenialCode, Change); 6] = [
        ("group.partners", DenialCode::InvalidArgument, |group| group.partners.clear()),
        ("group.partners", DenialCode::InvalidArgument, |group| {
            group.partners.push(group.partners[0].clone());
        }),
        ("group.partners", DenialCode::InvalidArgument, |group| {
            group.partners = vec!["left_arm".parse().expect("a name")];
        }),
        ("group.loss_ms", DenialCode::OutOfRange, |group| group.loss_ms = 10),
        ("group.max_divergence_ms", DenialCode::OutOfRange, |group| {
            group.max_divergence_ms = 0.0;
        }),
        ("group.model_rev", DenialCode::StaleModel, |group| group.model_rev = Some(77)),
    ];
    for (field, code, change) in changes {
        let mut params = team.params(0, id, Coupling::TimeSynced);
        change(params.group.as_mut().expect("a group"));
        let refused = denial(team.client.call::<Prepare>(&team.names[0], params).await);
        assert_eq!(refused.code, code, "{refused}");
        assert_eq!(refused.details["field"], field, "{refused}");
    }
    let mut hard = team.params(0, id, Coupling::Rigid);
    hard.trajectory.waypoints = vec![
        hard.trajectory.waypoints[0].clone(),
        Waypoint {
            time_from_start_s: 1.0,
            joint_position: hard.trajectory.waypoints[20].joint_position.clone(),
            ..Waypoint::default()
        },
    ];
    let refused = denial(team.client.call::<Prepare>(&team.names[0], hard).await);
    assert_eq!(refused.code, DenialCode::OutOfRange, "{refused}");
    assert_eq!(refused.details["joint"], "shoulder_pan_joint", "{refused}");
    assert!(refused.details["stretch"].as_f64().is_some_and(|f| f > 1.0), "{refused}");
    let ready = team.prepare(0, id, Coupling::Rigid).await.group.expect("readiness");
    assert!(ready.rate_slope_s >= 0.5 && ready.start_travel < 2e-3, "{ready:?}");
    assert!(ready.stop_time_s > 0.0 && ready.stop_time_s < 1.0, "{ready:?}");
    let nameless = PrepareParams { motion_id: None, ..team.params(0, id, Coupling::TimeSynced) };
    let refused = denial(team.client.call::<Prepare>(&team.names[0], nameless).await);
    assert_eq!(refused.details["field"], "motion_id", "{refused}");
    Box::pin(team.shut_down()).await;
}
