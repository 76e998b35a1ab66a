//! Conversion between drive units and SI: encoder counts to joint positions, joint torques to per mille of rated torque
//! by their torque curves (4.2, Fig. 6; decisions 24 and 25).
//!
//! A torque beyond the calibrated range saturates, so that the polynomial is never evaluated outside of it.
//! [`limits`](crate::limits) scales torques before that.

use std::f64::consts::TAU;

use nalgebra::SVector;
use thiserror::Error;

use crate::coupling::Coupling;
pub use crate::torque_curve::{InvalidTorqueCurve, TorqueCurve};
use units::drive::{Counts, PerMille};

/// Valid magnitudes of a gear ratio; positions stay exact and finite.
const RATIOS: std::ops::RangeInclusive<f64> = 1e-3..=1e9;

/// Encoder, gear and torque curve of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointCalibration {
    /// Counts per rad, or per m of a prismatic joint; negative if motor and joint turn in opposite directions.
    counts_per_unit: f64,
    zero_counts: i32,
    curve: TorqueCurve,
}

/// Reason why a joint's calibration is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidJointCalibration {
    /// Zero counts per revolution.
    #[error("an encoder of 0 counts per revolution")]
    NoCounts,
    /// Gear ratio whose magnitude is not within 0.001 and 1e9.
    #[error("gear ratio {0} is not within 0.001 and 1e9 either way")]
    GearRatio(f64),
}

impl JointCalibration {
    /// Creates the calibration of a joint. `counts_per_rev` counts one motor revolution; `zero_counts` is the actual
    /// position (6064h) at joint position zero. `gear_ratio` is motor revolutions per joint revolution, or motor rad per m;
    /// negative if they turn in opposite directions.
    ///
    /// # Errors
    /// Returns an error for zero counts, or a gear ratio out of range.
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

    /// Converts counts to a position in rad or m, modulo 2³² counts.
    fn position(&self, counts: Counts) -> f64 {
        f64::from(counts.0.wrapping_sub(self.zero_counts)) / self.counts_per_unit
    }

    /// Converts a position in rad or m to the nearest counts.
    fn counts(&self, position: f64) -> Counts {
        Counts(whole_i32(position * self.counts_per_unit).wrapping_add(self.zero_counts))
    }

    /// Converts a torque in N·m or N to the nearest target.
    fn target(&self, torque: f64) -> PerMille {
        PerMille(whole_i16(self.curve.at(torque) * self.direction()))
    }

    /// Magnitude of the target at the end of the calibrated range, rounded up.
    pub fn max_target(&self) -> PerMille {
        PerMille(whole_i16(self.curve.at(self.curve.max_torque()).ceil()))
    }

    /// Replaces the torque curve.
    #[must_use]
    pub const fn with_curve(self, curve: TorqueCurve) -> Self {
        Self { curve, ..self }
    }

    /// Curve from joint torque to per mille of rated torque.
    pub const fn curve(&self) -> &TorqueCurve {
        &self.curve
    }

    /// Resolution of a target near zero, in N·m or N: the torque of 1 ‰.
    pub fn resolution(&self) -> f64 {
        self.curve.torque(1.0)
    }

    /// Resolution of the position, in rad or m: one count.
    pub const fn quantum(&self) -> f64 {
        self.counts_per_unit.recip().abs()
    }

    /// Converts the magnitude of a motion in rad or m to counts, at most 2³¹ - 1.
    pub fn span(&self, motion: f64) -> u32 {
        whole_i32(motion * self.counts_per_unit).unsigned_abs()
    }

    /// Rounds a number of counts, at most ±2³¹.
    pub fn whole_counts(&self, counts: f64) -> i32 {
        whole_i32(counts)
    }

    /// Converts a target to a torque in N·m or N.
    fn torque(&self, target: PerMille) -> f64 {
        self.curve.torque(f64::from(target.0) * self.direction())
    }

    /// Returns -1 if motor and joint turn in opposite directions, else 1.
    fn direction(&self) -> f64 {
        self.counts_per_unit.signum()
    }
}

/// Calibration of all actuators, and their coupling with the joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration<const N: usize> {
    actuators: [JointCalibration; N],
    coupling: Coupling<N>,
}

impl<const N: usize> Calibration<N> {
    /// Creates the calibration of uncoupled joints, base first.
    pub fn new(actuators: [JointCalibration; N]) -> Self {
        Self { actuators, coupling: Coupling::none() }
    }

    /// Replaces the coupling of actuators and joints.
    #[must_use]
    pub const fn coupled(self, coupling: Coupling<N>) -> Self {
        Self { coupling, ..self }
    }

    /// Coupling of actuators and joints.
    pub const fn coupling(&self) -> &Coupling<N> {
        &self.coupling
    }

    /// Converts actual positions (6064h) to joint positions, in rad or m.
    pub fn positions(&self, counts: &[Counts; N]) -> SVector<f64, N> {
        let counted = self.actuators.iter().zip(counts);
        let m = counted.map(|(actuator, counts)| actuator.position(*counts));
        self.coupling.joints(&SVector::from_iterator(m))
    }

    /// Converts joint positions to the nearest counts (6064h).
    pub fn counts(&self, q: &SVector<f64, N>) -> [Counts; N] {
        let m = self.coupling.actuators(q);
        let mut counts = [Counts(0); N];
        for ((actuator, position), counts) in self.actuators.iter().zip(m.iter()).zip(&mut counts) {
            *counts = actuator.counts(*position);
        }
        counts
    }

    /// Converts joint torques in N·m or N, which must be finite, to target torques (6071h).
    pub fn targets(&self, tau: &SVector<f64, N>) -> [PerMille; N] {
        let tau_a = self.coupling.at_actuators(tau);
        let mut targets = [PerMille(0); N];
        for ((actuator, torque), target) in
            self.actuators.iter().zip(tau_a.iter()).zip(&mut targets)
        {
            *target = actuator.target(*torque);
        }
        targets
    }

    /// Converts actual torques (6077h) to joint torques, in N·m or N.
    pub fn torques(&self, actual: &[PerMille; N]) -> SVector<f64, N> {
        let exerted = self.actuators.iter().zip(actual);
        let tau_a = exerted.map(|(actuator, actual)| actuator.torque(*actual));
        self.coupling.at_joints(&SVector::from_iterator(tau_a))
    }

    /// Converts held targets to actuator torques, in N·m or N. `tau_a` are the torques of `targets`, and replace the
    /// conversion where both targets agree.
    pub(crate) fn held_torques(
        &self,
        held: &[PerMille; N],
        targets: &[PerMille; N],
        tau_a: &SVector<f64, N>,
    ) -> SVector<f64, N> {
        let mut torques = *tau_a;
        let pairs = held.iter().zip(targets);
        for ((torque, (held, target)), actuator) in
            torques.iter_mut().zip(pairs).zip(&self.actuators)
        {
            // The inverse of a curve dominates the cost.
            if held != target {
                *torque = actuator.torque(*held);
            }
        }
        torques
    }

    /// Capacity of each actuator, in N·m or N: the end of its calibrated range.
    pub fn max_torques(&self) -> SVector<f64, N> {
        SVector::from_iterator(self.actuators.iter().map(|actuator| actuator.curve.max_torque()))
    }
}

/// Rounds to the nearest `i16`, ties to even, saturating.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "saturates at the ends of i16; NaN would become zero torque"
)]
fn whole_i16(value: f64) -> i16 {
    value.round_ties_even() as i16
}

/// Rounds to the nearest `i32`, ties to even, saturating.
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
    use proptest::prelude::*;

    use super::*;

    fn curve() -> TorqueCurve {
        TorqueCurve::new([300.0, -5.468_75, 0.878_906_25], 4.0).unwrap()
    }

    fn joint(gear_ratio: f64, zero_counts: i32) -> JointCalibration {
        JointCalibration::new(16_384, gear_ratio, zero_counts, curve()).unwrap()
    }

    proptest! {
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
        fn counts_may_run_over_the_end_of_32_bits(
            before in 0..300_000_i32, beyond in 1..300_000_i32, is_upwards in any::<bool>()
        ) {
            // The path crosses the end of the range.
            let moved = if is_upwards { before + beyond } else { -before - beyond };
            let zero = if is_upwards { i32::MAX - before } else { i32::MIN + before };
            prop_assert!(zero.checked_add(moved).is_none());
            let here = joint(40.0, zero).position(Counts(zero.wrapping_add(moved)));
            prop_assert!((here - joint(40.0, 0).position(Counts(moved))).abs() == 0.0);
        }
    }

    #[test]
    fn one_joint_turn_is_gear_ratio_motor_turns() {
        let turned = |gear_ratio| joint(gear_ratio, 7).position(Counts(7 + 40 * 16_384));
        assert!((turned(40.0) - TAU).abs() < 1e-15 && (turned(-40.0) + TAU).abs() < 1e-15);
    }

    #[test]
    fn zero_counts_and_invalid_gear_ratio_are_refused() {
        let curve = curve();
        assert!(JointCalibration::new(0, 1.0, 0, curve).is_err());
        assert!(JointCalibration::new(1, 0.0, 0, curve).is_err());
        assert!(JointCalibration::new(1, f64::NAN, 0, curve).is_err());
    }

    #[test]
    fn halves_go_to_the_even_number() {
        let curve = TorqueCurve::new([1.0, 0.0, 0.0], 10.0).unwrap();
        let joint = JointCalibration::new(4096, 1.0, 0, curve).unwrap();
        let targets = [0.5, 1.5, 2.5, -0.5, -1.5].map(|t| joint.target(t).0);
        assert_eq!(targets, [0, 2, 2, 0, -2]);
    }
}
