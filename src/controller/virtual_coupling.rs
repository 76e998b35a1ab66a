//! Virtual coupling in pose mode: a spring and a damper between hand and object replace the sensed wrench.
//!
//! The object must be a god-object drawn by the same coupling (`robot::god_object`), so that surfaces stop it. The
//! coupling then carries the contact force. A stiffly servoed object would penetrate a surface, and the coupling would
//! show the lag of its servo only.
//!
//! The coupling bounds the stiffness at the hand, for any environment and servo. It can be chosen for the device
//! (Colgate: `K T / 2 + |B| < b`); the stiffness of the environment cannot.

use nalgebra::Isometry3;

use crate::gains::Gains;
use crate::period::Period;
use units::spatial::{Twist, Wrench};

/// Spring and damper between the commanded and the actual pose of the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualCoupling {
    stiffness: Gains,
    damping: Gains,
    period: Period,
    stretch_before: Option<Twist>,
}

impl VirtualCoupling {
    /// Creates a coupling of six stiffnesses in N/m and N·m/rad, and six dampings in N·s/m and N·m·s/rad.
    pub const fn new(stiffness: Gains, damping: Gains, period: Period) -> Self {
        Self { stiffness, damping, period, stretch_before: None }
    }

    /// Stiffness of each axis, in N/m and N·m/rad.
    pub const fn stiffness(&self) -> &Gains {
        &self.stiffness
    }

    /// Damping of each axis, in N·s/m and N·m·s/rad.
    pub const fn damping(&self) -> &Gains {
        &self.damping
    }

    /// Returns the wrench that draws the commanded frame at `x_b_d` to the object at `x_b_m`, written in the commanded
    /// frame. Without a commanded pose it is zero, and the rate of the stretch restarts.
    pub fn wrench(&mut self, x_b_d: Option<&Isometry3<f64>>, x_b_m: &Isometry3<f64>) -> Wrench {
        let Some(x_b_d) = x_b_d else {
            self.stretch_before = None;
            return Wrench::ZERO;
        };
        let stretch = Twist::reaching(&(x_b_d.inverse() * x_b_m), 1.0);
        let before = self.stretch_before.replace(stretch).unwrap_or(stretch);
        let rate = (stretch + before * -1.0) * self.period.seconds().recip();
        let pull = stretch.scaled(self.stiffness.values()) + rate.scaled(self.damping.values());
        Wrench { force: pull.linear, moment: pull.angular }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn coupling() -> VirtualCoupling {
        let stiffness = Gains::new([400.0, 400.0, 400.0, 5.0, 5.0, 5.0], "stiffness").unwrap();
        let damping = Gains::new([4.0, 4.0, 4.0, 0.05, 0.05, 0.05], "damping").unwrap();
        VirtualCoupling::new(stiffness, damping, Period::new(1e-3).unwrap())
    }

    fn pose() -> impl Strategy<Value = Isometry3<f64>> {
        prop::array::uniform6(-0.7..0.7_f64)
            .prop_map(|[x, y, z, a, b, c]| Isometry3::new([x, y, z].into(), [a, b, c].into()))
    }

    proptest! {
        #[test]
        fn the_hand_is_drawn_to_the_object(x_b_d in pose(), x_b_m in pose()) {
            let f_d = coupling().wrench(Some(&x_b_d), &x_b_m);
            let way = Twist::reaching(&(x_b_d.inverse() * x_b_m), 1.0);
            let (drawn, turned) = (way.linear.norm_squared(), way.angular.norm_squared());
            // Twice the energy of its springs, 400 N/m and 5 N·m/rad.
            let expected = 400.0 * drawn + 5.0 * turned;
            prop_assert!((f_d.power(&way) - expected).abs() <= 1e-9 * expected, "{f_d:?}");
        }

        #[test]
        fn damper_opposes_the_motion_of_the_hand(
            x_b_m in pose(), x_b_d in pose(), way in prop::array::uniform3(-0.01..0.01_f64)
        ) {
            let way = Twist { linear: way.into(), ..Twist::ZERO };
            let moved = x_b_d * Isometry3::translation(way.linear.x, way.linear.y, way.linear.z);
            let mut coupled = coupling();
            coupled.wrench(Some(&x_b_d), &x_b_m);
            let f_d = coupled.wrench(Some(&moved), &x_b_m);
            // The spring alone: the first cycle has no rate.
            let spring = coupling().wrench(Some(&moved), &x_b_m);
            let power = (f_d + spring * -1.0).power(&way);
            prop_assert!(power < 0.0 || way.linear.norm() < 1e-6, "{power} W");
        }

        #[test]
        fn where_they_are_one_nothing_pulls(x_b_d in pose()) {
            let f_d = coupling().wrench(Some(&x_b_d), &x_b_d);
            prop_assert!(f_d.force.norm() < 1e-9 && f_d.moment.norm() < 1e-9);
        }

        #[test]
        fn the_damper_forgets_where_nothing_is_commanded(x_b_d in pose(), x_b_m in pose(), y in pose()) {
            let mut coupled = coupling();
            coupled.wrench(Some(&y), &x_b_m);
            prop_assert_eq!(coupled.wrench(None, &x_b_m), Wrench::ZERO);
            let again = coupled.wrench(Some(&x_b_d), &x_b_m);
            prop_assert_eq!(again, coupling().wrench(Some(&x_b_d), &x_b_m));
        }
    }
}
