//! Cycle thread: priority, bring-up, cycles, stop.

use std::sync::mpsc::channel;
use std::time::Duration;

use crate::console::request_queue::{AcceptedRequest, RequestReceiver};
use crate::exit::{Failure, Kind, OrFail};
use crate::latch::LatchFile;
use crate::realtime_args::RealtimeArgs;
use crate::rings::EntryProducer;
use crate::stop_signals::StopSignals;
use crate::stopping;
use crate::{print, threads};
use bus::realtime::{self, GrantedSettings};
use bus::{Bus, TappedBus};
use inputs::{InputSink, RecordedNode};
use node::{BringUpError, Request};
use remote::Remote;

/// Time allowed for the end of the latch, so that a stalled disk does not keep the process alive.
const LATCH_TIMEOUT: Duration = Duration::from_millis(300);

/// Node of a run, whose frames and inputs are sent to the recorder thread.
type TappedNode<B, R, S> = RecordedNode<TappedBus<B, EntryProducer>, R, S>;

/// Result of the cycle thread.
#[derive(Debug)]
pub struct RunEnd {
    /// Set if every drive has confirmed that it is disabled, and no stop is latched.
    pub is_orderly: bool,
    /// Failure of the run, with its exit code.
    pub outcome: Result<(), Failure>,
}

impl RunEnd {
    fn new(is_orderly: bool, outcome: Result<(), Failure>) -> Self {
        Self { is_orderly, outcome }
    }
}

/// Runs the cycle thread: priority, bring-up, cycles, stop. Removes the latch after an orderly end.
pub(super) fn run<B: Bus, R: Remote, S: InputSink + Clone>(
    mut node: TappedNode<B, R, S>,
    mut requests: RequestReceiver,
    signals: &StopSignals,
    mut latch: LatchFile,
    realtime: &RealtimeArgs,
) -> Result<(), Failure> {
    // Held until the cycle ends, because the limit of the processors' latency ends with it.
    let granted = realtime::ask_for(realtime.settings());
    let stopping = || signals.is_stop_requested();
    let is_urgent = || signals.is_urgent();
    let RunEnd { is_orderly, outcome } = match warning(&granted) {
        Some(refused) if realtime.require_realtime => {
            RunEnd::new(true, Err(Failure::new(Kind::Bus, refused)))
        }
        warning => {
            match warning {
                None => tracing::info!(%granted, "priority"),
                // Also with `-q`, which leaves errors only in the log.
                Some(warning) => print::error(&format!("warning: {warning}")),
            }
            run_node(&mut node, &mut requests, &mut latch, &stopping, &is_urgent)
        }
    };
    let reason = || outcome.as_ref().err().map_or_else(String::new, ToString::to_string);
    let end = if is_orderly { Ok(()) } else { Err(reason()) };
    match within(LATCH_TIMEOUT, move || latch.end(end)) {
        Some(message) => message.iter().for_each(|line| tracing::warn!("{line}")),
        None => tracing::warn!(
            "the disk of the latch does not respond: the next run may wait for a reset"
        ),
    }
    outcome
}

/// Returns the warning about real-time settings that the kernel refused.
fn warning(granted: &GrantedSettings) -> Option<String> {
    let warning = || {
        format!(
            "real-time settings refused, so cycles may be late: {granted}; LimitRTPRIO=80 and \
             LimitMEMLOCK=512M of systemd/frhc.service allow them"
        )
    };
    (!granted.is_all()).then(warning)
}

/// Runs `task` on a separate thread; returns `None` if it takes longer than `limit`.
fn within<T: Send + 'static>(
    limit: Duration,
    task: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    let (sender, result) = channel();
    let thread = threads::builder("latch");
    // Without a thread the sender is dropped: nothing is received.
    thread.spawn(move || sender.send(task()).ok()).ok();
    result.recv_timeout(limit).ok()
}

/// Boots the node and runs cycles until `stopping` returns true, then shuts it down in order. If it `is_urgent`, the drives
/// keep monitoring the heartbeat, and report its end.
pub fn run_node<B: Bus, R: Remote, S: InputSink + Clone>(
    node: &mut TappedNode<B, R, S>,
    requests: &mut RequestReceiver,
    latch: &mut LatchFile,
    stopping: &impl Fn() -> bool,
    is_urgent: &impl Fn() -> bool,
) -> RunEnd {
    let mut give_up = || {
        requests.answer_during_boot();
        stopping()
    };
    let booted = match latch.awaits() {
        None => node.bring_up(&mut give_up),
        Some(reason) => node.bring_up_unpowered(reason, &mut give_up),
    };
    match booted {
        Ok(()) if latch.awaits().is_some() => {
            tracing::warn!("waiting for `frhc ctl reset`: no drive is enabled");
        }
        // The recorder thread logs that the drives are enabled, behind the events of the boot.
        Ok(()) => {}
        Err(error) => return boot_failure(node, error),
    }
    requests.end_boot(node.now());
    while !stopping() {
        execute_requests(node, requests, latch, stopping);
        // Events of a cycle are behind its record, which is pushed at its end; those of a boot are pushed at once.
        node.bus_mut().tap_mut().takes_events(false);
        run_cycle(node);
        forward_events(node);
        node.bus_mut().tap_mut().takes_events(true);
    }
    requests.close();
    let stopped_by = node.cause().map(|cause| node.in_words(cause));
    let stop = |reason| Failure::new(Kind::Stopped, reason);
    let off = node.shut_down(&mut || is_urgent());
    let off = off.map_err(|error| node.with_names(&error));
    match (stopped_by, off) {
        (None, Ok(())) => RunEnd::new(true, Ok(())),
        (None, Err(error)) => RunEnd::new(false, Err(Failure::new(Kind::Drive, error))),
        (Some(cause), Ok(())) => RunEnd::new(false, Err(stop(format!("stopped by {cause}")))),
        (Some(cause), Err(error)) => {
            RunEnd::new(false, Err(stop(format!("stopped by {cause}; {error}"))))
        }
    }
}

/// Returns the result of a failed boot. If no drive was enabled, the end is orderly and latches nothing.
fn boot_failure<B: Bus, R: Remote, S: InputSink + Clone>(
    node: &mut TappedNode<B, R, S>,
    error: BringUpError,
) -> RunEnd {
    match error {
        BringUpError::GivenUp => RunEnd::new(true, Ok(())),
        BringUpError::Bus(_) | BringUpError::Unfit(_) => {
            RunEnd::new(true, Err(error).or_fail(Kind::Bus))
        }
        BringUpError::Boot(_) => RunEnd::new(true, Err(error).or_fail(Kind::Drive)),
        BringUpError::Mode(_) | BringUpError::Homing(_) | BringUpError::ProofTest(_) => {
            RunEnd::new(node.is_off(), Err(error).or_fail(Kind::Drive))
        }
        BringUpError::LeftOn(_) => {
            RunEnd::new(false, Err(Failure::new(Kind::Drive, node.with_names(&error))))
        }
        BringUpError::NotEnabled(_) => {
            // Records the trip.
            run_cycle(node);
            RunEnd::new(false, Err(Failure::new(Kind::Drive, node.with_names(&error))))
        }
    }
}

/// Runs one cycle and queues its record.
fn run_cycle<B: Bus, R: Remote, S: InputSink + Clone>(node: &mut TappedNode<B, R, S>) {
    let record = node.cycle();
    node.bus_mut().tap_mut().push_record(&record);
}

/// Executes a pending disarm, and then at most one other request.
pub fn execute_requests<B: Bus, R: Remote, S: InputSink + Clone>(
    node: &mut RecordedNode<B, R, S>,
    requests: &mut RequestReceiver,
    latch: &mut LatchFile,
    stopping: &impl Fn() -> bool,
) {
    if let Some(disarm) = requests.pending_disarm() {
        // A disarm is never refused.
        let mode = node.request(Request::Disarm, &mut || false).unwrap_or(node.mode());
        requests.complete_disarm(disarm, mode);
    }
    let Some(accepted) = requests.next(node.now()) else { return };
    let AcceptedRequest { request, .. } = accepted;
    let mut has_booted = false;
    if request == Request::Reset
        && let Err(reason) = latch.before_reset()
    {
        return accepted.refuse_without_latch(reason);
    }
    let is_arming = request == Request::Arm;
    let unverified = if is_arming { node.unverified_posture() } else { Vec::new() };
    let outcome = node.request(request, &mut || {
        has_booted = true;
        requests.begin_boot();
        requests.answer_during_boot();
        stopping()
    });
    if has_booted {
        requests.end_boot(node.now());
    }
    if request == Request::Reset {
        match &outcome {
            Ok(_) => latch.release(),
            Err(_) if node.is_off() => latch.restore(),
            // A drive may be enabled, so the latch records that this run has not ended in order.
            Err(_) => {}
        }
    }
    if is_arming && outcome.is_ok() {
        stopping::facts(node.facts()).iter().for_each(|line| tracing::info!("{line}"));
        log_unverified(&unverified);
    }
    accepted.answer(outcome);
}

/// Logs the posture that nothing verified at the first arming after a boot.
fn log_unverified(posture: &[String]) {
    if !posture.is_empty() {
        let posture = posture.join(", ");
        tracing::info!(
            "posture not verified, as without rest_deg (rest_m): {posture}: compare it with the arm"
        );
    }
}

/// Queues events on the network for the recorder thread.
fn forward_events<B: Bus, R: Remote, S: InputSink + Clone>(node: &mut TappedNode<B, R, S>) {
    while let Some(event) = node.next_event() {
        node.bus_mut().tap_mut().push_event(event);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refused_real_time_setting_is_a_warning() {
        let all = |is_locked| GrantedSettings {
            is_fifo: true,
            is_locked,
            is_exact: true,
            ..GrantedSettings::default()
        };
        assert_eq!(warning(&all(true)), None);
        let warned = warning(&all(false)).unwrap();
        assert!(
            warned.starts_with("real-time settings refused")
                && warned.contains("memory locked refused")
        );
    }

    #[test]
    fn hazard_32_hung_disk_of_the_latch_keeps_no_thread() {
        assert_eq!(within(Duration::from_secs(60), || 7), Some(7));
        let (release, hangs) = channel::<()>();
        assert_eq!(within(Duration::ZERO, move || hangs.recv().is_ok()), None);
        drop(release);
    }
}
