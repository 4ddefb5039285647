//! The file of a recording: MessagePack, the numbers bit for bit.

use std::io::{Read, Write};

use armada_protocol::RobotName;
use serde::{Deserialize, Serialize};

use super::segment::Segment;
use crate::control::Params;

/// Version of the form.
const FORMAT: u32 = 3;

/// A recording: the loop's parameters, and segments that follow each other.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Recording {
    format: u32,
    /// Version of the program that wrote it; only the same build is sure to replay it bit for bit.
    pub software_version: String,
    /// Which robot.
    pub robot: RobotName,
    /// Why it was written.
    pub reason: String,
    /// What did not change while the loop ran.
    pub params: Params,
    /// The segments, oldest first.
    pub segments: Vec<Segment>,
}

/// Why a recording cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// It cannot be written.
    #[error("the recording cannot be written: {0}")]
    Write(#[from] rmp_serde::encode::Error),
    /// It is not a recording, or not of this version of the program.
    #[error("not a recording of this version of the program: {0}")]
    Read(#[from] rmp_serde::decode::Error),
    /// It is of another form.
    #[error("the recording has format {found}, this program reads {FORMAT}")]
    Format {
        /// Its format.
        found: u32,
    },
}

impl Recording {
    /// A recording of these segments, oldest first.
    #[must_use]
    pub fn new(robot: RobotName, reason: String, params: Params, segments: Vec<Segment>) -> Self {
        let software_version = env!("CARGO_PKG_VERSION").to_owned();
        Self { format: FORMAT, software_version, robot, reason, params, segments }
    }

    /// Number of ticks in all segments.
    #[must_use]
    pub fn ticks(&self) -> usize {
        self.segments.iter().map(|segment| segment.ticks.len()).sum()
    }

    /// Writes it.
    ///
    /// # Errors
    /// [`RecordingError::Write`] if `writer` fails.
    pub fn write(&self, writer: &mut impl Write) -> Result<(), RecordingError> {
        Ok(rmp_serde::encode::write_named(writer, self)?)
    }

    /// Reads it.
    ///
    /// # Errors
    /// [`RecordingError::Read`] if it is something else, [`RecordingError::Format`] if it is of
    /// another form.
    pub fn read(reader: impl Read) -> Result<Self, RecordingError> {
        let recording: Self = rmp_serde::from_read(reader)?;
        match recording.format {
            FORMAT => Ok(recording),
            found => Err(RecordingError::Format { found }),
        }
    }
}
