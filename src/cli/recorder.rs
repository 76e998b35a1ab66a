//! What a running node leaves behind, off the cycle's thread: the session on disk, the summary, the
//! newest status.

use std::fs;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::mpsc::Receiver;
use std::sync::mpsc::SyncSender;

use anyhow::Context;

use crate::bus::Tap;
use crate::canopen::frame::Telegram;
use crate::canopen::master::event::Event;
use crate::telemetry::candump::LogWriter;
use crate::telemetry::record::Mode;
use crate::telemetry::record::Record;
use crate::telemetry::session::SessionLog;
use crate::telemetry::status::Status;
use crate::telemetry::summary::Summary;
use crate::time::Instant;

/// A second of frames and records at 1 kHz. When the disk is slower than that they are lost and
/// counted; the cycle does not wait.
pub(super) const QUEUE: usize = 16_384;

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
/// cycle goes on without.
#[derive(Clone, Debug)]
pub(super) struct Offer(pub(super) SyncSender<Entry>);

impl Offer {
    /// A record, or nothing if the queue is full: the recorder sees the gap in the cycle numbers.
    pub(super) fn record(&self, record: Record) {
        self.0.try_send(Entry::Record(record)).ok();
    }

    /// What has happened on the network, or nothing if the queue is full.
    pub(super) fn notice(&self, event: Event) {
        self.0.try_send(Entry::Notice(event)).ok();
    }
}

impl Tap for Offer {
    fn on_wire(&mut self, at: Instant, telegram: &Telegram) {
        self.0.try_send(Entry::Frame(at, *telegram)).ok();
    }
}

/// The folder of a session: `bus.log` and `summary.json`.
#[derive(Debug)]
pub(super) struct Session {
    folder: PathBuf,
    pub(super) log: SessionLog<BufWriter<File>>,
}

impl Session {
    /// Makes the folder and begins its log. Stamps are `epoch_micros` plus the bus's time.
    pub(super) fn create(
        folder: &Path,
        interfaces: &[String],
        epoch_micros: u64,
    ) -> anyhow::Result<Self> {
        let make = || -> std::io::Result<File> {
            fs::create_dir_all(folder)?;
            File::create(folder.join("bus.log"))
        };
        let file = make().with_context(|| format!("session {}", folder.display()))?;
        let writer = LogWriter::new(BufWriter::new(file), interfaces, epoch_micros);
        Ok(Self { folder: folder.to_path_buf(), log: SessionLog::new(writer) })
    }

    /// Ends the log and writes the summary.
    pub(super) fn finish(self, summary: &Summary) -> anyhow::Result<()> {
        let Self { folder, log } = self;
        let finish = || -> anyhow::Result<()> {
            log.finish()?;
            let mut text = serde_json::to_string_pretty(summary)?;
            text.push('\n');
            fs::write(folder.join("summary.json"), text)?;
            Ok(())
        };
        finish().with_context(|| format!("session {}", folder.display()))
    }
}

/// Takes entries until the cycle's thread has gone; returns the summary of them all. `names` are the
/// nodes', in the order of their plans.
pub(super) fn record(
    entries: &Receiver<Entry>,
    mut session: Option<&mut Session>,
    latest: &Latest,
    names: &[String],
) -> Summary {
    let mut summary = Summary::default();
    let mut mode = Mode::Boot;
    for entry in entries {
        match entry {
            Entry::Frame(at, telegram) => {
                if let Some(session) = &mut session {
                    session.log.frame(at, &telegram);
                }
            }
            Entry::Notice(event) => tell(&event, names),
            Entry::Record(record) => {
                if let Some(session) = &mut session {
                    session.log.record(&record);
                }
                if record.mode != mode {
                    mode = record.mode;
                    announce(&record);
                }
                summary.add(&record);
                latest.set(Status::of(&record, summary.missing_samples));
            }
        }
    }
    summary
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
