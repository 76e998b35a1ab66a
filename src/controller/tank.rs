//! Energy tank: bounds the energy that the port delivers to the hand (passivity layer of Franken and others 2011).
//! It uses no model of the task, so it bounds the effect of a wrong one.
//!
//! The hand's work on the port fills the tank, and a weak damper refills it when it is low. With an empty tank the task
//! wrench resists the hand but does no work on it.

use thiserror::Error;

/// Levels and damper of the tank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TankSettings {
    /// Initial level, in J.
    pub initial: f64,
    /// Minimum level, in J, below which the port delivers no energy.
    pub min: f64,
    /// Maximum level, in J.
    pub max: f64,
    /// Level below which the damper refills the tank, in J.
    pub low: f64,
    /// Damping per missing energy, in N·s/m per J.
    pub refill: f64,
    /// Maximum damping, in N·s/m. A sampled grip oscillates with more.
    pub max_damping: f64,
}

/// Reason why settings of a tank are invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("a tank needs 0 <= min <= low <= max, initial within min and max, and a damper: {0}")]
pub struct InvalidTank(pub &'static str);

/// Energy tank with its level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tank {
    settings: TankSettings,
    level: f64,
}

impl Tank {
    /// Creates a tank at its initial level.
    ///
    /// # Errors
    /// Returns the first violated constraint.
    pub fn new(settings: TankSettings) -> Result<Self, InvalidTank> {
        let TankSettings { initial, min, max, low, refill, max_damping } = settings;
        let fits = |ok: bool, what| if ok { Ok(()) } else { Err(InvalidTank(what)) };
        fits(min >= 0.0, "min is below 0")?;
        fits((min..=max).contains(&low), "low is not within min and max")?;
        fits((min..=max).contains(&initial), "initial is not within min and max")?;
        fits(max <= 1e6, "max must be at most 1e6")?;
        fits((0.0..=1e6).contains(&refill), "the damper must be within 0..=1e6")?;
        fits((0.0..=1e6).contains(&max_damping), "the strongest damper must be within 0..=1e6")?;
        Ok(Self { settings, level: initial })
    }

    /// Level, in J.
    pub const fn level(&self) -> f64 {
        self.level
    }

    /// Adds the work of the hand on the port since the last cycle, in J.
    pub fn account(&mut self, work: f64) {
        self.level = (self.level + work).min(self.settings.max);
    }

    /// Returns the permitted share of a task wrench, 0 to 1, that would do `work` J on the hand until the next cycle.
    pub fn share(&self, work: f64) -> f64 {
        let left = (self.level - self.settings.min).max(0.0);
        if work > left { left / work } else { 1.0 }
    }

    /// Damping that refills the tank at its present level, in N·s/m.
    pub fn refill(&self) -> f64 {
        let missing = (self.settings.low - self.level).max(0.0);
        (self.settings.refill * missing).min(self.settings.max_damping)
    }

    /// Maximum damping at any level, in N·s/m; zero without refill.
    pub const fn max_damping(&self) -> f64 {
        let TankSettings { refill, max_damping, .. } = self.settings;
        // Delayed torques may empty the tank below `min`, so no level bounds the missing energy.
        if refill > 0.0 { max_damping } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::torque_delay::TorqueDelay;

    const SETTINGS: TankSettings = TankSettings {
        initial: 0.006,
        min: 0.001,
        max: 0.05,
        low: 0.004,
        refill: 400.0,
        max_damping: 60.0,
    };

    proptest! {
        #[test]
        fn no_more_is_given_than_was_there(
            steps in prop::collection::vec((-10.0..10.0_f64, -0.01..0.01_f64), 1..200)
        ) {
            let mut tank = Tank::new(SETTINGS).unwrap();
            let mut given = 0.0;
            for (force, moved) in steps {
                // The motion is the one that the share was computed for.
                let work = force * moved;
                let applied = work * tank.share(work);
                tank.account(-applied);
                given += applied;
                prop_assert!(tank.level() >= SETTINGS.min - 1e-12 && tank.level() <= SETTINGS.max);
                prop_assert!(given <= SETTINGS.initial - SETTINGS.min + 1e-12);
            }
        }
    }

    #[test]
    fn levels_are_in_order() {
        assert!(Tank::new(TankSettings { min: -0.1, ..SETTINGS }).is_err());
        assert!(Tank::new(TankSettings { low: 0.06, ..SETTINGS }).is_err());
        assert!(Tank::new(TankSettings { initial: 0.0, ..SETTINGS }).is_err());
        assert!(Tank::new(TankSettings { max: f64::NAN, ..SETTINGS }).is_err());
        assert!(Tank::new(TankSettings { refill: f64::INFINITY, ..SETTINGS }).is_err());
        assert!(Tank::new(TankSettings { max_damping: f64::NAN, ..SETTINGS }).is_err());
    }

    /// Returns the highest speed in the second half of 2 s of a mass of 0.5 kg that an empty tank damps, two cycles late.
    fn speed_after_a_second(settings: TankSettings) -> f64 {
        let (dt, mass) = (1e-3, 0.5);
        let mut tank = Tank::new(settings).unwrap();
        let mut forces = TorqueDelay::new(0.0);
        let (mut v, mut fastest) = (0.1_f64, 0.0_f64);
        let mut came = v;
        for cycle in 0..2_000 {
            let acted = forces.acted();
            tank.account(-acted * came * dt);
            forces.push(-tank.refill() * came);
            let next = v + forces.acted() / mass * dt;
            came = f64::midpoint(v, next);
            v = next;
            fastest = if cycle >= 1_000 { fastest.max(v.abs()) } else { fastest };
        }
        fastest
    }

    #[test]
    fn refill_has_a_ceiling_and_no_limit_cycle() {
        let empty = TankSettings { initial: 0.0, min: 0.0, max: 1.0, low: 1.0, ..SETTINGS };
        let strong = TankSettings { refill: 2_000.0, ..empty };
        let speed = speed_after_a_second(strong);
        assert!(speed < 1e-3, "{speed} m/s: it is driven to and fro");
        let unbounded = speed_after_a_second(TankSettings { max_damping: 2_000.0, ..strong });
        assert!(unbounded > 0.1, "{unbounded} m/s: the case would show nothing");
    }
}
