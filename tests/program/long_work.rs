//! Long work: its bar is on a terminal alone, and SIGINT ends it with exit code 130, one line, and no half-written file.

use crate::common::on_terminal::{OnTerminal, ends_when_interrupted, has_bar, has_no_bar};
use crate::common::prelude::*;

/// Commands that show a bar, with a part of its line; `SESSION` and `OUT` are replaced.
const LONG: &[(&str, &str)] = &[
    ("demo --seconds 30", "/30000 cycles  "),
    ("replay SESSION", "/60000 cycles  "),
    ("export csv SESSION tau --every 1000", "/60000 cycles  "),
    ("replay SESSION --with config/kraft_like.toml", "/60000 cycles  "),
    ("campaign --faults 200 --only emergency --config config/kraft_like.toml", "/200 faults  "),
    ("campaign --soak 60000 --config config/kraft_like.toml", "/60000 cycles  "),
];

/// Commands that take minutes, each with the contents of `OUT` after an interruption.
const ENDLESS: &[(&str, &[&str])] = &[
    ("demo --seconds 86400", &[]),
    ("campaign --faults 100000 --out OUT", &[]),
    ("campaign --soak 1000000000", &[]),
];

fn session(test: &str, seconds: &str) -> String {
    let session = folder("long_work", test).join("session");
    let session = session.to_str().unwrap();
    let recorded = frhc(&["-q", "demo", "--seconds", seconds, "--out", session]);
    assert_eq!((recorded.code, recorded.stderr.as_str()), (0, ""));
    session.to_owned()
}

fn args(line: &str, session: &str, out: &str) -> Vec<String> {
    line.split(' ').map(|word| word.replace("SESSION", session).replace("OUT", out)).collect()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn bar_with_time_left_is_on_a_terminal_and_gone_at_the_end() {
    let session = session("bar", "60");
    for (line, amount) in LONG {
        has_bar(&args(line, &session, ""), amount);
    }
}

#[test]
fn quiet_work_shows_no_byte_of_a_bar() {
    let session = session("quiet", "4");
    for (line, _) in LONG {
        has_no_bar(&args(&format!("-q {line}"), &session, ""));
    }
}

#[test]
fn interrupted_work_says_so_in_one_line_and_leaves_no_file() {
    let out = folder("long_work", "interrupted").join("out");
    for (line, left) in ENDLESS {
        ends_when_interrupted(&args(line, "", out.to_str().unwrap()));
        assert_eq!(names(&out), *left, "{line}");
    }
}

#[test]
fn interrupted_replay_leaves_nothing_of_the_frames() {
    let session = session("emitted", "60");
    let out = folder("long_work", "sent");
    let file = out.join("sent.log");
    let line = "replay SESSION --emit OUT";
    let mut replay = OnTerminal::start(&args(line, &session, file.to_str().unwrap()));
    replay.wait_for("0 s");
    assert_eq!(names(&out).len(), 1, "a temporary file");
    replay.interrupt();
    let (code, stdout, shown) = replay.end();
    assert_eq!((code, stdout.as_str()), (Some(130), ""), "{shown}");
    assert!(shown.ends_with(" of 60000 cycles\r\n"), "{shown}");
    assert_eq!(names(&out), [""; 0]);
}
