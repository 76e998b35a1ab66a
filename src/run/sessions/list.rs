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
        let files = parts.files();
        Ok(Self {
            name: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            kind: text(&description, "/kind").unwrap_or_default(),
            begun: Origin::from_micros(origin),
            seconds: stated_seconds.or_else(|| seconds(folder, &parts, origin)),
            bytes: files.iter().map(|part| part.size).sum(),
            parts: parts.count(),
            files: files.len(),
            packed: files.iter().filter(|part| part.is_packed).count(),
            ended,
            ended_early: summary.as_ref().and_then(|it| text(it, "/recording/ended_early")),
            missing: parts.missing(),
        })
    }

    /// Returns the end of the session in words.
    fn end(&self) -> String {
        let ended = self.ended.as_deref();
        let mut end = ended.unwrap_or("no summary: it is still recorded, or was killed").to_owned();
        if let Some(reason) = &self.ended_early {
            end += &format!("; recording ended early: {reason}");
        }
        if !self.missing.is_empty() {
            end += &format!("; missing: {}", self.missing.join(", "));
        }
        end
    }
}

/// Returns the table of sessions, with a head.
pub(super) fn table(sessions: &[Session]) -> Vec<String> {
    let width = sessions.iter().map(|session| session.name.len()).max().unwrap_or(0).max(7);
    let row = |name: &str, cells: [&str; 5], end: &str| {
        let [begun, seconds, size, parts, packed] = cells;
        format!(
            "{name:width$}  {begun:20}  {seconds:>10}  {size:>12}  {parts:>5}  {packed:>6}  {end}"
        )
    };
    let head = row("session", ["begun (UTC)", "duration", "size", "parts", "packed"], "ended");
    let rows = sessions.iter().map(|session| {
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
        let killed = Session::read(&folder).unwrap();
        let row = table(&[killed]).pop().unwrap();
        for cell in [
            "2026-11-22T07:12:43 ",
            " 10.5 s ",
            " 2 ",
            " no ",
            "no summary",
            "missing: inputs-002.bin",
        ] {
            assert!(row.contains(cell), "{cell:?} in {row}");
        }
        fs::rename(folder.join("bus.log"), folder.join("bus.log.gz")).unwrap();
        write(
            "summary.json",
            "{\"seconds\": 7.25, \"final_mode\": \"zero-torque\", \"stopped_by\": \"joint 3\", \
             \"recording\": {\"parts\": 3, \"ended_early\": \"its limit\"}}",
        );
        let row = table(&[Session::read(&folder).unwrap()]).pop().unwrap();
        for cell in [
            " 7.2 s ",
            " 3 ",
            " 1/3 ",
            "zero-torque: joint 3; recording ended early: its limit; missing:",
            "bus-003.log",
        ] {
            assert!(row.contains(cell), "{cell:?} in {row}");
        }
        fs::remove_dir_all(&folder).unwrap();
    }
}
