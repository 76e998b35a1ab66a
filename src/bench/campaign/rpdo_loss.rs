//! Time for which the torque held by a drive without its RPDOs differs from the targets sent to it.

use std::time::Duration;

use units::numbering::Joint;
use units::time::Instant;

/// Maximum difference from the held target that counts as rounding by the drive, in ‰ of rated torque.
const ROUNDING: i32 = 2;

/// Targets sent to a drive that receives no RPDO any more and holds the first of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct RpdoLoss {
    joint: Joint,
    target: Option<i16>,
    /// Set if the sent targets exceed the held one, cleared if they are below it; with the start of the difference.
    run: Option<(bool, Instant)>,
    /// Start and duration of the longest difference, or of the last one if the node stops.
    longest: Option<(Instant, Duration)>,
}

impl RpdoLoss {
    /// Returns the observation of a drive before its RPDOs are lost.
    pub(super) const fn new(joint: Joint) -> Self {
        Self { joint, target: None, run: None, longest: None }
    }

    pub(super) const fn joint(&self) -> Joint {
        self.joint
    }

    /// Takes the target sent in a cycle.
    pub(super) fn update(&mut self, now: Instant, sent: i16) {
        let held = *self.target.get_or_insert(sent);
        let difference = i32::from(sent) - i32::from(held);
        let side = (difference.abs() > ROUNDING).then_some(difference > 0);
        self.run = side.map(|side| match self.run {
            Some((before, since)) if before == side => (side, since),
            Some(_) | None => (side, now),
        });
        if let Some((_, since)) = self.run
            && now.since(since) >= self.longest()
        {
            self.longest = Some((since, now.since(since)));
        }
    }

    /// Returns the start of the present difference, else of the longest one.
    pub(super) fn since(&self) -> Option<Instant> {
        let longest = self.longest.map(|(since, _)| since);
        self.run.map(|(_, since)| since).or(longest)
    }

    /// Returns the longest time for which the targets were on one side of the held one.
    pub(super) fn longest(&self) -> Duration {
        self.longest.map_or(Duration::ZERO, |(_, time)| time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn difference_counts_from_its_side_of_the_held_target() {
        let mut loss = RpdoLoss::new(Joint::of::<3>());
        let at = |millis: u64| Instant::from_micros(1_000 * millis);
        for (millis, target) in (0..).zip([100, 101, 98, 104, 105, 104, 90, 90, 100]) {
            loss.update(at(millis), target);
        }
        assert_eq!((loss.since(), loss.longest()), (Some(at(3)), Duration::from_millis(2)));
        loss.update(at(9), 90);
        assert_eq!(loss.since(), Some(at(9)), "the one that goes on");
    }
}
