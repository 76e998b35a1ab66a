//! Real-time settings of a thread: requested from the kernel, and granted or refused.

use std::fmt;

use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::sys::prctl::set_timerslack;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Priority of 99: above ordinary work, below the threads of the CAN interrupt.
const PRIORITY: u8 = 80;

/// Settings granted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Granted {
    /// `SCHED_FIFO` at priority 80.
    pub is_fifo: bool,
    /// Memory is locked: no page is swapped out.
    pub is_locked: bool,
    /// Timer slack is 1 ns instead of 50 µs.
    pub is_exact: bool,
}

/// Requests all settings for the calling thread. A refusal is not an error.
pub fn ask() -> Granted {
    let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let priority = ThreadPriorityValue::try_from(PRIORITY).map(ThreadPriority::Crossplatform);
    let is_fifo = priority.is_ok_and(|priority| {
        set_thread_priority_and_policy(thread_native_id(), priority, fifo).is_ok()
    });
    Granted {
        is_fifo,
        is_locked: mlockall(MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE).is_ok(),
        is_exact: set_timerslack(1).is_ok(),
    }
}

impl Granted {
    /// Returns whether no setting was refused.
    pub const fn is_all(self) -> bool {
        self.is_fifo && self.is_locked && self.is_exact
    }
}

impl fmt::Display for Granted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = |is: bool| if is { "yes" } else { "refused" };
        let (fifo, locked, exact) = (self.is_fifo, self.is_locked, self.is_exact);
        write!(
            f,
            "SCHED_FIFO {}, memory locked {}, timers exact {}",
            word(fifo),
            word(locked),
            word(exact)
        )
    }
}
