//! Reaction time of the operator: a pure delay.

use std::time::Duration;

use units::spatial::Wrench;

/// Sample time of the delay line, in s.
const TICK: f64 = 1e-3;

/// Remainder of time that counts as zero, in s.
const ROUNDING: f64 = 1e-9;

/// Delay line of wrenches, with one sample per millisecond.
#[derive(Clone, Debug)]
pub(super) struct Delay {
    line: Box<[Wrench]>,
    /// Index of the oldest.
    oldest: usize,
    /// Time not yet in the line, in s.
    rest: f64,
}

impl Delay {
    /// Creates a delay of `seconds`, rounded to ms, with zero content.
    pub(super) fn new(seconds: f64) -> Self {
        let rounded = Duration::try_from_secs_f64(seconds + 0.5 * TICK).unwrap_or_default();
        let length = usize::try_from(rounded.as_millis()).unwrap_or_default();
        Self { line: vec![Wrench::ZERO; length].into(), oldest: 0, rest: 0.0 }
    }

    /// Advances by `dt` s with input `input` and returns the delayed output. Does not allocate.
    pub(super) fn step(&mut self, dt: f64, input: Wrench) -> Wrench {
        self.rest += dt;
        let mut out = self.line.get(self.oldest).copied().unwrap_or(input);
        while self.rest >= TICK - ROUNDING {
            self.rest -= TICK;
            if let Some(place) = self.line.get_mut(self.oldest) {
                out = std::mem::replace(place, input);
                self.oldest = (self.oldest + 1) % self.line.len();
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn force(number: f64) -> Wrench {
        Wrench::from_components([number, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    #[test]
    fn output_is_the_input_delayed() {
        let mut delay = Delay::new(0.15);
        for ms in 0..400 {
            let out = delay.step(1e-3, force(f64::from(ms)));
            assert_eq!(out, force(f64::from((ms - 150).max(0))), "at {ms} ms");
        }
    }

    #[test]
    fn delay_hardly_depends_on_the_step() {
        let mut delay = Delay::new(0.1);
        // A step, seen every 0.3 ms.
        let arrived = (0..1_000).position(|_| delay.step(0.3e-3, force(1.0)).force.x > 0.5);
        let at = 0.3 * f64::from(u32::try_from(arrived.unwrap()).unwrap());
        assert!((at - 100.0).abs() <= 1.3, "{at} ms");
        // After a long pause the output is the last input.
        assert_eq!(delay.step(1.0, force(2.0)), force(2.0));
    }

    #[test]
    fn zero_delay_returns_the_input() {
        assert_eq!(Delay::new(0.0).step(1e-3, force(3.0)), force(3.0));
    }
}
