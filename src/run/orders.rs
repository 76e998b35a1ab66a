//! Signals to a running node: some stop it in order, the others do nothing.
//!
//! Every signal whose default ends or stops a process is blocked in all threads and read here from a descriptor, so
//! none interrupts a system call and none acts by its default. Excepted are SIGKILL and SIGSTOP, which cannot be
//! blocked, those of a defect, and 32 and 33, which the C library keeps to itself.

use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering;
use std::thread;

use nix::sys::signal::SigSet;
use nix::sys::signal::Signal;
use nix::sys::signal::raise;
use nix::sys::signalfd::SfdFlags;
use nix::sys::signalfd::SignalFd;

/// Signals of a defect: the process must end, and leave its core.
const DEFECTS: [Signal; 7] = [
    Signal::SIGABRT,
    Signal::SIGBUS,
    Signal::SIGFPE,
    Signal::SIGILL,
    Signal::SIGSEGV,
    Signal::SIGSYS,
    Signal::SIGTRAP,
];

/// Signals whose default is harmless.
const HARMLESS: [Signal; 4] = [Signal::SIGCHLD, Signal::SIGCONT, Signal::SIGURG, Signal::SIGWINCH];

/// Signals that stop the node in order. SIGXCPU comes before the limit of CPU time that kills.
const STOPS: [Signal; 5] =
    [Signal::SIGINT, Signal::SIGTERM, Signal::SIGQUIT, Signal::SIGPWR, Signal::SIGXCPU];

/// Number of SIGHUP, which asks other programs to read their configuration again.
const HANG_UP: u32 = 1;

fn blocked() -> SigSet {
    let mut set = SigSet::all();
    DEFECTS.into_iter().chain(HARMLESS).for_each(|signal| set.remove(signal));
    set
}

/// Blocks them in the calling thread and in those it starts from now on: call it before any is started.
///
/// # Errors
/// When the system refuses.
pub fn block() -> io::Result<()> {
    Ok(blocked().thread_block()?)
}

/// Outcome of the signals sent to this process.
#[derive(Debug)]
pub(super) struct Orders(Arc<State>);

#[derive(Debug, Default)]
struct State {
    /// A stop is in order from now on.
    is_orderly: AtomicBool,
    stop: AtomicBool,
}

impl Orders {
    /// Reads signals, since [`block`], in a thread of its own. One that stops ends the process at once until there is
    /// something to stop in order.
    ///
    /// # Errors
    /// When the system refuses a descriptor or a thread.
    pub(super) fn start() -> io::Result<Self> {
        let signals = SignalFd::with_flags(&blocked(), SfdFlags::SFD_CLOEXEC)?;
        let state = Arc::new(State::default());
        let shared = Arc::clone(&state);
        let reader = thread::Builder::new().name("frhc-signals".to_owned());
        reader.spawn(move || read(&signals, &shared))?;
        Ok(Self(state))
    }

    /// From now on a signal that stops only sets what [`stopping`](Self::stopping) returns.
    pub(super) fn become_orderly(&self) {
        self.0.is_orderly.store(true, Ordering::Release);
    }

    /// Returns whether a signal asks for a stop.
    pub(super) fn stopping(&self) -> bool {
        self.0.stop.load(Ordering::Acquire)
    }
}

/// Reads signals for as long as the process lives.
fn read(signals: &SignalFd, state: &State) {
    let mut counts: BTreeMap<u32, u64> = BTreeMap::new();
    while let Ok(Some(received)) = signals.read_signal() {
        let number = received.ssi_signo;
        let signal = i32::try_from(number).ok().and_then(|it| Signal::try_from(it).ok());
        let name = signal.map_or_else(|| format!("signal {number}"), |it| it.as_str().to_owned());
        let (pid, uid) = (received.ssi_pid, received.ssi_uid);
        let count = counts.entry(number).or_default();
        *count += 1;
        // No flood of them.
        let is_logged = count.is_power_of_two();
        match signal.filter(|signal| STOPS.contains(signal)) {
            Some(signal) if !state.is_orderly.load(Ordering::Acquire) => end_at_once(signal),
            Some(_) => {
                let is_new = !state.stop.swap(true, Ordering::AcqRel);
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
                    "{name}: ignored, the configuration is read at the start alone"
                );
            }
            None if is_logged => tracing::info!(pid, uid, count, "{name}: ignored"),
            None => {}
        }
    }
}

/// Ends the process as the signal does by default.
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
    fn every_signal_that_ends_or_stops_is_blocked_but_defects() {
        let blocked = blocked();
        for signal in Signal::iterator() {
            let is_kept = DEFECTS.contains(&signal) || HARMLESS.contains(&signal);
            assert_eq!(blocked.contains(signal), !is_kept, "{signal}");
        }
        assert!(STOPS.iter().all(|signal| blocked.contains(*signal)));
    }
}
