//! Coordinator, agents and a network between them, on an invented clock.

use std::collections::BTreeMap;
use std::time::Duration;

use armada_model::{JointTrajectory, MonoTime, Waypoint};
use armada_protocol::RobotName;
use armada_protocol::messages::{
    CellExecuteTrajectory, CellMotionStatus, CellStatus, ClearanceAnswer, Denial, DenialCode,
    Event, StopLevel, StopRequest, StopScope,
};
use uuid::Uuid;

use super::agent::FakeAgent;
use crate::config::{ClearanceConfig, MotionTimers};
use crate::coordinator::{
    Action, AgentAnswer, AgentCall, AskId, CellAnswer, CellRequest, Coordinator, CoordinatorConfig,
    Input, Ticket,
};
use crate::world::ClearanceReport;

/// What becomes of one message.
#[derive(Clone, Copy, Debug)]
pub(super) enum Fate {
    /// It arrives after so many milliseconds.
    Arrives(u64),
    /// It arrives twice.
    Twice(u64, u64),
    /// It does not arrive.
    Lost,
}

enum Delivery {
    ToAgent(Asked),
    ToGateway(Input),
}

/// A question on its way.
#[derive(Clone)]
struct Asked {
    ask: AskId,
    robot: RobotName,
    client: String,
    lease: Option<Uuid>,
    call: AgentCall,
    sent: MonoTime,
}

pub(super) struct Bench {
    pub(super) now: MonoTime,
    coordinator: Coordinator,
    /// Agents that are there; one that is not neither hears nor speaks.
    pub(super) agents: BTreeMap<RobotName, FakeAgent>,
    queue: BTreeMap<(MonoTime, u64), Delivery>,
    next: u64,
    /// What becomes of the messages to come, again and again.
    pub(super) fates: Vec<Fate>,
    next_fate: usize,
    /// Whether answers about clocks vanish.
    pub(super) drop_clock_answers: bool,
    /// What every check of clearances finds, and how long it takes; it never ends if `None`.
    pub(super) clearance: Option<(Result<ClearanceReport, Denial>, Duration)>,
    /// Everything the coordinator did.
    pub(super) actions: Vec<(MonoTime, Action)>,
    /// Everything it took, with the number of actions before it.
    inputs: Vec<(usize, Input)>,
    next_ticket: u64,
}

pub(super) fn name(robot: &str) -> RobotName {
    robot.parse().expect("a name")
}

pub(super) const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

pub(super) const JOINTS: [&str; 2] = ["elbow_joint", "spin_joint"];

/// A trajectory of these robots, as long as the model's motions are.
pub(super) fn trajectory(robots: &[&str]) -> JointTrajectory {
    let names = robots.iter().flat_map(|robot| JOINTS.map(|joint| format!("{robot}/{joint}")));
    let joint_names: Vec<_> = names.collect();
    let row = |time_from_start_s| Waypoint {
        time_from_start_s,
        joint_position: vec![0.0; joint_names.len()],
        ..Waypoint::default()
    };
    let waypoints = vec![row(0.0), row(2.0)];
    JointTrajectory { waypoints, joint_names, ..JointTrajectory::default() }
}

/// Nothing is near.
pub(super) fn clear() -> ClearanceReport {
    let answer = ClearanceAnswer {
        clear: true,
        required_m: 0.01,
        distance_m: Some(0.4),
        links: None,
        at_s: None,
        without_shape: Vec::new(),
    };
    ClearanceReport { answer, refusal: None, states: 10 }
}

pub(super) fn stop_request(id: u128, scope: StopScope) -> StopRequest {
    StopRequest {
        stop_id: Uuid::from_u128(id),
        source: "panel".to_owned(),
        level: StopLevel::L2,
        scope,
        reason: String::new(),
        seq: 0,
    }
}

impl Bench {
    /// A cell of left, right and torso, all of them on the bus and known.
    pub(super) fn new() -> Self {
        let mut bench = Self::empty();
        for robot in ["left", "right", "torso"] {
            bench.appear(robot, 100);
        }
        bench.run(ms(300));
        bench
    }

    /// The same before anybody is there. The clocks of the agents are hours apart.
    pub(super) fn empty() -> Self {
        let now = MonoTime::from_nanos(100_000_000_000_000);
        let config = CoordinatorConfig {
            cell: "cell".to_owned(),
            boot_id: Uuid::from_u128(7),
            robots: ["torso", "left", "right"].map(name).to_vec(),
            timers: MotionTimers::default(),
            clearance: ClearanceConfig::default(),
        };
        Self {
            now,
            coordinator: Coordinator::new(config, now),
            agents: BTreeMap::new(),
            queue: BTreeMap::new(),
            next: 0,
            fates: vec![Fate::Arrives(1)],
            next_fate: 0,
            drop_clock_answers: false,
            clearance: Some((Ok(clear()), ms(5))),
            actions: Vec::new(),
            inputs: Vec::new(),
            next_ticket: 0,
        }
    }

    /// A new run of the agent of `robot` comes up.
    pub(super) fn appear(&mut self, robot: &str, boot: u128) {
        let offset_s = i64::try_from(robot.len()).expect("short") * 3_600 - 18_000;
        let boot = boot + 1_000 * robot.len() as u128;
        let agent = FakeAgent::new(robot, boot, offset_s * 1_000_000_000);
        self.agents.insert(name(robot), agent);
        self.feed(Input::Presence { robot: name(robot), online: true });
    }

    /// The agent of `robot` dies.
    pub(super) fn vanish(&mut self, robot: &str) {
        self.agents.remove(&name(robot));
        self.feed(Input::Presence { robot: name(robot), online: false });
    }

    pub(super) fn agent(&mut self, robot: &str) -> &mut FakeAgent {
        self.agents.get_mut(&name(robot)).expect("is there")
    }

    pub(super) fn request(&mut self, request: CellRequest) -> Ticket {
        self.request_of("tester", request)
    }

    pub(super) fn request_of(&mut self, client: &str, request: CellRequest) -> Ticket {
        let ticket = Ticket(self.next_ticket);
        self.next_ticket += 1;
        self.feed(Input::Request { ticket, client: client.to_owned(), request });
        ticket
    }

    pub(super) fn execute(&mut self, id: u128, robots: &[&str]) -> Ticket {
        self.execute_trajectory(id, trajectory(robots))
    }

    pub(super) fn execute_trajectory(&mut self, id: u128, trajectory: JointTrajectory) -> Ticket {
        self.execute_with(id, CellExecuteTrajectory::new(None, trajectory))
    }

    pub(super) fn execute_with(&mut self, id: u128, params: CellExecuteTrajectory) -> Ticket {
        let (motion_id, params) = (Uuid::from_u128(id), Box::new(params));
        self.request(CellRequest::ExecuteTrajectory { motion_id, params })
    }

    pub(super) fn feed(&mut self, input: Input) {
        self.inputs.push((self.actions.len(), input.clone()));
        let actions = self.coordinator.handle(self.now, input);
        assert!(self.coordinator.next_deadline() > self.now, "the timer would fire for ever");
        for action in actions {
            self.actions.push((self.now, action.clone()));
            match action {
                Action::Ask { ask, robot, client, lease, call, timeout } => {
                    let denial = Denial::new(DenialCode::Timeout, "no answer");
                    let timed_out = Input::Answer { ask, result: Err(denial) };
                    self.push(self.now + timeout, Delivery::ToGateway(timed_out));
                    let asked = Asked { ask, robot, client, lease, call, sent: self.now };
                    for delay in self.delays() {
                        self.push(self.now + ms(delay), Delivery::ToAgent(asked.clone()));
                    }
                }
                Action::CheckClearance { check, .. } => {
                    if let Some((result, time)) = self.clearance.clone() {
                        let input = Input::Clearance { check, result };
                        self.push(self.now + time, Delivery::ToGateway(input));
                    }
                }
                Action::PublishStop(request) => {
                    let now = self.now;
                    for agent in self.agents.values_mut() {
                        if request.scope.includes(&agent.robot) {
                            agent.stop(&request, now);
                        }
                    }
                }
                _ => {}
            }
        }
    }

    fn delays(&mut self) -> Vec<u64> {
        let fate = self.fates[self.next_fate % self.fates.len()];
        self.next_fate += 1;
        match fate {
            Fate::Arrives(delay) => vec![delay],
            Fate::Twice(first, second) => vec![first, second],
            Fate::Lost => Vec::new(),
        }
    }

    fn push(&mut self, at: MonoTime, delivery: Delivery) {
        self.queue.insert((at, self.next), delivery);
        self.next += 1;
    }

    /// Lets `time` pass.
    pub(super) fn run(&mut self, time: Duration) {
        let end = self.now + time;
        let mut tick = self.now;
        loop {
            let queued = self.queue.first_key_value().map(|((at, _), _)| *at);
            let due = [Some(tick), queued, Some(self.coordinator.next_deadline())];
            let at = due.into_iter().flatten().min().expect("ticks").max(self.now);
            if at > end {
                self.now = end;
                return;
            }
            self.now = at;
            if at == tick {
                tick = tick + ms(5);
                self.agents.values_mut().for_each(|agent| agent.advance(at));
                self.watch_partners();
            }
            self.publish();
            match self.queue.first_entry().filter(|entry| entry.key().0 <= at) {
                Some(entry) => {
                    let delivery = entry.remove();
                    self.deliver(delivery);
                }
                None => self.feed(Input::Timer),
            }
        }
    }

    /// Lets every agent see how its partners keep up, as their heartbeats would tell.
    fn watch_partners(&mut self) {
        let names: Vec<_> = self.agents.keys().cloned().collect();
        for name in names {
            let Some(mut agent) = self.agents.remove(&name) else { continue };
            let others = &self.agents;
            let keeps_up =
                |robot: &RobotName, id| others.get(robot).is_some_and(|other| other.keeps_up(id));
            agent.watch(keeps_up, self.now);
            self.agents.insert(name, agent);
        }
    }

    /// Sends what the agents published.
    fn publish(&mut self) {
        let published: Vec<_> = self
            .agents
            .values_mut()
            .flat_map(|agent| std::mem::take(&mut agent.published))
            .collect();
        for input in published {
            for delay in self.delays() {
                self.push(self.now + ms(delay), Delivery::ToGateway(input.clone()));
            }
        }
    }

    fn deliver(&mut self, delivery: Delivery) {
        match delivery {
            Delivery::ToGateway(Input::Answer {
                ask,
                result: Ok(AgentAnswer::Clock { sample, sent, .. }),
            }) => {
                if self.drop_clock_answers {
                    return;
                }
                let received = self.now;
                let answer = AgentAnswer::Clock { sample, sent, received };
                self.feed(Input::Answer { ask, result: Ok(answer) });
            }
            Delivery::ToGateway(input) => self.feed(input),
            Delivery::ToAgent(Asked { ask, robot, client, lease, call, sent }) => {
                let now = self.now;
                let Some(agent) = self.agents.get_mut(&robot) else { return };
                let mut result = match agent.answered.get(&ask) {
                    Some(answer) => answer.clone(),
                    None => agent.answer(&client, lease, &call, now),
                };
                // Clocks and stops are no requests with an identity.
                if !matches!(call, AgentCall::Clock | AgentCall::Stop(_)) {
                    agent.answered.insert(ask, result.clone());
                }
                if let Ok(AgentAnswer::Clock { sent: at, .. }) = &mut result {
                    *at = sent;
                }
                for delay in self.delays() {
                    let result = result.clone();
                    self.push(
                        self.now + ms(delay),
                        Delivery::ToGateway(Input::Answer { ask, result }),
                    );
                }
            }
        }
    }

    pub(super) fn is_idle(&self) -> bool {
        self.coordinator.is_idle()
    }

    /// Inputs and actions in the order in which they came and were done.
    pub(super) fn history(&self) -> impl Iterator<Item = Result<&Input, &Action>> {
        let mut inputs = self.inputs.iter().peekable();
        let mut actions = self.actions.iter().enumerate().peekable();
        std::iter::from_fn(move || {
            let done = actions.peek().map_or(usize::MAX, |(index, _)| *index);
            match inputs.next_if(|(before, _)| *before <= done) {
                Some((_, input)) => Some(Ok(input)),
                None => actions.next().map(|(_, (_, action))| Err(action)),
            }
        })
    }

    /// Every answer to a request.
    pub(super) fn answers(&self, ticket: Ticket) -> Vec<&Result<CellAnswer, Denial>> {
        let answer =
            |action: &'_ Action| matches!(action, Action::Answer { ticket: t, .. } if *t == ticket);
        let of_ticket = self.actions.iter().filter(|(_, action)| answer(action));
        of_ticket
            .filter_map(|(_, action)| {
                if let Action::Answer { result, .. } = action { Some(result) } else { None }
            })
            .collect()
    }

    /// The one answer to a request that was taken.
    pub(super) fn answer(&self, ticket: Ticket) -> &CellAnswer {
        match self.answers(ticket).as_slice() {
            [Ok(answer)] => answer,
            other => panic!("expected one good answer, not {other:?}"),
        }
    }

    /// The one answer to a request that was refused.
    pub(super) fn denial(&self, ticket: Ticket) -> &Denial {
        match self.answers(ticket).as_slice() {
            [Err(denial)] => denial,
            other => panic!("expected one denial, not {other:?}"),
        }
    }

    /// Every status of a motion.
    pub(super) fn motion(&self, id: u128) -> Vec<&CellMotionStatus> {
        let id = Uuid::from_u128(id);
        let all = self.actions.iter().filter_map(|(_, action)| match action {
            Action::PublishMotion(status) => Some(&**status),
            _ => None,
        });
        all.filter(|status| status.id == id).collect()
    }

    pub(super) fn last_motion(&self, id: u128) -> &CellMotionStatus {
        self.motion(id).last().expect("was published")
    }

    pub(super) fn statuses(&self) -> impl DoubleEndedIterator<Item = (MonoTime, &CellStatus)> {
        self.actions.iter().filter_map(|(at, action)| match action {
            Action::PublishStatus(status) => Some((*at, &**status)),
            _ => None,
        })
    }

    pub(super) fn status(&self) -> &CellStatus {
        self.statuses().next_back().expect("was published").1
    }

    pub(super) fn events(&self) -> impl Iterator<Item = &Event> {
        self.actions.iter().filter_map(|(_, action)| match action {
            Action::PublishEvent(event) => Some(&**event),
            _ => None,
        })
    }

    /// What was asked of a robot.
    pub(super) fn asked<'b>(
        &'b self,
        robot: &'b str,
    ) -> impl Iterator<Item = (MonoTime, &'b AgentCall)> {
        self.actions.iter().filter_map(move |(at, action)| match action {
            Action::Ask { robot: asked, call, .. } if asked.as_str() == robot => Some((*at, call)),
            _ => None,
        })
    }
}
