//! The recorder, and tools.

use std::sync::Arc;

use armada_agent::control::{EquipmentOrder, Order};
use armada_agent::drivers::LoadSetting;
use armada_agent::recorder::Tape;
use armada_protocol::messages::CommandMode;

use crate::orders::{follow, jog, set_mode};
use crate::rig::{PERIOD, Rig, equipment, trajectory};

#[test]
fn the_recorder_allocates_nothing_and_frees_nothing_whatever_it_takes_down() {
    let mut rig = Rig::new();
    rig.tape = Some(Tape::new(&rig.state, PERIOD.as_secs_f64(), 4.0));
    rig.ticks(5);
    for round in 0..8 {
        rig.tick([set_mode(CommandMode::Trajectory)]);
        let path = trajectory(0.0, 0.2);
        rig.tick([follow(100 + 3 * round, &path, None)]);
        drop(path);
        rig.ticks(700);
        rig.tick([Order::Halt]);
        rig.ticks(300);
        rig.tick([set_mode(CommandMode::Jog)]);
        rig.tick([jog(101 + 3 * round, 0.0)]);
        rig.ticks(900);
        if let Some((tape, _)) = &mut rig.tape {
            tape.save();
        }
        rig.tick([Order::Halt]);
        rig.ticks(300);
    }
    rig.expect_mode(CommandMode::Halt);
}

#[test]
fn other_tools_and_values_allocate_nothing_and_are_not_freed_in_the_loop() {
    let mut rig = Rig::new();
    rig.ticks(500);
    for config_seqno in 2..6 {
        let mut equipment = equipment();
        equipment.config_seqno = config_seqno;
        let order = EquipmentOrder {
            equipment: Arc::new(equipment),
            load: Some((0, LoadSetting::default())),
            replaces: config_seqno - 1,
        };
        let output = rig.tick([Order::SetEquipment(order)]);
        assert_eq!(output.retired.len(), 1, "the old tools come back");
        assert_eq!(output.snapshot.config_seqno, config_seqno);
        rig.ticks(10);
    }
    rig.expect_mode(CommandMode::Halt);
}
