//! A node and its drives, each a process, and candump on the drives' side: what every test begins with,
//! and how it reads what came of it.

use std::os::unix::net::UnixStream;
use std::time::Duration;

use crate::common::log::Entry;
use crate::common::log::Log;
use crate::common::process::Candump;
use crate::common::process::Outcome;
use crate::common::process::Process;
use crate::common::process::Scratch;
use crate::gateway::DRIVES;
use crate::gateway::NODE;
use crate::script;
use crate::torque;
use crate::torque::CYCLE;
use crate::torque::Torque;

const CONFIG: &str = "config/kraft_like.toml";

/// So many drives, in node-ids.
pub(crate) const NODES: std::ops::RangeInclusive<u16> = 1..=6;

/// What any drive may be told at most, in per mille of its rated torque: every torque curve ends there.
const MOST: u16 = 867;

/// Torque comes on within this, with the ramps of [`RAMPS`].
const RAMPED: Duration = Duration::from_millis(80);

/// Ramps as short as they may be: a test's time is its cost.
const RAMPS: [(&str, &str); 3] = [
    ("gravity_ramp_s = 1.0", "gravity_ramp_s = 0.05"),
    ("reflection_ramp_s = 0.3", "reflection_ramp_s = 0.05"),
    ("ramp_s = 0.3  ", "ramp_s = 0.05 "),
];

/// What is other than in [`CONFIG`].
#[derive(Clone, Debug)]
pub(crate) struct Setup {
    /// The node's interface.
    pub(crate) node: &'static str,
    pub(crate) script: String,
    pub(crate) changes: Vec<(&'static str, &'static str)>,
}

impl Default for Setup {
    fn default() -> Self {
        Self { node: NODE, script: script::rhythm(), changes: Vec::new() }
    }
}

/// Node, drives and witness.
pub(crate) struct Rig {
    pub(crate) node: Option<Process>,
    drives: Process,
    pub(crate) witness: Candump,
    on: &'static str,
    config: String,
    scratch: Scratch,
    random: u64,
}

impl Rig {
    /// Engaged, with torque on.
    pub(crate) fn engaged(name: &str, setup: &Setup) -> Self {
        let mut rig = Self::started(name, setup);
        rig.arm();
        rig.engage();
        rig
    }

    /// Both processes run; the node boots.
    pub(crate) fn started(name: &str, setup: &Setup) -> Self {
        let scratch = Scratch::new(name);
        let changes: Vec<_> = RAMPS.into_iter().chain(setup.changes.iter().copied()).collect();
        let config = scratch.variant(CONFIG, &changes);
        let script = scratch.write("script.toml", &setup.script);
        let mut witness = Candump::of(DRIVES);
        let words = ["sim", "--config", &config, "-i", DRIVES, "--scenario", &script];
        let drives = scratch.frhc(&words);
        witness.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x706));
        let random = name.bytes().fold(0xCBF2_9CE4_8422_2325, |hash: u64, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
        });
        let mut rig = Self { node: None, drives, witness, on: setup.node, config, scratch, random };
        rig.start_node();
        rig
    }

    /// Starts the node, again.
    pub(crate) fn start_node(&mut self) {
        self.node = Some(self.scratch.frhc(&["run", "--config", &self.config, "-i", self.on]));
    }

    /// Asks for arming until it is granted: a node whose deadman is closed refuses.
    fn arm(&mut self) {
        for _ in 0..100 {
            if self.ctl("--wait arm").code == Some(0) {
                return;
            }
            self.run_for(Duration::from_millis(20));
        }
        let refusal = self.ctl("arm").stderr;
        panic!("it cannot be armed: {refusal}{}", self.node.take().unwrap().terminate().stderr);
    }

    /// Asks the node.
    pub(crate) fn ctl(&self, request: &str) -> Outcome {
        self.scratch.ctl(request)
    }

    /// A connection to the node's control socket.
    pub(crate) fn client(&self) -> UnixStream {
        UnixStream::connect(self.scratch.path("frhc/node.sock")).unwrap()
    }

    /// Waits until the deadman closes from now on, and until what is felt then has come on.
    fn engage(&mut self) {
        self.now();
        let is = |wanted: u8| {
            move |line: &frhc::telemetry::candump::Line<'_>| {
                line.canopen().is_some_and(|(id, data)| id == 0x190 && data[0] & 3 == wanted)
            }
        };
        self.witness.until(is(2));
        self.witness.until(is(1));
        self.run_for(RAMPED);
    }

    /// The data of the next frame with this identifier on the drives' side.
    pub(crate) fn next(&mut self, wanted: u16) -> Vec<u8> {
        let next = std::cell::RefCell::default();
        self.witness.until(|line| {
            let data =
                line.canopen().filter(|(id, _)| *id == wanted).map(|(_, data)| data.to_vec());
            data.map(|data| next.replace(data)).is_some()
        });
        next.into_inner()
    }

    /// The deadman opens: when its word is on the bus.
    pub(crate) fn released(&mut self) -> Onset {
        let opened = self
            .witness
            .until(|line| line.canopen().is_some_and(|(id, data)| id == 0x190 && data[0] & 3 != 1));
        Onset(opened.nanos)
    }

    /// What time it is on the bus.
    pub(crate) fn now(&mut self) -> Onset {
        Onset(self.witness.mark().nanos)
    }

    /// Lets the bus run on.
    pub(crate) fn run_for(&mut self, span: Duration) {
        let until = self.witness.mark().nanos + nanos(span);
        self.witness.until(|line| line.nanos > until);
    }

    /// A moment somewhere in a cycle: in virtual time a sleep ends when it should.
    pub(crate) fn onset(&mut self) -> Onset {
        self.witness.until(|line| line.canopen().is_some_and(|(id, _)| id == 0x080));
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        std::thread::sleep(Duration::from_micros(self.random % 1_000));
        Onset(self.witness.mark().nanos)
    }

    /// The node is no more.
    pub(crate) fn kill_node(&mut self) {
        self.node.take().unwrap().kill();
    }

    /// Ends the node in order, and says how long it took on the bus.
    pub(crate) fn terminate_node(&mut self) -> (Outcome, Duration) {
        let before = self.witness.mark().nanos;
        let outcome = self.node.take().unwrap().terminate();
        let after = self.witness.mark().nanos;
        (outcome, Duration::from_nanos(after - before))
    }

    /// What the node says of itself, as `frhc ctl status --json` prints it.
    pub(crate) fn status(&self) -> serde_json::Value {
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

    /// Fails unless the node has stopped and says why.
    #[track_caller]
    pub(crate) fn is_stopped_by(&self, reason: &str) {
        let status = self.status();
        let cause = status["status"]["stopped_by"].as_str().unwrap_or("nothing");
        assert!(cause.contains(reason), "stopped by {cause}, not by {reason}; {}", status["mode"]);
    }

    /// Fails unless the node has stopped, for whatever it noticed first.
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
    pub(crate) fn seen_after(mut self, Onset(onset): Onset, span: Duration) -> Seen {
        let until = onset + nanos(span);
        self.witness.until(|line| line.nanos > until);
        drop(self.node.take());
        drop(self.drives);
        let lines = self.witness.finish();
        let log = Log::parse(&lines);
        let torques = torque::of_all(log.entries());
        Seen { lines, log, torques, onset }
    }
}

/// A controlword on the bus.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Controlword {
    pub(crate) nanos: u64,
    pub(crate) word: u16,
}

/// When a fault began: a mark on the bus just before it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Onset(pub(crate) u64);

/// What a fault came to, on the drives' side.
pub(crate) struct Seen {
    lines: Vec<String>,
    log: Log,
    torques: [Torque; 6],
    onset: u64,
}

impl Seen {
    /// Drives that push when the fault begins are torque-free within `most`, all together, for good; and
    /// there are such drives in both groups.
    #[track_caller]
    pub(crate) fn all_are_free_within(&self, most: Duration) {
        self.are_free_within(most, |_| true);
    }

    /// The same of some drives.
    #[track_caller]
    pub(crate) fn are_free_within(&self, most: Duration, is_of: impl Fn(u16) -> bool) {
        let pushing: Vec<u16> =
            NODES.filter(|node| is_of(*node) && self.torque(*node).at(self.onset) != 0).collect();
        assert!(!pushing.is_empty(), "no drive pushed");
        for node in NODES.filter(|node| is_of(*node)) {
            let ends = self.torque(node).ends_after(self.onset);
            let is_free = ends.is_some_and(|ends| ends <= most);
            if !is_free {
                let file =
                    format!("{}/vcan_faults_{}.log", env!("CARGO_TARGET_TMPDIR"), self.onset);
                std::fs::write(&file, self.lines.join("\n")).unwrap();
                panic!("node {node} is free after {ends:?}, not within {most:?} of {}", self.onset);
            }
        }
    }

    /// How long the last drive pushed that did when the fault began; they are all free.
    #[track_caller]
    pub(crate) fn last_is_free_after(&self) -> Duration {
        let pushing = NODES.filter(|node| self.pushed(*node));
        pushing.map(|node| self.torque(node).ends_after(self.onset).unwrap()).max().unwrap()
    }

    /// From the first drive that is torque-free to the last, no longer than a cycle.
    #[track_caller]
    pub(crate) fn are_free_together(&self) {
        let ends = NODES.map(|node| self.torque(node)).filter(|torque| torque.at(self.onset) != 0);
        let ends: Vec<Duration> =
            ends.map(|torque| torque.ends_after(self.onset).unwrap()).collect();
        let (first, last) = (ends.iter().min().unwrap(), ends.iter().max().unwrap());
        assert!(*last - *first <= CYCLE, "{ends:?}");
    }

    /// Counted from the first frame of this kind since the fault.
    #[track_caller]
    pub(crate) fn from(mut self, is_first: impl Fn(&Entry) -> bool) -> Self {
        let first = self.since().find(|entry| is_first(entry)).unwrap().nanos;
        self.onset = first;
        self
    }

    /// Every drive is told to take its voltage off: its first controlword since the fault. One frame goes
    /// out a cycle behind the torques, a word or a request.
    #[track_caller]
    pub(crate) fn all_are_switched_off(&self) {
        for node in NODES {
            let first = self.first_controlword(node).unwrap_or_else(|| panic!("node {node}: none"));
            let after = Duration::from_nanos(first.nanos - self.onset);
            assert!(
                first.word & 0x8F == 0 && after <= cycles(20),
                "node {node}: {first:?} {after:?}"
            );
        }
    }

    /// The first controlword to a node since the fault: by RPDO 2 or by SDO.
    pub(crate) fn first_controlword(&self, node: u16) -> Option<Controlword> {
        self.since().find_map(|entry| {
            let word = match (entry.id, entry.data.as_slice()) {
                (id, &[low, high]) if id == 0x300 + node => [low, high],
                (id, &[0x2B, 0x40, 0x60, 0, low, high, ..]) if id == 0x600 + node => [low, high],
                _ => return None,
            };
            Some(Controlword { nanos: entry.nanos, word: u16::from_le_bytes(word) })
        })
    }

    /// The first torques since `resumed` are zero, and from then on no two SYNCs are closer than half a
    /// period, and none within so many that those missed are made up for.
    #[track_caller]
    pub(crate) fn goes_on_without_a_burst(&self, Onset(resumed): Onset) {
        let since = || self.since().filter(|entry| entry.nanos >= resumed);
        let told = since().find(|entry| matches!(entry.id, 0x201 | 0x204));
        assert!(told.is_none_or(|entry| entry.data == [0; 6]), "{told:?}");
        let syncs: Vec<u64> =
            since().filter(|entry| entry.id == 0x080).map(|entry| entry.nanos).collect();
        for pair in syncs.windows(2) {
            let apart = Duration::from_nanos(pair[1] - pair[0]);
            assert!(apart >= CYCLE / 2, "SYNCs {apart:?} apart at {}", pair[0]);
        }
    }

    /// No drive is ever told more than its joint may have.
    #[track_caller]
    pub(crate) fn told_within_bounds(&self) {
        for node in NODES {
            let most = self.torque(node).most();
            assert!(most <= MOST, "node {node} was told {most} per mille");
        }
    }

    /// Whether a drive pushed when the fault began.
    pub(crate) fn pushed(&self, node: u16) -> bool {
        self.torque(node).at(self.onset) != 0
    }

    pub(crate) const fn onset(&self) -> u64 {
        self.onset
    }

    pub(crate) fn torque(&self, node: u16) -> &Torque {
        &self.torques[usize::from(node) - 1]
    }

    /// Every frame since the fault.
    pub(crate) fn since(&self) -> impl Iterator<Item = &Entry> {
        self.log.entries().iter().filter(|entry| entry.nanos >= self.onset)
    }

    /// The whole log.
    pub(crate) fn log(&self) -> &Log {
        &self.log
    }
}

pub(crate) fn nanos(span: Duration) -> u64 {
    u64::try_from(span.as_nanos()).unwrap()
}

/// So many periods.
pub(crate) fn cycles(count: u32) -> Duration {
    CYCLE * count
}

pub(crate) const fn millis(count: u64) -> Duration {
    Duration::from_millis(count)
}
