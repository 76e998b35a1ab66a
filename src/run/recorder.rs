//! What a running node leaves behind, off the cycle's thread: the session on disk, fault records, the
//! summary, the newest status, and lines for people.

use std::sync::Arc;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::thread;
use std::time::Duration;

use crate::archive::Archive;
use crate::rings::Entries;
use crate::rings::Lost;
use crate::rings::Taker;
use crate::time_line;
use canopen::frame::Telegram;
use canopen::master::event::Event;
use node::record::Mode;
use node::record::Record;
use telemetry::status::Status;
use telemetry::summary::Summary;
use telemetry::token_bucket::TokenBucket;
use units::time::Instant;

/// Time between two looks for entries. The recorder polls: a cycle that wakes it would make a system call.
const POLL: Duration = Duration::from_millis(5);

/// Entries in a batch at most.
const MAX_BATCH: usize = 4_096;

/// Time between two lines about the network during a boot, in the long run.
const BOOT_LINE_EVERY: Duration = Duration::from_millis(100);

/// Lines at once during a boot: what it says of seven nodes.
const BOOT_LINES_AT_ONCE: u32 = 50;

/// Time between two lines about the network afterwards, in the long run: a flood of forged frames is not read.
const LINE_EVERY: Duration = Duration::from_secs(1);

/// Lines at once afterwards: what six drives say that stop.
const LINES_AT_ONCE: u32 = 20;

/// The newest status, for the console.
#[derive(Clone, Debug, Default)]
pub(super) struct Latest(Arc<Mutex<Option<(Instant, Status)>>>);

impl Latest {
    /// The newest status, `None` before the first cycle.
    pub(super) fn get(&self) -> Option<Status> {
        let latest = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        latest.as_ref().map(|(_, status)| status.clone())
    }

    /// Time of the SYNC that the newest status belongs to.
    pub(super) fn at(&self) -> Option<Instant> {
        let latest = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        latest.as_ref().map(|(at, _)| *at)
    }

    pub(super) fn set(&self, at: Instant, status: Status) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((at, status));
    }
}

/// Takes entries until the cycle's thread has gone; returns the summary of them all. `names` are the
/// nodes', in the order of their plans.
pub(super) fn record(
    mut entries: Taker,
    archive: &mut Archive,
    latest: &Latest,
    names: &[String],
    lost: &Lost,
) -> Summary {
    let mut recorder = Recorder {
        archive,
        names,
        summary: Summary::default(),
        mode: Mode::Boot,
        teller: Teller::new(),
        now: Instant::ZERO,
        newest: None,
    };
    loop {
        // In this order what was left at the end is taken too.
        let is_over = entries.is_abandoned();
        while entries.take(MAX_BATCH, &mut recorder) > 0 {
            recorder.hand_on(latest, lost);
        }
        recorder.pass_news();
        if is_over {
            return recorder.end(lost);
        }
        thread::park_timeout(POLL);
    }
}

/// What is made of the entries, in their order.
#[derive(Debug)]
struct Recorder<'a> {
    archive: &'a mut Archive,
    names: &'a [String],
    summary: Summary,
    mode: Mode,
    teller: Teller,
    now: Instant,
    newest: Option<Record>,
}

impl Entries for Recorder<'_> {
    fn frame(&mut self, at: Instant, telegram: &Telegram) {
        self.now = self.now.max(at);
        self.archive.frame(at, telegram);
    }

    fn record(&mut self, record: &Record) {
        self.now = self.now.max(record.at);
        self.archive.cycle(record);
        if record.mode != self.mode {
            self.mode = record.mode;
            time_line::at(record.at, || announce(record));
        }
        self.summary.add(record);
        self.newest = Some(*record);
    }

    fn event(&mut self, event: &Event) {
        time_line::at(self.now, || self.teller.tell(self.now, self.mode, event, self.names));
    }
}

impl Recorder<'_> {
    /// Hands what was taken to the disks, and the newest status to the console.
    fn hand_on(&mut self, latest: &Latest, lost: &Lost) {
        self.archive.flush();
        if let Some(record) = self.newest.take() {
            latest.set(record.at, Status::of(&record, self.summary.missing_samples, lost.so_far()));
        }
    }

    fn pass_news(&mut self) {
        while let Some(news) = self.archive.news() {
            tracing::warn!("{news}");
        }
    }

    fn end(mut self, lost: &Lost) -> Summary {
        time_line::at(self.now, || self.teller.own_up());
        self.summary.lost = lost.so_far();
        self.summary
    }
}

/// Tells what happens on the network, but no flood of it.
#[derive(Debug)]
struct Teller {
    boot: TokenBucket,
    /// Outside of a boot.
    run: TokenBucket,
    suppressed: u64,
}

impl Teller {
    const fn new() -> Self {
        let boot = TokenBucket::new(BOOT_LINE_EVERY, BOOT_LINES_AT_ONCE);
        let run = TokenBucket::new(LINE_EVERY, LINES_AT_ONCE);
        Self { boot, run, suppressed: 0 }
    }

    fn tell(&mut self, now: Instant, mode: Mode, event: &Event, names: &[String]) {
        let bucket = if mode == Mode::Boot { &mut self.boot } else { &mut self.run };
        if bucket.take(now) {
            self.own_up();
            tell(event, names);
        } else {
            self.suppressed += 1;
        }
    }

    /// Says how many lines were not told.
    fn own_up(&mut self) {
        match std::mem::take(&mut self.suppressed) {
            0 => {}
            suppressed => tracing::warn!("network: {suppressed} more suppressed"),
        }
    }
}

/// What happens on the network is worth a line, with the name of the node it is about.
fn tell(event: &Event, names: &[String]) {
    let name = event.node().and_then(|node| names.get(node.0)).map_or("network", String::as_str);
    match event {
        Event::Booted
        | Event::Configured { .. }
        | Event::Joined { .. }
        | Event::StateChanged { .. } => tracing::info!("{name}: {event}"),
        Event::Emergency { emergency, .. } if emergency.is_reset() => {
            tracing::info!("{name}: {event}");
        }
        Event::Emergency { .. }
        | Event::BootFailed(_)
        | Event::FoundEnabled { .. }
        | Event::Absent { .. }
        | Event::ErrorHistory { .. }
        | Event::Statusword { .. }
        | Event::ReadBack { .. }
        | Event::ReadByAnother { .. }
        | Event::HeartbeatLost { .. }
        | Event::Rebooted { .. }
        | Event::Duplicate { .. }
        | Event::UnknownNode { .. }
        | Event::ForeignMaster { .. } => tracing::warn!("{name}: {event}"),
    }
}

/// A change of mode is worth a line.
fn announce(record: &Record) {
    let mode = record.mode;
    match record.cause {
        Some(cause) => tracing::warn!(%mode, %cause, "mode"),
        None => tracing::info!(%mode, "mode"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::numbering::NodeIndex;

    #[test]
    fn hazard_32_a_flood_of_events_is_told_by_a_few_lines_that_say_how_many_were_not() {
        for (mode, most) in
            [(Mode::Boot, 50 + 14), (Mode::Engaged, 20 + 1), (Mode::ZeroTorque, 20 + 1)]
        {
            let mut teller = Teller::new();
            let mut told = 0;
            for millis in 0..1_500 {
                let now = Instant::from_micros(millis * 1_000);
                let before = teller.suppressed;
                teller.tell(now, mode, &Event::HeartbeatLost { node: NodeIndex(0) }, &[]);
                told += u64::from(teller.suppressed != before + 1);
            }
            assert_eq!(told, most, "{mode}");
            assert!(teller.suppressed > 0);
            teller.own_up();
            assert_eq!(teller.suppressed, 0);
        }
    }
}
