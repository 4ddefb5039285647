//! Packets survive both ways, and no bytes do harm.

use armada_protocol::messages::OperationalMode;
use proptest::prelude::*;

use super::super::wire::{
    Body, Header, MAX_VALUE, Power, RequestBody, Status, WireError, decode, encode,
};
use super::*;
use crate::drivers::LinkRefusal;

fn joints(len: usize) -> impl Strategy<Value = JointVector> {
    prop::collection::vec(-MAX_VALUE..=MAX_VALUE, len)
        .prop_map(|values| JointVector::from_slice(&values).expect("finite and few"))
}

fn set_points() -> impl Strategy<Value = SetPoint> {
    (1_usize..=16)
        .prop_flat_map(|len| (joints(len), joints(len)))
        .prop_map(|(joint_position, joint_velocity)| SetPoint { joint_position, joint_velocity })
}

fn requests() -> impl Strategy<Value = RequestBody> {
    let power = prop_oneof![
        Just((0, None)),
        (1_u32.., any::<bool>())
            .prop_map(|(id, on)| (id, Some(if on { Power::On } else { Power::Off }))),
    ];
    (power, any::<u32>()).prop_map(|((power_id, power), reset_id)| RequestBody {
        power_id,
        power,
        reset_id,
    })
}

fn statuses() -> impl Strategy<Value = Status> {
    let vectors = (1_usize..=16).prop_flat_map(|len| (joints(len), joints(len), joints(len)));
    let mode = prop::sample::select(vec![
        OperationalMode::Undefined,
        OperationalMode::ManualReducedSpeed,
        OperationalMode::ManualFullSpeed,
        OperationalMode::Auto,
        OperationalMode::Cobot,
    ]);
    (any::<(u64, u64, u32, u32)>(), any::<(bool, bool, bool)>(), mode, any::<u32>(), vectors)
        .prop_map(|(numbers, flags, operational_mode, error, vectors)| Status {
            time_ns: numbers.0,
            last_command: numbers.1,
            last_power_id: numbers.2,
            last_reset_id: numbers.3,
            enabled: flags.0,
            ready: flags.1,
            emergency_stop: flags.2,
            operational_mode,
            error,
            position: vectors.0,
            velocity: vectors.1,
            effort: vectors.2,
        })
}

fn bodies() -> impl Strategy<Value = Body> {
    let faults = prop::sample::select(vec![
        Fault::EmergencyStop,
        Fault::ControllerError(17),
        Fault::SilenceMs(500),
        Fault::BlockJoint(15),
        Fault::LatencyMs(0),
    ]);
    let refusals = prop_oneof![
        Just(LinkRefusal::Busy),
        any::<(u8, u8)>()
            .prop_map(|(controller, client)| LinkRefusal::JointCount { controller, client }),
        any::<u8>().prop_map(|controller| LinkRefusal::Version { controller }),
    ];
    prop_oneof![
        (1_u8..=16).prop_map(|joints| Body::Hello { joints }),
        set_points().prop_map(Body::Command),
        requests().prop_map(Body::Request),
        statuses().prop_map(Body::Status),
        refusals.prop_map(Body::Refused),
        faults.clone().prop_map(Body::Inject),
        (faults, any::<bool>())
            .prop_map(|(fault, accepted)| Body::InjectAnswer { fault, accepted }),
    ]
}

fn headers() -> impl Strategy<Value = Header> {
    (1_u64.., 1_u64.., 1_u64..).prop_map(|(sender, receiver, sequence)| Header {
        sender,
        receiver,
        sequence,
    })
}

/// Gives the bytes to both sides of a running pair.
fn feed(bytes: &[u8]) {
    let mut pair = Pair::new(quiet());
    pair.run(0.01);
    pair.driver.receive(pair.now, 0, bytes);
    pair.emulator.receive(pair.now, 0, address(50_004), bytes);
    pair.run(0.01);
}

proptest! {
    #[test]
    fn every_packet_survives(header in headers(), body in bodies()) {
        let mut buffer = [0; MAX_PACKET];
        let len = encode(&header, &body, &mut buffer);
        prop_assert!(len > 32);
        prop_assert_eq!(decode(&buffer[..len]), Ok((header, body)));
    }

    #[test]
    fn a_buffer_that_is_too_short_takes_nothing(body in bodies(), room in 0_usize..600) {
        let header = Header { sender: 1, receiver: 1, sequence: 1 };
        let mut whole = [0; MAX_PACKET];
        let len = encode(&header, &body, &mut whole);
        let mut buffer = vec![0; room];
        prop_assert_eq!(encode(&header, &body, &mut buffer), if room < len { 0 } else { len });
    }

    #[test]
    fn a_cut_or_lengthened_packet_is_refused(
        header in headers(), body in bodies(), cut in 0_usize..600,
    ) {
        let mut buffer = [0; MAX_PACKET];
        let len = encode(&header, &body, &mut buffer);
        prop_assume!(cut != len);
        prop_assert!(decode(&buffer[..cut]).is_err());
    }

    #[test]
    fn random_bytes_do_no_harm(bytes in prop::collection::vec(any::<u8>(), 0..1600)) {
        feed(&bytes);
    }

    #[test]
    fn altered_packets_do_no_harm(
        header in headers(),
        body in bodies(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        to_pair in any::<bool>(),
    ) {
        let header = if to_pair { Header { sender: 22, receiver: 11, ..header } } else { header };
        let mut buffer = [0; MAX_PACKET];
        let len = encode(&header, &body, &mut buffer);
        for (index, value) in changes {
            buffer[index.index(len)] = value;
        }
        if let Ok((header, body)) = decode(&buffer[..len]) {
            // What is taken is a packet that could have been sent.
            let mut again = [0; MAX_PACKET];
            prop_assert_eq!(encode(&header, &body, &mut again), len);
            prop_assert_eq!(&again[..len], &buffer[..len]);
        }
        feed(&buffer[..len]);
    }
}

#[test]
fn the_layout_is_the_documented_one() {
    let header = Header { sender: 0x0102, receiver: 0x0304, sequence: 5 };
    let mut buffer = [0; MAX_PACKET];
    let body = Body::Command(set_point([1.5, -2.0], [0.0, 0.25]));
    let len = encode(&header, &body, &mut buffer);
    let mut expected = b"ASIM\x01\x02\x41\x00".to_vec();
    expected.extend([2, 1, 0, 0, 0, 0, 0, 0, 4, 3, 0, 0, 0, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0, 2]);
    for value in [1.5_f64, -2.0, 0.0, 0.25] {
        expected.extend(value.to_le_bytes());
    }
    assert_eq!(&buffer[..len], &expected);
}

#[test]
fn numbers_that_are_not_finite_or_too_large_are_refused() {
    let header = Header { sender: 1, receiver: 2, sequence: 3 };
    let mut buffer = [0; MAX_PACKET];
    let len = encode(&header, &Body::Command(set_point([0.0; 2], [0.0; 2])), &mut buffer);
    for value in [f64::NAN, f64::INFINITY, 2.0 * MAX_VALUE, -f64::MAX] {
        buffer[len - 8..len].copy_from_slice(&value.to_le_bytes());
        assert_eq!(decode(&buffer[..len]), Err(WireError::Field { field: "velocities" }));
    }
}

#[test]
fn only_what_may_be_anonymous_is() {
    let mut buffer = [0; MAX_PACKET];
    let mut decoded = |sender, receiver, body: Body| {
        let len = encode(&Header { sender, receiver, sequence: 1 }, &body, &mut buffer);
        decode(&buffer[..len]).map(|_| ())
    };
    let command = Body::Command(set_point([0.0; 2], [0.0; 2]));
    assert_eq!(decoded(0, 1, command), Err(WireError::Field { field: "sender" }));
    assert_eq!(decoded(1, 0, command), Err(WireError::Field { field: "receiver" }));
    assert_eq!(decoded(1, 0, Body::Hello { joints: 2 }), Ok(()));
    assert_eq!(decoded(0, 0, Body::Inject(Fault::Freeze)), Ok(()));
}
