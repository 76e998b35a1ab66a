//! `[environment]`: changes of the configured surroundings of the object.

use serde::{Deserialize, Serialize};
use toml::Spanned;

use crate::scenario::problem::{LocatedProblem, Problem, within};

/// Range of the stiffness of a wall, in N/m.
const STIFFNESS: [f64; 2] = [1.0, 1e7];

/// Largest coordinate of a point of a wall, in m.
const MAX_COORDINATE: f64 = 100.0;

/// Changes of the configured environment of the object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Environment {
    /// Stiffness instead of the configured one, within 1 to 1e7 N/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wall_stiffness_n_per_m: Option<f64>,
    /// Point of the wall, in the object's base, in m; its normal stays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wall_point_m: Option<[f64; 3]>,
}

impl Environment {
    /// Returns whether the environment is that of the configuration.
    pub fn is_as_configured(&self) -> bool {
        *self == Self::default()
    }

    /// Checks the values of a file.
    pub(super) fn check(section: &Spanned<Self>) -> Result<Self, LocatedProblem> {
        let changes = *section.get_ref();
        changes.check_values().map_err(|problem| (section.span(), problem))?;
        Ok(changes)
    }

    fn check_values(&self) -> Result<(), Problem> {
        let [low, high] = STIFFNESS;
        if let Some(stiffness) = self.wall_stiffness_n_per_m {
            within("wall_stiffness_n_per_m", stiffness, low, high)?;
        }
        for coordinate in self.wall_point_m.into_iter().flatten() {
            within("wall_point_m", coordinate, -MAX_COORDINATE, MAX_COORDINATE)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    fn parsed(section: &str) -> Result<Environment, String> {
        let text = format!("seconds = 5\n[environment]\n{section}\n");
        Scenario::parse(&text).map(|one| one.environment()).map_err(|error| error.to_string())
    }

    #[test]
    fn each_key_is_optional() {
        let moved = parsed("wall_point_m = [0.5, 0.0, 0.0]").unwrap();
        assert_eq!(
            (moved.wall_point_m, moved.wall_stiffness_n_per_m),
            (Some([0.5, 0.0, 0.0]), None)
        );
        assert!(parsed("").unwrap().is_as_configured());
    }

    #[test]
    fn wrong_value_is_named_with_its_line() {
        for (section, words) in [
            ("wall_point_m = [nan, 0.0, 0.0]", "wall_point_m: must be within -100..=100, got NaN"),
            (
                "wall_stiffness_n_per_m = 0",
                "wall_stiffness_n_per_m: must be within 1..=10000000, got 0",
            ),
        ] {
            let error = parsed(section).unwrap_err();
            assert!(error.starts_with("2: environment") && error.contains(words), "{error}");
        }
    }

    #[test]
    fn written_environment_is_read_again() {
        let text = "seconds = 5\n[environment]\nwall_point_m = [0.5, 0.1, 0.0]\n";
        let scenario = Scenario::parse(text).unwrap();
        assert_eq!(Scenario::parse(&scenario.to_toml()).unwrap(), scenario);
    }
}
