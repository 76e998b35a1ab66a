//! Maximum force on the hand that the drives' own timers allow. After a failure of the master, drives hold their last
//! torques until a timer expires.
//!
//! All commanded forces are held for that time: reflection, return to centre and walls, soft stops. A force F
//! accelerates a free hand and grip of mass m to F t / m in a time t. The limit is [`MAX_RUNAWAY_SPEED`].
//!
//! Gravity compensation balances the weight, and friction compensation is at most 0.7 of the friction. A held damper
//! d slows the hand unless d t / m exceeds 1: the excess reverses the motion and adds to the speed.

use std::time::Duration;

use derive_more::Display;
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
    /// Maximum of each damper, in N·s/m.
    pub dampers: Dampers,
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

/// Dampers of the grip, in N·s/m; zero for one that is absent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dampers {
    /// K_D, the largest of the three axes.
    pub constant: f64,
    /// Passivity layer, at its strongest.
    pub passivity: f64,
    /// Energy tank, at its strongest.
    pub tank: f64,
}

/// Summand of the forces or the dampers, with the key that sets it, relative to `[controller]`.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Summand {
    /// Reflection.
    #[display("max_force_n")]
    Reflected,
    /// Return to centre and walls.
    #[display("centring_n and walls")]
    Centring,
    /// Springs of the soft stops.
    #[display("soft_stops.push")]
    SoftStops,
    /// K_D.
    #[display("damping_ns_per_m")]
    Damping,
    /// Damper of the passivity layer.
    #[display("passivity.max_damping_ns_per_m")]
    PassivityDamper,
    /// Damper of the energy tank.
    #[display("tank.max_damping_ns_per_m")]
    TankDamper,
}

impl Forces {
    /// Returns the sum of the forces, as if all act along one line.
    pub fn total(&self) -> f64 {
        self.summands().iter().map(|(_, force)| force).sum()
    }

    const fn summands(&self) -> [(Summand, f64); 3] {
        let Self { reflected, centring, soft_stops } = *self;
        [
            (Summand::Reflected, reflected),
            (Summand::Centring, centring),
            (Summand::SoftStops, soft_stops),
        ]
    }
}

impl Dampers {
    /// Returns the sum of the dampers.
    pub fn total(&self) -> f64 {
        self.summands().iter().map(|(_, damping)| damping).sum()
    }

    const fn summands(&self) -> [(Summand, f64); 3] {
        let Self { constant, passivity, tank } = *self;
        [
            (Summand::Damping, constant),
            (Summand::PassivityDamper, passivity),
            (Summand::TankDamper, tank),
        ]
    }
}

/// Error of forces above the maximum that the drives' timers allow.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "{:.1} N ({}){} for the {:.1} ms until a drive stops by itself would make {} kg of hand and grip \
     {speed:.2} m/s fast, more than {}: {}",
    .cap.forces.total(), listed(.cap.forces.summands()), self.dampers(), millis(.reaction_time),
    .cap.effective_mass, bound(.cap.is_halved), self.remedy()
)]
pub struct ForceAboveCap {
    /// Configured forces and dampers.
    pub cap: ForceCap,
    /// Maximum time from the loss of the master until a drive's own timer stops it.
    pub reaction_time: Duration,
    /// Speed that the hand would reach, in m/s.
    pub speed: f64,
}

impl ForceAboveCap {
    /// Returns the summand that contributes most to the speed.
    pub fn largest(&self) -> Summand {
        let Self { cap, reaction_time, .. } = self;
        let by_force = reaction_time.as_secs_f64() / cap.effective_mass;
        let by_damper = cap.reversed(*reaction_time) / cap.dampers.total();
        let forces = cap.forces.summands().map(|(summand, force)| (summand, force * by_force));
        let dampers =
            cap.dampers.summands().map(|(summand, damping)| (summand, damping * by_damper));
        let summands = forces.into_iter().chain(dampers).filter(|(_, speed)| *speed > 0.0);
        let largest = summands.max_by(|(_, a), (_, b)| a.total_cmp(b));
        largest.map_or(Summand::Reflected, |(summand, _)| summand)
    }

    /// Returns the dampers in words, if they reverse the motion.
    fn dampers(&self) -> String {
        let dampers = &self.cap.dampers;
        if self.cap.reversed(self.reaction_time) > 0.0 {
            format!(" and dampers of {:.1} N·s/m ({})", dampers.total(), listed(dampers.summands()))
        } else {
            String::new()
        }
    }

    /// Returns the allowed sum of forces, and that with dampers which do not reverse the motion.
    fn remedy(&self) -> String {
        let Self { cap, reaction_time, .. } = self;
        let force = cap.max_force(*reaction_time);
        if cap.reversed(*reaction_time) <= 0.0 {
            return format!("at most {force:.1} N in all");
        }
        let undamped = ForceCap { dampers: Dampers::default(), ..*cap }.max_force(*reaction_time);
        let damping = tenths(cap.effective_mass / reaction_time.as_secs_f64());
        let with = format!("{undamped:.1} N in all with dampers of at most {damping:.1} N·s/m");
        if force > 0.0 {
            format!("at most {force:.1} N in all, or {with}")
        } else {
            format!("these dampers leave no force; at most {with}")
        }
    }
}

impl ForceCap {
    /// Checks the forces for drives whose own timers stop them within `reaction_time`.
    ///
    /// # Errors
    /// When the hand would exceed [`MAX_RUNAWAY_SPEED`]. The error has the allowed sum of forces.
    pub fn check(&self, reaction_time: Duration) -> Result<(), ForceAboveCap> {
        let Self { forces, effective_mass: mass, .. } = *self;
        let seconds = reaction_time.as_secs_f64();
        let reversed = self.reversed(reaction_time);
        let speed = forces.total() * seconds / mass + reversed;
        let max_speed = reversed + self.share() * (MAX_RUNAWAY_SPEED - reversed).max(0.0);
        // NaN allows nothing.
        if mass > 0.0 && speed <= max_speed && speed <= MAX_RUNAWAY_SPEED {
            return Ok(());
        }
        Err(ForceAboveCap { cap: *self, reaction_time, speed })
    }

    /// Returns the maximum sum of forces for this reaction time, in N, rounded down to a tenth.
    pub fn max_force(&self, reaction_time: Duration) -> f64 {
        let left = (MAX_RUNAWAY_SPEED - self.reversed(reaction_time)).max(0.0);
        tenths(self.share() * left * self.effective_mass / reaction_time.as_secs_f64())
    }

    /// Returns the allowed share of the force, 0.5 or 1.
    const fn share(&self) -> f64 {
        if self.is_halved { 0.5 } else { 1.0 }
    }

    /// Returns the speed added by dampers that reverse the motion, in m/s.
    fn reversed(&self, reaction_time: Duration) -> f64 {
        let turned = self.dampers.total() * reaction_time.as_secs_f64() / self.effective_mass;
        self.max_speed * (turned - 1.0).max(0.0)
    }
}

/// Formats summands that are not zero, largest first: `max_force_n 40.0, soft_stops.push 15.1`.
fn listed(mut summands: [(Summand, f64); 3]) -> String {
    summands.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    let summands = summands.iter().filter(|(_, value)| *value > 0.0);
    let summands: Vec<_> = summands.map(|(key, value)| format!("{key} {value:.1}")).collect();
    summands.join(", ")
}

/// Rounds down to a tenth.
fn tenths(value: f64) -> f64 {
    (value * 10.0).floor() / 10.0
}

fn bound(is_halved: bool) -> String {
    if is_halved {
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
        ForceCap {
            forces,
            dampers: Dampers::default(),
            max_speed: 1.0,
            effective_mass: 1.0,
            is_halved: false,
        }
    }

    #[test]
    fn rpdo_timer_allows_40_n_and_heartbeat_alone_20_n() {
        let (rpdo, heartbeat) = (Duration::from_millis(6), Duration::from_millis(25));
        assert_eq!(cap(40.0).check(rpdo), Ok(()));
        assert_eq!(cap(20.0).check(heartbeat), Ok(()));
        let refused = cap(40.0).check(heartbeat).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "40.0 N (max_force_n 40.0) for the 25.0 ms until a drive stops by itself would make 1 kg of hand \
             and grip 1.00 m/s fast, more than 0.5 m/s: at most 20.0 N in all"
        );
    }

    #[test]
    fn promise_03_forces_that_last_together_count_together() {
        let heartbeat = Duration::from_millis(25);
        let forces = Forces { reflected: 10.0, centring: 6.0, soft_stops: 5.0 };
        let refused = ForceCap { forces, ..cap(0.0) }.check(heartbeat).unwrap_err();
        assert!(refused.to_string().starts_with(
            "21.0 N (max_force_n 10.0, centring_n and walls 6.0, soft_stops.push 5.0) for the 25.0 ms"
        ));
        assert_eq!(refused.largest(), Summand::Reflected);
        let of = |forces| ForceCap { forces, ..cap(0.0) }.check(heartbeat).unwrap_err();
        let walls = Forces { centring: 30.0, ..forces };
        assert_eq!(of(walls).largest(), Summand::Centring);
        let stops = of(Forces { soft_stops: 31.0, ..walls });
        assert_eq!(stops.largest(), Summand::SoftStops);
        let order = "(soft_stops.push 31.0, centring_n and walls 30.0, max_force_n 10.0)";
        assert!(stops.to_string().contains(order), "{stops}");
        let enough = Forces { reflected: 9.0, ..forces };
        assert_eq!(ForceCap { forces: enough, ..cap(0.0) }.check(heartbeat), Ok(()));
    }

    #[test]
    fn promise_03_damper_counts_once_it_reverses_the_motion() {
        let with = |passivity| {
            let dampers = Dampers { constant: 8.0, passivity: passivity - 8.0, tank: 0.0 };
            ForceCap { dampers, ..cap(10.0) }.check(Duration::from_millis(25))
        };
        assert_eq!((with(40.0), with(44.0)), (Ok(()), Ok(())));
        let refused = with(60.0).unwrap_err();
        assert!((refused.speed - 0.75).abs() < 1e-9);
        assert_eq!(
            refused.to_string(),
            "10.0 N (max_force_n 10.0) and dampers of 60.0 N·s/m (passivity.max_damping_ns_per_m 52.0, damping_ns_per_m 8.0) \
             for the 25.0 ms until a drive stops by itself would make 1 kg of hand and grip 0.75 m/s fast, more than \
             0.5 m/s: these dampers leave no force; at most 20.0 N in all with dampers of at most 40.0 N·s/m"
        );
        assert_eq!(refused.largest(), Summand::PassivityDamper);
        let refused = with(56.0).unwrap_err();
        let remedy = " N in all, or 20.0 N in all with dampers of at most 40.0 N·s/m";
        assert!(refused.to_string().ends_with(remedy), "{refused}");
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
        let dampers = Dampers { constant: 48.0, ..Dampers::default() };
        let damped = ForceCap { dampers, ..half(0.0) };
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
                let max_force = refused.cap.max_force(reaction_time);
                prop_assert!(max_force < force);
                prop_assert!(cap(max_force).check(reaction_time).is_ok());
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
        let dampers = Dampers { tank: f64::INFINITY, ..Dampers::default() };
        assert!(ForceCap { dampers, ..cap(1.0) }.check(UNPROVEN_REACTION_TIME).is_err());
    }
}
