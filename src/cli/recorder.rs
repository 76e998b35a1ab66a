//! What a running node leaves behind, off the cycle's thread: the session on disk, fault records, the
//! summary, the newest status, and lines for people.

use std::sync::Arc;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::sync::mpsc::SyncSender;
use std::sync::mpsc::sync_channel;
use std::time::Duration;

use crate::bus::Tap;
use crate::canopen::frame::Telegram;
use crate::canopen::master::event::Event;
use crate::cli::keeper::Keeper;
use crate::telemetry::record::Mode;
use crate::telemetry::record::Record;
use crate::telemetry::status::Status;
use crate::telemetry::summary::Summary;
use crate::telemetry::token_bucket::TokenBucket;
use crate::time::Instant;

/// A second of frames and records at 1 kHz. When the disk is slower than that they are lost and
/// counted; the cycle does not wait.
const QUEUE: usize = 16_384;

/// A line for people about the network comes so often at most, in the long run …
const LINE_EVERY: Duration = Duration::from_millis(100);

/// … and so many at once: what a boot says of seven nodes.
const LINES_AT_ONCE: u32 = 50;

/// What the cycle's thread hands over.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "a box would be an allocation in every cycle")]
pub(super) enum Entry {
    /// A frame that passed by.
    Frame(Instant, Telegram),
    /// A cycle.
    Record(Record),
    /// Something has happened on the network.
    Notice(Event),
}

/// The newest status, for the console.
#[derive(Clone, Debug, Default)]
pub(super) struct Latest(Arc<Mutex<Option<Status>>>);

impl Latest {
    /// The newest status, `None` before the first cycle.
    pub(super) fn get(&self) -> Option<Status> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn set(&self, status: Status) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(status);
    }
}

/// The cycle's end of the queue. Never waits: when it is full, or nobody takes entries any more, the
/// cycle goes on without, and the loss is counted.
#[derive(Clone, Debug)]
pub(super) struct Offer {
    queue: SyncSender<Entry>,
    lost: Lost,
}

/// How many entries were lost so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Lost(Arc<AtomicU64>);

impl Lost {
    /// So many.
    pub(super) fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// The two ends of the queue, and what is lost on the way.
pub(super) fn queue() -> (Offer, Receiver<Entry>, Lost) {
    let (queue, entries) = sync_channel(QUEUE);
    let lost = Lost::default();
    (Offer { queue, lost: lost.clone() }, entries, lost)
}

impl Offer {
    /// A record.
    pub(super) fn record(&self, record: Record) {
        self.offer(Entry::Record(record));
    }

    /// What has happened on the network.
    pub(super) fn notice(&self, event: Event) {
        self.offer(Entry::Notice(event));
    }

    fn offer(&self, entry: Entry) {
        if self.queue.try_send(entry).is_err() {
            self.lost.0.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl Tap for Offer {
    fn on_wire(&mut self, at: Instant, telegram: &Telegram) {
        self.offer(Entry::Frame(at, *telegram));
    }
}

/// Takes entries until the cycle's thread has gone; returns the summary of them all. `names` are the
/// nodes', in the order of their plans.
pub(super) fn record(
    entries: &Receiver<Entry>,
    keeper: &mut Keeper,
    latest: &Latest,
    names: &[String],
    lost: &Lost,
) -> Summary {
    let mut summary = Summary::default();
    let mut mode = Mode::Boot;
    let mut teller = Teller::new();
    let mut now = Instant::ZERO;
    for entry in entries {
        match entry {
            Entry::Frame(at, telegram) => {
                now = now.max(at);
                keeper.frame(at, &telegram);
            }
            Entry::Notice(event) => teller.tell(now, &event, names),
            Entry::Record(record) => {
                now = now.max(record.at);
                keeper.cycle(&record);
                if record.mode != mode {
                    mode = record.mode;
                    announce(&record);
                }
                summary.add(&record);
                latest.set(Status::of(&record, summary.missing_samples, lost.count()));
            }
        }
        while let Some(news) = keeper.news() {
            tracing::warn!("{news}");
        }
    }
    teller.own_up();
    summary.lost_entries = lost.count();
    summary
}

/// Tells what happens on the network, but no flood of it.
#[derive(Debug)]
struct Teller {
    bucket: TokenBucket,
    suppressed: u64,
}

impl Teller {
    const fn new() -> Self {
        Self { bucket: TokenBucket::new(LINE_EVERY, LINES_AT_ONCE), suppressed: 0 }
    }

    fn tell(&mut self, now: Instant, event: &Event, names: &[String]) {
        if self.bucket.take(now) {
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
    let name = event.node().and_then(|node| names.get(node)).map_or("network", String::as_str);
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
        | Event::HeartbeatLost { .. }
        | Event::Rebooted { .. }
        | Event::Duplicate { .. }
        | Event::Stranger { .. }
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
    use std::path::Path;

    use crate::canopen::frame::Channel;
    use crate::canopen::frame::Frame;
    use crate::config::Config;
    use crate::lab::bench::Bench;
    use crate::sim::scenario::Scenario;

    fn sync() -> Telegram {
        Telegram { channel: Channel(0), frame: Frame::new(0x80, []) }
    }

    #[test]
    fn hazard_32_what_a_slow_disk_cannot_take_is_lost_and_counted() {
        let (mut offer, entries, lost) = queue();
        for micros in 0..20_000 {
            offer.on_wire(Instant::from_micros(micros), &sync());
        }
        drop(offer);
        let latest = Latest::default();
        let summary = record(&entries, &mut Keeper::default(), &latest, &[], &lost);
        assert_eq!(summary.lost_entries, 20_000 - 16_384);
        assert!(summary.to_string().contains("not recorded      3616 frames"), "{summary}");
    }

    /// The torques of so many cycles, arm carried, while the recorder does as it likes.
    fn torques(tap: impl Tap, cycles: usize) -> Vec<(Instant, [i16; 6])> {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let script = "seconds = 2\n[[console]]\nat_s = 0.05\nrequest = \"arm\"\n";
        let mut bench = Bench::new(&config, Scenario::parse(script).unwrap(), 1, false, tap);
        bench.bring_up().unwrap();
        (0..cycles).map(|_| bench.cycle()).map(|record| (record.at, record.targets)).collect()
    }

    #[test]
    fn promise_13_a_recorder_that_hangs_or_is_gone_changes_no_torque() {
        let alone = torques((), 1_500);
        assert!(alone.iter().any(|(_, targets)| targets.iter().any(|target| *target != 0)));
        let (hanging, entries, lost) = queue();
        assert_eq!(torques(hanging, 1_500), alone);
        assert!(lost.count() > 0, "its queue was full");
        drop(entries);
        let (orphan, entries, _) = queue();
        drop(entries);
        assert_eq!(torques(orphan, 300), alone[..300]);
    }

    #[test]
    fn hazard_32_a_flood_of_events_is_told_by_a_few_lines_that_say_how_many_were_not() {
        let mut teller = Teller::new();
        let mut told = 0;
        for millis in 0..10_000 {
            let now = Instant::from_micros(millis * 1_000);
            let before = teller.suppressed;
            teller.tell(now, &Event::HeartbeatLost { node: 0 }, &[]);
            told += u64::from(teller.suppressed != before + 1);
        }
        assert_eq!(told, 50 + 99, "those at once, and ten a second");
        assert!(teller.suppressed > 0);
        teller.own_up();
        assert_eq!(teller.suppressed, 0);
    }
}
