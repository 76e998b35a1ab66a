//! Dynamics of the grip in all six axes, and their reduction to one axis.
//!
//! A force along axis `i` moves the grip along the other axes, too, where the hand and K_D resist. At frequency ω the
//! motion is `u = Z⁻¹ eᵢ/(Z⁻¹)ᵢᵢ` with the impedance `Z = K_h + jω(D + b_h + K_D) - ω² Λ`. A mass
//! `m = uᴴ Λ u`, a damper `b = uᴴ D u` and a spring `K = uᴴ K_h u` together have exactly the same impedance at that
//! frequency.

use nalgebra::{Complex, Matrix6, SVector};

use crate::JointVector;
use crate::arm::Arm;
use crate::stability::axis::Impedance;
use crate::stability::device::Massless;

/// Mobility added on every axis to bound the inertia at a singularity, in 1/kg or 1/(kg·m²).
const LEAST_MOBILITY: f64 = 1e-4;

/// Inertia and viscous damping of the grip at one posture.
#[derive(Clone, Debug, PartialEq)]
pub struct GripDynamics {
    /// Description of the posture, for messages.
    pub posture: String,
    /// Λ = (J M⁻¹ Jᵀ)⁻¹.
    inertia: Matrix6<f64>,
    /// D = J̄ᵀ B J̄, from the joints' viscous friction B.
    damping: Matrix6<f64>,
}

/// Impedance of the hand, and K_D, on each axis.
#[derive(Clone, Copy, Debug)]
pub struct Restraint {
    /// K_h and b_h.
    pub hand: [Impedance; 6],
    /// K_D, in N·s/m or N·m·s/rad.
    pub damping: [f64; 6],
}

/// Equivalent mass, dampers and spring of the grip along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReducedGrip {
    /// Mass, in kg or kg·m².
    pub mass: f64,
    /// Damping of device and hand, in N·s/m or N·m·s/rad.
    pub damping: f64,
    /// Stiffness of the hand, in N/m or N·m/rad.
    pub stiffness: f64,
    /// K_D, sampled and delayed, in N·s/m or N·m·s/rad.
    pub sampled_damping: f64,
}

impl GripDynamics {
    /// Computes the dynamics of `arm` with its joints at `q` and their viscous friction in N·m·s/rad or N·s/m.
    ///
    /// # Errors
    /// Returns [`Massless`] if the mass matrix or the mobility has no inverse.
    pub fn at(
        arm: &Arm<6>,
        viscous: &[f64; 6],
        q: &JointVector,
        posture: String,
    ) -> Result<Self, Massless> {
        let at = arm.posture(q);
        let mass = arm.mass_matrix(&at).cholesky().ok_or(Massless)?;
        let j_g = arm.jacobian(&at).matrix();
        let least = Matrix6::identity() * LEAST_MOBILITY;
        let mobility = j_g * mass.solve(&j_g.transpose()) + least;
        let inertia = mobility.try_inverse().ok_or(Massless)?;
        // J̄ᵀ B J̄ with the dynamically consistent inverse J̄ = M⁻¹ Jᵀ Λ.
        let inverse = mass.solve(&j_g.transpose()) * inertia;
        let damping = inverse.transpose() * Matrix6::from_diagonal(&(*viscous).into()) * inverse;
        Ok(Self { posture, inertia, damping })
    }

    /// Reduces the motion along `axis` at `omega` rad/s to one mass, damper and spring. NaN if the impedance is singular.
    pub fn reduced(&self, axis: usize, held: &Restraint, omega: f64) -> ReducedGrip {
        let stiffness = SVector::from(held.hand.map(|hand| hand.stiffness));
        let damping = SVector::from(held.hand.map(|hand| hand.damping));
        let sampled = SVector::from(held.damping);
        let real = Matrix6::from_diagonal(&stiffness) - self.inertia * (omega * omega);
        let imaginary = (self.damping + Matrix6::from_diagonal(&(damping + sampled))) * omega;
        let impedance = real.zip_map(&imaginary, Complex::new);
        let mut force = SVector::<Complex<f64>, 6>::zeros();
        if let Some(part) = force.get_mut(axis) {
            *part = Complex::new(1.0, 0.0);
        }
        let moved =
            impedance.lu().solve(&force).unwrap_or_else(|| force * Complex::new(f64::NAN, 0.0));
        let along = moved.get(axis).copied().unwrap_or_default();
        let shape = moved.map(|part| part / along);
        let (re, im) = (shape.map(|part| part.re), shape.map(|part| part.im));
        let energy =
            |matrix: &Matrix6<f64>| (re.transpose() * matrix * re + im.transpose() * matrix * im).x;
        let squares = shape.map(|part| part.norm_sqr());
        ReducedGrip {
            mass: energy(&self.inertia),
            damping: energy(&self.damping) + damping.dot(&squares),
            stiffness: stiffness.dot(&squares),
            sampled_damping: sampled.dot(&squares),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::ComplexField;

    use super::*;

    impl GripDynamics {
        /// Returns a grip with this mass and damping along every axis.
        pub(in crate::stability) fn of_mass(mass: f64, damping: f64) -> Self {
            let posture = "anywhere".to_owned();
            let [inertia, damping] = [mass, damping].map(|value| Matrix6::identity() * value);
            Self { posture, inertia, damping }
        }
    }

    fn held(stiffness: f64) -> Restraint {
        Restraint { hand: [Impedance { stiffness, damping: 10.0 }; 6], damping: [5.0; 6] }
    }

    #[test]
    fn grip_without_coupling_is_reduced_to_itself() {
        let reduced = GripDynamics::of_mass(0.6, 0.1).reduced(2, &held(400.0), 30.0);
        let expected =
            ReducedGrip { mass: 0.6, damping: 10.1, stiffness: 400.0, sampled_damping: 5.0 };
        let parts =
            |grip: ReducedGrip| [grip.mass, grip.damping, grip.stiffness, grip.sampled_damping];
        let pairs = parts(reduced).into_iter().zip(parts(expected));
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-9), "{reduced:?}");
    }

    /// At its frequency the reduced grip has the impedance of all axes.
    #[test]
    fn reduced_grip_has_the_impedance_of_all_axes() {
        let mut grip = GripDynamics::of_mass(0.6, 0.1);
        (grip.inertia[(0, 1)], grip.inertia[(1, 0)]) = (0.3, 0.3);
        let (held, omega) = (held(400.0), 40.0);
        let reduced = grip.reduced(0, &held, omega);
        let stiffness = reduced.stiffness - omega * omega * reduced.mass;
        let damping = omega * (reduced.damping + reduced.sampled_damping);
        let impedance =
            grip.inertia.zip_map(&grip.damping, |m, d| Complex::new(-omega * omega * m, omega * d))
                + Matrix6::from_diagonal_element(Complex::new(400.0, omega * 15.0));
        let mobility = impedance.try_inverse().unwrap()[(0, 0)];
        assert!((Complex::new(stiffness, damping) * mobility - 1.0).modulus() < 1e-9);
    }
}
