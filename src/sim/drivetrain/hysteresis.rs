//! Hysteresis between what a motor makes and what leaves its gear: a play operator (Visintin 1994).
//!
//! The torque given stays where it is until the torque made has gone half the width past it, then keeps
//! that distance: whoever drives up reads half a width less, whoever drives down half a width more. What
//! is left at zero current is at most half a width.

/// The loop of one joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hysteresis {
    /// Half the width of the loop, in N·m (N).
    half: f64,
    given: f64,
}

impl Hysteresis {
    /// Of this width in N·m (N), from nothing.
    pub(super) const fn new(width: f64) -> Self {
        Self { half: width.abs() / 2.0, given: 0.0 }
    }

    /// What is given when `made` is made, in N·m (N).
    pub(super) const fn follow(&mut self, made: f64) -> f64 {
        self.given = self.given.max(made - self.half).min(made + self.half);
        self.given
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "what is not touched stays what it is, bit for bit")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn it_keeps_within_half_its_width(made in prop::collection::vec(-9.0..9.0_f64, 1..50)) {
            let mut hysteresis = Hysteresis::new(0.4);
            for made in made {
                prop_assert!((hysteresis.follow(made) - made).abs() <= 0.2 + 1e-12);
            }
        }

        #[test]
        fn without_width_nothing_is_changed(made in -9.0..9.0_f64) {
            prop_assert_eq!(Hysteresis::new(0.0).follow(made), made);
        }
    }

    #[test]
    fn a_loop_is_as_wide_as_it_is_said_to_be() {
        let mut hysteresis = Hysteresis::new(0.4);
        let up = [-5.0, 1.0].map(|made| hysteresis.follow(made))[1];
        let down = [5.0, 1.0].map(|made| hysteresis.follow(made))[1];
        assert!((down - up - 0.4).abs() < 1e-12);
    }
}
