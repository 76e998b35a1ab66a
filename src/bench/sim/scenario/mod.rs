//! Scenario: the operator's actions and the faults of a run, read from TOML or built from entries.
//!
//! Times are in s after the first SYNC. Hand movements are relative to where the grip was at the start:
//! along the axes of {0} and about those of the grip.
//!
//! | file         | what                                                        |
//! |--------------|-------------------------------------------------------------|
//! | [`operator`] | moves, switches, holds, requests to the console             |
//! | [`environment`] | changes of the wall                                      |
//! | `entry`      | `[[fault]]` entries, read and written                       |
//! | `fault_table` | words, targets and keys of faults                          |

mod entry;
pub mod environment;
mod fault_table;
mod keys;
pub mod operator;
mod problem;

pub use operator::{ConsoleRequest, OperatorState};
pub use problem::{Problem, ScenarioError};

use std::ops::Range;

use serde::{Deserialize, Serialize, Serializer};
use toml::Spanned;

use crate::operator_settings::OperatorSettings;
use crate::quirks::QuirkAssignment;
use crate::scenario::entry::FaultEntry;
use crate::scenario::environment::Environment;
use crate::scenario::keys::Entry as Table;
use crate::scenario::operator::{Actions, Console, Hold, Move, Switch};
use crate::scenario::problem::{LocatedProblem, MIN_DURATION, follows, within};
use faults::{Fault, Target};

/// Maximum length of a scenario, in s.
const MAX_LENGTH: f64 = 86_400.0;

/// Scenario that can be played.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    seconds: f64,
    environment: Environment,
    compares_passivity: bool,
    hand: OperatorSettings,
    quirks: QuirkAssignment,
    actions: Actions,
    faults: Vec<Fault>,
}

/// Action of the operator, or a fault.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// Movement of the hand.
    Move(Move),
    /// Switches pressed or released.
    Switch(Switch),
    /// Request to the console.
    Console(Console),
    /// Release or hold of the grip.
    Hold(Hold),
    /// Fault of a device, a bus, the host or the link.
    Fault(Fault),
}

/// Sections of a file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Script {
    seconds: Spanned<f64>,
    /// Changes of the configured environment.
    environment: Option<Spanned<Environment>>,
    /// Set if the scenario is played twice: without and with the passivity layer.
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
    faults: Vec<Spanned<Table>>,
    /// Quirks of drives.
    #[serde(default, rename = "drive")]
    quirks: QuirkAssignment,
}

impl Scenario {
    /// Reads a scenario.
    ///
    /// # Errors
    /// Returns the first problem, with its line.
    pub fn parse(text: &str) -> Result<Self, ScenarioError> {
        let at = |span: Range<usize>, problem| ScenarioError::at(text, span.start, problem);
        let script: Script = toml::from_str(text).map_err(|error| {
            let problem = Problem::Toml(toml_input::message(text, &error));
            at(error.span().unwrap_or_default(), problem)
        })?;
        Self::check(script).map_err(|(span, problem)| at(span, problem))
    }

    /// Builds a scenario of this duration in s from its entries, each kind in order.
    ///
    /// # Errors
    /// Returns the first entry that is out of order or beyond the end.
    pub fn new(seconds: f64, entries: impl IntoIterator<Item = Entry>) -> Result<Self, Problem> {
        let (mut moves, mut switches, mut console) = (Vec::new(), Vec::new(), Vec::new());
        let (mut holds, mut faults): (_, Vec<Fault>) = (Vec::new(), Vec::new());
        for entry in entries {
            match entry {
                Entry::Move(one) => moves.push(Spanned::new(0..0, one)),
                Entry::Switch(one) => switches.push(Spanned::new(0..0, one)),
                Entry::Console(one) => console.push(Spanned::new(0..0, one)),
                Entry::Hold(one) => holds.push(Spanned::new(0..0, one)),
                Entry::Fault(one) => faults.push(one),
            }
        }
        within("seconds", seconds, MIN_DURATION, MAX_LENGTH)?;
        let actions = Actions::new(moves, switches, console, holds, seconds);
        let actions = actions.map_err(|(_, problem)| problem)?;
        check_times(&faults, seconds)?;
        Ok(Self {
            seconds,
            environment: Environment::default(),
            compares_passivity: false,
            hand: OperatorSettings::default(),
            quirks: QuirkAssignment::default(),
            actions,
            faults,
        })
    }

    /// Sets the operator model.
    #[must_use]
    pub fn with_operator(self, hand: OperatorSettings) -> Self {
        Self { hand, ..self }
    }

    /// Writes the scenario, so that [`parse`](Self::parse) reads the same one.
    pub fn to_toml(&self) -> String {
        // Tables of numbers, words and lists alone: every value has its form in TOML.
        toml::to_string(self).unwrap_or_default()
    }

    /// Returns the duration, in s.
    pub const fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Returns the changes of the configured environment.
    pub const fn environment(&self) -> Environment {
        self.environment
    }

    /// Returns whether it is to be played twice: without and with the passivity layer.
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

    /// Returns the requests to the console with their times in s, in order.
    pub fn requests(&self) -> impl Iterator<Item = (f64, ConsoleRequest)> + '_ {
        self.actions.requests()
    }

    /// Returns the operator at `t` s.
    pub fn operator(&self, t: f64) -> OperatorState {
        self.actions.at(t)
    }

    /// Returns the faults, in order of their start.
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    /// Returns whether it arms the node, or has a fault of the switch box.
    pub fn needs_switch_box(&self) -> bool {
        let arms = self.requests().any(|(_, request)| request == ConsoleRequest::Arm);
        arms || self.faults().iter().any(|fault| fault.target == Target::SwitchBox)
    }

    fn check(script: Script) -> Result<Self, LocatedProblem> {
        let seconds = *script.seconds.get_ref();
        within("seconds", seconds, MIN_DURATION, MAX_LENGTH)
            .map_err(|problem| (script.seconds.span(), problem))?;
        let environment = script.environment.as_ref().map(Environment::check).transpose()?;
        let environment = environment.unwrap_or_default();
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
        Ok(Self { seconds, environment, compares_passivity, hand, quirks, actions, faults })
    }
}

/// Checks that faults lie within the scenario, in order of their start.
fn check_times(faults: &[Fault], seconds: f64) -> Result<(), Problem> {
    let mut started_s = 0.0;
    for fault in faults {
        let at_s = fault.start.as_secs_f64();
        within("at_s", at_s, 0.0, seconds)?;
        follows(at_s, started_s)?;
        started_s = at_s;
        if let Some(duration) = fault.duration {
            within("for_s", duration.as_secs_f64(), 0.0, seconds - at_s)?;
        }
    }
    Ok(())
}

/// Keys of a file, in the order in which people write them.
#[derive(Serialize)]
struct File<'a> {
    seconds: f64,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    compares_passivity: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    environment: Option<Environment>,
    #[serde(skip_serializing_if = "Option::is_none")]
    hand: Option<OperatorSettings>,
    #[serde(skip_serializing_if = "QuirkAssignment::is_empty")]
    drive: &'a QuirkAssignment,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    console: &'a [Console],
    #[serde(rename = "switch", skip_serializing_if = "<[_]>::is_empty")]
    switches: &'a [Switch],
    #[serde(rename = "move", skip_serializing_if = "<[_]>::is_empty")]
    moves: &'a [Move],
    #[serde(rename = "hold", skip_serializing_if = "<[_]>::is_empty")]
    holds: &'a [Hold],
    #[serde(rename = "fault", skip_serializing_if = "Vec::is_empty")]
    faults: Vec<FaultEntry<'a>>,
}

impl Serialize for Scenario {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { seconds, environment, compares_passivity, hand, quirks, actions, faults } = self;
        File {
            seconds: *seconds,
            compares_passivity: *compares_passivity,
            environment: Some(*environment).filter(|changes| !changes.is_as_configured()),
            hand: Some(*hand).filter(|hand| *hand != OperatorSettings::default()),
            drive: quirks,
            console: &actions.console,
            switches: &actions.switches,
            moves: &actions.moves,
            holds: &actions.holds,
            faults: faults.iter().map(FaultEntry).collect(),
        }
        .serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::PathBuf;
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;
    use faults::{DeviceFault, FaultKind, Target};
    use units::numbering::Joint;

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
        let (to_m, deadman, arm) = ("to_m = [0.04, 0, 0]", "deadman = true", "\"arm\"");
        for (from, to, reason) in [
            ("duration_s = 2", "duration_s = -2", "2: move[0].duration_s: must be within"),
            ("at_s = 1\n", "at_s = 1e308\n", "2: move[0].at_s: must be within"),
            ("at_s = 1\n", "at_s = nan\n", "2: move[0].at_s: must be within 0..=5, got NaN"),
            ("at_s = 0.5", "at_s = 5.1", "9: console[0].at_s: must be within 0..=5, got 5.1"),
            ("at_s = 2", "at_s = nan", "6: switch[0].at_s: must be within 0..=5, got NaN"),
            (to_m, "to_m = [nan, 0, 0]", "2: move[0].to_m: must be within -2..=2, got NaN"),
            (to_m, "to_rad = [0, 4, 0]", "2: move[0].to_rad: must be within"),
            (to_m, "to_m = [0.04, 0, 0, \"x\"]", "5: move[0].to_m: must be a list of 3, got 4"),
            (to_m, "to_rad = [0, 0]", "5: move[0].to_rad: must be a list of 3, got 2"),
            (
                "[[move]]",
                "[hand]\ntremor_hz = [8, 9, 10]\n[[move]]",
                "3: hand.tremor_hz: must be a list of 2, got 3",
            ),
            ("seconds = 5", "seconds = inf", "1: seconds: must be within"),
            (deadman, "dead_man = true", "8: unknown field `dead_man`"),
            (arm, "\"fire\"", "11: console[0].request: unknown request \"fire\"; expected arm"),
            (
                arm,
                "\"scale motion x\"",
                "11: console[0].request: unknown request \"scale motion x\"",
            ),
            (deadman, "buttons = [true]", "8: switch[0].buttons: must be a list of 4, got 1"),
            (
                "[[hold]]",
                "[[switch]]\nat_s = 1.5\n[[hold]]",
                "12: switch[1].at_s: must be at least 2",
            ),
            ("seconds = 5", "seconds", "1: "),
            ("[[move]]", "[hand]\ntremor_mm = -1\n[[move]]", "2: hand: tremor_mm must be within"),
            ("[[move]]", "[hand]\ntremble = 1\n[[move]]", "3: unknown field `tremble`"),
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
    fn every_shipped_scenario_is_written_and_read_as_the_same() {
        let mut folders = vec![PathBuf::from("../../../config/scenarios")];
        let mut count = 0;
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                    continue;
                }
                let scenario = Scenario::parse(&fs::read_to_string(&path).unwrap()).unwrap();
                let written = scenario.to_toml();
                assert_eq!(Scenario::parse(&written).unwrap(), scenario, "{path:?}:\n{written}");
                count += 1;
            }
        }
        assert!(count > 50, "{count} scenarios");
    }

    #[test]
    fn built_scenario_is_the_one_that_its_text_describes() {
        let at_s = [0.5, 1.0, 2.0, 4.0];
        let fault = Fault::new(
            Duration::from_micros(1_234_567),
            Target::Joint(Joint::of::<3>()),
            FaultKind::Device(DeviceFault::SafeTorqueOff),
        );
        let entries = [
            Entry::Console(Console::new(at_s[0], ConsoleRequest::Arm)),
            Entry::Move(Move::new(at_s[1], 2.0, [0.04, 0.0, 0.0])),
            Entry::Switch(Switch::deadman(at_s[2], true)),
            Entry::Fault(fault),
        ];
        let scenario = Scenario::new(5.0, entries.clone()).unwrap();
        let text = "seconds = 5.0\n\n[[console]]\nat_s = 0.5\nrequest = \"arm\"\n\n\
            [[switch]]\nat_s = 2.0\ndeadman = true\n\n\
            [[move]]\nat_s = 1.0\nduration_s = 2.0\nto_m = [0.04, 0.0, 0.0]\n\n\
            [[fault]]\nat_s = 1.234567\nkind = \"sto\"\njoint = 3\n";
        assert_eq!(scenario.to_toml(), text);
        assert_eq!(Scenario::parse(text).unwrap(), scenario);
        let too_short = Scenario::new(1.2, entries).unwrap_err();
        assert!(too_short.to_string().contains("duration_s: must be within"), "{too_short}");
    }
}
