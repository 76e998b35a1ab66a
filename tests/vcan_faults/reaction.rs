//! The reaction to a fault, read from the drives' side of the bus.

use std::time::Duration;

use crate::common::log::{Entry, Log, NODES};
use crate::rig::{Onset, cycles};
use crate::torque::{self, CYCLE, Torque};

/// Largest target of any drive, in per mille of its rated torque: the end of every torque curve.
const MAX_TARGET: u16 = 867;

/// A controlword on the bus.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Controlword {
    pub(crate) nanos: u64,
    pub(crate) word: u16,
}

/// The frames on the drives' side since a fault.
pub(crate) struct Reaction {
    lines: Vec<String>,
    log: Log,
    torques: [Torque; 6],
    onset: u64,
}

impl Reaction {
    /// The frames of these lines, with a fault that began at `onset`.
    pub(crate) fn new(lines: Vec<String>, log: Log, onset: u64) -> Self {
        let torques = torque::of_all(log.entries());
        Self { lines, log, torques, onset }
    }

    /// Fails unless all drives with torque at the onset are torque-free within `most` for good, and there are such drives.
    #[track_caller]
    pub(crate) fn all_are_free_within(&self, most: Duration) {
        self.are_free_within(most, |_| true);
    }

    /// Fails unless some drives are torque-free within `most`.
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

    /// Returns the time until the last drive was torque-free.
    #[track_caller]
    pub(crate) fn last_is_free_after(&self) -> Duration {
        let pushing = NODES.filter(|node| self.pushed(*node));
        pushing.map(|node| self.torque(node).ends_after(self.onset).unwrap()).max().unwrap()
    }

    /// Fails unless all drives are torque-free within a cycle of each other.
    #[track_caller]
    pub(crate) fn are_free_together(&self) {
        let ends = NODES.map(|node| self.torque(node)).filter(|torque| torque.at(self.onset) != 0);
        let ends: Vec<Duration> =
            ends.map(|torque| torque.ends_after(self.onset).unwrap()).collect();
        let (first, last) = (ends.iter().min().unwrap(), ends.iter().max().unwrap());
        assert!(*last - *first <= CYCLE, "{ends:?}");
    }

    /// Returns the frames with the onset at the first one of this kind.
    #[track_caller]
    pub(crate) fn from(mut self, is_first: impl Fn(&Entry) -> bool) -> Self {
        let first = self.since().find(|entry| is_first(entry)).unwrap().nanos;
        self.onset = first;
        self
    }

    /// Returns the frames with the onset at the last SYNC.
    pub(crate) fn since_last_sync(mut self) -> Self {
        let last = self.log.entries().iter().rev().find(|entry| entry.id == 0x080);
        self.onset = last.unwrap().nanos;
        self
    }

    /// Fails unless the first controlword to every drive disables its voltage. One frame is sent a cycle behind the
    /// targets, a controlword or an SDO request.
    #[track_caller]
    pub(crate) fn all_are_switched_off(&self) {
        for node in NODES {
            let first = self
                .first_controlword(node)
                .unwrap_or_else(|| panic!("node {node}: no controlword"));
            let after = Duration::from_nanos(first.nanos - self.onset);
            assert!(
                first.word & 0x8F == 0 && after <= cycles(20),
                "node {node}: {first:?} {after:?}"
            );
        }
    }

    /// Returns the first controlword to a node since the fault: by RPDO 2 or by SDO.
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

    /// Fails unless the first targets since `resumed` are zero, and no two SYNCs are closer than half a period.
    #[track_caller]
    pub(crate) fn goes_on_without_a_burst(&self, Onset(resumed): Onset) {
        let since = || self.since().filter(|entry| entry.nanos >= resumed);
        let first = since().find(|entry| matches!(entry.id, 0x201 | 0x204));
        assert!(first.is_none_or(|entry| entry.data == [0; 6]), "{first:?}");
        let syncs: Vec<u64> =
            since().filter(|entry| entry.id == 0x080).map(|entry| entry.nanos).collect();
        for pair in syncs.windows(2) {
            let apart = Duration::from_nanos(pair[1] - pair[0]);
            assert!(apart >= CYCLE / 2, "SYNCs {apart:?} apart at {}", pair[0]);
        }
    }

    /// Fails if a target exceeds its joint's capacity.
    #[track_caller]
    pub(crate) fn targets_are_within_bounds(&self) {
        for node in NODES {
            let most = self.torque(node).most();
            assert!(most <= MAX_TARGET, "node {node}: target {most} per mille");
        }
    }

    /// Returns whether a drive had torque at the onset.
    pub(crate) fn pushed(&self, node: u16) -> bool {
        self.torque(node).at(self.onset) != 0
    }

    pub(crate) const fn onset(&self) -> u64 {
        self.onset
    }

    pub(crate) fn torque(&self, node: u16) -> &Torque {
        &self.torques[usize::from(node) - 1]
    }

    /// Returns every frame since the fault.
    pub(crate) fn since(&self) -> impl Iterator<Item = &Entry> {
        self.log.entries().iter().filter(|entry| entry.nanos >= self.onset)
    }

    /// Returns the complete log.
    pub(crate) fn log(&self) -> &Log {
        &self.log
    }
}
