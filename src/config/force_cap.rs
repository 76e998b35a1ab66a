//! Largest force on the hand that the drives' own timers allow: a master that dies leaves the last torques
//! on the arm until they trip.
//!
//! Everything that may be commanded at once lasts as long: what is reflected, return to centre and walls,
//! soft stops. A free hand and grip of mass m, pushed by F for a time t, reaches F t / m; that must not be
//! more than [`FASTEST`]. The weight of the arm is carried, so it pushes nothing. A damper d that is held
//! slows the hand down, unless it turns it round: d t / m above 1 adds to the speed.

use std::fmt;
use std::time::Duration;

use thiserror::Error;

/// Speed of the hand that a force without its master may lead to, in m/s.
pub const FASTEST: f64 = 0.5;

/// Time for which a force lasts where the drives' timers were not proven: until a person has let go and
/// hit the emergency stop.
pub const UNPROVEN: Duration = Duration::from_millis(250);

/// The largest forces that may be commanded at the same time, and the hand they push.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceCap {
    /// The forces.
    pub pushes: Pushes,
    /// All dampers together, in N·s/m.
    pub damping: f64,
    /// Speed at which the node stops the hand, in m/s.
    pub max_speed: f64,
    /// Mass of hand and grip, in kg: `[safety] effective_mass_kg`.
    pub effective_mass: f64,
}

/// Forces at the grip, in N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pushes {
    /// Sensed or by the virtual coupling: `[controller] max_force_n`.
    pub reflected: f64,
    /// Return to centre and walls.
    pub centring: f64,
    /// Soft stops.
    pub soft_stops: f64,
}

impl Pushes {
    /// Their sum, all along one line.
    pub fn total(&self) -> f64 {
        let Self { reflected, centring, soft_stops } = self;
        reflected + centring + soft_stops
    }

    /// Returns the largest of them.
    pub fn largest(&self) -> Push {
        let Self { reflected, centring, soft_stops } = *self;
        if reflected >= centring && reflected >= soft_stops {
            Push::Reflected
        } else if centring >= soft_stops {
            Push::Centring
        } else {
            Push::SoftStops
        }
    }
}

/// One of the forces of [`Pushes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Push {
    /// Sensed or by the virtual coupling.
    Reflected,
    /// Return to centre and walls.
    Centring,
    /// Soft stops.
    SoftStops,
}

/// As in `43.5 N (max_force_n = 40, return to centre and walls 3.5)`.
impl fmt::Display for Pushes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { reflected, centring, soft_stops } = self;
        write!(f, "{:.1} N (max_force_n = {reflected}", self.total())?;
        for (name, force) in [("return to centre and walls", centring), ("soft stops", soft_stops)]
        {
            if *force > 0.0 {
                write!(f, ", {name} {force:.1}")?;
            }
        }
        f.write_str(")")
    }
}

/// More force than the drives' timers allow.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "{pushes}{} for the {:.1} ms until a drive stops by itself would make {mass} kg of hand and grip \
     {speed:.2} m/s fast, more than {FASTEST} m/s: at most {largest:.1} N in all",
    dampers(.damping), millis(.lasting)
)]
pub struct TooMuchForce {
    /// What was asked for.
    pub pushes: Pushes,
    /// Dampers that turn the hand round, in N·s/m; `None` where they only slow it down.
    pub damping: Option<f64>,
    /// How long a drive may push by itself.
    pub lasting: Duration,
    /// In kg.
    pub mass: f64,
    /// The speed the hand would reach, in m/s.
    pub speed: f64,
    /// The sum that would be allowed, in N, rounded down to a tenth.
    pub largest: f64,
}

impl ForceCap {
    /// Allows the forces to last so long.
    ///
    /// # Errors
    /// When the hand would become too fast; with the sum that would do.
    pub fn allows(&self, lasting: Duration) -> Result<(), TooMuchForce> {
        let Self { pushes, damping, max_speed, effective_mass: mass } = *self;
        let seconds = lasting.as_secs_f64();
        let turned_round = max_speed * (damping * seconds / mass - 1.0).max(0.0);
        let speed = pushes.total() * seconds / mass + turned_round;
        // NaN allows nothing.
        if mass > 0.0 && speed <= FASTEST {
            return Ok(());
        }
        let left = (FASTEST - turned_round).max(0.0);
        let largest = (left * mass / seconds * 10.0).floor() / 10.0;
        let damping = (turned_round > 0.0).then_some(damping);
        Err(TooMuchForce { pushes, damping, lasting, mass, speed, largest })
    }
}

fn dampers(damping: &Option<f64>) -> String {
    damping.map(|damping| format!(" and dampers of {damping} N·s/m")).unwrap_or_default()
}

fn millis(span: &Duration) -> f64 {
    span.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn cap(reflected: f64) -> ForceCap {
        let pushes = Pushes { reflected, centring: 0.0, soft_stops: 0.0 };
        ForceCap { pushes, damping: 0.0, max_speed: 1.0, effective_mass: 1.0 }
    }

    #[test]
    fn with_an_rpdo_timer_40_n_pass_and_with_a_heartbeat_alone_20_n() {
        let (rpdo, heartbeat) = (Duration::from_millis(6), Duration::from_millis(25));
        assert_eq!(cap(40.0).allows(rpdo), Ok(()));
        assert_eq!(cap(20.0).allows(heartbeat), Ok(()));
        let refused = cap(40.0).allows(heartbeat).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "40.0 N (max_force_n = 40) for the 25.0 ms until a drive stops by itself would make 1 kg of hand \
             and grip 1.00 m/s fast, more than 0.5 m/s: at most 20.0 N in all"
        );
    }

    #[test]
    fn promise_03_forces_that_last_together_count_together() {
        let heartbeat = Duration::from_millis(25);
        let pushes = Pushes { reflected: 10.0, centring: 6.0, soft_stops: 5.0 };
        let refused = ForceCap { pushes, ..cap(0.0) }.allows(heartbeat).unwrap_err();
        assert!(refused.to_string().starts_with(
            "21.0 N (max_force_n = 10, return to centre and walls 6.0, soft stops 5.0) for the 25.0 ms"
        ));
        assert_eq!(refused.pushes.largest(), Push::Reflected);
        let walls = Pushes { centring: 30.0, ..pushes };
        assert_eq!(walls.largest(), Push::Centring);
        assert_eq!(Pushes { soft_stops: 31.0, ..walls }.largest(), Push::SoftStops);
        let enough = Pushes { reflected: 9.0, ..pushes };
        assert_eq!(ForceCap { pushes: enough, ..cap(0.0) }.allows(heartbeat), Ok(()));
    }

    #[test]
    fn promise_03_damper_counts_once_it_turns_the_hand_round() {
        let with = |damping| ForceCap { damping, ..cap(10.0) }.allows(Duration::from_millis(25));
        assert_eq!((with(40.0), with(44.0)), (Ok(()), Ok(())));
        let refused = with(60.0).unwrap_err();
        assert!((refused.speed - 0.75).abs() < 1e-9);
        assert!(refused.to_string().contains("and dampers of 60 N·s/m for the 25.0 ms"));
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
        fn no_number_that_is_none_is_allowed(wrong in prop_oneof![Just(f64::NAN), Just(0.0), Just(-0.0)]) {
            let massless = ForceCap { effective_mass: wrong, ..cap(40.0) };
            prop_assert!(massless.allows(Duration::from_millis(1)).is_err());
        }
    }

    #[test]
    fn forces_that_are_nan_are_not_allowed() {
        assert!(cap(f64::NAN).allows(Duration::from_millis(1)).is_err());
        assert!(ForceCap { damping: f64::INFINITY, ..cap(1.0) }.allows(UNPROVEN).is_err());
    }
}
