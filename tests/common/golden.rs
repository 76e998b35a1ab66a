//! Transcripts that are kept: what was said on the bus, frame for frame, as candump shows it.

use std::fs;
use std::path::Path;

use bus::candump::Line;

/// Compares a transcript with the one in tests/golden, line by line, or with `GOLDEN=write` in the
/// environment writes it anew.
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
