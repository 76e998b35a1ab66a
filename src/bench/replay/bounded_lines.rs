//! Log whose lines have a maximum length, so that reading by lines takes bounded memory whatever the file has.

use std::io::{self, BufRead, ErrorKind, Read};

/// Maximum length of a line, in bytes. The longest lines of candump have about 250, and a disk that lost its power may
/// leave blocks of zeros between two.
pub const MAX_LINE: u64 = 1 << 20;

/// Reader that fails in the first line above [`MAX_LINE`], after at most a buffer more, and names it by its number.
#[derive(Debug)]
pub struct BoundedLines<R> {
    log: R,
    /// Number of the line that is read, from 1.
    number: u64,
    /// Length of that line so far, in bytes.
    length: u64,
}

impl<R: BufRead> BoundedLines<R> {
    /// Returns a reader of `log` from its begin.
    pub const fn new(log: R) -> Self {
        Self { log, number: 1, length: 0 }
    }
}

impl<R: BufRead> Read for BoundedLines<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(to)?;
        self.consume(count);
        Ok(count)
    }
}

impl<R: BufRead> BufRead for BoundedLines<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.length > MAX_LINE {
            let (number, limit) = (self.number, MAX_LINE >> 20);
            let reason = format!("line {number} is longer than {limit} MiB: not a candump log");
            return Err(io::Error::new(ErrorKind::InvalidData, reason));
        }
        self.log.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        let read = self.log.fill_buf().ok().and_then(|bytes| bytes.get(..count));
        let read = read.unwrap_or_default();
        let wide = |count| u64::try_from(count).unwrap_or(u64::MAX);
        if let Some(last) = read.iter().rposition(|byte| *byte == b'\n') {
            self.number += wide(read.iter().filter(|byte| **byte == b'\n').count());
            self.length = wide(read.len() - last - 1);
        } else {
            self.length += wide(read.len());
        }
        self.log.consume(count);
    }
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use super::*;

    /// Returns the number of lines that can be read, and the error behind them.
    fn lines(log: impl Read) -> (usize, Option<String>) {
        let mut lines = BoundedLines::new(BufReader::with_capacity(1 << 16, log)).lines();
        let read = lines.by_ref().map_while(Result::ok).count();
        (read, lines.next().and_then(Result::err).map(|error| error.to_string()))
    }

    #[test]
    fn endless_line_is_an_error_with_its_number() {
        let log = (&b"(1.000000) can0 080#\n\n"[..]).chain(io::repeat(0));
        let mut lines = BoundedLines::new(BufReader::with_capacity(1 << 16, log)).lines();
        assert!(lines.next().unwrap().is_ok() && lines.next().unwrap().is_ok());
        let error = lines.next().unwrap().unwrap_err().to_string();
        assert_eq!(error, "line 3 is longer than 1 MiB: not a candump log");
    }

    #[test]
    fn long_line_within_the_limit_is_read() {
        let mut log = vec![b'x'; usize::try_from(MAX_LINE).unwrap()];
        log.extend(b"\nend");
        assert_eq!(lines(&log[..]), (2, None));
        assert_eq!(lines(&b""[..]), (0, None));
    }
}
