//! Packets survive both ways, and no bytes do harm.

use armada_model::Pose;
use armada_protocol::messages::{OperationalMode, RobotFlags};
use nalgebra::{Isometry3, Vector3};
use proptest::prelude::*;

use super::super::wire::{
    Body, Header, MAX_VALUE, Power, RequestBody, Status, WireError, decode, encode,
};
use super::*;
use crate::drivers::{
    DelegatedGoal, DelegatedMove, DelegatedReport, DelegatedStatus, JointSet, LinkRefusal,
    LoadSetting, ReportedTip, TipFrame, Values,
};

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
    let order = prop_oneof![
        Just((0, None)),
        (1_u32.., orders()).prop_map(|(id, order)| (id, Some(order))),
    ];
    (power, any::<u32>(), order).prop_map(|((power_id, power), reset_id, (order_id, order))| {
        RequestBody { power_id, power, reset_id, order_id, order }
    })
}

fn poses() -> impl Strategy<Value = Pose> {
    prop::array::uniform6(-10.0..10.0_f64).prop_map(|[x, y, z, a, b, c]| {
        Pose::from_isometry(Isometry3::new(Vector3::new(x, y, z), Vector3::new(a, b, c)))
    })
}

fn moves() -> impl Strategy<Value = DelegatedMove> {
    let goal = prop_oneof![
        (1_usize..=16).prop_flat_map(joints).prop_map(DelegatedGoal::Joint),
        (any::<u8>(), poses()).prop_map(|(chain, pose)| DelegatedGoal::Pose { chain, pose }),
        (any::<u8>(), poses()).prop_map(|(chain, pose)| DelegatedGoal::Linear { chain, pose }),
    ];
    (any::<u32>(), goal, 0.01..=1.0, 0.0..1.0, any::<bool>()).prop_map(
        |(number, goal, speed, blend_radius_m, connect)| DelegatedMove {
            number,
            goal,
            speed,
            blend_radius_m,
            connect,
        },
    )
}

fn values<const N: usize>() -> impl Strategy<Value = Values<N>> {
    prop::collection::vec(-MAX_VALUE..=MAX_VALUE, 0..=N)
        .prop_map(|values| Values::from_slice(&values).expect("few"))
}

fn loads() -> impl Strategy<Value = LoadSetting> {
    (0.0..100.0, prop::array::uniform3(-1.0..1.0), prop::array::uniform6(-1.0..1.0))
        .prop_map(|(mass, com, inertia)| LoadSetting { mass, com, inertia })
}

fn orders() -> impl Strategy<Value = DriverRequest> {
    prop_oneof![
        any::<u16>().prop_map(|bits| DriverRequest::Home(JointSet::from_bits(bits))),
        moves().prop_map(DriverRequest::Move),
        Just(DriverRequest::StopMotion),
        Just(DriverRequest::PauseMotion),
        Just(DriverRequest::ResumeMotion),
        (0.01..=1.0).prop_map(DriverRequest::SetSpeedRatio),
        (any::<u8>(), values())
            .prop_map(|(signal, values)| DriverRequest::SetSignal { signal, values }),
        (any::<u8>(), -MAX_VALUE..=MAX_VALUE)
            .prop_map(|(parameter, value)| DriverRequest::SetParameter { parameter, value }),
        (any::<u8>(), loads()).prop_map(|(chain, load)| DriverRequest::SetLoad { chain, load }),
        (any::<u8>(), poses()).prop_map(|(chain, tool)| DriverRequest::SetTool { chain, tool }),
    ]
}

fn reports() -> impl Strategy<Value = Option<DelegatedReport>> {
    let status = prop_oneof![
        Just(DelegatedStatus::Waiting),
        Just(DelegatedStatus::Running),
        Just(DelegatedStatus::Paused),
        Just(DelegatedStatus::Done),
        Just(DelegatedStatus::Stopped),
        any::<u32>().prop_map(|code| DelegatedStatus::Failed { code }),
    ];
    prop::option::of((any::<u32>(), status, 0.0..=1.0).prop_map(|(number, status, progress)| {
        DelegatedReport { number, status, progress }
    }))
}

fn tips() -> impl Strategy<Value = [Option<ReportedTip>; 2]> {
    let frame = prop::sample::select(vec![TipFrame::Flange, TipFrame::Tcp]);
    let tip = (any::<u8>(), frame, poses())
        .prop_map(|(chain, frame, pose)| ReportedTip { chain, frame, pose });
    prop::collection::vec(tip, 0..=2)
        .prop_map(|tips| [tips.first().copied(), tips.get(1).copied()])
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
    let conditions = any::<(bool, bool)>().prop_map(|(button, guard)| {
        RobotFlags::ENABLING_SWITCH
            .with(RobotFlags::ESTOP_BUTTON2, button)
            .with(RobotFlags::ESTOP_GUARD4, guard)
    });
    let ids = any::<(u64, u64, u32, u32, u32, u32)>();
    let more = (reports(), values(), values(), tips(), conditions);
    (ids, any::<(bool, bool, bool, bool, bool)>(), mode, vectors, any::<(u16, u16)>(), more)
        .prop_map(|(numbers, flags, operational_mode, vectors, sets, more)| Status {
            time_ns: numbers.0,
            last_command: numbers.1,
            last_power_id: numbers.2,
            last_reset_id: numbers.3,
            last_order_id: numbers.4,
            enabled: flags.0,
            ready: flags.1,
            emergency_stop: flags.2,
            guard_stop: flags.3,
            local_control: flags.4,
            conditions: more.4,
            operational_mode,
            error: numbers.5,
            homed: of_joints(sets.0, vectors.0.len()),
            homing: of_joints(sets.1, vectors.0.len()),
            position: vectors.0,
            velocity: vectors.1,
            effort: vectors.2,
            delegated: more.0,
            signals: more.1,
            parameters: more.2,
            tips: more.3,
        })
}

fn of_joints(bits: u16, count: usize) -> JointSet {
    JointSet::from_bits(bits & JointSet::first(count).bits())
}

fn bodies() -> impl Strategy<Value = Body> {
    let faults = prop::sample::select(vec![
        Fault::EmergencyStop,
        Fault::ControllerError(17),
        Fault::SilenceMs(500),
        Fault::BlockJoint(15),
        Fault::LatencyMs(0),
        Fault::KeySwitch(OperationalMode::Auto),
        Fault::GuardOpen(4),
        "input=FT1[2]:-9.5".parse().expect("a fault"),
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
    fn a_buffer_that_is_too_short_takes_nothing(body in bodies(), room in 0_usize..1100) {
        let header = Header { sender: 1, receiver: 1, sequence: 1 };
        let mut whole = [0; MAX_PACKET];
        let len = encode(&header, &body, &mut whole);
        let mut buffer = vec![0; room];
        prop_assert_eq!(encode(&header, &body, &mut buffer), if room < len { 0 } else { len });
    }

    #[test]
    fn a_cut_or_lengthened_packet_is_refused(
        header in headers(), body in bodies(), cut in 0_usize..1100,
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

/// The bytes of a packet from run 0x0102 to run 0x0304, its fifth, without the header.
fn body_bytes(body: &Body) -> Vec<u8> {
    let header = Header { sender: 0x0102, receiver: 0x0304, sequence: 5 };
    let mut buffer = [0; MAX_PACKET];
    let len = encode(&header, body, &mut buffer);
    let (kind, length) = (buffer[5], len as u8);
    let mut expected = vec![b'A', b'S', b'I', b'M', 3, kind, length, (len >> 8) as u8];
    expected.extend([2, 1, 0, 0, 0, 0, 0, 0, 4, 3, 0, 0, 0, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(&buffer[..32], &expected);
    buffer[32..len].to_vec()
}

/// Bytes and numbers one after another.
fn bytes(parts: &[&dyn AsBytes]) -> Vec<u8> {
    parts.iter().flat_map(|part| part.bytes()).collect()
}

trait AsBytes {
    fn bytes(&self) -> Vec<u8>;
}

impl<const N: usize> AsBytes for [u8; N] {
    fn bytes(&self) -> Vec<u8> {
        self.to_vec()
    }
}

impl<const N: usize> AsBytes for [f64; N] {
    fn bytes(&self) -> Vec<u8> {
        self.iter().flat_map(|value| value.to_le_bytes()).collect()
    }
}

#[test]
fn the_layout_of_small_packets_is_the_documented_one() {
    assert_eq!(body_bytes(&Body::Hello { joints: 7 }), [7]);
    let command = Body::Command(set_point([1.5, -2.0], [0.0, 0.25]));
    assert_eq!(body_bytes(&command), bytes(&[&[2_u8], &[1.5, -2.0, 0.0, 0.25]]));
    let refusal = LinkRefusal::JointCount { controller: 6, client: 7 };
    assert_eq!(body_bytes(&Body::Refused(refusal)), [2, 6, 7]);
    let fault: Fault = "input=AI1:2.5".parse().expect("a fault");
    let expected = bytes(&[&[23_u8, 0, 0, 0, 0], &[2.5], b"\x03AI1"]);
    assert_eq!(body_bytes(&Body::Inject(fault)), expected);
    let answer = Body::InjectAnswer { fault: Fault::BlockJoint(3), accepted: true };
    assert_eq!(body_bytes(&answer), bytes(&[&[8_u8, 3, 0, 0, 0], &[0.0], &[0_u8, 1]]));
}

#[test]
fn the_layout_of_requests_is_the_documented_one() {
    let request = |order_id, order| {
        let power = Some(Power::Off);
        body_bytes(&Body::Request(RequestBody { power_id: 3, power, reset_id: 4, order_id, order }))
    };
    assert_eq!(request(0, None), [3, 0, 0, 0, 2, 4, 0, 0, 0, 0, 0, 0, 0, 0]);
    let begin = [3_u8, 0, 0, 0, 2, 4, 0, 0, 0, 9, 0, 0, 0];
    let order = |order| request(9, Some(order));
    let home = DriverRequest::Home(JointSet::from_bits(0x0105));
    assert_eq!(order(home), bytes(&[&begin, &[1_u8, 5, 1]]));
    let goal = DelegatedGoal::Linear { chain: 1, pose: Pose::from_translation(1.0, 2.0, 3.0) };
    let wanted =
        DelegatedMove { number: 6, goal, speed: 0.5, blend_radius_m: 0.25, connect: true };
    let expected = bytes(&[
        &begin,
        &[2_u8, 6, 0, 0, 0],
        &[0.5, 0.25],
        &[1_u8, 3, 1],
        &[1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0],
    ]);
    assert_eq!(order(DriverRequest::Move(wanted)), expected);
    let values = Values::from_slice(&[1.0, 0.0]).expect("few");
    let signal = DriverRequest::SetSignal { signal: 4, values };
    assert_eq!(order(signal), bytes(&[&begin, &[7_u8, 4, 2], &[1.0, 0.0]]));
    let parameter = DriverRequest::SetParameter { parameter: 2, value: 8.0 };
    assert_eq!(order(parameter), bytes(&[&begin, &[8_u8, 2], &[8.0]]));
}

fn status(joints: usize, signals: usize, parameters: usize, tips: usize) -> Status {
    let all = |value: f64| {
        JointVector::from_slice(&vec![value; joints]).expect("finite and few")
    };
    let pose = Pose::from_translation(0.5, 0.0, 0.0);
    let tip = |place| {
        (place < tips).then_some(ReportedTip { chain: place as u8, frame: TipFrame::Tcp, pose })
    };
    Status {
        time_ns: 1,
        last_command: 2,
        last_power_id: 3,
        last_reset_id: 4,
        last_order_id: 5,
        enabled: true,
        ready: false,
        emergency_stop: false,
        guard_stop: true,
        local_control: true,
        conditions: RobotFlags::ESTOP_GUARD1,
        operational_mode: OperationalMode::Cobot,
        error: 6,
        homed: JointSet::first(1),
        homing: JointSet::NONE,
        position: all(1.0),
        velocity: all(2.0),
        effort: all(3.0),
        delegated: Some(DelegatedReport {
            number: 7,
            status: DelegatedStatus::Failed { code: 8 },
            progress: 0.5,
        }),
        signals: Values::from_slice(&vec![4.0; signals]).expect("few"),
        parameters: Values::from_slice(&vec![5.0; parameters]).expect("few"),
        tips: [tip(0), tip(1)],
    }
}

#[test]
fn the_layout_of_the_status_is_the_documented_one() {
    let expected = bytes(&[
        &[1_u8, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0],
        &[3_u8, 0, 0, 0, 4, 0, 0, 0, 5, 0, 0, 0],
        &[0b1_1001_u8, 4, 0x80, 0, 0, 0, 6, 0, 0, 0],
        &[1_u8, 1, 0, 0, 0],
        &[1.0, 2.0, 3.0],
        &[6_u8, 7, 0, 0, 0, 8, 0, 0, 0],
        &[0.5],
        &[1_u8],
        &[4.0],
        &[1_u8],
        &[5.0],
        &[1_u8, 0, 2],
        &[0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
    ]);
    assert_eq!(body_bytes(&Body::Status(status(1, 1, 1, 1))), expected);
}

#[test]
fn the_largest_status_fits_into_a_packet() {
    assert_eq!(32 + body_bytes(&Body::Status(status(16, 32, 16, 2))).len(), 979);
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
