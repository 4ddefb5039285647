//! The mode machine against a small model, which reads what the loop says in its order.

use std::collections::HashSet;

use armada_model::MonoTime;
use armada_protocol::messages::{
    ClearBy, CommandMode, FaultCode, OperationalMode, RobotFlags, StopLevel,
};
use proptest::prelude::*;

use super::rig::{Plant, Rig, jog, long_stories, params};
use crate::control::{Granted, LoopEvent, MAX_REQUESTS, Order, Params, Refusal, clear_by};

use CommandMode::{Halt, Homing, InvalidState};

/// Something that happens to the loop.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "a story of some hundred acts")]
enum Act {
    Ticks(usize),
    Late(u32),
    Ask(Order),
    Stop(Option<StopLevel>),
    Silent(bool),
    EmergencyStop(bool),
    GuardStop(bool),
    Error(u32),
    LoopError(bool),
    Drives { enabled: bool, ready: bool },
    KeySwitch(OperationalMode),
    Recover,
}

fn act() -> impl Strategy<Value = Act> {
    let mode = prop_oneof![
        1 => Just(InvalidState),
        3 => Just(Halt),
        3 => Just(CommandMode::Jog),
        2 => Just(CommandMode::Trajectory),
        2 => Just(CommandMode::PositionCommand),
        2 => Just(CommandMode::VelocityCommand),
        2 => Just(Homing),
    ];
    let ask = prop_oneof![
        10 => mode.prop_map(Order::SetMode),
        3 => Just(Order::Halt),
        4 => Just(Order::ResetErrors),
        1 => Just(Order::Enable),
        1 => Just(Order::Disable),
        4 => (1..u128::MAX, -1.5..1.5f64).prop_map(|(id, goal)| jog(id, [goal, 0.0, 0.0])),
    ];
    let stop = prop_oneof![
        1 => Just(Some(StopLevel::L2)),
        1 => Just(Some(StopLevel::L1)),
        1 => Just(Some(StopLevel::L0)),
        4 => Just(None),
    ];
    let key = prop_oneof![
        Just(OperationalMode::Cobot),
        Just(OperationalMode::ManualFullSpeed),
        Just(OperationalMode::ManualReducedSpeed),
    ];
    prop_oneof![
        8 => (1..40usize).prop_map(Act::Ticks),
        1 => (2..9u32).prop_map(Act::Late),
        20 => ask.prop_map(Act::Ask),
        2 => stop.prop_map(Act::Stop),
        1 => any::<bool>().prop_map(Act::Silent),
        1 => any::<bool>().prop_map(Act::EmergencyStop),
        1 => any::<bool>().prop_map(Act::GuardStop),
        1 => (0..2u32).prop_map(Act::Error),
        1 => any::<bool>().prop_map(Act::LoopError),
        2 => (any::<bool>(), any::<bool>())
            .prop_map(|(enabled, ready)| Act::Drives { enabled, ready }),
        1 => key.prop_map(Act::KeySwitch),
        6 => Just(Act::Recover),
    ]
}

/// What the controller last reported, and the loop error.
#[derive(Clone, Copy, Debug, Default)]
struct World {
    heard: bool,
    enabled: bool,
    ready: bool,
    emergency_stop: bool,
    guard_stop: bool,
    error: bool,
    loop_error: bool,
    key: OperationalMode,
}

impl World {
    /// What the controller reports at its next tick.
    fn reported(plant: &Plant) -> Self {
        Self {
            enabled: plant.enabled,
            ready: plant.ready,
            emergency_stop: plant.emergency_stop,
            guard_stop: plant.guard_stop,
            error: plant.error_code != 0,
            key: plant.operational_mode,
            ..Self::default()
        }
    }

    /// Everything that is wrong now.
    fn causes(&self) -> impl Iterator<Item = FaultCode> {
        [
            (self.loop_error, FaultCode::LoopError),
            (!self.heard, FaultCode::CommunicationLost),
            (self.heard && self.emergency_stop, FaultCode::EmergencyStop),
            (self.heard && self.guard_stop, FaultCode::GuardStop),
            (self.heard && self.error, FaultCode::ControllerError),
        ]
        .into_iter()
        .filter_map(|(present, code)| present.then_some(code))
    }

    const fn serves(&self, mode: CommandMode) -> bool {
        self.enabled && (self.ready || matches!(mode, Homing))
    }
}

const fn is_motion(mode: CommandMode) -> bool {
    !matches!(mode, InvalidState | Halt)
}

/// What ought to be.
struct Model {
    mode: CommandMode,
    faults: Vec<(FaultCode, MonoTime)>,
    stop: Option<StopLevel>,
    key: OperationalMode,
    /// What is asked in this tick, in its order.
    asked: Vec<(u64, Order)>,
    resets: HashSet<u64>,
    /// Orders to disable that wait for the controller.
    disables: HashSet<u64>,
    /// Whether something raised the epoch in this tick.
    raised: bool,
    now: MonoTime,
    world: World,
}

impl Model {
    /// The phases before the requests: faults, key switch, stop gate.
    fn begin_tick(&mut self, now: MonoTime, world: World, stop: Option<StopLevel>) {
        (self.now, self.world, self.raised) = (now, world, false);
        for code in world.causes() {
            self.latch(code);
        }
        if world.heard && is_motion(self.mode) && !world.serves(self.mode) {
            self.latch(FaultCode::NotReady);
        }
        if world.heard && std::mem::replace(&mut self.key, world.key) != world.key {
            self.raised |= is_motion(self.mode);
        }
        if stop > self.stop {
            self.enter(if self.mode == InvalidState { InvalidState } else { Halt });
        }
        self.raised |= stop.is_none() && self.stop.is_some();
        self.stop = if stop.is_none() { None } else { stop.max(self.stop) };
    }

    fn latch(&mut self, code: FaultCode) {
        if self.faults.iter().all(|(latched, _)| *latched != code) {
            self.faults.push((code, self.now));
            self.enter(InvalidState);
        }
    }

    fn enter(&mut self, mode: CommandMode) {
        (self.mode, self.raised) = (mode, true);
    }

    /// Goes through what the loop said in a tick.
    fn follow(&mut self, events: &[LoopEvent]) {
        let mut asked = std::mem::take(&mut self.asked).into_iter().peekable();
        for event in events {
            match event {
                LoopEvent::Answer { ticket, result } => {
                    // Those before it were not answered, so they wait for the controller.
                    while let Some((ticket, order)) = asked.next_if(|(asked, _)| asked < ticket) {
                        self.waits(ticket, &order);
                    }
                    self.resets.remove(ticket);
                    self.disables.remove(ticket);
                    if let Some((_, order)) = asked.next_if(|(asked, _)| asked == ticket) {
                        self.answered(&order, *result);
                    }
                }
                LoopEvent::FaultLatched(fault) => {
                    let known = self.faults.iter().any(|(code, _)| *code == fault.code);
                    assert!(known, "{fault:?} without a cause");
                }
                LoopEvent::FaultsCleared => self.cleared(),
                _ => {}
            }
        }
        for (ticket, order) in asked {
            self.waits(ticket, &order);
        }
    }

    fn waits(&mut self, ticket: u64, order: &Order) {
        match order {
            Order::Disable => {
                self.disables.insert(ticket);
                self.disabled();
            }
            Order::Enable | Order::ResetErrors => {}
            _ => panic!("{order:?} was not answered"),
        }
    }

    fn disabled(&mut self) {
        self.enter(if self.mode == InvalidState { InvalidState } else { Halt });
    }

    fn cleared(&mut self) {
        let remaining: Vec<_> = self.world.causes().collect();
        assert!(remaining.is_empty(), "cleared though {remaining:?} is there");
        let fresh = self.faults.iter().any(|(_, stamp)| *stamp == self.now);
        assert!(!fresh, "cleared in the tick it was latched in: {:?}", self.faults);
        let by_halt = self.faults.iter().all(|(code, _)| clear_by(*code) == ClearBy::Halt);
        assert!(by_halt || !self.resets.is_empty(), "nobody cleared {:?}", self.faults);
        self.faults.clear();
        self.enter(Halt);
    }

    fn answered(&mut self, order: &Order, result: Result<Granted, Refusal>) {
        match order {
            Order::SetMode(wanted) => {
                let expected = self.expect(*wanted);
                let passing = result == Err(Refusal::StillMoving);
                if expected.is_ok() && is_motion(*wanted) && passing {
                    return;
                }
                assert_eq!(result.map(|_| ()), expected, "{order:?} in {:?}", self.mode);
                if result.is_ok() && self.mode != *wanted {
                    self.enter(*wanted);
                }
            }
            Order::Halt => {
                let expected = self.expect(Halt);
                assert_eq!(result.map(|_| ()), expected, "halt in {:?}", self.mode);
                if result.is_ok() {
                    self.enter(Halt);
                }
            }
            // Too many wait for their answers: it is done all the same.
            Order::Disable if matches!(result, Ok(_) | Err(Refusal::TooManyPending)) => {
                self.disabled();
            }
            _ => {}
        }
        if let Ok(granted) = result {
            assert_eq!(granted.command_mode, self.mode, "{order:?}");
        }
    }

    /// The row of the table at the head of `mode.rs`.
    fn expect(&self, wanted: CommandMode) -> Result<(), Refusal> {
        if wanted == InvalidState {
            return Err(Refusal::ModeNotSupported(wanted));
        }
        if wanted == self.mode {
            return Ok(());
        }
        if let Some(level) = self.stop.filter(|_| wanted != Halt) {
            return Err(Refusal::Stopped(level));
        }
        if self.mode == InvalidState {
            let stays = |(code, stamp): &&(FaultCode, MonoTime)| {
                wanted != Halt || clear_by(*code) > ClearBy::Halt || *stamp == self.now
            };
            return Err(match self.faults.iter().find(stays) {
                _ if !self.world.heard => Refusal::CommunicationLost,
                Some((code, _)) => Refusal::Faulted(*code),
                None => panic!("halt should have cleared {:?}", self.faults),
            });
        }
        if wanted == Halt {
            return Ok(());
        }
        match self.mode {
            Halt if !self.disables.is_empty() => Err(Refusal::Disabled),
            Halt if self.world.serves(wanted) => Ok(()),
            Halt if !self.world.enabled => Err(Refusal::NotEnabled),
            Halt => Err(Refusal::NotReady),
            mode => Err(Refusal::ThroughHalt { mode, wanted }),
        }
    }
}

struct Story {
    rig: Rig,
    model: Model,
    world: World,
    told: CommandMode,
}

impl Story {
    fn new() -> Self {
        let home = vec![None, Some(0.0), None];
        let mut rig = Rig::with(Params { home, ..params() });
        rig.tick();
        let model = Model {
            mode: Halt,
            faults: Vec::new(),
            stop: None,
            key: OperationalMode::Cobot,
            asked: Vec::new(),
            resets: HashSet::new(),
            disables: HashSet::new(),
            raised: false,
            now: rig.now,
            world: World::default(),
        };
        let world = World::reported(&rig.plant);
        Self { rig, model, world, told: Halt }
    }

    fn play(&mut self, act: &Act) {
        let plant = &mut self.rig.plant;
        match act {
            Act::Ticks(count) => (0..*count).for_each(|_| self.tick(1)),
            Act::Late(periods) => self.tick(*periods),
            Act::Ask(order) => self.ask(order.clone()),
            Act::Stop(level) => self.rig.stop = *level,
            Act::Silent(silent) => plant.silent = *silent,
            Act::EmergencyStop(pressed) => plant.emergency_stop = *pressed,
            Act::GuardStop(open) => plant.guard_stop = *open,
            Act::Error(code) => plant.error_code = *code,
            Act::LoopError(error) => self.rig.loop_error = *error,
            Act::Drives { enabled, ready } => {
                (plant.enabled, plant.ready) = (*enabled, *ready);
            }
            Act::KeySwitch(mode) => plant.operational_mode = *mode,
            Act::Recover => self.recover(),
        }
    }

    fn recover(&mut self) {
        self.rig.plant.recover();
        (self.rig.stop, self.rig.loop_error) = (None, false);
        self.tick(1);
        for order in [Order::ResetErrors, Order::Enable] {
            self.ask(order);
            (0..60).for_each(|_| self.tick(1));
        }
    }

    fn ask(&mut self, order: Order) {
        if self.model.asked.len() == MAX_REQUESTS {
            self.tick(1);
        }
        let ticket = self.rig.order(order.clone());
        if matches!(order, Order::ResetErrors) {
            self.model.resets.insert(ticket);
        }
        self.model.asked.push((ticket, order));
    }

    fn tick(&mut self, periods: u32) {
        let epoch = self.rig.epoch();
        let plant = &self.rig.plant;
        if !plant.silent {
            self.world = World::reported(plant);
        }
        let output = self.rig.late_tick(periods);
        let snapshot = output.snapshot;
        let heard = !snapshot.flags.contains(RobotFlags::COMMUNICATION_FAILURE);
        let world = World { heard, loop_error: self.rig.loop_error, ..self.world };
        self.model.begin_tick(self.rig.now, world, self.rig.stop);
        self.model.follow(&output.events);
        assert_eq!(snapshot.command_mode, self.model.mode);
        if self.model.raised {
            assert!(snapshot.epoch > epoch, "the epoch was not raised");
        } else {
            assert_eq!(snapshot.epoch, epoch, "the epoch was raised for nothing");
        }
        for event in &output.events {
            if let LoopEvent::Mode { from, to } = event {
                assert_eq!(*from, self.told, "a change of mode was not told");
                self.told = *to;
            }
        }
        assert_eq!(self.told, snapshot.command_mode);
    }
}

proptest! {
    #![proptest_config(long_stories(22))]

    #[test]
    fn the_mode_is_as_its_model_whatever_happens(acts in prop::collection::vec(act(), 1..120)) {
        let mut story = Story::new();
        for act in &acts {
            story.play(act);
        }
        story.tick(1);
        story.rig.finish();
    }
}
