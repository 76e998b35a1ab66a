//! Rows of `frhc sessions list`.

use std::io::{self, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use crate::sessions::documents::{document, summary};
use crate::sessions::pack::megabytes;
use crate::sources::DESCRIPTION;
use config::files;
use telemetry::origin::Origin;
use telemetry::parts::{Parts, Stream};
use telemetry::recording_lock::RecordingLock;

/// Number of bytes at the end of a log that are searched for its last line.
const TAIL: u64 = 4_096;

/// Recorded session in a folder.
#[derive(Debug, Serialize)]
pub(super) struct Session {
    /// Name of the folder.
    name: String,
    /// Command that has recorded the session.
    kind: String,
    /// Time zero; that of a demo is zero.
    begun: Origin,
    /// Time from the first to the last cycle, in s. Without a summary, from time zero to the last frame, unless that is
    /// packed.
    seconds: Option<f64>,
    /// Size of all parts, in bytes.
    bytes: u64,
    parts: u32,
    /// Number of files of these parts, and of packed files among them.
    files: usize,
    packed: usize,
    /// Mode in which the run ended, with its cause; `None` without a summary.
    ended: Option<String>,
    /// Set while a process records the session; `None` without a summary, if the file cannot be locked.
    is_recording: Option<bool>,
    /// Reason of an end of the recording before the end of the run.
    ended_early: Option<String>,
    /// Names of missing files.
    missing: Vec<String>,
}

impl Session {
    /// Reads a session from its documents and the names of its files.
    ///
    /// # Errors
    /// When a document cannot be read.
    pub(super) fn read(folder: &Path) -> io::Result<Self> {
        let description = document(folder, DESCRIPTION)?.ok_or(ErrorKind::NotFound)?;
        let (summary, stated) = summary(folder)?;
        let parts = Parts::find(folder, stated)?;
        let text = |of: &Value, at: &str| of.pointer(at).and_then(Value::as_str).map(str::to_owned);
        let origin = description.get("origin_us").and_then(Value::as_u64).unwrap_or(0);
        let stated_seconds = summary.as_ref().and_then(|it| it.get("seconds")?.as_f64());
        let ended = summary.as_ref().and_then(|summary| {
            let (mode, cause) = (text(summary, "/final_mode")?, text(summary, "/stopped_by"));
            let is_interrupted = summary.get("is_interrupted").and_then(Value::as_bool);
            let cause = cause.map_or_else(String::new, |cause| format!(": {cause}"));
            let interrupted = if is_interrupted == Some(true) { " (interrupted)" } else { "" };
            Some(format!("{mode}{cause}{interrupted}"))
        });
        let is_recording = match &summary {
            Some(_) => Some(false),
            None => RecordingLock::is_held(&folder.join(DESCRIPTION)),
        };
        let files = parts.files();
        Ok(Self {
            name: name(folder),
            kind: text(&description, "/kind").unwrap_or_default(),
            begun: Origin::from_micros(origin),
            seconds: stated_seconds.or_else(|| seconds(folder, &parts, origin)),
            bytes: files.iter().map(|part| part.size).sum(),
            parts: parts.count(),
            files: files.len(),
            packed: files.iter().filter(|part| part.is_packed).count(),
            ended,
            is_recording,
            ended_early: summary.as_ref().and_then(|it| text(it, "/recording/ended_early")),
            missing: parts.missing(),
        })
    }

    /// Returns the end of the session in words.
    fn end(&self) -> String {
        let mut end = match (&self.ended, self.is_recording) {
            (Some(ended), _) => ended.clone(),
            (None, Some(true)) => "still recording".to_owned(),
            (None, Some(false)) => "no summary: killed while recording".to_owned(),
            (None, None) => "no summary: still recording, or killed".to_owned(),
        };
        if let Some(reason) = &self.ended_early {
            end += &format!("; recording ended early: {reason}");
        }
        if !self.missing.is_empty() {
            end += &format!("; missing: {}", self.missing.join(", "));
        }
        end
    }
}

/// Folder whose session cannot be read.
#[derive(Debug, Serialize)]
pub(super) struct Unreadable {
    /// Name of the folder.
    name: String,
    /// File and reason.
    unreadable: String,
}

/// Row of the list.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub(super) enum Row {
    /// Session with its figures.
    Session(Session),
    /// Folder without them.
    Unreadable(Unreadable),
}

impl Row {
    /// Reads the session of a folder.
    pub(super) fn read(folder: &Path) -> Self {
        match Session::read(folder) {
            Ok(session) => Self::Session(session),
            Err(error) => {
                Self::Unreadable(Unreadable { name: name(folder), unreadable: error.to_string() })
            }
        }
    }

    /// Returns whether the session cannot be read.
    pub(super) const fn is_unreadable(&self) -> bool {
        matches!(self, Self::Unreadable(_))
    }

    fn name(&self) -> &str {
        match self {
            Self::Session(session) => &session.name,
            Self::Unreadable(folder) => &folder.name,
        }
    }
}

/// Returns the name of a folder.
fn name(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns the table of sessions, with a head.
pub(super) fn table(sessions: &[Row]) -> Vec<String> {
    let width = sessions.iter().map(|session| session.name().len()).max().unwrap_or(0).max(7);
    let row = |name: &str, cells: [&str; 5], end: &str| {
        let [begun, seconds, size, parts, packed] = cells;
        format!(
            "{name:width$}  {begun:20}  {seconds:>10}  {size:>12}  {parts:>5}  {packed:>6}  {end}"
        )
    };
    let head = row("session", ["begun (UTC)", "duration", "size", "parts", "packed"], "ended");
    let rows = sessions.iter().map(|session| {
        let session = match session {
            Row::Session(session) => session,
            Row::Unreadable(Unreadable { name, unreadable }) => {
                return row(name, ["?"; 5], &format!("unreadable: {unreadable}"));
            }
        };
        let begun = session.begun.to_string();
        let begun = match session.begun == Origin::default() {
            true => session.kind.as_str(),
            false => begun.get(..19).unwrap_or(&begun),
        };
        let seconds = session.seconds.map_or_else(|| "?".to_owned(), |it| format!("{it:.1} s"));
        let packed = match (session.packed, session.files) {
            (0, _) => "no".to_owned(),
            (packed, files) if packed == files => "yes".to_owned(),
            (packed, files) => format!("{packed}/{files}"),
        };
        let (size, parts) = (megabytes(session.bytes), session.parts.to_string());
        row(&session.name, [begun, &seconds, &size, &parts, &packed], &session.end())
    });
    std::iter::once(head).chain(rows).collect()
}

/// Returns the time from time zero to the last frame, if its part is plain.
fn seconds(folder: &Path, parts: &Parts, origin_us: u64) -> Option<f64> {
    let last = parts.stream(Stream::BusLog).last()?.ok()?;
    let mut file = files::open_unlinked(&folder.join(last.name())).ok()?;
    file.seek(SeekFrom::Start(last.size.saturating_sub(TAIL))).ok()?;
    let mut tail = String::new();
    file.take(TAIL).read_to_string(&mut tail).ok()?;
    let stamp = tail.rsplit('\n').find_map(|line| line.strip_prefix('(')?.split_once(')'));
    let (seconds, micros) = stamp?.0.split_once('.')?;
    let micros = seconds.parse::<u64>().ok()? * 1_000_000 + micros.parse::<u64>().ok()?;
    Some(std::time::Duration::from_micros(micros.checked_sub(origin_us)?).as_secs_f64())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::scratch::path as scratch;

    #[test]
    fn rows_say_how_sessions_have_ended() {
        let folder = scratch("list");
        fs::create_dir(&folder).unwrap();
        let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
        write("session.json", "{\"kind\": \"run\", \"origin_us\": 1795331563123456}");
        write("bus.log", "(1795331563.123463) can0 080#\n");
        write("inputs.bin", "frhcin");
        write("bus-002.log", "(1795331564.000000) can0 080#\n(1795331573.623456) can0 080#\n");
        let last_row = || table(&[Row::read(&folder)]).pop().unwrap();
        let row = last_row();
        for cell in [
            "2026-11-22T07:12:43 ",
            " 10.5 s ",
            " 2 ",
            " no ",
            "no summary: killed while recording",
            "missing: inputs-002.bin",
        ] {
            assert!(row.contains(cell), "{cell:?} in {row}");
        }
        let lock = RecordingLock::take(&folder.join("session.json"));
        assert!(lock.is_some() && last_row().contains("  still recording; missing: "));
        drop(lock);
        fs::rename(folder.join("bus.log"), folder.join("bus.log.gz")).unwrap();
        write(
            "summary.json",
            "{\"seconds\": 7.25, \"final_mode\": \"zero-torque\", \"stopped_by\": \"joint 3\", \
             \"recording\": {\"parts\": 3, \"ended_early\": \"its limit\"}}",
        );
        let row = last_row();
        for cell in [
            " 7.2 s ",
            " 3 ",
            " 1/3 ",
            "zero-torque: joint 3; recording ended early: its limit; missing:",
            "bus-003.log",
        ] {
            assert!(row.contains(cell), "{cell:?} in {row}");
        }
        write("session.json", "{");
        let row = last_row();
        assert!(row.contains("  unreadable: session.json: EOF while parsing"), "{row}");
        fs::remove_dir_all(&folder).unwrap();
    }
}
