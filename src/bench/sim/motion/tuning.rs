//! Servo tuning: inertia and friction of the load.

use std::f64::consts::TAU;

use thiserror::Error;

/// Inertia and friction in the units of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Inertia in ‰ of rated torque per increment/s²; positive.
    pub(super) inertia: f64,
    /// Viscous friction in ‰ of rated torque per increment/s; not negative.
    pub(super) viscous: f64,
}

/// Load of a joint, in SI units at the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Inertia of the moved links and the motor in a middle posture, in kg·m² (kg). The loops tolerate a factor of three up
    /// or down.
    pub inertia: f64,
    /// Viscous friction, in N·m·s/rad (N·s/m).
    pub viscous: f64,
    /// Increments per revolution of the joint, of either sign: `608Fh` times the gear ratio. For a prismatic joint, per
    /// 2π m.
    pub counts_per_turn: f64,
    /// Torque scale near zero: ‰ of rated torque per N·m (N) at the joint, of either sign.
    pub per_mille_per_newton_metre: f64,
}

/// Reasons to refuse a load.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum InvalidLoad {
    /// Inertia is not positive.
    #[error("inertia must be positive, got {0} kg·m²")]
    Inertia(f64),
    /// Viscous friction is negative or NaN.
    #[error("viscous friction must not be negative, got {0} N·m·s/rad")]
    Viscous(f64),
    /// Increments per revolution are zero or not finite.
    #[error("increments per turn must be finite and not zero, got {0}")]
    CountsPerTurn(f64),
    /// Torque scale is zero or not finite.
    #[error("torque scale must be finite and not zero, got {0} ‰ per N·m")]
    PerMille(f64),
}

impl Tuning {
    /// Converts a load to the units of the drive.
    ///
    /// # Errors
    /// Returns the first invalid value.
    pub fn from_load(load: &Load) -> Result<Self, InvalidLoad> {
        let Load { inertia, viscous, counts_per_turn, per_mille_per_newton_metre } = *load;
        if !(inertia.is_finite() && inertia > 0.0) {
            return Err(InvalidLoad::Inertia(inertia));
        }
        if !(viscous.is_finite() && viscous >= 0.0) {
            return Err(InvalidLoad::Viscous(viscous));
        }
        if !(counts_per_turn.is_finite() && counts_per_turn.abs() > 0.0) {
            return Err(InvalidLoad::CountsPerTurn(counts_per_turn));
        }
        if !(per_mille_per_newton_metre.is_finite() && per_mille_per_newton_metre.abs() > 0.0) {
            return Err(InvalidLoad::PerMille(per_mille_per_newton_metre));
        }
        // rad per increment, times ‰ per N·m.
        let scale = (TAU / counts_per_turn * per_mille_per_newton_metre).abs();
        Ok(Self { inertia: inertia * scale, viscous: viscous * scale })
    }
}

impl Default for Tuning {
    /// Returns the tuning of a middle joint: 0.02 kg·m², 16,384 increments, gear ratio 40, 7.5 N·m at rated torque.
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
    fn tuning_follows_newtons_law() {
        let tuning = Tuning::from_load(&LOAD).unwrap();
        let increments = 655_360.0 / TAU;
        let per_mille = tuning.inertia * 10.0 * increments;
        assert!((per_mille - 0.02 * 10.0 * 133.0).abs() < 1e-9, "10 rad/s²");
        let per_mille = tuning.viscous * 3.0 * increments;
        assert!((per_mille - 0.1 * 3.0 * 133.0).abs() < 1e-9, "3 rad/s");
        assert!((tuning.inertia / Tuning::default().inertia - 1.0).abs() < 0.05);
    }

    #[test]
    fn inverted_gear_gives_the_same_tuning() {
        let turned =
            Load { counts_per_turn: -655_360.0, per_mille_per_newton_metre: -133.0, ..LOAD };
        assert_eq!(Tuning::from_load(&turned), Tuning::from_load(&LOAD));
    }

    #[test]
    fn invalid_loads_are_refused() {
        for (load, why) in [
            (Load { inertia: 0.0, ..LOAD }, InvalidLoad::Inertia(0.0)),
            (Load { viscous: -1.0, ..LOAD }, InvalidLoad::Viscous(-1.0)),
            (Load { counts_per_turn: 0.0, ..LOAD }, InvalidLoad::CountsPerTurn(0.0)),
            (
                Load { per_mille_per_newton_metre: f64::INFINITY, ..LOAD },
                InvalidLoad::PerMille(f64::INFINITY),
            ),
        ] {
            assert_eq!(Tuning::from_load(&load), Err(why));
        }
    }
}
