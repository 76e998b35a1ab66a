//! The examples in README and docs/ print the output shown there.
#![allow(
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::fs;
use std::path::Path;

use crate::common::cli::folder;
use crate::common::cli::frhc;

const KRAFT: &str = "config/kraft_like.toml";

/// Pages with examples.
const PAGES: &str = concat!(
    include_str!("../../README.md"),
    include_str!("../../docs/bus.md"),
    include_str!("../../docs/configuration.md"),
    include_str!("../../docs/simulation.md"),
);

/// Returns the lines of a page from the one with this beginning to the end of its code block.
fn shown(beginning: &str) -> Vec<&'static str> {
    let lines = PAGES.lines().skip_while(|line| !line.starts_with(beginning));
    let block: Vec<&str> = lines.take_while(|line| !line.starts_with("```")).collect();
    assert!(!block.is_empty(), "{beginning}");
    block
}

/// Returns the output of these arguments on stdout and stderr.
fn printed(args: &[&str]) -> String {
    let ended = frhc(args);
    ended.stdout + &ended.stderr
}

#[test]
fn examples_print_the_output_shown() {
    // The path of a record is chosen by the user.
    let is_printed = |line: &&&str| !line.starts_with("fault record: ");
    for (args, beginning) in [
        (&["demo", "--scenario", "faults/unplug"][..], "0.445055 s: the scenario begins"),
        (&["plan", "--config", KRAFT, "--layout", "per-drive"], "proposals to make it fit"),
        (&["demo", "--scenario", "stiff-wall"], "wall of 30000 N/m"),
    ] {
        let printed = printed(args);
        for line in shown(beginning).iter().filter(is_printed) {
            assert!(printed.lines().any(|printed| printed == *line), "{args:?}: {line}\n{printed}");
        }
    }
}

#[test]
fn decoded_cycle_shown_is_that_of_the_demo() {
    let out = folder("readme", "cycle").join("demo");
    let ended = frhc(&["demo", "--seconds", "3", "--out", out.to_str().unwrap()]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let decoded = frhc(&["decode", "--config", KRAFT, out.join("bus.log").to_str().unwrap()]);
    let is_frame = |line: &&str| line.contains(") vcan0 ");
    let frames: Vec<&str> = decoded.stdout.lines().filter(is_frame).collect();
    let shown = shown("(2.00");
    let cycle = frames.windows(shown.len()).find(|cycle| cycle[0] == shown[0]);
    assert_eq!(cycle, Some(&*shown), "docs/bus.md shows another cycle");
}

/// Writes a copy of the configuration to `path`, with the first `from` of each pair replaced by `to`.
fn write_changed(path: &Path, slips: &[(&str, &str)]) {
    let mut text = fs::read_to_string(KRAFT)
        .unwrap()
        .replace("../eds", concat!(env!("CARGO_MANIFEST_DIR"), "/eds"));
    for (from, to) in slips {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    fs::write(path, text).unwrap();
}

#[test]
fn refusals_name_file_line_and_key_as_shown() {
    let broken =
        [("start_deg", "start_dg"), ("-0.393453", "-3.93453"), ("a_m = 0.254", "a_m = nan")];
    let bad = [("damping_ns_per_m = [8.0", "damping_ns_per_m = [30.0")];
    for (name, slips, beginning) in
        [("broken.toml", &broken[..], "frhc: broken.toml:"), ("bad.toml", &bad, "frhc: bad.toml:")]
    {
        let path = folder("readme", name).join(name);
        write_changed(&path, slips);
        let ended = frhc(&["check", "--config", path.to_str().unwrap()]);
        assert_eq!(ended.code, 3, "{}", ended.stderr);
        let stderr = ended.stderr.replace(path.to_str().unwrap(), name);
        let errors: Vec<&str> = stderr.lines().filter(|line| line.starts_with("frhc: ")).collect();
        assert_eq!(errors, shown(beginning));
    }
}
