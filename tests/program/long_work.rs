//! Long work: its bar is on a terminal alone, and SIGINT ends it with exit code 130, one line, and no half-written file.

use std::fs::File;
use std::io::Read;
use std::process::Child;
use std::thread;

use nix::pty::{Winsize, openpty};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::common::prelude::*;

/// Commands that show a bar, with a part of its line; `SESSION` and `OUT` are replaced.
const LONG: &[(&str, &str)] = &[
    ("demo --seconds 30", "/30000 cycles  "),
    ("replay SESSION", "/60000 cycles  "),
    ("export csv SESSION tau --every 1000", "/60000 cycles  "),
    ("replay SESSION --with config/kraft_like.toml", "/60000 cycles  "),
    ("campaign --faults 200 --only emergency --config config/kraft_like.toml", "/200 faults  "),
    ("campaign --soak 60000 --config config/kraft_like.toml", "/60000 cycles  "),
    ("experiment ntrfc --short --robot config/robots/puma560.toml", " runs  "),
];

/// Commands that take minutes, each with the contents of `OUT` after an interruption.
const ENDLESS: &[(&str, &[&str])] = &[
    ("demo --seconds 86400", &[]),
    ("campaign --faults 100000 --out OUT", &[]),
    ("campaign --soak 1000000000", &[]),
    ("experiment fidelity --out OUT", &[]),
    ("experiment delay --out OUT", &[]),
];

/// A program whose stderr is a terminal.
struct OnTerminal {
    child: Child,
    terminal: File,
    shown: String,
}

impl OnTerminal {
    fn start(args: &[String]) -> Self {
        let size = Winsize { ws_row: 24, ws_col: 100, ws_xpixel: 0, ws_ypixel: 0 };
        let pty = openpty(Some(&size), None).unwrap();
        let mut command = Command::new(crate::common::program());
        command.args(args).env("TERM", "xterm").stdin(Stdio::null()).stdout(Stdio::piped());
        let child = command.stderr(Stdio::from(pty.slave)).spawn().unwrap();
        Self { child, terminal: File::from(pty.master), shown: String::new() }
    }

    /// Reads the next output; returns whether the terminal is still open.
    fn read(&mut self) -> bool {
        let mut bytes = [0; 4096];
        // Once the program has ended, reading fails.
        let count = self.terminal.read(&mut bytes).unwrap_or(0);
        self.shown.push_str(&String::from_utf8_lossy(&bytes[..count]));
        count > 0
    }

    /// Waits until this is shown.
    #[track_caller]
    fn wait_for(&mut self, text: &str) {
        while !self.shown.contains(text) {
            assert!(self.read(), "{text}: {}", self.shown);
        }
    }

    fn interrupt(&self) {
        kill(Pid::from_raw(self.child.id().try_into().unwrap()), Signal::SIGINT).unwrap();
    }

    /// Returns exit code, stdout, and the output on the terminal.
    fn end(mut self) -> (Option<i32>, String, String) {
        // A full pipe would stop the program.
        let mut stdout = self.child.stdout.take().unwrap();
        let stdout = thread::spawn(move || {
            let mut text = String::new();
            stdout.read_to_string(&mut text).map(|_| text)
        });
        while self.read() {}
        let stdout = stdout.join().unwrap().unwrap();
        (self.child.wait().unwrap().code(), stdout, self.shown)
    }
}

/// Returns the lines that a terminal still has at the end: a bar erases its own.
fn lines_left(shown: &str) -> Vec<String> {
    let left = |line: &str| {
        line.rsplit('\r')
            .find_map(|part| part.strip_prefix("\u{1b}[2K"))
            .map(str::to_owned)
            .unwrap_or_else(|| line.to_owned())
    };
    shown.replace("\r\n", "\n").split('\n').map(left).filter(|line| !line.is_empty()).collect()
}

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
        let args = args(line, &session, "");
        let (code, stdout, shown) = OnTerminal::start(&args).end();
        assert_eq!(code, Some(0), "{line}: {shown}");
        assert!(shown.contains(amount) && shown.contains(" s left"), "{line}: {shown}");
        let piped = frhc(&args);
        let noted: Vec<String> = piped.stderr.lines().map(str::to_owned).collect();
        assert_eq!((stdout, lines_left(&shown).len()), (piped.stdout, noted.len()), "{line}");
        assert!(!piped.stderr.contains(['\r', '\u{1b}', '%']), "{line}: {}", piped.stderr);
    }
}

#[test]
fn quiet_work_shows_no_byte_of_a_bar() {
    let session = session("quiet", "4");
    for (line, _) in LONG {
        let args = args(&format!("-q {line}"), &session, "");
        let (code, _, shown) = OnTerminal::start(&args).end();
        assert_eq!(code, Some(0), "{line}: {shown}");
        assert!(!shown.replace("\r\n", "\n").contains(['\r', '\u{1b}', '%']), "{line}: {shown}");
    }
}

#[test]
fn interrupted_work_says_so_in_one_line_and_leaves_no_file() {
    let out = folder("long_work", "interrupted").join("out");
    for (line, left) in ENDLESS {
        let mut work = OnTerminal::start(&args(line, "", out.to_str().unwrap()));
        work.wait_for("0 s");
        work.interrupt();
        let (code, _, shown) = work.end();
        assert_eq!(code, Some(130), "{line}: {shown}");
        let mut lines = lines_left(&shown);
        lines.retain(|line| !line.contains(" WARN"));
        let [said] = &*lines else { panic!("{line}: {lines:?}") };
        assert!(said.starts_with("frhc: interrupted after "), "{line}: {said}");
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
