//! A simulated controller with an ideal robot.

use std::collections::VecDeque;

use armada_model::{JointVector, MonoTime};
use armada_protocol::messages::{OperationalMode, RobotFlags};

use super::own_moves::OwnMoves;
use super::rig::{JOINTS, PERIOD};
use crate::drivers::{DriverRequest, Feedback, JointSet, MAX_SIGNAL_VALUES, SetPoint, Values};

/// A controller with an ideal robot: it goes where it was told to be [`Plant::LAG`] ticks ago.
pub(super) struct Plant {
    pub(super) position: JointVector,
    velocity: JointVector,
    sent: VecDeque<JointVector>,
    pub(super) enabled: bool,
    /// Which run of the controller it is.
    pub(super) session: u64,
    pub(super) ready: bool,
    pub(super) emergency_stop: bool,
    pub(super) error_code: u32,
    pub(super) guard_stop: bool,
    /// Whether the pendant has control.
    pub(super) local_control: bool,
    pub(super) conditions: RobotFlags,
    pub(super) operational_mode: OperationalMode,
    /// Joints that know their reference.
    pub(super) homed: JointSet,
    /// Joints that search it.
    pub(super) homing: JointSet,
    /// Ticks until a request has an effect; never if `None`.
    pub(super) obeys_after: Option<u32>,
    obeying: Vec<(u32, DriverRequest)>,
    /// Whether it reports at all.
    pub(super) silent: bool,
    /// Whether the robot stays where it is, whatever it is told.
    pub(super) blocked: bool,
    /// By how much the first joint drifts per tick, whatever it is told.
    pub(super) creep: f64,
    pub(super) reports_velocity: bool,
    /// Ticks until the references searched for are found; never if `None`.
    pub(super) finds_after: Option<u32>,
    /// Moves that it makes itself.
    pub(super) own: OwnMoves,
    pub(super) signals: Values<MAX_SIGNAL_VALUES>,
    pub(super) asked: Vec<DriverRequest>,
    last: Option<Feedback>,
}

impl Plant {
    pub(super) const LAG: usize = 3;

    pub(super) fn new(position: JointVector) -> Self {
        Self {
            position,
            velocity: position.map_indexed(|_, _| 0.0),
            sent: VecDeque::new(),
            enabled: true,
            session: 1,
            ready: true,
            emergency_stop: false,
            error_code: 0,
            guard_stop: false,
            local_control: false,
            conditions: RobotFlags::NONE,
            operational_mode: OperationalMode::Cobot,
            homed: JointSet::first(JOINTS),
            homing: JointSet::NONE,
            obeys_after: Some(5),
            obeying: Vec::new(),
            silent: false,
            blocked: false,
            creep: 0.0,
            reports_velocity: true,
            finds_after: None,
            own: OwnMoves::default(),
            signals: Values::EMPTY,
            asked: Vec::new(),
            last: None,
        }
    }

    /// Takes back everything that went wrong, but for what needs a request.
    pub(super) fn recover(&mut self) {
        (self.emergency_stop, self.silent, self.blocked) = (false, false, false);
        (self.guard_stop, self.conditions) = (false, RobotFlags::NONE);
        self.local_control = false;
        (self.obeys_after, self.creep) = (Some(5), 0.0);
        self.obeying.clear();
        self.ready = self.enabled;
    }

    pub(super) fn feedback(&mut self, now: MonoTime) -> Option<Feedback> {
        if !self.silent {
            self.last = Some(Feedback {
                joint_velocity: if self.reports_velocity {
                    self.velocity
                } else {
                    JointVector::EMPTY
                },
                enabled: self.enabled,
                session: self.session,
                ready: self.ready,
                emergency_stop: self.emergency_stop,
                error_code: self.error_code,
                operational_mode: self.operational_mode,
                guard_stop: self.guard_stop,
                local_control: self.local_control,
                conditions: self.conditions,
                homed: self.homed,
                homing: self.homing,
                delegated: self.own.report,
                signals: self.signals,
                ..Feedback::of(now, self.position)
            });
        }
        self.last
    }

    pub(super) fn take(&mut self, command: Option<&SetPoint>, request: Option<DriverRequest>) {
        if let Some(request) = request {
            self.asked.push(request);
            if let Some(ticks) = self.obeys_after
                && self.obeying.iter().all(|(_, known)| *known != request)
            {
                self.obeying.push((ticks, request));
            }
        }
        self.search();
        for (ticks, _) in &mut self.obeying {
            *ticks = ticks.saturating_sub(1);
        }
        while let Some(at) = self.obeying.iter().position(|(ticks, _)| *ticks == 0) {
            let request = self.obeying.remove(at).1;
            self.own.take(&request, &self.position);
            match request {
                DriverRequest::Enable => (self.enabled, self.ready) = (true, true),
                DriverRequest::Disable => (self.enabled, self.ready) = (false, false),
                DriverRequest::ResetErrors if self.emergency_stop => {}
                DriverRequest::ResetErrors => (self.error_code, self.ready) = (0, self.enabled),
                DriverRequest::Home(joints) => {
                    self.homed = JointSet::from_bits(self.homed.bits() & !joints.bits());
                    self.homing = joints;
                }
                DriverRequest::StopMotion => self.homing = JointSet::NONE,
                DriverRequest::SetSignal { signal, values } => {
                    // As the tests lay them out: one number, then the others.
                    let rest = self.signals.as_mut_slice().get_mut(usize::from(signal)..);
                    for (slot, value) in rest.into_iter().flatten().zip(values.as_slice()) {
                        *slot = *value;
                    }
                }
                // Not among the abilities of this controller.
                _ => {}
            }
        }
        self.go(command);
    }

    /// A tick of a search: the joints creep until their references are found.
    pub(super) fn search(&mut self) {
        if self.homing.is_empty() {
            return;
        }
        let homing = self.homing;
        let creep = |joint: usize, x: f64| if homing.contains(joint) { x + 1e-3 } else { x };
        self.position = self.position.map_indexed(creep);
        match &mut self.finds_after {
            Some(0) => {
                self.homed = JointSet::from_bits(self.homed.bits() | homing.bits());
                (self.homing, self.finds_after) = (JointSet::NONE, Some(20));
            }
            Some(ticks) => *ticks -= 1,
            None => {}
        }
    }

    /// A period passes in which nothing is sent.
    pub(super) fn go_on(&mut self) {
        let newest = self.sent.back().copied();
        if let Some(held) = newest {
            self.sent.push_back(held);
        }
        self.move_on();
    }

    pub(super) fn go(&mut self, command: Option<&SetPoint>) {
        match command {
            Some(command) if self.enabled && self.ready => {
                self.sent.push_back(command.joint_position);
            }
            _ => self.sent.clear(),
        }
        self.move_on();
    }

    pub(super) fn move_on(&mut self) {
        let before = self.position;
        if !self.enabled {
            self.own.drop_move();
        }
        if let Some(next) = self.own.step(&self.position) {
            self.position = next;
        }
        if self.sent.len() > Self::LAG
            && let Some(next) = self.sent.pop_front().filter(|_| !self.blocked)
        {
            self.position = next;
        }
        if let Some(first) = self.position.first_mut() {
            *first += self.creep;
        }
        self.velocity = self
            .position
            .map_indexed(|joint, position| (position - before[joint]) / PERIOD.as_secs_f64());
    }
}
