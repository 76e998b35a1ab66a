//! How much force may be felt, seen from the drives' own timers: a master that dies leaves the last force
//! on the hand until they trip.
//!
//! A hand and grip of mass m that nobody holds back, pushed by F for as long as t, is F t / m fast. That
//! must not be more than [`FASTEST`].

use std::time::Duration;

use thiserror::Error;

/// The fastest a hand may become by a force that nobody commands any more, in m/s.
pub const FASTEST: f64 = 0.5;

/// How long a force is taken to last where the drives' timers were not proven: nothing is known to stop
/// them, and so long it takes a person to let go and hit the emergency stop.
pub const UNPROVEN: Duration = Duration::from_millis(250);

/// The largest force, and whom it pushes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceCap {
    /// The most that is reflected, in N: `[controller] max_force_n`.
    pub max_force: f64,
    /// Of hand and grip, in kg: `[safety] effective_mass_kg`.
    pub effective_mass: f64,
}

/// More force than the drives' timers allow.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "max_force_n = {max_force} N for the {:.1} ms until a drive stops by itself would make {mass} kg of hand \
     and grip {speed:.2} m/s fast, more than {FASTEST} m/s: at most {largest:.1} N",
    millis(.lasting)
)]
pub struct TooMuchForce {
    /// In N.
    pub max_force: f64,
    /// How long a drive may push by itself.
    pub lasting: Duration,
    /// In kg.
    pub mass: f64,
    /// How fast the hand would become, in m/s.
    pub speed: f64,
    /// What would be allowed, in N, rounded down to a tenth.
    pub largest: f64,
}

impl ForceCap {
    /// Whether the force may last so long.
    ///
    /// # Errors
    /// When the hand would become too fast; with the most that would do.
    pub fn allows(&self, lasting: Duration) -> Result<(), TooMuchForce> {
        let Self { max_force, effective_mass: mass } = *self;
        let seconds = lasting.as_secs_f64();
        let speed = max_force * seconds / mass;
        // A number that is none allows nothing.
        if mass > 0.0 && speed <= FASTEST {
            return Ok(());
        }
        let largest = (FASTEST * mass / seconds * 10.0).floor() / 10.0;
        Err(TooMuchForce { max_force, lasting, mass, speed, largest })
    }
}

fn millis(span: &Duration) -> f64 {
    span.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cap(max_force: f64) -> ForceCap {
        ForceCap { max_force, effective_mass: 1.0 }
    }

    #[test]
    fn with_an_rpdo_timer_40_n_pass_and_with_a_heartbeat_alone_20_n() {
        let (rpdo, heartbeat) = (Duration::from_millis(6), Duration::from_millis(25));
        assert_eq!(cap(40.0).allows(rpdo), Ok(()));
        assert_eq!(cap(20.0).allows(heartbeat), Ok(()));
        let refused = cap(40.0).allows(heartbeat).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "max_force_n = 40 N for the 25.0 ms until a drive stops by itself would make 1 kg of hand and \
             grip 1.00 m/s fast, more than 0.5 m/s: at most 20.0 N"
        );
    }

    #[test]
    fn what_nobody_has_proven_may_hardly_be_felt() {
        assert_eq!(cap(2.0).allows(UNPROVEN), Ok(()));
        assert!(cap(2.1).allows(UNPROVEN).is_err());
    }

    proptest! {
        #[test]
        fn what_is_named_as_the_most_is_allowed(force in 0.1..1e4_f64, micros in 1..1_000_000_u64) {
            let lasting = Duration::from_micros(micros);
            if let Err(refused) = cap(force).allows(lasting) {
                prop_assert!(refused.largest < force);
                prop_assert!(cap(refused.largest).allows(lasting).is_ok());
            }
        }

        #[test]
        fn no_number_that_is_none_is_allowed(mass in prop_oneof![Just(f64::NAN), Just(0.0), Just(-0.0)]) {
            let cap = ForceCap { max_force: 40.0, effective_mass: mass };
            prop_assert!(cap.allows(Duration::from_millis(1)).is_err());
        }
    }
}
