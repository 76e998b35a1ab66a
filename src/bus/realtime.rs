//! Real-time settings of a thread, requested from the kernel.

use std::fmt;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::os::fd::OwnedFd;
use std::path::Path;

use nix::sched::{CpuSet, sched_setaffinity};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::sys::prctl::set_timerslack;
use nix::unistd::Pid;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// `SCHED_FIFO` priority, of 99 at most: above ordinary work, below the threads of the CAN interrupt.
const PRIORITY: u8 = 80;

/// Attributes of the processors (Documentation/ABI/testing/sysfs-devices-system-cpu).
const CPUS: &str = "/sys/devices/system/cpu";

/// Limit of the time in which an idle processor wakes up; valid while the file is open
/// (Documentation/power/pm_qos_interface.rst).
const CPU_LATENCY: &str = "/dev/cpu_dma_latency";

/// Settings that a caller may choose.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// `SCHED_FIFO` priority, 80 unless another is chosen; with `None` the thread keeps the policy and priority it has.
    pub fifo: Option<u8>,
    /// Processor that the thread runs on alone.
    pub cpu: Option<usize>,
    /// Maximum time in which an idle processor wakes up, in µs.
    pub cpu_latency_us: Option<i32>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { fifo: Some(PRIORITY), cpu: None, cpu_latency_us: None }
    }
}

/// Settings in effect, and the reasons of those that the kernel refused.
#[derive(Debug, Default)]
pub struct GrantedSettings {
    /// `SCHED_FIFO` at the priority that was requested, if any was.
    pub is_fifo: bool,
    /// Memory is locked: no page is swapped out.
    pub is_locked: bool,
    /// Timer slack is 1 ns instead of 50 µs.
    pub is_exact: bool,
    /// Processor, with the reason if the thread does not run on it alone; `None` if not requested.
    pub cpu: Option<(usize, Result<(), String>)>,
    /// Limit in µs, with the reason if it is not in effect; `None` if not requested.
    pub cpu_latency: Option<(i32, Result<LatencyLimit, String>)>,
}

/// Limit of the processors' wake-up time, in effect until dropped.
#[derive(Debug)]
pub struct LatencyLimit(#[expect(dead_code, reason = "its descriptor stays open")] OwnedFd);

/// Requests all settings for the calling thread. A refusal is not an error.
pub fn ask() -> GrantedSettings {
    ask_for(Settings::default())
}

/// Requests all settings for the calling thread, including the optional ones. A refusal is not an error.
pub fn ask_for(settings: Settings) -> GrantedSettings {
    let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let is_fifo = settings.fifo.is_none_or(|priority| {
        let priority = ThreadPriorityValue::try_from(priority).map(ThreadPriority::Crossplatform);
        priority.is_ok_and(|priority| {
            set_thread_priority_and_policy(thread_native_id(), priority, fifo).is_ok()
        })
    });
    GrantedSettings {
        is_fifo,
        is_locked: mlockall(MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE).is_ok(),
        is_exact: set_timerslack(1).is_ok(),
        cpu: settings.cpu.map(|cpu| (cpu, pin(cpu))),
        cpu_latency: settings.cpu_latency_us.map(|limit| (limit, limit_latency(limit))),
    }
}

/// Returns whether this machine has a processor of this number.
pub fn has_cpu(cpu: usize) -> bool {
    Path::new(&format!("{CPUS}/cpu{cpu}")).exists()
}

/// Lets the thread run on this processor alone.
fn pin(cpu: usize) -> Result<(), String> {
    let mut only = CpuSet::new();
    let set = only.set(cpu).and_then(|()| sched_setaffinity(Pid::from_raw(0), &only));
    set.map_err(|error| format!("not permitted ({})", error.desc()))?;
    let isolated = fs::read_to_string(format!("{CPUS}/isolated")).unwrap_or_default();
    let is_isolated = contains(&isolated, cpu);
    if is_isolated { Ok(()) } else { Err("shared, as it is not in isolcpus".to_owned()) }
}

/// Returns whether a list of the kernel, such as `2-3,6`, contains a number.
fn contains(list: &str, number: usize) -> bool {
    list.trim().split(',').any(|range| {
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        let bounds = first.parse().and_then(|first| Ok((first, last.parse()?)));
        bounds.is_ok_and(|(first, last): (usize, usize)| (first..=last).contains(&number))
    })
}

/// Limits the time in which idle processors wake up.
fn limit_latency(micros: i32) -> Result<LatencyLimit, String> {
    let limit = || -> io::Result<LatencyLimit> {
        let mut file = OpenOptions::new().write(true).open(CPU_LATENCY)?;
        file.write_all(&micros.to_ne_bytes())?;
        Ok(LatencyLimit(file.into()))
    };
    limit().map_err(|error| format!("{CPU_LATENCY}: {error}"))
}

impl GrantedSettings {
    /// Returns whether no setting was refused.
    pub fn is_all(&self) -> bool {
        let has_cpu = self.cpu.as_ref().is_none_or(|(_, set)| set.is_ok());
        let has_latency = self.cpu_latency.as_ref().is_none_or(|(_, set)| set.is_ok());
        self.is_fifo && self.is_locked && self.is_exact && has_cpu && has_latency
    }
}

impl fmt::Display for GrantedSettings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = |is: bool| if is { "yes" } else { "refused" };
        let (fifo, locked, exact) = (self.is_fifo, self.is_locked, self.is_exact);
        write!(
            f,
            "SCHED_FIFO {}, memory locked {}, timers exact {}",
            word(fifo),
            word(locked),
            word(exact)
        )?;
        match &self.cpu {
            None => {}
            Some((cpu, Ok(()))) => write!(f, ", CPU {cpu} alone yes")?,
            Some((cpu, Err(reason))) => write!(f, ", CPU {cpu} alone refused: {reason}")?,
        }
        match &self.cpu_latency {
            None => Ok(()),
            Some((limit, Ok(_))) => write!(f, ", CPUs awake within {limit} µs yes"),
            Some((limit, Err(reason))) => {
                write!(f, ", CPUs awake within {limit} µs refused: {reason}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn list_of_processors_has_numbers_and_ranges() {
        for (list, number, is_in) in [
            ("", 0, false),
            ("2-3,6\n", 2, true),
            ("2-3,6\n", 3, true),
            ("2-3,6\n", 4, false),
            ("2-3,6\n", 6, true),
            ("nonsense", 1, false),
        ] {
            assert_eq!(contains(list, number), is_in, "{list:?}, {number}");
        }
    }

    #[test]
    fn refusals_say_what_and_why() {
        let granted = GrantedSettings {
            is_fifo: true,
            cpu: Some((3, Err("shared".to_owned()))),
            cpu_latency: Some((0, Err("gone".to_owned()))),
            ..GrantedSettings::default()
        };
        assert!(!granted.is_all());
        let text = "SCHED_FIFO yes, memory locked refused, timers exact refused, CPU 3 alone refused: shared, \
            CPUs awake within 0 µs refused: gone";
        assert_eq!(granted.to_string(), text);
    }

    #[test]
    fn first_processor_exists_and_the_last_number_does_not() {
        assert!(has_cpu(0) && !has_cpu(usize::MAX));
    }
}
