//! Processes that are killed at the end of a test.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;
use std::{fs, thread};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use canopen_tools::candump::{Content, Line};

/// A running process.
pub(crate) struct Process(Child);

/// Exit code and stderr of a process.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) code: Option<i32>,
    pub(crate) stderr: String,
}

impl Process {
    pub(crate) fn start(program: &str, args: &[&str]) -> Self {
        Self::spawn(Command::new(program).args(args))
    }

    /// Starts Python with the packages of the tests and that of `python/`.
    pub(crate) fn python(args: &[&str]) -> Self {
        let mut command = Command::new("target/interop/venv/bin/python");
        Self::spawn(command.arg("-B").args(args).env("PYTHONPATH", "python"))
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

    /// Sends a signal by its number: real-time signals have no name in `nix`.
    pub(crate) fn signal_number(&self, number: u8) {
        Self::start("sh", &["-c", &format!("kill -{number} {}", self.0.id())]).wait().succeeds();
    }

    pub(crate) fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(self.0.id().try_into().unwrap()), signal).unwrap();
    }

    /// Limits the address space of the process (RLIMIT_AS) to its present size.
    pub(crate) fn limit_address_space(&self) {
        let limit = format!(
            "read -r pages rest </proc/{0}/statm; prlimit --pid {0} --as=$((pages * $(getconf PAGESIZE)))",
            self.0.id()
        );
        Self::start("sh", &["-c", &limit]).wait().succeeds();
    }

    /// Returns the inodes of its sockets (proc_pid_fd(5)).
    pub(crate) fn sockets(&self) -> Vec<String> {
        let links = fs::read_dir(format!("/proc/{}/fd", self.0.id())).unwrap();
        let targets = links.map(|link| fs::read_link(link.unwrap().path()).unwrap());
        let names: Vec<String> = targets.map(|to| to.to_str().unwrap().to_owned()).collect();
        let inode =
            |name: &String| Some(name.strip_prefix("socket:[")?.strip_suffix(']')?.to_owned());
        names.iter().filter_map(inode).collect()
    }

    /// Returns the state of the main thread; `Z` after its end (proc_pid_stat(5)).
    pub(crate) fn state_of_main_thread(&self) -> char {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.0.id())).unwrap();
        stat.rsplit_once(") ").unwrap().1.chars().next().unwrap()
    }

    /// Returns a size in /proc/PID/status, in kB.
    pub(crate) fn memory_kb(&self, name: &str) -> u64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.0.id())).unwrap();
        let of = |line: &str| {
            line.strip_prefix(name)?.strip_prefix(':')?.trim().split(' ').next()?.parse().ok()
        };
        status.lines().find_map(of).unwrap()
    }

    /// Returns the page faults of each of its threads so far, by name (proc_pid_stat(5)).
    pub(crate) fn page_faults(&self) -> BTreeMap<String, u64> {
        let threads = fs::read_dir(format!("/proc/{}/task", self.0.id())).unwrap();
        let counted = threads.map(|thread| {
            let stat = fs::read_to_string(thread.unwrap().path().join("stat")).unwrap();
            let (name, rest) = stat.split_once('(').unwrap().1.rsplit_once(") ").unwrap();
            let fields: Vec<_> = rest.split(' ').collect();
            // Minor and major ones: fields 10 and 12; `rest` begins with field 3.
            let faults = [7, 9].map(|field: usize| fields[field].parse::<u64>().unwrap());
            (name.to_owned(), faults.iter().sum())
        });
        counted.collect()
    }

    /// Returns the outcome, or `None` while the process runs.
    pub(crate) fn ended(&mut self) -> Option<Outcome> {
        let status = self.0.try_wait().unwrap()?;
        Some(Outcome { code: status.code(), stderr: self.read_stderr() })
    }

    pub(crate) fn wait(mut self) -> Outcome {
        let stderr = self.read_stderr();
        Outcome { code: self.0.wait().unwrap().code(), stderr }
    }

    /// Reads stderr until the process ends.
    fn read_stderr(&mut self) -> String {
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

/// candump of can-utils on one interface: it records the frames, and its time stamps are the clock.
pub(crate) struct Candump {
    interface: String,
    child: Child,
    /// Read at once by a thread: a full pipe would block candump, which would then lose frames.
    lines: Receiver<String>,
    seen: Vec<String>,
}

impl Candump {
    /// Starts candump, and returns when it has received a first frame.
    pub(crate) fn start(interface: &str) -> Self {
        let mut child = Command::new("candump")
            .args(["-L", "-d", "-r", "8000000", interface]) // reports lost frames, in lines that are no log lines
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        let (taken, lines) = channel();
        // Until candump ends or its lines are dropped.
        thread::spawn(move || {
            stdout.lines().map_while(Result::ok).try_for_each(|it| taken.send(it))
        });
        let mut candump = Self { interface: interface.to_owned(), child, lines, seen: Vec::new() };
        // candump does not report that it is ready: send marks until one is received.
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

    /// Sends a mark and reads up to it; returns the time on the bus.
    pub(crate) fn mark(&mut self) -> Stamp {
        let last = format!("{MARK}#FF");
        Process::start("cansend", &[&self.interface, &last]).wait().succeeds();
        self.until(|line| {
            is_mark(line) && matches!(&line.content, Content::Data(data) if data == &[0xFF])
        })
    }

    /// Reads up to the first wanted line. Fails on a silent bus.
    pub(crate) fn until(&mut self, is_wanted: impl Fn(&Line<'_>) -> bool) -> Stamp {
        let stamp = self.until_silent(is_wanted);
        stamp.unwrap_or_else(|| panic!("{} is silent, or candump has ended", self.interface))
    }

    /// Reads up to the first wanted line; `None` on a silent bus.
    pub(crate) fn until_silent(&mut self, is_wanted: impl Fn(&Line<'_>) -> bool) -> Option<Stamp> {
        loop {
            let text = self.lines.recv_timeout(SILENCE_TIMEOUT).ok()?;
            let line = Line::parse(&text).unwrap_or_else(|error| panic!("{text}: {error}"));
            let (wanted, nanos) = (is_wanted(&line), line.nanos);
            self.seen.push(text);
            if wanted {
                return Some(Stamp { nanos });
            }
        }
    }

    /// Returns the time stamp of the last line read, in ns.
    pub(crate) fn last_nanos(&self) -> u64 {
        Line::parse(self.seen.last().unwrap()).unwrap().nanos
    }

    /// Returns all lines, without the marks.
    pub(crate) fn finish(mut self) -> Vec<String> {
        self.mark();
        let mark = format!(" {MARK}#");
        std::mem::take(&mut self.seen).into_iter().filter(|line| !line.contains(&mark)).collect()
    }
}

/// Maximum time without a line before the bus counts as silent.
const SILENCE_TIMEOUT: Duration = Duration::from_secs(60);

/// Time stamp of a line.
pub(crate) struct Stamp {
    pub(crate) nanos: u64,
}

/// Identifier of marks; no node uses it.
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

/// Folder of one test, in memory, removed at its end; the test's programs run with it.
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

    /// Writes a variant of a configuration; each replaced text must be in it. Returns its path.
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

    /// Starts frhc with this stderr.
    pub(crate) fn frhc_onto(&self, args: &[&str], stderr: impl Into<Stdio>) -> Process {
        let mut command = Command::new(crate::common::program());
        Process::spawn_onto(self.at_home(command.args(args)), stderr.into())
    }

    /// Starts frhc behind a command of the shell, such as `ulimit -f 100`, with signals as a service manager leaves them.
    pub(crate) fn frhc_under(&self, limit: &str, args: &[&str]) -> Process {
        let mut command = Command::new("sh");
        // Forks: a child of glibc's posix_spawn ignores signal 32.
        command.uid(nix::unistd::getuid().as_raw());
        command.args(["-c", &format!("{limit}; exec \"$0\" \"$@\""), crate::common::program()]);
        Process::spawn(self.at_home(command.args(args)))
    }

    /// Starts frhc; returns it with its stdout.
    pub(crate) fn frhc_and_stdout(&self, args: &[&str]) -> (Process, BufReader<ChildStdout>) {
        let mut command = Command::new(crate::common::program());
        let command = self.at_home(command.args(args));
        let command = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        (Process(child), stdout)
    }

    /// Places socket and state of a command in this folder.
    pub(crate) fn at_home<'c>(&self, command: &'c mut Command) -> &'c mut Command {
        command
            .env("XDG_RUNTIME_DIR", &self.0)
            .env("STATE_DIRECTORY", self.0.join("state"))
            .env_remove("RUNTIME_DIRECTORY")
    }

    /// Runs `frhc ctl`; returns exit code, and standard output and error.
    pub(crate) fn ctl_and_text(&self, request: &str) -> (i32, String) {
        let words: Vec<&str> = std::iter::once("ctl").chain(request.split(' ')).collect();
        let (process, mut stdout) = self.frhc_and_stdout(&words);
        let mut text = String::new();
        stdout.read_to_string(&mut text).unwrap();
        let outcome = process.wait();
        (outcome.code.unwrap(), format!("{text}{}", outcome.stderr))
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
