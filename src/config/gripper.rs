//! `[switches.gripper]`: the operator's input for a gripper, one analogue or two digital inputs of the switch box.
//! `[remote.gripper]`: the gripper of the virtual object and of the simulated robot.

use crate::problem::Problems;
use crate::raw;
use crate::raw_gripper::{RemoteGripper, SwitchesGripper};
use crate::section::Sections;
use crate::value::{HasPlace, Optional};
use remote::gripper::{GrippedObject, GripperSettings};

/// Bounds of an opening, in m.
const OPENING: std::ops::RangeInclusive<f64> = 1e-4..=1.0;

/// Bounds of the speed of opening and closing, in m/s.
const SPEED: std::ops::RangeInclusive<f64> = 1e-4..=10.0;

/// Bounds of the maximum force, in N.
const FORCE: std::ops::RangeInclusive<f64> = 0.1..=1e3;

/// Bounds of the stiffness of an object, in N/m.
const STIFFNESS: std::ops::RangeInclusive<f64> = 1.0..=1e7;

/// Bits of the buttons: those below belong to deadman, reference and reflection.
const BITS: std::ops::RangeInclusive<u8> = 4..=7;

/// Input of the operator for a gripper, with stroke, force and speed of its commands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GripperInput {
    /// Terminals of the switch box.
    pub terminals: GripperTerminals,
    /// Opening commanded at fully open, in m; fully closed is zero.
    pub stroke: f64,
    /// Maximum force commanded, in N.
    pub max_force: f64,
    /// Maximum speed of the commanded opening, in m/s.
    pub max_speed: f64,
}

/// Terminals of the switch box for a gripper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GripperTerminals {
    /// Analogue input (6401h).
    Analogue {
        /// Number of the input: sub-index of 6401h, 1 to 254.
        number: u8,
        /// Counts at fully open.
        open: i16,
        /// Counts at fully closed, different from `open`.
        closed: i16,
    },
    /// Two digital inputs (6000h:1), which move the gripper while they are set.
    Digital {
        /// Bit that opens, 4 to 7.
        open: u8,
        /// Bit that closes, 4 to 7, different from `open`.
        close: u8,
    },
}

impl GripperInput {
    /// Returns the number of the analogue input; `None` for digital ones.
    pub const fn analogue_input(&self) -> Option<u8> {
        match self.terminals {
            GripperTerminals::Analogue { number, .. } => Some(number),
            GripperTerminals::Digital { .. } => None,
        }
    }
}

/// Reads the input of a switch box. Returns the outer `None` after a problem, the inner one without the section.
pub(super) fn input(
    switches: &raw::Switches,
    problems: &mut Problems<'_>,
) -> Option<Option<GripperInput>> {
    let Some(raw) = &switches.gripper else { return Some(None) };
    let terminals = terminals(raw, switches, problems);
    let stroke = problems.within(&raw.stroke_m, OPENING);
    let max_force = problems.within(&raw.force_n, FORCE);
    let max_speed = problems.within(&raw.max_speed_m_per_s, SPEED);
    let (terminals, stroke) = (terminals?, stroke?);
    Some(Some(GripperInput { terminals, stroke, max_force: max_force?, max_speed: max_speed? }))
}

fn terminals(
    raw: &SwitchesGripper,
    switches: &raw::Switches,
    problems: &mut Problems<'_>,
) -> Option<GripperTerminals> {
    let counts = [&raw.open_counts, &raw.closed_counts];
    let is_analogue = !raw.input.is_absent() || counts.iter().any(|key| !key.is_absent());
    let bits = [&raw.open_bit, &raw.close_bit];
    let digital = bits.into_iter().find(|key| !key.is_absent());
    match (is_analogue, digital) {
        (true, Some(bit)) => {
            let reason = "contradicts the analogue input: a gripper has one analogue or two digital inputs; \
                          remove one of both";
            problems.add(bit, reason);
            None
        }
        (true, None) => analogue(raw, problems),
        (false, Some(_)) => digital_pair(raw, switches.button.as_ref(), problems),
        (false, None) => {
            let reason =
                "needs input, open_counts and closed_counts, or else open_bit and close_bit";
            problems.add(raw, reason);
            None
        }
    }
}

/// Reads an analogue input. The check of the layout finds out whether the switch box has it.
fn analogue(raw: &SwitchesGripper, problems: &mut Problems<'_>) -> Option<GripperTerminals> {
    let number = needed(&raw.input, problems);
    problems.within(&raw.input, 1..=254);
    let open = needed(&raw.open_counts, problems);
    let closed = needed(&raw.closed_counts, problems);
    let (number, open, closed) = (number?, open?, closed?);
    if open == closed {
        let reason = format_args!("must be another number than open_counts, got {closed} twice");
        problems.add(&raw.closed_counts, reason);
        return None;
    }
    Some(GripperTerminals::Analogue { number, open, closed })
}

/// Reads two digital inputs, which must differ and must not be those of buttons.
fn digital_pair(
    raw: &SwitchesGripper,
    buttons: Option<&Sections<raw::Button>>,
    problems: &mut Problems<'_>,
) -> Option<GripperTerminals> {
    let mut bit = |key: &Optional<u8>| {
        let bit = needed(key, problems)?;
        problems.within(key, BITS);
        let mut taken = buttons.into_iter().flat_map(Sections::all);
        if taken.any(|button| button.bit.get() == Some(bit)) {
            problems.add(key, format_args!("bit {bit} is that of a button"));
        }
        Some(bit)
    };
    let (open, close) = (bit(&raw.open_bit), bit(&raw.close_bit));
    let (open, close) = (open?, close?);
    if open == close {
        problems
            .add(&raw.close_bit, format_args!("must be another bit than open_bit, got {close}"));
        return None;
    }
    Some(GripperTerminals::Digital { open, close })
}

/// Returns the value of a key that other keys of its section require.
fn needed<T: Copy>(key: &Optional<T>, problems: &mut Problems<'_>) -> Option<T> {
    if key.is_absent() {
        problems.add(key, format_args!("missing field `{}`", key.place().name()));
    }
    key.get()
}

/// Reads the simulated gripper. Returns `None` after a problem.
pub(super) fn simulated(
    raw: &RemoteGripper,
    problems: &mut Problems<'_>,
) -> Option<GripperSettings> {
    let stroke = problems.within(&raw.stroke_m, OPENING);
    let max_speed = problems.within(&raw.max_speed_m_per_s, SPEED);
    let is_empty = raw.object_m.is_absent() && raw.stiffness_n_per_m.is_absent();
    let object = if is_empty { Some(None) } else { object(raw, problems).map(Some) };
    let (stroke, max_speed, object) = (stroke?, max_speed?, object?);
    if let Some(GrippedObject { width, .. }) = object
        && width >= stroke
    {
        let reason = format_args!("must be below stroke_m, {stroke}, got {width}");
        problems.add(&raw.object_m, reason);
    }
    Some(GripperSettings { stroke, max_speed, object })
}

fn object(raw: &RemoteGripper, problems: &mut Problems<'_>) -> Option<GrippedObject> {
    needed(&raw.object_m, problems);
    needed(&raw.stiffness_n_per_m, problems);
    let width = problems.within(&raw.object_m, OPENING);
    let stiffness = problems.within(&raw.stiffness_n_per_m, STIFFNESS);
    Some(GrippedObject { width: width?, stiffness: stiffness? })
}
