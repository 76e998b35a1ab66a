//! Four conditions: reflection on or off, accommodation on or off. All other settings are equal.

use std::fmt;

use serde::Serialize;

use config::Config;
use controller::gains::Gains;
use robot::accommodation::Accommodation;

/// Positions of the switches of reflection and accommodation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Condition {
    /// Set if the wrench is reflected: K_T is not zero.
    pub reflection: bool,
    /// Set if the arm yields to the wrench: K_FA is not zero.
    pub accommodation: bool,
}

impl Condition {
    /// "No force info" of the paper: both off.
    pub const NEITHER: Self = Self { reflection: false, accommodation: false };

    /// "FRHC/NTRFC" of the paper: both on.
    pub const BOTH: Self = Self { reflection: true, accommodation: true };

    /// All four conditions; the paper's two are the first and the last.
    pub const ALL: [Self; 4] = [
        Self::NEITHER,
        Self { reflection: true, accommodation: false },
        Self { reflection: false, accommodation: true },
        Self::BOTH,
    ];

    /// Returns the configuration with the switches of this condition; `config` has both on.
    #[must_use]
    pub fn applied(self, config: &Config) -> Config {
        let k_t = config.controller.reflection.gain();
        let k_fa = config.remote.interaction.accommodation;
        let k_t = if self.reflection { *k_t } else { Gains::ZERO };
        let k_fa = if self.accommodation { k_fa } else { Accommodation::default() };
        config.clone().with_switches_at(k_t, k_fa)
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.reflection, self.accommodation) {
            (false, false) => "neither (no force info)",
            (true, false) => "reflection",
            (false, true) => "accommodation",
            (true, true) => "both (FRHC/NTRFC)",
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::dual_peg::settings::DualPeg;

    use super::*;

    #[test]
    fn conditions_differ_in_nothing_but_the_two_switches() {
        let config = DualPeg::load(Path::new("lab/config/dual_peg.toml")).unwrap().config;
        let whole = |config: &Config| format!("{config:?}");
        let both = Condition::BOTH.applied(&config);
        assert_eq!(whole(&both), whole(&config));
        for condition in Condition::ALL {
            let applied = condition.applied(&config);
            let is_on = |gains: [f64; 6]| gains.iter().all(|gain| *gain > 0.0);
            let is_off = |gains: [f64; 6]| gains.iter().all(|gain| gain.abs() <= 0.0);
            let (k_t, k_fa) = (
                *applied.controller.reflection.gain().values(),
                *applied.remote.interaction.accommodation.gain(),
            );
            assert!(if condition.reflection { is_on(k_t) } else { is_off(k_t) }, "{k_t:?}");
            assert!(if condition.accommodation { is_on(k_fa) } else { is_off(k_fa) }, "{k_fa:?}");
            // With both switches on again, the configuration is the original.
            let again = applied.with_switches_at(
                *config.controller.reflection.gain(),
                config.remote.interaction.accommodation,
            );
            assert_eq!(whole(&again), whole(&config));
        }
    }
}
