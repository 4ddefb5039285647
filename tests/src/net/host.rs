//! A host: a network namespace with a card, and the processes in it.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result, ensure};
use rustix::process::Signal;

use super::namespace::Namespace;
use super::switch::{self, Switch};
use crate::process::{armada, is_running, signal};

/// Programs that end with the test, however that ends.
const TIED: [&str; 3] = ["agent", "gateway", "emulator"];

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
        let named = card.clone();
        let device = namespace.inside(move || switch::card(&named))?;
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
        let mut arguments: Vec<String> = arguments.iter().map(|&word| word.to_owned()).collect();
        if arguments.first().is_some_and(|command| TIED.contains(&command.as_str())) {
            arguments.extend(["--parent".to_owned(), std::process::id().to_string()]);
        }
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

    /// Runs the program here to its end; returns what it printed and its exit code.
    ///
    /// # Errors
    /// If it cannot be started or is ended by a signal.
    pub fn run(&self, arguments: &[&str]) -> Result<(String, i32)> {
        let mut command = Command::new(armada()?);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = self.namespace.inside(move || Ok(command.spawn()?))?;
        let output = child.wait_with_output()?;
        let printed = [output.stdout, output.stderr].concat();
        let code = output.status.code().context("ended by a signal")?;
        Ok((String::from_utf8_lossy(&printed).into_owned(), code))
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
    log: PathBuf,
    state: PathBuf,
    arguments: Vec<String>,
    child: Option<Child>,
}

impl HostProcess {
    /// Starts it, again if it has ended.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn start(&mut self) -> Result<()> {
        ensure!(!self.is_running(), "it still runs");
        let printed = File::options().create(true).append(true).open(&self.log)?;
        let mut command = Command::new(armada()?);
        command.args(&self.arguments).env("XDG_STATE_HOME", &self.state);
        command.stdin(Stdio::piped()).stdout(printed.try_clone()?).stderr(printed);
        self.child = Some(self.namespace.inside(move || Ok(command.spawn()?))?);
        Ok(())
    }

    /// Writes a line to its standard input.
    ///
    /// # Errors
    /// If it does not run, or does not read.
    pub fn write_line(&mut self, line: &str) -> Result<()> {
        let child = self.child.as_mut().context("was started")?;
        let input = child.stdin.as_mut().context("an input")?;
        writeln!(input, "{line}")?;
        Ok(input.flush()?)
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
