//! A host: a network namespace with a card, and the processes in it.

use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use anyhow::{Context, Result, ensure};
use rustix::process::Signal;
use rustix::thread::{LinkNameSpaceType, move_into_link_name_space};

use super::switch::{self, Switch};
use crate::process::{armada, is_running, signal};

/// A network namespace, removed with its last handle.
#[derive(Clone, Debug)]
pub(super) struct Namespace(Arc<Named>);

#[derive(Debug)]
struct Named(String);

impl Drop for Named {
    fn drop(&mut self) {
        // What cannot be removed now goes with the machine; there is nobody to tell.
        let _ = Command::new("ip").args(["netns", "del", &self.0]).output();
    }
}

impl Namespace {
    pub(super) fn new(host: &str) -> Result<Self> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("armada-{}-{count}-{host}", std::process::id());
        ip(&["netns", "add", &name])?;
        let namespace = Self(Arc::new(Named(name)));
        namespace.ip(&["link", "set", "lo", "up"])?;
        Ok(namespace)
    }

    /// Moves the calling thread into it, and with it every thread that it starts.
    pub(super) fn enter(&self) -> Result<()> {
        let file = File::open(format!("/var/run/netns/{}", self.0.0))?;
        move_into_link_name_space(std::os::fd::AsFd::as_fd(&file), Some(LinkNameSpaceType::Network))
            .context("cannot enter the namespace")
    }

    fn ip(&self, arguments: &[&str]) -> Result<()> {
        ip(&[&["-n", self.0.0.as_str()], arguments].concat())
    }
}

fn ip(arguments: &[&str]) -> Result<()> {
    let output = Command::new("ip").args(arguments).output()?;
    let said = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "ip {}: {said}", arguments.join(" "));
    Ok(())
}

/// A machine of its own, as far as its network goes.
#[derive(Debug)]
pub struct Host {
    namespace: Namespace,
    name: String,
    index: u8,
    address: String,
    card: String,
    switch: Switch,
}

impl Host {
    pub(super) fn on(
        namespace: Namespace,
        name: &str,
        network: u8,
        index: u8,
        switch: &Switch,
    ) -> Result<Self> {
        let card = format!("net{network}");
        let address = format!("10.77.{network}.{index}");
        let (inside, named) = (namespace.clone(), card.clone());
        let make = move || {
            inside.enter()?;
            switch::card(&named)
        };
        let made = std::thread::Builder::new().name(format!("card of {name}")).spawn(make)?;
        let device = made.join().map_err(|_| anyhow::anyhow!("no card"))??;
        let [a, b, c, d, e, f] = switch::mac(index);
        let mac = format!("{a:02x}:{b:02x}:{c:02x}:{d:02x}:{e:02x}:{f:02x}");
        namespace.ip(&["link", "set", &card, "address", &mac])?;
        namespace.ip(&["addr", "add", &format!("{address}/24"), "dev", &card])?;
        namespace.ip(&["link", "set", &card, "up"])?;
        switch.plug(index, device);
        let (name, switch) = (name.to_owned(), switch.clone());
        Ok(Self { namespace, name, index, address, card, switch })
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its address.
    #[must_use]
    pub fn address(&self) -> &str {
        &self.address
    }

    pub(super) const fn index(&self) -> u8 {
        self.index
    }

    /// Pulls its network cable: the card has no carrier, and its routes are gone.
    ///
    /// # Errors
    /// If the card cannot be changed.
    pub fn pull_cable(&self) -> Result<()> {
        self.namespace.ip(&["link", "set", &self.card, "down"])
    }

    /// Puts the cable in again.
    ///
    /// # Errors
    /// If the card cannot be changed.
    pub fn plug_cable(&self) -> Result<()> {
        self.namespace.ip(&["link", "set", &self.card, "up"])
    }

    /// Starts the program here; what it prints goes to `{folder}/{name}.log`, its state below
    /// `folder`.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn spawn(&self, folder: &Path, name: &str, arguments: &[&str]) -> Result<HostProcess> {
        let arguments = arguments.iter().map(|&argument| argument.to_owned()).collect();
        let mut process = HostProcess {
            namespace: self.namespace.clone(),
            log: folder.join(format!("{name}.log")),
            state: folder.join("state"),
            arguments,
            child: None,
        };
        process.start()?;
        Ok(process)
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        self.switch.unplug(self.index);
    }
}

/// A process on a host; killed when it is dropped.
#[derive(Debug)]
pub struct HostProcess {
    namespace: Namespace,
    log: std::path::PathBuf,
    state: std::path::PathBuf,
    arguments: Vec<String>,
    child: Option<Child>,
}

impl HostProcess {
    /// Starts it, again if it has ended.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn start(&mut self) -> Result<()> {
        let printed = File::options().create(true).append(true).open(&self.log)?;
        // `ip netns exec` becomes the program: the process id is the program's own.
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.namespace.0.0]).arg(armada()?).args(&self.arguments);
        command.env("XDG_STATE_HOME", &self.state).stdin(Stdio::null());
        command.stdout(printed.try_clone()?).stderr(printed);
        self.child = Some(command.spawn()?);
        Ok(())
    }

    /// Its process id.
    ///
    /// # Errors
    /// If it was never started.
    pub fn pid(&self) -> Result<u32> {
        Ok(self.child.as_ref().context("was started")?.id())
    }

    /// Whether it runs.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.pid().is_ok_and(is_running)
    }

    /// Ends it at once, as a crash or a power cut would.
    ///
    /// # Errors
    /// If it does not run.
    pub fn kill(&mut self) -> Result<()> {
        let child = self.child.as_mut().context("was started")?;
        child.kill()?;
        child.wait()?;
        Ok(())
    }

    /// Freezes it: it holds all its sockets and answers nothing.
    ///
    /// # Errors
    /// If it does not run.
    pub fn freeze(&self) -> Result<()> {
        signal(self.pid()?, Signal::STOP)
    }

    /// Lets it go on.
    ///
    /// # Errors
    /// If it does not run.
    pub fn thaw(&self) -> Result<()> {
        signal(self.pid()?, Signal::CONT)
    }

    /// What it has printed.
    #[must_use]
    pub fn printed(&self) -> String {
        std::fs::read_to_string(&self.log).unwrap_or_default()
    }
}

impl Drop for HostProcess {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            // It may have ended by itself.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
