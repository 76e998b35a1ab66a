//! Recorder thread: passes entries of the cycle thread to the disk writers, the summary, the status for the console, the
//! viewers and the log.

use std::thread;
use std::time::Duration;

use crate::adjustment_log::AdjustmentLog;
use crate::disk_writers::DiskWriters;
use crate::feed_socket::Publisher;
use crate::input_ring::InputConsumer;
use crate::latest_status::LatestStatus;
use crate::log_time;
use crate::rings::{EntryConsumer, EntryHandler, LossCounters};
use canopen::frame::Telegram;
use canopen::master::event::Event;
use config::Config;
use node::record::{Mode, Record};
use telemetry::contact_posture::ContactPostures;
use telemetry::fidelity::{CommandSampler, Fidelity, WrenchSource};
use telemetry::status::{self, JointLabel};
use telemetry::summary::Summary;
use telemetry::timing::LateCycle;
use telemetry::token_bucket::TokenBucket;
use units::numbering::Joint;
use units::time::Instant;

/// Polling interval of the rings. The recorder polls because waking it would cost the cycle thread a system call.
const POLL: Duration = Duration::from_millis(10);

/// Maximum number of entries in a batch.
const MAX_BATCH: usize = 4_096;

/// Mean interval between log lines about the network during a boot.
const BOOT_LINE_EVERY: Duration = Duration::from_millis(100);

/// Burst of log lines during a boot: enough for seven nodes.
const BOOT_LINES_AT_ONCE: u32 = 50;

/// Mean interval between log lines about the network after the boot; limits a flood of forged frames.
const LINE_EVERY: Duration = Duration::from_secs(1);

/// Burst of log lines after the boot: enough for a stop of six drives.
const LINES_AT_ONCE: u32 = 20;

/// Records entries until the cycle thread has ended; returns the summary of the run.
pub(super) fn run(
    mut entries: EntryConsumer,
    mut inputs: InputConsumer,
    mut recorder: Recorder<'_>,
    lost: &LossCounters,
) -> Summary {
    loop {
        // Read before the last `take`, so that entries pushed before the end are not missed.
        let is_over = entries.is_abandoned();
        while entries.take(MAX_BATCH, &mut recorder)
            + inputs.take(MAX_BATCH, |input| recorder.writers.push_input(input))
            > 0
        {
            recorder.flush(lost);
        }
        recorder.log_messages();
        if is_over {
            return recorder.finish(lost);
        }
        thread::park_timeout(POLL);
    }
}

/// State of the recorder thread; handles entries in their order.
#[derive(Debug)]
pub(super) struct Recorder<'a> {
    writers: &'a mut DiskWriters,
    /// Names of the nodes, in the order of their plans.
    nodes: Vec<String>,
    /// Names of the joints with their units, base first.
    joints: Vec<JointLabel>,
    /// Samples the commanded wrench, because the wrench at the hand is unknown on drives.
    commanded: CommandSampler,
    fidelity: Fidelity,
    summary: Summary,
    mode: Mode,
    self_driven: Option<Joint>,
    event_log: EventLog,
    adjustment_log: AdjustmentLog,
    now: Instant,
    latest: LatestStatus,
    newest: Option<Record>,
    telemetry: Option<Publisher>,
}

impl EntryHandler for Recorder<'_> {
    fn on_frame(&mut self, at: Instant, telegram: &Telegram) {
        self.now = self.now.max(at);
        self.writers.push_frame(at, telegram);
        if let Some(telemetry) = &mut self.telemetry {
            telemetry.on_frame(at, telegram);
        }
    }

    fn on_record(&mut self, record: &Record) {
        self.now = self.now.max(record.at);
        self.writers.push_cycle(record);
        if record.mode != self.mode {
            let is_boot_over = self.mode == Mode::Boot && record.mode == Mode::Ready;
            self.mode = record.mode;
            log_time::stamp_with(record.at, || {
                if is_boot_over {
                    tracing::info!("ready: all drives enabled at zero torque");
                }
                log_mode(record, &self.joints);
            });
        }
        let self_driven = record.output.ledger.self_driven;
        let before = std::mem::replace(&mut self.self_driven, self_driven);
        if let Some(joint) = self_driven.filter(|_| before.is_none()) {
            log_time::stamp_with(record.at, || log_self_driven(joint, &self.joints));
        }
        self.adjustment_log.log(record);
        self.watch_timing(record);
        self.summary.add(record);
        self.fidelity.add(self.commanded.sample(record).as_ref());
        if let Some(telemetry) = &mut self.telemetry {
            telemetry.on_record(record, || self.latest.scarce());
        }
        self.newest = Some(*record);
    }

    fn on_event(&mut self, event: &Event) {
        log_time::stamp_with(self.now, || {
            self.event_log.log(self.now, self.mode, event, &self.nodes);
        });
    }
}

impl<'a> Recorder<'a> {
    /// Creates a recorder without entries.
    pub(super) fn new(config: &Config, writers: &'a mut DiskWriters, latest: LatestStatus) -> Self {
        let postures = ContactPostures::new(config.contact_bounds, config.dry_friction());
        Self {
            writers,
            nodes: config.node_plans().into_iter().map(|(_, plan)| plan.name).collect(),
            joints: status::labels(config),
            commanded: CommandSampler::new(&config.controller),
            fidelity: Fidelity::new(WrenchSource::Command),
            summary: Summary::judging(postures),
            mode: Mode::Boot,
            self_driven: None,
            event_log: EventLog::new(),
            adjustment_log: AdjustmentLog::new(),
            now: Instant::ZERO,
            latest,
            newest: None,
            telemetry: None,
        }
    }

    /// Adds viewers, which also receive all entries.
    pub(super) fn with_telemetry(self, telemetry: Option<Publisher>) -> Self {
        Self { telemetry, ..self }
    }

    /// Sends the entries to the disk writers, and the newest record to the console.
    fn flush(&mut self, lost: &LossCounters) {
        self.writers.flush();
        if let Some(record) = self.newest.take() {
            self.latest.set(&record, self.summary.missing_samples, lost.snapshot());
        }
    }

    /// Adds the times of a cycle, and logs the longest step of a late one.
    fn watch_timing(&mut self, record: &Record) {
        // In a boot, nodes and drives decide how long steps take.
        let late = if record.mode == Mode::Boot { None } else { self.latest.add_times(record) };
        if let Some(late) = late {
            log_time::stamp_with(record.at, || self.event_log.log_late_cycle(record.at, &late));
        }
    }

    fn log_messages(&mut self) {
        while let Some(message) = self.writers.next_message() {
            tracing::warn!("{message}");
        }
    }

    fn finish(mut self, lost: &LossCounters) -> Summary {
        log_time::stamp_with(self.now, || self.event_log.log_suppressed());
        self.summary.lost = lost.snapshot();
        self.summary.timing = Some(self.latest.timing());
        self.summary.histograms = Some(self.latest.histograms());
        self.summary.fidelity = self.fidelity.report();
        self.summary
    }
}

/// Logs events on the network at a limited rate.
#[derive(Debug)]
struct EventLog {
    boot: TokenBucket,
    /// Outside of a boot.
    run: TokenBucket,
    suppressed: u64,
}

impl EventLog {
    const fn new() -> Self {
        let boot = TokenBucket::new(BOOT_LINE_EVERY, BOOT_LINES_AT_ONCE);
        let run = TokenBucket::new(LINE_EVERY, LINES_AT_ONCE);
        Self { boot, run, suppressed: 0 }
    }

    fn log(&mut self, now: Instant, mode: Mode, event: &Event, names: &[String]) {
        let bucket = if mode == Mode::Boot { &mut self.boot } else { &mut self.run };
        if bucket.take(now) {
            self.log_suppressed();
            log_event(event, names);
        } else {
            self.suppressed += 1;
        }
    }

    /// Logs the longest step of a late cycle.
    fn log_late_cycle(&mut self, now: Instant, late: &LateCycle) {
        if self.run.take(now) {
            self.log_suppressed();
            tracing::warn!("{late}");
        } else {
            self.suppressed += 1;
        }
    }

    /// Logs the number of lines suppressed since the last call, if any.
    fn log_suppressed(&mut self) {
        match std::mem::take(&mut self.suppressed) {
            0 => {}
            suppressed => tracing::warn!("network: {suppressed} more suppressed"),
        }
    }
}

/// Logs an event with the name of its node: a warning, unless it belongs to an orderly run.
fn log_event(event: &Event, names: &[String]) {
    let name = event.node().and_then(|node| names.get(node.0)).map_or("network", String::as_str);
    let is_expected = matches!(
        event,
        Event::Booted
            | Event::Configured { .. }
            | Event::Joined { .. }
            | Event::LimitsRaised { .. }
            | Event::HomingPrepared { .. }
            | Event::HomingLeft { .. }
            | Event::TorqueLimited { .. }
            | Event::Tested { .. }
            | Event::MonitoringEnded { .. }
            | Event::PowerOffConfirmed { .. }
            | Event::StateChanged { .. }
    );
    let is_reset = matches!(event, Event::Emergency { emergency, .. } if emergency.is_reset());
    if is_expected || is_reset {
        tracing::info!("{name}: {event}");
    } else {
        tracing::warn!("{name}: {event}");
    }
}

/// Logs a change of mode, and the cause of a stop.
fn log_mode(record: &Record, labels: &[JointLabel]) {
    let mode = record.mode;
    let names: Vec<_> = labels.iter().map(|label| label.name.as_str()).collect();
    match record.cause.map(|cause| cause.with_name(&names)) {
        Some(cause) => tracing::warn!(%mode, %cause, "mode"),
        None => tracing::info!(%mode, "mode"),
    }
}

/// Logs that friction compensation was withdrawn, because it drove a joint.
fn log_self_driven(joint: Joint, labels: &[JointLabel]) {
    let name = labels.get(joint.index()).map(|label| label.name.as_str());
    tracing::warn!(
        joint = joint.number(),
        name,
        "friction compensation drove a joint by itself and is withdrawn until the next arming: measure its friction"
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::numbering::NodeIndex;

    #[test]
    fn hazard_32_flood_of_events_is_logged_at_a_limited_rate() {
        for (mode, expected) in
            [(Mode::Boot, 50 + 14), (Mode::Engaged, 20 + 1), (Mode::ZeroTorque, 20 + 1)]
        {
            let mut log = EventLog::new();
            let mut logged = 0;
            for millis in 0..1_500 {
                let now = Instant::from_micros(millis * 1_000);
                let before = log.suppressed;
                log.log(now, mode, &Event::HeartbeatLost { node: NodeIndex(0) }, &[]);
                logged += u64::from(log.suppressed != before + 1);
            }
            assert_eq!(logged, expected, "{mode}");
            assert!(log.suppressed > 0);
            log.log_suppressed();
            assert_eq!(log.suppressed, 0);
        }
    }
}
