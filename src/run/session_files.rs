//! Streams of a session on disk, in parts: `bus.log` and `inputs.bin`, then `bus-002.log` and `inputs-002.bin`.
//!
//! A part ends by size or time, whichever is first, between two cycles. The log ends after the lines of a cycle, the
//! inputs before their next call. Both may differ by a few cycles, because inputs are recorded earlier or later. Without
//! cycles, as during a boot, a part ends between two frames.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::inputs_file::InputsFile;
use crate::limits::Limits;
use crate::log_file::LogFile;
use crate::provenance::Provenance;
use crate::results;
use bus::log_writer::LogWriter;
use canopen::frame::Telegram;
use inputs::Input;
use inputs::intermediates::Digest;
use node::record::Record;
use telemetry::parts::Stream;
use telemetry::session::{Brief, SessionLog};
use units::time::Instant;

/// Time without a cycle after which the node is considered not to run cycles.
const MAX_CYCLE: Duration = Duration::from_secs(1);

/// Streams being written.
#[derive(Debug)]
pub(super) struct SessionFiles {
    folder: PathBuf,
    provenance: Provenance,
    limits: Limits,
    log: SessionLog<BufWriter<LogFile>>,
    inputs: Option<InputsFile>,
    /// Number of this part.
    part: u32,
    /// Start time of this part.
    begun: Instant,
    /// Size of the earlier parts of the log, in bytes.
    finished: u64,
    last_cycle: Instant,
    end: Option<End>,
}

/// Reason why writing has ended.
#[derive(Debug)]
enum End {
    /// Limit of the recording.
    Limit,
    /// Part that cannot be created.
    Failed(io::Error),
}

impl SessionFiles {
    /// Creates the first part in `folder`.
    ///
    /// # Errors
    /// When a file cannot be created, or exists.
    pub(super) fn create(
        folder: &Path,
        provenance: &Provenance,
        limits: Limits,
    ) -> io::Result<Self> {
        let create = |stream: Stream| results::private_file(&folder.join(stream.part(1)));
        let log = create(Stream::BusLog)?;
        let inputs = InputsFile::onto(create(Stream::Inputs)?)?;
        Ok(Self { inputs: Some(inputs), limits, ..Self::onto(log, folder, provenance) })
    }

    /// Creates streams that write only the log, to `file`, without limits.
    pub(super) fn onto(file: File, folder: &Path, provenance: &Provenance) -> Self {
        Self {
            folder: folder.to_path_buf(),
            log: SessionLog::new(writer(file, provenance)),
            provenance: provenance.clone(),
            limits: Limits::NONE,
            inputs: None,
            part: 1,
            begun: Instant::ZERO,
            finished: 0,
            last_cycle: Instant::ZERO,
            end: None,
        }
    }

    /// Returns the number of parts so far.
    pub(super) const fn parts(&self) -> u32 {
        self.part
    }

    /// Writes a frame.
    pub(super) fn frame(&mut self, at: Instant, telegram: &Telegram) {
        if self.end.is_none() {
            self.log.frame(at, telegram);
            if at.since(self.last_cycle) >= MAX_CYCLE {
                self.end_part_if_due(at);
            }
        }
    }

    /// Writes a cycle.
    pub(super) fn cycle(&mut self, record: &Record) {
        if self.end.is_none() {
            self.log.cycle(&Brief::from(record));
            self.input(&Input::Intermediates(record.cycle, Digest::from_output(&record.output)));
            self.last_cycle = record.at;
            self.end_part_if_due(record.at);
        }
    }

    /// Writes an input.
    pub(super) fn input(&mut self, input: &Input) {
        self.inputs.iter_mut().for_each(|inputs| inputs.write(input));
    }

    /// Returns the reason of an end before the end of the run: the limit, or a failure.
    pub(super) fn ended_early(&self) -> Option<Result<String, &io::Error>> {
        let of_inputs = self.inputs.as_ref().and_then(InputsFile::failure);
        match &self.end {
            Some(End::Failed(error)) => Some(Err(error)),
            Some(End::Limit) => Some(Ok(self.limits.reason())),
            None => self.log.failure().or(of_inputs).map(Err),
        }
    }

    /// Closes the files.
    ///
    /// # Errors
    /// Returns the error of the write that has ended a stream.
    pub(super) fn finish(self) -> io::Result<()> {
        let inputs = self.inputs.map_or(Ok(()), InputsFile::finish);
        let log = self.log.finish();
        match self.end {
            Some(End::Failed(error)) => Err(error),
            Some(End::Limit) | None => log.and(inputs),
        }
    }

    fn end_part_if_due(&mut self, now: Instant) {
        let is_turning = self.inputs.as_ref().is_some_and(InputsFile::is_turning);
        if is_turning || self.end.is_some() {
            return;
        }
        let inputs = self.inputs.as_ref().map_or(0, InputsFile::written);
        if self.finished + self.log.written() + inputs >= self.limits.total_bytes {
            self.log.flush();
            self.end_at(End::Limit);
            return;
        }
        let is_due = self.log.written() >= self.limits.part_bytes
            || now.since(self.begun) >= self.limits.part_time;
        let has_failed = self.ended_early().is_some();
        // A stream that has failed has no further part: that would be a gap.
        if is_due
            && !has_failed
            && let Err(error) = self.begin_part(now)
        {
            self.end_at(End::Failed(error));
        }
    }

    fn end_at(&mut self, end: End) {
        self.inputs.iter_mut().for_each(InputsFile::end);
        self.end = Some(end);
    }

    fn begin_part(&mut self, now: Instant) -> io::Result<()> {
        let number = self.part + 1;
        let create = |stream: Stream| {
            let path = self.folder.join(stream.part(number));
            let named = |error: io::Error| {
                io::Error::new(error.kind(), format!("{}: {error}", stream.part(number)))
            };
            results::private_file(&path).map_err(named)
        };
        // In this order: `telemetry::parts` knows what is left by a kill in between.
        let (inputs, log) = (create(Stream::Inputs)?, create(Stream::BusLog)?);
        results::sync_folder(&self.folder.join(Stream::BusLog.part(number)))?;
        self.finished += self.log.written();
        self.log.begin_part(writer(log, &self.provenance));
        self.inputs.iter_mut().take(1).zip([inputs]).for_each(|(it, file)| {
            it.begin_part(number, file);
        });
        (self.part, self.begun) = (number, now);
        Ok(())
    }
}

fn writer(file: File, provenance: &Provenance) -> LogWriter<BufWriter<LogFile>> {
    let Provenance { interfaces, origin, .. } = provenance;
    LogWriter::new(BufWriter::new(LogFile::onto(file)), interfaces, origin.as_micros())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::scratch::{any_record, path as scratch};
    use canopen::frame::{Channel, Frame};
    use inputs::Call;

    /// Bytes of the header of a part of the inputs, and the tag of a cycle.
    const HEADER: usize = 20;
    const CYCLE: u8 = 0x09;

    fn provenance() -> Provenance {
        Provenance { interfaces: vec!["can0".to_owned()], ..Provenance::default() }
    }

    fn create(name: &str, limits: Limits) -> (PathBuf, SessionFiles) {
        let folder = scratch(name);
        results::private_folder(&folder).unwrap();
        let files = SessionFiles::create(&folder, &provenance(), limits).unwrap();
        (folder, files)
    }

    /// Writes cycles of 1 ms, each record in the midst of the inputs of the next cycle, as the recorder thread may.
    fn write(files: &mut SessionFiles, cycles: std::ops::RangeInclusive<u64>) {
        let record = any_record();
        for cycle in cycles {
            let at = Instant::from_micros(1_000 * cycle);
            files.input(&Input::Call(Call::Cycle));
            files.input(&Input::Now(at));
            let frame = Frame::from_slice(0x181, &cycle.to_le_bytes()).unwrap();
            files.frame(at, &Telegram { channel: Channel(0), frame });
            files.cycle(&Record { cycle, at, ..record });
            files.input(&Input::Returned(7));
        }
    }

    fn parts(folder: &Path, stream: Stream) -> Vec<Vec<u8>> {
        let parts = (1..).map(|number| fs::read(folder.join(stream.part(number))));
        parts.map_while(Result::ok).collect()
    }

    #[test]
    fn parts_end_between_cycles_and_are_one_recording() {
        let (whole, mut files) = create("one-part", Limits::NONE);
        write(&mut files, 1..=500);
        files.finish().unwrap();
        let limits = Limits { part_bytes: 20_000, ..Limits::NONE };
        let (folder, mut files) = create("parts", limits);
        write(&mut files, 1..=500);
        let count = files.parts();
        files.finish().unwrap();

        let log = parts(&folder, Stream::BusLog);
        assert!(count >= 5 && log.len() == usize::try_from(count).unwrap(), "{count}");
        for part in &log {
            let text = std::str::from_utf8(part).unwrap();
            assert!(text.ends_with('\n') && text.lines().last().unwrap().contains(" node0 "));
        }
        assert!(log.concat() == fs::read(whole.join("bus.log")).unwrap());

        let inputs = parts(&folder, Stream::Inputs);
        assert_eq!(inputs.len(), log.len());
        let mut entries = 0;
        for (part, number) in inputs.iter().zip(1_u32..) {
            assert_eq!(part[..8], *b"frhcin\x02\0");
            assert_eq!(part[8..12], number.to_le_bytes());
            let before = u64::from_le_bytes(part[12..HEADER].try_into().unwrap());
            assert!(before >= entries && (number == 1) == (before == 0), "{before}");
            entries = before;
            assert_eq!(part[HEADER], CYCLE, "between two cycles");
        }
        // Four entries a cycle.
        assert!((1_600..2_000).contains(&entries), "{entries}");
        fs::remove_dir_all(&whole).unwrap();
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn part_ends_by_time_also_where_no_cycle_runs() {
        let limits = Limits { part_time: Duration::from_secs(2), ..Limits::NONE };
        let (folder, mut files) = create("part-time", limits);
        write(&mut files, 1..=4_500);
        assert_eq!(files.parts(), 3);
        let telegram = Telegram { channel: Channel(0), frame: Frame::new(0x700, [5]) };
        for tenths in 46..100 {
            files.frame(Instant::from_micros(100_000 * tenths), &telegram);
        }
        assert_eq!(files.parts(), 5);
        files.finish().unwrap();
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn limit_ends_the_recording_behind_a_cycle() {
        let limits = Limits { part_bytes: 20_000, total_bytes: 70_000, ..Limits::NONE };
        let (folder, mut files) = create("limit", limits);
        write(&mut files, 1..=2_000);
        assert!(files.ended_early().unwrap().unwrap().contains("its limit of 0.00007 GB"));
        files.finish().unwrap();
        let (log, inputs) = (parts(&folder, Stream::BusLog), parts(&folder, Stream::Inputs));
        let size: usize = log.iter().chain(&inputs).map(Vec::len).sum();
        assert!((70_000..71_000).contains(&size), "{size}");
        let text = String::from_utf8(log.concat()).unwrap();
        assert!(text.lines().last().unwrap().contains(" node0 "));
        // The last call has returned.
        assert_eq!(inputs.concat().last_chunk(), Some(&[0x10, 7, 0, 0, 0]));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_32_part_that_cannot_begin_ends_the_recording() {
        let limits = Limits { part_bytes: 20_000, ..Limits::NONE };
        let (folder, mut files) = create("part-taken", limits);
        fs::write(folder.join("bus-003.log"), "mine").unwrap();
        write(&mut files, 1..=1_000);
        assert_eq!(files.parts(), 2);
        let reason = files.ended_early().unwrap().unwrap_err().to_string();
        assert!(reason.starts_with("bus-003.log: File exists"), "{reason}");
        assert!(files.finish().is_err());
        assert_eq!(fs::read(folder.join("bus-003.log")).unwrap(), b"mine");
        let log = parts(&folder, Stream::BusLog);
        assert!(log[1].ends_with(b"\n"));
        fs::remove_dir_all(&folder).unwrap();
    }
}
