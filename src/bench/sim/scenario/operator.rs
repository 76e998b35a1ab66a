//! Operator actions: hand motion, switches and console requests.

use std::f64::consts::PI;

use derive_more::Display;
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use crate::scenario::problem::{LocatedProblem, MIN_DURATION, in_order, within};
use toml_input::List;
use units::adjustment::{Adjustment, InvalidAdjustment};

/// Reach of the hand, in m.
const REACH: f64 = 2.0;

/// Request to the node's console.
#[derive(Clone, Copy, Debug, PartialEq, Display, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub enum ConsoleRequest {
    /// Gravity compensation on.
    #[display("arm")]
    Arm,
    /// Torque off.
    #[display("disarm")]
    Disarm,
    /// Resets a stop.
    #[display("reset")]
    Reset,
    /// Sets all zeros by the rest posture.
    #[display("zero")]
    Zero,
    /// Brings the arm to its rest posture.
    #[display("park")]
    Park,
    /// Rate mode.
    #[display("mode rate")]
    Rate,
    /// Pose mode.
    #[display("mode pose")]
    Pose,
    /// Change of scales, locks or alignment.
    #[display("{_0}")]
    Adjust(Adjustment),
}

impl TryFrom<String> for ConsoleRequest {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let known =
            [Self::Arm, Self::Disarm, Self::Reset, Self::Zero, Self::Park, Self::Rate, Self::Pose];
        if let Some(request) = known.into_iter().find(|request| request.to_string() == text) {
            return Ok(request);
        }
        let adjustment = text.parse().map(Self::Adjust);
        adjustment.map_err(|InvalidAdjustment(text)| {
            format!("unknown request {text:?}; expected arm, disarm, reset, zero, park, mode rate, mode pose, or an adjustment as `frhc ctl` takes it")
        })
    }
}

impl From<ConsoleRequest> for String {
    fn from(request: ConsoleRequest) -> Self {
        request.to_string()
    }
}

/// State of the operator at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OperatorState {
    /// Desired translation of the grip from its start, along {0}, in m.
    pub translation: Vector3<f64>,
    /// Desired rotation of the grip from its start.
    pub rotation: UnitQuaternion<f64>,
    /// Switch box's inputs: deadman A and B (antivalent), reference, reflection, buttons.
    pub inputs: u8,
    /// Lever of a gripper at the analogue inputs, in counts.
    pub lever: i16,
    /// Set if the hand holds the grip.
    pub is_holding: bool,
}

impl OperatorState {
    /// Returns the inputs with the hand off the grip: the deadman switch is open.
    pub const fn hand_off(&self) -> u8 {
        self.inputs & !0b11 | 0b10
    }
}

/// All operator actions, each list in order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Actions {
    pub(super) moves: Vec<Move>,
    pub(super) switches: Vec<Switch>,
    pub(super) console: Vec<Console>,
    pub(super) holds: Vec<Hold>,
}

/// Moves the hand smoothly; absent keys leave their part as it is.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Move {
    at_s: f64,
    duration_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    to_m: Option<List<f64, 3>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    to_rad: Option<List<f64, 3>>,
}

/// Operates switches; absent keys leave their switch as it is.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Switch {
    at_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    deadman: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reference: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reflection: Option<bool>,
    /// Buttons at input bits 4 to 7.
    #[serde(skip_serializing_if = "Option::is_none")]
    buttons: Option<List<bool, 4>>,
    /// Lever of a gripper at the analogue inputs, in counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    gripper: Option<i16>,
}

/// Sends a console request.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Console {
    at_s: f64,
    request: ConsoleRequest,
}

/// Releases or holds the grip.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Hold {
    at_s: f64,
    holding: bool,
}

impl Move {
    /// Movement to a displacement along {0}, in m.
    pub const fn new(at_s: f64, duration_s: f64, to_m: [f64; 3]) -> Self {
        Self { at_s, duration_s, to_m: Some(List(to_m)), to_rad: None }
    }

    /// Adds a turn to a rotation vector in {G} at the start, in rad.
    #[must_use]
    pub const fn turning(self, to_rad: [f64; 3]) -> Self {
        Self { to_rad: Some(List(to_rad)), ..self }
    }

    /// Turn to a rotation vector in {G} at the start, in rad.
    pub const fn turn(at_s: f64, duration_s: f64, to_rad: [f64; 3]) -> Self {
        Self { at_s, duration_s, to_m: None, to_rad: Some(List(to_rad)) }
    }
}

impl Switch {
    /// No switch operated.
    const fn none(at_s: f64) -> Self {
        Self {
            at_s,
            deadman: None,
            reference: None,
            reflection: None,
            buttons: None,
            gripper: None,
        }
    }

    /// Deadman pressed or released.
    pub const fn deadman(at_s: f64, is_pressed: bool) -> Self {
        Self { deadman: Some(is_pressed), ..Self::none(at_s) }
    }

    /// Reference button pressed or released.
    pub const fn reference(at_s: f64, is_pressed: bool) -> Self {
        Self { reference: Some(is_pressed), ..Self::none(at_s) }
    }

    /// Reflection button pressed or released.
    pub const fn reflection(at_s: f64, is_pressed: bool) -> Self {
        Self { reflection: Some(is_pressed), ..Self::none(at_s) }
    }
}

impl Hold {
    /// Grip held or released.
    pub const fn new(at_s: f64, holding: bool) -> Self {
        Self { at_s, holding }
    }
}

impl Console {
    /// Request at a time, in s.
    pub const fn new(at_s: f64, request: ConsoleRequest) -> Self {
        Self { at_s, request }
    }
}

impl Actions {
    /// Checks that all actions are possible within `seconds`.
    pub(super) fn new(
        moves: Vec<Spanned<Move>>,
        switches: Vec<Spanned<Switch>>,
        console: Vec<Spanned<Console>>,
        holds: Vec<Spanned<Hold>>,
        seconds: f64,
    ) -> Result<Self, LocatedProblem> {
        let moves = in_order(moves, seconds, |step| {
            let Move { at_s, duration_s, to_m, to_rad } = *step;
            within("at_s", at_s, 0.0, seconds)?;
            within("duration_s", duration_s, MIN_DURATION, seconds - at_s)?;
            to_m.iter()
                .flat_map(|list| &list.0)
                .try_for_each(|to| within("to_m", *to, -REACH, REACH))?;
            to_rad
                .iter()
                .flat_map(|list| &list.0)
                .try_for_each(|to| within("to_rad", *to, -PI, PI))?;
            Ok((at_s, at_s + duration_s))
        })?;
        let switches = in_order(switches, seconds, |switch| Ok((switch.at_s, switch.at_s)))?;
        let console = in_order(console, seconds, |console| Ok((console.at_s, console.at_s)))?;
        let holds = in_order(holds, seconds, |hold| Ok((hold.at_s, hold.at_s)))?;
        Ok(Self { moves, switches, console, holds })
    }

    /// Returns the console requests with their times in s, in order.
    pub(super) fn requests(&self) -> impl Iterator<Item = (f64, ConsoleRequest)> + '_ {
        self.console.iter().map(|console| (console.at_s, console.request))
    }

    /// Returns the operator's state at `t` s.
    pub(super) fn at(&self, t: f64) -> OperatorState {
        let (mut place, mut turn) = (Vector3::zeros(), Vector3::zeros());
        for step in self.moves.iter().take_while(|step| step.at_s <= t) {
            let share = smooth((t - step.at_s) / step.duration_s);
            place = place.lerp(&step.to_m.map_or(place, |to| Vector3::from(to.0)), share);
            turn = turn.lerp(&step.to_rad.map_or(turn, |to| Vector3::from(to.0)), share);
        }
        let (mut deadman, mut reference, mut reflection) = (false, false, false);
        let (mut buttons, mut lever) = ([false; 4], 0);
        for switch in self.switches.iter().take_while(|switch| switch.at_s <= t) {
            deadman = switch.deadman.unwrap_or(deadman);
            reference = switch.reference.unwrap_or(reference);
            reflection = switch.reflection.unwrap_or(reflection);
            buttons = switch.buttons.map_or(buttons, |List(pressed)| pressed);
            lever = switch.gripper.unwrap_or(lever);
        }
        let holds = self.holds.iter().take_while(|hold| hold.at_s <= t);
        OperatorState {
            translation: place,
            rotation: UnitQuaternion::from_scaled_axis(turn),
            inputs: byte([deadman, !deadman, reference, reflection], buttons),
            lever,
            is_holding: holds.last().is_none_or(|hold| hold.holding),
        }
    }
}

/// Returns the byte of these bits, the lowest first.
fn byte(low: [bool; 4], high: [bool; 4]) -> u8 {
    let bits = low.into_iter().chain(high);
    bits.rev().fold(0, |byte, bit| byte << 1 | u8::from(bit))
}

/// Minimum-jerk step from 0 to 1 (Flash and Hogan 1985), constant outside.
fn smooth(share: f64) -> f64 {
    let s = share.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}
