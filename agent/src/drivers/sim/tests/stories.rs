//! Ten thousand random sequences of commands, faults and stops through the loop and the emulated
//! controller: no set-point is ever outside the limits, and while the controller moves by itself
//! none is sent and what it reports keeps them.

mod orders;
mod watch;

use std::sync::Arc;

use armada_model::{Chain, Pose, RobotModel};
use armada_protocol::messages::{CommandMode, HomeMethod, StopLevel};
use uuid::Uuid;

use super::super::HomingConfig;
use super::*;
use crate::control::{
    Equipment, EquippedChain, HomeOrder, Input, LoopAbilities, LoopRequest, LoopState, Order,
    Params, Snapshot, step,
};
use crate::drivers::JointSet;
use watch::Watch;

const SEQUENCES: u32 = 10_000;
/// Speed of the controller's search of references over the limit.
const SEARCH_SHARE: f64 = 0.5;

/// A joint that turns and one that slides, with a tool that both move in a plane.
const URDF: &str = r#"<robot name="polar">
  <link name="base"/><link name="arm"/><link name="tool"/>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="2" effort="100"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="arm"/><child link="tool"/><origin xyz="0.8 0 0"/><axis xyz="1 0 0"/>
    <limit lower="-0.5" upper="0.5" velocity="0.2" effort="100"/>
  </joint>
</robot>"#;

fn chain() -> Chain {
    let model = RobotModel::from_urdf(URDF, "polar.urdf").expect("a robot");
    Chain::new(&model, "base", "tool").expect("a chain")
}

/// The robot of the other tests, whose controller knows its chain.
fn polar(nonce: u64) -> DriverSetup {
    DriverSetup { chains: vec![Some(chain())], ..setup(nonce) }
}

/// A controller that homes and moves by itself.
fn emulator() -> EmulatorConfig {
    let homing = HomingConfig {
        required: true,
        speed_share: SEARCH_SHARE,
        spacing_rad: 0.05,
        spacing_m: 0.005,
        ..HomingConfig::default()
    };
    EmulatorConfig { homing, own_moves: true, enable_time_ms: 20.0, ..EmulatorConfig::default() }
}

fn params() -> Params {
    let limits: Vec<_> = setup(1).joints.iter().map(|joint| joint.limits).collect();
    let arm = EquippedChain {
        chain: chain().with_limits(&limits),
        tcp: Pose::default(),
        base_in_world: Pose::from_translation(1.0, -2.0, 0.5),
        joints: vec![0, 1],
        load: crate::drivers::LoadSetting::default(),
    };
    let abilities = LoopAbilities {
        homing: true,
        move_joint: true,
        move_pose: true,
        move_linear: true,
        pause: true,
        load: true,
    };
    Params {
        home: vec![Some(0.1), Some(0.01)],
        abilities,
        // Short, for stories in which much happens.
        standstill_hold: Duration::from_millis(50),
        equipment: Arc::new(Equipment { config_seqno: 1, chains: vec![arm] }),
        ..Params::for_joints(limits, PERIOD).expect("two joints")
    }
}

/// A loop with the emulated controller behind it.
struct Cell {
    pair: Pair,
    params: Params,
    state: LoopState,
    chain: Chain,
    stop: Option<StopLevel>,
    dice: Noise,
    ids: u128,
    lease: Option<Uuid>,
    samples: u64,
    snapshot: Option<Snapshot>,
    watch: Watch,
}

impl Cell {
    /// A cell that is ready to move.
    fn new() -> Self {
        let params = params();
        let mut cell = Self {
            pair: Pair::of(polar, emulator(), Weather::default()),
            state: LoopState::new(&params).expect("sensible"),
            watch: Watch::new(&params),
            params,
            chain: chain(),
            stop: None,
            dice: Noise::new(4),
            ids: 0,
            lease: None,
            samples: 0,
            snapshot: None,
        };
        cell.ticks(10);
        cell.recover();
        assert!(cell.is_homed());
        cell
    }

    /// An order and some time, now and then a fault.
    fn chapter(&mut self) {
        let order = self.order();
        let begins_motion = order.motion_id().is_some();
        self.enter_its_mode(&order);
        self.tick(Some(order));
        // Mostly the next order comes at once, but motions come to their end too.
        let count = if self.below(10) == 0 { self.below(100) } else { self.below(8) };
        self.ticks(count);
        if begins_motion && self.below(12) == 0 {
            self.until(700, |cell| cell.snapshot.is_none_or(|now| now.motion.is_none()));
        }
        if self.below(40) == 0 {
            self.harm();
        }
    }

    fn harm(&mut self) {
        let harms = [
            "estop",
            "estop_release",
            "drives_off",
            "error=7",
            "silence_ms=150",
            "guard_open=1",
            "guard_close=1",
            "key_switch=auto",
            "key_switch=manual_reduced_speed",
            "key_switch=cobot",
            "block_joint=0",
            "unblock",
        ];
        match self.below(16) as usize {
            12 => self.stop = Some(StopLevel::L2),
            13 => self.stop = Some(StopLevel::L1),
            14 => self.stop = Some(StopLevel::L0),
            15 => self.stop = None,
            which => {
                self.watch.joint_is_blocked |= harms[which] == "block_joint=0";
                self.pair.inject(harms[which]);
            }
        }
    }

    fn tick(&mut self, order: Option<Order>) {
        let mut input = Input {
            feedback: self.pair.driver.feedback().copied(),
            stop: self.stop,
            ..Input::at(self.pair.now)
        };
        if let Some(order) = order {
            let lease = self.lease.filter(|_| self.below(10) > 0);
            input.requests.push(LoopRequest { ticket: 0, lease, until: None, order });
        }
        if self.below(3) == 0
            && let Some(sample) = self.sample()
        {
            input.stream.push(sample);
        }
        let feedback = input.feedback;
        let output = step(&self.params, &mut self.state, &mut input);
        self.watch.see(feedback.as_ref(), &output);
        if let Some(request) = output.driver_request {
            self.pair.driver.request(self.pair.now, request);
        }
        if let Some(command) = &output.command {
            self.pair.driver.command(self.pair.now, command);
        }
        self.snapshot = Some(output.snapshot);
        self.pair.tick();
    }

    fn ticks(&mut self, count: u32) {
        for _ in 0..count {
            self.tick(None);
        }
    }

    /// Until it is so, or `patience` ticks.
    fn until(&mut self, patience: u32, is_so: impl Fn(&Self) -> bool) {
        for _ in 0..patience {
            if is_so(self) {
                return;
            }
            self.tick(None);
        }
    }

    fn is_homed(&self) -> bool {
        self.pair.driver.feedback().is_some_and(|feedback| feedback.homed == JointSet::first(2))
    }

    /// Puts right what the story did, as a person would.
    fn recover(&mut self) {
        self.stop = None;
        self.lease = None;
        for harm in ["unblock", "guard_close=1", "estop_release", "key_switch=cobot"] {
            self.pair.inject(harm);
        }
        for order in [Order::ResetErrors, Order::Enable, Order::Halt] {
            self.tick(Some(order));
            self.ticks(30);
        }
        self.tick(Some(Order::SetSpeedRatio(1.0)));
        self.watch.joint_is_blocked = false;
        if !self.is_homed() {
            self.tick(Some(Order::SetMode(CommandMode::Homing)));
            let home = self.home(HomeMethod::Controller);
            self.tick(Some(Order::Home(home)));
            self.until(400, Self::is_homed);
            self.ticks(10);
        }
    }

    fn home(&mut self, method: HomeMethod) -> HomeOrder {
        let both = JointSet::first(2);
        let groups = std::array::from_fn(|group| if group == 0 { both } else { JointSet::NONE });
        HomeOrder { id: self.id(), groups, method }
    }
}

#[test]
fn ten_thousand_random_sequences_send_no_set_point_outside_the_limits() {
    let mut cell = Cell::new();
    for sequence in 0..SEQUENCES {
        for _ in 0..4 {
            cell.chapter();
        }
        if sequence.is_multiple_of(3) {
            cell.recover();
        }
    }
    cell.watch.assert_that_all_happened();
}
