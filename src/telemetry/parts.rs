//! Parts of a session's two streams: `bus.log` and `inputs.bin` are the first ones, then `bus-002.log` and `inputs-002.bin`.
//! Each may be packed: `bus-002.log.gz`.

use std::io;
use std::path::Path;
use std::{fs, iter};

/// Stream of a session that is written in parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stream {
    /// Frames and cycles, in candump's format.
    BusLog,
    /// Inputs of the node.
    Inputs,
}

/// End of the name of a packed part.
const PACKED: &str = ".gz";

/// One file of a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Stream that the file is part of.
    pub stream: Stream,
    /// Number in the stream, from 1.
    pub number: u32,
    /// Set if the file is compressed (gzip).
    pub is_packed: bool,
    /// Size of the file, in bytes.
    pub size: u64,
}

/// Parts in the folder of a session, and those that are missing.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// Parts by stream and number; a packed one precedes a plain one of the same number.
    found: Vec<Part>,
    count: u32,
}

impl Stream {
    /// Both streams.
    pub const ALL: [Self; 2] = [Self::BusLog, Self::Inputs];

    /// Returns the file name of a part that is not packed.
    pub fn part(self, number: u32) -> String {
        let (name, extension) = match self {
            Self::BusLog => ("bus", "log"),
            Self::Inputs => ("inputs", "bin"),
        };
        match number {
            0 | 1 => format!("{name}.{extension}"),
            _ => format!("{name}-{number:03}.{extension}"),
        }
    }
}

impl Part {
    /// Parses a file name; `None` for a file that is not a part.
    fn parse(name: &str, size: u64) -> Option<Self> {
        let plain = name.strip_suffix(PACKED);
        let is_packed = plain.is_some();
        let plain = plain.unwrap_or(name);
        let digits: String = plain.chars().filter(char::is_ascii_digit).collect();
        let number = if digits.is_empty() { 1 } else { digits.parse().ok()? };
        let stream = Stream::ALL.into_iter().find(|stream| stream.part(number) == plain)?;
        (number > 0).then_some(Self { stream, number, is_packed, size })
    }

    /// Returns the file name.
    pub fn name(&self) -> String {
        let packed = if self.is_packed { PACKED } else { "" };
        format!("{}{packed}", self.stream.part(self.number))
    }
}

impl Parts {
    /// Finds the parts in `folder`. `stated` is their number in `summary.json`; `None` without a summary.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn find(folder: &Path, stated: Option<u32>) -> io::Result<Self> {
        let mut found = Vec::new();
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let size = entry.metadata().map_or(0, |found| found.len());
            found.extend(entry.file_name().to_str().and_then(|name| Part::parse(name, size)));
        }
        found.sort_by_key(|part| (part.stream, part.number, !part.is_packed));
        let last = |found: &[Part]| found.iter().map(|part| part.number).max().unwrap_or(0);
        let mut count = last(&found);
        // A writer that is killed while it starts a part leaves only the empty file of the inputs.
        let begun: Vec<_> = found.iter().filter(|part| part.number == count).collect();
        let is_begun = matches!(*begun, [Part { stream: Stream::Inputs, size: 0, .. }]);
        if is_begun && stated.is_none() {
            found.retain(|part| part.number < count);
            count = last(&found);
        }
        Ok(Self { found, count: count.max(stated.unwrap_or(1)) })
    }

    /// Returns the number of parts, including missing ones.
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// Returns all files.
    pub fn files(&self) -> &[Part] {
        &self.found
    }

    /// Returns each part of a stream in order; `Err` with its plain file name for a missing one.
    pub fn stream(&self, stream: Stream) -> impl Iterator<Item = Result<&Part, String>> {
        let mut numbers = 1..=self.count;
        iter::from_fn(move || {
            let number = numbers.next()?;
            let is_it = |part: &&Part| part.stream == stream && part.number == number;
            Some(self.found.iter().find(is_it).ok_or_else(|| stream.part(number)))
        })
    }

    /// Returns the names of the missing parts.
    pub fn missing(&self) -> Vec<String> {
        Stream::ALL.into_iter().flat_map(|one| self.stream(one)).filter_map(Result::err).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates a folder of files with these names and sizes.
    fn folder(name: &str, files: &[(&str, u64)]) -> std::path::PathBuf {
        let folder = std::env::temp_dir().join(format!("frhc-{}-{name}", std::process::id()));
        fs::remove_dir_all(&folder).ok();
        fs::create_dir(&folder).unwrap();
        for (name, size) in files {
            let file = fs::File::create_new(folder.join(name)).unwrap();
            file.set_len(*size).unwrap();
        }
        folder
    }

    fn found(name: &str, files: &[(&str, u64)], stated: Option<u32>) -> Parts {
        let folder = folder(name, files);
        let parts = Parts::find(&folder, stated).unwrap();
        fs::remove_dir_all(&folder).unwrap();
        parts
    }

    #[test]
    fn names_of_parts_are_read_as_they_are_written() {
        for stream in Stream::ALL {
            for number in [1, 2, 10, 999, 1_000, 123_456] {
                for is_packed in [false, true] {
                    let part = Part { stream, number, is_packed, size: 7 };
                    assert_eq!(Part::parse(&part.name(), 7), Some(part));
                }
            }
        }
        for other in [
            "bus-001.log",
            "bus-2.log",
            "bus-0002.log",
            "bus-002.bin",
            "bus.log.gz.gz",
            "bus.log2",
            "2bus.log",
            "inputs",
            "bus-000.log",
            "bus-99999999999.log",
            "",
        ] {
            assert_eq!(Part::parse(other, 0), None, "{other}");
        }
    }

    #[test]
    fn parts_are_in_the_order_of_their_numbers() {
        let files = [
            ("bus.log.gz", 1),
            ("bus-1000.log", 1),
            ("bus-002.log", 1),
            ("bus-002.log.gz", 1),
            ("notes", 1),
        ];
        let parts = found("parts-order", &files, None);
        let names: Vec<_> = parts.stream(Stream::BusLog).flatten().map(Part::name).collect();
        assert_eq!(names, ["bus.log.gz", "bus-002.log.gz", "bus-1000.log"]);
        assert_eq!(parts.count(), 1_000);
    }

    #[test]
    fn missing_parts_are_named() {
        let files = [("bus.log", 9), ("inputs.bin", 9), ("bus-003.log", 9), ("inputs-003.bin", 9)];
        let parts = found("parts-middle", &files, None);
        assert_eq!(parts.missing(), ["bus-002.log", "inputs-002.bin"]);
        let parts = found("parts-last", &files[..2], Some(2));
        assert_eq!(parts.missing(), ["bus-002.log", "inputs-002.bin"]);
        assert_eq!(found("parts-all", &files[..2], None).missing(), Vec::<String>::new());
        assert_eq!(found("parts-none", &[], None).missing(), ["bus.log", "inputs.bin"]);
    }

    #[test]
    fn part_that_a_killed_run_has_not_begun_is_not_missing() {
        let files = [("bus.log", 9), ("inputs.bin", 9), ("inputs-002.bin", 0)];
        let parts = found("parts-begun", &files, None);
        assert_eq!((parts.count(), parts.missing()), (1, vec![]));
        assert_eq!(found("parts-begun-2", &files, Some(2)).missing(), ["bus-002.log"]);
    }
}
