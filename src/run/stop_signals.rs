//! Signals to a running node. Some stop it in order, the others are ignored.
//!
//! Every signal whose default action ends or stops a process is blocked in all threads and read here from a signalfd.
//! None of them interrupts a system call or has its default action. Exceptions are SIGKILL and SIGSTOP, which cannot be
//! blocked, signals of a program error, and 32 and 33, which the C library reserves.

use std::collections::BTreeMap;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use nix::sys::signal::{SigSet, Signal, raise};
use nix::sys::signalfd::{SfdFlags, SignalFd};

use crate::{log_time, threads};
use units::time::Instant;

/// Signals of a program error: the process must end with a core dump.
const PROGRAM_ERRORS: [Signal; 7] = [
    Signal::SIGABRT,
    Signal::SIGBUS,
    Signal::SIGFPE,
    Signal::SIGILL,
    Signal::SIGSEGV,
    Signal::SIGSYS,
    Signal::SIGTRAP,
];

/// Signals whose default action does not end or stop a process.
const IGNORED_BY_DEFAULT: [Signal; 4] =
    [Signal::SIGCHLD, Signal::SIGCONT, Signal::SIGURG, Signal::SIGWINCH];

/// Signals that stop the node in order. SIGXCPU is sent at the soft limit of CPU time, before SIGKILL at the hard one.
const STOP_SIGNALS: [Signal; 5] =
    [Signal::SIGINT, Signal::SIGTERM, Signal::SIGQUIT, Signal::SIGPWR, Signal::SIGXCPU];

/// Number of SIGHUP, which makes other daemons reload their configuration.
const HANG_UP: u32 = 1;

fn blocked() -> SigSet {
    let mut set = SigSet::all();
    PROGRAM_ERRORS.into_iter().chain(IGNORED_BY_DEFAULT).for_each(|signal| set.remove(signal));
    set
}

/// Blocks the signals in the calling thread and in threads it starts later. Call it before any is started.
///
/// # Errors
/// When the signal mask cannot be set.
pub fn block() -> io::Result<()> {
    Ok(blocked().thread_block()?)
}

/// Receiver of the signals sent to this process.
#[derive(Debug)]
pub(super) struct StopSignals(Arc<State>);

#[derive(Debug, Default)]
struct State {
    /// Set once a stop signal must stop the drives in order instead of ending the process.
    is_orderly: AtomicBool,
    stop: AtomicBool,
    /// Set by the second stop signal.
    is_urgent: AtomicBool,
    /// Time of the first orderly stop signal.
    stopped_at: OnceLock<Instant>,
}

impl StopSignals {
    /// Starts a thread that reads the signals blocked by [`block`]. A stop signal ends the process at once until
    /// [`enable_orderly_stop`](Self::enable_orderly_stop).
    ///
    /// # Errors
    /// When the signalfd or the thread cannot be created.
    pub(super) fn start() -> io::Result<Self> {
        let signals = SignalFd::with_flags(&blocked(), SfdFlags::SFD_CLOEXEC)?;
        let state = Arc::new(State::default());
        let shared = Arc::clone(&state);
        let reader = threads::builder("signals");
        reader.spawn(move || read(&signals, &shared))?;
        Ok(Self(state))
    }

    /// Makes later stop signals set [`is_stop_requested`](Self::is_stop_requested) instead of ending the process.
    pub(super) fn enable_orderly_stop(&self) {
        self.0.is_orderly.store(true, Ordering::Release);
    }

    /// Returns whether a stop signal was received.
    pub(super) fn is_stop_requested(&self) -> bool {
        self.0.stop.load(Ordering::Acquire)
    }

    /// Returns the time at which the stop signal was received, on the bus clock.
    pub(super) fn stop_requested_at(&self) -> Option<Instant> {
        self.0.stopped_at.get().copied()
    }

    /// Returns whether a second stop signal was received. The stop then waits only for the drives' power to be off.
    pub(super) fn is_urgent(&self) -> bool {
        self.0.is_urgent.load(Ordering::Acquire)
    }
}

/// Reads signals until the process ends.
fn read(signals: &SignalFd, state: &State) {
    let mut counts: BTreeMap<u32, u64> = BTreeMap::new();
    while let Ok(Some(received)) = signals.read_signal() {
        let number = received.ssi_signo;
        let signal = i32::try_from(number).ok().and_then(|it| Signal::try_from(it).ok());
        let name = signal.map_or_else(|| format!("signal {number}"), |it| it.as_str().to_owned());
        let (pid, uid) = (received.ssi_pid, received.ssi_uid);
        let count = counts.entry(number).or_default();
        *count += 1;
        // Limits the log when a signal is sent repeatedly.
        let is_logged = count.is_power_of_two();
        match signal.filter(|signal| STOP_SIGNALS.contains(signal)) {
            Some(signal) if !state.is_orderly.load(Ordering::Acquire) => end_at_once(signal),
            Some(_) => {
                if let Some(now) = log_time::now() {
                    state.stopped_at.get_or_init(|| now);
                }
                let is_new = !state.stop.swap(true, Ordering::AcqRel);
                state.is_urgent.fetch_or(!is_new, Ordering::AcqRel);
                if is_new {
                    tracing::info!(signal = name, pid, uid, "stopping");
                } else if is_logged {
                    tracing::info!(signal = name, pid, uid, "already stopping");
                }
            }
            None if is_logged && number == HANG_UP => {
                tracing::info!(
                    pid,
                    uid,
                    "{name}: ignored; the configuration is read only at the start"
                );
            }
            None if is_logged => tracing::info!(pid, uid, count, "{name}: ignored"),
            None => {}
        }
    }
}

/// Ends the process by the default action of the signal.
fn end_at_once(signal: Signal) {
    let mut set = SigSet::empty();
    set.add(signal);
    if set.thread_unblock().and_then(|()| raise(signal)).is_err() {
        std::process::abort();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_that_end_or_stop_are_blocked_except_program_errors() {
        let blocked = blocked();
        for signal in Signal::iterator() {
            let is_default =
                PROGRAM_ERRORS.contains(&signal) || IGNORED_BY_DEFAULT.contains(&signal);
            assert_eq!(blocked.contains(signal), !is_default, "{signal}");
        }
        assert!(STOP_SIGNALS.iter().all(|signal| blocked.contains(*signal)));
    }
}
