//! The twelve invariants, and what is noted when one is broken.

use std::fmt;

use units::time::Instant;

/// What must hold on the buses at any moment, whatever breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Law {
    /// I1: no target is beyond its joint's capacity.
    Cap,
    /// I2: no target grows faster than it may.
    Slew,
    /// I3: none but zero while not armed, none but the arm's weight while the deadman is open, and no engagement
    /// before the deadman's contacts have settled for 25 ms, open and then closed.
    Permitted,
    /// I4: none but zero after a trip, until reset, deadman edge and arm.
    Latched,
    /// I5: every drive is told its target once for each SYNC, and not late.
    OncePerSync,
    /// I6: nothing is started or enabled before it is known and configured.
    KnownFirst,
    /// I7: the heartbeat comes with the cycle alone.
    Heartbeat,
    /// I8: nothing is written into a drive that is enabled.
    HandsOff,
    /// I9: no identifier but those of the configuration.
    OwnIdentifiers,
    /// I10: one SYNC in a period; what was missed is not made up for.
    NoBurst,
    /// I11: what stops one joint stops all within a cycle.
    Together,
    /// I12: zero, then disabled, then NMT.
    Shutdown,
}

impl Law {
    /// All of them, by their numbers.
    pub const ALL: [Self; 12] = [
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
    ];

    /// Its number, from 1.
    pub fn number(self) -> usize {
        1 + Self::ALL.iter().position(|law| *law == self).unwrap_or_default()
    }
}

/// As in "I4".
impl fmt::Display for Law {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "I{}", self.number())
    }
}

/// A law was broken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Breach {
    /// Which.
    pub law: Law,
    /// When, on the bus's clock.
    pub at: Instant,
    /// How, in words.
    pub what: String,
}

/// As in `3.200512 s: I4: joint 3 is told 12 per mille after a trip`.
impl fmt::Display for Breach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.at.since(Instant::ZERO).as_secs_f64();
        write!(f, "{seconds:.6} s: {}: {}", self.law, self.what)
    }
}

/// The breaches of one run: the first ones in words, all of them counted.
#[derive(Clone, Debug, Default)]
pub(super) struct Breaches {
    first: Vec<Breach>,
    count: u64,
}

/// As many are kept in words.
const KEPT: usize = 8;

impl Breaches {
    pub(super) fn add(&mut self, law: Law, at: Instant, what: String) {
        self.count += 1;
        if self.first.len() < KEPT {
            self.first.push(Breach { law, at, what });
        }
    }

    pub(super) fn first(&self) -> &[Breach] {
        &self.first
    }

    pub(super) const fn count(&self) -> u64 {
        self.count
    }

    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}
