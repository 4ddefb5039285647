//! A network namespace, and the thread that works in it.

use std::fs::File;
use std::os::fd::AsFd;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Sender, channel, sync_channel};

use anyhow::{Context, Result, anyhow, ensure};
use rustix::thread::{LinkNameSpaceType, move_into_link_name_space};

/// Niceness of all that runs on hosts.
const NICENESS: i32 = -15;

type Job = Box<dyn FnOnce() + Send>;

/// A network namespace. It has no name, so the system removes it with the last thread or process in
/// it, however those end.
#[derive(Clone, Debug)]
pub(super) struct Namespace(Arc<Inside>);

#[derive(Debug)]
struct Inside {
    file: File,
    /// Works in it. Processes are tied to the thread that starts them, so it lives as long as this.
    jobs: Sender<Job>,
}

impl Namespace {
    pub(super) fn new() -> Result<Self> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        // A name is needed to make one with `ip`, and no longer than to open it.
        let name = format!("armada-test-{}-{count}", std::process::id());
        ip(&["netns", "add", &name])?;
        let opened = File::open(format!("/var/run/netns/{name}"));
        ip(&["netns", "del", &name])?;
        let file = opened.context("the namespace cannot be opened")?;
        let (jobs, todo) = channel::<Job>();
        let inside = file.try_clone()?;
        let (told, entered) = sync_channel(1);
        std::thread::Builder::new().name("host".to_owned()).spawn(move || {
            come_first();
            // The one who waits is the one who asked.
            let _ = told.send(enter(&inside));
            todo.into_iter().for_each(|job| job());
        })?;
        entered.recv().context("the host's thread")??;
        let namespace = Self(Arc::new(Inside { file, jobs }));
        namespace.ip(&["link", "set", "lo", "up"])?;
        Ok(namespace)
    }

    /// Moves the calling thread into it, and with it every thread that it starts.
    pub(super) fn enter(&self) -> Result<()> {
        enter(&self.0.file)
    }

    /// Does something in it.
    pub(super) fn inside<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> Result<T> + Send + 'static,
    ) -> Result<T> {
        let (told, done) = sync_channel(1);
        let job: Job = Box::new(move || {
            let _ = told.send(work());
        });
        self.0.jobs.send(job).map_err(|_| anyhow!("the host's thread has ended"))?;
        done.recv().context("the host's thread")?
    }

    /// Runs `ip` in it.
    pub(super) fn ip(&self, arguments: &[&str]) -> Result<()> {
        let arguments: Vec<String> = arguments.iter().map(|&word| word.to_owned()).collect();
        self.inside(move || {
            let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
            ip(&words)
        })
    }
}

/// Lets the calling thread, and all threads and processes that it starts, run before others: hosts
/// are machines of their own, and what else this machine does must not slow them all down.
pub(super) fn come_first() {
    // Where that is not permitted it is done without.
    let _ = rustix::process::setpriority_process(None, NICENESS);
}

fn enter(namespace: &File) -> Result<()> {
    move_into_link_name_space(namespace.as_fd(), Some(LinkNameSpaceType::Network))
        .context("cannot enter the namespace")
}

fn ip(arguments: &[&str]) -> Result<()> {
    let output = Command::new("ip").args(arguments).output()?;
    let said = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "ip {}: {said}", arguments.join(" "));
    Ok(())
}
