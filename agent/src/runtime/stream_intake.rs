//! Streams of commands as they come in: decoded and named in Zenoh's callbacks, judged in the loop.
//!
//! ```text
//! stream/position, stream/velocity, stream/twist, command
//!        --decode, resolve names--> queue of 64 --8 a tick--> loop
//!              |                       |
//!       stream_malformed,        full: dropped,
//!       unknown_joint            stream_overflow
//! ```
//!
//! What depends on the robot's state (lease, epoch, number, age, mode) or can be judged from the
//! numbers alone is left to the loop, which sees every sample in the tick that would follow it.

use std::sync::{Arc, Mutex, PoisonError};

use armada_model::JointVector;
use armada_protocol::codec::WireEncoding;
use armada_protocol::keys::{self, Key};
use armada_protocol::messages::{CommandMode, JointCommand, StreamCommand, StreamTwist};
use rtrb::Producer;
use serde::de::DeserializeOwned;
use zenoh::Session;
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;

use super::board::SharedBoard;
use super::robot::Robot;
use crate::control::{StreamSample, StreamValues, TwistTarget};
use crate::drivers::JointSet;

/// Longest sample that is read \[bytes\].
const MAX_SAMPLE_BYTES: usize = 16 * 1024;

/// Keeps the streams' keys open until dropped.
#[derive(Debug)]
pub(super) struct StreamIntake {
    _subscribers: [Subscriber<()>; 4],
}

/// What the callbacks share.
struct Intake {
    names: Names,
    queue: Mutex<Producer<StreamSample>>,
    board: Arc<SharedBoard>,
}

/// What the robot calls its parts, in its order.
#[derive(Debug)]
struct Names {
    joints: Vec<String>,
    chains: Vec<String>,
}

/// A sample is not of the form that its key has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Malformed;

/// What a [`JointCommand`] is for this robot.
#[derive(Debug, PartialEq)]
struct Resolved {
    /// None if it names no joint of this robot.
    sample: Option<StreamSample>,
    /// Names that this robot does not have.
    unknown: u64,
}

impl StreamIntake {
    /// Opens the keys of a robot's streams.
    ///
    /// # Errors
    /// Zenoh's error if a key cannot be declared.
    pub(super) async fn open(
        session: &Session,
        robot: &Robot,
        queue: Producer<StreamSample>,
        board: &Arc<SharedBoard>,
    ) -> zenoh::Result<Self> {
        let chains = robot.chains.iter().map(|chain| chain.name.clone()).collect();
        let intake = Arc::new(Intake {
            names: Names { joints: robot.joint_names(), chains },
            queue: Mutex::new(queue),
            board: Arc::clone(board),
        });
        let open = async |key: &Key, take: fn(&Intake, &Sample)| {
            let intake = Arc::clone(&intake);
            let key = key.of(&robot.config.robot);
            session.declare_subscriber(key).callback(move |sample| take(&intake, &sample)).await
        };
        Ok(Self {
            _subscribers: [
                open(&keys::ROBOT_STREAM_POSITION, Intake::take_position).await?,
                open(&keys::ROBOT_STREAM_VELOCITY, Intake::take_velocity).await?,
                open(&keys::ROBOT_STREAM_TWIST, Intake::take_twist).await?,
                open(&keys::ROBOT_COMMAND, Intake::take_command).await?,
            ],
        })
    }
}

impl Intake {
    fn take_position(&self, sample: &Sample) {
        self.take(decode(sample).map(|command| self.names.position(&command)));
    }

    fn take_velocity(&self, sample: &Sample) {
        self.take(decode(sample).and_then(|command| self.names.velocity(&command)));
    }

    fn take_twist(&self, sample: &Sample) {
        self.take(decode(sample).map(|command| self.names.twist(&command)));
    }

    fn take_command(&self, sample: &Sample) {
        let mode = self.board.lock().snapshot.command_mode;
        match decode(sample).and_then(|command| self.names.command(&command, mode)) {
            Ok(Resolved { sample, unknown }) => {
                self.count("unknown_joint", unknown);
                if let Some(sample) = sample {
                    self.take(Ok(sample));
                }
            }
            Err(Malformed) => self.count("stream_malformed", 1),
        }
    }

    fn take(&self, sample: Result<StreamSample, Malformed>) {
        match sample {
            Ok(sample) => {
                let mut queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
                if queue.push(sample).is_err() {
                    drop(queue);
                    self.count("stream_overflow", 1);
                }
            }
            Err(Malformed) => self.count("stream_malformed", 1),
        }
    }

    fn count(&self, what: &str, times: u64) {
        if times > 0 {
            *self.board.lock().dropped.entry(what.to_owned()).or_default() += times;
        }
    }
}

impl Names {
    fn all_joints(&self) -> JointSet {
        JointSet::first(self.joints.len())
    }

    fn position(&self, command: &StreamCommand) -> StreamSample {
        let values = StreamValues::Position {
            joints: self.all_joints(),
            position: command.values,
            velocity: command.velocity.unwrap_or_default(),
        };
        StreamSample { header: command.header(), values }
    }

    fn velocity(&self, command: &StreamCommand) -> Result<StreamSample, Malformed> {
        if command.velocity.is_some() {
            return Err(Malformed);
        }
        let (joints, velocity) = (self.all_joints(), command.values);
        let values = StreamValues::Velocity { joints, velocity };
        Ok(StreamSample { header: command.header(), values })
    }

    /// A chain that the robot does not have gets a number that it does not have: the loop counts.
    fn twist(&self, command: &StreamTwist) -> StreamSample {
        let chain = self.chains.iter().position(|name| *name == command.chain);
        let chain = chain.and_then(|chain| u8::try_from(chain).ok()).unwrap_or(u8::MAX);
        let target = TwistTarget { chain, twist: command.twist, frame: command.frame };
        StreamSample { header: command.header(), values: StreamValues::Twist(target) }
    }

    /// With positions and speeds, `mode` tells which of them is commanded; the speeds are those at
    /// the positions in `position_command`.
    fn command(&self, command: &JointCommand, mode: CommandMode) -> Result<Resolved, Malformed> {
        let JointCommand { name, position, velocity, .. } = command;
        let fits = |values: &[f64]| values.is_empty() || values.len() == name.len();
        if !fits(position) || !fits(velocity) || (position.is_empty() && velocity.is_empty()) {
            return Err(Malformed);
        }
        let zero = JointVector::zeros(self.joints.len()).map_err(|_| Malformed)?;
        let (mut joints, mut unknown) = (JointSet::NONE, 0);
        let (mut positions, mut speeds) = (zero, zero);
        for (index, name) in name.iter().enumerate() {
            let Some(joint) = self.joints.iter().position(|known| known == name) else {
                unknown += 1;
                continue;
            };
            if joints.contains(joint) {
                return Err(Malformed);
            }
            joints = joints.with(joint);
            for (values, all) in [(position, &mut positions), (velocity, &mut speeds)] {
                if let (Some(&value), Some(slot)) = (values.get(index), all.get_mut(joint)) {
                    *slot = value;
                }
            }
        }
        let by_speed =
            position.is_empty() || (!velocity.is_empty() && mode == CommandMode::VelocityCommand);
        let values = if by_speed {
            StreamValues::Velocity { joints, velocity: speeds }
        } else {
            let velocity = if velocity.is_empty() { JointVector::EMPTY } else { speeds };
            StreamValues::Position { joints, position: positions, velocity }
        };
        let sample = StreamSample { header: command.header(), values };
        Ok(Resolved { sample: (!joints.is_empty()).then_some(sample), unknown })
    }
}

fn decode<T: DeserializeOwned>(sample: &Sample) -> Result<T, Malformed> {
    let encoding = WireEncoding::from_zenoh(sample.encoding()).map_err(|_| Malformed)?;
    encoding.decode(&sample.payload().to_bytes(), MAX_SAMPLE_BYTES).map_err(|_| Malformed)
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    const NAMES: [&str; 3] = ["lift", "turn", "tilt"];

    fn names() -> Names {
        Names { joints: NAMES.map(str::to_owned).to_vec(), chains: vec!["arm".to_owned()] }
    }

    fn command(name: &[&str], position: &[f64], velocity: &[f64]) -> JointCommand {
        JointCommand {
            lease: Uuid::from_u128(1),
            epoch: 2,
            seq: 3,
            state_seqno: 4,
            name: name.iter().map(|&name| name.to_owned()).collect(),
            position: position.to_vec(),
            velocity: velocity.to_vec(),
        }
    }

    fn resolve(
        name: &[&str],
        position: &[f64],
        velocity: &[f64],
        mode: CommandMode,
    ) -> Result<(Option<StreamValues>, u64), Malformed> {
        let resolved = names().command(&command(name, position, velocity), mode)?;
        Ok((resolved.sample.map(|sample| sample.values), resolved.unknown))
    }

    fn vector(values: [f64; 3]) -> JointVector {
        JointVector::from_slice(&values).expect("finite")
    }

    #[test]
    fn joints_are_found_by_name_in_any_order_and_unknown_ones_are_counted() {
        let given = resolve(&["tilt", "other", "lift"], &[3.0, 9.0, 1.0], &[], CommandMode::Halt);
        let joints = JointSet::NONE.with(0).with(2);
        let (position, velocity) = (vector([1.0, 0.0, 3.0]), JointVector::EMPTY);
        let values = StreamValues::Position { joints, position, velocity };
        assert_eq!(given, Ok((Some(values), 1)));
        assert_eq!(resolve(&["other"], &[1.0], &[], CommandMode::Halt), Ok((None, 1)));
    }

    #[test]
    fn with_positions_and_speeds_the_mode_decides() {
        let joints = JointSet::NONE.with(1);
        let velocity = vector([0.0, 0.5, 0.0]);
        let position = vector([0.0, 2.0, 0.0]);
        let both = |mode| resolve(&["turn"], &[2.0], &[0.5], mode).map(|(values, _)| values);
        let by_speed = StreamValues::Velocity { joints, velocity };
        assert_eq!(both(CommandMode::VelocityCommand), Ok(Some(by_speed)));
        let by_position = StreamValues::Position { joints, position, velocity };
        assert_eq!(both(CommandMode::PositionCommand), Ok(Some(by_position)));
    }

    #[test]
    fn lengths_that_do_not_match_and_joints_named_twice_are_malformed() {
        let mode = CommandMode::PositionCommand;
        for (name, position, velocity) in [
            (&["turn"][..], &[1.0, 2.0][..], &[][..]),
            (&["turn"], &[1.0], &[1.0, 2.0]),
            (&["turn"], &[], &[]),
            (&["turn", "turn"], &[1.0, 2.0], &[]),
        ] {
            assert_eq!(resolve(name, position, velocity, mode), Err(Malformed), "{name:?}");
        }
    }

    #[test]
    fn a_stream_of_speeds_has_no_speeds_besides() {
        let speeds = StreamCommand {
            lease: Uuid::from_u128(1),
            epoch: 2,
            seq: 3,
            state_seqno: 4,
            values: vector([0.1; 3]),
            velocity: Some(vector([0.1; 3])),
        };
        assert_eq!(names().velocity(&speeds), Err(Malformed));
        let header = speeds.header();
        let sample = names().velocity(&StreamCommand { velocity: None, ..speeds });
        assert_eq!(sample.map(|sample| sample.header), Ok(header));
    }

    #[test]
    fn a_chain_that_the_robot_does_not_have_gets_a_number_that_it_does_not_have() {
        let chain_of = |chain: &str| {
            let twist = StreamTwist {
                lease: Uuid::from_u128(1),
                epoch: 2,
                seq: 3,
                state_seqno: 4,
                chain: chain.to_owned(),
                twist: armada_model::Twist::default(),
                frame: armada_protocol::messages::JogFrame::Base,
            };
            match names().twist(&twist).values {
                StreamValues::Twist(target) => target.chain,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!((chain_of("arm"), chain_of("leg")), (0, u8::MAX));
    }
}
