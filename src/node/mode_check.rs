//! Check of the mode of drives that display it (6061h) only while enabled (`joint.boot.mode_shown`), before the proof test.
//!
//! ```text
//!  boot: 6060h = 10, reduced torque limits ──► each drive alone: enable, read 6061h by SDO, disable ──► planned limits
//!                                                        └ not 10 within 10 ms: disable, bring-up fails
//! ```
//!
//! Targets are zero throughout. A drive in a position or speed mode pushes with at most 5 % of its torque, for 10 ms.

mod run;

use std::time::Duration;

use thiserror::Error;

use canopen::NodeId;
use canopen::master::boot_error::BootError;
use canopen::master::event::Event;
use canopen::master::read_back::ReadBack;
use canopen::object::Object;
use canopen::plan::{NodePlan, ShownMode};
use units::numbering::Joint;

/// Maximum time for which a drive is enabled without displaying its mode.
const LOOK_TIME: Duration = Duration::from_millis(10);

/// Maximum time until all drives are off after the check.
const POWER_OFF_TIMEOUT: Duration = Duration::from_millis(500);

/// Maximum time until all planned limits are written and read back.
const RAISE_TIMEOUT: Duration = Duration::from_secs(5);

/// Error of a drive that did not display its mode when enabled, and was disabled.
///
/// `joint 3 (elbow), node 3: 6061h is 8 when enabled, although 6060h = 10 was read back; the drive is disabled again`
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{name}, node {}: {}; the drive is disabled again", node.raw(), seen(*shown, *commanded))]
pub struct WrongMode {
    /// Joint and drive: `joint 3 (elbow)`.
    pub name: String,
    /// Node-id of the drive.
    pub node: NodeId,
    /// Mode commanded by 6060h.
    pub commanded: i8,
    /// Mode displayed by 6061h; `None` if it could not be read.
    pub shown: Option<i8>,
}

/// Describes the mode that the drive displayed.
fn seen(shown: Option<i8>, commanded: i8) -> String {
    let within = LOOK_TIME.as_millis();
    let unread = || format!("6061h could not be read within {within} ms of enabling");
    let wrong = |shown| {
        format!("6061h is {shown} when enabled, although 6060h = {commanded} was read back")
    };
    shown.map_or_else(unread, wrong)
}

/// Drives that are being enabled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Enabling {
    #[default]
    All,
    Only(Joint),
    None,
}

/// Progress of the check of the mode.
#[derive(Clone, Debug, Default)]
pub(super) struct ModeCheck {
    /// Drives that display their mode only when enabled.
    drives: [Option<WrongMode>; 6],
    enabling: Enabling,
    /// Set while an answer is awaited.
    is_asked: bool,
    /// Mode read last.
    shown: Option<i8>,
    /// Drives whose torque limits are raised.
    raised: [bool; 6],
    refused: Vec<BootError>,
}

impl ModeCheck {
    /// Returns the check of the drives in `plans`, which begin with those of the joints.
    pub(super) fn new<'a>(plans: impl Iterator<Item = &'a NodePlan>) -> Self {
        let mut drives: [Option<WrongMode>; 6] = Default::default();
        for (drive, plan) in drives.iter_mut().zip(plans) {
            let is_hidden = matches!(plan.shown_mode, ShownMode::WhenEnabled { .. });
            *drive = plan.mode.filter(|_| is_hidden).map(|commanded| WrongMode {
                name: plan.name.clone(),
                node: plan.node,
                commanded,
                shown: None,
            });
        }
        Self { drives, ..Self::default() }
    }

    /// Returns whether the drive of this joint must be enabled now.
    pub(super) fn is_enabling(&self, joint: Joint) -> bool {
        match self.enabling {
            Enabling::All => true,
            Enabling::Only(only) => only == joint,
            Enabling::None => false,
        }
    }

    /// Takes an event of the master; returns whether it is an answer to this check alone.
    pub(super) fn on_event(&mut self, event: &Event) -> bool {
        if let Event::ReadBack { object: Object::MODE_DISPLAY, read, .. } = event {
            self.is_asked = false;
            self.shown = match read {
                ReadBack::Value(byte) => u8::try_from(*byte).ok().map(u8::cast_signed),
                ReadBack::Unchanged | ReadBack::Changed { .. } | ReadBack::Unread(_) => None,
            };
            return true;
        }
        if let Event::LimitsRaised { node } = event
            && let Some(joint) = node.joint()
        {
            *joint.entry_mut(&mut self.raised) = true;
        }
        if let Event::BootFailed(error) = event
            && self.enabling == Enabling::None
        {
            self.refused.push(error.clone());
            return true;
        }
        false
    }

    /// Sets the only drive that may be enabled; `None` for none.
    pub(super) fn enable_only(&mut self, joint: Option<Joint>) {
        self.enabling = joint.map_or(Enabling::None, Enabling::Only);
    }

    /// Lets all drives be enabled.
    pub(super) const fn enable_all(&mut self) {
        self.enabling = Enabling::All;
    }

    /// Takes the refusals of stages that ran with no drive enabled.
    pub(super) fn take_refused(&mut self) -> Vec<BootError> {
        std::mem::take(&mut self.refused)
    }

    /// Joints whose drives are checked.
    fn joints(&self) -> Vec<Joint> {
        Joint::each(&self.drives)
            .filter_map(|(joint, drive)| drive.as_ref().map(|_| joint))
            .collect()
    }

    /// Returns the error of a drive that did not display its mode.
    fn wrong(&self, joint: Joint) -> Option<WrongMode> {
        let drive = joint.entry(&self.drives).as_ref()?;
        Some(WrongMode { shown: self.shown, ..drive.clone() })
    }

    /// Returns whether the mode read last is the commanded one.
    fn is_right(&self, joint: Joint) -> bool {
        self.wrong(joint).is_none_or(|drive| drive.shown == Some(drive.commanded))
    }
}
