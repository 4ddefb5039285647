//! Packets between the `sim` driver and the emulated controller: version 3, little endian.
//!
//! One datagram is one packet: a header of 32 bytes, then the body that its kind gives.
//!
//! ```text
//! header   0 magic "ASIM"   4 version u8   5 kind u8   6 length of the whole packet u16
//!          8 sender u64    16 receiver u64            24 sequence u64
//!
//! kind            way  body
//! 1 hello          ->  joints u8
//! 2 command        ->  joints u8, positions n f64, velocities n f64
//! 3 request        ->  power id u32, power u8 (0 none 1 on 2 off), reset id u32,
//!                      order id u32, order (one byte 0 if the id is 0)
//! 4 status         <-  time u64 [ns], last command u64, last power id u32, last reset id u32,
//!                      last order id u32,
//!                      flags u8 (1 enabled 2 ready 4 emergency stop 8 guard stop
//!                      16 local control),
//!                      operational mode u8, conditions u32, error u32,
//!                      joints u8, homed u16, homing u16, positions, velocities, efforts n f64 each,
//!                      move u8 (0 none, else its status: 1 waiting 2 running 3 paused 4 done
//!                      5 stopped 6 failed), and if there is one: number u32, code u32, progress f64,
//!                      signals u8, n f64, parameters u8, n f64,
//!                      tips u8, each: chain u8, frame u8 (1 flange 2 tcp), pose
//! 5 refused        <-  reason u8 (1 busy 2 joint count 3 version), detail u8, detail u8
//! 6 inject         ->  fault
//! 7 inject answer  <-  fault, accepted u8
//!
//! order, first its kind u8:
//!  1 home          joints u16, the lowest bit is the first joint
//!  2 move          number u32, speed f64, blend radius f64 [m], connect u8, goal u8:
//!                  1 joints u8, positions n f64   2 pose, 3 straight: chain u8, pose
//!  3 stop   4 pause   5 resume
//!  6 speed ratio   ratio f64
//!  7 set signal    signal u8, values u8, n f64
//!  8 set parameter parameter u8, value f64
//!  9 set load      chain u8, mass f64, centre of mass 3 f64, inertia 6 f64
//! 10 set tool      chain u8, pose
//!
//! pose     position 3 f64 [m], orientation w x y z f64
//! fault    tag u8, number u32, value f64, length of the name u8, name
//! ```
//!
//! `sender` and `receiver` are boot nonces: a number that each run of a program chooses. Only
//! hello and inject may leave `receiver` zero, "not known yet", and so may what answers a packet
//! whose sender could not be read; only inject may leave `sender` zero. A packet for an
//! earlier run is dropped. `sequence` counts all packets of a sender from 1. Request ids count the
//! client's requests from 1; power, reset and orders apart; 0 is none, or one that is done. A
//! request is repeated until the status shows its id, and done once however often it comes. Orders
//! leave one at a time, each with a higher id than the one before: one that comes late after a newer
//! one is not done any more. `conditions` are bits of the robot's flag word. Numbers are finite and at most
//! [`MAX_VALUE`] in size. Header and `refused` stay the same in every version.
//!
//! The largest packet is a status of 16 joints, 32 signal values, 16 parameters and 2 tips: 979
//! bytes.

mod codec;
mod order;
mod status;

use armada_protocol::messages::{OperationalMode, RobotFlags};

use super::Fault;
use crate::drivers::{
    DelegatedReport, DriverRequest, JointSet, LinkRefusal, MAX_PARAMETERS, MAX_REPORTED_TIPS,
    MAX_SIGNAL_VALUES, ReportedTip, SetPoint, Values,
};
use armada_model::JointVector;
use codec::{Reader, Writer, joint_count};
use order::{read_request, write_request};
pub(super) use status::mode_to_wire;
use status::{read_status, write_status};

/// First bytes of every packet.
const MAGIC: [u8; 4] = *b"ASIM";
/// Version of the layout above.
pub const VERSION: u8 = 3;
/// Largest size of a position, speed or effort \[SI\]; far above any robot, far below overflow.
pub const MAX_VALUE: f64 = 1e6;

/// Who sends a packet to whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Boot nonce of the sender.
    pub sender: u64,
    /// Boot nonce of the run it is meant for; 0 if not known.
    pub receiver: u64,
    /// Number of the packet among all of the sender, from 1.
    pub sequence: u64,
}

/// What a packet says.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a driver has no heap, so nothing is boxed")]
pub enum Body {
    /// A client wants the status stream.
    Hello {
        /// Joints of the client's robot.
        joints: u8,
    },
    /// A set-point.
    Command(SetPoint),
    /// Requests in force.
    Request(RequestBody),
    /// Report of the controller.
    Status(Status),
    /// The controller does not serve the client.
    Refused(LinkRefusal),
    /// A fault to be injected.
    Inject(Fault),
    /// Whether a fault was injected.
    InjectAnswer {
        /// The fault.
        fault: Fault,
        /// False if this robot cannot have it: it has no such joint.
        accepted: bool,
    },
}

/// The client's newest requests.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RequestBody {
    /// Number of the power request; 0 if none was made.
    pub power_id: u32,
    /// Drives on or off; `None` exactly if `power_id` is 0.
    pub power: Option<Power>,
    /// Number of the request to reset errors; 0 if none was made.
    pub reset_id: u32,
    /// Number of the order; 0 if there is none.
    pub order_id: u32,
    /// The order, never of power or reset; `None` exactly if `order_id` is 0.
    pub order: Option<DriverRequest>,
}

/// What to do with the drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Power {
    /// Switch them on.
    On,
    /// Switch them off.
    Off,
}

/// Report of the controller, once a controller cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// The controller's clock \[ns\].
    pub time_ns: u64,
    /// Sequence of the newest command taken; 0 if none.
    pub last_command: u64,
    /// Newest power request done; 0 if none.
    pub last_power_id: u32,
    /// Newest reset done; 0 if none.
    pub last_reset_id: u32,
    /// Newest order done; 0 if none.
    pub last_order_id: u32,
    /// Drives are on.
    pub enabled: bool,
    /// Commands are taken.
    pub ready: bool,
    /// The emergency stop is pressed.
    pub emergency_stop: bool,
    /// A guard is open, or was and is not reset.
    pub guard_stop: bool,
    /// The pendant has control.
    pub local_control: bool,
    /// Which button or guard, of [`Feedback::CONDITIONS`](crate::drivers::Feedback::CONDITIONS).
    pub conditions: RobotFlags,
    /// Where the key switch stands.
    pub operational_mode: OperationalMode,
    /// Error in force; 0 for none.
    pub error: u32,
    /// Joints that know their reference.
    pub homed: JointSet,
    /// Joints that search it.
    pub homing: JointSet,
    /// Measured positions \[rad or m\].
    pub position: JointVector,
    /// Measured speeds \[1/s\].
    pub velocity: JointVector,
    /// Measured efforts \[Nm or N\].
    pub effort: JointVector,
    /// The newest of the controller's own moves.
    pub delegated: Option<DelegatedReport>,
    /// Values of all signals.
    pub signals: Values<MAX_SIGNAL_VALUES>,
    /// Values of all parameters.
    pub parameters: Values<MAX_PARAMETERS>,
    /// Poses that the controller reports, those there are before those there are not.
    pub tips: [Option<ReportedTip>; MAX_REPORTED_TIPS],
}

/// Why bytes are not a packet.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum WireError {
    /// Fewer bytes than the layout needs.
    #[error("packet of {len} bytes ends too early")]
    Truncated {
        /// Bytes given.
        len: usize,
    },
    /// Another length than the header says, or bytes after the body.
    #[error("packet of {len} bytes, its layout has {expected}")]
    Length {
        /// Bytes given.
        len: usize,
        /// Bytes of header and body.
        expected: usize,
    },
    /// It does not begin with the magic bytes.
    #[error("not a packet of this protocol")]
    Magic,
    /// Another version of the protocol; its sender's nonce can still be read.
    #[error("version {version}, expected {VERSION}")]
    Version {
        /// The version.
        version: u8,
        /// The sender's boot nonce.
        sender: u64,
    },
    /// No such kind of packet.
    #[error("unknown kind {0} of packet")]
    Kind(u8),
    /// A field has a value that it must not have.
    #[error("field {field} has a value it must not have")]
    Field {
        /// Name of the field as in the layout.
        field: &'static str,
    },
}

/// Writes a packet and gives its length; 0 if it does not fit into `buffer`.
///
/// [`MAX_PACKET`](crate::drivers::MAX_PACKET) bytes are always enough.
#[must_use]
pub fn encode(header: &Header, body: &Body, buffer: &mut [u8]) -> usize {
    let mut writer = Writer::new(buffer);
    let written = write_packet(header, body, &mut writer);
    let (Some(()), Ok(len)) = (written, u16::try_from(writer.len())) else { return 0 };
    match buffer.get_mut(6..8) {
        Some(length) => length.copy_from_slice(&len.to_le_bytes()),
        None => return 0,
    }
    usize::from(len)
}

/// Reads a packet, checking every field.
///
/// # Errors
/// [`WireError::Truncated`] and [`WireError::Length`] if the size is wrong, [`WireError::Magic`],
/// [`WireError::Version`] and [`WireError::Kind`] if it is of another protocol, version or kind,
/// [`WireError::Field`] if a value is not allowed.
pub fn decode(bytes: &[u8]) -> Result<(Header, Body), WireError> {
    let mut reader = Reader::new(bytes);
    if reader.take()? != MAGIC {
        return Err(WireError::Magic);
    }
    let (version, kind, length) = (reader.u8()?, reader.u8()?, usize::from(reader.u16()?));
    let header = Header { sender: reader.u64()?, receiver: reader.u64()?, sequence: reader.u64()? };
    if version != VERSION {
        return Err(WireError::Version { version, sender: header.sender });
    }
    if length != bytes.len() {
        return Err(WireError::Length { len: bytes.len(), expected: length });
    }
    let body = read_body(kind, &mut reader)?;
    if reader.left() > 0 {
        let expected = bytes.len() - reader.left();
        return Err(WireError::Length { len: bytes.len(), expected });
    }
    check_header(&header, &body)?;
    Ok((header, body))
}

/// Writes a packet that injects `fault` into the emulator it is sent to, and gives its length; 0
/// if `buffer` is too short: 128 bytes always are enough.
///
/// The emulator answers the sender with a packet that [`decode_inject_answer`] reads. Injecting
/// twice does no more than injecting once, so it may be repeated until the answer comes.
#[must_use]
pub fn encode_inject(fault: &Fault, buffer: &mut [u8]) -> usize {
    let header = Header { sender: 0, receiver: 0, sequence: 0 };
    encode(&header, &Body::Inject(*fault), buffer)
}

/// Reads the emulator's answer to an injected fault: the fault, and whether the robot can have it.
///
/// # Errors
/// As [`decode`]; [`WireError::Kind`] if it is another packet.
pub fn decode_inject_answer(bytes: &[u8]) -> Result<(Fault, bool), WireError> {
    match decode(bytes)?.1 {
        Body::InjectAnswer { fault, accepted } => Ok((fault, accepted)),
        other => Err(WireError::Kind(other.kind())),
    }
}

impl Body {
    const fn kind(&self) -> u8 {
        match self {
            Self::Hello { .. } => 1,
            Self::Command(_) => 2,
            Self::Request(_) => 3,
            Self::Status(_) => 4,
            Self::Refused(_) => 5,
            Self::Inject(_) => 6,
            Self::InjectAnswer { .. } => 7,
        }
    }
}

fn check_header(header: &Header, body: &Body) -> Result<(), WireError> {
    let anonymous = matches!(body, Body::Inject(_));
    let may_miss_receiver = anonymous
        || matches!(body, Body::Hello { .. } | Body::Refused(_) | Body::InjectAnswer { .. });
    match header {
        Header { sender: 0, .. } if !anonymous => Err(WireError::Field { field: "sender" }),
        Header { receiver: 0, .. } if !may_miss_receiver => {
            Err(WireError::Field { field: "receiver" })
        }
        Header { sequence: 0, .. } if !anonymous => Err(WireError::Field { field: "sequence" }),
        _ => Ok(()),
    }
}

fn write_packet(header: &Header, body: &Body, out: &mut Writer<'_>) -> Option<()> {
    out.put(&MAGIC)?;
    out.put(&[VERSION, body.kind(), 0, 0])?; // the length is filled in when it is known
    out.put(&header.sender.to_le_bytes())?;
    out.put(&header.receiver.to_le_bytes())?;
    out.put(&header.sequence.to_le_bytes())?;
    match body {
        Body::Hello { joints } => out.put(&[*joints]),
        Body::Command(set_point) => {
            out.u8(joint_count(&set_point.joint_position))?;
            out.joints(&set_point.joint_position)?;
            out.joints(&set_point.joint_velocity)
        }
        Body::Request(request) => write_request(request, out),
        Body::Status(status) => write_status(status, out),
        Body::Refused(refusal) => out.put(&match *refusal {
            LinkRefusal::Busy => [1, 0, 0],
            LinkRefusal::JointCount { controller, client } => [2, controller, client],
            LinkRefusal::Version { controller } => [3, controller, 0],
        }),
        Body::Inject(fault) => out.fault(fault),
        Body::InjectAnswer { fault, accepted } => {
            out.fault(fault)?;
            out.put(&[u8::from(*accepted)])
        }
    }
}

fn read_body(kind: u8, reader: &mut Reader<'_>) -> Result<Body, WireError> {
    Ok(match kind {
        1 => Body::Hello { joints: reader.joint_count()? },
        2 => {
            let joints = reader.joint_count()?;
            Body::Command(SetPoint {
                joint_position: reader.joints(joints, "positions")?,
                joint_velocity: reader.joints(joints, "velocities")?,
            })
        }
        3 => Body::Request(read_request(reader)?),
        4 => Body::Status(read_status(reader)?),
        5 => Body::Refused(match reader.take::<3>()? {
            [1, 0, 0] => LinkRefusal::Busy,
            [2, controller, client] => LinkRefusal::JointCount { controller, client },
            [3, controller, 0] => LinkRefusal::Version { controller },
            _ => return Err(WireError::Field { field: "reason" }),
        }),
        6 => Body::Inject(reader.fault()?),
        7 => Body::InjectAnswer {
            fault: reader.fault()?,
            accepted: reader.flags(1, "accepted")? == 1,
        },
        other => return Err(WireError::Kind(other)),
    })
}
