//! A node and its drives, each a process, and candump on the drives' side: the start of every test.

use std::cell::Cell;
use std::os::unix::net::UnixStream;

use nix::sys::signal::Signal;

use crate::common::log::Log;
use crate::common::prelude::*;
use crate::common::process::Outcome;
use crate::gateway::{DRIVES, Gateway, NODE};
use crate::reaction::Reaction;
use crate::script;
use crate::torque::CYCLE;
use canopen_tools::candump::Line;
use sim::scenario::Entry;

/// Time in which torque has ramped up, with the ramps of [`RAMPS`].
const RAMP_TIME: Duration = Duration::from_millis(80);

/// Shortest valid ramps, to keep tests short.
const RAMPS: [(&str, &str); 3] = [
    ("gravity_ramp_s = 1.0", "gravity_ramp_s = 0.05"),
    ("reflection_ramp_s = 0.3", "reflection_ramp_s = 0.05"),
    ("ramp_s = 0.3  ", "ramp_s = 0.05 "),
];

/// Differences from [`KRAFT`].
#[derive(Clone, Debug)]
pub(crate) struct Setup {
    /// The node's interface.
    pub(crate) node: &'static str,
    /// Entries of the drives' scenario.
    pub(crate) entries: Vec<Entry>,
    pub(crate) changes: Vec<(&'static str, &'static str)>,
    /// Command of the shell before the node starts, such as a `ulimit`.
    pub(crate) shell: &'static str,
}

impl Default for Setup {
    fn default() -> Self {
        Self { node: NODE, entries: script::rhythm(), changes: Vec::new(), shell: "true" }
    }
}

/// Node, drives and candump.
pub(crate) struct Rig {
    pub(crate) node: Option<Process>,
    drives: Process,
    pub(crate) candump: Candump,
    on: &'static str,
    shell: &'static str,
    config: String,
    scratch: Scratch,
    random: u64,
}

impl Rig {
    /// A node that is engaged, with torque on.
    pub(crate) fn engaged(name: &str, setup: &Setup) -> Self {
        let mut rig = Self::started(name, setup);
        rig.arm();
        rig.engage();
        rig
    }

    /// A node that boots, with its drives.
    pub(crate) fn started(name: &str, setup: &Setup) -> Self {
        let scratch = Scratch::new(name);
        let changes: Vec<_> = RAMPS.into_iter().chain(setup.changes.iter().copied()).collect();
        let config = scratch.variant(KRAFT, &changes);
        let scenario = script::scenario(setup.entries.clone());
        let script = scratch.write("script.toml", &scenario);
        let candump = Candump::start(DRIVES);
        let words = ["sim", "--config", &config, "-i", DRIVES, "--scenario", &script];
        let drives = scratch.frhc(&words);
        let random = name.bytes().fold(0xCBF2_9CE4_8422_2325, |hash: u64, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
        });
        let mut rig = Self {
            node: None,
            drives,
            candump,
            on: setup.node,
            shell: setup.shell,
            config,
            scratch,
            random,
        };
        rig.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
        rig.start_node();
        rig
    }

    /// Starts the node, again.
    pub(crate) fn start_node(&mut self) {
        let words = ["run", "--config", &self.config, "-i", self.on];
        self.node = Some(self.scratch.frhc_under(self.shell, &words));
    }

    /// Requests arming until it is granted: a node whose deadman is closed refuses.
    fn arm(&mut self) {
        for _ in 0..100 {
            if self.ctl("--wait=2 arm").code == Some(0) {
                return;
            }
            self.all_run();
            self.run_for(Duration::from_millis(20));
        }
        let refusal = self.ctl("arm").stderr;
        panic!("it cannot be armed: {refusal}{}", self.node.take().unwrap().terminate().stderr);
    }

    /// Waits until the node exits by itself, and returns its outcome.
    pub(crate) fn until_node_ends(&mut self) -> Outcome {
        let mut node = self.node.take().unwrap();
        for _ in 0..200 {
            if let Some(outcome) = node.ended() {
                return outcome;
            }
            self.run_for(millis(5));
        }
        panic!("the node has not ended: {}", node.terminate().stderr);
    }

    /// Makes a request to the node's console.
    pub(crate) fn ctl(&self, request: &str) -> Outcome {
        self.scratch.ctl(request)
    }

    /// A connection to the node's control socket.
    pub(crate) fn client(&self) -> UnixStream {
        UnixStream::connect(self.socket()).unwrap()
    }

    /// Path of the node's control socket.
    pub(crate) fn socket(&self) -> String {
        self.scratch.path("frhc/node.sock")
    }

    /// Waits until the deadman closes, and until reflection has ramped up.
    fn engage(&mut self) {
        self.now();
        let is = |wanted: u8| {
            move |line: &Line<'_>| {
                line.canopen().is_some_and(|(id, data)| id == 0x190 && data[0] & 3 == wanted)
            }
        };
        self.until(is(2));
        self.until(is(1));
        self.run_for(RAMP_TIME);
    }

    /// Returns the data of the next frame with this COB-ID on the drives' side.
    pub(crate) fn next(&mut self, wanted: u16) -> Vec<u8> {
        let next = std::cell::RefCell::default();
        self.until(|line| {
            let data =
                line.canopen().filter(|(id, _)| *id == wanted).map(|(_, data)| data.to_vec());
            data.map(|data| next.replace(data)).is_some()
        });
        next.into_inner()
    }

    /// Returns the time at which the open deadman is on the bus.
    pub(crate) fn released(&mut self) -> Onset {
        self.until(|line| line.canopen().is_some_and(|(id, data)| id == 0x190 && data[0] & 3 != 1))
    }

    /// Reads up to the first line that is wanted, while all run.
    pub(crate) fn until(&mut self, is_wanted: impl Fn(&Line<'_>) -> bool) -> Onset {
        let is_found = Cell::new(false);
        loop {
            let stamp = self.candump.until_silent(|line| {
                is_found.set(is_wanted(line));
                is_found.get() || line.canopen().is_some_and(|(id, _)| id & 0x780 == 0x700)
            });
            if let Some(stamp) = stamp.as_ref().filter(|_| is_found.get()) {
                return Onset(stamp.nanos);
            }
            // A heartbeat of either side.
            self.all_run();
            assert!(stamp.is_some(), "{DRIVES} is silent");
        }
    }

    /// Fails if node or drives have ended by themselves.
    #[track_caller]
    fn all_run(&mut self) {
        let node = self.node.as_mut().map(|node| ("node", node));
        for (name, process) in node.into_iter().chain([("drives", &mut self.drives)]) {
            if let Some(Outcome { code, stderr }) = process.ended() {
                panic!("the {name} ended with {code:?}: {stderr}");
            }
        }
    }

    /// Returns the time on the bus.
    pub(crate) fn now(&mut self) -> Onset {
        Onset(self.candump.mark().nanos)
    }

    /// Lets the bus run on.
    pub(crate) fn run_for(&mut self, span: Duration) {
        let until = self.candump.mark().nanos + nanos(span);
        self.candump.until(|line| line.nanos > until);
    }

    /// Waits for a random phase of a cycle: in virtual time a sleep ends in time.
    pub(crate) fn onset(&mut self) -> Onset {
        self.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x080));
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        std::thread::sleep(Duration::from_micros(self.random % 1_000));
        Onset(self.candump.mark().nanos)
    }

    /// Ends the node by SIGKILL.
    pub(crate) fn kill_node(&mut self) {
        self.node.take().unwrap().kill();
    }

    /// Ends the node in order, and returns the time that it took on the bus.
    pub(crate) fn terminate_node(&mut self) -> (Outcome, Duration) {
        let before = self.candump.mark().nanos;
        let outcome = self.node.take().unwrap().terminate();
        let after = self.candump.mark().nanos;
        (outcome, Duration::from_nanos(after - before))
    }

    /// Returns the output of `frhc ctl status --json`.
    pub(crate) fn status(&self) -> Value {
        let (ctl, mut stdout) = self.scratch.frhc_and_stdout(&["ctl", "status", "--json"]);
        let mut text = String::new();
        std::io::Read::read_to_string(&mut stdout, &mut text).unwrap();
        ctl.wait().succeeds();
        serde_json::from_str(&text).unwrap()
    }

    /// Runs a bench tool on the node's interface.
    pub(crate) fn tool(&self, words: &str) -> Outcome {
        let args: Vec<&str> = words.split(' ').chain(["-i", self.on]).collect();
        self.scratch.frhc(&args).wait()
    }

    /// Fails unless the node has stopped for this reason.
    #[track_caller]
    pub(crate) fn is_stopped_by(&self, reason: &str) {
        let status = self.status();
        let cause = status["status"]["stopped_by"].as_str().unwrap_or("no cause");
        assert!(cause.contains(reason), "stopped by {cause}, not by {reason}; {}", status["mode"]);
    }

    /// Fails unless the node has stopped, for any reason.
    #[track_caller]
    pub(crate) fn is_stopped(&self) {
        let status = self.status();
        let mode = status["mode"].as_str();
        assert!(matches!(mode, Some("zero-torque" | "drives-off")), "{status}");
    }

    /// Fails unless the node is in this mode.
    #[track_caller]
    pub(crate) fn is(&self, mode: &str) {
        let status = self.status();
        assert_eq!(status["mode"], mode, "{}", status["status"]["stopped_by"]);
    }

    /// Lets the bus run on for `span` after the fault, and ends.
    pub(crate) fn seen_after(mut self, Onset(onset): Onset, span: Duration) -> Reaction {
        let until = onset + nanos(span);
        self.candump.until(|line| line.nanos > until);
        drop(self.node.take());
        drop(self.drives);
        let lines = self.candump.finish();
        let log = Log::parse(&lines);
        Reaction::new(lines, log, onset)
    }
}

/// Start of a fault: a mark on the bus just before it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Onset(pub(crate) u64);

pub(crate) fn nanos(span: Duration) -> u64 {
    u64::try_from(span.as_nanos()).unwrap()
}

/// Returns the duration of this many periods.
pub(crate) fn cycles(count: u32) -> Duration {
    CYCLE * count
}

pub(crate) const fn millis(count: u64) -> Duration {
    Duration::from_millis(count)
}

#[test]
#[should_panic(expected = "the node ended with Some(4): ")]
fn node_that_ends_before_it_is_armed_fails_at_once() {
    Rig::engaged("absent", &Setup { node: "vcan9", ..Setup::default() });
}

#[test]
#[should_panic(expected = "the node ended with None: ")]
fn node_that_ends_armed_fails_at_once() {
    let _gateway = Gateway::at(NODE);
    let mut rig = Rig::started("short", &Setup::default());
    rig.arm();
    rig.node.as_ref().unwrap().signal(Signal::SIGKILL);
    rig.engage();
}
