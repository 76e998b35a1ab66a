//! Fault records: one folder `NNN-CYCLE-CAUSE/` per trip, with `bus.log` in the session's format and `fault.json`.
//!
//! They are readable by their owner only, and the newest 50 are kept. A record that cannot be written is reported once,
//! and the run continues.

use std::fs;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::log_file::LogFile;
use crate::provenance::Provenance;
use crate::record_sink::RecordSink;
use crate::results::{self, Access, number};
use crate::state;
use bus::log_writer::LogWriter;
use canopen::frame::Telegram;
use node::record::Record;
use node::safety::table;
use telemetry::losses::Losses;
use telemetry::session::{Brief, SessionLog};
use telemetry::status::{Status, joints};
use telemetry::trip::{Observation, Trip, TripDetector};
use units::numbering::Joint;
use units::time::Instant;

/// Maximum number of records in the folder; a new one removes the oldest.
const MAX_RECORDS: usize = 50;

/// Files of a record.
const LOG: &str = "bus.log";
const DOCUMENT: &str = "fault.json";

/// Returns the folder of records when no session is recorded: `faults` in the state folder.
pub(super) fn default_folder() -> Option<PathBuf> {
    state::folder().map(|folder| folder.join("faults"))
}

/// Detects trips and writes their records.
#[derive(Debug)]
pub(super) struct FaultRecorder {
    folder: PathBuf,
    provenance: Provenance,
    trips: TripDetector,
    open: Option<Open>,
    has_failed: bool,
    /// Records that this run has written.
    written: Vec<PathBuf>,
    message: Option<String>,
}

/// Record of the last trip, still being written.
#[derive(Debug)]
struct Open {
    folder: PathBuf,
    log: SessionLog<BufWriter<LogFile>>,
    document: Value,
    tripped: Instant,
    latest: Instant,
    /// Joints whose drives did not confirm that they are off.
    not_off: [bool; 6],
}

impl FaultRecorder {
    /// Opens or creates `folder`, so that missing permissions are reported at the start.
    ///
    /// # Errors
    /// When the folder cannot be created or read.
    pub(super) fn open(folder: &Path, provenance: &Provenance) -> io::Result<Self> {
        results::private_folder(folder)?;
        fs::read_dir(folder)?;
        Ok(Self {
            folder: folder.to_path_buf(),
            provenance: provenance.clone(),
            trips: TripDetector::default(),
            open: None,
            has_failed: false,
            written: Vec::new(),
            message: None,
        })
    }

    /// Returns the folder in which each record has a folder.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Closes the open record; returns a line that names the records of this run, if any.
    pub(super) fn finish(mut self) -> Option<String> {
        self.close();
        // Removes the folder only if it is empty. Another run creates it again for its next record.
        fs::remove_dir(&self.folder).ok();
        match self.written.as_slice() {
            [] => None,
            [one] => Some(format!("fault record      {}", one.display())),
            [first, .., last] => {
                let (count, last) = (self.written.len(), last.file_name().unwrap_or_default());
                Some(format!("{count} fault records   {} to {}", first.display(), last.display()))
            }
        }
    }

    fn begin(&mut self, trip: &Trip, record: &Record) {
        match self.create(trip, record) {
            Ok(open) => {
                self.message = Some(format!("fault record: {}", open.folder.display()));
                self.written.push(open.folder.clone());
                self.open = Some(open);
            }
            Err(error) if !self.has_failed => {
                self.has_failed = true;
                self.message =
                    Some(format!("no fault record in {}: {error}", self.folder.display()));
            }
            Err(_) => {}
        }
    }

    fn create(&mut self, trip: &Trip, record: &Record) -> io::Result<Open> {
        self.make_room();
        let cause = hyphenated(&format!("{:?}", trip.cause.kind()));
        let name = |number| format!("{number:03}-{}-{cause}", trip.cycle);
        let folder = results::create_numbered(&self.folder, name)?;
        let seconds_before = self.trips.reach().as_secs_f64();
        let document = document(trip, record, &self.provenance, seconds_before);
        write_document(&folder, &document)?;
        let file = LogFile::onto(results::private_file(&folder.join(LOG))?);
        let Provenance { interfaces, origin, .. } = &self.provenance;
        let writer = LogWriter::new(BufWriter::new(file), interfaces, origin.as_micros());
        let mut log = SessionLog::new(writer);
        for moment in self.trips.past() {
            match moment {
                Observation::Frame(at, telegram) => log.frame(at, telegram),
                Observation::Cycle(brief) => log.cycle(brief),
            }
        }
        let (at, not_off) = (trip.at, record.not_off);
        Ok(Open { folder, log, document, tripped: at, latest: at, not_off })
    }

    /// Removes the oldest records, also those of other runs. Keeps files of other origin in them.
    fn make_room(&self) {
        let Ok(entries) = fs::read_dir(&self.folder) else { return };
        let entries = entries.flatten();
        let mut records: Vec<_> =
            entries.filter_map(|it| Some((number(&it.file_name())?, it.path()))).collect();
        records.sort_unstable();
        let surplus = (records.len() + 1).saturating_sub(MAX_RECORDS);
        records.iter().take(surplus).for_each(|(_, oldest)| discard(oldest));
    }

    fn close_if_over(&mut self, now: Instant) {
        if self.trips.is_over(now) {
            self.close();
        }
    }

    fn close(&mut self) {
        let Some(Open { folder, log, mut document, tripped, latest, not_off }) = self.open.take()
        else {
            return;
        };
        let ended = log.finish();
        if let Some(members) = document.as_object_mut() {
            members.insert("seconds_after".to_owned(), latest.since(tripped).as_secs_f64().into());
            members.insert("not_off".to_owned(), joints(&not_off).into());
            members.insert("is_complete".to_owned(), ended.is_ok().into());
        }
        let written = write_document(&folder, &document);
        if let Err(error) = ended.and(written) {
            let folder = folder.display();
            self.message = Some(format!("fault record {folder}: incomplete: {error}"));
        }
    }
}

impl RecordSink for FaultRecorder {
    fn on_frame(&mut self, at: Instant, telegram: &Telegram) {
        self.close_if_over(at);
        self.trips.frame(at, telegram);
        if let Some(open) = &mut self.open {
            open.latest = open.latest.max(at);
            open.log.frame(at, telegram);
        }
    }

    fn on_cycle(&mut self, record: &Record) {
        self.close_if_over(record.at);
        let brief = Brief::from(record);
        if let Some(trip) = self.trips.cycle(&brief) {
            self.begin(&trip, record);
        } else if let Some(open) = &mut self.open {
            open.latest = open.latest.max(record.at);
            open.log.cycle(&brief);
            open.not_off.iter_mut().zip(record.not_off).for_each(|(known, now)| *known |= now);
        }
    }

    fn next_message(&mut self) -> Option<String> {
        self.message.take()
    }
}

/// Returns `fault.json` as written at the trip, with `is_complete: false`. A run that ends within the second leaves it
/// unchanged.
fn document(trip: &Trip, record: &Record, provenance: &Provenance, seconds_before: f64) -> Value {
    let kind = trip.cause.kind();
    let row = kind.row();
    let reaction = table::reaction(kind, trip.from).mode();
    let joint = trip.cause.joint();
    let names = provenance.joint_names();
    let name = joint.and_then(|joint| names.get(joint.index()));
    json!({
        "cause": trip.cause.to_string(),
        "kind": hyphenated(&format!("{kind:?}")),
        "joint": joint.map(Joint::number),
        "joint_name": name,
        // Relative to this record, which lies in `faults` of its session.
        "session": provenance.session.as_ref().map(|_| "../.."),
        "session_name": provenance.session,
        "cycle": trip.cycle,
        "seconds": trip.at.since(Instant::ZERO).as_secs_f64(),
        "origin": provenance.origin,
        "mode_before": trip.from.name(),
        "mode": trip.to.name(),
        "reaction": reaction.map_or("none", |mode| mode.name()),
        "reset_boots": row.reset_boots,
        "hazards": row.hazards,
        "seconds_before": seconds_before,
        "seconds_after": 0.0,
        "not_off": joints(&record.not_off),
        "is_complete": false,
        "joints": names,
        "status": Status::from_record(record, 0, Losses::default()).with_joints(&provenance.joints),
    })
}

fn write_document(folder: &Path, document: &Value) -> io::Result<()> {
    let mut text = serde_json::to_string_pretty(document)?;
    text.push('\n');
    results::replace(&folder.join(DOCUMENT), text.as_bytes(), Access::Owner)
}

/// Removes every record in `folder`, and the folder if nothing else is in it.
pub(super) fn clear(folder: &Path) -> io::Result<()> {
    results::clear_numbered(folder, discard)
}

/// Removes the files of a record, and its folder if nothing else is in it.
fn discard(record: &Path) {
    for file in [LOG, DOCUMENT] {
        fs::remove_file(record.join(file)).ok();
    }
    fs::remove_dir(record).ok();
}

/// Converts `SamplesMissing` to `samples-missing`.
fn hyphenated(name: &str) -> String {
    let mut hyphenated = String::new();
    for letter in name.chars() {
        if letter.is_ascii_uppercase() && !hyphenated.is_empty() {
            hyphenated.push('-');
        }
        hyphenated.push(letter.to_ascii_lowercase());
    }
    hyphenated
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;
    use std::os::unix::fs::PermissionsExt;

    use super::*;
    use crate::scratch::any_record;
    use crate::scratch::path as scratch;
    use config::Config;
    use node::cause::Cause;
    use node::record::Mode;
    use telemetry::origin::Origin;

    const TRIP: Trip = Trip {
        cycle: 4_213,
        at: Instant::from_micros(4_300_000),
        cause: Cause::SamplesMissing { joint: Joint::of::<3>(), cycles: 3 },
        from: Mode::Engaged,
        to: Mode::ZeroTorque,
    };

    fn provenance() -> Provenance {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let origin = Origin::from_micros(1_795_331_563_123_456);
        Provenance::new(&config, &["can0".to_owned()], origin)
    }

    fn mode_of(path: &Path) -> u32 {
        fs::metadata(path).unwrap().permissions().mode() & 0o777
    }

    #[test]
    fn promise_15_record_has_cause_and_modes_for_its_owner_only() {
        let folder = scratch("record");
        let mut faults = FaultRecorder::open(&folder, &provenance()).unwrap();
        faults.begin(&TRIP, &any_record());
        let record = folder.join("001-4213-samples-missing");
        assert_eq!(faults.next_message(), Some(format!("fault record: {}", record.display())));
        let document: Value =
            serde_json::from_slice(&fs::read(record.join(DOCUMENT)).unwrap()).unwrap();
        assert_eq!(document["cause"], "joint 3: no sample for 3 cycles");
        assert_eq!((&document["joint"], &document["cycle"]), (&json!(3), &json!(4_213)));
        assert_eq!((&document["joint_name"], &document["seconds"]), (&json!("elbow"), &json!(4.3)));
        assert_eq!(document["origin"]["utc"], "2026-11-22T07:12:43.123456Z");
        assert_eq!(document["joints"][2], "elbow");
        assert_eq!(
            (&document["mode_before"], &document["mode"]),
            (&json!("engaged"), &json!("zero-torque"))
        );
        assert_eq!(
            (&document["reaction"], &document["hazards"]),
            (&json!("zero-torque"), &json!([1, 3, 4]))
        );
        let budget = document["status"]["budget"].as_object().unwrap();
        let torques = "task gravity centring damping passivity soft_stops friction hold";
        let rest = "assist_scale rest_scale limiting_joint slewing_joint";
        assert_eq!(
            budget.keys().map(String::as_str).collect::<Vec<_>>().join(" "),
            format!("{torques} {rest}")
        );
        assert_eq!(budget["task"].as_array().unwrap().len(), 6);
        assert_eq!(document["is_complete"], false, "until one second after the trip");
        assert_eq!((mode_of(&folder), mode_of(&record)), (0o700, 0o700));
        assert_eq!((mode_of(&record.join(LOG)), mode_of(&record.join(DOCUMENT))), (0o600, 0o600));
        assert!(faults.finish().unwrap().contains("001-4213-samples-missing"));
        let document: Value =
            serde_json::from_slice(&fs::read(record.join(DOCUMENT)).unwrap()).unwrap();
        assert_eq!(document["is_complete"], true);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_32_newest_fifty_records_and_foreign_files_are_kept() {
        let (folder, record) = (scratch("quota"), any_record());
        for run in 0..6 {
            let mut faults = FaultRecorder::open(&folder, &provenance()).unwrap();
            for _ in 0..10 {
                faults.begin(&TRIP, &record);
                faults.close();
            }
            if run == 0 {
                fs::write(folder.join("002-4213-samples-missing/notes"), "why?").unwrap();
            }
            assert!(faults.finish().unwrap().starts_with("10 fault records"));
        }
        let left = fs::read_dir(&folder).unwrap().flatten();
        let mut left: Vec<_> = left.filter_map(|entry| number(&entry.file_name())).collect();
        left.sort_unstable();
        let kept: Vec<u64> = std::iter::once(2).chain(11..=60).collect();
        assert_eq!(left, kept);
        assert!(folder.join("002-4213-samples-missing/notes").exists());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_32_record_survives_the_end_of_another_run() {
        let (folder, record) = (scratch("two-runs"), any_record());
        let open = || FaultRecorder::open(&folder, &provenance()).unwrap();
        let (mut faults, mut others) = (open(), open());
        // Without a record its folder is empty, and removed.
        assert_eq!(open().finish(), None);
        assert!(!folder.exists());
        faults.begin(&TRIP, &record);
        assert!(faults.next_message().unwrap().starts_with("fault record: "));
        // The same cycle and cause: names differ by their number.
        others.begin(&TRIP, &record);
        assert!(others.next_message().unwrap().ends_with("002-4213-samples-missing"));
        assert!(faults.finish().unwrap().ends_with("001-4213-samples-missing"));
        assert!(others.finish().is_some());
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 2);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn hazard_32_unwritable_fault_folder_is_reported_once() {
        let (folder, record) = (scratch("gone"), any_record());
        let mut faults = FaultRecorder::open(&folder, &provenance()).unwrap();
        fs::remove_dir(&folder).unwrap();
        fs::write(&folder, "").unwrap();
        faults.begin(&TRIP, &record);
        assert!(faults.next_message().unwrap().starts_with("no fault record in "));
        faults.begin(&TRIP, &record);
        assert_eq!((faults.next_message(), faults.finish()), (None, None));
        assert!(FaultRecorder::open(&folder.join("faults"), &provenance()).is_err());
        fs::remove_file(&folder).unwrap();
    }

    #[test]
    fn record_names_begin_with_a_number_and_are_hyphenated() {
        assert_eq!(hyphenated("SamplesMissing"), "samples-missing");
        assert_eq!(number(OsStr::new("042-7-late")), Some(42));
        assert_eq!(number(OsStr::new("notes")), None);
        assert_eq!(number(OsStr::new("-7-late")), None);
    }
}
