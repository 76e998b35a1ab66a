//! Input of `decode`: lines of a log or pipe, of any bytes, and of at most 1 MiB.

use std::io::{self, BufRead, BufReader, ErrorKind, Read};
use std::path::Path;

use config::files;
use replay::{BoundedLines, PartFile, Session};
use run::exit::{Failure, Kind, OrFail};
use run::print;

/// Size of the read buffer, in bytes.
pub(super) const BUFFER: usize = 1 << 16;

/// Maximum length kept of a line, in bytes; the longest candump lines have about 250.
const MAX_LINE: usize = 1 << 12;

/// Opens the file, or stdin for `None` and `-`; returns it with its name for messages.
pub(super) fn open(path: Option<&Path>) -> Result<(Box<dyn Read>, String), Failure> {
    let Some(path) = path.filter(|path| path.as_os_str() != "-") else {
        return Ok((Box::new(BoundedLines::new(io::stdin().lock())), "stdin".to_owned()));
    };
    let name = path.display().to_string();
    match files::open(path).and_then(PartFile::from_file) {
        Ok(file) => Ok((Box::new(BoundedLines::new(file)), name)),
        Err(error) => {
            let is_piped = error.kind() == ErrorKind::InvalidInput;
            let remedy = if is_piped { "; send it to standard input" } else { "" };
            Err(Failure::new(Kind::File, format!("{name}: {error}{remedy}")))
        }
    }
}

/// Opens all parts of the log of a session, and names the missing ones.
pub(super) fn of_session(session: &Session) -> Result<(Box<dyn Read>, String), Failure> {
    let log = session.bus_log().or_fail(Kind::File)?;
    session.remarks().iter().for_each(|remark| print::note(remark));
    Ok((Box::new(log), session.folder().display().to_string()))
}

/// Reads the next line without its line end; returns false after the last. Truncates an overlong line.
pub(super) fn read_line<R: Read>(input: &mut BufReader<R>, line: &mut Vec<u8>) -> io::Result<bool> {
    line.clear();
    let mut has_read = false;
    loop {
        let available = match input.fill_buf() {
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            available => available?,
        };
        let end = available.iter().position(|byte| *byte == b'\n');
        let (part, used) = match end {
            Some(end) => (available.get(..end).unwrap_or_default(), end + 1),
            None => (available, available.len()),
        };
        has_read |= used > 0;
        let room = MAX_LINE.saturating_sub(line.len());
        line.extend_from_slice(part.get(..room).unwrap_or(part));
        input.consume(used);
        if end.is_some() || used == 0 {
            break;
        }
    }
    if line.last() == Some(&b'\r') {
        line.pop();
    }
    Ok(has_read)
}
