//! Invariants I1 to I13, and their violations.

use std::fmt;

use derive_more::Display;

use crate::monitor::sheet::Sheet;
use units::time::Instant;

/// Condition on the frames of all buses that holds at any time, with any fault.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[display("I{}", self.number())]
pub enum Invariant {
    /// I1: no target exceeds its joint's capacity.
    Cap,
    /// I2: no target exceeds its slew rate.
    Slew,
    /// I3: targets are zero unless armed, and carry the arm's weight alone while the deadman is open. The node engages
    /// only after the deadman's contacts have settled for 25 ms, open and then closed.
    Permitted,
    /// I4: targets are zero after a stop, until reset, deadman edge and arming.
    Latched,
    /// I5: every drive receives one target for each SYNC, in time.
    OncePerSync,
    /// I6: no node is started or enabled before its identity and configuration are checked.
    KnownFirst,
    /// I7: the master's heartbeat is sent within a cycle.
    Heartbeat,
    /// I8: no SDO download to an enabled drive.
    HandsOff,
    /// I9: the node uses the configured COB-IDs alone.
    OwnIdentifiers,
    /// I10: one SYNC per period; missed ones are not repeated.
    NoBurst,
    /// I11: all joints stop within a cycle of each other.
    Together,
    /// I12: zero torque, then disabled, then NMT.
    Shutdown,
    /// I13: no controlword by SDO, and no NMT stop of a single node, for a drive that reports its power stage off.
    LastResort,
}

impl Invariant {
    /// All invariants, by their numbers.
    pub const ALL: [Self; 13] = [
        Self::Cap,
        Self::Slew,
        Self::Permitted,
        Self::Latched,
        Self::OncePerSync,
        Self::KnownFirst,
        Self::Heartbeat,
        Self::HandsOff,
        Self::OwnIdentifiers,
        Self::NoBurst,
        Self::Together,
        Self::Shutdown,
        Self::LastResort,
    ];

    /// Returns the number of the invariant, from 1.
    pub fn number(self) -> usize {
        1 + Self::ALL.iter().position(|one| *one == self).unwrap_or_default()
    }
}

/// Time and description of a violated invariant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Violated invariant.
    pub invariant: Invariant,
    /// Time on the bus.
    pub at: Instant,
    /// Description, with joint or node and value.
    pub what: String,
}

/// As in `3.200512 s: I4: joint 3: target 12 per mille after a stop`.
impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.at.since(Instant::ZERO).as_secs_f64();
        write!(f, "{seconds:.6} s: {}: {}", self.invariant, self.what)
    }
}

/// First violations of a run, and the number of all.
#[derive(Clone, Debug, Default)]
pub(super) struct Violations {
    first: Vec<Violation>,
    count: u64,
}

/// Time, configuration and record of violations for the checks of one frame.
#[derive(Debug)]
pub(super) struct Moment<'a> {
    pub(super) sheet: &'a Sheet,
    pub(super) at: Instant,
    pub(super) violations: &'a mut Violations,
}

impl Moment<'_> {
    /// Records a violation at this time.
    pub(super) fn violates(&mut self, invariant: Invariant, what: impl Into<String>) {
        self.violations.add(invariant, self.at, what.into());
    }
}

/// Maximum number of violations that are kept with their description.
const MAX_KEPT: usize = 8;

impl Violations {
    fn add(&mut self, invariant: Invariant, at: Instant, what: String) {
        self.count += 1;
        if self.first.len() < MAX_KEPT {
            self.first.push(Violation { invariant, at, what });
        }
    }

    pub(super) fn first(&self) -> &[Violation] {
        &self.first
    }

    pub(super) const fn count(&self) -> u64 {
        self.count
    }

    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}
