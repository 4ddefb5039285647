//! Motions of several robots.

use std::time::Duration;

use armada_agent::control::{FollowOrder, GroupOrder, GroupWord, Order, Say, Word};
use armada_protocol::messages::{CommandMode, Coupling};
use uuid::Uuid;

use crate::orders::set_mode;
use crate::rig::{Rig, all, trajectory};

/// Ticks with a partner that says at each tick what this robot said at the one before.
fn with_an_echo(rig: &mut Rig, ticks: usize, orders: &[(usize, Order)]) {
    for tick in 0..ticks {
        let mut due = orders.iter().filter(|(at, _)| *at == tick).map(|(_, order)| order.clone());
        let output = match due.next() {
            Some(order) => rig.tick([order]),
            None => rig.tick([]),
        };
        for said in &output.group {
            let word = match said.say {
                Say::Go => Word::Go,
                Say::Heartbeat(beat) => Word::Heartbeat(beat),
                Say::Abort { from_phase_s, .. } => Word::Abort { from_phase_s },
            };
            rig.words.push(GroupWord { group: said.group, partner: 0, at: rig.now, word });
        }
    }
}

#[test]
fn motions_with_partners_their_pauses_and_their_ends_allocate_nothing() {
    let mut rig = Rig::new();
    rig.ticks(5);
    rig.tick([set_mode(CommandMode::Trajectory)]);
    let mut from = 0.0;
    for (id, coupling) in
        [(1, Coupling::Independent), (2, Coupling::TimeSynced), (3, Coupling::Rigid)]
    {
        let to = 0.3 - from;
        let path = trajectory(from, to);
        let group = GroupOrder {
            coupling,
            partners: 1,
            loss: Duration::from_millis(60),
            max_divergence_s: 0.05,
            rate_slope_s: 2.0,
        };
        let order = FollowOrder {
            start: Some(rig.now + Duration::from_millis(100)),
            group: Some(group),
            ..FollowOrder::at_once(Uuid::from_u128(id), path)
        };
        rig.tick([Order::Follow(order)]);
        let id = Uuid::from_u128(id);
        let orders = [
            (400, Order::Pause(id)),
            (1500, Order::Resume(id)),
            (1700, Order::SetSpeedRatio(0.5)),
            (2000, Order::SetSpeedRatio(1.0)),
        ];
        with_an_echo(&mut rig, 5000, &orders);
        let last = rig.tick([]);
        assert!(last.snapshot.motion.is_none(), "{coupling:?}: {:?}", last.snapshot.motion);
        assert_eq!(last.snapshot.joint_position_command, all(to));
        from = to;
    }
    // One whose partner is never heard.
    let order = FollowOrder {
        start: Some(rig.now + Duration::from_millis(100)),
        group: Some(GroupOrder {
            coupling: Coupling::TimeSynced,
            partners: 15,
            loss: Duration::from_millis(60),
            max_divergence_s: 0.05,
            rate_slope_s: 0.0,
        }),
        ..FollowOrder::at_once(Uuid::from_u128(9), trajectory(from, 0.3 - from))
    };
    rig.tick([Order::Follow(order)]);
    rig.ticks(500);
    assert!(rig.tick([]).snapshot.motion.is_none());
    rig.expect_mode(CommandMode::Trajectory);
}
