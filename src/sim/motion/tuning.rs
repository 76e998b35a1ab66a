//! What the servo has to know of the mechanics it moves.

use std::f64::consts::TAU;

use thiserror::Error;

/// Inertia and friction, as a drive sees them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// In ‰ of rated torque per increment/s²; positive.
    pub(super) inertia: f64,
    /// In ‰ of rated torque per increment/s; not negative.
    pub(super) viscous: f64,
}

/// What a joint is like, seen from the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Of all that the joint moves, its motor with it, in kg·m² (kg). A middle value does: it may be three
    /// times less or more in other postures.
    pub inertia: f64,
    /// Viscous friction, in N·m·s/rad (N·s/m).
    pub viscous: f64,
    /// Increments per turn of the joint, of either sign: `608Fh` times the gear ratio. For a joint that
    /// slides, per 2π m.
    pub counts_per_turn: f64,
    /// ‰ of rated torque per N·m (N) at the joint near zero, of either sign.
    pub per_mille_per_newton_metre: f64,
}

/// Why a servo cannot be tuned to a load.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum Untunable {
    /// Nothing to move.
    #[error("an inertia of {0} kg·m² is not positive")]
    Inertia(f64),
    /// Friction that drives.
    #[error("a viscous friction of {0} N·m·s/rad is negative or no number")]
    Viscous(f64),
    /// No encoder.
    #[error("{0} increments per turn are none")]
    CountsPerTurn(f64),
    /// No motor.
    #[error("{0} ‰ per N·m are none")]
    PerMille(f64),
}

impl Tuning {
    /// That for a load.
    ///
    /// # Errors
    /// If the load cannot be.
    pub fn of(load: &Load) -> Result<Self, Untunable> {
        let Load { inertia, viscous, counts_per_turn, per_mille_per_newton_metre } = *load;
        if !(inertia.is_finite() && inertia > 0.0) {
            return Err(Untunable::Inertia(inertia));
        }
        if !(viscous.is_finite() && viscous >= 0.0) {
            return Err(Untunable::Viscous(viscous));
        }
        if !(counts_per_turn.is_finite() && counts_per_turn.abs() > 0.0) {
            return Err(Untunable::CountsPerTurn(counts_per_turn));
        }
        if !(per_mille_per_newton_metre.is_finite() && per_mille_per_newton_metre.abs() > 0.0) {
            return Err(Untunable::PerMille(per_mille_per_newton_metre));
        }
        // rad per increment, times ‰ per N·m.
        let scale = (TAU / counts_per_turn * per_mille_per_newton_metre).abs();
        Ok(Self { inertia: inertia * scale, viscous: viscous * scale })
    }
}

impl Default for Tuning {
    /// That of an arm joint of middle size: 0.02 kg·m² behind 16,384 increments and a gear of 40, 7.5 N·m
    /// at rated torque.
    fn default() -> Self {
        Self { inertia: 2.5e-5, viscous: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOAD: Load = Load {
        inertia: 0.02,
        viscous: 0.1,
        counts_per_turn: 655_360.0,
        per_mille_per_newton_metre: 133.0,
    };

    #[test]
    fn a_joint_is_accelerated_by_what_newton_says() {
        let tuning = Tuning::of(&LOAD).unwrap();
        let increments = 655_360.0 / TAU;
        let per_mille = tuning.inertia * 10.0 * increments;
        assert!((per_mille - 0.02 * 10.0 * 133.0).abs() < 1e-9, "10 rad/s²");
        let per_mille = tuning.viscous * 3.0 * increments;
        assert!((per_mille - 0.1 * 3.0 * 133.0).abs() < 1e-9, "3 rad/s");
        assert!((tuning.inertia / Tuning::default().inertia - 1.0).abs() < 0.05);
    }

    #[test]
    fn a_gear_that_turns_the_motor_round_turns_torque_and_encoder_both() {
        let turned =
            Load { counts_per_turn: -655_360.0, per_mille_per_newton_metre: -133.0, ..LOAD };
        assert_eq!(Tuning::of(&turned), Tuning::of(&LOAD));
    }

    #[test]
    fn a_load_that_cannot_be_is_named() {
        for (load, why) in [
            (Load { inertia: 0.0, ..LOAD }, Untunable::Inertia(0.0)),
            (Load { viscous: -1.0, ..LOAD }, Untunable::Viscous(-1.0)),
            (Load { counts_per_turn: 0.0, ..LOAD }, Untunable::CountsPerTurn(0.0)),
            (
                Load { per_mille_per_newton_metre: f64::INFINITY, ..LOAD },
                Untunable::PerMille(f64::INFINITY),
            ),
        ] {
            assert_eq!(Tuning::of(&load), Err(why));
        }
    }
}
