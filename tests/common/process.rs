//! Real processes, killed when a test ends, however it ends.

use std::fs;
use std::io::BufRead;
use std::io::BufReader;
use std::io::Read;
use std::path::Path;
use std::path::PathBuf;
use std::process::Child;
use std::process::ChildStdout;
use std::process::Command;
use std::process::Stdio;
use std::sync::mpsc::Receiver;
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use nix::sys::signal::Signal;
use nix::sys::signal::kill;
use nix::unistd::Pid;

use bus::candump::Content;
use bus::candump::Line;

/// A running process.
pub(crate) struct Process(Child);

/// How a process ended.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) code: Option<i32>,
    pub(crate) stderr: String,
}

impl Process {
    pub(crate) fn of(program: &str, args: &[&str]) -> Self {
        Self::spawn(Command::new(program).args(args))
    }

    fn spawn(command: &mut Command) -> Self {
        Self::spawn_onto(command, Stdio::piped())
    }

    fn spawn_onto(command: &mut Command, stderr: Stdio) -> Self {
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr);
        Self(command.spawn().unwrap())
    }

    pub(crate) fn terminate(self) -> Outcome {
        self.signal(Signal::SIGTERM);
        self.wait()
    }

    pub(crate) fn kill(self) {
        self.signal(Signal::SIGKILL);
        self.wait();
    }

    /// A signal by its number: those of real time have no name.
    pub(crate) fn signal_number(&self, number: u8) {
        Self::of("sh", &["-c", &format!("kill -{number} {}", self.0.id())]).wait().succeeds();
    }

    pub(crate) fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(self.0.id().try_into().unwrap()), signal).unwrap();
    }

    /// How it ended, if it has.
    pub(crate) fn ended(&mut self) -> Option<Outcome> {
        let status = self.0.try_wait().unwrap()?;
        Some(Outcome { code: status.code(), stderr: self.last_words() })
    }

    pub(crate) fn wait(mut self) -> Outcome {
        let stderr = self.last_words();
        Outcome { code: self.0.wait().unwrap().code(), stderr }
    }

    /// What it says on stderr until it ends.
    fn last_words(&mut self) -> String {
        let mut stderr = String::new();
        if let Some(mut pipe) = self.0.stderr.take() {
            pipe.read_to_string(&mut stderr).unwrap();
        }
        stderr
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if matches!(self.0.try_wait(), Ok(None)) {
            self.0.kill().unwrap();
            self.0.wait().unwrap();
        }
    }
}

impl Outcome {
    #[track_caller]
    pub(crate) fn succeeds(&self) {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
    }
}

/// can-utils' candump on one interface: the witness, and the clock.
pub(crate) struct Candump {
    interface: String,
    child: Child,
    /// Taken from it at once, whatever the test does: a pipe that is full would stop it, and it loses frames.
    lines: Receiver<String>,
    seen: Vec<String>,
}

impl Candump {
    /// Listens, and has heard its own first frame when it returns.
    pub(crate) fn of(interface: &str) -> Self {
        let mut child = Command::new("candump")
            .args(["-L", "-d", "-r", "8000000", interface]) // one that misses frames says so: no line of a log
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        let (taken, lines) = channel();
        // Until one of the two is gone.
        thread::spawn(move || {
            stdout.lines().map_while(Result::ok).try_for_each(|it| taken.send(it))
        });
        let mut candump = Self { interface: interface.to_owned(), child, lines, seen: Vec::new() };
        // It says nothing when it is ready, so it is spoken to until it is: by marks on the way of
        // every later frame.
        let mut hello = Process::spawn(
            Command::new("cangen").args([interface, "-g", "1", "-I", MARK, "-L", "0"]),
        );
        candump.until(is_mark);
        hello.0.kill().unwrap();
        drop(hello);
        candump.mark();
        candump.seen.clear();
        candump
    }

    /// Sends a mark and reads up to it: what time it is on the bus.
    pub(crate) fn mark(&mut self) -> Stamp {
        let last = format!("{MARK}#FF");
        Process::of("cansend", &[&self.interface, &last]).wait().succeeds();
        self.until(|line| {
            is_mark(line) && matches!(&line.content, Content::Data(data) if data == &[0xFF])
        })
    }

    /// Reads up to the first line that is wanted. Fails on a bus that falls silent.
    pub(crate) fn until(&mut self, is_wanted: impl Fn(&Line<'_>) -> bool) -> Stamp {
        let stamp = self.until_silent(is_wanted);
        stamp.unwrap_or_else(|| panic!("{} is silent, or candump has ended", self.interface))
    }

    /// The same; `None` on a bus that falls silent.
    pub(crate) fn until_silent(&mut self, is_wanted: impl Fn(&Line<'_>) -> bool) -> Option<Stamp> {
        loop {
            let text = self.lines.recv_timeout(SILENCE).ok()?;
            let line = Line::parse(&text).unwrap_or_else(|error| panic!("{text}: {error}"));
            let (wanted, nanos) = (is_wanted(&line), line.nanos);
            self.seen.push(text);
            if wanted {
                return Some(Stamp { nanos });
            }
        }
    }

    /// The stamp of the last line read.
    pub(crate) fn last_nanos(&self) -> u64 {
        Line::parse(self.seen.last().unwrap()).unwrap().nanos
    }

    /// Every line since the beginning, without the marks.
    pub(crate) fn finish(mut self) -> Vec<String> {
        self.mark();
        let mark = format!(" {MARK}#");
        std::mem::take(&mut self.seen).into_iter().filter(|line| !line.contains(&mark)).collect()
    }
}

/// Time without a line in which somebody should have sent.
const SILENCE: Duration = Duration::from_secs(60);

/// When a line was stamped.
pub(crate) struct Stamp {
    pub(crate) nanos: u64,
}

/// An identifier nobody uses.
const MARK: &str = "7FF";

fn is_mark(line: &Line<'_>) -> bool {
    line.canopen().is_some_and(|(id, _)| id == 0x7FF)
}

impl Drop for Candump {
    fn drop(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

/// A folder of one test, in memory, gone when it ends; and the programs run with it.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    pub(crate) fn new(name: &str) -> Self {
        let path = Path::new("/dev/shm").join(format!("frhc-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        let scratch = Self(path);
        for eds in ["eds/frhc_drive.eds", "eds/frhc_switches.eds"] {
            scratch.write(eds, &fs::read_to_string(eds).unwrap());
        }
        scratch
    }

    pub(crate) fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    pub(crate) fn write(&self, name: &str, text: &str) -> String {
        let path = self.0.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
        self.path(name)
    }

    /// A configuration with some lines changed, each of which must be there.
    pub(crate) fn variant(&self, file: &str, changes: &[(&str, &str)]) -> String {
        let mut text = fs::read_to_string(file).unwrap();
        for (from, to) in changes {
            assert!(text.contains(from), "{file} has no line {from}");
            text = text.replace(from, to);
        }
        self.write("config/variant.toml", &text)
    }

    pub(crate) fn frhc(&self, args: &[&str]) -> Process {
        self.frhc_onto(args, Stdio::piped())
    }

    /// The same, with what it says to people going there.
    pub(crate) fn frhc_onto(&self, args: &[&str], stderr: impl Into<Stdio>) -> Process {
        let mut command = Command::new(crate::common::program());
        Process::spawn_onto(self.at_home(command.args(args)), stderr.into())
    }

    /// The same, under a limit of the shell's, such as `ulimit -f 100`.
    pub(crate) fn frhc_under(&self, limit: &str, args: &[&str]) -> Process {
        let mut command = Command::new("sh");
        command.args(["-c", &format!("{limit}; exec \"$0\" \"$@\""), crate::common::program()]);
        Process::spawn(self.at_home(command.args(args)))
    }

    /// The same, with what it prints.
    pub(crate) fn frhc_and_stdout(&self, args: &[&str]) -> (Process, BufReader<ChildStdout>) {
        let mut command = Command::new(crate::common::program());
        let command = self.at_home(command.args(args));
        let command = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        (Process(child), stdout)
    }

    /// With its socket and its state in this folder.
    fn at_home<'c>(&self, command: &'c mut Command) -> &'c mut Command {
        command
            .env("XDG_RUNTIME_DIR", &self.0)
            .env("XDG_STATE_HOME", self.0.join("state"))
            .env_remove("RUNTIME_DIRECTORY")
            .env_remove("STATE_DIRECTORY")
    }

    pub(crate) fn ctl(&self, request: &str) -> Outcome {
        let words: Vec<&str> = std::iter::once("ctl").chain(request.split(' ')).collect();
        self.frhc(&words).wait()
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).unwrap();
    }
}
