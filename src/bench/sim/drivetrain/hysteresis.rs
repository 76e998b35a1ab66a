//! Hysteresis between motor torque and gear output: a play operator (Visintin 1994).
//!
//! The output stays until the input is half the width beyond it, then follows at that distance. So rising torque is half
//! a width too low, falling torque half a width too high. The remanence at zero current is at most half a width.

/// Hysteresis of one joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hysteresis {
    /// Half the width of the loop, in N·m (N).
    half: f64,
    output: f64,
}

impl Hysteresis {
    /// Creates a hysteresis of `width` in N·m (N), with zero output.
    pub(super) const fn new(width: f64) -> Self {
        Self { half: width.abs() / 2.0, output: 0.0 }
    }

    /// Returns the output for the input, in N·m (N).
    pub(super) const fn step(&mut self, input: f64) -> f64 {
        self.output = self.output.max(input - self.half).min(input + self.half);
        self.output
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "what is not touched stays what it is, bit for bit")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn output_stays_within_half_the_width(input in prop::collection::vec(-9.0..9.0_f64, 1..50)) {
            let mut hysteresis = Hysteresis::new(0.4);
            for input in input {
                prop_assert!((hysteresis.step(input) - input).abs() <= 0.2 + 1e-12);
            }
        }

        #[test]
        fn zero_width_changes_nothing(input in -9.0..9.0_f64) {
            prop_assert_eq!(Hysteresis::new(0.0).step(input), input);
        }
    }

    #[test]
    fn loop_has_the_configured_width() {
        let mut hysteresis = Hysteresis::new(0.4);
        let up = [-5.0, 1.0].map(|input| hysteresis.step(input))[1];
        let down = [5.0, 1.0].map(|input| hysteresis.step(input))[1];
        assert!((down - up - 0.4).abs() < 1e-12);
    }
}
