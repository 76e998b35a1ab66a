//! Force accommodation: the object gives way to what touches it, so that a rate command in free
//! space becomes a force command in contact (NTRFC, 4.3) without a change of mode or gain.
//!
//! Not reflection. With a rate held, the object comes to rest where `K_FA F` cancels it: it pushes
//! with `K_FA⁻¹ K_V ΔX`. How fast an object may give way is judged before anything moves
//! (`controller::stability::bounds`).

use thiserror::Error;

use units::spatial::Twist;
use units::spatial::Wrench;

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
}
