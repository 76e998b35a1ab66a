//! Maximum force on the hand that the drives' own timers allow. After a failure of the master, drives hold their last
//! torques until a timer expires.
//!
//! All commanded forces are held for that time: reflection, return to centre and walls, soft stops. A force F
//! accelerates a free hand and grip of mass m to F t / m in a time t. The limit is [`MAX_RUNAWAY_SPEED`].
//!
//! Gravity compensation balances the weight, and friction compensation is at most 0.7 of the friction. A held damper
//! d slows the hand unless d t / m exceeds 1: the excess reverses the motion and adds to the speed.

use std::fmt;
use std::time::Duration;

use thiserror::Error;

/// Maximum speed that the hand may reach before the drives stop without a master, in m/s.
pub const MAX_RUNAWAY_SPEED: f64 = 0.5;

/// Reaction time without a proof test of the drives' timers, in which the operator releases the grip and hits the emergency stop.
pub const UNPROVEN_REACTION_TIME: Duration = Duration::from_millis(250);

/// Maximum forces commanded at the same time, and the hand they act on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceCap {
    /// Maximum of each kind of force, in N.
    pub forces: Forces,
    /// Sum of all dampers, in N·s/m.
    pub damping: f64,
    /// Speed at which the node stops the hand, in m/s.
    pub max_speed: f64,
    /// Mass of hand and grip, in kg: `[safety] effective_mass_kg`.
    pub effective_mass: f64,
    /// Set if a fact of a drive is stated only: half of the force is allowed.
    pub is_halved: bool,
}

/// Forces at the grip, in N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forces {
    /// Reflection, of a sensed force or of the virtual coupling: `[controller] max_force_n`.
    pub reflected: f64,
    /// Return to centre and walls.
    pub centring: f64,
    /// Springs of the soft stops, at the ends of the joints' ranges; zero without them.
    pub soft_stops: f64,
}

impl Forces {
    /// Returns the sum of the forces, as if all act along one line.
    pub fn total(&self) -> f64 {
        let Self { reflected, centring, soft_stops } = self;
        reflected + centring + soft_stops
    }

    /// Returns the kind that contributes most to the sum.
    pub fn largest(&self) -> ForceKind {
        let Self { reflected, centring, soft_stops } = *self;
        if reflected >= centring && reflected >= soft_stops {
            ForceKind::Reflected
        } else if centring >= soft_stops {
            ForceKind::Centring
        } else {
            ForceKind::SoftStops
        }
    }
}

/// Origin of a force at the grip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForceKind {
    /// Reflection, of a sensed force or of the virtual coupling.
    Reflected,
    /// Return to centre and walls.
    Centring,
    /// Springs of the soft stops, at the ends of the joints' ranges.
    SoftStops,
}

/// Writes the sum and its terms: `43.5 N (max_force_n = 40, return to centre and walls 3.5)`.
impl fmt::Display for Forces {
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

/// Error of forces above the maximum that the drives' timers allow.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "{forces}{} for the {:.1} ms until a drive stops by itself would make {mass} kg of hand and grip \
     {speed:.2} m/s fast, more than {}: at most {max_force:.1} N in all",
    dampers(.damping), millis(.reaction_time), bound(.is_halved)
)]
pub struct ForceAboveCap {
    /// Configured forces.
    pub forces: Forces,
    /// Dampers that reverse the motion of the hand, in N·s/m; `None` if they only slow it.
    pub damping: Option<f64>,
    /// Maximum time from the loss of the master until a drive's own timer stops it.
    pub reaction_time: Duration,
    /// Mass of hand and grip, in kg.
    pub mass: f64,
    /// Speed that the hand would reach, in m/s.
    pub speed: f64,
    /// Maximum sum of forces, in N, rounded down to a tenth.
    pub max_force: f64,
    /// Set if only half of the force is allowed, because a fact of a drive is stated only.
    pub is_halved: bool,
}

impl ForceCap {
    /// Checks the forces for drives whose own timers stop them within `reaction_time`.
    ///
    /// # Errors
    /// When the hand would exceed [`MAX_RUNAWAY_SPEED`]. The error has the allowed sum of forces.
    pub fn check(&self, reaction_time: Duration) -> Result<(), ForceAboveCap> {
        let Self { forces, damping, effective_mass: mass, .. } = *self;
        let seconds = reaction_time.as_secs_f64();
        let reversed = self.reversed(reaction_time);
        let speed = forces.total() * seconds / mass + reversed;
        let max_speed = reversed + self.share() * (MAX_RUNAWAY_SPEED - reversed).max(0.0);
        // NaN allows nothing.
        if mass > 0.0 && speed <= max_speed && speed <= MAX_RUNAWAY_SPEED {
            return Ok(());
        }
        let max_force = self.max_force(reaction_time);
        let damping = (reversed > 0.0).then_some(damping);
        let is_halved = self.is_halved;
        Err(ForceAboveCap { forces, damping, reaction_time, mass, speed, max_force, is_halved })
    }

    /// Returns the maximum sum of forces for this reaction time, in N, rounded down to a tenth.
    pub fn max_force(&self, reaction_time: Duration) -> f64 {
        let left = (MAX_RUNAWAY_SPEED - self.reversed(reaction_time)).max(0.0);
        (self.share() * left * self.effective_mass / reaction_time.as_secs_f64() * 10.0).floor()
            / 10.0
    }

    /// Returns the allowed share of the force, 0.5 or 1.
    const fn share(&self) -> f64 {
        if self.is_halved { 0.5 } else { 1.0 }
    }

    /// Returns the speed added by dampers that reverse the motion, in m/s.
    fn reversed(&self, reaction_time: Duration) -> f64 {
        let turned = self.damping * reaction_time.as_secs_f64() / self.effective_mass;
        self.max_speed * (turned - 1.0).max(0.0)
    }
}

fn dampers(damping: &Option<f64>) -> String {
    damping.map(|damping| format!(" and dampers of {damping} N·s/m")).unwrap_or_default()
}

fn bound(is_halved: &bool) -> String {
    if *is_halved {
        format!("half of {MAX_RUNAWAY_SPEED} m/s, as facts of a drive are stated only")
    } else {
        format!("{MAX_RUNAWAY_SPEED} m/s")
    }
}

fn millis(span: &Duration) -> f64 {
    span.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn cap(reflected: f64) -> ForceCap {
        let forces = Forces { reflected, centring: 0.0, soft_stops: 0.0 };
        ForceCap { forces, damping: 0.0, max_speed: 1.0, effective_mass: 1.0, is_halved: false }
    }

    #[test]
    fn rpdo_timer_allows_40_n_and_heartbeat_alone_20_n() {
        let (rpdo, heartbeat) = (Duration::from_millis(6), Duration::from_millis(25));
        assert_eq!(cap(40.0).check(rpdo), Ok(()));
        assert_eq!(cap(20.0).check(heartbeat), Ok(()));
        let refused = cap(40.0).check(heartbeat).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "40.0 N (max_force_n = 40) for the 25.0 ms until a drive stops by itself would make 1 kg of hand \
             and grip 1.00 m/s fast, more than 0.5 m/s: at most 20.0 N in all"
        );
    }

    #[test]
    fn promise_03_forces_that_last_together_count_together() {
        let heartbeat = Duration::from_millis(25);
        let forces = Forces { reflected: 10.0, centring: 6.0, soft_stops: 5.0 };
        let refused = ForceCap { forces, ..cap(0.0) }.check(heartbeat).unwrap_err();
        assert!(refused.to_string().starts_with(
            "21.0 N (max_force_n = 10, return to centre and walls 6.0, soft stops 5.0) for the 25.0 ms"
        ));
        assert_eq!(refused.forces.largest(), ForceKind::Reflected);
        let walls = Forces { centring: 30.0, ..forces };
        assert_eq!(walls.largest(), ForceKind::Centring);
        assert_eq!(Forces { soft_stops: 31.0, ..walls }.largest(), ForceKind::SoftStops);
        let enough = Forces { reflected: 9.0, ..forces };
        assert_eq!(ForceCap { forces: enough, ..cap(0.0) }.check(heartbeat), Ok(()));
    }

    #[test]
    fn promise_03_damper_counts_once_it_reverses_the_motion() {
        let with = |damping| ForceCap { damping, ..cap(10.0) }.check(Duration::from_millis(25));
        assert_eq!((with(40.0), with(44.0)), (Ok(()), Ok(())));
        let refused = with(60.0).unwrap_err();
        assert!((refused.speed - 0.75).abs() < 1e-9);
        assert!(refused.to_string().contains("and dampers of 60 N·s/m for the 25.0 ms"));
    }

    #[test]
    fn stated_facts_halve_the_allowed_force() {
        let heartbeat = Duration::from_millis(25);
        let half = |reflected| ForceCap { is_halved: true, ..cap(reflected) };
        assert_eq!(half(10.0).check(heartbeat), Ok(()));
        let refused = half(10.1).check(heartbeat).unwrap_err();
        assert!(
            refused.to_string().ends_with(
                "0.25 m/s fast, more than half of 0.5 m/s, as facts of a drive are stated only: at most 10.0 N in all"
            ),
            "{refused}"
        );
        // Dampers that reverse the motion take their share first.
        let damped = ForceCap { damping: 48.0, ..half(0.0) };
        assert!(
            (damped.max_force(heartbeat) - 6.0).abs() < 0.11,
            "{}",
            damped.max_force(heartbeat)
        );
    }

    #[test]
    fn unproven_timers_allow_2_n() {
        assert_eq!(cap(2.0).check(UNPROVEN_REACTION_TIME), Ok(()));
        assert!(cap(2.1).check(UNPROVEN_REACTION_TIME).is_err());
    }

    proptest! {
        #[test]
        fn named_maximum_force_is_allowed(force in 0.1..1e4_f64, micros in 1..1_000_000_u64) {
            let reaction_time = Duration::from_micros(micros);
            if let Err(refused) = cap(force).check(reaction_time) {
                prop_assert!(refused.max_force < force);
                prop_assert!(cap(refused.max_force).check(reaction_time).is_ok());
            }
        }

        #[test]
        fn force_on_an_invalid_mass_is_refused(wrong in prop_oneof![Just(f64::NAN), Just(0.0), Just(-0.0)]) {
            let massless = ForceCap { effective_mass: wrong, ..cap(40.0) };
            prop_assert!(massless.check(Duration::from_millis(1)).is_err());
        }
    }

    #[test]
    fn nan_forces_are_refused() {
        assert!(cap(f64::NAN).check(Duration::from_millis(1)).is_err());
        assert!(
            ForceCap { damping: f64::INFINITY, ..cap(1.0) }.check(UNPROVEN_REACTION_TIME).is_err()
        );
    }
}
