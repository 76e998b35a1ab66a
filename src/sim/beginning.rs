//! When a script begins: at the first SYNC, and anew at one that comes after a silence, as long as nobody has
//! pushed. A master that lets its drives prove that they stop without it pauses before it is ready; what an
//! operator does is told from then on.

use std::time::Duration;

use units::time::Instant;

/// Time zero of a script.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Beginning {
    zero: Option<Instant>,
    last: Option<Instant>,
    /// From the SYNC before the last one to that.
    gap: Option<Duration>,
    is_final: bool,
}

impl Beginning {
    /// Time zero, if it has come.
    pub(super) const fn zero(&self) -> Option<Instant> {
        self.zero
    }

    /// Takes a SYNC. Whether the script begins with it.
    pub(super) fn on_sync(&mut self, now: Instant) -> bool {
        let gap = self.last.map(|last| now.since(last));
        let is_after_silence =
            gap.zip(self.gap).is_some_and(|(gap, before)| gap > before * SILENCE);
        self.last = Some(now);
        self.gap = gap;
        let begins = self.zero.is_none() || is_after_silence && !self.is_final;
        if begins {
            self.zero = Some(now);
            self.gap = None;
        }
        begins
    }

    /// Somebody pushes, or the script has done something: after the first SYNC it stays begun.
    pub(super) const fn settle(&mut self) {
        self.is_final = self.zero.is_some();
    }
}

/// So many periods without a SYNC are a silence.
const SILENCE: u32 = 3;

#[cfg(test)]
mod tests {
    use super::*;

    fn zero(beginning: &mut Beginning, syncs: impl IntoIterator<Item = u64>) -> u64 {
        syncs.into_iter().for_each(|at| {
            beginning.on_sync(Instant::from_micros(at));
        });
        beginning.zero().unwrap().as_micros()
    }

    #[test]
    fn a_script_begins_anew_after_a_silence_until_somebody_pushes() {
        let mut beginning = Beginning::default();
        beginning.settle();
        assert_eq!(zero(&mut beginning, [1_000, 2_000, 3_000, 5_500, 6_500]), 1_000, "jitter");
        assert_eq!(zero(&mut beginning, [14_000, 15_000, 16_000]), 14_000);
        beginning.settle();
        assert_eq!(zero(&mut beginning, [50_000, 51_000]), 14_000);
    }

    #[test]
    fn a_slow_master_is_not_a_silent_one() {
        let syncs = (1..50).map(|place| place * 100_000);
        assert_eq!(zero(&mut Beginning::default(), syncs), 100_000);
    }
}
