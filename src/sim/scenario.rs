//! What the operator does and when: a script in TOML, read once, asked at any time.
//!
//! Times are in s after the first SYNC. Hand movements are relative to where the grip was at the start:
//! along the axes of {0} and about those of the grip.

use nalgebra::UnitQuaternion;
use nalgebra::Vector3;
use serde::Deserialize;
use thiserror::Error;

/// Why a script is none.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// No such file at all: the message has line and column.
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    /// A number that is not finite, or a time that is negative.
    #[error("[[{section}]] {number}: {quantity} = {value} is not a time or length")]
    Number {
        /// Which list.
        section: &'static str,
        /// Its entry, from 1.
        number: usize,
        /// Which of its numbers.
        quantity: &'static str,
        /// What stands there.
        value: f64,
    },
    /// The entries of a list must follow each other in time.
    #[error("[[{section}]] {number}: begins at {at_s} s, before the one before it ends")]
    Order {
        /// Which list.
        section: &'static str,
        /// Its entry, from 1.
        number: usize,
        /// When it begins.
        at_s: f64,
    },
}

/// What the operator asks of the node's console.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum ConsoleRequest {
    /// Gravity compensation on.
    #[serde(rename = "arm")]
    Arm,
    /// Torque off.
    #[serde(rename = "disarm")]
    Disarm,
    /// Leave a stop.
    #[serde(rename = "reset")]
    Reset,
    /// Command rates.
    #[serde(rename = "mode rate")]
    Rate,
    /// Command poses.
    #[serde(rename = "mode pose")]
    Pose,
}

/// What the operator does at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Operator {
    /// Where the hand wants the grip, from its start, along {0}, in m.
    pub translation: Vector3<f64>,
    /// How it wants it turned, from its start.
    pub rotation: UnitQuaternion<f64>,
    /// The switch box's inputs: deadman A and B (antivalent), reference, reflection.
    pub inputs: u8,
    /// Whether it holds the grip at all.
    pub is_holding: bool,
}

/// A whole script.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    seconds: f64,
    #[serde(default, rename = "move")]
    moves: Vec<Move>,
    #[serde(default, rename = "switch")]
    switches: Vec<Switch>,
    #[serde(default)]
    console: Vec<Console>,
    #[serde(default, rename = "hold")]
    holds: Vec<Hold>,
}

/// The hand goes somewhere, smoothly; what is not named stays as it is.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Move {
    at_s: f64,
    duration_s: f64,
    to_m: Option<[f64; 3]>,
    to_rad: Option<[f64; 3]>,
}

/// Switches are pressed or released; those not named stay as they are.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Switch {
    at_s: f64,
    deadman: Option<bool>,
    reference: Option<bool>,
    reflection: Option<bool>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Console {
    at_s: f64,
    request: ConsoleRequest,
}

/// The hand lets go, or takes hold again.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Hold {
    at_s: f64,
    holding: bool,
}

impl Scenario {
    /// Reads a script.
    ///
    /// # Errors
    /// The first thing that is wrong with it.
    pub fn parse(text: &str) -> Result<Self, ScenarioError> {
        let scenario: Self = toml::from_str(text)?;
        scenario.check()?;
        Ok(scenario)
    }

    /// How long it is, in s.
    pub const fn seconds(&self) -> f64 {
        self.seconds
    }

    /// What is asked of the console, and when, in s, in order.
    pub fn requests(&self) -> impl Iterator<Item = (f64, ConsoleRequest)> + '_ {
        self.console.iter().map(|console| (console.at_s, console.request))
    }

    /// What the operator does at `t` s.
    pub fn operator(&self, t: f64) -> Operator {
        let (mut place, mut turn) = (Vector3::zeros(), Vector3::zeros());
        for step in self.moves.iter().take_while(|step| step.at_s <= t) {
            let share = smooth((t - step.at_s) / step.duration_s);
            place = place.lerp(&step.to_m.map_or(place, Vector3::from), share);
            turn = turn.lerp(&step.to_rad.map_or(turn, Vector3::from), share);
        }
        let (mut deadman, mut reference, mut reflection) = (false, false, false);
        for switch in self.switches.iter().take_while(|switch| switch.at_s <= t) {
            deadman = switch.deadman.unwrap_or(deadman);
            reference = switch.reference.unwrap_or(reference);
            reflection = switch.reflection.unwrap_or(reflection);
        }
        let holds = self.holds.iter().take_while(|hold| hold.at_s <= t);
        Operator {
            translation: place,
            rotation: UnitQuaternion::from_scaled_axis(turn),
            inputs: u8::from(deadman)
                | u8::from(!deadman) << 1
                | u8::from(reference) << 2
                | u8::from(reflection) << 3,
            is_holding: holds.last().is_none_or(|hold| hold.holding),
        }
    }

    fn check(&self) -> Result<(), ScenarioError> {
        let positive = |section, number, quantity, value: f64| {
            if value.is_finite() && value > 0.0 {
                Ok(())
            } else {
                Err(ScenarioError::Number { section, number, quantity, value })
            }
        };
        positive("scenario", 1, "seconds", self.seconds)?;
        for (number, step) in (1..).zip(&self.moves) {
            positive("move", number, "duration_s", step.duration_s)?;
            let mut to = step.to_m.iter().chain(&step.to_rad).flatten();
            let wrong = to.find(|value| !value.is_finite());
            if let Some(&value) = wrong {
                return Err(ScenarioError::Number {
                    section: "move",
                    number,
                    quantity: "to",
                    value,
                });
            }
        }
        in_order("move", self.moves.iter().map(|step| (step.at_s, step.at_s + step.duration_s)))?;
        in_order("switch", self.switches.iter().map(|switch| (switch.at_s, switch.at_s)))?;
        in_order("console", self.console.iter().map(|console| (console.at_s, console.at_s)))?;
        in_order("hold", self.holds.iter().map(|hold| (hold.at_s, hold.at_s)))
    }
}

/// Sums of decimal fractions may differ by less than this, in s.
const ROUNDING: f64 = 1e-9;

/// Entries begin at zero or later and not before the one before them has ended.
fn in_order(
    section: &'static str,
    spans: impl Iterator<Item = (f64, f64)>,
) -> Result<(), ScenarioError> {
    let mut free = 0.0;
    for (number, (begin, end)) in (1..).zip(spans) {
        if !(begin.is_finite() && begin >= 0.0) {
            let quantity = "at_s";
            return Err(ScenarioError::Number { section, number, quantity, value: begin });
        }
        if begin < free - ROUNDING {
            return Err(ScenarioError::Order { section, number, at_s: begin });
        }
        free = end;
    }
    Ok(())
}

/// From 0 to 1 with the least jerk (Flash and Hogan 1985), and constant outside.
fn smooth(share: f64) -> f64 {
    let s = share.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCRIPT: &str = "seconds = 5\n\
        [[move]]\nat_s = 1\nduration_s = 2\nto_m = [0.04, 0, 0]\n\
        [[switch]]\nat_s = 2\ndeadman = true\n\
        [[console]]\nat_s = 0.5\nrequest = \"arm\"\n\
        [[hold]]\nat_s = 4\nholding = false\n";

    #[test]
    fn the_hand_goes_smoothly_from_where_it_was_to_where_it_is_told() {
        let scenario = Scenario::parse(SCRIPT).unwrap();
        let x = |t| scenario.operator(t).translation.x;
        assert!(x(1.0).abs() < 1e-12 && (x(2.0) - 0.02).abs() < 1e-12);
        assert!((x(3.0) - 0.04).abs() < 1e-12 && (x(9.0) - 0.04).abs() < 1e-12);
    }

    #[test]
    fn the_deadman_has_two_channels_that_never_agree() {
        let scenario = Scenario::parse(SCRIPT).unwrap();
        assert_eq!(scenario.operator(1.9).inputs, 0b10);
        assert_eq!(scenario.operator(2.0).inputs, 0b01);
    }

    #[test]
    fn a_script_that_cannot_be_followed_is_refused() {
        for (from, to, reason) in [
            ("duration_s = 2", "duration_s = -2", "[[move]] 1: duration_s = -2"),
            ("to_m = [0.04, 0, 0]", "to_m = [nan, 0, 0]", "[[move]] 1: to = NaN"),
            ("deadman = true", "dead_man = true", "unknown field `dead_man`"),
            ("\"arm\"", "\"fire\"", "unknown variant `fire`"),
            ("[[hold]]", "[[switch]]\nat_s = 1.5\n[[hold]]", "[[switch]] 2: begins at 1.5 s"),
        ] {
            let error = Scenario::parse(&SCRIPT.replace(from, to)).unwrap_err();
            assert!(error.to_string().contains(reason), "{error}");
        }
    }

    #[test]
    fn every_shipped_script_can_be_followed() {
        for text in [
            include_str!("../../config/scenarios/teleoperation.toml"),
            include_str!("../../config/scenarios/contact_10s.toml"),
            include_str!("../../config/scenarios/free.toml"),
        ] {
            Scenario::parse(text).unwrap();
        }
    }
}
