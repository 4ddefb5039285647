//! The lease against a small model, which reads what the loop says in its order.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{CommandMode, LeaseLoss, StopLevel};
use proptest::prelude::*;
use uuid::Uuid;

use super::rig::{PERIOD, Rig, jog, long_stories, trajectory};
use crate::control::{
    FollowOrder, LeaseChange, LeaseReport, LoopEvent, MAX_REQUESTS, Order, Refusal,
};

/// Something that happens to the loop.
#[derive(Clone, Debug)]
enum Act {
    Ticks(usize),
    Late(u32),
    Acquire { who: u128, ttl_ticks: u32 },
    Renew(u128),
    Release(u128),
    Command { under: Option<u128>, what: Command },
    Halt,
    Stop(Option<StopLevel>),
    Error(u32),
}

#[derive(Clone, Copy, Debug)]
enum Command {
    Mode(CommandMode),
    ResetErrors,
    Jog,
    Follow(LeaseLoss),
}

fn act() -> impl Strategy<Value = Act> {
    let who = 0..3u128;
    let reaction = prop_oneof![
        Just(LeaseLoss::StopOnPath),
        Just(LeaseLoss::Finish),
        (0.01..0.3).prop_map(LeaseLoss::ContinueS),
    ];
    let command = prop_oneof![
        2 => Just(Command::Mode(CommandMode::Jog)),
        3 => Just(Command::Mode(CommandMode::Trajectory)),
        3 => Just(Command::ResetErrors),
        2 => Just(Command::Jog),
        4 => reaction.prop_map(Command::Follow),
    ];
    let stop = prop_oneof![1 => Just(Some(StopLevel::L2)), 3 => Just(None)];
    prop_oneof![
        8 => (1..30usize).prop_map(Act::Ticks),
        1 => (2..20u32).prop_map(Act::Late),
        4 => (who.clone(), 0..60u32).prop_map(|(who, ttl_ticks)| Act::Acquire { who, ttl_ticks }),
        3 => who.clone().prop_map(Act::Renew),
        1 => who.clone().prop_map(Act::Release),
        10 => (prop::option::of(who), command)
            .prop_map(|(under, what)| Act::Command { under, what }),
        2 => Just(Act::Halt),
        1 => stop.prop_map(Act::Stop),
        1 => (0..2u32).prop_map(Act::Error),
    ]
}

/// What ought to be.
#[derive(Default)]
struct Model {
    held: Option<Held>,
    stopped: bool,
    /// The motion in progress, as the loop told, with its lease and reaction.
    running: Option<Running>,
    /// What is asked in this tick, in its order.
    asked: Vec<Asked>,
    expected: Vec<LeaseChange>,
}

struct Held {
    lease: Uuid,
    ttl: Duration,
    deadline: MonoTime,
    stale: bool,
}

struct Running {
    id: Uuid,
    lease: Option<Uuid>,
    reaction: LeaseLoss,
}

struct Asked {
    ticket: u64,
    lease: Option<Uuid>,
    order: Order,
}

fn lease(who: u128) -> Uuid {
    Uuid::from_u128(5000 + who)
}

impl Model {
    fn begin_tick(&mut self, now: MonoTime, stop: Option<StopLevel>) {
        if stop.is_some() && !self.stopped {
            self.release();
        }
        self.stopped = stop.is_some();
        if let Some(held) = self.held.as_mut().filter(|held| now >= held.deadline && !held.stale) {
            held.stale = true;
            self.expected.push(LeaseChange::Expired(held.lease));
        }
    }

    fn release(&mut self) {
        if let Some(held) = self.held.take() {
            self.expected.push(LeaseChange::Released(held.lease));
        }
    }

    fn in_force(&self, lease: Uuid) -> bool {
        self.held.as_ref().is_some_and(|held| held.lease == lease && !held.stale)
    }

    /// The refusal that the lease is cause of, if it is.
    fn refusal(&self, now: MonoTime, asked: &Asked) -> Option<Refusal> {
        let required = |held: &Held| Refusal::LeaseRequired {
            remaining_s: held.deadline.saturating_since(now).as_secs_f64(),
        };
        let is_held = |lease| self.held.as_ref().is_some_and(|held| held.lease == lease);
        match &asked.order {
            Order::AcquireLease { .. } if self.stopped => Some(Refusal::Stopped(StopLevel::L2)),
            Order::AcquireLease { lease, .. } => {
                self.held.as_ref().filter(|held| held.lease != *lease && !held.stale).map(required)
            }
            Order::RenewLease(lease) | Order::ReleaseLease(lease) => {
                (!is_held(*lease)).then_some(Refusal::LeaseStale)
            }
            Order::Halt => None,
            _ => match asked.lease {
                Some(lease) if self.in_force(lease) => None,
                Some(_) if self.stopped => Some(Refusal::Stopped(StopLevel::L2)),
                Some(_) => Some(Refusal::LeaseStale),
                None => {
                    let held = self.held.as_ref()?;
                    let drives = self.running.as_ref().is_some_and(|r| r.lease == Some(held.lease));
                    (!held.stale || drives).then(|| required(held))
                }
            },
        }
    }

    fn granted(&mut self, now: MonoTime, asked: &Asked) {
        match &asked.order {
            Order::AcquireLease { lease, ttl } => match &mut self.held {
                Some(held) if held.lease == *lease => {
                    held.ttl = *ttl;
                    self.renewed(now);
                }
                _ => {
                    let (lease, ttl) = (*lease, *ttl);
                    self.held = Some(Held { lease, ttl, deadline: now + ttl, stale: false });
                    self.expected.push(LeaseChange::Granted(lease));
                }
            },
            Order::RenewLease(_) => self.renewed(now),
            Order::ReleaseLease(_) => self.release(),
            Order::Halt => {}
            order => {
                let (lease, id) = (asked.lease, order.motion_id());
                let reaction = match order {
                    Order::Follow(order) => order.on_lease_loss,
                    _ => LeaseLoss::StopOnPath,
                };
                if let Some(id) = id {
                    self.running = Some(Running { id, lease, reaction });
                }
                if lease.is_none() && self.held.as_ref().is_some_and(|held| held.stale) {
                    self.release();
                }
            }
        }
    }

    fn renewed(&mut self, now: MonoTime) {
        let Some(held) = &mut self.held else { return };
        held.deadline = now + held.ttl;
        if std::mem::replace(&mut held.stale, false) {
            self.expected.push(LeaseChange::Recovered(held.lease));
        }
    }

    /// Goes through what the loop said in a tick.
    fn follow(&mut self, now: MonoTime, epoch_before: u64, events: &[LoopEvent]) {
        let mut asked = std::mem::take(&mut self.asked).into_iter().peekable();
        for event in events {
            match event {
                LoopEvent::Answer { ticket, result } => {
                    // Those before it were not answered, so they wait for the controller.
                    while let Some(waiting) = asked.next_if(|asked| asked.ticket < *ticket) {
                        assert_eq!(self.refusal(now, &waiting), None, "{:?}", waiting.order);
                        self.granted(now, &waiting);
                    }
                    let Some(asked) = asked.next_if(|asked| asked.ticket == *ticket) else {
                        continue;
                    };
                    match self.refusal(now, &asked) {
                        Some(refusal) => assert_eq!(*result, Err(refusal), "{:?}", asked.order),
                        None => self.check_answer(&asked, *result, epoch_before),
                    }
                    if result.is_ok() {
                        self.granted(now, &asked);
                    }
                }
                LoopEvent::Motion(report) if report.status.is_terminal() => {
                    self.running = self.running.take().filter(|running| running.id != report.id);
                }
                _ => {}
            }
        }
        for waiting in asked {
            assert_eq!(self.refusal(now, &waiting), None, "{:?}", waiting.order);
            self.granted(now, &waiting);
        }
    }

    fn check_answer(
        &self,
        asked: &Asked,
        result: Result<crate::control::Granted, Refusal>,
        epoch_before: u64,
    ) {
        let order = &asked.order;
        assert!(
            !matches!(result, Err(Refusal::LeaseStale | Refusal::LeaseRequired { .. })),
            "{order:?} under {:?}: {result:?}",
            asked.lease
        );
        match order {
            Order::AcquireLease { lease, .. }
                if self.held.as_ref().is_none_or(|held| held.lease != *lease) =>
            {
                let granted = result.expect("nothing speaks against it");
                assert!(granted.epoch > epoch_before, "a grant raises the epoch");
            }
            Order::ReleaseLease(_) => {
                let granted = result.expect("nothing speaks against it");
                assert!(granted.epoch > epoch_before, "a release raises the epoch");
            }
            Order::AcquireLease { .. } | Order::RenewLease(_) => assert!(result.is_ok()),
            _ => {}
        }
    }

    fn check(&self, now: MonoTime, report: Option<LeaseReport>, motion: Option<Uuid>) {
        let held = self.held.as_ref().map(|held| LeaseReport {
            lease: held.lease,
            deadline: held.deadline,
            stale: held.stale,
        });
        assert_eq!(report, held);
        let running = self.running.as_ref().filter(|running| Some(running.id) == motion);
        let Some(Running { lease: Some(lease), reaction, .. }) = running else { return };
        let held = self.held.as_ref().expect("what moves under a lease ends with it");
        assert_eq!(held.lease, *lease, "what moves under a lease ends with it");
        let since_s = now.saturating_since(held.deadline).as_secs_f64();
        let may = match reaction {
            _ if !held.stale => true,
            LeaseLoss::StopOnPath => false,
            LeaseLoss::Finish => true,
            LeaseLoss::ContinueS(time_s) => since_s < *time_s,
        };
        assert!(may, "{reaction:?} still moves {since_s} s after the end of its lease");
    }
}

struct Story {
    rig: Rig,
    model: Model,
    motions: u128,
}

impl Story {
    fn new() -> Self {
        let (rig, model) = (Rig::in_mode(CommandMode::Halt), Model::default());
        Self { rig, model, motions: 0 }
    }

    fn play(&mut self, act: &Act) {
        match *act {
            Act::Ticks(count) => (0..count).for_each(|_| self.tick(1)),
            Act::Late(periods) => self.tick(periods),
            Act::Acquire { who, ttl_ticks } => {
                let ttl = PERIOD * ttl_ticks;
                self.ask(None, Order::AcquireLease { lease: lease(who), ttl });
            }
            Act::Renew(who) => self.ask(None, Order::RenewLease(lease(who))),
            Act::Release(who) => self.ask(None, Order::ReleaseLease(lease(who))),
            Act::Halt => self.ask(None, Order::Halt),
            Act::Command { under, what } => {
                let order = self.command(what);
                self.ask(under.map(lease), order);
            }
            Act::Stop(level) => self.rig.stop = level,
            Act::Error(code) => self.rig.plant.error_code = code,
        }
    }

    fn command(&mut self, what: Command) -> Order {
        self.motions += 1;
        let id = self.motions;
        match what {
            Command::Mode(mode) => Order::SetMode(mode),
            Command::ResetErrors => Order::ResetErrors,
            Command::Jog => jog(id, [if id.is_multiple_of(2) { 0.5 } else { -0.5 }, 0.0, 0.0]),
            Command::Follow(on_lease_loss) => {
                let held = self.rig.commands.last().expect("held").joint_position;
                let (a, b) = (held[0], if held[0] > 0.0 { -0.3 } else { 0.3 });
                let path = trajectory(&[(0.0, [a, 0.0, 0.0]), (2.0, [a + b, 0.0, 0.0])]);
                let order = FollowOrder::at_once(Uuid::from_u128(id), path);
                Order::Follow(FollowOrder { on_lease_loss, ..order })
            }
        }
    }

    fn ask(&mut self, lease: Option<Uuid>, order: Order) {
        if self.model.asked.len() == MAX_REQUESTS {
            self.tick(1);
        }
        let ticket = self.rig.order_under(lease, order.clone());
        self.model.asked.push(Asked { ticket, lease, order });
    }

    fn tick(&mut self, periods: u32) {
        let epoch = self.rig.epoch();
        let output = self.rig.late_tick(periods);
        let now = self.rig.now;
        self.model.begin_tick(now, self.rig.stop);
        self.model.follow(now, epoch, &output.events);
        let said: Vec<LeaseChange> = output
            .events
            .iter()
            .filter_map(|event| match event {
                LoopEvent::Lease(change) => Some(*change),
                _ => None,
            })
            .collect();
        assert_eq!(said, std::mem::take(&mut self.model.expected));
        let snapshot = output.snapshot;
        self.model.check(now, snapshot.lease, snapshot.motion.map(|motion| motion.id));
    }
}

proptest! {
    #![proptest_config(long_stories(21))]

    #[test]
    fn the_lease_is_as_its_model_whatever_happens(acts in prop::collection::vec(act(), 1..120)) {
        let mut story = Story::new();
        for act in &acts {
            story.play(act);
        }
        story.tick(1);
        story.rig.finish();
    }
}
