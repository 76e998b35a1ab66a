//! One part of a session on disk, plain or packed with gzip.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

use config::files;

/// Size of the buffer that unpacked bytes are read into, in bytes.
const BUFFER: usize = 1 << 16;

/// First bytes of a gzip file (RFC 1952, 2.3.1).
const GZIP: [u8; 2] = [0x1F, 0x8B];

/// File being read, unpacked where it is packed. Its memory does not depend on its size.
#[derive(Debug)]
pub enum PartFile {
    /// File as it was written.
    Plain(BufReader<File>),
    /// File packed by gzip.
    Packed(Box<BufReader<MultiGzDecoder<BufReader<File>>>>),
}

impl PartFile {
    /// Opens a regular file, never by a symbolic link.
    ///
    /// # Errors
    /// Returns an error if it cannot be opened or read, or is not a regular file.
    pub fn open(path: &Path) -> io::Result<Self> {
        Self::from_file(files::open_unlinked(path)?)
    }

    /// Reads `file`, which is packed if it begins as gzip does.
    ///
    /// # Errors
    /// Returns an error if it cannot be read.
    pub fn from_file(file: File) -> io::Result<Self> {
        let mut file = BufReader::with_capacity(BUFFER, file);
        Ok(match file.fill_buf()?.starts_with(&GZIP) {
            true => {
                let unpacked = MultiGzDecoder::new(file);
                Self::Packed(Box::new(BufReader::with_capacity(BUFFER, unpacked)))
            }
            false => Self::Plain(file),
        })
    }

    /// Returns whether gzip unpacks the file.
    pub const fn is_packed(&self) -> bool {
        matches!(self, Self::Packed(_))
    }
}

impl Read for PartFile {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain(file) => file.read(to),
            Self::Packed(file) => file.read(to),
        }
    }
}

impl BufRead for PartFile {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        match self {
            Self::Plain(file) => file.fill_buf(),
            Self::Packed(file) => file.fill_buf(),
        }
    }

    fn consume(&mut self, count: usize) {
        match self {
            Self::Plain(file) => file.consume(count),
            Self::Packed(file) => file.consume(count),
        }
    }
}
