//! The file that keeps a latched stop while no agent runs: `{robot}.latch.json`.
//!
//! Written whole under another name, synced, renamed, and the folder synced, so that after a power
//! cut it is the old one or the new one. `running` is true from the start of the loop to an orderly
//! end: an agent that finds it true follows one that died. A second file is locked for as long as the
//! agent lives, so that two agents never keep one robot's stops.

use std::fs::{self, DirBuilder, File, TryLockError};
use std::io::{self, Write as _};
use std::os::unix::fs::DirBuilderExt as _;
use std::path::{Path, PathBuf};

use armada_protocol::RobotName;
use armada_protocol::messages::{LatchedStop, StopLevel};
use serde::{Deserialize, Serialize};

/// Version of the file's form.
const VERSION: u32 = 1;
/// Largest file that is read \[bytes\].
const MAX_FILE: u64 = 16 << 20;

/// What is kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Kept {
    /// Level of the stop in force; none if none is latched.
    pub(super) level: Option<StopLevel>,
    /// Every stop that a reset must clear.
    pub(super) stops: Vec<LatchedStop>,
}

/// What was found at the start.
#[derive(Debug, PartialEq)]
pub(super) enum Found {
    /// No agent of this robot has kept anything here yet.
    Nothing,
    /// What the agent before has kept, and whether it died.
    Kept { kept: Kept, died: bool },
    /// Something that cannot be understood, and why.
    Unreadable(String),
}

/// Why a robot's stops cannot be kept.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    /// The folder or a file in it cannot be made or written.
    #[error("cannot keep latched stops in {}: {source}", path.display())]
    Io {
        /// Folder or file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The file cannot be written.
    #[error("cannot keep latched stops: {0}")]
    NotKept(String),
    /// Another agent keeps the same robot's stops there.
    #[error(
        "{} is locked: another agent keeps stops there; give one of them a folder of its own with \
         --state-dir",
        .0.display()
    )]
    Taken(PathBuf),
}

/// The file of one robot, locked until dropped.
#[derive(Debug)]
pub(super) struct StopFile {
    folder: PathBuf,
    robot: RobotName,
    _lock: File,
}

/// The form of the file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    version: u32,
    robot: RobotName,
    running: bool,
    level: Option<StopLevel>,
    stops: Vec<LatchedStop>,
}

/// Makes a folder that outlives a loss of power, if it is not there.
fn make(folder: &Path) -> io::Result<()> {
    if folder.is_dir() {
        return Ok(());
    }
    DirBuilder::new().recursive(true).mode(0o700).create(folder)?;
    match folder.parent().filter(|parent| !parent.as_os_str().is_empty()) {
        Some(parent) => File::open(parent)?.sync_all(),
        None => Ok(()),
    }
}

impl StopFile {
    /// Locks the file of `robot` in `folder`, which is made if it is not there, and reads it.
    ///
    /// # Errors
    /// [`StateError::Taken`] if another agent has it, [`StateError::Io`] if nothing can be written.
    pub(super) fn open(folder: &Path, robot: &RobotName) -> Result<(Self, Found), StateError> {
        let at = |path: &Path| {
            let path = path.to_owned();
            move |source| StateError::Io { path, source }
        };
        make(folder).map_err(at(folder))?;
        let path = folder.join(format!("{robot}.lock"));
        let lock = File::options().create(true).append(true).open(&path).map_err(at(&path))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(StateError::Taken(path)),
            Err(TryLockError::Error(source)) => return Err(StateError::Io { path, source }),
        }
        let file = Self { folder: folder.to_owned(), robot: robot.clone(), _lock: lock };
        let found = file.read();
        Ok((file, found))
    }

    /// Writes what is to be kept; it is durable when this returns.
    ///
    /// # Errors
    /// The system's: the file is the old one or the new one then.
    pub(super) fn write(&self, kept: &Kept, running: bool) -> io::Result<()> {
        let Kept { level, stops } = kept.clone();
        let content =
            Content { version: VERSION, robot: self.robot.clone(), running, level, stops };
        let text = serde_json::to_vec_pretty(&content)?;
        let draft = self.folder.join(format!("{}.latch.json.new", self.robot));
        let mut file = File::create(&draft)?;
        file.write_all(&text)?;
        file.sync_all()?;
        fs::rename(&draft, self.path())?;
        File::open(&self.folder)?.sync_all()
    }

    /// Where it is.
    pub(super) fn path(&self) -> PathBuf {
        self.folder.join(format!("{}.latch.json", self.robot))
    }

    fn read(&self) -> Found {
        let path = self.path();
        match fs::metadata(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Found::Nothing,
            Ok(about) if about.len() > MAX_FILE => {
                return Found::Unreadable(format!("{} bytes, above the limit", about.len()));
            }
            // Whatever else is wrong, reading tells.
            Ok(_) | Err(_) => {}
        }
        let content: Result<Content, String> = fs::read(&path)
            .map_err(|error| error.to_string())
            .and_then(|text| serde_json::from_slice(&text).map_err(|error| error.to_string()));
        match content {
            Err(problem) => Found::Unreadable(problem),
            Ok(content) if content.version != VERSION => {
                let version = content.version;
                Found::Unreadable(format!("version is {version}, expected {VERSION}"))
            }
            Ok(content) if content.robot != self.robot => {
                Found::Unreadable(format!("it is of robot {}", content.robot))
            }
            Ok(content) if content.level.is_some() == content.stops.is_empty() => {
                Found::Unreadable("level and stops contradict each other".to_owned())
            }
            Ok(Content { running: died, level, stops, .. }) => {
                Found::Kept { kept: Kept { level, stops }, died }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    fn robot() -> RobotName {
        "left_arm".parse().expect("a name")
    }

    fn kept() -> Kept {
        let stop = LatchedStop {
            stop_id: Uuid::from_u128(7),
            source: "door_1".to_owned(),
            level: StopLevel::L1,
            reason: "pressed".to_owned(),
        };
        Kept { level: Some(StopLevel::L0), stops: vec![stop] }
    }

    #[test]
    fn what_was_kept_is_found_with_the_way_the_agent_ended() {
        let folder = tempfile::tempdir().expect("a folder");
        let place = folder.path().join("state/cell");
        for died in [true, false] {
            let (file, _) = StopFile::open(&place, &robot()).expect("free");
            file.write(&kept(), died).expect("written");
            drop(file);
            let (_, found) = StopFile::open(&place, &robot()).expect("free again");
            assert_eq!(found, Found::Kept { kept: kept(), died });
        }
    }

    #[test]
    fn a_second_agent_on_the_same_file_is_refused_by_its_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let (_first, found) = StopFile::open(folder.path(), &robot()).expect("free");
        assert_eq!(found, Found::Nothing);
        let taken = StopFile::open(folder.path(), &robot()).expect_err("locked");
        assert!(taken.to_string().contains("left_arm.lock is locked"), "{taken}");
        let other = "right_arm".parse().expect("a name");
        StopFile::open(folder.path(), &other).expect("another robot");
    }

    #[test]
    fn what_cannot_be_understood_is_told_and_never_taken_for_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let good = {
            let (file, _) = StopFile::open(folder.path(), &robot()).expect("free");
            file.write(&kept(), false).expect("written");
            fs::read_to_string(file.path()).expect("text")
        };
        let bad = [
            (String::new(), "EOF"),
            (good[..good.len() / 2].to_owned(), "EOF"),
            (good.replace("\"version\": 1", "\"version\": 2"), "version is 2"),
            (good.replace("\"running\"", "\"walking\""), "unknown field `walking`"),
            (good.replace("left_arm", "right_arm"), "it is of robot right_arm"),
            (good.replace("\"L0\"", "null"), "contradict"),
        ];
        for (text, problem) in bad {
            fs::write(folder.path().join("left_arm.latch.json"), &text).expect("written");
            let (_, found) = StopFile::open(folder.path(), &robot()).expect("free");
            let Found::Unreadable(told) = found else { panic!("{text} was taken: {found:?}") };
            assert!(told.contains(problem), "{told:?} of {text}");
        }
        let path = folder.path().join("left_arm.latch.json");
        fs::remove_file(&path).and_then(|()| fs::create_dir(&path)).expect("a folder instead");
        let (file, found) = StopFile::open(folder.path(), &robot()).expect("free");
        assert!(matches!(found, Found::Unreadable(_)), "{found:?}");
        assert!(file.write(&kept(), true).is_err(), "nothing can be kept there");
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        fs::write(&file, "").expect("written");
        let error = StopFile::open(&file.join("below"), &robot()).expect_err("below a file");
        assert!(error.to_string().starts_with("cannot keep latched stops in"), "{error}");
    }
}
