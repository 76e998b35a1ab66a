//! Force accommodation: the object gives way to what touches it, so that a rate command in free
//! space becomes a force command in contact (NTRFC, 4.3) without a change of mode or gain.
//!
//! Not reflection. With a rate held, the object comes to rest where `K_FA F` cancels it: it pushes
//! with `K_FA⁻¹ K_V ΔX`. Against stiffness `k_e` in cycles of `dt` and `n` cycles late this is stable
//! for `K_FA k_e dt < 2 cos(nπ / (2n + 1))`.

use std::f64::consts::PI;

use thiserror::Error;

use crate::spatial::Twist;
use crate::spatial::Wrench;

/// No object gives way more easily, in m/s per N or rad/s per N·m.
const LARGEST: f64 = 1e3;

/// K_FA: how fast the object gives way, per axis of {MRF}; and the wrench it does not notice.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accommodation {
    gain: [f64; 6],
    deadband: [f64; 6],
}

/// Why six numbers are no accommodation.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("accommodation {quantity} {value} is not within 0 and {LARGEST}")]
pub struct InvalidAccommodation {
    /// Gain or deadband.
    pub quantity: &'static str,
    /// What stood there.
    pub value: f64,
}

impl Accommodation {
    /// From gains in m/s per N and rad/s per N·m, and the deadband in N and N·m, which must be
    /// wider than the sensor's bias lest the object drift.
    ///
    /// # Errors
    /// A number that is negative or not finite.
    pub fn new(gain: [f64; 6], deadband: [f64; 6]) -> Result<Self, InvalidAccommodation> {
        for (quantity, values) in [("gain", gain), ("deadband", deadband)] {
            let wrong = values.into_iter().find(|value| !(0.0..=LARGEST).contains(value));
            if let Some(value) = wrong {
                return Err(InvalidAccommodation { quantity, value });
            }
        }
        Ok(Self { gain, deadband })
    }

    /// K_FA, in m/s per N and rad/s per N·m.
    pub const fn gain(&self) -> &[f64; 6] {
        &self.gain
    }

    /// The rate with which the object follows a commanded one while `f_m` acts on it.
    pub fn rate(&self, v_m_commanded: &Twist, f_m: &Wrench) -> Twist {
        let mut noticed = f_m.components();
        for (part, deadband) in noticed.iter_mut().zip(self.deadband) {
            *part = (part.abs() - deadband).max(0.0).copysign(*part);
        }
        *v_m_commanded + Twist::from_components(noticed).scaled(&self.gain)
    }

    /// Up to which stiffness in N/m (N·m/rad for rotations) contact on each axis is stable, in
    /// cycles of `dt` s and with the wrench `late` cycles old. Infinite where nothing gives way.
    pub fn stiffest_contact(&self, dt: f64, late: u32) -> [f64; 6] {
        let n = f64::from(late);
        let bound = 2.0 * (n * PI / (2.0 * n + 1.0)).cos();
        self.gain.map(|gain| bound / (gain * dt))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn untouched_it_follows_the_command() {
        let law = Accommodation::new([0.01; 6], [0.5; 6]).unwrap();
        let v_m = Twist::from_components([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
        assert_eq!(law.rate(&v_m, &Wrench::ZERO), v_m);
        let bias = Wrench::from_components([0.5, -0.5, 0.5, -0.5, 0.5, -0.5]);
        assert_eq!(law.rate(&v_m, &bias), v_m);
    }

    #[test]
    fn it_gives_way_in_the_direction_it_is_pushed() {
        let law = Accommodation::new([0.01; 6], [1.0; 6]).unwrap();
        let f_m = Wrench::from_components([3.0, -3.0, 0.0, 0.0, 2.0, 0.0]);
        let v_m = law.rate(&Twist::ZERO, &f_m);
        assert_eq!(v_m, Twist::from_components([0.02, -0.02, 0.0, 0.0, 0.01, 0.0]));
        assert!(f_m.power(&v_m) > 0.0);
    }

    #[test]
    fn a_gain_is_finite_and_not_negative() {
        for wrong in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(Accommodation::new([wrong; 6], [0.0; 6]).is_err());
            assert!(Accommodation::new([0.0; 6], [wrong; 6]).is_err());
        }
    }

    #[test]
    fn contact_up_to_the_bound_settles_and_beyond_it_does_not() {
        let (dt, gain) = (0.002, 0.002);
        let law = Accommodation::new([gain; 6], [0.0; 6]).unwrap();
        for late in [0_usize, 1, 2, 3] {
            let [bound, ..] = law.stiffest_contact(dt, u32::try_from(late).unwrap());
            for (stiffness, settles) in [(0.98 * bound, true), (1.02 * bound, false)] {
                let mut x = vec![1e-3; late + 1];
                for _ in 0..4_000 {
                    let felt = x[x.len() - 1 - late];
                    let f_m = Wrench::from_components([-stiffness * felt, 0.0, 0.0, 0.0, 0.0, 0.0]);
                    let next = x[x.len() - 1] + law.rate(&Twist::ZERO, &f_m).linear.x * dt;
                    x.push(next);
                }
                assert_eq!(x[x.len() - 1].abs() < 1e-3, settles, "{late} late, {stiffness} N/m");
            }
        }
    }
}
