//! Compression of finished parts of a session with gzip (RFC 1952). A packed part gets its name only once it is on the disk
//! and was read back equal. Only then is the plain part removed.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufReader, ErrorKind, Read, Write};
use std::ops::AddAssign;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use flate2::Compression;
use flate2::bufread::MultiGzDecoder;
use flate2::write::GzEncoder;
use tempfile::NamedTempFile;

use crate::results::{self, Access};
use crate::sessions::documents::summary;
use config::files;
use telemetry::parts::{Part, Parts};

/// Prefix of the names of files that are being packed.
const TEMPORARY: &str = ".pack-";

/// Compression level. A higher one takes twice the time and saves 2 %.
const LEVEL: Compression = Compression::new(6);

/// Number of bytes between two checks for signals.
const CHUNK: usize = 1 << 16;

/// Result of packing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PackReport {
    pub(super) sessions: u32,
    files: u32,
    /// Sizes of these files, in bytes.
    before: u64,
    after: u64,
    /// Number of parts that are not finished.
    left: u32,
}

impl AddAssign for PackReport {
    fn add_assign(&mut self, other: Self) {
        self.sessions += other.sessions;
        self.files += other.files;
        self.before += other.before;
        self.after += other.after;
        self.left += other.left;
    }
}

/// Formats as `4 files packed, 37.5 MB to 6.0 MB`.
impl fmt::Display for PackReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let files = |count| format!("{count} {}", if count == 1 { "file" } else { "files" });
        match self.files {
            0 => f.write_str("nothing to pack")?,
            count => {
                let (before, after) = (megabytes(self.before), megabytes(self.after));
                write!(f, "{} packed, {before} to {after}", files(count))?;
            }
        }
        match self.left {
            0 => Ok(()),
            left => write!(f, "; {} not finished", files(left)),
        }
    }
}

/// Formats a size in MB, with a digit of kB.
pub(super) fn megabytes(bytes: u64) -> String {
    let tenths = bytes.saturating_add(50_000) / 100_000;
    format!("{}.{} MB", tenths / 10, tenths % 10)
}

/// Packs the finished parts in the folder of a session.
///
/// # Errors
/// When a file cannot be read or written, another process packs this session, or `is_interrupted`. Files packed before
/// remain packed.
pub(super) fn pack(folder: &Path, is_interrupted: &dyn Fn() -> bool) -> io::Result<PackReport> {
    let lock = File::open(folder)?;
    if lock.try_lock().is_err() {
        return Err(io::Error::new(ErrorKind::ResourceBusy, "is being packed by another process"));
    }
    // Left by a kill.
    for entry in fs::read_dir(folder)?.flatten() {
        if entry.file_name().to_string_lossy().starts_with(TEMPORARY) {
            fs::remove_file(entry.path())?;
        }
    }
    let (_, stated) = summary(folder)?;
    let parts = Parts::find(folder, stated)?;
    let mut packed = PackReport { sessions: 1, ..PackReport::default() };
    for part in parts.files().iter().filter(|part| !part.is_packed) {
        if stated.is_some() || is_followed(part, &parts) {
            let sizes = pack_part(folder, part, is_interrupted);
            let named = |error: io::Error| {
                io::Error::new(error.kind(), format!("{}: {error}", part.name()))
            };
            let (before, after) = sizes.map_err(named)?;
            packed += PackReport { files: 1, before, after, ..PackReport::default() };
        } else {
            packed.left += 1;
        }
    }
    Ok(packed)
}

/// Returns whether the writer has started the next part. The file of that part is empty while the writer is at this one.
fn is_followed(part: &Part, parts: &Parts) -> bool {
    let mut files = parts.files().iter();
    files.any(|it| it.stream == part.stream && it.number == part.number + 1 && it.size > 0)
}

/// Packs one part; returns its sizes before and after.
fn pack_part(
    folder: &Path,
    part: &Part,
    is_interrupted: &dyn Fn() -> bool,
) -> io::Result<(u64, u64)> {
    let path = folder.join(part.name());
    let packed = folder.join(Part { is_packed: true, ..part.clone() }.name());
    let plain = files::open_unlinked(&path)?;
    let found = plain.metadata()?;
    match files::open_unlinked(&packed) {
        // Of a process that was killed before it removed the plain one.
        Ok(file) => compare(&plain, &file, is_interrupted)?,
        Err(error) if error.kind() == ErrorKind::NotFound => {
            let file = compress(folder, &plain, is_interrupted)?;
            compare(&files::open_unlinked(&path)?, &file.reopen()?, is_interrupted)?;
            file.as_file().set_modified(found.modified()?)?;
            file.as_file().sync_all()?;
            file.persist_noclobber(&packed).map_err(|error| error.error)?;
            results::sync_folder(&packed)?;
        }
        Err(error) => return Err(error),
    }
    let facts = |of: &fs::Metadata| (of.dev(), of.ino(), of.len(), of.mtime(), of.mtime_nsec());
    if facts(&fs::symlink_metadata(&path)?) != facts(&found) {
        fs::remove_file(&packed)?;
        return Err(io::Error::new(ErrorKind::ResourceBusy, "is still being written"));
    }
    fs::remove_file(&path)?;
    results::sync_folder(&path)?;
    Ok((found.len(), fs::symlink_metadata(&packed)?.len()))
}

/// Compresses `plain` to a temporary file in `folder`.
fn compress(
    folder: &Path,
    mut plain: &File,
    is_interrupted: &dyn Fn() -> bool,
) -> io::Result<NamedTempFile> {
    let file = tempfile::Builder::new()
        .prefix(TEMPORARY)
        .permissions(Access::Owner.permissions())
        .tempfile_in(folder)?;
    let mut encoder = GzEncoder::new(file, LEVEL);
    let mut chunk = vec![0; CHUNK];
    loop {
        let read = read(&mut plain, &mut chunk, is_interrupted)?;
        if read.is_empty() {
            return encoder.finish();
        }
        encoder.write_all(read)?;
    }
}

/// Compares a plain file with the content of a packed one.
///
/// # Errors
/// When they differ, one cannot be read, or `is_interrupted`.
fn compare(mut plain: &File, packed: &File, is_interrupted: &dyn Fn() -> bool) -> io::Result<()> {
    let mut unpacked = MultiGzDecoder::new(BufReader::new(packed));
    let (mut expected, mut found) = (vec![0; CHUNK], vec![0; CHUNK]);
    loop {
        let expected = read(&mut plain, &mut expected, is_interrupted)?;
        let found = read(&mut unpacked, &mut found, is_interrupted)?;
        if expected != found {
            let reason = "differs from the packed file of this name; remove one of both";
            return Err(io::Error::new(ErrorKind::InvalidData, reason));
        }
        if expected.is_empty() {
            return Ok(());
        }
    }
}

/// Reads until `chunk` is full or the file ends; returns the bytes read.
fn read<'c>(
    from: &mut impl Read,
    chunk: &'c mut [u8],
    is_interrupted: &dyn Fn() -> bool,
) -> io::Result<&'c [u8]> {
    if is_interrupted() {
        return Err(ErrorKind::Interrupted.into());
    }
    let mut length = 0;
    while let Some(room) = chunk.get_mut(length..).filter(|room| !room.is_empty()) {
        match from.read(room) {
            Ok(0) => break,
            Ok(count) => length += count,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(chunk.get(..length).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::os::unix::fs::{PermissionsExt, symlink};
    use std::path::PathBuf;

    use super::*;
    use crate::scratch::path as scratch;

    /// Creates a session of two parts; the second may still be written.
    fn session(name: &str, has_summary: bool) -> PathBuf {
        let folder = scratch(name);
        results::private_folder(&folder).unwrap();
        for part in ["bus.log", "inputs.bin", "bus-002.log", "inputs-002.bin"] {
            fs::write(folder.join(part), content(part)).unwrap();
        }
        if has_summary {
            fs::write(folder.join("summary.json"), "{\"recording\": {\"parts\": 2}}").unwrap();
        }
        folder
    }

    fn content(part: &str) -> Vec<u8> {
        (0..20_000).flat_map(|line| format!("({line}.5) can0 {part}\n").into_bytes()).collect()
    }

    fn unpacked(path: &Path) -> Vec<u8> {
        let mut content = Vec::new();
        let file = BufReader::new(File::open(path).unwrap());
        MultiGzDecoder::new(file).read_to_end(&mut content).unwrap();
        content
    }

    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().flatten();
        let mut names: Vec<_> =
            names.map(|entry| entry.file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    const ALL_PACKED: [&str; 5] =
        ["bus-002.log.gz", "bus.log.gz", "inputs-002.bin.gz", "inputs.bin.gz", "summary.json"];

    #[test]
    fn finished_session_is_packed_whole_and_only_once() {
        let folder = session("pack", true);
        let packed = pack(&folder, &|| false).unwrap();
        assert_eq!((packed.files, packed.left), (4, 0));
        assert!(packed.after * 4 < packed.before, "{packed}");
        assert_eq!(names(&folder), ALL_PACKED);
        for name in &ALL_PACKED[..4] {
            let file = folder.join(name);
            assert_eq!(unpacked(&file), content(name.strip_suffix(".gz").unwrap()));
            assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o600);
        }
        assert_eq!(pack(&folder, &|| false).unwrap().to_string(), "nothing to pack");
        assert_eq!(names(&folder), ALL_PACKED);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn part_that_is_being_written_is_left_alone() {
        let folder = session("pack-open", false);
        let packed = pack(&folder, &|| false).unwrap();
        assert_eq!((packed.files, packed.left), (2, 2), "{packed}");
        assert_eq!(
            names(&folder),
            ["bus-002.log", "bus.log.gz", "inputs-002.bin", "inputs.bin.gz"]
        );
        // The writer has created the third part, and is still at the second.
        for next in ["bus-003.log", "inputs-003.bin"] {
            fs::write(folder.join(next), "").unwrap();
        }
        assert_eq!(pack(&folder, &|| false).unwrap().left, 4);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn interruption_anywhere_loses_nothing_and_leaves_no_temporary() {
        let folder = session("pack-interrupted", true);
        let mut interruptions = 0;
        loop {
            let looks = Cell::new(0);
            let is_interrupted = || looks.replace(looks.get() + 1) == interruptions;
            let ended = pack(&folder, &is_interrupted);
            for name in ["bus.log", "inputs.bin", "bus-002.log", "inputs-002.bin"] {
                let (plain, packed) = (folder.join(name), folder.join(format!("{name}.gz")));
                let found = fs::read(plain).unwrap_or_else(|_| unpacked(&packed));
                assert_eq!(found, content(name));
            }
            let names = names(&folder);
            assert!(!names.iter().any(|name| name.starts_with('.')), "{names:?}");
            match ended {
                Ok(_) => break,
                Err(error) => assert_eq!(error.kind(), ErrorKind::Interrupted),
            }
            interruptions += 1;
        }
        assert!(interruptions > 5, "{interruptions}");
        assert_eq!(names(&folder), ALL_PACKED);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn plain_part_beside_an_equal_packed_one_is_removed() {
        let folder = session("pack-both", true);
        pack(&folder, &|| false).unwrap();
        fs::write(folder.join("bus.log"), content("bus.log")).unwrap();
        fs::write(folder.join(".pack-Ab12"), "left by a kill").unwrap();
        assert_eq!(pack(&folder, &|| false).unwrap().files, 1);
        assert_eq!(names(&folder), ALL_PACKED);
        fs::write(folder.join("bus.log"), "other").unwrap();
        let error = pack(&folder, &|| false).unwrap_err().to_string();
        assert!(error.starts_with("bus.log: differs from the packed file"), "{error}");
        assert_eq!(fs::read(folder.join("bus.log")).unwrap(), b"other");
        assert_eq!(unpacked(&folder.join("bus.log.gz")), content("bus.log"));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn symbolic_link_as_a_part_is_refused() {
        let folder = session("pack-link", true);
        let elsewhere = scratch("pack-link-target");
        fs::write(&elsewhere, "mine").unwrap();
        fs::remove_file(folder.join("bus-002.log")).unwrap();
        symlink(&elsewhere, folder.join("bus-002.log")).unwrap();
        let error = pack(&folder, &|| false).unwrap_err().to_string();
        assert_eq!(error, "bus-002.log: must be a regular file");
        assert_eq!(fs::read(&elsewhere).unwrap(), b"mine");
        fs::remove_file(&elsewhere).unwrap();
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn session_is_packed_by_one_process_at_a_time() {
        let folder = session("pack-twice", true);
        let lock = File::open(&folder).unwrap();
        lock.lock().unwrap();
        let error = pack(&folder, &|| false).unwrap_err().to_string();
        assert_eq!(error, "is being packed by another process");
        drop(lock);
        assert_eq!(pack(&folder, &|| false).unwrap().files, 4);
        fs::remove_dir_all(&folder).unwrap();
    }
}
