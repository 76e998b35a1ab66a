//! Work of the contact wrench over a task (Eq. 11), per component of {MRF}.
//!
//! ```text
//!  literal    W = Σ_i | ∫ F_i dξ_i |        as printed: loading and unloading of an elastic contact cancel
//!  absolute   W = Σ_i   ∫ | F_i dξ_i |      they add up
//! ```
//!
//! `dξ` is the displacement of {MRF}, written in {MRF}: a body twist times its duration, so rotations need no angles. The
//! integral is evaluated by the trapezoidal rule.

use units::spatial::{Twist, Wrench};

/// Integrals of both forms, in J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactWork {
    before: Option<[f64; 6]>,
    signed: [f64; 6],
    absolute: [f64; 6],
}

impl ContactWork {
    /// Adds the wrench `f_m` at the end of a displacement `dx_m`, a twist times its duration. The first call only stores
    /// the wrench.
    pub fn add(&mut self, f_m: &Wrench, dx_m: &Twist) {
        let now = f_m.components();
        let before = self.before.replace(now);
        let Some(before) = before else { return };
        let parts = self.signed.iter_mut().zip(&mut self.absolute);
        let ways = before.into_iter().zip(now).zip(dx_m.components());
        for ((signed, absolute), ((before, now), way)) in parts.zip(ways) {
            let work = f64::midpoint(before, now) * way;
            *signed += work;
            *absolute += work.abs();
        }
    }

    /// Returns `|∫ F_i dξ_i|` per component, in J.
    pub fn literal_parts(&self) -> [f64; 6] {
        self.signed.map(f64::abs)
    }

    /// Returns `∫ |F_i dξ_i|` per component, in J.
    pub const fn absolute_parts(&self) -> [f64; 6] {
        self.absolute
    }

    /// Returns Eq. 11 as printed, in J.
    pub fn literal(&self) -> f64 {
        self.literal_parts().iter().sum()
    }

    /// Returns the sum of the absolute parts, in J.
    pub fn absolute(&self) -> f64 {
        self.absolute.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn literal_work_is_at_most_the_absolute(
            samples in prop::collection::vec(prop::array::uniform12(-1.0..1.0_f64), 2..50)
        ) {
            let mut work = ContactWork::default();
            for [f, g, h, a, b, c, x, y, z, u, v, w] in samples {
                let f_m = Wrench::from_components([f, g, h, a, b, c]);
                work.add(&f_m, &Twist::from_components([x, y, z, u, v, w]));
            }
            prop_assert!(work.literal() <= work.absolute() + 1e-12);
        }
    }

    #[test]
    fn constant_force_does_force_times_way() {
        let mut work = ContactWork::default();
        let f_m = Wrench::from_components([0.0, 5.0, 0.0, 0.0, 0.0, 2.0]);
        let dx_m = Twist::from_components([1.0, 0.01, 0.0, 0.0, 0.0, -0.1]);
        for _ in 0..11 {
            work.add(&f_m, &dx_m);
        }
        assert!((work.literal() - (0.5 + 2.0)).abs() < 1e-12, "{work:?}");
    }
}
