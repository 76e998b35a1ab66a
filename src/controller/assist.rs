//! Operator assist: return to centre as a wrench (Eq. 8), and damping (Eq. 9).
//!
//! [`channels`](crate::channels) has the law of one axis. Gravity compensation acts at the joints, not at the grip
//! (decision 12).

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use thiserror::Error;

use crate::channels::Channels;
use crate::gains::Gains;
use crate::interpretation::Difference;
use crate::orientation::Orientation;
use crate::period::Period;
use crate::reference::Displacement;
use units::spatial::{Twist, Wrench};

/// Computes the wrench that returns the hand to the reference, in {G} (Eq. 8). Forces act along the axes of ΔX, rotated
/// into {G} by `r_g_dx` (decision 2). Moments are conjugate to the orientation parameters (decision 15).
pub fn centring(
    channels: &Channels,
    orientation: Orientation,
    r_g_dx: &UnitQuaternion<f64>,
    dx: &Displacement,
) -> Wrench {
    let [fx, fy, fz, m_gamma, m_beta, m_alpha] = channels.centring(dx);
    let conjugate = Vector3::new(m_gamma, m_beta, m_alpha);
    Wrench {
        force: r_g_dx * Vector3::new(fx, fy, fz),
        moment: orientation.moment(&conjugate, &dx.orientation),
    }
}

/// Computes Eq. 8 as printed: the six forces on ΔX, taken as a wrench at {G}. It generates energy on closed paths, and
/// repels a hand at large rotations (decisions 2 and 15).
pub fn centring_by_components(channels: &Channels, dx: &Displacement) -> Wrench {
    Wrench::from_components(channels.centring(dx))
}

/// Damping of the hand's motion (Eq. 9), with gains in SI rather than per cycle (decision 19).
///
/// It depends on the twist of the grip, which a new reference does not change, or on the difference to the last ΔX.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damping {
    gain: Gains,
    period: Period,
    reading: Difference,
    dx_before: Option<Displacement>,
}

impl Damping {
    /// Creates a damping of K_D in N·s/m and N·m·s/rad. The paper's gain per cycle is K_D over the period.
    pub const fn new(gain: Gains, period: Period, reading: Difference) -> Self {
        Self { gain, period, reading, dx_before: None }
    }

    /// Computes the wrench on the hand against its motion, in {G}. `forget` discards the last ΔX: after a new reference, a
    /// change of command mode or a gap.
    pub fn wrench(
        &mut self,
        v_g: &Twist,
        x_h_g: &Isometry3<f64>,
        dx: &Displacement,
        forget: bool,
    ) -> Wrench {
        let dx_before = self.dx_before.replace(*dx).filter(|_| !forget).unwrap_or(*dx);
        match self.reading {
            Difference::Twist => self.against(v_g, x_h_g),
            Difference::Components => self.against_change(dx, &dx_before),
        }
    }

    /// Damps translation along the axes of the reference, and rotation about the axes of the grip.
    fn against(&self, v_g: &Twist, x_h_g: &Isometry3<f64>) -> Wrench {
        let moving = Twist { linear: x_h_g.rotation * v_g.linear, angular: v_g.angular };
        let against = moving.scaled(self.gain.values()) * -1.0;
        Wrench { force: x_h_g.rotation.inverse() * against.linear, moment: against.angular }
    }

    /// Computes Eq. 9 as printed: the change of each component of ΔX, taken as a wrench at {G}.
    fn against_change(&self, dx: &Displacement, dx_before: &Displacement) -> Wrench {
        let mut change = dx.components();
        for (now, before) in change.iter_mut().zip(dx_before.components()) {
            *now -= before;
        }
        let per_cycle = Wrench::from_components(change).scaled(self.gain.values());
        per_cycle * -self.period.seconds().recip()
    }
}

/// Maximum slope of `1 / (1 + u²)`, at `u = 1/√3`: `3 √3 / 8`.
const STEEPEST_FADE: f64 = 0.649_519_052_838_329;

/// Fade of the return to centre in contact (decision 23): a factor of `1 / (1 + (|F| / F0)²)`.
///
/// F0 is at least `3 √3 / 8` of the return along the task force. The sum of both along it is then monotonic in the task
/// force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactFade(f64);

/// Invalid force F0 of a fade, in N.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("the contact fade must be positive and finite, got {0} N")]
pub struct InvalidFade(pub f64);

impl ContactFade {
    /// Creates a fade to one half at a task force of `half_at` N.
    ///
    /// # Errors
    /// Returns an error unless the force is positive and finite.
    pub fn new(half_at: f64) -> Result<Self, InvalidFade> {
        if half_at.is_finite() && half_at > 0.0 {
            Ok(Self(half_at))
        } else {
            Err(InvalidFade(half_at))
        }
    }

    /// Returns the remaining share, 0 to 1, of the return to centre `f_g_centring` at task wrench `f_g_task`.
    pub fn share(self, f_g_task: &Wrench, f_g_centring: &Wrench) -> f64 {
        let force = f_g_task.force.norm();
        let along = f_g_task.force.dot(&f_g_centring.force) / force.max(f64::MIN_POSITIVE);
        let strength = force / self.0.max(STEEPEST_FADE * along);
        (1.0 + strength * strength).recip()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use units::math;
    use units::spatial::rotation;

    const K_D: [f64; 6] = [6.0, 7.0, 8.0, 0.05, 0.06, 0.07];

    fn damping(reading: Difference) -> Damping {
        Damping::new(Gains::new(K_D, "K_D").unwrap(), Period::new(1e-3).unwrap(), reading)
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

    fn dx(x_h_g: &Isometry3<f64>) -> Displacement {
        Displacement::between(x_h_g, Orientation::EulerZyx)
    }

    proptest! {
        #[test]
        fn property_05_damping_takes_power(x_h_g in pose(), v_g in twist()) {
            let f_g = damping(Difference::Twist).wrench(&v_g, &x_h_g, &dx(&x_h_g), false);
            prop_assert!(f_g.power(&v_g) <= 0.0);
        }

        #[test]
        fn property_05_a_new_reference_is_no_motion(before in pose(), after in pose(), v_g in twist()) {
            let mut of_twist = damping(Difference::Twist);
            of_twist.wrench(&v_g, &before, &dx(&before), false);
            let kept = of_twist.wrench(&v_g, &before, &dx(&before), true);
            prop_assert!(kept.power(&v_g) <= 0.0);
            let mut of_numbers = damping(Difference::Components);
            of_numbers.wrench(&v_g, &before, &dx(&before), false);
            let forgotten = of_numbers.wrench(&v_g, &after, &dx(&after), true);
            prop_assert!(forgotten.force.norm() == 0.0 && forgotten.moment.norm() == 0.0);
        }

        #[test]
        fn near_the_reference_both_readings_agree(v_g in twist()) {
            let (before, after) = (v_g.over(-1e-3), Isometry3::identity());
            let mut of_numbers = damping(Difference::Components);
            of_numbers.wrench(&v_g, &before, &dx(&before), false);
            let numbers = of_numbers.wrench(&v_g, &after, &dx(&after), false);
            let twist = damping(Difference::Twist).wrench(&v_g, &after, &dx(&after), false);
            for (numbers, twist) in numbers.components().iter().zip(twist.components()) {
                prop_assert!((numbers - twist).abs() < 0.02, "{numbers}, {twist}");
            }
        }

        #[test]
        fn property_03_the_return_to_centre_never_leads_away(x_h_g in pose()) {
            for orientation in [Orientation::EulerZyx, Orientation::RotationVector] {
                let dx = Displacement::between(&x_h_g, orientation);
                let f_g = centring(&channels(), orientation, &x_h_g.rotation.inverse(), &dx);
                let outwards = x_h_g.rotation.inverse() * dx.translation;
                prop_assert!(f_g.force.dot(&outwards) <= 0.0);
                // A small turn towards the reference does positive work.
                let step = 1e-6;
                let shrunk = orientation.rotation(&(dx.orientation * (1.0 - step)));
                let turn = rotation::rotation_vector(&(x_h_g.rotation.inverse() * shrunk));
                prop_assert!(f_g.moment.dot(&turn) >= -1e-9 * step);
            }
        }

        #[test]
        fn return_to_centre_fades_and_never_grows(force in 0.0..1e6_f64, half_at in 0.1..100.0_f64) {
            let fade = ContactFade::new(half_at).unwrap();
            let none = Wrench::ZERO;
            let share = fade.share(&Wrench::from_components([force, 0.0, 0.0, 0.0, 0.0, 0.0]), &none);
            prop_assert!((0.0..=1.0).contains(&share));
            let at_half = Wrench::from_components([0.0, half_at, 0.0, 0.0, 0.0, 0.0]);
            prop_assert!((fade.share(&at_half, &none) - 0.5).abs() < 1e-12);
        }
    }

    #[test]
    fn at_the_reference_nothing_pulls() {
        let dx = Displacement::default();
        let here = UnitQuaternion::identity();
        let f_g = centring(&channels(), Orientation::EulerZyx, &here, &dx);
        assert!(f_g.components().iter().all(|part| *part == 0.0));
    }

    #[test]
    fn components_push_away_a_hand_that_is_turned_round() {
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
        let x_0_g = Isometry3::from_parts(Vector3::new(0.05, 0.0, 0.0).into(), turned);
        let dx = Displacement { translation: x_0_g.translation.vector, ..Displacement::default() };
        let force_in_0 = turned * centring_by_components(&channels(), &dx).force;
        assert!(force_in_0.x > 1.9, "pushed outwards with {} N", force_in_0.x);
    }

    proptest! {
        #[test]
        fn force_along_the_push_never_falls_as_contact_grows(
            push in prop::array::uniform3(-1.0..1.0_f64), back in prop::array::uniform3(-9.0..9.0_f64),
            half_at in 0.05..5.0_f64, force in 0.0..20.0_f64, more in 0.0..5.0_f64
        ) {
            let Some(push) = Vector3::from(push).try_normalize(1e-3) else { return Ok(()) };
            let f_g_centring = Wrench { force: back.into(), moment: Vector3::zeros() };
            let fade = ContactFade::new(half_at).unwrap();
            let total = |force: f64| {
                let f_g_task = Wrench { force: push * force, moment: Vector3::zeros() };
                force + fade.share(&f_g_task, &f_g_centring) * f_g_centring.force.dot(&push)
            };
            prop_assert!(total(force + more) >= total(force) - 1e-9, "{} {}", total(force), total(force + more));
        }
    }

    #[test]
    fn fade_along_one_axis_of_the_shipped_files_is_that_of_f0() {
        let along_x = |force| Wrench::from_components([force, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let fade = ContactFade::new(1.3).unwrap();
        for force in [0.1, 0.75, 1.3, 4.0] {
            let printed = (1.0 + math::powf(force / 1.3, 2.0)).recip();
            assert!((fade.share(&along_x(force), &along_x(2.0)) - printed).abs() < 1e-12);
        }
        assert!((fade.share(&Wrench::ZERO, &along_x(9.0)) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_fade_has_a_force() {
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(ContactFade::new(wrong).is_err());
        }
    }
}
