//! Wrench: force and moment, in N and N·m (Craig 1989, chapter 5).

use derive_more::{Add, Mul, Neg, Sub};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::spatial::Twist;

/// Force and moment at a frame, written in that frame. A wrench acts *on* the body that its name states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Add, Sub, Neg, Mul)]
pub struct Wrench {
    /// Force, in N.
    pub force: Vector3<f64>,
    /// Moment about the frame's origin, in N·m.
    pub moment: Vector3<f64>,
}

impl Wrench {
    /// Zero force and moment.
    pub const ZERO: Self =
        Self { force: Vector3::new(0.0, 0.0, 0.0), moment: Vector3::new(0.0, 0.0, 0.0) };

    /// Creates a wrench from fx, fy, fz, mx, my, mz.
    pub const fn from_components([fx, fy, fz, mx, my, mz]: [f64; 6]) -> Self {
        Self { force: Vector3::new(fx, fy, fz), moment: Vector3::new(mx, my, mz) }
    }

    /// Returns fx, fy, fz, mx, my, mz.
    pub fn components(&self) -> [f64; 6] {
        [self.force.x, self.force.y, self.force.z, self.moment.x, self.moment.y, self.moment.z]
    }

    /// Transforms the wrench to the other frame of `x`: `f_m = f_s.at(&x_m_s)` (Eq. 6).
    pub fn at(&self, x: &Isometry3<f64>) -> Self {
        let force = x.rotation * self.force;
        let moment = x.rotation * self.moment + x.translation.vector.cross(&force);
        Self { force, moment }
    }

    /// Rotates the wrench by `r` to other axes.
    pub fn turned(&self, r: &UnitQuaternion<f64>) -> Self {
        Self { force: r * self.force, moment: r * self.moment }
    }

    /// Multiplies each component by its own gain: a diagonal gain matrix.
    pub fn scaled(&self, gains: &[f64; 6]) -> Self {
        let [fx, fy, fz, mx, my, mz] = self.components();
        let [a, b, c, d, e, f] = *gains;
        Self::from_components([a * fx, b * fy, c * fz, d * mx, e * my, f * mz])
    }

    /// Returns the power into a body with `twist`, both at the same frame, in W.
    pub fn power(&self, twist: &Twist) -> f64 {
        self.force.dot(&twist.linear) + self.moment.dot(&twist.angular)
    }

    /// Returns whether all components are finite.
    pub fn is_finite(&self) -> bool {
        self.components().iter().all(|component| component.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;
    use proptest::prelude::*;

    use super::*;

    fn six(size: f64) -> impl Strategy<Value = [f64; 6]> {
        prop::array::uniform6(-size..size)
    }

    fn pose() -> impl Strategy<Value = Isometry3<f64>> {
        six(2.0).prop_map(|[x, y, z, a, b, c]| {
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(a, b, c));
            Isometry3::from_parts(Vector3::new(x, y, z).into(), rotation)
        })
    }

    fn close(a: &Wrench, b: &Wrench) -> bool {
        a.components().iter().zip(b.components()).all(|(a, b)| (a - b).abs() < 1e-10)
    }

    proptest! {
        #[test]
        fn property_02_transformed_wrench_has_the_same_power(f in six(50.0), v in six(5.0), x_m_s in pose()) {
            let f_s = Wrench::from_components(f);
            let v_s = Twist::from_components(v);
            let difference = f_s.power(&v_s) - f_s.at(&x_m_s).power(&v_s.at(&x_m_s));
            prop_assert!(difference.abs() < 1e-9, "{difference} W appeared from nowhere");
        }

        #[test]
        fn transform_there_and_back_is_the_identity(f in six(50.0), x_m_s in pose()) {
            let f_s = Wrench::from_components(f);
            prop_assert!(close(&f_s.at(&x_m_s).at(&x_m_s.inverse()), &f_s));
        }

        #[test]
        fn transforms_compose(f in six(50.0), x_b_m in pose(), x_m_s in pose()) {
            let f_s = Wrench::from_components(f);
            prop_assert!(close(&f_s.at(&x_m_s).at(&x_b_m), &f_s.at(&(x_b_m * x_m_s))));
        }
    }

    #[test]
    fn force_has_a_moment_about_a_distant_point() {
        let f_s = Wrench::from_components([0.0, 0.0, 2.0, 0.0, 0.0, 0.0]);
        let f_m = f_s.at(&Isometry3::translation(0.5, 0.0, 0.0));
        assert_eq!(f_m, Wrench::from_components([0.0, 0.0, 2.0, 0.0, -1.0, 0.0]));
    }

    #[test]
    fn one_infinite_component_is_not_finite() {
        let mut f_s = Wrench::ZERO;
        assert!(f_s.is_finite());
        f_s.moment.y = f64::NAN;
        assert!(!f_s.is_finite());
    }
}
