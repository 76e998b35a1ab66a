//! Reference pose, and the displacement of the grip from it (Eq. 2, 3 and 4).
//!
//! The translation is written in the reference {G0}, or optionally in the base as printed in Eq. 2 (decision 2). In
//! {G0} all six components and their wrenches share one frame, independent of the arm's base.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::interpretation::{DisplacementFrame, Interpretation};
use crate::orientation::Orientation;
use crate::switches::Permissions;

/// ΔX of Eq. 4: pose of the grip relative to its reference, as six components.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Displacement {
    /// Translation, in m, along the axes of the reference or, with decision 2 as printed, of the base.
    pub translation: Vector3<f64>,
    /// Parameters of the relative orientation, in rad.
    pub orientation: Vector3<f64>,
}

impl Displacement {
    /// Converts a relative pose to components, with the rotation in the given parametrisation.
    pub fn between(x_h_g: &Isometry3<f64>, orientation: Orientation) -> Self {
        Self {
            translation: x_h_g.translation.vector,
            orientation: orientation.numbers(&x_h_g.rotation),
        }
    }

    /// Rotates the translation by `r`, to the axes of another frame.
    #[must_use]
    pub fn along(self, r: &UnitQuaternion<f64>) -> Self {
        Self { translation: r * self.translation, ..self }
    }

    /// Creates a displacement from x, y, z in m and γ, β, α (or a rotation vector) in rad.
    pub const fn from_components([x, y, z, gamma, beta, alpha]: [f64; 6]) -> Self {
        Self { translation: Vector3::new(x, y, z), orientation: Vector3::new(gamma, beta, alpha) }
    }

    /// Returns x, y, z in m and γ, β, α (or a rotation vector) in rad.
    pub fn components(&self) -> [f64; 6] {
        let (p, phi) = (&self.translation, &self.orientation);
        [p.x, p.y, p.z, phi.x, phi.y, phi.z]
    }

    /// Multiplies by a diagonal gain matrix.
    pub fn scaled(&self, gains: &[f64; 6]) -> Self {
        let [x, y, z, gamma, beta, alpha] = self.components();
        let [a, b, c, d, e, f] = *gains;
        Self::from_components([a * x, b * y, c * z, d * gamma, e * beta, f * alpha])
    }

    /// Returns whether all six components are zero.
    pub fn is_zero(&self) -> bool {
        self.translation == Vector3::zeros() && self.orientation == Vector3::zeros()
    }
}

/// Reference poses of grip and object, at which the displacement is zero.
///
/// Until the operator sets a reference, it follows the grip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Pose of the grip at the reference, in {0}: {G0}.
    pub x_0_h: Isometry3<f64>,
    /// Pose of the object at the reference, in its base.
    pub x_b_r: Isometry3<f64>,
    /// Set once the operator has set a reference.
    pub is_set: bool,
}

impl Reference {
    /// Creates a reference that follows the grip until an operator sets one.
    pub fn none() -> Self {
        Self { x_0_h: Isometry3::identity(), x_b_r: Isometry3::identity(), is_set: false }
    }

    /// Sets both poses if the switches request a reference, so that the object does not jump (decisions 28 and 29).
    /// Returns whether they did. `x_b_m` is the last commanded pose of the object, or its actual pose without a pose
    /// command.
    pub fn update(
        &mut self,
        permissions: &Permissions,
        x_0_g: &Isometry3<f64>,
        x_b_m: &Isometry3<f64>,
    ) -> bool {
        let set =
            permissions.reference || permissions.engaged && (permissions.latches || !self.is_set);
        if set || !self.is_set {
            *self = Self { x_0_h: *x_0_g, x_b_r: *x_b_m, is_set: self.is_set || set };
        }
        set
    }

    /// Returns the rotation from the axes of ΔX to the axes of the grip at `x_0_g`.
    pub fn turn_to_grip(
        &self,
        displaced: DisplacementFrame,
        x_0_g: &Isometry3<f64>,
    ) -> UnitQuaternion<f64> {
        let r_g_0 = x_0_g.rotation.inverse();
        match displaced {
            DisplacementFrame::Base => r_g_0,
            DisplacementFrame::Reference => r_g_0 * self.x_0_h.rotation,
        }
    }

    /// Computes ΔX of a grip at `x_h_g` (Eq. 4), in the chosen interpretation.
    pub fn dx(&self, interpretation: &Interpretation, x_h_g: &Isometry3<f64>) -> Displacement {
        let dx = Displacement::between(x_h_g, interpretation.orientation);
        match interpretation.displacement {
            DisplacementFrame::Reference => dx,
            DisplacementFrame::Base => dx.along(&self.x_0_h.rotation),
        }
    }

    /// Computes the pose of the grip in the reference (Eq. 2 and 3).
    pub fn displacement(&self, x_0_g: &Isometry3<f64>) -> Isometry3<f64> {
        self.x_0_h.inverse() * x_0_g
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SET: Permissions = Permissions { reference: true, ..Permissions::NOTHING };

    fn pose() -> impl Strategy<Value = Isometry3<f64>> {
        prop::array::uniform6(-1.0..1.0_f64).prop_map(|[x, y, z, a, b, c]| {
            Isometry3::new(Vector3::new(x, y, z), Vector3::new(a, b, c))
        })
    }

    proptest! {
        #[test]
        fn no_motion_is_no_displacement(x_0_g in pose(), x_b_m in pose()) {
            let mut reference = Reference::none();
            prop_assert!(reference.update(&SET, &x_0_g, &x_b_m));
            let x_h_g = reference.displacement(&x_0_g);
            for orientation in [Orientation::EulerZyx, Orientation::RotationVector] {
                let dx = Displacement::between(&x_h_g, orientation);
                prop_assert!(dx.components().iter().all(|part| part.abs() < 1e-14));
            }
        }

        #[test]
        fn a_moved_base_moves_no_displacement(
            x_base in pose(), x_0_h in pose(), x_0_g in pose(), x_b_m in pose()
        ) {
            let mut here = Reference::none();
            here.update(&SET, &x_0_h, &x_b_m);
            let mut elsewhere = Reference::none();
            elsewhere.update(&SET, &(x_base * x_0_h), &x_b_m);
            let difference = here.displacement(&x_0_g).inverse()
                * elsewhere.displacement(&(x_base * x_0_g));
            prop_assert!(difference.translation.vector.norm() < 1e-12);
            prop_assert!(difference.rotation.angle() < 1e-7);
        }

        #[test]
        fn before_it_is_set_it_follows_the_grip(x_0_g in pose(), x_b_m in pose()) {
            let mut reference = Reference::none();
            prop_assert!(!reference.update(&Permissions::NOTHING, &x_0_g, &x_b_m));
            prop_assert!(!reference.is_set);
            prop_assert_eq!(reference.x_0_h, x_0_g);
        }
    }

    #[test]
    fn once_set_it_stays() {
        let mut reference = Reference::none();
        let x_0_h = Isometry3::translation(0.1, 0.2, 0.3);
        reference.update(&SET, &x_0_h, &Isometry3::identity());
        let moved = Isometry3::translation(1.0, 0.0, 0.0);
        let engaged = Permissions { engaged: true, ..Permissions::NOTHING };
        assert!(!reference.update(&engaged, &moved, &moved));
        assert_eq!((reference.x_0_h, reference.is_set), (x_0_h, true));
    }
}
