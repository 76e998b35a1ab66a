//! When the loops of a drive run: every [`SERVO_PERIOD`] while they are needed, and else never.

use std::time::Duration;

use crate::motion::SERVO_PERIOD;
use units::time::Instant;

/// The time of the loops.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Servo {
    /// When they run next; `None` until it is known what time it is.
    next: Option<Instant>,
}

impl Servo {
    /// When they run next: the first time at once, to see what time it is.
    pub(super) fn deadline(&self) -> Instant {
        self.next.unwrap_or(Instant::ZERO)
    }

    /// They are not needed any more.
    pub(super) const fn stop(&mut self) {
        self.next = None;
    }

    /// How often they run to be up to date at `now`. Who comes much too late is not caught up with.
    pub(super) fn periods(&mut self, now: Instant) -> u32 {
        let period = Duration::from_secs_f64(SERVO_PERIOD);
        let mut next = self.next.unwrap_or(now + period);
        let mut periods = 0;
        while next <= now {
            next = if periods < MOST { next + period } else { now + period };
            periods += 1;
        }
        self.next = Some(next);
        periods
    }
}

/// So many periods are made up for.
const MOST: u32 = 100;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_period_is_neither_lost_nor_made_up(steps in proptest::collection::vec(0..20_000_u64, 1..50)) {
            let mut servo = Servo::default();
            let start = Instant::from_micros(777);
            prop_assert_eq!(servo.periods(start), 0);
            let (mut now, mut periods) = (start, 0);
            for step in steps {
                now = now + Duration::from_micros(step);
                periods += u128::from(servo.periods(now));
                prop_assert_eq!(periods, now.since(start).as_millis());
                prop_assert!(servo.deadline() > now);
            }
        }
    }

    #[test]
    fn a_stopped_simulation_is_not_caught_up_with() {
        let mut servo = Servo::default();
        servo.periods(Instant::ZERO);
        assert!(servo.periods(Instant::from_micros(3_600_000_000)) <= MOST + 1);
    }
}
