//! Output of the experiments: failed writes, bars of long work, and interruptions.

use std::fs::OpenOptions;

use crate::common::cli::onto;
use crate::common::on_terminal::{ends_when_interrupted, has_bar, has_no_bar};
use crate::common::prelude::*;

/// An experiment of a second.
const SHORT: &str = "experiment ntrfc --short --robot config/robots/puma560.toml";

fn args(line: &str) -> Vec<String> {
    line.split(' ').map(str::to_owned).collect()
}

#[test]
fn failed_write_to_stdout_fails_the_command() {
    for line in [SHORT.to_owned(), format!("{SHORT} --json")] {
        let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let ended = onto(full, &args(&line));
        assert_eq!(ended.code, 4, "{line}: {}", ended.stderr);
        let reports = ended.stderr.matches("frhc: stdout: No space left on device").count();
        assert_eq!(reports, 1, "{line}: {}", ended.stderr);
    }
}

#[test]
fn closed_stdout_fails_no_command() {
    for line in [SHORT.to_owned(), format!("{SHORT} --json")] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let ended = onto(writer, &args(&line));
        assert!(ended.code == 0 && !ended.stderr.contains("stdout"), "{line}: {}", ended.stderr);
    }
}

#[test]
fn bar_with_time_left_is_on_a_terminal_and_gone_at_the_end() {
    has_bar(&args(SHORT), " runs  ");
    has_no_bar(&args(&format!("-q {SHORT}")));
}

#[test]
fn interrupted_work_says_so_in_one_line_and_leaves_no_file() {
    let out = folder("experiments", "interrupted").join("out");
    for experiment in ["fidelity", "delay"] {
        ends_when_interrupted(&args(&format!("experiment {experiment} --out {}", out.display())));
        assert!(!out.exists(), "{experiment}");
    }
}
