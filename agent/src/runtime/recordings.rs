//! Recordings of the control loop: kept in memory, written to a file when a fault is latched or
//! somebody asks.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use armada_protocol::RobotName;
use armada_protocol::messages::{Denial, DenialCode, RecordingAnswer};
use tokio::sync::{Notify, mpsc, oneshot};
use tracing::{info, warn};

use super::board::SharedBoard;
use super::clock::utc_ns;
use crate::config::RecorderConfig;
use crate::control::Params;
use crate::recorder::{Recording, RecordingError, Shelf};

/// How often full segments are fetched.
const TIDY: Duration = Duration::from_millis(250);
/// Requests to save that wait.
const QUEUE: usize = 8;

/// Who waits for a recording to be written.
type Waiting = oneshot::Sender<Result<RecordingAnswer, Denial>>;

/// Asks for recordings.
#[derive(Clone, Debug)]
pub(super) struct Recorder {
    /// Read and cleared by the loop.
    pub(super) save: Arc<AtomicBool>,
    asked: mpsc::Sender<Waiting>,
}

impl Recorder {
    /// Has the last seconds written to a file.
    pub(super) async fn save(&self) -> Result<RecordingAnswer, Denial> {
        let (answer, answered) = oneshot::channel();
        if self.asked.try_send(answer).is_err() {
            return Err(Denial::new(DenialCode::Busy, "too many recordings are asked for"));
        }
        self.save.store(true, Ordering::Relaxed);
        let ended = || Denial::new(DenialCode::Internal, "the recorder has ended");
        answered.await.unwrap_or_else(|_| Err(ended()))
    }
}

/// Keeps the newest segments and writes them.
pub(super) struct Recordings {
    robot: RobotName,
    params: Params,
    directory: PathBuf,
    keep: usize,
    shelf: Shelf,
    board: Arc<SharedBoard>,
    changed: Arc<Notify>,
    asked: mpsc::Receiver<Waiting>,
}

impl Recordings {
    /// The task, and what asks it.
    pub(super) fn new(
        robot: RobotName,
        config: &RecorderConfig,
        params: Params,
        shelf: Shelf,
        (board, changed): (Arc<SharedBoard>, Arc<Notify>),
    ) -> (Recorder, Self) {
        let (sender, asked) = mpsc::channel(QUEUE);
        let recorder = Recorder { save: Arc::default(), asked: sender };
        let temporary = || std::env::temp_dir().join("armada-recordings");
        let directory = config.directory.clone().unwrap_or_else(temporary);
        let keep = config.keep;
        (recorder, Self { robot, params, directory, keep, shelf, board, changed, asked })
    }

    /// Works until nobody can ask any more.
    pub(super) async fn run(mut self) {
        let mut clock = tokio::time::interval(TIDY);
        let mut waiting = Vec::new();
        loop {
            tokio::select! {
                asked = self.asked.recv() => match asked {
                    Some(asker) => waiting.push(asker),
                    None => return,
                },
                _ = clock.tick() => {
                    if self.shelf.tidy() {
                        self.write(std::mem::take(&mut waiting)).await;
                    }
                }
            }
        }
    }

    async fn write(&mut self, waiting: Vec<Waiting>) {
        let faults: Vec<_> = self.board.lock().faults.iter().map(|fault| fault.code).collect();
        let reason = if faults.is_empty() { "asked for".to_owned() } else { format!("{faults:?}") };
        let segments = self.shelf.segments().cloned().collect();
        let recording = Recording::new(self.robot.clone(), reason, self.params.clone(), segments);
        let (directory, keep, ticks) = (self.directory.clone(), self.keep, recording.ticks());
        let written =
            tokio::task::spawn_blocking(move || write_file(&directory, keep, &recording)).await;
        let result = match written {
            Ok(Ok(path)) => Ok(RecordingAnswer {
                file: path.display().to_string(),
                ticks: u64::try_from(ticks).unwrap_or(u64::MAX),
            }),
            Ok(Err(error)) => Err(Denial::new(
                DenialCode::Internal,
                format!("the recording of {} was not written: {error}", self.robot),
            )),
            Err(_) => Err(Denial::new(DenialCode::Internal, "the recorder panicked")),
        };
        match &result {
            Ok(answer) => {
                info!(file = answer.file, ticks, "recording written");
                self.attach(&answer.file);
            }
            Err(denial) => warn!(%denial, "no recording"),
        }
        for asker in waiting {
            // Who gave up is not told.
            drop(asker.send(result.clone()));
        }
    }

    /// Names the file in the faults that have none yet.
    fn attach(&self, file: &str) {
        for fault in &mut self.board.lock().faults {
            fault.recording.get_or_insert_with(|| file.to_owned());
        }
        self.changed.notify_one();
    }
}

/// Why a recording is not on the disk.
#[derive(Debug, thiserror::Error)]
enum WriteError {
    #[error("{path}: {error}", path = path.display())]
    Io { path: PathBuf, error: io::Error },
    #[error(transparent)]
    Encode(#[from] RecordingError),
}

fn write_file(directory: &Path, keep: usize, recording: &Recording) -> Result<PathBuf, WriteError> {
    let at = |path: &Path| {
        let path = path.to_owned();
        move |error| WriteError::Io { path, error }
    };
    fs::create_dir_all(directory).map_err(at(directory))?;
    let path = directory.join(format!("{}-{}.armada", recording.robot, utc_ns() / 1_000_000));
    // Whoever sees the name sees the whole file.
    let partial = path.with_extension("part");
    let mut file = BufWriter::new(File::create(&partial).map_err(at(&partial))?);
    recording.write(&mut file)?;
    file.flush().map_err(at(&partial))?;
    fs::rename(&partial, &path).map_err(at(&path))?;
    remove_oldest(directory, &recording.robot, keep).map_err(at(directory))?;
    Ok(path)
}

/// Leaves the newest `keep` recordings of a robot.
fn remove_oldest(directory: &Path, robot: &RobotName, keep: usize) -> io::Result<()> {
    let prefix = format!("{robot}-");
    let mut found: Vec<PathBuf> = fs::read_dir(directory)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            name.strip_prefix(&prefix)
                .and_then(|rest| rest.strip_suffix(".armada"))
                .is_some_and(|stamp| stamp.bytes().all(|byte| byte.is_ascii_digit()))
        })
        .collect();
    found.sort();
    let surplus = found.len().saturating_sub(keep);
    found.iter().take(surplus).try_for_each(fs::remove_file)
}
