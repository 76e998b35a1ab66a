//! Timing of the control loops: every [`SERVO_PERIOD`] while they are needed.

use std::time::Duration;

use crate::motion::SERVO_PERIOD;
use units::time::Instant;

/// Schedule of the control loops.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Servo {
    /// Time of the next run; `None` before the first call of [`periods`](Self::periods).
    next: Option<Instant>,
}

impl Servo {
    /// Returns the time of the next run; zero before the first call, which sets the schedule.
    pub(super) fn deadline(&self) -> Instant {
        self.next.unwrap_or(Instant::ZERO)
    }

    /// Stops the schedule.
    pub(super) const fn stop(&mut self) {
        self.next = None;
    }

    /// Returns the number of periods due at `now`, at most [`MAX_CATCH_UP`] and one.
    pub(super) fn periods(&mut self, now: Instant) -> u32 {
        let period = Duration::from_secs_f64(SERVO_PERIOD);
        let mut next = self.next.unwrap_or(now + period);
        let mut periods = 0;
        while next <= now {
            next = if periods < MAX_CATCH_UP { next + period } else { now + period };
            periods += 1;
        }
        self.next = Some(next);
        periods
    }
}

/// Maximum periods to catch up after a pause of the simulation.
const MAX_CATCH_UP: u32 = 100;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn periods_match_the_elapsed_time(steps in proptest::collection::vec(0..20_000_u64, 1..50)) {
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
    fn paused_simulation_catches_up_a_bounded_time() {
        let mut servo = Servo::default();
        servo.periods(Instant::ZERO);
        assert!(servo.periods(Instant::from_micros(3_600_000_000)) <= MAX_CATCH_UP + 1);
    }
}
