//! The task that keeps the latched stop on disk, so that nothing that stops waits for the disk.
//!
//! ```text
//! board --keep (newest wins)--> task --write, sync--> file
//!                                 |
//! reset <------- durable ---------+
//! ```
//!
//! Numbers are given in the order of the board's changes, since both happen under its lock. What
//! cannot be written is tried again every second, and a reset is refused meanwhile.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::watch;
use tracing::{error, info};

use super::stop_file::{Kept, StopFile};

/// Pause before a write that failed is tried again.
const RETRY: Duration = Duration::from_secs(1);

/// Keeps the latched stop of one robot.
#[derive(Debug)]
pub(super) struct StopKeeper(Option<Keeping>);

#[derive(Debug)]
struct Keeping {
    wanted: watch::Sender<Wanted>,
    written: watch::Receiver<Written>,
}

#[derive(Clone, Debug)]
struct Wanted {
    number: u64,
    running: bool,
    kept: Kept,
}

#[derive(Clone, Debug)]
struct Written {
    number: u64,
    /// Why this number is not durable.
    error: Option<String>,
}

impl StopKeeper {
    /// Keeps nothing: a stop is over when the agent ends.
    pub(super) const fn none() -> Self {
        Self(None)
    }

    /// Keeps stops in `file`, where `kept` is to be; nothing is written before it is asked for.
    pub(super) fn start(file: StopFile, kept: Kept) -> Self {
        let first = Wanted { number: 0, running: false, kept };
        let (wanted, to_write) = watch::channel(first);
        let (tell, written) = watch::channel(Written { number: 0, error: None });
        start(write_all(Arc::new(file), to_write, tell));
        Self(Some(Keeping { wanted, written }))
    }

    /// Has `kept` written as soon as may be; returns the number that it has.
    pub(super) fn keep(&self, kept: Kept) -> u64 {
        self.want(|wanted| (wanted.running, wanted.kept) = (true, kept))
    }

    /// The number of the newest that was to be kept.
    pub(super) fn newest(&self) -> u64 {
        self.0.as_ref().map_or(0, |keeping| keeping.wanted.borrow().number)
    }

    /// Waits until what has this number, or something newer, is on the disk.
    ///
    /// # Errors
    /// Why it is not, in words.
    pub(super) async fn durable(&self, number: u64) -> Result<(), String> {
        let Some(keeping) = &self.0 else { return Ok(()) };
        let mut written = keeping.written.clone();
        let reached = written.wait_for(|written| written.number >= number).await;
        match reached.map(|written| written.error.clone()) {
            Ok(None) => Ok(()),
            Ok(Some(error)) => Err(error),
            Err(_) => Err("the agent ends".to_owned()),
        }
    }

    /// Notes an orderly end and lets go of the file.
    ///
    /// # Errors
    /// Why that is not on the disk, in words.
    pub(super) async fn end(&self) -> Result<(), String> {
        let number = self.want(|wanted| wanted.running = false);
        self.durable(number).await
    }

    fn want(&self, change: impl FnOnce(&mut Wanted)) -> u64 {
        let Some(keeping) = &self.0 else { return 0 };
        let mut number = 0;
        keeping.wanted.send_modify(|wanted| {
            wanted.number += 1;
            number = wanted.number;
            change(wanted);
        });
        number
    }
}

async fn write_all(
    file: Arc<StopFile>,
    mut wanted: watch::Receiver<Wanted>,
    tell: watch::Sender<Written>,
) {
    let mut failed = false;
    loop {
        let again = async {
            if failed {
                tokio::time::sleep(RETRY).await;
            } else {
                std::future::pending::<()>().await;
            }
        };
        tokio::select! {
            changed = wanted.changed() => if changed.is_err() { return },
            () = again => {}
        }
        let Wanted { number, running, kept } = wanted.borrow_and_update().clone();
        let error = write(&file, kept, running).await.err();
        match &error {
            Some(error) => error!(path = %file.path().display(), %error, "latched stop not kept"),
            None if failed => info!(path = %file.path().display(), "latched stop kept again"),
            None => {}
        }
        failed = error.is_some();
        let over = !running && !failed;
        if over {
            // Whoever waits for the end may have the file at once.
            drop(file);
            tell.send_replace(Written { number, error });
            return;
        }
        tell.send_replace(Written { number, error });
    }
}

async fn write(file: &Arc<StopFile>, kept: Kept, running: bool) -> Result<(), String> {
    let file = Arc::clone(file);
    let done = tokio::task::spawn_blocking(move || {
        let path = file.path();
        file.write(&kept, running).map_err(|error| format!("{}: {error}", path.display()))
    });
    done.await.unwrap_or_else(|error| Err(error.to_string()))
}

#[expect(clippy::disallowed_methods, reason = "the runtime is where tasks are started")]
fn start(task: impl Future<Output = ()> + Send + 'static) {
    tokio::spawn(task);
}

#[cfg(test)]
mod tests {
    use armada_protocol::messages::{LatchedStop, StopLevel};
    use uuid::Uuid;

    use super::super::stop_file::Found;
    use super::*;

    fn kept(number: u128) -> Kept {
        let stop = LatchedStop {
            stop_id: Uuid::from_u128(number),
            source: "test".to_owned(),
            level: StopLevel::L2,
            reason: String::new(),
        };
        Kept { level: Some(StopLevel::L2), stops: vec![stop] }
    }

    fn open(folder: &std::path::Path) -> (StopFile, Found) {
        StopFile::open(folder, &"left_arm".parse().expect("a name")).expect("free")
    }

    #[tokio::test]
    async fn what_is_durable_is_what_was_wanted_last() {
        let folder = tempfile::tempdir().expect("a folder");
        let keeper = StopKeeper::start(open(folder.path()).0, Kept::default());
        let numbers: Vec<_> = (1..=50).map(|number| keeper.keep(kept(number))).collect();
        assert_eq!(keeper.newest(), numbers[49]);
        for number in numbers {
            keeper.durable(number).await.expect("written");
        }
        keeper.end().await.expect("written");
        let (_, found) = open(folder.path());
        assert_eq!(found, Found::Kept { kept: kept(50), died: false }, "the lock is free as well");
    }

    #[tokio::test]
    async fn a_keeper_that_does_not_end_in_order_is_found_to_have_died() {
        let folder = tempfile::tempdir().expect("a folder");
        let keeper = StopKeeper::start(open(folder.path()).0, kept(1));
        let number = keeper.keep(Kept::default());
        keeper.durable(number).await.expect("written");
        let copy = tempfile::tempdir().expect("a folder");
        let name = "left_arm.latch.json";
        std::fs::copy(folder.path().join(name), copy.path().join(name)).expect("copied");
        let (_, found) = open(copy.path());
        assert_eq!(found, Found::Kept { kept: Kept::default(), died: true });
    }

    #[tokio::test]
    async fn an_end_before_anything_was_kept_loses_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let keeper = StopKeeper::start(open(folder.path()).0, kept(1));
        keeper.end().await.expect("written");
        let (_, found) = open(folder.path());
        assert_eq!(found, Found::Kept { kept: kept(1), died: false });
    }

    #[tokio::test]
    async fn what_cannot_be_written_is_not_durable_and_says_why() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("left_arm.latch.json")).expect("in the way");
        let keeper = StopKeeper::start(open(folder.path()).0, Kept::default());
        let number = keeper.keep(kept(1));
        let why = keeper.durable(number).await.expect_err("a folder is in the way");
        assert!(why.contains("left_arm.latch.json"), "{why}");
        std::fs::remove_dir(folder.path().join("left_arm.latch.json")).expect("out of the way");
        let number = keeper.keep(kept(2));
        keeper.durable(number).await.expect("written now");
    }

    #[tokio::test]
    async fn without_a_file_everything_is_said_to_be_kept_at_once() {
        let keeper = StopKeeper::none();
        let number = keeper.keep(kept(1));
        keeper.durable(number).await.expect("nothing to wait for");
        keeper.end().await.expect("nothing to note");
    }
}
