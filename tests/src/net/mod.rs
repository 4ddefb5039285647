//! Hosts on one machine: network namespaces, joined by a switch whose links can be made bad.
//!
//! ```text
//!  namespace client      namespace left_arm      namespace right_arm   ..
//!     tap 10.77.n.1          tap 10.77.n.2           tap 10.77.n.3
//!        \______________________|_______________________/
//!                 Switch: a thread per tap, delay, loss, cut
//! ```
//!
//! The switch works on Ethernet frames, so that TCP loses, repeats and slows down as on a real bad
//! link. It is our own because `tc netem` is not in every kernel.
//!
//! Threads inherit the namespace of the thread that starts them, and Zenoh's live as long as the
//! process: so all tests of a process share one client namespace, and run in a thread that has
//! entered it ([`in_network`]).

mod host;
mod namespace;
mod switch;

use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

use anyhow::{Context, Result, bail};

pub use host::{Host, HostProcess};
pub use switch::Quality;

use namespace::Namespace;
use switch::Switch;

/// A network of hosts; everything in it ends when it is dropped.
#[derive(Debug)]
pub struct Network {
    number: u8,
    switch: Switch,
    hosts: Vec<Host>,
    client: Host,
}

/// Runs a test inside the client's namespace, with a network of its own.
///
/// Where namespaces cannot be made (no root, no `ip`, no `/dev/net/tun`) the test is skipped with a
/// line that says why.
///
/// # Errors
/// What the test returns.
pub fn in_network<F>(name: &str, test: impl FnOnce(Network) -> F + Send + 'static) -> Result<()>
where
    F: Future<Output = Result<()>>,
{
    if let Err(why) = can_make_hosts() {
        skip(name, &why);
        return Ok(());
    }
    let thread = std::thread::Builder::new().name(format!("client of {name}"));
    let run = move || -> Result<()> {
        namespace::come_first();
        client_namespace()?.enter()?;
        let network = Network::new()?;
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
        runtime.block_on(test(network))
    };
    thread.spawn(run)?.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Says that a test did not run, and why.
#[expect(clippy::print_stderr, reason = "a skipped test says so where the runner shows it")]
fn skip(name: &str, why: &str) {
    eprintln!("SKIPPED: {name} needs {why}");
}

/// Whether hosts can be made here.
///
/// # Errors
/// What they need and is not there.
pub fn can_make_hosts() -> Result<(), String> {
    if !rustix::process::geteuid().is_root() {
        return Err("root, to make network namespaces".to_owned());
    }
    if !Path::new("/dev/net/tun").exists() {
        return Err("/dev/net/tun, for virtual network cards".to_owned());
    }
    match Command::new("ip").args(["netns", "list"]).output() {
        Ok(output) if output.status.success() => Ok(()),
        _ => Err("ip of iproute2, with network namespaces".to_owned()),
    }
}

/// The namespace that all clients of this process are in.
fn client_namespace() -> Result<&'static Namespace> {
    static NAMESPACE: OnceLock<Namespace> = OnceLock::new();
    if let Some(namespace) = NAMESPACE.get() {
        return Ok(namespace);
    }
    let made = Namespace::new()?;
    Ok(NAMESPACE.get_or_init(|| made))
}

impl Network {
    fn new() -> Result<Self> {
        static NUMBER: AtomicU8 = AtomicU8::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let switch = Switch::new();
        let client = Host::on(client_namespace()?.clone(), "client", number, 1, &switch)?;
        Ok(Self { number, switch, hosts: Vec::new(), client })
    }

    /// A new host with an address of its own.
    ///
    /// # Errors
    /// If the namespace or its network card cannot be made.
    pub fn add_host(&mut self, name: &str) -> Result<&Host> {
        let index = u8::try_from(self.hosts.len() + 2).context("at most 253 hosts")?;
        let namespace = Namespace::new()?;
        self.hosts.push(Host::on(namespace, name, self.number, index, &self.switch)?);
        self.hosts.last().context("just added")
    }

    /// The host of this name; `client` is where the test itself runs.
    ///
    /// # Errors
    /// If there is none.
    pub fn host(&self, name: &str) -> Result<&Host> {
        if name == "client" {
            return Ok(&self.client);
        }
        match self.hosts.iter().find(|host| host.name() == name) {
            Some(host) => Ok(host),
            None => bail!("the network has no host {name}"),
        }
    }

    /// Makes the link between two hosts as good or bad as `quality` says, both ways.
    ///
    /// # Errors
    /// If there is no such host.
    pub fn set_link(&self, a: &str, b: &str, quality: Quality) -> Result<()> {
        let (a, b) = (self.host(a)?.index(), self.host(b)?.index());
        self.switch.set(a, b, quality);
        self.switch.set(b, a, quality);
        Ok(())
    }

    /// Makes every link of a host as good or bad as `quality` says, both ways.
    ///
    /// # Errors
    /// If there is no such host.
    pub fn set_host(&self, name: &str, quality: Quality) -> Result<()> {
        let index = self.host(name)?.index();
        for other in self.hosts.iter().chain([&self.client]).map(Host::index) {
            self.switch.set(index, other, quality);
            self.switch.set(other, index, quality);
        }
        Ok(())
    }
}
