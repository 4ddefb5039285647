//! Every golden sample decodes to its type and comes back the same, in both encodings.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::cell::Cell;
use std::fs;
use std::path::PathBuf;

use armada_protocol::codec::{CodecError, WireEncoding};
use armada_protocol::messages::*;
use armada_protocol::signature::SigningKey;
use serde::de::DeserializeOwned;
use serde::{Serialize, Serializer};
use serde_json::Value;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("golden")
}

fn check<T: Serialize + DeserializeOwned>(name: &str) {
    let path = folder().join(name).with_extension("json");
    let text = fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let golden: Value = serde_json::from_slice(&text).expect("golden sample is JSON");
    let message: T =
        serde_json::from_value(golden.clone()).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert_eq!(serde_json::to_value(&message).expect("encodes"), golden, "{name}");
    let packed = WireEncoding::MessagePack.encode(&message).expect("packs");
    let unpacked: T = WireEncoding::MessagePack.decode(&packed, 1 << 20).expect("unpacks");
    assert_eq!(serde_json::to_value(&unpacked).expect("encodes"), golden, "{name} as MessagePack");
}

/// A message with its number at one place, counted from 0, replaced by another.
struct Spoilt<'a> {
    message: &'a Value,
    by: f64,
    /// How many numbers are still to come before it.
    left: &'a Cell<usize>,
}

impl Serialize for Spoilt<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let inner = |message| Spoilt { message, ..*self };
        match self.message {
            Value::Object(map) => serializer.collect_map(map.iter().map(|(k, v)| (k, inner(v)))),
            Value::Array(list) => serializer.collect_seq(list.iter().map(inner)),
            Value::Number(_) => {
                let left = self.left.get();
                self.left.set(left.wrapping_sub(1));
                if left == 0 {
                    self.by.serialize(serializer)
                } else {
                    self.message.serialize(serializer)
                }
            }
            other => other.serialize(serializer),
        }
    }
}

/// Paths of all numbers, in their order.
fn numbers(message: &Value, path: &str, paths: &mut Vec<String>) {
    match message {
        Value::Object(map) => {
            let dot = if path.is_empty() { "" } else { "." };
            map.iter().for_each(|(key, value)| numbers(value, &format!("{path}{dot}{key}"), paths));
        }
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(at, v)| numbers(v, &format!("{path}[{at}]"), paths));
        }
        Value::Number(_) => paths.push(path.to_owned()),
        _ => {}
    }
}

/// How many numbers the message has.
fn check_not_finite<T: DeserializeOwned>(name: &str) -> usize {
    let path = folder().join(name).with_extension("json");
    let golden: Value = serde_json::from_slice(&fs::read(path).expect("a file")).expect("JSON");
    let mut paths = Vec::new();
    numbers(&golden, "", &mut paths);
    for (at, path) in paths.iter().enumerate() {
        for by in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let spoilt = Spoilt { message: &golden, by, left: &Cell::new(at) };
            let bytes = WireEncoding::MessagePack.encode(&spoilt).expect("packs");
            match WireEncoding::MessagePack.decode::<T>(&bytes, 1 << 20).map(|_| "a message") {
                Err(CodecError::NotFinite { field, value }) => {
                    assert_eq!(&field, path, "{name}");
                    assert!(!value.is_finite());
                }
                other => panic!("{name}: {path} as {by} gives {other:?}"),
            }
        }
    }
    paths.len()
}

macro_rules! golden {
    ($($name:literal: $message:ty,)+) => {
        const NAMES: &[&str] = &[$($name),+];

        #[test]
        fn every_sample_comes_back_the_same_in_both_encodings() {
            $(check::<$message>($name);)+
        }

        #[test]
        fn no_number_of_any_message_may_be_infinite_or_none() {
            let counts = [$(check_not_finite::<$message>($name)),+];
            assert!(counts.iter().sum::<usize>() > 300, "{counts:?} numbers");
        }
    };
}

golden! {
    "robot_info": RobotInfo,
    "robot_state": RobotState,
    "robot_status": RobotStatus,
    "joint_state": JointState,
    "event": Event,
    "motion_status": MotionStatus,
    "stop_request": StopRequest,
    "stop_ack": StopAck,
    "stop_report": StopReport,
    "stop_challenge": StopChallenge,
    "stop_check_in": StopCheckIn,
    "clock_sample": ClockSample,
    "denial": Denial,
    "cell_info": CellInfo,
    "cell_status": CellStatus,
    "cell_frames": CellFrames,
    "cell_motion_status": CellMotionStatus,
    "group_go": GroupGo,
    "group_heartbeat": GroupHeartbeat,
    "group_abort": GroupAbort,
    "request_set_mode": Request<SetModeParams>,
    "request_empty": Request<Empty>,
    "request_jog_freespace": Request<JogFreespaceParams>,
    "request_execute_trajectory": Request<ExecuteTrajectoryParams>,
    "request_prepare": Request<PrepareParams>,
    "request_commit": Request<CommitParams>,
    "request_cancel": Request<CancelParams>,
    "request_reset": Request<ResetParams>,
    "request_cell_execute_trajectory": Request<CellExecuteTrajectory>,
    "request_cell_reset": Request<CellResetParams>,
    "request_cell_acquire_lease": Request<CellAcquireLeaseParams>,
    "request_cell_renew_lease": Request<CellLeaseParams>,
    "request_cell_release_lease": Request<CellLeaseParams>,
    "request_cell_pause": Request<MotionParams>,
    "request_cell_resume": Request<MotionParams>,
    "request_cell_set_speed_ratio": Request<CellSpeedRatioParams>,
    "request_cell_check_clearance": Request<CheckClearanceParams>,
    "request_acquire_lease": Request<AcquireLeaseParams>,
    "request_renew_lease": Request<RenewLeaseParams>,
    "request_release_lease": Request<LeaseParams>,
    "request_take_lease": Request<TakeLeaseParams>,
    "request_delegate_lease": Request<DelegateLeaseParams>,
    "request_home": Request<HomeParams>,
    "request_jog_joint": Request<JogJointParams>,
    "request_jog_cartesian": Request<JogCartesianParams>,
    "request_move_joint": Request<MoveJointParams>,
    "request_move_pose": Request<MovePoseParams>,
    "request_move_linear": Request<MovePoseParams>,
    "request_move_home": Request<MoveHomeParams>,
    "request_pause": Request<MotionParams>,
    "request_resume": Request<MotionParams>,
    "request_set_speed_ratio": Request<SpeedRatioParams>,
    "request_attach_tool": Request<AttachToolParams>,
    "request_detach_tool": Request<DetachParams>,
    "request_attach_payload": Request<AttachPayloadParams>,
    "request_detach_payload": Request<DetachParams>,
    "request_get_param": Request<NameParams>,
    "request_set_param": Request<SetValueParams>,
    "request_get_signal": Request<NameParams>,
    "request_set_signal": Request<SetValueParams>,
    "request_forward_kinematics": Request<ForwardKinematicsParams>,
    "request_inverse_kinematics": Request<InverseKinematicsParams>,
    "stream_position": StreamCommand,
    "stream_velocity": StreamCommand,
    "stream_twist": StreamTwist,
    "joint_command": JointCommand,
    "answer_mode": ModeAnswer,
    "answer_halt": HaltAnswer,
    "answer_accepted": Accepted,
    "answer_accepted_and_ended": Accepted,
    "answer_prepared": Prepared,
    "answer_reset": ResetAnswer,
    "answer_cell_reset": CellResetAnswer,
    "answer_lease": LeaseGrant,
    "answer_lease_released": LeaseReleased,
    "answer_group_lease": GroupLease,
    "answer_group_lease_released": GroupLeaseReleased,
    "answer_clearance": ClearanceAnswer,
    "answer_speed_ratio": SpeedRatioAnswer,
    "answer_equipment": EquipmentAnswer,
    "answer_signal": NamedValue,
    "answer_param": NamedValue,
    "answer_forward_kinematics": ForwardKinematicsAnswer,
    "answer_inverse_kinematics": InverseKinematicsAnswer,
    "answer_recording": RecordingAnswer,
}

#[test]
fn no_sample_is_left_unread() {
    let mut files: Vec<String> = fs::read_dir(folder())
        .expect("folder of golden samples")
        .map(|entry| entry.expect("entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
        .map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned())
        .collect();
    files.sort();
    let mut names: Vec<&str> = NAMES.to_vec();
    names.sort_unstable();
    assert_eq!(files, names);
}

#[test]
fn the_sample_of_a_signed_reset_is_signed_for_the_sample_of_a_status() {
    let read = |name: &str| fs::read(folder().join(name)).expect("a golden sample");
    let status: RobotStatus = serde_json::from_slice(&read("robot_status.json")).expect("a status");
    let request: Request<ResetParams> =
        serde_json::from_slice(&read("request_reset.json")).expect("a request");
    let key = SigningKey::from_bytes(b"golden reset key").expect("a key");
    let params = status.stop.expect("a stop").reset_params();
    assert_eq!(key.sign_reset(&status.robot, status.boot_id, params), request.params);
}
