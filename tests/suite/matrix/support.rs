//! What the rows share: a cell on hosts, motions from wherever the arms are, and what was seen.

use std::time::Duration;

use anyhow::{Context, Result, ensure};
use armada_model::{JointTrajectory, JointVector, MonoTime, Waypoint};
use armada_protocol::RobotName;
use armada_protocol::client::{Client, ClientError, Subscription};
use armada_protocol::keys;
use armada_protocol::messages::*;
use armada_protocol::method::robot::{
    Enable, ExecuteTrajectory, Halt, Reset, ResetErrors, SetMode,
};
use armada_protocol::method::{Method, cell};
use armada_tests::{NetCell, NetCellOptions, Network, wait_for};
use uuid::Uuid;

/// Period of the control loops.
pub(crate) const PERIOD: Duration = Duration::from_millis(2);
/// Silence of a partner after which a group stops.
pub(crate) const LOSS: Duration = Duration::from_millis(60);
/// What is added to every bound: control loops that a busy machine runs late. Bounds are taken
/// between stamps of control loops, which are scheduled before everything else.
pub(crate) const RESERVE: Duration = Duration::from_millis(60);
/// Longest ramp to rest in these rows.
pub(crate) const RAMP: Duration = Duration::from_millis(150);
/// How long anything may take to be seen on a busy machine.
const PATIENCE: Duration = Duration::from_secs(30);
/// States that are seen are not farther apart, unless the link is cut.
const STATES_APART: Duration = Duration::from_millis(50);
/// Acceleration limit of every joint of the arms \[rad/s²\].
const ACCELERATION: f64 = 5.0;

/// A cell on hosts, with somebody who watches it from the client's host.
pub(crate) struct Bed {
    pub(crate) cell: NetCell,
    pub(crate) client: Client,
    pub(crate) left: RobotName,
    pub(crate) right: RobotName,
}

impl Bed {
    pub(crate) async fn start(network: Network, options: NetCellOptions) -> Result<Self> {
        let cell = NetCell::start(network, options).await?;
        let client = cell.client().await?;
        Ok(Self { cell, client, left: "left_arm".parse()?, right: "right_arm".parse()? })
    }

    pub(crate) fn robots(&self) -> [&RobotName; 2] {
        [&self.left, &self.right]
    }

    /// Turns the first joint of both arms to 0 or to `angle_rad`, whichever is further from the left
    /// one: however they were stopped, they are side by side afterwards. It takes `duration_s`, or
    /// longer if the way is long.
    pub(crate) async fn both(&self, angle_rad: f64, duration_s: f64) -> Result<JointTrajectory> {
        let (mut joint_names, mut start, mut goal) = (Vec::new(), Vec::new(), Vec::new());
        let (mut target, mut way) = (None, 0.0_f64);
        for robot in self.robots() {
            let mut arm = self.position(robot).await?.to_vec();
            let joints = self.client.robot_info(robot).await?.joints;
            joint_names.extend(joints.iter().map(|joint| format!("{robot}/{}", joint.name)));
            start.extend(&arm);
            let nearer_zero = arm[0].abs() < (angle_rad - arm[0]).abs();
            let to = *target.get_or_insert(if nearer_zero { angle_rad } else { 0.0 });
            way = way.max((to - arm[0]).abs());
            arm[0] = to;
            goal.extend(arm);
        }
        Ok(between(joint_names, start, goal, duration_s.max(4.0 * way)))
    }

    /// Turns the first joint of an arm by `angle_rad`, back and forth by turns.
    pub(crate) async fn one(
        &self,
        robot: &RobotName,
        angle_rad: f64,
        duration_s: f64,
    ) -> Result<JointTrajectory> {
        let start = self.position(robot).await?.to_vec();
        let joints = self.client.robot_info(robot).await?.joints;
        let joint_names = joints.into_iter().map(|joint| joint.name).collect();
        let mut goal = start.clone();
        goal[0] += if goal[0] > 0.2 { -angle_rad } else { angle_rad };
        Ok(between(joint_names, start, goal, duration_s))
    }

    /// Where an arm that stands is told to be, or is if it is told nothing.
    async fn position(&self, robot: &RobotName) -> Result<JointVector> {
        let mut watch = Watch::of(&self.client, robot).await?;
        let state = watch.state_when("it stands", |_| true, |state| !is_commanded(state)).await?;
        let told = state.joint_position_command_rad;
        Ok(if told.is_empty() { state.joint_position_rad } else { told })
    }

    /// Starts a motion of both arms.
    pub(crate) async fn move_both(&self, coupling: Coupling, duration_s: f64) -> Result<Uuid> {
        let trajectory = self.both(0.1 * duration_s, duration_s).await?;
        let params =
            CellExecuteTrajectory { coupling, ..CellExecuteTrajectory::new(None, trajectory) };
        let id = self.begin("the motion", params).await?;
        self.until_moving(id).await?;
        Ok(id)
    }

    /// Asks for a motion of several arms until it is granted. One whose answer was lost is asked for
    /// by the same identity, so that it is not done a second time.
    pub(crate) async fn begin(&self, what: &str, params: CellExecuteTrajectory) -> Result<Uuid> {
        let unanswered = std::sync::Mutex::new(None);
        until_granted(what, async || {
            let lost = *unanswered.lock().expect("one asks");
            let id = lost.unwrap_or_else(Uuid::now_v7);
            let params = CellExecuteTrajectory { motion_id: Some(id), ..params.clone() };
            let answer = self.client.call_cell::<cell::ExecuteTrajectory>(params).await;
            let is_known = match &answer {
                Err(ClientError::Denied(denial)) => denial.details.get("field"),
                _ => None,
            }
            .is_some_and(|field| field == "motion_id");
            if lost.is_some() && is_known {
                return Ok(id);
            }
            *unanswered.lock().expect("one asks") =
                answer.as_ref().err().is_some_and(is_lost).then_some(id);
            answer.map(|accepted| accepted.motion_id)
        })
        .await
    }

    /// Waits until both arms are well under way.
    pub(crate) async fn until_moving(&self, id: Uuid) -> Result<()> {
        for robot in self.robots() {
            let look = async || {
                let status = self.client.motion(robot, id).await.ok()?;
                (status.elapsed_s > 0.3 || status.status.is_terminal()).then_some(status)
            };
            let status = wait_for("the arm moves", PATIENCE, look).await?;
            ensure!(status.status == ActionStatus::Running, "{status:#?}");
        }
        Ok(())
    }

    /// How one robot's motion ended, as its agent says.
    pub(crate) async fn end_of(&self, robot: &RobotName, id: Uuid) -> Result<MotionStatus> {
        let look = async || {
            let status = self.client.motion(robot, id).await.ok()?;
            status.status.is_terminal().then_some(status)
        };
        wait_for("the motion ends", PATIENCE, look).await
    }

    /// Moves an arm in mode `trajectory` under a lease, from halt.
    pub(crate) async fn move_one(
        &self,
        client: &Client,
        robot: &RobotName,
        duration_s: f64,
        on_lease_loss: LeaseLoss,
    ) -> Result<Uuid> {
        client.call::<Halt>(robot, Empty {}).await?;
        let trajectory = self.one(robot, 0.3 * duration_s, duration_s).await?;
        let mode = SetModeParams { mode: CommandMode::Trajectory };
        client.call::<SetMode>(robot, mode).await?;
        let params = ExecuteTrajectoryParams {
            on_lease_loss,
            ..ExecuteTrajectoryParams::at_once(None, trajectory)
        };
        Ok(client.call::<ExecuteTrajectory>(robot, params).await?.motion_id)
    }

    /// Asks until it is granted; some things are possible a moment later only.
    pub(crate) async fn granted<M: Method>(
        &self,
        robot: &RobotName,
        params: M::Params,
    ) -> Result<M::Answer>
    where
        M::Params: Clone,
    {
        self.granted_under::<M>(&self.client, robot, params).await
    }

    /// As [`Self::granted`], asked by another client.
    pub(crate) async fn granted_under<M: Method>(
        &self,
        client: &Client,
        robot: &RobotName,
        params: M::Params,
    ) -> Result<M::Answer>
    where
        M::Params: Clone,
    {
        until_granted(M::NAME, async || client.call::<M>(robot, params.clone()).await).await
    }

    pub(crate) async fn status_when(
        &self,
        robot: &RobotName,
        what: &str,
        condition: impl Fn(&RobotStatus) -> bool,
    ) -> Result<RobotStatus> {
        self.cell.status_when(&self.client, robot, what, condition).await
    }

    /// Clears the stop of an arm that nobody else holds.
    pub(crate) async fn reset_stop(&self, robot: &RobotName) -> Result<()> {
        let look = async || {
            let Some(latch) = self.client.robot_status(robot).await.ok()?.stop else {
                return Some(());
            };
            self.client.call::<Reset>(robot, latch.reset_params()).await.ok().map(drop)
        };
        let reset = wait_for("the stop is reset", PATIENCE, look).await;
        let status = self.client.robot_status(robot).await;
        reset.with_context(|| format!("{status:#?}"))
    }

    /// Does what a person does before work goes on: errors and stops are reset, drives are on. What
    /// happened may still come out meanwhile, such as a controller's error, so it is looked again.
    pub(crate) async fn make_ready(&self) -> Result<()> {
        for robot in self.robots() {
            let last = std::sync::Mutex::new(None);
            let step = async || {
                let status = self.client.robot_status(robot).await.ok()?;
                let refused = self.step_to_ready(robot, &status).await;
                *last.lock().expect("one looks") = Some((refused, status.why));
                let ready = status.stop.is_none()
                    && status.faults.is_empty()
                    && status.flags.contains(RobotFlags::ENABLED)
                    && status.command_mode == CommandMode::Halt;
                ready.then_some(())
            };
            let ready = wait_for("ready", PATIENCE, step).await;
            ready.with_context(|| format!("{robot}: {last:#?}"))?;
        }
        Ok(())
    }

    /// The next thing that a person does about a robot; what it was refused for, if it was.
    async fn step_to_ready(&self, robot: &RobotName, status: &RobotStatus) -> Option<ClientError> {
        let done = if let Some(latch) = &status.stop {
            self.client.call::<Reset>(robot, latch.reset_params()).await.map(drop)
        } else if !status.faults.is_empty() {
            self.client.call::<ResetErrors>(robot, Empty {}).await.map(drop)
        } else if !status.flags.contains(RobotFlags::ENABLED) {
            self.client.call::<Enable>(robot, Empty {}).await.map(drop)
        } else {
            self.client.call::<Halt>(robot, Empty {}).await.map(drop)
        };
        done.err()
    }

    /// A watch of each arm, to be opened before anything fails.
    pub(crate) async fn watch_both(&self) -> Result<[Watch; 2]> {
        Ok([
            Watch::of(&self.client, &self.left).await?,
            Watch::of(&self.client, &self.right).await?,
        ])
    }

    /// Both arms do a new motion together, to its end; once more while a link that has just come back
    /// still waits to send again what was lost.
    pub(crate) async fn work_again(&self) -> Result<()> {
        for _ in 0..5 {
            let ends = self.work().await?;
            if ends.iter().all(|end| end.status == ActionStatus::Complete) {
                return Ok(());
            }
            let lost_each_other = |end: &MotionStatus| {
                let code = end.reason.as_ref().map(|why| why.code);
                matches!(code, Some(DenialCode::CommunicationLost | DenialCode::NotReady))
            };
            ensure!(ends.iter().any(lost_each_other), "{ends:#?}");
            self.make_ready().await?;
        }
        anyhow::bail!("the arms lose each other again and again")
    }

    async fn work(&self) -> Result<Vec<MotionStatus>> {
        let trajectory = self.both(0.1, 0.8).await?;
        let params = CellExecuteTrajectory::new(None, trajectory);
        let id = self.begin("a new motion", params).await?;
        let mut ends = Vec::new();
        for robot in self.robots() {
            ends.push(self.end_of(robot, id).await?);
        }
        Ok(ends)
    }
}

/// Whether what was refused for this may be granted soon.
fn is_passing(error: &ClientError) -> bool {
    use DenialCode::{Collision, Internal, InvalidArgument, NotSupported, StaleModel};
    match error {
        ClientError::Denied(denial) => !matches!(
            denial.code,
            Collision | Internal | InvalidArgument | NotSupported | StaleModel
        ),
        error => is_lost(error),
    }
}

/// Whether it is not known what became of the request.
const fn is_lost(error: &ClientError) -> bool {
    matches!(error, ClientError::NoReply { .. } | ClientError::Timeout { .. })
}

/// The answer as soon as it is none of a refusal; one that no time can mend ends it.
pub(crate) async fn until_granted<T>(
    what: &str,
    ask: impl AsyncFn() -> Result<T, ClientError>,
) -> Result<T> {
    let last = std::sync::Mutex::new(None);
    let asking = async || match ask().await {
        Ok(answer) => Some(Ok(answer)),
        Err(error) if is_passing(&error) => {
            *last.lock().expect("one asks") = Some(error.to_string());
            None
        }
        Err(error) => Some(Err(error)),
    };
    let granted =
        wait_for(what, PATIENCE, asking).await.map(|answer| answer.context(what.to_owned()));
    granted.and_then(|answer| answer).with_context(|| {
        format!("{what}: {}", last.into_inner().ok().flatten().unwrap_or_default())
    })
}

fn between(
    joint_names: Vec<String>,
    start: Vec<f64>,
    goal: Vec<f64>,
    duration_s: f64,
) -> JointTrajectory {
    let waypoint = |time_from_start_s, joint_position| Waypoint {
        time_from_start_s,
        joint_position,
        ..Waypoint::default()
    };
    JointTrajectory {
        joint_names,
        waypoints: vec![waypoint(0.0, start), waypoint(duration_s, goal)],
        ..JointTrajectory::default()
    }
}

/// What one robot has published since the watch began.
pub(crate) struct Watch {
    states: Subscription<RobotState>,
    events: Subscription<Event>,
    pub(crate) seen: Vec<RobotState>,
    pub(crate) heard: Vec<Event>,
}

impl Watch {
    pub(crate) async fn of(client: &Client, robot: &RobotName) -> Result<Self> {
        Ok(Self {
            states: client.subscribe(&keys::ROBOT_STATE.of(robot), 20_000).await?,
            events: client.subscribe(&keys::ROBOT_EVENTS.of(robot), 1_000).await?,
            seen: Vec::new(),
            heard: Vec::new(),
        })
    }

    /// Takes what has come.
    pub(crate) fn look(&mut self) -> Result<()> {
        while let Some((_, state)) = self.states.try_next()? {
            self.seen.push(state);
        }
        while let Some((_, event)) = self.events.try_next()? {
            self.heard.push(event);
        }
        Ok(())
    }

    /// The first state that fits both conditions; `since` leaves out what was before something.
    pub(crate) async fn state_when(
        &mut self,
        what: &str,
        since: impl Fn(&RobotState) -> bool,
        condition: impl Fn(&RobotState) -> bool,
    ) -> Result<RobotState> {
        let mut next = 0;
        let looking = async {
            loop {
                self.look()?;
                let fits = |state: &&RobotState| since(state) && condition(state);
                if let Some(state) = self.seen[next..].iter().find(fits) {
                    return Ok(state.clone());
                }
                next = self.seen.len();
                self.seen.push(self.states.next().await?.1);
            }
        };
        let found: Result<Result<_>, _> = tokio::time::timeout(PATIENCE, looking).await;
        found.with_context(|| format!("{what}: never; last {:#?}", self.seen.last()))?
    }

    /// The first event that fits.
    pub(crate) async fn event_when(
        &mut self,
        what: &str,
        condition: impl Fn(&Event) -> bool,
    ) -> Result<Event> {
        let looking = async {
            loop {
                self.look()?;
                if let Some(event) = self.heard.iter().find(|event| condition(event)) {
                    return Ok(event.clone());
                }
                self.heard.push(self.events.next().await?.1);
            }
        };
        let found: Result<Result<_>, _> = tokio::time::timeout(PATIENCE, looking).await;
        found.with_context(|| format!("{what}: never; heard {:#?}", self.heard))?
    }

    /// Waits until the robot is told to stand, after `from`; returns when it first was.
    pub(crate) async fn rest(&mut self, from: MonoTime) -> Result<MonoTime> {
        let after = |state: &RobotState| state.stamp_ns > from;
        Ok(self.state_when("it rests", after, |state| !is_commanded(state)).await?.stamp_ns)
    }

    /// An arm whose motion was aborted at `aborted` rests soon.
    pub(crate) async fn assert_rests(&mut self, row: &str, aborted: MonoTime) -> Result<()> {
        let rest = self.rest(aborted).await?;
        let before = self.seen.iter().rev().find(|state| state.stamp_ns < rest);
        let gap = before.map(|state| rest.saturating_since(state.stamp_ns));
        // What was cut off may have stood for long when it was seen again.
        if gap.is_some_and(|gap| gap < STATES_APART) {
            assert_within(&format!("{row}: abort to rest"), aborted, rest, RAMP);
        }
        Ok(())
    }

    /// No joint was told to change its speed faster than its limit, between the states seen.
    pub(crate) fn assert_ramped(&self) {
        for (before, after) in self.seen.iter().zip(self.seen.iter().skip(1)) {
            let time = after.seqno.saturating_sub(before.seqno) as f64 * PERIOD.as_secs_f64();
            let speeds = before.joint_velocity_command_rad_s.iter();
            for (joint, (a, b)) in speeds.zip(after.joint_velocity_command_rad_s.iter()).enumerate()
            {
                let most = ACCELERATION * time * 1.001 + 1e-6;
                assert!((b - a).abs() <= most, "joint {joint}: {a} -> {b} rad/s in {time} s");
            }
        }
    }

    /// The robot is told to stand in every state seen after `from`, and there are some.
    pub(crate) async fn assert_still(&mut self, from: MonoTime) -> Result<()> {
        let later = from + Duration::from_millis(300);
        self.state_when("time passes", |_| true, |state| state.stamp_ns > later).await?;
        for state in self.seen.iter().filter(|state| state.stamp_ns > from) {
            assert!(!is_commanded(state), "it moves: {state:#?}");
        }
        Ok(())
    }
}

/// Whether any joint is told to move.
pub(crate) fn is_commanded(state: &RobotState) -> bool {
    state.joint_velocity_command_rad_s.iter().any(|speed| speed.abs() > 1e-9)
}

/// Fastest speed that a joint is told.
pub(crate) fn speed(state: &RobotState) -> f64 {
    state.joint_velocity_command_rad_s.iter().fold(0.0, |most, speed| speed.abs().max(most))
}

/// Asserts that `later` is at most `bound` after `earlier`, and says how long it was.
#[expect(clippy::print_stderr, reason = "figures of a test, for whoever looks")]
pub(crate) fn assert_within(what: &str, earlier: MonoTime, later: MonoTime, bound: Duration) {
    let early = earlier.saturating_since(later);
    assert!(early <= PERIOD, "{what}: {early:?} before its cause");
    let took = later.saturating_since(earlier);
    eprintln!("{what}: {:.1} ms (bound {} ms)", took.as_secs_f64() * 1e3, bound.as_millis());
    assert!(took <= bound + RESERVE, "{what}: {took:?}, bound {bound:?}");
}

/// How often something was dropped or refused.
pub(crate) fn count(status: &RobotStatus, what: &str) -> u64 {
    status.dropped.iter().find(|(name, _)| name == what).map_or(0, |(_, count)| *count)
}

/// The refusal of a call that has to be refused.
pub(crate) fn denial<T>(result: Result<T, ClientError>) -> Denial {
    match result {
        Err(ClientError::Denied(denial)) => denial,
        Err(other) => panic!("no denial: {other:#}"),
        Ok(_) => panic!("it was granted"),
    }
}
