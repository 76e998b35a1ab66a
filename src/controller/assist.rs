//! What helps the hand: the return to centre as a wrench (Eq. 8) and damping (Eq. 9).
//!
//! Not gravity, which is no wrench at the grip (decision 12), and not the law of one axis, which is
//! [`channels`](crate::controller::channels).

use nalgebra::Isometry3;
use nalgebra::Vector3;
use thiserror::Error;

use crate::controller::channels::Channels;
use crate::controller::gains::Gains;
use crate::controller::orientation::Orientation;
use crate::controller::reference::Displacement;
use crate::spatial::Wrench;
use crate::spatial::rotation;

/// The wrench on the hand that draws it back to the reference, in {G} (Eq. 8): forces along the
/// axes of {G0}, turned into those of {G} (decision 2); moments that belong to the numbers the
/// orientation is written in (decision 15).
pub fn centring(
    channels: &Channels,
    orientation: Orientation,
    x_h_g: &Isometry3<f64>,
    dx: &Displacement,
) -> Wrench {
    let [fx, fy, fz, m_gamma, m_beta, m_alpha] = channels.centring(dx);
    let force_in_h = Vector3::new(fx, fy, fz);
    let conjugate = Vector3::new(m_gamma, m_beta, m_alpha);
    Wrench {
        force: x_h_g.rotation.inverse() * force_in_h,
        moment: orientation.moment(&conjugate, &dx.orientation),
    }
}

/// Damping of the hand's motion (Eq. 9), with gains in SI rather than per cycle: it does not change
/// with the cycle period (decision 19).
///
/// It remembers where the grip was in {0}, not the last displacement: a new reference is no motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damping {
    gain: Gains,
    period: f64,
    x_0_before: Option<Isometry3<f64>>,
}

/// A cycle that is none.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("a cycle period of {0} s is not within 10 µs and 1 s")]
pub struct InvalidPeriod(pub f64);

impl Damping {
    /// From K_D in N·s/m and N·m·s/rad, and the cycle period in s.
    ///
    /// # Errors
    /// A period no control loop has.
    pub fn new(gain: Gains, period: f64) -> Result<Self, InvalidPeriod> {
        if (1e-5..=1.0).contains(&period) {
            Ok(Self { gain, period, x_0_before: None })
        } else {
            Err(InvalidPeriod(period))
        }
    }

    /// K_D, in N·s/m and N·m·s/rad.
    pub const fn gain(&self) -> &Gains {
        &self.gain
    }

    /// The wrench on the hand, in {G}, against its motion since the last cycle; none in the first.
    /// Translation is damped along the axes of the reference, rotation about those of the grip.
    ///
    /// `restart` makes this cycle the first (decision 19): after an overrun the motion since the
    /// last one took longer than a cycle.
    pub fn wrench(
        &mut self,
        x_0_g: &Isometry3<f64>,
        x_0_h: &Isometry3<f64>,
        restart: bool,
    ) -> Wrench {
        let last = self.x_0_before.replace(*x_0_g);
        let x_0_before = last.filter(|_| !restart).unwrap_or(*x_0_g);
        let moved_in_0 = x_0_g.translation.vector - x_0_before.translation.vector;
        let turned = rotation::rotation_vector(&(x_0_before.rotation.inverse() * x_0_g.rotation));
        let r_h_0 = x_0_h.rotation.inverse();
        let r_g_0 = x_0_g.rotation.inverse();
        let motion = Wrench { force: r_h_0 * moved_in_0, moment: turned };
        let against = motion.scaled(self.gain.values()) * -self.period.recip();
        Wrench { force: r_g_0 * (x_0_h.rotation * against.force), moment: against.moment }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::Twist;
    use proptest::prelude::*;

    const K_D: [f64; 6] = [6.0, 7.0, 8.0, 0.05, 0.06, 0.07];

    fn damping(period: f64) -> Damping {
        Damping::new(Gains::new(K_D, "K_D").unwrap(), period).unwrap()
    }

    fn channels() -> Channels {
        Channels::new([0.01, 0.02, 0.03, 0.05, 0.06, 0.07], [2.0, 3.0, 4.0, 0.1, 0.2, 0.3]).unwrap()
    }

    fn pose() -> impl Strategy<Value = Isometry3<f64>> {
        prop::array::uniform6(-0.7..0.7_f64)
            .prop_map(|[x, y, z, a, b, c]| Isometry3::new([x, y, z].into(), [a, b, c].into()))
    }

    fn twist() -> impl Strategy<Value = Twist> {
        prop::array::uniform6(-1.0..1.0_f64).prop_map(Twist::from_components)
    }

    /// The wrench of damping on a hand that moves with `v_g`.
    fn damped(period: f64, x_0_g: &Isometry3<f64>, x_0_h: &Isometry3<f64>, v_g: &Twist) -> Wrench {
        let mut damping = damping(period);
        damping.wrench(&(x_0_g * (*v_g * -1.0).over(period)), x_0_h, false);
        damping.wrench(x_0_g, x_0_h, false)
    }

    proptest! {
        #[test]
        fn damping_takes_power(x_0_g in pose(), x_0_h in pose(), v_g in twist()) {
            let f_g = damped(1e-5, &x_0_g, &x_0_h, &v_g);
            prop_assert!(f_g.power(&v_g) <= 0.0);
        }

        #[test]
        fn damping_does_not_depend_on_the_cycle(x_0_g in pose(), x_0_h in pose(), v_g in twist()) {
            let (fast, slow) =
                (damped(1e-4, &x_0_g, &x_0_h, &v_g), damped(2e-4, &x_0_g, &x_0_h, &v_g));
            for (fast, slow) in fast.components().iter().zip(slow.components()) {
                prop_assert!((fast - slow).abs() < 2e-3, "{fast} at 10 kHz, {slow} at 5 kHz");
            }
        }

        #[test]
        fn a_new_reference_is_no_motion(
            x_0_g in pose(), x_0_h in pose(), x_0_new in pose(), v_g in twist()
        ) {
            let mut uniform = Damping::new(Gains::new([5.0; 6], "K_D").unwrap(), 1e-3).unwrap();
            uniform.wrench(&(x_0_g * (v_g * -1.0).over(1e-3)), &x_0_h, false);
            let mut kept = uniform;
            let f_g = kept.wrench(&x_0_g, &x_0_h, false);
            let f_g_new = uniform.wrench(&x_0_g, &x_0_new, false);
            for (before, after) in f_g.components().iter().zip(f_g_new.components()) {
                prop_assert!((before - after).abs() < 1e-10);
            }
        }

        #[test]
        fn the_first_cycle_is_not_damped(x_0_g in pose(), x_0_h in pose(), elsewhere in pose()) {
            let mut damping = damping(1e-3);
            prop_assert!(damping.wrench(&elsewhere, &x_0_h, false).force.norm() == 0.0);
            prop_assert!(damping.wrench(&x_0_g, &x_0_h, true).force.norm() == 0.0);
            prop_assert!(damping.wrench(&elsewhere, &x_0_h, false).force.norm() > 0.0);
        }

        #[test]
        fn the_return_to_centre_never_leads_away(x_h_g in pose()) {
            for orientation in [Orientation::EulerZyx, Orientation::RotationVector] {
                let dx = Displacement::between(&x_h_g, orientation);
                let f_g = centring(&channels(), orientation, &x_h_g, &dx);
                let outwards = x_h_g.rotation.inverse() * dx.translation;
                prop_assert!(f_g.force.dot(&outwards) <= 0.0);
                // Turning a little towards the reference, as its numbers shrink, is helped.
                let step = 1e-6;
                let shrunk = orientation.rotation(&(dx.orientation * (1.0 - step)));
                let turn = rotation::rotation_vector(&(x_h_g.rotation.inverse() * shrunk));
                prop_assert!(f_g.moment.dot(&turn) >= -1e-9 * step);
            }
        }

        #[test]
        fn the_axes_of_the_base_do_not_matter(
            x_base in pose(), x_0_g in pose(), x_0_h in pose(), v_g in twist()
        ) {
            let here = damped(1e-3, &x_0_g, &x_0_h, &v_g);
            let there = damped(1e-3, &(x_base * x_0_g), &(x_base * x_0_h), &v_g);
            for (here, there) in here.components().iter().zip(there.components()) {
                prop_assert!((here - there).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn at_the_reference_nothing_pulls() {
        let dx = Displacement::default();
        let f_g = centring(&channels(), Orientation::EulerZyx, &Isometry3::identity(), &dx);
        assert!(f_g.components().iter().all(|part| *part == 0.0));
    }

    #[test]
    fn a_period_is_one_of_a_control_loop() {
        for wrong in [0.0, -1e-3, 2.0, f64::NAN] {
            assert!(Damping::new(Gains::ZERO, wrong).is_err());
        }
    }
}
