//! Linear ramp of a torque share between 0 and 1, with separate rise and fall times.

use std::time::Duration;

use units::time::Instant;

/// Share from 0 to 1 that ramps up and down.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ramp {
    rise: Duration,
    fall: Duration,
    share: f64,
    at: Instant,
}

impl Ramp {
    /// Returns a ramp at zero. From zero to one takes `rise`, back takes `fall`; a zero time is a step.
    pub(super) const fn new(rise: Duration, fall: Duration) -> Self {
        Self { rise, fall, share: 0.0, at: Instant::ZERO }
    }

    /// Sets the share to zero.
    pub(super) const fn reset(&mut self, now: Instant) {
        (self.share, self.at) = (0.0, now);
    }

    /// Advances towards one if `is_on`, else towards zero.
    pub(super) fn advance(&mut self, now: Instant, is_on: bool) {
        let elapsed = now.since(self.at);
        let share = if is_on {
            self.share + fraction(elapsed, self.rise)
        } else {
            self.share - fraction(elapsed, self.fall)
        };
        (self.share, self.at) = (share.clamp(0.0, 1.0), now);
    }

    /// Returns the share at the last [`advance`](Self::advance), from 0 to 1.
    pub(super) const fn share(&self) -> f64 {
        self.share
    }

    /// Returns true at zero.
    pub(super) fn is_zero(&self) -> bool {
        self.share <= 0.0
    }

    /// Returns true at one.
    pub(super) fn is_full(&self) -> bool {
        self.share >= 1.0
    }
}

/// Returns `elapsed` as a fraction of `duration`, at most 1; 1 if `duration` is zero.
fn fraction(elapsed: Duration, duration: Duration) -> f64 {
    if elapsed >= duration { 1.0 } else { elapsed.as_secs_f64() / duration.as_secs_f64() }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn share_stays_within_0_and_1_and_its_rates(steps in prop::collection::vec((1..20_u64, any::<bool>()), 1..200)) {
            let mut ramp = Ramp::new(Duration::from_millis(300), Duration::from_millis(50));
            let (mut micros, mut before) = (0, 0.0);
            for (step, is_on) in steps {
                micros += step * 1_000;
                ramp.advance(Instant::from_micros(micros), is_on);
                let (up, down) = (f64::from(u32::try_from(step).unwrap()) / 300.0, 20.0 / 50.0);
                let by = ramp.share() - before;
                prop_assert!(by <= up + 1e-12 && by >= -down - 1e-12);
                prop_assert!((0.0..=1.0).contains(&ramp.share()));
                before = ramp.share();
            }
        }
    }

    #[test]
    fn ramp_with_zero_times_is_a_step() {
        let mut ramp = Ramp::new(Duration::ZERO, Duration::ZERO);
        ramp.advance(Instant::ZERO, true);
        assert!(ramp.is_full());
        ramp.advance(Instant::ZERO, false);
        assert!(ramp.is_zero());
    }
}
