//! Single moves to a goal, planned here or by the controller.

use armada_model::{JointVector, MotionLimits};
use armada_protocol::messages::{
    Accepted, ActionStatus, CommandMode, Denial, DenialCode, Executor, MotionKind, MoveExecutor,
    MoveHomeParams, MoveJointParams, MoveOptions, MovePoseParams, Queue,
};
use uuid::Uuid;

use super::{Asker, LOOP_PATIENCE, NewMotion, Requests};
use crate::control::{DelegateOrder, FollowOrder, Order, Refusal};
use crate::drivers::{DelegatedGoal, DelegatedMove};
use crate::moves::{MoveGoal, MovePlan, MovePlanner, SingleMove};
use crate::runtime::connected::{Collection, MAX_CONNECTED};
use crate::runtime::leases::check_may_move;

/// A move as it was asked for.
struct Wanted {
    id: Uuid,
    kind: MotionKind,
    goal: MoveGoal,
    options: MoveOptions,
}

impl Requests {
    pub(super) async fn move_joint(
        &self,
        asker: Asker,
        params: MoveJointParams,
    ) -> Result<Accepted, Denial> {
        let goal = MoveGoal::Joint(params.joint_position_rad);
        self.make_move(asker, (params.motion_id, MotionKind::MoveJoint), goal, params.options).await
    }

    pub(super) async fn move_pose(
        &self,
        asker: Asker,
        params: MovePoseParams,
    ) -> Result<Accepted, Denial> {
        let (chain, _) = self.chain(params.chain.as_deref())?;
        let goal = MoveGoal::Pose { chain, pose: params.pose };
        self.make_move(asker, (params.motion_id, MotionKind::MovePose), goal, params.options).await
    }

    pub(super) async fn move_linear(
        &self,
        asker: Asker,
        params: MovePoseParams,
    ) -> Result<Accepted, Denial> {
        let (chain, _) = self.chain(params.chain.as_deref())?;
        let goal = MoveGoal::Linear { chain, pose: params.pose };
        self.make_move(asker, (params.motion_id, MotionKind::MoveLinear), goal, params.options)
            .await
    }

    pub(super) async fn move_home(
        &self,
        asker: Asker,
        params: MoveHomeParams,
    ) -> Result<Accepted, Denial> {
        let mut home = Vec::new();
        for (joint, position) in self.params.home.iter().enumerate() {
            let missing = || self.board.lock().vocabulary.denial(&Refusal::NoHome { joint });
            home.push(position.ok_or_else(missing)?);
        }
        let goal = MoveGoal::Joint(JointVector::from_slice(&home).unwrap_or_default());
        self.make_move(asker, (params.motion_id, MotionKind::MoveJoint), goal, params.options).await
    }

    async fn make_move(
        &self,
        asker: Asker,
        (id, kind): (Option<Uuid>, MotionKind),
        goal: MoveGoal,
        options: MoveOptions,
    ) -> Result<Accepted, Denial> {
        check_options(&options)?;
        let answering = self.answering(options.wait)?;
        let wanted = Wanted { id: id.unwrap_or_else(Uuid::now_v7), kind, goal, options };
        // One after the other: what is collected is looked at and then added to.
        let planning = self.planning.lock().await;
        let accepted = if self.is_for_controller(&wanted)? {
            self.delegate(&asker, &wanted).await?
        } else {
            self.plan_here(&asker, &wanted).await?
        };
        drop(planning);
        self.finish(accepted, answering).await
    }

    /// Whether the controller is to make a move; refused if it is to and cannot.
    fn is_for_controller(&self, wanted: &Wanted) -> Result<bool, Denial> {
        let abilities = &self.abilities;
        let (can, what) = match wanted.goal {
            MoveGoal::Joint(_) => (abilities.move_joint, "move_joint"),
            MoveGoal::Pose { .. } => (abilities.move_pose, "move_pose"),
            MoveGoal::Linear { .. } => (abilities.move_linear, "move_linear"),
        };
        let options = &wanted.options;
        let is_collecting = options.connect || self.board.lock().connected.collected.is_some();
        let refuse = |text: String| {
            let denial = Denial::new(DenialCode::NotSupported, text);
            Err(denial.with("field", "options.executor"))
        };
        match options.executor {
            MoveExecutor::Agent => Ok(false),
            MoveExecutor::Auto => Ok(can && !is_collecting && self.params.delegates),
            MoveExecutor::Controller if !can => {
                refuse(format!("the controller makes no {what} of its own"))
            }
            MoveExecutor::Controller if is_collecting => {
                refuse("connected moves are planned by the agent, not by the controller".to_owned())
            }
            MoveExecutor::Controller => Ok(true),
        }
    }

    async fn delegate(&self, asker: &Asker, wanted: &Wanted) -> Result<Accepted, Denial> {
        let chain = |chain: usize| u8::try_from(chain).unwrap_or(u8::MAX);
        let goal = match wanted.goal {
            MoveGoal::Joint(goal) => DelegatedGoal::Joint(goal),
            MoveGoal::Pose { chain: of, pose } => DelegatedGoal::Pose { chain: chain(of), pose },
            MoveGoal::Linear { chain: of, pose } => {
                DelegatedGoal::Linear { chain: chain(of), pose }
            }
        };
        let Wanted { id, kind, options, .. } = *wanted;
        let order = DelegateOrder {
            id,
            kind,
            order: DelegatedMove {
                number: 0,
                goal,
                speed: options.speed,
                blend_radius_m: 0.0,
                connect: false,
            },
            queue: options.queue,
            on_lease_loss: options.on_lease_loss,
        };
        let executor = Executor::Controller;
        let motion = NewMotion { id, kind, executor, duration_s: 0.0, waypoint_count: 0 };
        let accepted = self.start(asker, motion, Order::Delegate(order)).await?;
        if let MoveGoal::Joint(end) = wanted.goal {
            self.board.lock().connected.note_end(id, end);
        }
        Ok(accepted)
    }

    async fn plan_here(&self, asker: &Asker, wanted: &Wanted) -> Result<Accepted, Denial> {
        let Wanted { id, kind, goal, options } = *wanted;
        let collected = self.collected(asker, &options)?;
        let step =
            SingleMove { goal, speed: options.speed, blend_radius_m: options.blend_radius_m };
        let mut moves: Vec<_> = collected.iter().flat_map(|c| &c.moves).copied().collect();
        moves.push((id, kind, step));
        let plan = self.plan(&options, moves.iter().map(|(.., step)| *step).collect()).await?;
        let duration_s = plan.trajectory.duration_s();
        if options.connect {
            return self.collect(asker, wanted, (step, duration_s));
        }
        let order = FollowOrder {
            id,
            trajectory: std::sync::Arc::new(plan.trajectory),
            start: None,
            epoch: collected.map(|collected| collected.epoch),
            kind,
            queue: options.queue,
            on_lease_loss: options.on_lease_loss,
            group: None,
        };
        let accepted = self.follow(asker, order).await?;
        self.board.lock().connected.begin(id, &plan.passed_s);
        Ok(accepted)
    }

    /// Keeps a move for the one that does not connect.
    fn collect(
        &self,
        asker: &Asker,
        wanted: &Wanted,
        (step, duration_s): (SingleMove, f64),
    ) -> Result<Accepted, Denial> {
        let Wanted { id, kind, options, .. } = *wanted;
        let executor = Executor::Agent;
        self.begin(asker, NewMotion { id, kind, executor, duration_s, waypoint_count: 0 })?;
        let mut board = self.board.lock();
        let epoch = board.snapshot.epoch;
        let owner = (asker.client.clone(), asker.lease);
        let collection =
            board.connected.collected.get_or_insert_with(|| Collection::new(owner, epoch, options));
        collection.moves.push((id, kind, step));
        let status = Some(ActionStatus::Queued);
        Ok(Accepted { motion_id: id, duration_s, epoch, status })
    }

    /// The moves that this one joins, if it may.
    fn collected(
        &self,
        asker: &Asker,
        options: &MoveOptions,
    ) -> Result<Option<Collection>, Denial> {
        let board = self.board.lock();
        let collected = board.connected.collected.clone();
        if options.connect {
            let snapshot = &board.snapshot;
            let (mode, needed) = (snapshot.command_mode, CommandMode::Trajectory);
            if mode != needed {
                return Err(board.vocabulary.denial(&Refusal::WrongMode { mode, needed }));
            }
            check_may_move(snapshot, asker.lease, snapshot.stamp)
                .map_err(|refusal| board.denial(&refusal))?;
        }
        let Some(first) = collected.as_ref() else {
            return Ok(None);
        };
        if first.owner != (asker.client.clone(), asker.lease) {
            let text = format!("{} is collecting connected moves", first.owner.0);
            return Err(Denial::new(DenialCode::Busy, text));
        }
        if first.moves.len() >= MAX_CONNECTED {
            let text = format!("{MAX_CONNECTED} moves are connected already");
            return Err(Denial::new(DenialCode::TooLarge, text).with("limit", MAX_CONNECTED));
        }
        let differs = [
            (first.options.queue != options.queue, "options.queue"),
            (first.options.on_lease_loss != options.on_lease_loss, "options.on_lease_loss"),
        ];
        match differs.into_iter().find(|(differs, _)| *differs) {
            Some((_, field)) => {
                let text = format!("{field} differs from that of the moves it is connected to");
                Err(Denial::new(DenialCode::InvalidArgument, text).with("field", field))
            }
            None => Ok(collected),
        }
    }

    /// Plans moves from where the robot is, or will be; away from the threads that serve others.
    async fn plan(
        &self,
        options: &MoveOptions,
        moves: Vec<SingleMove>,
    ) -> Result<MovePlan, Denial> {
        let equipment = self.equipment_in_force()?;
        let start = self.start_of_move(options.queue)?;
        let (limits, names) = (self.limits_of_moves(), self.joint_names.clone());
        let count = moves.len();
        let planned = tokio::task::spawn_blocking(move || {
            MovePlanner { equipment: &equipment, limits: &limits, names: &names }
                .plan(&start, &moves)
        });
        let planned = planned.await.map_err(|_| {
            Denial::new(DenialCode::Internal, "planning the move failed unexpectedly")
        })?;
        planned.map_err(|error| {
            let denial = self.problem_denial(&error.problem);
            if count > 1 { denial.with("move", error.index) } else { denial }
        })
    }

    /// Where the motion before it ends if it is to follow that, else where the robot is held.
    fn start_of_move(&self, queue: Queue) -> Result<JointVector, Denial> {
        let board = self.board.lock();
        let snapshot = &board.snapshot;
        let last = board.motions.newest().map(|motion| motion.id);
        let tail = last.filter(|_| queue == Queue::Append);
        let tail = tail.and_then(|id| board.connected.end_of(id));
        let held = snapshot.joint_position_command;
        let held = if held.is_empty() { snapshot.joint_position } else { held };
        let start = tail.unwrap_or(held);
        if start.is_empty() {
            return Err(board.vocabulary.denial(&Refusal::CommunicationLost));
        }
        Ok(start)
    }

    /// The limits, reduced where the key switch says so or nobody knows where it stands.
    pub(super) fn limits_of_moves(&self) -> MotionLimits {
        let mode = self.board.lock().snapshot.operational_mode;
        // Never refused: the loop was made of the same limits.
        self.params.limits_in(mode).unwrap_or(self.limits)
    }

    /// Cancels a move that is a part of a motion, or collected to become one; `None` if it is
    /// neither.
    pub(super) async fn cancel_connected(
        &self,
        asker: &Asker,
        id: Uuid,
    ) -> Option<Result<(), Denial>> {
        use crate::runtime::connected::CancelOf;
        let what = self.board.lock().connected.cancel(id)?;
        Some(match what {
            CancelOf::Collected => Ok(()),
            CancelOf::Part(whole) => {
                self.ask(asker, Order::Cancel(whole), LOOP_PATIENCE).await.map(drop)
            }
        })
    }
}

/// Refuses options that make no sense.
fn check_options(options: &MoveOptions) -> Result<(), Denial> {
    let refuse = |code, field: &str, text: String| {
        Err(Denial::new(code, format!("{field}: {text}")).with("field", field))
    };
    let MoveOptions { speed, blend_radius_m, connect, queue, wait, .. } = *options;
    // Written so that not a number is refused as well.
    if !(speed > 0.0 && speed <= 1.0) {
        let text = format!("{speed} is outside 0 (exclusive) to 1");
        return refuse(DenialCode::OutOfRange, "options.speed", text);
    }
    if !(0.0..=1.0).contains(&blend_radius_m) {
        let text = format!("{blend_radius_m} is outside 0 to 1");
        return refuse(DenialCode::OutOfRange, "options.blend_radius_m", text);
    }
    if blend_radius_m > 0.0 && !connect {
        let text = "needs connect: there is no move to blend into".to_owned();
        return refuse(DenialCode::InvalidArgument, "options.blend_radius_m", text);
    }
    if wait && connect {
        let text = "a move that connects does not begin by itself: wait for the last".to_owned();
        return refuse(DenialCode::InvalidArgument, "options.wait", text);
    }
    if !matches!(queue, Queue::Refuse | Queue::Append) {
        let text = "a single move is refused or appended".to_owned();
        return refuse(DenialCode::NotSupported, "options.queue", text);
    }
    Ok(())
}
