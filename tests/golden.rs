//! Golden transcripts: what a node says on the bus, frame for frame, as candump shows it.
//!
//! `GOLDEN=write cargo test --test golden` writes them anew; read the difference before you commit it.
#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

mod common;

use std::fs;
use std::path::Path;

use common::bench::booted;
use common::bench::until;
use frhc::node::Request;
use frhc::telemetry::candump::Line;
use frhc::telemetry::record::Mode;

/// Compares a transcript with the one in tests/golden, line by line.
fn compare(name: &str, transcript: &str) {
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

#[test]
fn boot() {
    let (_, wire) = booted("config/kraft_like_500hz.toml", "free");
    compare("boot.log", &wire.transcript(12));
}

#[test]
fn fault_reset() {
    let (mut bench, wire) = booted("config/kraft_like_500hz.toml", "free");
    bench.cycle();
    wire.clear();
    bench.world_mut().drive_mut(3).unwrap().fail();
    until(&mut bench, |record| record.mode == Mode::Stopped);
    bench.ask(Request::Reset).unwrap();
    until(&mut bench, |record| record.mode == Mode::Ready);
    compare("fault_reset.log", &wire.transcript(usize::MAX));
}
