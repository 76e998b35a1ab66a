//! Torque curve of one joint (4.2, Fig. 6; decision 24): an odd polynomial of 5th order, proven to rise.

use thiserror::Error;

/// Maximum target torque (6071h), in ‰ of rated torque.
const MAX_PER_MILLE: f64 = 32_767.0;
/// Rounding tolerance in the comparison of a slope with zero; smaller slopes are refused.
const ROUNDING: f64 = 1e-12;
/// Bisections of the range, for a relative accuracy of 1e-15.
const HALVINGS: u32 = 52;

/// Calibrated curve of one joint: `c1 t + c3 t³ + c5 t⁵` in ‰ of rated torque for a joint torque `t` in N·m.
///
/// It rises strictly up to the end of the calibrated range. It is odd, as the joints of the paper (4.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueCurve {
    coefficients: [f64; 3],
    max_torque: f64,
}

/// Reason why a torque curve is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidTorqueCurve {
    /// End of the calibrated range is not positive and finite.
    #[error("the calibrated range must be positive and finite, got {0} N·m")]
    MaxTorque(f64),
    /// Coefficient is not finite.
    #[error("c{power} = {value} is not a finite number")]
    NotFinite {
        /// Power of the coefficient: 1, 3 or 5.
        power: u8,
        /// Rejected value, in ‰ per N·m to that power.
        value: f64,
    },
    /// Curve does not rise strictly within its range.
    #[error("the curve stops rising at {torque:.3} N·m, within its range up to {max_torque} N·m")]
    NotMonotone {
        /// Smallest torque with zero slope, in N·m.
        torque: f64,
        /// End of the range, in N·m.
        max_torque: f64,
    },
    /// Target out of the drive's range or below its resolution.
    #[error(
        "the curve ends at {per_mille} ‰ of rated torque, not within 1 ‰ and {MAX_PER_MILLE} ‰"
    )]
    End {
        /// Target at the end of the range, in ‰.
        per_mille: f64,
    },
}

impl TorqueCurve {
    /// Creates a curve from its coefficients c1, c3, c5 in ‰ per N·m, (N·m)³, (N·m)⁵, up to the torque `max_torque`. For a
    /// prismatic joint N replaces N·m.
    ///
    /// # Errors
    /// Returns an error unless the curve rises over the range, and ends within 1 ‰ and 32,767 ‰.
    pub fn new(coefficients: [f64; 3], max_torque: f64) -> Result<Self, InvalidTorqueCurve> {
        if !(max_torque.is_finite() && max_torque > 0.0) {
            return Err(InvalidTorqueCurve::MaxTorque(max_torque));
        }
        for (value, power) in coefficients.into_iter().zip([1, 3, 5]) {
            if !value.is_finite() {
                return Err(InvalidTorqueCurve::NotFinite { power, value });
            }
        }
        if let Some(torque) = first_flat(coefficients, max_torque) {
            return Err(InvalidTorqueCurve::NotMonotone { torque, max_torque });
        }
        let curve = Self { coefficients, max_torque };
        let per_mille = curve.evaluate(max_torque);
        if (1.0..=MAX_PER_MILLE).contains(&per_mille) {
            Ok(curve)
        } else {
            Err(InvalidTorqueCurve::End { per_mille })
        }
    }

    /// End of the calibrated range, in N·m: the capacity of the joint.
    pub const fn max_torque(&self) -> f64 {
        self.max_torque
    }

    /// Converts a joint torque in N·m to ‰ of rated torque, not rounded. A torque beyond the range saturates.
    pub fn at(&self, torque: f64) -> f64 {
        self.evaluate(torque.clamp(-self.max_torque, self.max_torque))
    }

    /// Converts ‰ of rated torque to a joint torque in N·m, by bisection, which cannot fail on a rising curve. A value beyond
    /// the end of the curve saturates.
    pub fn torque(&self, per_mille: f64) -> f64 {
        let (mut low, mut high) = (0.0, self.max_torque);
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            if self.evaluate(middle) < per_mille.abs() {
                low = middle;
            } else {
                high = middle;
            }
        }
        high.copysign(per_mille)
    }

    /// Coefficients c1, c3, c5 in ‰ per N·m, (N·m)³, (N·m)⁵.
    pub const fn coefficients(&self) -> [f64; 3] {
        self.coefficients
    }

    /// Returns the minimum slope within the range, in ‰ per N·m, and its torque in N·m.
    ///
    /// Being a parabola in `s = t²`, the slope has its minimum at an end of the range or at the vertex.
    pub fn least_slope(&self) -> (f64, f64) {
        let [_, c3, c5] = self.coefficients;
        let vertex = (-3.0 * c3 / (10.0 * c5)).sqrt(); // NaN without a vertex
        let places = [0.0, vertex.min(self.max_torque), self.max_torque];
        let slopes = places.map(|torque| (self.slope(torque), torque));
        slopes.into_iter().fold(
            (f64::INFINITY, 0.0),
            |least, slope| {
                if slope.0 < least.0 { slope } else { least }
            },
        )
    }

    /// Returns the slope at a torque in N·m, in ‰ per N·m.
    pub fn slope(&self, torque: f64) -> f64 {
        let [c1, c3, c5] = self.coefficients;
        let s = torque * torque;
        c1 + s * (3.0 * c3 + s * 5.0 * c5)
    }

    fn evaluate(&self, t: f64) -> f64 {
        let [c1, c3, c5] = self.coefficients;
        t * (c1 + t * t * (c3 + t * t * c5))
    }
}

/// Returns the smallest torque in N·m, within 0 and `max_torque`, at which the slope is not positive.
///
/// With `s = t²` the slope is the quadratic `c1 + 3 c3 s + 5 c5 s²`. If it is positive at 0, it is positive up to its
/// smallest positive root.
fn first_flat([c1, c3, c5]: [f64; 3], max_torque: f64) -> Option<f64> {
    if c1 <= 0.0 {
        return Some(0.0);
    }
    // Over u = s / max², within 0 and 1, and divided by c1: 1 + b u + a u².
    let square = max_torque * max_torque;
    let b = 3.0 * (c3 / c1) * square;
    let a = 5.0 * (c5 / c1) * square * square;
    let discriminant = b * b - 4.0 * a;
    if !discriminant.is_finite() {
        return Some(0.0); // c1 is negligible beside the others
    }
    if discriminant < -ROUNDING * b * b {
        return None;
    }
    // The largest v = 1 / u of v² + b v + a = 0, without cancellation.
    let root = discriminant.max(0.0).sqrt();
    let inverse = if b > 0.0 { -2.0 * a / (b + root) } else { (root - b) / 2.0 };
    (inverse >= 1.0 - ROUNDING).then(|| inverse.sqrt().recip().min(1.0) * max_torque)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use units::math;

    fn curve() -> TorqueCurve {
        TorqueCurve::new([300.0, -5.468_75, 0.878_906_25], 4.0).unwrap()
    }

    proptest! {
        #[test]
        fn property_10_more_torque_asks_for_more(a in -5.0..5.0_f64, b in -5.0..5.0_f64) {
            let (low, high) = (a.min(b), a.max(b));
            prop_assert!(curve().at(low) <= curve().at(high));
        }

        #[test]
        fn property_10_curve_is_odd_and_inverse_right_to_a_thousandth(torque in -4.0..4.0_f64) {
            prop_assert!((curve().at(-torque) + curve().at(torque)).abs() < 1e-12);
            let back = curve().torque(curve().at(torque));
            prop_assert!((back - torque).abs() <= 1e-3 * torque.abs() + 1e-12, "{back}");
        }

        #[test]
        fn a_curve_is_accepted_exactly_if_it_rises_everywhere(
            c1 in -50.0..200.0_f64, c3 in -50.0..50.0_f64, c5 in -5.0..5.0_f64, max in 0.1..6.0_f64
        ) {
            let slope = |t: f64| c1 + 3.0 * c3 * t * t + 5.0 * c5 * math::powf(t, 4.0);
            let samples = (0..=2_000).map(|i| max * f64::from(i) / 2_000.0);
            let lowest = samples.map(slope).fold(f64::INFINITY, f64::min);
            match TorqueCurve::new([c1, c3, c5], max) {
                Ok(_) | Err(InvalidTorqueCurve::End { .. }) => prop_assert!(lowest > 0.0),
                Err(InvalidTorqueCurve::NotMonotone { torque, .. }) => {
                    prop_assert!((0.0..=max).contains(&torque));
                    prop_assert!(lowest < 0.1 * c1.abs().max(1.0));
                    prop_assert!(c1 <= 0.0 || slope(torque).abs() < 1e-6 * c1);
                    prop_assert!(c1 <= 0.0 || slope(torque * 0.999) > 0.0);
                }
                Err(other) => prop_assert!(false, "{other}"),
            }
        }

        #[test]
        fn the_least_slope_is_met_and_nowhere_undercut(
            c3 in -50.0..50.0_f64, c5 in -5.0..5.0_f64, max in 0.1..6.0_f64
        ) {
            let slope = |t: f64| 200.0 + 3.0 * c3 * t * t + 5.0 * c5 * math::powf(t, 4.0);
            if let Ok(curve) = TorqueCurve::new([200.0, c3, c5], max) {
                let (least, torque) = curve.least_slope();
                prop_assert!(least > 0.0 && (0.0..=max).contains(&torque));
                prop_assert!((slope(torque) - least).abs() < 1e-9);
                for i in 0..=1_000 {
                    prop_assert!(slope(max * f64::from(i) / 1_000.0) >= least - 1e-9);
                }
            }
        }

        #[test]
        fn any_three_numbers_give_a_curve_or_a_reason(
            c in prop::array::uniform3(any::<f64>()), max in any::<f64>()
        ) {
            if let Ok(curve) = TorqueCurve::new(c, max) {
                prop_assert!(curve.at(f64::INFINITY) > 0.0 && curve.at(f64::MAX) <= MAX_PER_MILLE);
            }
        }
    }

    #[test]
    fn a_reason_says_where_the_slope_vanishes() {
        // Slope 1 - 3 u + 2 u² with u = t² / 4: zero at u = 1/2, so at √2 N·m.
        let error = TorqueCurve::new([1.0, -0.25, 0.025], 2.0).unwrap_err();
        let InvalidTorqueCurve::NotMonotone { torque, .. } = error else { panic!("{error}") };
        assert!((torque - 2.0_f64.sqrt()).abs() < 1e-12);
        let error = TorqueCurve::new([0.0, 1.0, 1.0], 2.0).unwrap_err();
        assert_eq!(error, InvalidTorqueCurve::NotMonotone { torque: 0.0, max_torque: 2.0 });
    }

    #[test]
    fn the_least_slope_may_be_within_the_range() {
        // 300 - 16.40625 s + 4.39453125 s² with s = t²: least at s = 28/15.
        let (slope, torque) = curve().least_slope();
        assert!((slope - 284.687_5).abs() < 1e-12);
        assert!((torque - (28.0_f64 / 15.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_slope_that_only_touches_zero_is_refused() {
        // Slope 1000 (1 - u)² with u = t²: flat at 1 N·m, rising on both sides of it.
        let error = TorqueCurve::new([1_000.0, -2_000.0 / 3.0, 200.0], 2.0).unwrap_err();
        let InvalidTorqueCurve::NotMonotone { torque, .. } = error else { panic!("{error}") };
        assert!((torque - 1.0).abs() < 1e-6);
        assert!(TorqueCurve::new([1_000.0, -2_000.0 / 3.0, 200.0], 0.99).is_ok());
    }

    #[test]
    fn beyond_the_range_the_polynomial_is_not_evaluated() {
        // 420 t - 55 t³ + 14 t⁵ was fitted up to 3 N·m; at 6 N·m it would give 99,504.
        let curve = TorqueCurve::new([420.0, -55.0, 14.0], 3.0).unwrap();
        assert!((curve.at(6.0) - curve.at(3.0)).abs() == 0.0);
    }

    #[test]
    fn other_reasons() {
        use InvalidTorqueCurve::{End, MaxTorque, NotFinite};
        assert!(matches!(TorqueCurve::new([1.0, 0.0, 0.0], 0.0), Err(MaxTorque(_))));
        assert!(matches!(TorqueCurve::new([1.0, 0.0, 0.0], f64::NAN), Err(MaxTorque(_))));
        assert!(matches!(
            TorqueCurve::new([1.0, f64::INFINITY, 0.0], 1.0),
            Err(NotFinite { power: 3, .. })
        ));
        assert!(matches!(TorqueCurve::new([40_000.0, 0.0, 0.0], 1.0), Err(End { .. })));
    }
}
