//! A share of torque on its way: up by one ramp, down by another, or gone at once.

use std::time::Duration;

use units::time::Instant;

/// A share, 0 to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ramp {
    rise: Duration,
    fall: Duration,
    share: f64,
    at: Instant,
}

impl Ramp {
    /// At zero; from there to one takes `rise`, and back `fall`.
    pub(super) const fn new(rise: Duration, fall: Duration) -> Self {
        Self { rise, fall, share: 0.0, at: Instant::ZERO }
    }

    /// Begins anew at zero.
    pub(super) const fn begin(&mut self, now: Instant) {
        (self.share, self.at) = (0.0, now);
    }

    /// Goes on towards one if it `is_on`, else towards zero.
    pub(super) fn follow(&mut self, now: Instant, is_on: bool) {
        let elapsed = now.since(self.at);
        let share = if is_on {
            self.share + part(elapsed, self.rise)
        } else {
            self.share - part(elapsed, self.fall)
        };
        (self.share, self.at) = (share.clamp(0.0, 1.0), now);
    }

    /// How far it is.
    pub(super) const fn share(&self) -> f64 {
        self.share
    }

    /// Whether it is at zero.
    pub(super) fn is_down(&self) -> bool {
        self.share <= 0.0
    }

    /// Whether it is at one.
    pub(super) fn is_up(&self) -> bool {
        self.share >= 1.0
    }
}

/// What `elapsed` is of the `whole`; all of it if that is no time.
fn part(elapsed: Duration, whole: Duration) -> f64 {
    if elapsed >= whole { 1.0 } else { elapsed.as_secs_f64() / whole.as_secs_f64() }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_share_never_jumps_up_and_is_one(steps in prop::collection::vec((1..20_u64, any::<bool>()), 1..200)) {
            let mut ramp = Ramp::new(Duration::from_millis(300), Duration::from_millis(50));
            let (mut micros, mut before) = (0, 0.0);
            for (step, is_on) in steps {
                micros += step * 1_000;
                ramp.follow(Instant::from_micros(micros), is_on);
                let (up, down) = (f64::from(u32::try_from(step).unwrap()) / 300.0, 20.0 / 50.0);
                let by = ramp.share() - before;
                prop_assert!(by <= up + 1e-12 && by >= -down - 1e-12);
                prop_assert!((0.0..=1.0).contains(&ramp.share()));
                before = ramp.share();
            }
        }
    }

    #[test]
    fn a_ramp_of_no_length_is_a_step() {
        let mut ramp = Ramp::new(Duration::ZERO, Duration::ZERO);
        ramp.follow(Instant::ZERO, true);
        assert!(ramp.is_up());
        ramp.follow(Instant::ZERO, false);
        assert!(ramp.is_down());
    }
}
