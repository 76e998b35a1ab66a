//! Gain margin of a sampled loop, and the frequency of the oscillation at that gain.
//!
//! A characteristic polynomial has two parts: without the gain, and the contribution of the gain. Jury's table decides
//! stability for one multiple of the gain, and bisection finds the margin. No roots are computed.

use std::f64::consts::PI;

use nalgebra::ComplexField;

use crate::stability::polynomial::Polynomial;
use crate::stability::sampled_loop::{Loop, SampledLoop};
use units::math;

/// Search range of a bound, as powers of two of the gain, and the steps per doubling.
const DOUBLINGS: [i32; 2] = [-6, 10];
const STEPS_PER_DOUBLING: i32 = 2;

/// Bisections of the step that contains the bound.
const HALVINGS: u32 = 16;

/// Number of angles ωT at which the frequency of an oscillation is searched, and the smallest, in rad.
const ANGLES: u32 = 120;
const LEAST_ANGLE: f64 = 1e-4;

/// Repetitions of the reduction of the grip at the frequency found.
const REFINEMENTS: u32 = 2;

/// Returns the gain margin of a loop and its frequency in rad/s, with the grip reduced at that frequency. `None` unless it
/// is below `most`. NaN if a coefficient of the loop is not finite.
pub(super) fn refined_margin<'a>(
    reduced: impl Fn(f64) -> SampledLoop<'a>,
    closed: Loop,
    most: f64,
    omega: f64,
    period: f64,
) -> Option<(f64, f64)> {
    let (mut multiple, mut omega, mut most) = (f64::NAN, omega, most);
    for _ in 0..=REFINEMENTS {
        let judged = reduced(omega);
        let parts = judged.characteristic(closed);
        multiple = margin(&parts, most);
        if multiple.is_nan() {
            break;
        }
        if multiple >= most {
            return None;
        }
        omega = crossover_angle(&parts, multiple) / period;
        most = f64::INFINITY;
    }
    Some((multiple, omega))
}

/// Returns the angle ωT at which the open loop comes nearest to `L = -1`, a sustained oscillation, in rad.
fn crossover_angle([open, added]: &[Polynomial; 2], multiple: f64) -> f64 {
    let ratio = math::powf(PI / LEAST_ANGLE, f64::from(ANGLES).recip());
    let angles = std::iter::successors(Some(LEAST_ANGLE), |angle| Some(angle * ratio));
    let distances = angles.take_while(|angle| *angle <= PI).map(|angle| {
        let w = math::cis(-angle);
        let (open, added) = (open.at(w), added.at(w) * multiple);
        ((open + added).modulus() / (open.modulus() + added.modulus()), angle)
    });
    distances.min_by(|(a, _), (b, _)| a.total_cmp(b)).map_or(PI, |(_, angle)| angle)
}

/// Returns the smallest unstable multiple of a gain, at most `most`. NaN if a coefficient is not finite.
pub(super) fn margin([open, added]: &[Polynomial; 2], most: f64) -> f64 {
    if !(open.is_finite() && added.is_finite()) {
        return f64::NAN;
    }
    let is_stable = |multiple: &f64| open.plus(added, *multiple).is_stable();
    if most.is_finite() && [0.25, 0.5, 1.0].iter().all(|share| is_stable(&(share * most))) {
        return most;
    }
    let [lowest, highest] = DOUBLINGS.map(|doublings| doublings * STEPS_PER_DOUBLING);
    let steps = (lowest..=highest)
        .map(|step| math::powf(2.0, f64::from(step) / f64::from(STEPS_PER_DOUBLING)));
    let mut low = 0.0;
    for high in steps {
        if !is_stable(&high) {
            return bisect(is_stable, low, high);
        }
        low = high;
    }
    f64::INFINITY
}

/// Bisects between the stable multiple `low` and the unstable `high`.
fn bisect(is_stable: impl Fn(&f64) -> bool, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        if is_stable(&middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the parts of `1 - w + g w`, whose pole is `1 - g`.
    fn integrator() -> [Polynomial; 2] {
        [Polynomial::new(&[1.0, -1.0]), Polynomial::new(&[0.0, 1.0])]
    }

    #[test]
    fn integrator_bears_a_gain_of_two() {
        assert!((margin(&integrator(), f64::INFINITY) - 2.0).abs() < 1e-4);
        assert!((crossover_angle(&integrator(), 2.0) - PI).abs() < 0.1);
    }

    #[test]
    fn bound_above_the_least_so_far_is_not_searched() {
        assert!((margin(&integrator(), 1.5) - 1.5).abs() < 1e-12);
    }

    #[test]
    fn loop_that_nothing_swings_has_an_infinite_bound() {
        let parts = [Polynomial::new(&[1.0, -0.5]), Polynomial::new(&[0.0])];
        assert!(margin(&parts, f64::INFINITY).is_infinite());
    }

    #[test]
    fn invalid_coefficients_have_no_bound() {
        for value in [f64::NAN, f64::INFINITY] {
            let parts = [Polynomial::new(&[1.0, -1.0]), Polynomial::new(&[0.0, value])];
            assert!(margin(&parts, f64::INFINITY).is_nan());
            assert!(margin(&parts, 1.0).is_nan());
        }
    }
}
