//! Damped least squares: joint rates for a twist of {MRF} (Nakamura and Hanafusa 1986; Maciejewski and Klein 1988).
//!
//! Translations of the twist are divided by a characteristic length, so that singular values are dimensionless.
//! With `A = S J = Σ σ_i u_i v_iᵀ` the rates are
//!
//! ```text
//!  qd = Σ σ_i / (σ_i² + λ_i²) v_i u_iᵀ S v_m        λ_i² = σ_0² (1 - (σ_i / σ_0)²)  where σ_i < σ_0, else 0
//! ```
//!
//! Away from singularities, with `σ_min ≥ σ_0`, the solution is exact and undamped. Near a singularity only its singular
//! directions are damped. The gain of every direction is at most `1 / σ_0`, so rates stay bounded.

use nalgebra::{SMatrix, SVector, SymmetricEigen};
use thiserror::Error;

use crate::chain::{Joints, MAX_JOINTS};
use units::spatial::{Jacobian, Twist};

/// Valid range of the singular value at which damping starts.
const MIN_THRESHOLD: f64 = 1e-3;
const MAX_THRESHOLD: f64 = 1.0;

/// Valid range of the characteristic length, in m.
const MIN_LENGTH: f64 = 1e-2;
const MAX_LENGTH: f64 = 1e2;

/// Damped least-squares inverse of a Jacobian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DampedInverse {
    threshold: f64,
    length: f64,
}

/// Setting out of range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidInverse {
    /// Threshold out of range.
    #[error("singular value must be within {MIN_THRESHOLD}..={MAX_THRESHOLD}, got {0}")]
    Threshold(f64),
    /// Length out of range.
    #[error("characteristic length must be within {MIN_LENGTH}..={MAX_LENGTH} m, got {0}")]
    Length(f64),
}

impl Default for DampedInverse {
    /// Damping below 0.05, with lengths over 0.5 m.
    fn default() -> Self {
        Self { threshold: 0.05, length: 0.5 }
    }
}

/// Inverse of one Jacobian, by its singular values and directions.
#[derive(Clone, Copy, Debug)]
pub struct PostureInverse {
    /// `A`: the Jacobian with translations over the characteristic length.
    scaled: SMatrix<f64, 6, MAX_JOINTS>,
    /// `u_i`, one per column.
    directions: SMatrix<f64, 6, 6>,
    /// `1 / (σ_i² + λ_i²)`.
    gains: SVector<f64, 6>,
    /// Smallest singular value.
    sigma_min: f64,
    length: f64,
}

impl DampedInverse {
    /// Creates an inverse that is damped below the singular value `threshold`, with lengths over `length` in m.
    ///
    /// # Errors
    /// Returns the value out of range, or NaN.
    pub fn new(threshold: f64, length: f64) -> Result<Self, InvalidInverse> {
        if !(MIN_THRESHOLD..=MAX_THRESHOLD).contains(&threshold) {
            return Err(InvalidInverse::Threshold(threshold));
        }
        if !(MIN_LENGTH..=MAX_LENGTH).contains(&length) {
            return Err(InvalidInverse::Length(length));
        }
        Ok(Self { threshold, length })
    }

    /// Returns σ_0, the singular value below which a direction is damped.
    pub const fn threshold(&self) -> f64 {
        self.threshold
    }

    /// Returns the characteristic length, in m.
    pub const fn length(&self) -> f64 {
        self.length
    }

    /// Inverts one Jacobian, which must be finite.
    pub fn invert(&self, j_m: &Jacobian<MAX_JOINTS>) -> PostureInverse {
        let mut scaled = j_m.matrix();
        scaled.fixed_rows_mut::<3>(0).scale_mut(self.length.recip());
        let SymmetricEigen { eigenvectors, eigenvalues } =
            SymmetricEigen::new(scaled * scaled.transpose());
        let start = self.threshold * self.threshold;
        // Rounding may leave a square slightly below zero.
        let squares = eigenvalues.map(|square| square.max(0.0));
        let gains = squares.map(|square| (square + (start - square).max(0.0)).recip());
        let sigma_min = squares.min().sqrt();
        PostureInverse { scaled, directions: eigenvectors, gains, sigma_min, length: self.length }
    }
}

impl PostureInverse {
    /// Returns the smallest singular value of the Jacobian, with lengths over the characteristic length.
    pub const fn sigma_min(&self) -> f64 {
        self.sigma_min
    }

    /// Computes the joint rates of minimum norm for a twist, damped near a singularity.
    pub fn rates(&self, v_m: &Twist) -> Joints {
        let Twist { linear, angular } = *v_m;
        let linear = linear / self.length;
        self.applied(&SVector::from([
            linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
        ]))
    }

    /// Projects joint rates into the null space of the Jacobian, where {MRF} is at rest.
    pub fn within_null_space(&self, qd: &Joints) -> Joints {
        qd - self.applied(&(self.scaled * qd))
    }

    fn applied(&self, scaled_twist: &SVector<f64, 6>) -> Joints {
        let along = self.directions.tr_mul(scaled_twist).component_mul(&self.gains);
        self.scaled.tr_mul(&(self.directions * along))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{eight_r, joints, puma};
    use units::math;

    fn twist() -> impl Strategy<Value = Twist> {
        prop::array::uniform6(-1.0..1.0_f64).prop_map(Twist::from_components)
    }

    /// Returns the maximum difference of two twists, in m/s or rad/s.
    fn difference(a: &Twist, b: &Twist) -> f64 {
        let pairs = a.components().into_iter().zip(b.components());
        pairs.fold(0.0, |most, (a, b)| most.max((a - b).abs()))
    }

    proptest! {
        #[test]
        fn twist_is_met_exactly_away_from_singularities(q in joints(2.5), v_m in twist()) {
            for chain in [puma(), eight_r()] {
                let (_, j_m) = chain.forward_and_jacobian(&q);
                let inverse = DampedInverse::default().invert(&j_m);
                if inverse.sigma_min() >= 0.05 {
                    let met = j_m.twist(&inverse.rates(&v_m));
                    prop_assert!(difference(&met, &v_m) < 1e-10, "{met:?} {v_m:?}");
                }
            }
        }

        #[test]
        fn rates_are_bounded_in_every_posture(q in joints(3.2), v_m in twist()) {
            for chain in [puma(), eight_r()] {
                let inverse = DampedInverse::default().invert(&chain.forward_and_jacobian(&q).1);
                let Twist { linear, angular } = v_m;
                let size = (linear.norm_squared() / 0.25 + angular.norm_squared()).sqrt();
                let rates = inverse.rates(&v_m);
                prop_assert!(rates.norm() <= size / 0.05 * (1.0 + 1e-9), "{rates}");
            }
        }

        #[test]
        fn null_space_motion_leaves_the_tool_at_rest(q in joints(2.5), qd in joints(1.0)) {
            let chain = eight_r();
            let (_, j_m) = chain.forward_and_jacobian(&q);
            let inverse = DampedInverse::default().invert(&j_m);
            if inverse.sigma_min() >= 0.05 {
                let still = inverse.within_null_space(&qd);
                prop_assert!(difference(&j_m.twist(&still), &Twist::ZERO) < 1e-10);
                // Two joints are redundant, and a projection is idempotent.
                let again = inverse.within_null_space(&still);
                prop_assert!((again - still).norm() < 1e-9);
            }
        }
    }

    #[test]
    fn stretched_arm_does_not_move_beyond_its_reach() {
        // The elbow of the PUMA is straight where the wrist is farthest from the shoulder.
        let (chain, inverse) = (puma(), DampedInverse::default());
        let straight = -math::atan2(0.4318, 0.0203);
        for bend in [0.0, 1e-3, 1e-2, 0.05, 0.2, -0.2] {
            let q = Joints::from([0.3, 0.8, straight + bend, 0.2, 0.9, 0.1, 0.0, 0.0, 0.0]);
            let (_, j_m) = chain.forward_and_jacobian(&q);
            let mut scaled = j_m.matrix();
            scaled.fixed_rows_mut::<3>(0).scale_mut(inverse.length().recip());
            let svd = scaled.svd(true, false);
            let (place, sigma) = svd.singular_values.argmin();
            let lost: SVector<f64, 6> = svd.u.unwrap().column(place).into();
            let outwards = Twist {
                linear: lost.fixed_rows::<3>(0) * inverse.length(),
                angular: lost.fixed_rows::<3>(3).into(),
            };
            let local = inverse.invert(&j_m);
            assert!(
                (local.sigma_min() - sigma).abs() < 1e-7 && (bend != 0.0 || sigma < 1e-9),
                "{sigma}"
            );
            // The response to a speed of 1 is (σ/σ_0)², zero at full reach.
            let rates = local.rates(&outwards);
            let part = math::powf(sigma / inverse.threshold(), 2.0).min(1.0);
            let moved = lost.dot(&(scaled * rates));
            assert!((moved - part).abs() < 1e-6, "moves by {moved}, not {part}, at {bend} rad");
            assert!((rates.norm() * sigma.max(1e-9) - part).abs() < 1e-6, "{bend} rad: {rates}");
            assert!(bend != 0.0 || rates.norm() < 1e-3, "{rates}");
        }
    }

    #[test]
    fn invalid_settings_are_refused() {
        for wrong in [0.0, -1.0, 1e3, f64::NAN] {
            assert!(DampedInverse::new(wrong, 0.5).is_err());
        }
        assert!(DampedInverse::new(0.05, 0.0).is_err() && DampedInverse::new(0.05, 0.5).is_ok());
    }
}
