//! Between what drives count and what physics measures: encoder counts to joint positions, joint
//! torques to per mille of rated torque (4.2, Fig. 6). The only place of either unit.
//!
//! Not the limits of the loop; a torque beyond the calibrated range is only cut off, so that the
//! polynomial is never evaluated where nobody measured. Decisions 24 and 25.

use std::f64::consts::TAU;

use nalgebra::SVector;
use thiserror::Error;

/// A position as a drive gives it (6064h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts(pub i32);

/// A torque as a drive takes it (6071h) or gives it (6077h): thousandths of its rated torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PerMille(pub i16);

/// The largest torque a drive can be asked for.
const LARGEST: f64 = 32_767.0;
/// Gear ratios between these keep positions exact and finite.
const RATIOS: std::ops::RangeInclusive<f64> = 1e-3..=1e9;
/// What rounding may hide when a slope is compared with zero; such curves are refused.
const ROUNDING: f64 = 1e-12;
/// Halvings of the range that find a torque to within 1e-15 of it.
const HALVINGS: u32 = 52;

/// The measured curve of one joint: per mille of rated torque, `c1 t + c3 t³ + c5 t⁵` for a joint
/// torque `t` in N·m, strictly rising up to the end of the measured range. Odd, as the paper found
/// its joints (4.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueCurve {
    coefficients: [f64; 3],
    max_torque: f64,
}

/// Why three coefficients are no torque curve.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidTorqueCurve {
    /// The end of the calibrated range.
    #[error("a calibrated range up to {0} N·m is none")]
    MaxTorque(f64),
    /// A coefficient.
    #[error("c{power} = {value} is not a finite number")]
    NotFinite {
        /// 1, 3 or 5.
        power: u8,
        /// What stood there.
        value: f64,
    },
    /// More torque must ask for more: there the slope vanishes.
    #[error("the curve stops rising at {torque:.3} N·m, within its range up to {max_torque} N·m")]
    NotMonotone {
        /// Where its slope is zero for the first time, in N·m.
        torque: f64,
        /// The end of its range, in N·m.
        max_torque: f64,
    },
    /// No drive can be asked for so much, or would notice so little.
    #[error("the curve ends at {per_mille} ‰ of rated torque, not within 1 ‰ and {LARGEST} ‰")]
    End {
        /// What it gives at the end of its range.
        per_mille: f64,
    },
}

impl TorqueCurve {
    /// From its coefficients (c1, c3, c5) in ‰ per N·m, N·m³, N·m⁵, and the end of the calibrated
    /// range in N·m (N for a sliding joint).
    ///
    /// # Errors
    /// Unless the curve is proven to rise over the whole range and to end where a drive can follow.
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
        if (1.0..=LARGEST).contains(&per_mille) {
            Ok(curve)
        } else {
            Err(InvalidTorqueCurve::End { per_mille })
        }
    }

    /// The end of the calibrated range: the most this joint is ever asked for, in N·m.
    pub const fn max_torque(&self) -> f64 {
        self.max_torque
    }

    /// Per mille of rated torque for a joint torque in N·m, not yet whole; beyond the range, its end.
    fn at(&self, torque: f64) -> f64 {
        self.evaluate(torque.clamp(-self.max_torque, self.max_torque))
    }

    /// The joint torque in N·m for which the curve gives `per_mille`; beyond its end, its end. By
    /// halving, which cannot fail on a rising curve.
    fn torque(&self, per_mille: f64) -> f64 {
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

    fn evaluate(&self, t: f64) -> f64 {
        let [c1, c3, c5] = self.coefficients;
        t * (c1 + t * t * (c3 + t * t * c5))
    }
}

/// The smallest torque in N·m within 0 and `max_torque` at which the slope is not positive.
///
/// The slope is the quadratic `c1 + 3 c3 s + 5 c5 s²` in `s = t²`. Positive at 0, it is positive
/// up to its smallest positive root, if it has one: a proof, not a sampling.
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
        return Some(0.0); // next to the others, c1 is no slope at all
    }
    if discriminant < -ROUNDING * b * b {
        return None;
    }
    // The largest v = 1 / u of v² + b v + a = 0, without the difference of two near numbers.
    let root = discriminant.max(0.0).sqrt();
    let inverse = if b > 0.0 { -2.0 * a / (b + root) } else { (root - b) / 2.0 };
    (inverse >= 1.0 - ROUNDING).then(|| inverse.sqrt().recip().min(1.0) * max_torque)
}

/// How one joint is counted and driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointCalibration {
    /// Counts per rad, or per m of a sliding joint; negative where the motor turns against it.
    counts_per_unit: f64,
    zero_counts: i32,
    curve: TorqueCurve,
}

/// Why a joint cannot be counted.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidJointCalibration {
    /// An encoder without counts.
    #[error("an encoder of 0 counts per revolution")]
    NoCounts,
    /// A gear that does not move, or is none.
    #[error("gear ratio {0} is not within 0.001 and 1e9 either way")]
    GearRatio(f64),
}

impl JointCalibration {
    /// From the encoder's counts per revolution of the motor, motor revolutions per revolution of
    /// the joint (motor rad per m for a sliding joint; negative where they turn against each
    /// other), the counts at position zero, and the torque curve.
    ///
    /// # Errors
    /// Unless counts and gear ratio give finite positions.
    pub fn new(
        counts_per_rev: u32,
        gear_ratio: f64,
        zero_counts: i32,
        curve: TorqueCurve,
    ) -> Result<Self, InvalidJointCalibration> {
        if counts_per_rev == 0 {
            return Err(InvalidJointCalibration::NoCounts);
        }
        if !RATIOS.contains(&gear_ratio.abs()) {
            return Err(InvalidJointCalibration::GearRatio(gear_ratio));
        }
        let counts_per_unit = f64::from(counts_per_rev) * gear_ratio / TAU;
        Ok(Self { counts_per_unit, zero_counts, curve })
    }

    /// The position, in rad or m. A count that has run over the end of 32 bits since zero is right.
    fn position(&self, counts: Counts) -> f64 {
        f64::from(counts.0.wrapping_sub(self.zero_counts)) / self.counts_per_unit
    }

    /// The counts nearest to a position in rad or m.
    fn counts(&self, position: f64) -> Counts {
        Counts(whole_i32(position * self.counts_per_unit).wrapping_add(self.zero_counts))
    }

    /// The target nearest to a joint torque in N·m.
    fn target(&self, torque: f64) -> PerMille {
        PerMille(whole_i16(self.curve.at(torque) * self.direction()))
    }

    /// The target of the largest torque, whichever way the motor turns.
    pub fn max_target(&self) -> PerMille {
        PerMille(whole_i16(self.curve.at(self.curve.max_torque()).ceil()))
    }

    /// The torque of one per mille near zero, in N·m: what a target cannot resolve.
    pub fn resolution(&self) -> f64 {
        self.curve.torque(1.0)
    }

    /// The joint torque in N·m that a target asks for.
    fn torque(&self, target: PerMille) -> f64 {
        self.curve.torque(f64::from(target.0) * self.direction())
    }

    /// -1 where the motor turns against the joint.
    fn direction(&self) -> f64 {
        self.counts_per_unit.signum()
    }
}

/// How all joints are counted and driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration<const N: usize>([JointCalibration; N]);

impl<const N: usize> Calibration<N> {
    /// Of joints, base first.
    pub const fn new(joints: [JointCalibration; N]) -> Self {
        Self(joints)
    }

    /// Joint positions, in rad or m.
    pub fn positions(&self, counts: &[Counts; N]) -> SVector<f64, N> {
        let joints = self.0.iter().zip(counts);
        SVector::from_iterator(joints.map(|(joint, counts)| joint.position(*counts)))
    }

    /// The counts nearest to joint positions: what the drives would say there.
    pub fn counts(&self, q: &SVector<f64, N>) -> [Counts; N] {
        let mut counts = [Counts(0); N];
        for ((joint, position), counts) in self.0.iter().zip(q.iter()).zip(&mut counts) {
            *counts = joint.counts(*position);
        }
        counts
    }

    /// What to ask of the drives for joint torques in N·m or N, which must be finite.
    pub fn targets(&self, tau: &SVector<f64, N>) -> [PerMille; N] {
        let mut targets = [PerMille(0); N];
        for ((joint, torque), target) in self.0.iter().zip(tau.iter()).zip(&mut targets) {
            *target = joint.target(*torque);
        }
        targets
    }

    /// The joint torques that drives say they exert, in N·m or N.
    pub fn torques(&self, actual: &[PerMille; N]) -> SVector<f64, N> {
        let joints = self.0.iter().zip(actual);
        SVector::from_iterator(joints.map(|(joint, actual)| joint.torque(*actual)))
    }

    /// The most each joint may be asked for: the ends of the calibrated ranges, in N·m or N.
    pub fn max_torques(&self) -> SVector<f64, N> {
        SVector::from_iterator(self.0.iter().map(|joint| joint.curve.max_torque()))
    }
}

/// The nearest whole number, halves to the even one; the nearest end beyond 16 bits.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "saturates at the ends of i16; NaN would become zero torque"
)]
fn whole_i16(value: f64) -> i16 {
    value.round_ties_even() as i16
}

/// The nearest whole number, halves to the even one; the nearest end beyond 32 bits.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "saturates at the ends of i32; NaN would become zero"
)]
fn whole_i32(value: f64) -> i32 {
    value.round_ties_even() as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn curve() -> TorqueCurve {
        TorqueCurve::new([300.0, -5.468_75, 0.878_906_25], 4.0).unwrap()
    }

    fn joint(gear_ratio: f64, zero_counts: i32) -> JointCalibration {
        JointCalibration::new(16_384, gear_ratio, zero_counts, curve()).unwrap()
    }

    proptest! {
        #[test]
        fn more_torque_asks_for_more(a in -5.0..5.0_f64, b in -5.0..5.0_f64) {
            let (low, high) = (a.min(b), a.max(b));
            prop_assert!(curve().at(low) <= curve().at(high));
        }

        #[test]
        fn both_driving_directions_are_alike(t in -5.0..5.0_f64) {
            prop_assert!((curve().at(t) + curve().at(-t)).abs() == 0.0);
            prop_assert_eq!(joint(40.0, 0).target(t).0, joint(-40.0, 0).target(-t).0);
        }

        #[test]
        fn any_number_gives_a_target_within_the_range(t in any::<f64>()) {
            prop_assert!(joint(40.0, 0).target(t).0.abs() <= 1750);
        }

        #[test]
        fn a_curve_is_accepted_exactly_if_it_rises_everywhere(
            c1 in -50.0..200.0_f64, c3 in -50.0..50.0_f64, c5 in -5.0..5.0_f64, max in 0.1..6.0_f64
        ) {
            let slope = |t: f64| c1 + 3.0 * c3 * t * t + 5.0 * c5 * t.powi(4);
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
        fn any_three_numbers_give_a_curve_or_a_reason(
            c in prop::array::uniform3(any::<f64>()), max in any::<f64>()
        ) {
            if let Ok(curve) = TorqueCurve::new(c, max) {
                prop_assert!(curve.at(f64::INFINITY) > 0.0 && curve.at(f64::MAX) <= LARGEST);
            }
        }

        #[test]
        fn what_a_drive_exerts_is_what_it_was_asked_for(t in -4.0..4.0_f64) {
            let joint = joint(-40.0, 0);
            prop_assert!((joint.torque(joint.target(t)) - t).abs() < 0.5 / 284.0 + 1e-9);
        }

        #[test]
        fn a_position_is_within_half_a_count_of_its_counts(
            q in -3.0..3.0_f64, zero in any::<i32>()
        ) {
            for gear_ratio in [40.0, -40.0] {
                let joint = joint(gear_ratio, zero);
                let count = TAU / (16_384.0 * 40.0);
                let again = joint.position(joint.counts(q));
                prop_assert!((again - q).abs() <= 0.501 * count);
            }
        }

        #[test]
        fn counts_may_run_over_the_end_of_32_bits(zero in any::<i32>(), moved in -300_000..300_000) {
            let here = joint(40.0, zero).position(Counts(zero.wrapping_add(moved)));
            prop_assert!((here - joint(40.0, 0).position(Counts(moved))).abs() == 0.0);
        }
    }

    #[test]
    fn one_turn_of_the_joint_is_the_gear_ratio_in_turns_of_the_motor() {
        let turned = |gear_ratio| joint(gear_ratio, 7).position(Counts(7 + 40 * 16_384));
        assert!((turned(40.0) - TAU).abs() < 1e-15 && (turned(-40.0) + TAU).abs() < 1e-15);
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
    fn a_slope_that_only_touches_zero_is_refused() {
        // Slope 1000 (1 - u)² with u = t²: flat at 1 N·m, rising on both sides of it.
        let error = TorqueCurve::new([1_000.0, -2_000.0 / 3.0, 200.0], 2.0).unwrap_err();
        let InvalidTorqueCurve::NotMonotone { torque, .. } = error else { panic!("{error}") };
        assert!((torque - 1.0).abs() < 1e-6);
        assert!(TorqueCurve::new([1_000.0, -2_000.0 / 3.0, 200.0], 0.99).is_ok());
    }

    #[test]
    fn other_reasons() {
        use InvalidTorqueCurve::End;
        use InvalidTorqueCurve::MaxTorque;
        use InvalidTorqueCurve::NotFinite;
        assert!(matches!(TorqueCurve::new([1.0, 0.0, 0.0], 0.0), Err(MaxTorque(_))));
        assert!(matches!(TorqueCurve::new([1.0, 0.0, 0.0], f64::NAN), Err(MaxTorque(_))));
        assert!(matches!(
            TorqueCurve::new([1.0, f64::INFINITY, 0.0], 1.0),
            Err(NotFinite { power: 3, .. })
        ));
        assert!(matches!(TorqueCurve::new([40_000.0, 0.0, 0.0], 1.0), Err(End { .. })));
        let curve = curve();
        assert!(JointCalibration::new(0, 1.0, 0, curve).is_err());
        assert!(JointCalibration::new(1, 0.0, 0, curve).is_err());
        assert!(JointCalibration::new(1, f64::NAN, 0, curve).is_err());
    }

    #[test]
    fn beyond_the_range_the_polynomial_is_not_evaluated() {
        // 420 t - 55 t³ + 14 t⁵ was fitted up to 3 N·m; at 6 N·m it would give 99,504.
        let curve = TorqueCurve::new([420.0, -55.0, 14.0], 3.0).unwrap();
        assert!((curve.at(6.0) - curve.at(3.0)).abs() == 0.0);
    }

    #[test]
    fn halves_go_to_the_even_number() {
        let curve = TorqueCurve::new([1.0, 0.0, 0.0], 10.0).unwrap();
        let joint = JointCalibration::new(4096, 1.0, 0, curve).unwrap();
        let targets = [0.5, 1.5, 2.5, -0.5, -1.5].map(|t| joint.target(t).0);
        assert_eq!(targets, [0, 2, 2, 0, -2]);
    }
}
