//! Random numbers of one case; seed and number determine the sequence.

use std::time::Duration;

use sim::random::SplitMix;
use units::numbering::Joint;

/// Pseudo-random sequence of one case (SplitMix64).
#[derive(Clone, Debug)]
pub(super) struct Random(SplitMix);

impl Random {
    /// Creates the sequence of case `number` of a campaign.
    pub(super) fn new(seed: u64, number: u32) -> Self {
        let mut seeds = SplitMix::new(seed);
        let stream = seeds.bits() ^ u64::from(number).wrapping_mul(STREAM);
        Self(SplitMix::new(stream))
    }

    /// Returns 64 random bits.
    pub(super) fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// Returns an integer below `count`; 0 if `count` is 0.
    pub(super) fn below(&mut self, count: u64) -> u64 {
        self.bits().checked_rem(count).unwrap_or(0)
    }

    /// Returns a number from `low` to `high`.
    pub(super) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.unit()
    }

    /// Returns a duration from `low` to `high` s, rounded to 1 µs.
    pub(super) fn duration(&mut self, low: f64, high: f64) -> Duration {
        let exact = Duration::from_secs_f64(self.within(low, high));
        let micros = (exact + Duration::from_nanos(500)).as_micros();
        Duration::from_micros(u64::try_from(micros).unwrap_or(u64::MAX))
    }

    /// Returns a random element; `None` if the list is empty.
    pub(super) fn one_of<'a, T>(&mut self, these: &'a [T]) -> Option<&'a T> {
        let count = u64::try_from(these.len()).unwrap_or(0);
        these.get(usize::try_from(self.below(count)).ok()?)
    }

    /// Returns one of the six joints, each with equal probability.
    pub(super) fn joint(&mut self) -> Joint {
        self.one_of(&Joint::ALL).copied().unwrap_or(Joint::of::<1>())
    }

    /// Returns true or false with equal probability.
    pub(super) fn coin(&mut self) -> bool {
        self.below(2) == 0
    }

    /// Returns `count` random bytes.
    pub(super) fn bytes(&mut self, count: u64) -> Vec<u8> {
        (0..count).map(|_| u8::try_from(self.below(256)).unwrap_or(0)).collect()
    }
}

/// Returns a number rounded to this many decimals, so that a written scenario stays short.
pub(super) fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    (value * scale).round() / scale
}

/// Constant that separates the sequences of the cases.
const STREAM: u64 = 0x9FB2_1C65_1E98_DF25;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_joint_comes_up() {
        let mut random = Random::new(1, 1);
        let mut seen = [0; 6];
        (0..600).for_each(|_| seen[random.joint().index()] += 1);
        assert!(seen.iter().all(|count| *count > 50), "{seen:?}");
    }

    #[test]
    fn neighbouring_cases_have_nothing_in_common() {
        let first = |number| Random::new(1, number).below(1_000_000);
        let mut all: Vec<u64> = (1..=1_000).map(first).collect();
        all.sort_unstable();
        all.dedup();
        assert!(all.len() > 990, "{}", all.len());
        assert_eq!(first(7), first(7));
    }
}
