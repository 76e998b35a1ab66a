//! Golden transcripts: the frames on the bus, in candump's format.

use std::fs;
use std::path::Path;

use canopen_tools::candump::Line;

/// Compares a transcript with the one in tests/golden, line by line; `GOLDEN=write` in the environment rewrites it.
pub(crate) fn compare(name: &str, transcript: &str) {
    for line in transcript.lines() {
        assert_eq!(Line::parse(line).unwrap().to_string(), line, "candump's format");
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    if std::env::var_os("GOLDEN").is_some_and(|word| word == "write") {
        fs::write(path, transcript).unwrap();
        return;
    }
    let golden = fs::read_to_string(&path).unwrap();
    for (number, (is, was)) in (1..).zip(transcript.lines().zip(golden.lines())) {
        assert_eq!(is, was, "{name}:{number}");
    }
    assert_eq!(transcript.lines().count(), golden.lines().count(), "{name}");
}
