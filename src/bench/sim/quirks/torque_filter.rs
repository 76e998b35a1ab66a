//! Low pass and gain error of a drive's torque actual (6077h).

use std::time::Duration;

use units::time::Instant;

/// Time constant of the low pass.
const TIME_CONSTANT: Duration = Duration::from_millis(10);

/// Low pass of first order with a gain error.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TorqueFilter {
    gain: f64,
    /// Output before the gain error, in ‰ of rated torque.
    filtered: f64,
    /// Time and value of the last input.
    last: Option<(Instant, f64)>,
}

impl TorqueFilter {
    /// Returns a filter at zero whose output is too large by `percent`.
    pub(super) fn new(percent: i8) -> Self {
        Self { gain: 1.0 + f64::from(percent) / 100.0, filtered: 0.0, last: None }
    }

    /// Takes the torque from `now` on; returns what the drive reports, both in ‰ of rated torque.
    pub(crate) fn step(&mut self, now: Instant, torque: f64) -> f64 {
        let (at, before) = self.last.unwrap_or((now, torque));
        let passed = now.since(at).as_secs_f64() / TIME_CONSTANT.as_secs_f64();
        self.filtered += (before - self.filtered) * -(-passed).exp_m1();
        self.last = Some((now, torque));
        self.gain * self.filtered
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_of_torque_is_reached_by_two_thirds_in_10_ms() {
        let mut filter = TorqueFilter::new(-5);
        let at = |millis: u64| Instant::from_micros(1_000 * millis);
        assert!(filter.step(at(0), 1_000.0).abs() < 1e-9);
        assert!((filter.step(at(10), 1_000.0) - 950.0 * (1.0 - (-1_f64).exp())).abs() < 1e-6);
        assert!((filter.step(at(200), 0.0) - 950.0).abs() < 1e-3, "its gain error stays");
    }
}
