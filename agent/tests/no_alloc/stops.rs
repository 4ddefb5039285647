//! Beginnings, stops and faults.

use armada_agent::control::Order;
use armada_protocol::messages::{CommandMode, StopLevel};

use crate::orders::{follow, jog, set_mode};
use crate::rig::{Rig, trajectory};

#[test]
fn start_up_and_halt_allocate_nothing() {
    let mut rig = Rig::new();
    let feedback = rig.feedback.take();
    rig.ticks(10);
    rig.feedback = feedback;
    rig.ticks(10);
    rig.expect_mode(CommandMode::Halt);
}

#[test]
fn stops_of_every_level_and_their_clearing_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    for level in [StopLevel::L2, StopLevel::L1, StopLevel::L0] {
        rig.tick([Order::Enable]);
        rig.ticks(10);
        rig.tick([set_mode(CommandMode::Trajectory)]);
        let from = rig.held();
        rig.tick([follow(1, &trajectory(from, from + 0.4), None)]);
        rig.ticks(500);
        rig.stop = Some(level);
        rig.ticks(1000);
        rig.stop = None;
        rig.ticks(10);
    }
    rig.expect_mode(CommandMode::Halt);
}

#[test]
fn faults_resets_and_disabling_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Jog), jog(1, 1.0)]);
    rig.ticks(200);
    rig.feedback.as_mut().expect("heard").error_code = 3;
    rig.ticks(300);
    rig.expect_mode(CommandMode::InvalidState);
    rig.tick([Order::ResetErrors]);
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Jog), jog(2, 1.0)]);
    rig.ticks(200);
    let feedback = rig.feedback.take();
    rig.ticks(200);
    rig.feedback = feedback;
    rig.tick([Order::ResetErrors, Order::Halt]);
    rig.tick([Order::Disable]);
    rig.ticks(200);
    rig.expect_mode(CommandMode::Halt);
}
