//! What the operator does and when: a script in TOML, read once, asked at any time.
//!
//! Times are in s after the first SYNC. Hand movements are relative to where the grip was at the start:
//! along the axes of {0} and about those of the grip.

use std::f64::consts::PI;
use std::ops::Range;

use nalgebra::UnitQuaternion;
use nalgebra::Vector3;
use serde::Deserialize;
use thiserror::Error;
use toml::Spanned;

use crate::sim::personality::Cast;

/// Nothing that takes time takes less, in s.
const SHORTEST: f64 = 1e-3;

/// No script is longer, in s.
const LONGEST: f64 = 86_400.0;

/// No hand reaches farther, in m.
const REACH: f64 = 2.0;

/// No wall is softer, in N/m.
const SOFTEST: f64 = 1.0;

/// No wall is stiffer, in N/m.
const STIFFEST: f64 = 1e7;

/// Sums of decimal fractions may differ by less than this, in s.
const ROUNDING: f64 = 1e-9;

/// Why a script is none, and where.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("line {line}: {problem}")]
pub struct ScenarioError {
    /// From 1.
    pub line: usize,
    /// What is wrong there.
    pub problem: Problem,
}

/// What an operator cannot follow.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Problem {
    /// Not TOML, or not with these keys.
    #[error("{0}")]
    Toml(String),
    /// A number beyond its bounds, or none.
    #[error("{quantity} = {value} is not within {low} and {high}")]
    Number {
        /// Its key.
        quantity: &'static str,
        /// What stands there.
        value: f64,
        /// The least it may be.
        low: f64,
        /// The most it may be.
        high: f64,
    },
    /// The entries of a list must follow each other in time.
    #[error("begins at {at_s} s, when the one before it lasts until {free_s} s")]
    Order {
        /// When it begins.
        at_s: f64,
        /// When it could.
        free_s: f64,
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
    seconds: Spanned<f64>,
    /// What is otherwise than configured around the object.
    environment: Option<Spanned<Environment>>,
    /// Whether it is played twice: without and with the passivity layer.
    #[serde(default)]
    compares_passivity: bool,
    #[serde(default, rename = "move")]
    moves: Vec<Spanned<Move>>,
    #[serde(default, rename = "switch")]
    switches: Vec<Spanned<Switch>>,
    #[serde(default)]
    console: Vec<Spanned<Console>>,
    #[serde(default, rename = "hold")]
    holds: Vec<Spanned<Hold>>,
    /// Which drives are dangerous.
    #[serde(default, rename = "drive")]
    cast: Cast,
}

/// What the object meets.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Environment {
    wall_stiffness_n_per_m: f64,
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
        let at = |span: Range<usize>, problem| ScenarioError { line: line(text, &span), problem };
        let scenario: Self = toml::from_str(text).map_err(|error| {
            let problem = Problem::Toml(error.message().replace('\n', " "));
            at(error.span().unwrap_or_default(), problem)
        })?;
        scenario.check().map_err(|(span, problem)| at(span, problem))?;
        Ok(scenario)
    }

    /// How long it is, in s.
    pub fn seconds(&self) -> f64 {
        *self.seconds.get_ref()
    }

    /// How stiff the wall is, in N/m, if it is otherwise than configured.
    pub fn wall_stiffness(&self) -> Option<f64> {
        self.environment.as_ref().map(|around| around.get_ref().wall_stiffness_n_per_m)
    }

    /// Whether it is to be played twice: without and with the passivity layer.
    pub const fn compares_passivity(&self) -> bool {
        self.compares_passivity
    }

    /// Which drive has which personality.
    pub const fn cast(&self) -> &Cast {
        &self.cast
    }

    /// The same, to give a drive another one.
    pub const fn cast_mut(&mut self) -> &mut Cast {
        &mut self.cast
    }

    /// What is asked of the console, and when, in s, in order.
    pub fn requests(&self) -> impl Iterator<Item = (f64, ConsoleRequest)> + '_ {
        self.console.iter().map(Spanned::get_ref).map(|console| (console.at_s, console.request))
    }

    /// What the operator does at `t` s.
    pub fn operator(&self, t: f64) -> Operator {
        let (mut place, mut turn) = (Vector3::zeros(), Vector3::zeros());
        for step in self.moves.iter().map(Spanned::get_ref).take_while(|step| step.at_s <= t) {
            let share = smooth((t - step.at_s) / step.duration_s);
            place = place.lerp(&step.to_m.map_or(place, Vector3::from), share);
            turn = turn.lerp(&step.to_rad.map_or(turn, Vector3::from), share);
        }
        let (mut deadman, mut reference, mut reflection) = (false, false, false);
        let switches = self.switches.iter().map(Spanned::get_ref);
        for switch in switches.take_while(|switch| switch.at_s <= t) {
            deadman = switch.deadman.unwrap_or(deadman);
            reference = switch.reference.unwrap_or(reference);
            reflection = switch.reflection.unwrap_or(reflection);
        }
        let holds = self.holds.iter().map(Spanned::get_ref).take_while(|hold| hold.at_s <= t);
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

    fn check(&self) -> Result<(), (Range<usize>, Problem)> {
        let seconds = self.seconds();
        within("seconds", seconds, SHORTEST, LONGEST)
            .map_err(|problem| (self.seconds.span(), problem))?;
        if let Some(around) = &self.environment {
            let stiffness = around.get_ref().wall_stiffness_n_per_m;
            within("wall_stiffness_n_per_m", stiffness, SOFTEST, STIFFEST)
                .map_err(|problem| (around.span(), problem))?;
        }
        in_order(&self.moves, seconds, |step| {
            let Move { at_s, duration_s, to_m, to_rad } = *step;
            within("duration_s", duration_s, SHORTEST, seconds - at_s)?;
            to_m.iter().flatten().try_for_each(|to| within("to_m", *to, -REACH, REACH))?;
            to_rad.iter().flatten().try_for_each(|to| within("to_rad", *to, -PI, PI))?;
            Ok((at_s, at_s + duration_s))
        })?;
        in_order(&self.switches, seconds, |switch| Ok((switch.at_s, switch.at_s)))?;
        in_order(&self.console, seconds, |console| Ok((console.at_s, console.at_s)))?;
        in_order(&self.holds, seconds, |hold| Ok((hold.at_s, hold.at_s)))
    }
}

/// Entries lie within the script, and none begins before the one before it has ended. `span` tells when
/// one begins and ends.
fn in_order<T>(
    entries: &[Spanned<T>],
    seconds: f64,
    span: impl Fn(&T) -> Result<(f64, f64), Problem>,
) -> Result<(), (Range<usize>, Problem)> {
    let mut free_s = 0.0;
    for entry in entries {
        let follows = |(at_s, end)| {
            within("at_s", at_s, 0.0, seconds)?;
            let is_after = at_s >= free_s - ROUNDING;
            if is_after { Ok(end) } else { Err(Problem::Order { at_s, free_s }) }
        };
        free_s =
            span(entry.get_ref()).and_then(follows).map_err(|problem| (entry.span(), problem))?;
    }
    Ok(())
}

/// Numbers out of bounds, and those that are none, are a problem.
fn within(quantity: &'static str, value: f64, low: f64, high: f64) -> Result<(), Problem> {
    let is_within = (low..=high + ROUNDING).contains(&value);
    if is_within { Ok(()) } else { Err(Problem::Number { quantity, value, low, high }) }
}

/// The line a span begins in, from 1.
fn line(text: &str, span: &Range<usize>) -> usize {
    1 + text.bytes().take(span.start).filter(|byte| *byte == b'\n').count()
}

/// From 0 to 1 with the least jerk (Flash and Hogan 1985), and constant outside.
fn smooth(share: f64) -> f64 {
    let s = share.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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
            ("duration_s = 2", "duration_s = -2", "line 2: duration_s = -2 is not within"),
            ("at_s = 1\n", "at_s = 1e308\n", "line 2: duration_s = 2 is not within"),
            ("at_s = 0.5", "at_s = 5.1", "line 9: at_s = 5.1 is not within 0 and 5"),
            ("at_s = 2", "at_s = nan", "line 6: at_s = NaN is not within 0 and 5"),
            ("to_m = [0.04, 0, 0]", "to_m = [nan, 0, 0]", "line 2: to_m = NaN"),
            ("to_m = [0.04, 0, 0]", "to_rad = [0, 4, 0]", "line 2: to_rad = 4"),
            ("seconds = 5", "seconds = inf", "line 1: seconds = inf"),
            ("deadman = true", "dead_man = true", "line 8: unknown field `dead_man`"),
            ("\"arm\"", "\"fire\"", "line 11: unknown variant `fire`"),
            ("[[hold]]", "[[switch]]\nat_s = 1.5\n[[hold]]", "line 12: begins at 1.5 s"),
            ("seconds = 5", "seconds", "line 1: "),
        ] {
            let error = Scenario::parse(&SCRIPT.replace(from, to)).unwrap_err().to_string();
            assert!(error.starts_with(reason), "{error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }

    proptest! {
        #[test]
        fn no_text_is_too_strange_to_be_refused_quietly(text in any::<String>(), cut in 0..200_usize) {
            drop(Scenario::parse(&text));
            let script: String = SCRIPT.chars().take(cut).chain(text.chars()).collect();
            drop(Scenario::parse(&script));
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
