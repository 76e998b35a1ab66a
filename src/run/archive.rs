//! Threads that write what a run leaves, one for each place: a disk that stalls holds up nothing but itself.
//!
//! The recorder hands every entry to both threads in batches, the fault records' first. The memory of the 2 s
//! before a trip is filled by the thread of the fault records, whatever the session's disk does. A batch that
//! finds no room, after about 5 s of stall, is dropped and counted.

use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::sync::mpsc::Sender;
use std::sync::mpsc::SyncSender;
use std::sync::mpsc::channel;
use std::sync::mpsc::sync_channel;
use std::thread;
use std::thread::JoinHandle;

use anyhow::Context;

use crate::fault_records::Faults;
use crate::keeper::Keeper;
use crate::kept::Kept;
use crate::rings::Lost;
use crate::session::Session;
use canopen::frame::Telegram;
use node::record::Record;
use telemetry::summary::Summary;
use units::time::Instant;

/// Batches that may wait for a disk: 5 s of them, one each time the recorder looks for entries.
const MAX_BATCHES: usize = 1_000;

/// Stack of a thread that writes, in bytes. Locked memory: the default would be eight times as much.
pub(super) const STACK: usize = 256 * 1_024;

/// An entry to be kept.
#[derive(Debug)]
enum Entry {
    Frame(Instant, Telegram),
    Cycle(Box<Record>),
}

/// Entries in their order.
type Batch = Arc<[Entry]>;

/// The threads of a run.
#[derive(Debug)]
pub(super) struct Archive {
    faults: Option<Writer<Faults>>,
    session: Option<Writer<Session>>,
    batch: Vec<Entry>,
    news: Option<String>,
    lost: Lost,
}

impl Archive {
    /// Gives each part of `keeper` a thread.
    ///
    /// # Errors
    /// When there is no thread.
    pub(super) fn of(keeper: Keeper, lost: Lost) -> anyhow::Result<Self> {
        let Keeper { faults, session, news } = keeper;
        let faults = faults.map(|faults| Writer::spawn("frhc-faults", faults)).transpose()?;
        let session = session.map(|session| Writer::spawn("frhc-session", session)).transpose()?;
        Ok(Self { faults, session, batch: Vec::new(), news, lost })
    }

    /// Adds a frame to the batch.
    pub(super) fn frame(&mut self, at: Instant, telegram: &Telegram) {
        self.batch.push(Entry::Frame(at, *telegram));
    }

    /// Adds a cycle to the batch.
    pub(super) fn cycle(&mut self, record: &Record) {
        self.batch.push(Entry::Cycle(Box::new(*record)));
    }

    /// Hands the batch to the threads, that of the fault records first. Never waits.
    pub(super) fn flush(&mut self) {
        let batch: Batch = self.batch.drain(..).collect();
        if batch.is_empty() {
            return;
        }
        let lost = |writer: &Result<(), u64>| writer.err().unwrap_or(0);
        let of_faults = self.faults.as_ref().map_or(Ok(()), |writer| writer.offer(&batch));
        let of_session = self.session.as_ref().map_or(Ok(()), |writer| writer.offer(&batch));
        self.lost.of_faults(lost(&of_faults));
        self.lost.of_session(lost(&of_session));
    }

    /// Returns the next line for people.
    pub(super) fn news(&mut self) -> Option<String> {
        let news = self.news.take();
        let news = news.or_else(|| self.faults.as_ref().and_then(Writer::news));
        news.or_else(|| self.session.as_ref().and_then(Writer::news))
    }

    /// Waits for the threads; returns what they kept.
    ///
    /// # Errors
    /// When one of them has failed.
    pub(super) fn close(mut self) -> anyhow::Result<Keeper> {
        self.flush();
        let faults = self.faults.map(Writer::close).transpose()?;
        let session = self.session.map(Writer::close).transpose()?;
        Ok(Keeper { faults, session, news: self.news })
    }

    /// Waits for the threads and ends what they kept, as [`Keeper::finish`] does.
    ///
    /// # Errors
    /// As [`Keeper::finish`], or when a thread has failed.
    pub(super) fn finish(self, summary: &Summary) -> (Option<String>, anyhow::Result<()>) {
        match self.close() {
            Ok(keeper) => keeper.finish(summary),
            Err(error) => (None, Err(error)),
        }
    }
}

/// A thread that writes.
#[derive(Debug)]
struct Writer<T> {
    name: &'static str,
    batches: SyncSender<Batch>,
    news: Receiver<String>,
    thread: JoinHandle<T>,
}

impl<T: Kept> Writer<T> {
    fn spawn(name: &'static str, kept: T) -> anyhow::Result<Self> {
        let (batches, taken) = sync_channel(MAX_BATCHES);
        let (said, news) = channel();
        let thread = thread::Builder::new().name(name.to_owned()).stack_size(STACK);
        let thread = thread.spawn(move || write(kept, &taken, &said));
        let thread = thread.with_context(|| format!("no thread {name}"))?;
        Ok(Self { name, batches, news, thread })
    }

    /// Hands over a batch; the number of its entries if there was no room.
    fn offer(&self, batch: &Batch) -> Result<(), u64> {
        let offered = self.batches.try_send(Arc::clone(batch));
        offered.map_err(|_| u64::try_from(batch.len()).unwrap_or(u64::MAX))
    }

    fn news(&self) -> Option<String> {
        self.news.try_recv().ok()
    }

    fn close(self) -> anyhow::Result<T> {
        drop(self.batches);
        let kept = self.thread.join();
        self.news.try_iter().for_each(|news| tracing::warn!("{news}"));
        kept.map_err(|_| anyhow::anyhow!("thread {} failed", self.name))
    }
}

/// Writes batches until the other end is gone.
fn write<T: Kept>(mut kept: T, batches: &Receiver<Batch>, said: &Sender<String>) -> T {
    for batch in batches {
        for entry in &*batch {
            match entry {
                Entry::Frame(at, telegram) => kept.frame(*at, telegram),
                Entry::Cycle(record) => kept.cycle(record),
            }
        }
        while let Some(news) = kept.news() {
            // The run may have ended.
            said.send(news).ok();
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::fs::File;
    use std::io::Read;
    use std::io::pipe;
    use std::os::fd::OwnedFd;
    use std::path::Path;
    use std::time::Duration;

    use super::*;
    use crate::provenance::Provenance;
    use canopen::frame::Channel;
    use canopen::frame::Frame;
    use config::Config;
    use lab::bench::Bench;
    use node::cause::Cause;
    use node::record::Mode;
    use sim::scenario::Scenario;
    use units::numbering::Joint;

    /// Frames on two full buses in a cycle of 1 ms.
    const FRAMES: u64 = 18;

    const LIMIT: Duration = Duration::from_secs(60);

    fn provenance() -> Provenance {
        Provenance { interfaces: vec!["can0".to_owned()], ..Provenance::default() }
    }

    fn any_record() -> Record {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        Bench::new(&config, Scenario::parse("seconds = 1").unwrap(), 1, false, ()).cycle()
    }

    /// Cycles of 1 ms with their frames, handed on every fifth, as the recorder does.
    fn cycles(archive: &mut Archive, cycles: std::ops::Range<u64>, record: &Record) {
        for cycle in cycles {
            let begun = 1_000 * cycle;
            for frame in 0..FRAMES {
                let at = Instant::from_micros(begun + 50 * frame);
                let telegram = Telegram { channel: Channel(0), frame: Frame::new(0x80, []) };
                archive.frame(at, &telegram);
            }
            archive.cycle(&Record { cycle, at: Instant::from_micros(begun), ..*record });
            if cycle % 5 == 4 {
                archive.flush();
            }
        }
    }

    #[test]
    fn hazard_32_a_stalled_session_disk_leaves_faults_complete() {
        let folder = crate::scratch::path("stalled");
        // A pipe that is read by nothing takes 64 kB and then holds up its writer, as a stalled disk does.
        let (mut unread, disk) = pipe().unwrap();
        let disk = File::from(OwnedFd::from(disk));
        let session = Some(Session::onto(disk, &folder, &provenance()));
        let faults = Some(Faults::open(&folder, &provenance()).unwrap());
        let lost = Lost::default();
        let keeper = Keeper { session, faults, news: None };
        let mut archive = Archive::of(keeper, lost.clone()).unwrap();

        let record = any_record();
        let engaged = Record { mode: Mode::Engaged, cause: None, ..record };
        cycles(&mut archive, 0..2_000, &engaged);
        let cause = Some(Cause::SamplesMissing { joint: Joint::of::<3>(), cycles: 3 });
        let stopped = Record { mode: Mode::ZeroTorque, cause, ..record };
        cycles(&mut archive, 2_000..3_005, &stopped);
        // The record stands on its disk while the session's is still stalled.
        let news = archive.faults.as_ref().unwrap().news.recv_timeout(LIMIT).unwrap();
        assert!(news.contains("001-2000-samples-missing"), "{news}");

        let session = thread::spawn(move || {
            let mut log = String::new();
            unread.read_to_string(&mut log).unwrap();
            log
        });
        let Keeper { session: kept, faults, .. } = archive.close().unwrap();
        assert!(faults.unwrap().finish().unwrap().contains("001-2000-samples-missing"));
        drop(kept);
        let log = fs::read_to_string(folder.join("001-2000-samples-missing/bus.log")).unwrap();
        let frames = |log: &str| log.lines().filter(|line| line.contains(" can0 ")).count();
        // 2 s before the last frame of the cycle that tripped, and 1 s after its SYNC.
        assert_eq!(frames(&log), 3_000 * usize::try_from(FRAMES).unwrap() - 17);
        assert_eq!(frames(&session.join().unwrap()), 3_005 * usize::try_from(FRAMES).unwrap());
        assert!(lost.so_far().is_empty(), "{}", lost.so_far());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_32_a_disk_that_hangs_for_good_loses_and_counts() {
        let folder = crate::scratch::path("hangs");
        let (unread, disk) = pipe().unwrap();
        let disk = File::from(OwnedFd::from(disk));
        let session = Some(Session::onto(disk, &folder, &provenance()));
        let lost = Lost::default();
        let keeper = Keeper { session, ..Keeper::default() };
        let mut archive = Archive::of(keeper, lost.clone()).unwrap();
        cycles(&mut archive, 0..7_000, &any_record());
        let of_session = lost.so_far().of_session;
        assert!(of_session > 0 && of_session % (5 * (FRAMES + 1)) == 0, "{of_session}");
        // The disk is gone: the thread ends, and says why the recording did.
        drop(unread);
        let mut session = archive.close().unwrap().session.unwrap();
        assert_eq!(session.news(), None, "it was passed on");
    }
}
