//! All parts of `bus.log`, read as one log.

use std::collections::VecDeque;
use std::io::{self, BufRead, Read};
use std::path::{Path, PathBuf};

use crate::bounded_lines::BoundedLines;
use crate::part_file::PartFile;

/// Frames and cycles of a session: the parts that are there, in their order, plain or packed. Each begins with a new line.
/// Lines above [`MAX_LINE`](crate::MAX_LINE) are an error. Errors name the file.
#[derive(Debug)]
pub struct BusLog {
    /// Parts that are still to be read.
    rest: VecDeque<PathBuf>,
    current: Option<(PathBuf, BoundedLines<PartFile>)>,
    /// Set if the last byte that was read ends a line.
    is_at_line_start: bool,
}

impl BusLog {
    /// Opens the first of these files.
    ///
    /// # Errors
    /// Returns an error without a file, or if the first cannot be read.
    pub fn open(parts: impl IntoIterator<Item = PathBuf>) -> io::Result<Self> {
        let mut log = Self::new(parts);
        if log.rest.is_empty() {
            let reason = "bus.log: No such file or directory";
            return Err(io::Error::new(io::ErrorKind::NotFound, reason));
        }
        // An invalid gzip file is found here.
        log.fill_buf()?;
        Ok(log)
    }

    fn new(parts: impl IntoIterator<Item = PathBuf>) -> Self {
        Self { rest: parts.into_iter().collect(), current: None, is_at_line_start: true }
    }

    /// Opens the next part, if this one is at its end.
    fn advance(&mut self) -> io::Result<()> {
        loop {
            if let Some((path, file)) = &mut self.current
                && !file.fill_buf().map_err(|error| named(path, &error))?.is_empty()
            {
                return Ok(());
            }
            if !self.is_at_line_start {
                self.current = None;
                return Ok(());
            }
            let Some(path) = self.rest.pop_front() else {
                self.current = None;
                return Ok(());
            };
            let file = PartFile::open(&path).map_err(|error| named(&path, &error))?;
            self.current = Some((path, BoundedLines::new(file)));
        }
    }
}

/// Returns an error with the name of its file.
fn named(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}

impl Read for BusLog {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(to)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for BusLog {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.advance()?;
        match &mut self.current {
            Some((_, file)) => file.fill_buf(),
            // The end of a line that its part was cut in.
            None if !self.is_at_line_start => Ok(b"\n"),
            None => Ok(b""),
        }
    }

    fn consume(&mut self, count: usize) {
        if count == 0 {
            return;
        }
        let Some((_, file)) = &mut self.current else {
            self.is_at_line_start = true;
            return;
        };
        if let Ok(bytes) = file.fill_buf() {
            self.is_at_line_start = bytes.get(count - 1) == Some(&b'\n');
        }
        file.consume(count);
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::*;

    /// Returns the text read from parts with these contents, some packed, byte by byte or by lines.
    fn read(name: &str, parts: &[(&str, bool)]) -> String {
        let folder = std::env::temp_dir().join(format!("frhc-{}-{name}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let paths = parts.iter().enumerate().map(|(number, (content, is_packed))| {
            let path = folder.join(number.to_string());
            let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
            gzip.write_all(content.as_bytes()).unwrap();
            let packed = gzip.finish().unwrap();
            fs::write(&path, if *is_packed { &packed } else { content.as_bytes() }).unwrap();
            path
        });
        let paths: Vec<_> = paths.collect();
        let mut whole = String::new();
        BusLog::new(paths.clone()).read_to_string(&mut whole).unwrap();
        let lines: Vec<_> = BusLog::new(paths).lines().map(Result::unwrap).collect();
        assert_eq!(lines, whole.lines().collect::<Vec<_>>());
        fs::remove_dir_all(&folder).unwrap();
        whole
    }

    #[test]
    fn parts_are_one_log_whose_lines_are_whole() {
        let parts = [("a\nb\n", true), ("", false), ("", true), ("c\n", false), ("d\n", true)];
        assert_eq!(read("log-parts", &parts), "a\nb\nc\nd\n");
        // A part that was cut by hand.
        let parts = [("a\nhal", false), ("c\n", true), ("end", false)];
        assert_eq!(read("log-cut", &parts), "a\nhal\nc\nend\n");
        assert_eq!(read("log-none", &[]), "");
    }

    #[test]
    fn endless_line_is_named_by_file_and_line() {
        let folder = std::env::temp_dir().join(format!("frhc-{}-log-zeros", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let paths = ["1", "2"].map(|name| folder.join(name));
        fs::write(&paths[0], "a\nb\n").unwrap();
        fs::write(&paths[1], "c\n").unwrap();
        // A sparse file takes no room on the disk.
        let sparse = fs::File::options().append(true).open(&paths[1]).unwrap();
        sparse.set_len(10_000_000_000).unwrap();
        let read: Vec<_> = BusLog::new(paths.clone()).lines().take(4).collect();
        assert!(read[..3].iter().all(Result::is_ok));
        let error = read[3].as_ref().unwrap_err().to_string();
        let expected = format!("{}: line 2 is longer than 1 MiB", paths[1].display());
        assert!(error.starts_with(&expected), "{error}");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn part_that_cannot_be_read_is_named() {
        let absent = PathBuf::from("/absent/bus-002.log");
        let error = BusLog::new([absent]).read(&mut [0; 8]).unwrap_err().to_string();
        assert!(error.starts_with("/absent/bus-002.log: No such file"), "{error}");
    }
}
