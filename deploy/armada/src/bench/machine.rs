//! Facts about the machine that a figure is worth nothing without.

use std::fmt;
use std::fs;

use serde::Serialize;

/// The machine as it was when the measurement began.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Machine {
    /// Processors this process may use.
    cores: usize,
    /// Processor, as the system names it; empty if it does not.
    processor: String,
    /// Whether a hypervisor lies beneath.
    virtual_machine: bool,
    /// Release of the kernel; empty if not known.
    kernel: String,
    /// Load averages over 1, 5 and 15 minutes at the start; empty if not known.
    load_average: String,
    /// How this program was built.
    build: &'static str,
    /// What each loop was really given.
    scheduling: Vec<(String, String)>,
}

impl Machine {
    /// This machine, now.
    pub(super) fn now() -> Self {
        let read = |path| fs::read_to_string(path).unwrap_or_default().trim().to_owned();
        let cpu_info = read("/proc/cpuinfo");
        let field = |name: &str| {
            let line = cpu_info.lines().find(|line| line.starts_with(name)).unwrap_or_default();
            line.split_once(':').map_or("", |(_, value)| value.trim()).to_owned()
        };
        let load = read("/proc/loadavg");
        Self {
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            processor: field("model name"),
            virtual_machine: field("flags").split(' ').any(|flag| flag == "hypervisor"),
            kernel: read("/proc/sys/kernel/osrelease"),
            load_average: load.split(' ').take(3).collect::<Vec<_>>().join(" "),
            build: if cfg!(debug_assertions) { "debug" } else { "release" },
            scheduling: Vec::new(),
        }
    }

    /// Adds what a loop was given; the same again is not repeated.
    pub(super) fn scheduled(&mut self, what: &str, how: &str) {
        let entry = (what.to_owned(), how.to_owned());
        if !self.scheduling.contains(&entry) {
            self.scheduling.push(entry);
        }
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if self.virtual_machine { ", virtual machine" } else { "" };
        writeln!(f, "machine     {} cores, {}{kind}", self.cores, self.processor)?;
        write!(f, "kernel      {}, load {} at the start", self.kernel, self.load_average)?;
        write!(f, "\nbuild       {}", self.build)?;
        for (what, how) in &self.scheduling {
            write!(f, "\nscheduling  {what}: {how}")?;
        }
        Ok(())
    }
}
