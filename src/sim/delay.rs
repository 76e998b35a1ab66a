//! Nerves: what goes in comes out a fixed time later.

use std::time::Duration;

use units::spatial::Wrench;

/// What goes in is kept so often, in s.
const TICK: f64 = 1e-3;

/// A rest of time this short is a rounding error, in s.
const ROUNDING: f64 = 1e-9;

/// A line of wrenches, one a millisecond.
#[derive(Clone, Debug)]
pub(super) struct Delay {
    line: Box<[Wrench]>,
    /// The oldest.
    oldest: usize,
    /// Time that has passed and is not in the line yet, in s.
    rest: f64,
}

impl Delay {
    /// A delay of `seconds`, to the millisecond, with nothing on the way; none below half of one.
    pub(super) fn new(seconds: f64) -> Self {
        let rounded = Duration::try_from_secs_f64(seconds + 0.5 * TICK).unwrap_or_default();
        let length = usize::try_from(rounded.as_millis()).unwrap_or_default();
        Self { line: vec![Wrench::ZERO; length].into(), oldest: 0, rest: 0.0 }
    }

    /// What comes out after `dt` s more, in which `felt` went in. Nothing is allocated.
    pub(super) fn pass(&mut self, dt: f64, felt: Wrench) -> Wrench {
        self.rest += dt;
        let mut out = self.line.get(self.oldest).copied().unwrap_or(felt);
        while self.rest >= TICK - ROUNDING {
            self.rest -= TICK;
            if let Some(place) = self.line.get_mut(self.oldest) {
                out = std::mem::replace(place, felt);
                self.oldest = (self.oldest + 1) % self.line.len();
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(number: f64) -> Wrench {
        Wrench::from_components([number, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    #[test]
    fn what_goes_in_comes_out_so_much_later() {
        let mut delay = Delay::new(0.15);
        for ms in 0..400 {
            let out = delay.pass(1e-3, of(f64::from(ms)));
            assert_eq!(out, of(f64::from((ms - 150).max(0))), "at {ms} ms");
        }
    }

    #[test]
    fn it_matters_little_how_time_is_cut() {
        let mut delay = Delay::new(0.1);
        // A step, seen every 0.3 ms.
        let arrived = (0..1_000).position(|_| delay.pass(0.3e-3, of(1.0)).force.x > 0.5);
        let at = 0.3 * f64::from(u32::try_from(arrived.unwrap()).unwrap());
        assert!((at - 100.0).abs() <= 1.3, "{at} ms");
        // After a long pause what went in last is all there is.
        assert_eq!(delay.pass(1.0, of(2.0)), of(2.0));
    }

    #[test]
    fn no_delay_is_none() {
        assert_eq!(Delay::new(0.0).pass(1e-3, of(3.0)), of(3.0));
    }
}
