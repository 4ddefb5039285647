//! The lease against a small model, which reads what the loop says in its order.

mod model;

use armada_protocol::messages::{CommandMode, LeaseLoss, LeaseScope, Role, StopLevel};
use proptest::prelude::*;
use uuid::Uuid;

use self::model::{Asked, MAINS, Model, SUBS, lease};
use super::rig::{PERIOD, Rig, jog, long_stories, trajectory};
use crate::control::{FollowOrder, LeaseChange, LoopEvent, MAX_REQUESTS, Order};

/// Something that happens to the loop.
#[derive(Clone, Debug)]
enum Act {
    Ticks(usize),
    Late(u32),
    Acquire {
        who: u128,
        ttl_ticks: u32,
        role: Role,
    },
    Take {
        who: u128,
        ttl_ticks: u32,
        role: Role,
    },
    Delegate {
        by: u128,
        who: u128,
        scope: LeaseScope,
        ttl_ticks: u32,
    },
    Renew {
        who: u128,
        ttl_ticks: Option<u32>,
    },
    Release(u128),
    Command {
        under: Option<u128>,
        what: Command,
    },
    /// A request about leases comes once more, however old it is.
    Again(usize),
    Halt,
    Stop(Option<StopLevel>),
    Local(bool),
    Error(u32),
}

#[derive(Clone, Copy, Debug)]
enum Command {
    Mode(CommandMode),
    ResetErrors,
    Parameter,
    Jog,
    Follow(LeaseLoss),
}

fn act() -> impl Strategy<Value = Act> {
    let main = 0..MAINS;
    let sub = MAINS..MAINS + SUBS;
    let who = prop_oneof![2 => main.clone(), 2 => sub.clone()].boxed();
    let ttl = 0..60u32;
    let role = prop::sample::select(vec![Role::Program, Role::Operator, Role::Supervisor]);
    let scope =
        prop::sample::select(vec![LeaseScope::Arm, LeaseScope::EndEffector, LeaseScope::Io]);
    let reaction = prop_oneof![
        Just(LeaseLoss::StopOnPath),
        Just(LeaseLoss::Finish),
        (0.01..0.3).prop_map(LeaseLoss::ContinueS),
    ];
    let command = prop_oneof![
        2 => Just(Command::Mode(CommandMode::Jog)),
        3 => Just(Command::Mode(CommandMode::Trajectory)),
        3 => Just(Command::ResetErrors),
        2 => Just(Command::Parameter),
        2 => Just(Command::Jog),
        4 => reaction.prop_map(Command::Follow),
    ];
    let stop = prop_oneof![1 => Just(Some(StopLevel::L2)), 3 => Just(None)];
    prop_oneof![
        8 => (1..30usize).prop_map(Act::Ticks),
        1 => (2..20u32).prop_map(Act::Late),
        4 => (main.clone(), ttl.clone(), role.clone())
            .prop_map(|(who, ttl_ticks, role)| Act::Acquire { who, ttl_ticks, role }),
        2 => (main, ttl.clone(), role)
            .prop_map(|(who, ttl_ticks, role)| Act::Take { who, ttl_ticks, role }),
        6 => (who.clone(), sub, scope, ttl.clone())
            .prop_map(|(by, who, scope, ttl_ticks)| Act::Delegate { by, who, scope, ttl_ticks }),
        4 => (who.clone(), prop::option::weighted(0.3, ttl))
            .prop_map(|(who, ttl_ticks)| Act::Renew { who, ttl_ticks }),
        1 => who.clone().prop_map(Act::Release),
        2 => any::<usize>().prop_map(Act::Again),
        10 => (prop::option::of(who), command)
            .prop_map(|(under, what)| Act::Command { under, what }),
        2 => Just(Act::Halt),
        1 => stop.prop_map(Act::Stop),
        1 => prop::bool::weighted(0.3).prop_map(Act::Local),
        1 => (0..2u32).prop_map(Act::Error),
    ]
}

struct Story {
    rig: Rig,
    model: Model,
    motions: u128,
    /// Requests about leases, to come once more.
    sent: Vec<Order>,
}

impl Story {
    fn new() -> Self {
        let (rig, model) = (Rig::in_mode(CommandMode::Halt), Model::default());
        Self { rig, model, motions: 0, sent: Vec::new() }
    }

    fn play(&mut self, act: &Act) {
        match *act {
            Act::Ticks(count) => (0..count).for_each(|_| self.tick(1)),
            Act::Late(periods) => self.tick(periods),
            Act::Acquire { who, ttl_ticks, role } => {
                let (lease, ttl) = (lease(who), PERIOD * ttl_ticks);
                self.send(Order::AcquireLease { lease, ttl, role });
            }
            Act::Take { who, ttl_ticks, role } => {
                let (lease, ttl) = (lease(who), PERIOD * ttl_ticks);
                self.send(Order::TakeLease { lease, ttl, role });
            }
            Act::Delegate { by, who, scope, ttl_ticks } => {
                let (parent, lease, ttl) = (lease(by), lease(who), PERIOD * ttl_ticks);
                self.send(Order::DelegateLease { parent, lease, scope, ttl });
            }
            Act::Renew { who, ttl_ticks } => {
                let ttl = ttl_ticks.map(|ticks| PERIOD * ticks);
                self.send(Order::RenewLease { lease: lease(who), ttl });
            }
            Act::Release(who) => self.send(Order::ReleaseLease(lease(who))),
            Act::Again(which) => {
                if let Some(order) = self.sent.get(which % self.sent.len().max(1)) {
                    self.ask(None, order.clone());
                }
            }
            Act::Halt => self.ask(None, Order::Halt),
            Act::Command { under, what } => {
                let order = self.command(what);
                self.ask(under.map(lease), order);
            }
            Act::Stop(level) => self.rig.stop = level,
            Act::Local(local) => self.rig.plant.local_control = local,
            Act::Error(code) => self.rig.plant.error_code = code,
        }
    }

    fn command(&mut self, what: Command) -> Order {
        self.motions += 1;
        let id = self.motions;
        match what {
            Command::Mode(mode) => Order::SetMode(mode),
            Command::ResetErrors => Order::ResetErrors,
            Command::Parameter => {
                Order::SetParameter { parameter: 0, value: 0.0, restricted: true }
            }
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

    fn send(&mut self, order: Order) {
        self.sent.push(order.clone());
        self.ask(None, order);
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
        let (local, was_local) = (self.rig.plant.local_control, self.model.local);
        self.model.begin_tick(now, self.rig.stop, local);
        let switched = LoopEvent::LocalControl(local);
        let told = output.events.iter().filter(|event| **event == switched).count();
        assert_eq!(told, usize::from(local != was_local), "the pendant's taking over is told once");
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
        self.model.check(now, &output.snapshot);
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
