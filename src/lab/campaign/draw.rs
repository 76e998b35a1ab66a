//! Chance of one case: the same again from the same seed.

use sim::random::SplitMix;
use units::numbering::Joint;

/// A source of choices.
#[derive(Clone, Debug)]
pub(super) struct Draw(SplitMix);

impl Draw {
    /// The choices of case `number` of a campaign.
    pub(super) fn of(seed: u64, number: u32) -> Self {
        let mut seeds = SplitMix::new(seed);
        let stream = seeds.bits() ^ u64::from(number).wrapping_mul(STREAM);
        Self(SplitMix::new(stream))
    }

    /// 64 bits.
    pub(super) fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// A number below `count`, 0 if there is none.
    pub(super) fn below(&mut self, count: u64) -> u64 {
        self.bits().checked_rem(count).unwrap_or(0)
    }

    /// A number from `low` to `high`.
    pub(super) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.unit()
    }

    /// One of some; there must be one.
    pub(super) fn among<'a, T>(&mut self, these: &'a [T]) -> Option<&'a T> {
        let count = u64::try_from(these.len()).unwrap_or(0);
        these.get(usize::try_from(self.below(count)).ok()?)
    }

    /// A joint.
    pub(super) fn joint(&mut self) -> Joint {
        self.among(&Joint::ALL).copied().unwrap_or(Joint::of::<1>())
    }

    /// Whether a coin shows heads.
    pub(super) fn is_heads(&mut self) -> bool {
        self.below(2) == 0
    }

    /// `count` bytes in hexadecimal digits.
    pub(super) fn digits(&mut self, count: u64) -> String {
        (0..count).map(|_| format!("{:02X}", self.below(256))).collect()
    }
}

/// Sets the choices of one case apart from those of another.
const STREAM: u64 = 0x9FB2_1C65_1E98_DF25;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_joint_comes_up() {
        let mut draw = Draw::of(1, 1);
        let mut seen = [0; 6];
        (0..600).for_each(|_| seen[draw.joint().index()] += 1);
        assert!(seen.iter().all(|count| *count > 50), "{seen:?}");
    }

    #[test]
    fn neighbouring_cases_have_nothing_in_common() {
        let first = |number| Draw::of(1, number).below(1_000_000);
        let mut all: Vec<u64> = (1..=1_000).map(first).collect();
        all.sort_unstable();
        all.dedup();
        assert!(all.len() > 990, "{}", all.len());
        assert_eq!(first(7), first(7));
    }
}
