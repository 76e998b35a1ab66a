//! An energy tank: the port may give the hand only what is in it (the outer layer of Franken and
//! others 2011). It knows nothing of the task, so it bounds every mistake about it.
//!
//! What the hand puts into the port fills it; a weak damper refills it when it runs low; when it is empty
//! the task wrench stops pushing the hand along and only resists.

use thiserror::Error;

/// Levels in J, and the damper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TankSettings {
    /// What it begins with.
    pub initial: f64,
    /// It is never emptied below this.
    pub min: f64,
    /// It holds no more.
    pub max: f64,
    /// Below this it is refilled.
    pub low: f64,
    /// The damper's strength per J that is missing, in N·s/m per J.
    pub refill: f64,
}

/// Why levels make no tank.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("a tank needs 0 <= min <= low <= max, initial within min and max, and a damper: {0}")]
pub struct InvalidTank(pub &'static str);

/// A tank and what is in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tank {
    settings: TankSettings,
    level: f64,
}

impl Tank {
    /// Filled to its initial level.
    ///
    /// # Errors
    /// Levels that are not in order, or not finite.
    pub fn new(settings: TankSettings) -> Result<Self, InvalidTank> {
        let TankSettings { initial, min, max, low, refill } = settings;
        let fits = |ok: bool, what| if ok { Ok(()) } else { Err(InvalidTank(what)) };
        fits(min >= 0.0, "min is below 0")?;
        fits((min..=max).contains(&low), "low is not within min and max")?;
        fits((min..=max).contains(&initial), "initial is not within min and max")?;
        fits(max <= 1e6, "max is no energy of a hand controller")?;
        fits((0.0..=1e6).contains(&refill), "the damper is none")?;
        Ok(Self { settings, level: initial })
    }

    /// What is in it, in J.
    pub const fn level(&self) -> f64 {
        self.level
    }

    /// Adds the work in J that the hand has just done against the port.
    pub fn account(&mut self, work: f64) {
        self.level = (self.level + work).min(self.settings.max);
    }

    /// How much of a task wrench may act that would give the hand `work` J by the next cycle, 0 to 1.
    pub fn share(&self, work: f64) -> f64 {
        let left = (self.level - self.settings.min).max(0.0);
        if work > left { left / work } else { 1.0 }
    }

    /// The damper that refills it, in N·s/m.
    pub fn refill(&self) -> f64 {
        self.settings.refill * (self.settings.low - self.level).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SETTINGS: TankSettings =
        TankSettings { initial: 0.006, min: 0.001, max: 0.05, low: 0.004, refill: 400.0 };

    proptest! {
        #[test]
        fn no_more_is_given_than_was_there(
            steps in prop::collection::vec((-10.0..10.0_f64, -0.01..0.01_f64), 1..200)
        ) {
            let mut tank = Tank::new(SETTINGS).unwrap();
            let mut given = 0.0;
            for (force, moved) in steps {
                // The force acts with the motion it was granted for.
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
    }
}
