//! Streams of commands.

use std::time::Duration;

use armada_agent::control::{Order, StreamSample, StreamValues};
use armada_agent::drivers::JointSet;
use armada_model::JointVector;
use armada_protocol::messages::{CommandMode, StreamHeader};
use uuid::Uuid;

use crate::orders::set_mode;
use crate::rig::{JOINTS, Rig, all};

/// Streams to a new lease in `mode`, with wrong samples and gaps among the good ones.
fn stream(rig: &mut Rig, lease: Uuid, mode: CommandMode, values: impl Fn(f64) -> StreamValues) {
    rig.tick([Order::AcquireLease {
        lease,
        ttl: Duration::from_secs(60),
        role: Default::default(),
    }]);
    // Orders of this rig name no lease, so the mode comes first where one is held.
    let mut snapshot = rig.ticks(500).snapshot;
    assert_eq!(snapshot.command_mode, mode);
    for seq in 1..1000u64 {
        let (epoch, state_seqno) = (snapshot.epoch, snapshot.seqno);
        let header = StreamHeader { lease, epoch, seq, state_seqno };
        let values = values((seq as f64 * 0.01).sin());
        let wrong = StreamHeader { epoch: 0, ..header };
        if seq % 100 > 60 {
            rig.stream.push(StreamSample { header: wrong, values });
        } else if seq % 3 == 0 {
            rig.stream.push(StreamSample { header, values });
            rig.stream.push(StreamSample { header, values });
        }
        snapshot = rig.tick([]).snapshot;
    }
    assert!(snapshot.stream.is_some_and(|stream| stream.taken > 100));
    assert!(snapshot.dropped_samples.sequence > 100 && snapshot.dropped_samples.epoch > 100);
}

#[test]
fn streams_of_positions_and_speeds_allocate_nothing() {
    let joints = JointSet::first(JOINTS);
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::PositionCommand)]);
    let position = |at: f64| StreamValues::Position {
        joints,
        position: all(4.0 * at),
        velocity: JointVector::EMPTY,
    };
    stream(&mut rig, Uuid::from_u128(1), CommandMode::PositionCommand, position);
    rig.tick([Order::ReleaseLease(Uuid::from_u128(1)), Order::Halt]);
    rig.ticks(1000);
    rig.tick([set_mode(CommandMode::VelocityCommand)]);
    let velocity = |at: f64| StreamValues::Velocity { joints, velocity: all(3.0 * at) };
    stream(&mut rig, Uuid::from_u128(2), CommandMode::VelocityCommand, velocity);
    rig.tick([Order::ReleaseLease(Uuid::from_u128(2)), Order::Halt]);
    rig.ticks(1000);
    rig.expect_mode(CommandMode::Halt);
}
