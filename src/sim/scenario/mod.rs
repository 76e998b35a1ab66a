//! Scenarios: a script in TOML of operator actions and faults.
//!
//! Times are in s after the first SYNC. Hand movements are relative to the grip's pose at the start, along the axes of
//! {0} and about those of the grip.
//!
//! | file         | content                                                     |
//! |--------------|-------------------------------------------------------------|
//! | [`operator`] | moves, switches, holds, console requests                    |
//! | [`fault`]    | faults, from `[[fault]]` entries                            |

mod entry;
pub mod fault;
mod keys;
pub mod operator;
mod problem;

pub use operator::ConsoleRequest;
pub use operator::Operator;
pub use problem::Problem;
pub use problem::ScenarioError;

use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use crate::operator_settings::OperatorSettings;
use crate::quirks::QuirkAssignment;
use crate::scenario::fault::Fault;
use crate::scenario::keys::Entry;
use crate::scenario::operator::Actions;
use crate::scenario::operator::Console;
use crate::scenario::operator::Hold;
use crate::scenario::operator::Move;
use crate::scenario::operator::Switch;
use crate::scenario::problem::MIN_DURATION;
use crate::scenario::problem::Misplaced;
use crate::scenario::problem::within;
use written;

/// Maximum length of a scenario, in s.
const MAX_LENGTH: f64 = 86_400.0;

/// Minimum stiffness of the wall, in N/m.
const MIN_WALL_STIFFNESS: f64 = 1.0;

/// Maximum stiffness of the wall, in N/m.
const MAX_WALL_STIFFNESS: f64 = 1e7;

/// A checked scenario.
#[derive(Clone, Debug)]
pub struct Scenario {
    seconds: f64,
    wall_stiffness: Option<f64>,
    compares_passivity: bool,
    hand: OperatorSettings,
    quirks: QuirkAssignment,
    actions: Actions,
    faults: Vec<Fault>,
}

/// A scenario as read from a file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Script {
    seconds: Spanned<f64>,
    /// Changes of the configured environment.
    environment: Option<Spanned<Environment>>,
    /// Plays the scenario twice: without and with the passivity layer.
    #[serde(default)]
    compares_passivity: bool,
    #[serde(default)]
    hand: OperatorSettings,
    #[serde(default, rename = "move")]
    moves: Vec<Spanned<Move>>,
    #[serde(default, rename = "switch")]
    switches: Vec<Spanned<Switch>>,
    #[serde(default)]
    console: Vec<Spanned<Console>>,
    #[serde(default, rename = "hold")]
    holds: Vec<Spanned<Hold>>,
    #[serde(default, rename = "fault")]
    faults: Vec<Spanned<Entry>>,
    /// Quirks of drives.
    #[serde(default, rename = "drive")]
    quirks: QuirkAssignment,
}

/// Environment of the commanded object.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Environment {
    wall_stiffness_n_per_m: f64,
}

impl Scenario {
    /// Parses a scenario.
    ///
    /// # Errors
    /// The first error, with its line.
    pub fn parse(text: &str) -> Result<Self, ScenarioError> {
        let at = |span: Range<usize>, problem| ScenarioError { line: line(text, &span), problem };
        let script: Script = toml::from_str(text).map_err(|error| {
            let message = error.message().replace('\n', " ");
            let key = || error.span().map(|span| written::key_at(text, span.start));
            let problem = match key().filter(|_| message.starts_with("must be")) {
                Some(key) => format!("{key} {message}"),
                None => message,
            };
            let problem = Problem::Toml(problem);
            at(error.span().unwrap_or_default(), problem)
        })?;
        Self::check(script).map_err(|(span, problem)| at(span, problem))
    }

    /// Returns the length, in s.
    pub const fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Returns the stiffness of the wall, in N/m, if it replaces the configured one.
    pub const fn wall_stiffness(&self) -> Option<f64> {
        self.wall_stiffness
    }

    /// Returns whether to play the scenario twice: without and with the passivity layer.
    pub const fn compares_passivity(&self) -> bool {
        self.compares_passivity
    }

    /// Returns the settings of the operator model.
    pub const fn operator_settings(&self) -> OperatorSettings {
        self.hand
    }

    /// Returns the quirks by joint.
    pub const fn quirks(&self) -> &QuirkAssignment {
        &self.quirks
    }

    /// Returns the quirks by joint, to change them.
    pub const fn quirks_mut(&mut self) -> &mut QuirkAssignment {
        &mut self.quirks
    }

    /// Returns the console requests with their times in s, in order.
    pub fn requests(&self) -> impl Iterator<Item = (f64, ConsoleRequest)> + '_ {
        self.actions.requests()
    }

    /// Returns the operator's state at `t` s.
    pub fn operator(&self, t: f64) -> Operator {
        self.actions.at(t)
    }

    /// Returns the faults, in order of their begin.
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    fn check(script: Script) -> Result<Self, Misplaced> {
        let seconds = *script.seconds.get_ref();
        within("seconds", seconds, MIN_DURATION, MAX_LENGTH)
            .map_err(|problem| (script.seconds.span(), problem))?;
        let wall_stiffness = script.environment.as_ref().map(wall_stiffness).transpose()?;
        let Script {
            compares_passivity,
            hand,
            quirks,
            moves,
            switches,
            console,
            holds,
            faults,
            ..
        } = script;
        let actions = Actions::new(moves, switches, console, holds, seconds)?;
        let faults = entry::read_all(faults, seconds)?;
        Ok(Self { seconds, wall_stiffness, compares_passivity, hand, quirks, actions, faults })
    }
}

fn wall_stiffness(around: &Spanned<Environment>) -> Result<f64, Misplaced> {
    let stiffness = around.get_ref().wall_stiffness_n_per_m;
    within("wall_stiffness_n_per_m", stiffness, MIN_WALL_STIFFNESS, MAX_WALL_STIFFNESS)
        .map_err(|problem| (around.span(), problem))?;
    Ok(stiffness)
}

/// Returns the line in which a span begins, from 1.
fn line(text: &str, span: &Range<usize>) -> usize {
    1 + text.bytes().take(span.start).filter(|byte| *byte == b'\n').count()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SCRIPT: &str = "seconds = 5\n\
        [[move]]\nat_s = 1\nduration_s = 2\nto_m = [0.04, 0, 0]\n\
        [[switch]]\nat_s = 2\ndeadman = true\n\
        [[console]]\nat_s = 0.5\nrequest = \"arm\"\n\
        [[hold]]\nat_s = 4\nholding = false\n";

    #[test]
    fn hand_moves_smoothly_between_positions() {
        let scenario = Scenario::parse(SCRIPT).unwrap();
        let x = |t| scenario.operator(t).translation.x;
        assert!(x(1.0).abs() < 1e-12 && (x(2.0) - 0.02).abs() < 1e-12);
        assert!((x(3.0) - 0.04).abs() < 1e-12 && (x(9.0) - 0.04).abs() < 1e-12);
    }

    #[test]
    fn deadman_channels_are_antivalent() {
        let scenario = Scenario::parse(SCRIPT).unwrap();
        assert_eq!(scenario.operator(1.9).inputs, 0b10);
        assert_eq!(scenario.operator(2.0).inputs, 0b01);
    }

    #[test]
    fn invalid_scenarios_are_refused() {
        for (from, to, reason) in [
            ("duration_s = 2", "duration_s = -2", "line 2: duration_s must be within"),
            ("at_s = 1\n", "at_s = 1e308\n", "line 2: duration_s must be within"),
            ("at_s = 0.5", "at_s = 5.1", "line 9: at_s must be within 0..=5, got 5.1"),
            ("at_s = 2", "at_s = nan", "line 6: at_s must be within 0..=5, got NaN"),
            (
                "to_m = [0.04, 0, 0]",
                "to_m = [nan, 0, 0]",
                "line 2: to_m must be within -2..=2, got NaN",
            ),
            ("to_m = [0.04, 0, 0]", "to_rad = [0, 4, 0]", "line 2: to_rad must be within"),
            (
                "to_m = [0.04, 0, 0]",
                "to_m = [0.04, 0, 0, \"x\"]",
                "line 5: move[0].to_m must be a list of 3, got 4",
            ),
            (
                "to_m = [0.04, 0, 0]",
                "to_rad = [0, 0]",
                "line 5: move[0].to_rad must be a list of 3, got 2",
            ),
            (
                "[[move]]",
                "[hand]\ntremor_hz = [8, 9, 10]\n[[move]]",
                "line 3: hand.tremor_hz must be a list of 2, got 3",
            ),
            ("seconds = 5", "seconds = inf", "line 1: seconds must be within"),
            ("deadman = true", "dead_man = true", "line 8: unknown field `dead_man`"),
            ("\"arm\"", "\"fire\"", "line 11: unknown variant `fire`"),
            ("[[hold]]", "[[switch]]\nat_s = 1.5\n[[hold]]", "line 12: at_s must be at least 2"),
            ("seconds = 5", "seconds", "line 1: "),
            ("[[move]]", "[hand]\ntremor_mm = -1\n[[move]]", "line 2: tremor_mm must be within"),
            ("[[move]]", "[hand]\ntremble = 1\n[[move]]", "line 3: unknown field `tremble`"),
        ] {
            let error = Scenario::parse(&SCRIPT.replace(from, to)).unwrap_err().to_string();
            assert!(error.starts_with(reason), "{error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_parsed_or_refused(text in any::<String>(), cut in 0..200_usize) {
            drop(Scenario::parse(&text));
            let script: String = SCRIPT.chars().take(cut).chain(text.chars()).collect();
            drop(Scenario::parse(&script));
        }
    }

    #[test]
    fn shipped_scenarios_are_valid() {
        for text in [
            include_str!("../../../config/scenarios/teleoperation.toml"),
            include_str!("../../../config/scenarios/contact_10s.toml"),
            include_str!("../../../config/scenarios/relaxed_10s.toml"),
            include_str!("../../../config/scenarios/free.toml"),
        ] {
            Scenario::parse(text).unwrap();
        }
    }
}
