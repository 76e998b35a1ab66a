//! Log file that always ends with a complete line.
//!
//! The first failed write (full disk, file size limit, lost disk) ends the file. The partial line is removed, and nothing
//! is written after it, so a reader finds complete lines without gaps.

use std::fs::File;
use std::io::{self, ErrorKind, Write};

/// Log file written from its start.
#[derive(Debug)]
pub(super) struct LogFile {
    file: File,
    written: u64,
    /// Length up to the end of the last complete line, in bytes.
    whole: u64,
    has_failed: bool,
}

impl LogFile {
    /// Writes to `file`, which must be empty.
    pub(super) const fn onto(file: File) -> Self {
        Self { file, written: 0, whole: 0, has_failed: false }
    }

    fn fail<T>(&mut self, error: io::Error) -> io::Result<T> {
        if error.kind() != ErrorKind::Interrupted {
            self.has_failed = true;
            // Fails for a pipe and for a disk that is gone; the write error is reported anyway.
            self.file.set_len(self.whole).ok();
        }
        Err(error)
    }
}

impl Write for LogFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.has_failed {
            return Err(io::Error::from(ErrorKind::BrokenPipe));
        }
        match self.file.write(bytes) {
            Ok(count) => {
                let lines = bytes.get(..count).unwrap_or_default();
                let length = |count: usize| u64::try_from(count).unwrap_or(u64::MAX);
                if let Some(last) = lines.iter().rposition(|byte| *byte == b'\n') {
                    self.whole = self.written + length(last) + 1;
                }
                self.written += length(count);
                Ok(count)
            }
            Err(error) => self.fail(error),
        }
    }

    /// Syncs the file to the disk.
    fn flush(&mut self) -> io::Result<()> {
        match self.file.sync_data() {
            // fdatasync returns EINVAL for a pipe.
            Err(error) if error.kind() == ErrorKind::InvalidInput => Ok(()),
            Err(error) => self.fail(error),
            Ok(()) => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Seek, SeekFrom};

    use super::*;

    #[test]
    fn log_files_that_fail_end_with_a_whole_line() {
        let mut copy = tempfile::tempfile().unwrap();
        let mut log = LogFile::onto(copy.try_clone().unwrap());
        log.write_all(b"one\ntwo\nthr").unwrap();
        log.fail::<()>(io::Error::from(ErrorKind::FileTooLarge)).unwrap_err();
        // A later flush of a buffer writes nothing.
        assert!(log.write_all(b"ee\nfour\n").is_err());
        let mut text = String::new();
        copy.seek(SeekFrom::Start(0)).unwrap();
        copy.read_to_string(&mut text).unwrap();
        assert_eq!(text, "one\ntwo\n");
    }
}
