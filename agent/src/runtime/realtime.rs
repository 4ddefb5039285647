//! Real-time scheduling of the calling thread, as far as the system permits.

use std::fmt;
use std::num::NonZeroU64;

use armada_protocol::messages::SchedulingPolicy;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, geteuid, getrlimit};
use rustix::thread::{CpuSet, sched_setaffinity, set_current_timer_slack};

use crate::config::RealtimeConfig;

/// What the calling thread was really given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RealtimeReport {
    /// How it is scheduled, read back from the system.
    pub policy: SchedulingPolicy,
    /// Whether the program's memory stays in RAM.
    pub memory_locked: bool,
    /// What was asked for and not given, in words.
    pub refused: Vec<String>,
}

impl fmt::Display for RealtimeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.policy {
            SchedulingPolicy::Other => f.write_str("SCHED_OTHER")?,
            SchedulingPolicy::Fifo(priority) => write!(f, "SCHED_FIFO {priority}")?,
        }
        if self.memory_locked {
            f.write_str(", memory locked")?;
        }
        for refused in &self.refused {
            write!(f, ", {refused}")?;
        }
        Ok(())
    }
}

/// Sets up the calling thread; whatever is refused is reported and done without.
pub fn enter(config: &RealtimeConfig) -> RealtimeReport {
    let mut refused = Vec::new();
    let mut note = |what: &str, result: Result<(), String>| match result {
        Ok(()) => true,
        Err(why) => {
            refused.push(format!("no {what}: {why}"));
            false
        }
    };
    let one_ns = NonZeroU64::MIN;
    note("timer slack of 1 ns", set_current_timer_slack(Some(one_ns)).map_err(|e| e.to_string()));
    let memory_locked = config.lock_memory && note("memory lock", lock_memory());
    if let Some(cpu) = config.cpu {
        note("fixed processor", fix_processor(usize::from(cpu)));
    }
    if let Some(priority) = config.priority {
        note("SCHED_FIFO", schedule_fifo(priority));
    }
    RealtimeReport { policy: current_policy(), memory_locked, refused }
}

/// Locks pages as they are touched. Where the limit is small it is not even tried: memory that
/// comes later than the lock would then fail to be allocated.
fn lock_memory() -> Result<(), String> {
    let unlimited = getrlimit(Resource::Memlock).current.is_none();
    if !geteuid().is_root() && !unlimited {
        return Err("the limit on locked memory (ulimit -l) is not unlimited".to_owned());
    }
    let flags = MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT;
    mlockall(flags).map_err(|error| error.to_string())
}

/// Keeps the calling thread on one processor.
pub(super) fn fix_processor(cpu: usize) -> Result<(), String> {
    if cpu >= CpuSet::MAX_CPU {
        return Err(format!("there is no processor {cpu}"));
    }
    let mut set = CpuSet::new();
    set.set(cpu);
    sched_setaffinity(None, &set).map_err(|error| format!("processor {cpu}: {error}"))
}

#[expect(unsafe_code, reason = "no safe wrapper of sched_setscheduler is maintained")]
fn schedule_fifo(priority: u8) -> Result<(), String> {
    let param = libc::sched_param { sched_priority: i32::from(priority) };
    // SAFETY: `param` is a valid sched_param for the call; pid 0 is the calling thread.
    let result = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const param) };
    if result == 0 { Ok(()) } else { Err(std::io::Error::last_os_error().to_string()) }
}

#[expect(unsafe_code, reason = "no safe wrapper of sched_getscheduler is maintained")]
fn current_policy() -> SchedulingPolicy {
    let mut param = libc::sched_param { sched_priority: 0 };
    // SAFETY: both calls only read the calling thread's policy; `param` is valid for writing.
    let (policy, read) =
        unsafe { (libc::sched_getscheduler(0), libc::sched_getparam(0, &raw mut param)) };
    match u8::try_from(param.sched_priority) {
        Ok(priority) if policy == libc::SCHED_FIFO && read == 0 => SchedulingPolicy::Fifo(priority),
        _ => SchedulingPolicy::Other,
    }
}
