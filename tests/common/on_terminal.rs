//! Long work on a terminal: its bar, and its end by SIGINT.

use std::fs::File;
use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::thread;

use nix::pty::{Winsize, openpty};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::cli::frhc;

/// A program whose stderr is a terminal.
pub(crate) struct OnTerminal {
    child: Child,
    terminal: File,
    shown: String,
}

impl OnTerminal {
    pub(crate) fn start(args: &[String]) -> Self {
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
    pub(crate) fn wait_for(&mut self, text: &str) {
        while !self.shown.contains(text) {
            assert!(self.read(), "{text}: {}", self.shown);
        }
    }

    pub(crate) fn interrupt(&self) {
        kill(Pid::from_raw(self.child.id().try_into().unwrap()), Signal::SIGINT).unwrap();
    }

    /// Returns exit code, stdout, and the output on the terminal.
    pub(crate) fn end(mut self) -> (Option<i32>, String, String) {
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

/// Asserts that a command shows a bar with this amount and the time left on a terminal alone, and erases it at its end.
#[track_caller]
pub(crate) fn has_bar(args: &[String], amount: &str) {
    let (code, stdout, shown) = OnTerminal::start(args).end();
    assert_eq!(code, Some(0), "{args:?}: {shown}");
    assert!(shown.contains(amount) && shown.contains(" s left"), "{args:?}: {shown}");
    let piped = frhc(args);
    let noted = piped.stderr.lines().count();
    assert_eq!((stdout, lines_left(&shown).len()), (piped.stdout, noted), "{args:?}");
    assert!(!piped.stderr.contains(['\r', '\u{1b}', '%']), "{args:?}: {}", piped.stderr);
}

/// Asserts that a command shows no byte of a bar.
#[track_caller]
pub(crate) fn has_no_bar(args: &[String]) {
    let (code, _, shown) = OnTerminal::start(args).end();
    assert_eq!(code, Some(0), "{args:?}: {shown}");
    assert!(!shown.replace("\r\n", "\n").contains(['\r', '\u{1b}', '%']), "{args:?}: {shown}");
}

/// Asserts that an interrupted command says so in one line, with exit code 130.
#[track_caller]
pub(crate) fn ends_when_interrupted(args: &[String]) {
    let mut work = OnTerminal::start(args);
    work.wait_for("0 s");
    work.interrupt();
    let (code, _, shown) = work.end();
    assert_eq!(code, Some(130), "{args:?}: {shown}");
    let mut lines = lines_left(&shown);
    lines.retain(|line| !line.contains(" WARN"));
    let [said] = &*lines else { panic!("{args:?}: {lines:?}") };
    assert!(said.starts_with("frhc: interrupted after "), "{args:?}: {said}");
}
