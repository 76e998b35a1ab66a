//! Writer threads of session and fault records, one each, so that a stalled disk delays only its own recording.
//!
//! The recorder thread sends every entry to both in batches, to the fault records first. The thread of the fault records
//! keeps the last 2 s in memory, so a trip is complete even if the session's disk stalls. After about 5 s of stall the
//! queue is full, and further batches are dropped and counted.
//!
//! Each thread closes its own recording at the end of the run. A stalled disk delays no other thread, and the process
//! only for a limited time.

use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::time::Duration;

use anyhow::Context;

use crate::batches::{Batch, Batches};
use crate::fault_records::FaultRecorder;
use crate::record_sink::RecordSink;
use crate::rings::LossCounters;
use crate::run_recorder::RunRecorder;
use crate::session::Session;
use crate::threads;
use canopen::frame::Telegram;
use inputs::Input;
use node::record::Record;
use telemetry::summary::Summary;
use units::time::Instant;

/// Capacity of a writer's queue in batches: 5 s at one batch per poll of the recorder thread.
const QUEUE_CAPACITY: usize = 500;

/// Writer threads of a run.
#[derive(Debug)]
pub(super) struct DiskWriters {
    faults: Option<Writer<FaultRecorder>>,
    session: Option<Writer<Session>>,
    batches: Batches,
    message: Option<String>,
    lost: LossCounters,
}

impl DiskWriters {
    /// Starts one thread for each part of `recorder`.
    ///
    /// # Errors
    /// When a thread cannot be started.
    pub(super) fn start(recorder: RunRecorder, lost: LossCounters) -> anyhow::Result<Self> {
        let RunRecorder { faults, session, message } = recorder;
        let faults = faults.map(|faults| Writer::spawn("faults", faults)).transpose()?;
        let session = session.map(|session| Writer::spawn("session", session)).transpose()?;
        Ok(Self { faults, session, batches: Batches::default(), message, lost })
    }

    /// Adds a frame to the batch.
    pub(super) fn push_frame(&mut self, at: Instant, telegram: &Telegram) {
        self.batches.filling.push_frame(at, telegram);
    }

    /// Adds a cycle to the batch.
    pub(super) fn push_cycle(&mut self, record: &Record) {
        self.batches.filling.push_cycle(record);
    }

    /// Adds an input of the node to the batch.
    pub(super) fn push_input(&mut self, input: Input) {
        self.batches.filling.push_input(input);
    }

    /// Sends the batch to the writers, to the fault records first. Never blocks.
    pub(super) fn flush(&mut self) {
        let Some(batch) = self.batches.take() else { return };
        let lost = |writer: &Result<(), u64>| writer.err().unwrap_or(0);
        let of_faults = self.faults.as_ref().map_or(Ok(()), |writer| writer.send(&batch));
        let of_session = self.session.as_ref().map_or(Ok(()), |writer| writer.send(&batch));
        self.lost.add_fault_records(lost(&of_faults));
        self.lost.add_session(lost(&of_session));
        if of_session.is_err() {
            let inputs = u64::try_from(batch.inputs()).unwrap_or(u64::MAX);
            self.batches.filling.push_input(Input::Lost(inputs));
        }
    }

    /// Returns the next message to log, if there is one.
    pub(super) fn next_message(&mut self) -> Option<String> {
        let message = self.message.take();
        let message = message.or_else(|| self.faults.as_ref().and_then(Writer::next_message));
        message.or_else(|| self.session.as_ref().and_then(Writer::next_message))
    }

    /// Lets each thread close its recording, and waits for both until `deadline`, on the clock `now`. Returns a line that
    /// names the fault records of this run.
    ///
    /// # Errors
    /// When a recording is incomplete, or its disk did not respond in time. Such a recording is abandoned.
    pub(super) fn finish(
        mut self,
        summary: &Summary,
        deadline: Instant,
        now: impl Fn() -> Instant,
    ) -> (Option<String>, anyhow::Result<()>) {
        self.flush();
        let faults = self.faults.map(|writer| writer.close(summary));
        let session = self.session.map(|writer| writer.close(summary));
        let mut closed = Outcome::default();
        let mut given_up = Vec::new();
        for closing in [faults, session].into_iter().flatten() {
            match closing.wait(deadline.since(now())) {
                Some(Outcome { line, result }) => {
                    closed.line = closed.line.or(line);
                    closed.result = closed.result.and(result);
                }
                None => given_up.push(closing.name),
            }
        }
        if !given_up.is_empty() {
            let recordings = given_up.join(" and ");
            closed.result = Err(anyhow::anyhow!(
                "{recordings} given up: the disk did not respond before the end of the process"
            ));
        }
        (closed.line, closed.result)
    }
}

/// Outcome of a recording.
#[derive(Debug)]
struct Outcome {
    /// Line about the recording, to be printed.
    line: Option<String>,
    result: anyhow::Result<()>,
}

impl Default for Outcome {
    fn default() -> Self {
        Self { line: None, result: Ok(()) }
    }
}

/// Recording that is closed with the summary of its run.
trait Recording: RecordSink {
    /// Returns the displayed name, with the folder.
    fn name(&self) -> String;
    fn close(self, summary: &Summary) -> Outcome;
}

impl Recording for FaultRecorder {
    fn name(&self) -> String {
        format!("fault records {}", self.folder().display())
    }

    fn close(self, _: &Summary) -> Outcome {
        Outcome { line: self.finish(), result: Ok(()) }
    }
}

impl Recording for Session {
    fn name(&self) -> String {
        format!("session {}", self.folder().display())
    }

    fn close(self, summary: &Summary) -> Outcome {
        Outcome { line: None, result: self.finish(summary) }
    }
}

/// Writer thread that gets no more batches, and closes its recording once it has written them.
#[derive(Debug)]
struct ClosingThread {
    /// Name of the recording.
    name: String,
    messages: Receiver<String>,
    closed: Receiver<Outcome>,
}

impl ClosingThread {
    /// Waits for at most `limit`; `None` if the recording is not closed by then.
    fn wait(&self, limit: Duration) -> Option<Outcome> {
        let closed = match self.closed.recv_timeout(limit) {
            Ok(closed) => closed,
            Err(RecvTimeoutError::Timeout) => return None,
            Err(RecvTimeoutError::Disconnected) => {
                let error = anyhow::anyhow!("the thread of {} panicked", self.name);
                Outcome { line: None, result: Err(error) }
            }
        };
        self.messages.try_iter().for_each(|message| tracing::warn!("{message}"));
        Some(closed)
    }
}

/// Thread that writes batches to its recording, and the queue to it.
#[derive(Debug)]
struct Writer<T> {
    /// Name of the recording.
    name: String,
    batches: SyncSender<Arc<Batch>>,
    messages: Receiver<String>,
    summary: Sender<Summary>,
    closed: Receiver<Outcome>,
    recording: PhantomData<T>,
}

impl<T: Recording> Writer<T> {
    fn spawn(thread: &'static str, recording: T) -> anyhow::Result<Self> {
        let name = recording.name();
        let (batches, received) = sync_channel(QUEUE_CAPACITY);
        let (sender, messages) = channel();
        let (summary, summaries) = channel();
        let (ended, closed) = channel();
        let spawned = threads::builder(thread).spawn(move || {
            let recording = write(recording, &received, &sender);
            // Without a summary the end is not awaited.
            if let Ok(summary) = summaries.recv() {
                ended.send(recording.close(&summary)).ok();
            }
        });
        spawned.with_context(|| format!("cannot start the {thread} thread"))?;
        Ok(Self { name, batches, messages, summary, closed, recording: PhantomData })
    }

    /// Queues a batch without blocking; returns the number of entries dropped when the queue is full.
    fn send(&self, batch: &Arc<Batch>) -> Result<(), u64> {
        let sent = self.batches.try_send(Arc::clone(batch));
        sent.map_err(|_| u64::try_from(batch.len()).unwrap_or(u64::MAX))
    }

    fn next_message(&self) -> Option<String> {
        self.messages.try_recv().ok()
    }

    /// Lets the thread write all queued batches, and then close its recording.
    fn close(self, summary: &Summary) -> ClosingThread {
        // The thread is gone after a panic; its receiver reports that.
        self.summary.send(summary.clone()).ok();
        ClosingThread { name: self.name, messages: self.messages, closed: self.closed }
    }
}

/// Writes batches until the sender is dropped; returns the recording.
fn write<T: RecordSink>(
    mut sink: T,
    batches: &Receiver<Arc<Batch>>,
    messages: &Sender<String>,
) -> T {
    for batch in batches {
        batch.write(&mut sink);
        while let Some(message) = sink.next_message() {
            // The receiver is gone once the run has ended.
            messages.send(message).ok();
        }
    }
    sink
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};
    use std::io::{Read, pipe};
    use std::os::fd::OwnedFd;
    use std::path::Path;

    use super::*;
    use crate::provenance::Provenance;
    use crate::scratch::any_record;
    use crate::session_files::SessionFiles;
    use canopen::frame::{Channel, Frame};
    use node::cause::Cause;
    use node::record::Mode;
    use units::numbering::Joint;

    /// Frames on two full buses in a cycle of 1 ms.
    const FRAMES: u64 = 18;

    const LIMIT: Duration = Duration::from_secs(60);

    fn provenance() -> Provenance {
        Provenance { interfaces: vec!["can0".to_owned()], ..Provenance::default() }
    }

    fn session_onto(file: File, folder: &Path) -> Session {
        Session::new(SessionFiles::onto(file, folder, &provenance()), folder)
    }

    /// Pushes cycles of 1 ms with their frames, and flushes every fifth, as the recorder thread does.
    fn push_cycles(writers: &mut DiskWriters, cycles: std::ops::Range<u64>, record: &Record) {
        for cycle in cycles {
            let begun = 1_000 * cycle;
            for frame in 0..FRAMES {
                let at = Instant::from_micros(begun + 50 * frame);
                let telegram = Telegram { channel: Channel(0), frame: Frame::new(0x80, []) };
                writers.push_frame(at, &telegram);
            }
            writers.push_cycle(&Record { cycle, at: Instant::from_micros(begun), ..*record });
            // As often as the recorder thread polls at 1 kHz.
            if cycle % 10 == 9 {
                writers.flush();
            }
        }
    }

    #[test]
    fn hazard_32_a_stalled_session_disk_leaves_faults_complete() {
        let folder = crate::scratch::path("stalled");
        // A pipe without a reader accepts 64 kB and then blocks its writer, as a stalled disk does.
        let (mut unread, disk) = pipe().unwrap();
        let disk = File::from(OwnedFd::from(disk));
        let session = Some(session_onto(disk, &folder));
        let faults = Some(FaultRecorder::open(&folder, &provenance()).unwrap());
        let lost = LossCounters::default();
        let recorder = RunRecorder { session, faults, message: None };
        let mut writers = DiskWriters::start(recorder, lost.clone()).unwrap();

        let record = any_record();
        let engaged = Record { mode: Mode::Engaged, cause: None, ..record };
        push_cycles(&mut writers, 0..2_000, &engaged);
        let cause = Some(Cause::SamplesMissing { joint: Joint::of::<3>(), cycles: 3 });
        let stopped = Record { mode: Mode::ZeroTorque, cause, ..record };
        push_cycles(&mut writers, 2_000..3_005, &stopped);
        // The record is on its disk while the session's disk is still stalled.
        let message = writers.faults.as_ref().unwrap().messages.recv_timeout(LIMIT).unwrap();
        assert!(message.contains("001-2000-samples-missing"), "{message}");

        let session = std::thread::spawn(move || {
            let mut log = String::new();
            unread.read_to_string(&mut log).unwrap();
            log
        });
        let (records, finished) = finish(writers, LIMIT);
        finished.unwrap();
        assert!(records.unwrap().contains("001-2000-samples-missing"));
        let log = fs::read_to_string(folder.join("001-2000-samples-missing/bus.log")).unwrap();
        let frames = |log: &str| log.lines().filter(|line| line.contains(" can0 ")).count();
        // From 2 s before the last frame of the cycle that tripped to 1 s after its SYNC.
        assert_eq!(frames(&log), 3_000 * usize::try_from(FRAMES).unwrap() - 17);
        assert_eq!(frames(&session.join().unwrap()), 3_005 * usize::try_from(FRAMES).unwrap());
        assert!(lost.snapshot().is_empty(), "{}", lost.snapshot());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_32_hung_disk_drops_entries_and_counts_them() {
        let folder = crate::scratch::path("hangs");
        let (unread, disk) = pipe().unwrap();
        let disk = File::from(OwnedFd::from(disk));
        let session = Some(session_onto(disk, &folder));
        let lost = LossCounters::default();
        let recorder = RunRecorder { session, ..RunRecorder::default() };
        let mut writers = DiskWriters::start(recorder, lost.clone()).unwrap();
        push_cycles(&mut writers, 0..7_000, &any_record());
        let of_session = lost.snapshot().of_session;
        assert!(of_session > 0 && of_session % (5 * (FRAMES + 1)) == 0, "{of_session}");
        // The disk is gone: the thread ends and reports why the recording stopped.
        drop(unread);
        let error = finish(writers, LIMIT).1.unwrap_err().to_string();
        assert!(error.ends_with("hangs: incomplete"), "reported already: {error}");
    }

    #[test]
    fn hazard_32_disk_that_hangs_at_the_end_is_given_up_in_time() {
        let folder = crate::scratch::path("hangs-at-end");
        let (unread, disk) = pipe().unwrap();
        let disk = File::from(OwnedFd::from(disk));
        let session = Some(session_onto(disk, &folder));
        let faults = Some(FaultRecorder::open(&folder, &provenance()).unwrap());
        let recorder = RunRecorder { session, faults, message: None };
        let mut writers = DiskWriters::start(recorder, LossCounters::default()).unwrap();
        push_cycles(&mut writers, 0..2_000, &any_record());
        let (records, finished) = finish(writers, Duration::from_millis(50));
        let error = finished.unwrap_err().to_string();
        assert!(records.is_none() && error.lines().count() == 1, "{error}");
        assert!(error.starts_with("session /"), "{error}");
        assert!(error.contains("hangs-at-end given up: the disk did not respond"), "{error}");
        drop(unread);
        fs::remove_dir_all(&folder).ok();
    }

    /// Closes the recordings within `limit` on the wall clock; the clock of the run is constant.
    fn finish(writers: DiskWriters, limit: Duration) -> (Option<String>, anyhow::Result<()>) {
        writers.finish(&Summary::default(), Instant::ZERO + limit, || Instant::ZERO)
    }
}
