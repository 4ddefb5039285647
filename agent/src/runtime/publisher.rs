//! The thread between the loop and Zenoh: states at their rate, events to the desk.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{
    CommandMode, ControllerState, JointState, OperationalMode, RobotState, TcpState,
};
use armada_protocol::publish::Latest as Sender;
use tokio::sync::{Notify, mpsc};
use tracing::{debug, warn};
use uuid::Uuid;

use super::board::SharedBoard;
use super::clock::{monotonic, utc_ns};
use super::equipment::SharedEquipment;
use super::groups::Groups;
use super::mailbox::{PublisherEnd, StampedEvent};
use super::processor::Follower;
use crate::control::{Equipment, EquippedChain, Snapshot};

/// How long the thread sleeps if nobody wakes it, so that it sees the shutdown.
const IDLE: Duration = Duration::from_millis(100);

/// The state at a lower rate.
pub(super) struct StateClass {
    sender: Sender,
    /// It falls due every so many ticks, at ticks whose number they divide.
    ticks_per_sample: u64,
    /// How often it had fallen due when it was last looked at.
    seen: u64,
    /// Whether it had fallen due then, and somebody listened to it.
    is_wanted: bool,
}

impl StateClass {
    /// A class that falls due every `ticks_per_sample` ticks.
    pub(super) const fn new(sender: Sender, ticks_per_sample: u64) -> Self {
        Self { sender, ticks_per_sample, seen: 0, is_wanted: false }
    }

    /// Looks whether it has fallen due, and somebody listens to it.
    fn look(&mut self, seqno: u64) {
        let number = seqno / self.ticks_per_sample.max(1);
        let is_due = std::mem::replace(&mut self.seen, number) != number;
        self.is_wanted = is_due && self.sender.has_subscribers();
    }
}

/// Everything the publisher thread owns or shares.
pub(super) struct Publisher {
    pub(super) mailbox: PublisherEnd,
    pub(super) board: Arc<SharedBoard>,
    pub(super) desk: mpsc::Sender<StampedEvent>,
    pub(super) state: Sender,
    pub(super) joint_states: Sender,
    pub(super) classes: Vec<StateClass>,
    pub(super) boot_id: Uuid,
    pub(super) joint_names: Vec<String>,
    /// Names of the chains.
    pub(super) chains: Vec<String>,
    /// Their tools in force.
    pub(super) in_force: Arc<Equipment>,
    pub(super) equipment: Arc<SharedEquipment>,
    /// Where words to partners go.
    pub(super) groups: Arc<Groups>,
    /// Told when the robot's condition has changed.
    pub(super) changed: Arc<Notify>,
    pub(super) shutdown: Arc<AtomicBool>,
}

impl Publisher {
    /// Runs until the shutdown, on the loop's processor if there is a `follower`.
    pub(super) fn run(mut self, mut follower: Option<Follower>) {
        let mut published = 0;
        while !self.shutdown.load(Ordering::Relaxed) {
            std::thread::park_timeout(IDLE);
            while let Ok(said) = self.mailbox.says.pop() {
                self.groups.say(&said);
            }
            while self.mailbox.retired.pop().is_ok() {}
            let latest = *self.mailbox.latest.read();
            let is_due = std::mem::replace(&mut published, latest.due) != latest.due;
            self.publish(&latest.snapshot, is_due);
            if let Some(follower) = &mut follower {
                follower.follow(latest.snapshot.stamp);
            }
            let before = std::mem::replace(&mut self.board.lock().snapshot, latest.snapshot);
            if condition(&before) != condition(&latest.snapshot) {
                self.changed.notify_one();
            }
            while let Ok(event) = self.mailbox.events.pop() {
                if self.desk.try_send(event).is_err() {
                    warn!("an event of the loop was lost: the desk does not keep up");
                    self.board.lock().count_dropped("loop_event");
                }
            }
        }
        // The last that is told of the robot is how it was left, whatever the rate.
        let last = *self.mailbox.latest.read();
        self.publish(&last.snapshot, true);
    }

    /// Publishes what has fallen due and somebody listens to; the state itself if it `is_due`, and
    /// at lower rates by its number.
    fn publish(&mut self, snapshot: &Snapshot, is_due: bool) {
        self.follow_equipment(snapshot.config_seqno);
        let wants_state = is_due && self.state.has_subscribers();
        let wants_joints = is_due && self.joint_states.has_subscribers();
        self.classes.iter_mut().for_each(|class| class.look(snapshot.seqno));
        let classes = self.classes.iter().filter(|class| class.is_wanted);
        let own = wants_state.then_some(&self.state).into_iter();
        let mut senders = own.chain(classes.map(|class| &class.sender)).peekable();
        if senders.peek().is_none() && !wants_joints {
            return;
        }
        let state = self.robot_state(snapshot);
        for sender in senders {
            if let Err(error) = sender.put(&state) {
                debug!(%error, "state not published");
            }
        }
        if wants_joints && let Err(error) = self.joint_states.put(&self.joint_state(&state)) {
            debug!(%error, "joint states not published");
        }
    }

    fn robot_state(&self, snapshot: &Snapshot) -> RobotState {
        RobotState {
            stamp_ns: snapshot.stamp,
            utc_ns: utc_at(snapshot.stamp),
            boot_id: self.boot_id,
            seqno: snapshot.seqno,
            epoch: snapshot.epoch,
            command_mode: snapshot.command_mode,
            operational_mode: snapshot.operational_mode,
            controller_state: snapshot.controller_state,
            flags: snapshot.flags,
            joint_position_rad: snapshot.joint_position,
            joint_velocity_rad_s: snapshot.joint_velocity,
            joint_effort_nm: snapshot.joint_effort,
            joint_position_command_rad: snapshot.joint_position_command,
            joint_velocity_command_rad_s: snapshot.joint_velocity_command,
            tcp: self.tips(snapshot),
            motion: snapshot.motion,
            speed_ratio: snapshot.speed_ratio,
            config_seqno: snapshot.config_seqno,
        }
    }

    /// Takes the tools that the loop has in force since it was looked last.
    fn follow_equipment(&mut self, config_seqno: u64) {
        if self.in_force.config_seqno != config_seqno
            && let Some(newer) = self.equipment.of_revision(config_seqno)
        {
            self.in_force = newer;
        }
    }

    /// Tool and flange of each chain; none while the positions are not known.
    fn tips(&self, snapshot: &Snapshot) -> Vec<TcpState> {
        if snapshot.joint_position.is_empty() {
            return Vec::new();
        }
        let tip = |(index, (name, chain)): (usize, (&String, &EquippedChain))| {
            let tip = chain.tip(&snapshot.joint_position, &snapshot.joint_velocity).ok()?;
            let reported = snapshot
                .tips
                .iter()
                .flatten()
                .find(|reported| usize::from(reported.chain) == index);
            let tip = reported.map_or(tip, |reported| chain.reported(tip, reported));
            Some(TcpState {
                chain: name.clone(),
                pose: tip.tcp,
                twist: tip.tcp_twist,
                flange_pose: tip.flange,
                flange_twist: tip.flange_twist,
            })
        };
        self.chains.iter().zip(&self.in_force.chains).enumerate().filter_map(tip).collect()
    }

    fn joint_state(&self, state: &RobotState) -> JointState {
        JointState {
            stamp_ns: state.stamp_ns,
            boot_id: state.boot_id,
            seqno: state.seqno,
            name: self.joint_names.clone(),
            position: state.joint_position_rad,
            velocity: state.joint_velocity_rad_s,
            effort: state.joint_effort_nm,
        }
    }
}

/// What a status says of the robot's condition.
type Condition = (CommandMode, ControllerState, OperationalMode, u64, Option<MonoTime>);

/// The condition that a snapshot shows.
const fn condition(snapshot: &Snapshot) -> Condition {
    let Snapshot { command_mode, controller_state, operational_mode, flags, .. } = *snapshot;
    (command_mode, controller_state, operational_mode, flags.bits(), snapshot.acknowledged)
}

/// The wall clock at `stamp`, which lies a moment back.
fn utc_at(stamp: MonoTime) -> u64 {
    let age = monotonic().saturating_since(stamp).as_nanos();
    utc_ns().saturating_sub(u64::try_from(age).unwrap_or_default())
}
