//! Check of the mode of drives that display it (6061h) only while enabled (`joint.boot.mode_shown`), before the proof test.
//!
//! ```text
//!  boot: 6060h = 10, reduced torque limits ──► each drive alone: enable, read 6061h by SDO, disable ──► planned limits
//!                                                        └ not 10 within 10 ms: disable, bring-up fails
//! ```
//!
//! Targets are zero throughout. A drive that obeys positions or speeds instead pushes with 5 % of its torque, for 10 ms.

use std::fmt;
use std::time::Duration;

use crate::{BringUpError, Node};
use bus::Bus;
use canopen::NodeId;
use canopen::master::boot_error::BootError;
use canopen::master::event::Event;
use canopen::master::read_back::{ReadBack, Setting};
use canopen::object::Object;
use canopen::plan::{NodePlan, ShownMode};
use remote::Remote;
use units::numbering::Joint;

/// Maximum time for which a drive is enabled without displaying its mode.
const LOOK_TIME: Duration = Duration::from_millis(10);

/// Maximum time until all drives are off after the check.
const POWER_OFF_TIMEOUT: Duration = Duration::from_millis(500);

/// Maximum time until all planned limits are written and read back.
const RAISE_TIMEOUT: Duration = Duration::from_secs(5);

/// A drive that did not display its mode when enabled, and was disabled.
#[derive(Clone, Debug, PartialEq, Eq)]
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

/// `joint 3 (elbow), node 3: 6061h is 8 when enabled, although 6060h = 10 was read back; the drive is disabled again`
impl fmt::Display for WrongMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, node, commanded, shown } = self;
        write!(f, "{name}, node {}: ", node.raw())?;
        match shown {
            Some(shown) => write!(
                f,
                "6061h is {shown} when enabled, although 6060h = {commanded} was read back; the drive is disabled again"
            ),
            None => write!(
                f,
                "6061h could not be read within {} ms of enabling; the drive is disabled again",
                LOOK_TIME.as_millis()
            ),
        }
    }
}

impl std::error::Error for WrongMode {}

/// Drives that are being enabled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Enabling {
    #[default]
    All,
    Only(Joint),
    None,
}

/// Check of the mode, and what it awaits.
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

    /// Returns whether the drive of this joint is to be enabled now.
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

impl<B: Bus, R: Remote> Node<B, R> {
    /// Enables each drive that displays its mode only then, alone and under its reduced torque limit, and disables it
    /// again. Then its planned torque limit is written.
    ///
    /// # Errors
    /// When a drive displays another mode or none, refuses its limit, a cause is raised, or `give_up` returns true.
    pub(super) fn check_modes(
        &mut self,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        let joints = self.mode_check.joints();
        self.mode_check.refused.clear();
        let checked = joints.iter().try_for_each(|joint| {
            self.mode_check.enabling = Enabling::Only(*joint);
            self.check_mode(*joint, give_up)
        });
        self.mode_check.enabling = Enabling::None;
        let raised = checked.and_then(|()| self.raise_limits(&joints, give_up));
        self.mode_check.enabling = Enabling::All;
        raised
    }

    /// Enables one drive, and disables it as soon as it has displayed its mode.
    fn check_mode(
        &mut self,
        joint: Joint,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        (self.mode_check.shown, self.mode_check.is_asked) = (None, false);
        let mut sync_at = self.enable(give_up)?;
        // It may have been enabled since the SYNC before.
        let until = sync_at + LOOK_TIME.saturating_sub(self.timing.period);
        loop {
            self.ask_mode(joint);
            let is_last = sync_at + self.timing.period * 2 >= until;
            if is_last {
                self.listen(until);
            } else {
                sync_at = self.cycle().at;
            }
            let is_right = self.mode_check.is_right(joint);
            if is_right || is_last || self.cause().is_some() {
                self.drives.power.keep_off(joint);
                self.network.master.power_off(self.wire.now(), joint.into(), &mut self.wire.out);
                self.send_queued();
            }
            if let Some(cause) = self.cause() {
                return Err(BringUpError::NotEnabled(cause));
            }
            if is_right {
                return Ok(());
            }
            if is_last {
                return Err(self.mode_check.wrong(joint).map_or(BringUpError::GivenUp, Into::into));
            }
        }
    }

    /// Reads 6061h at once, unless an answer is awaited.
    fn ask_mode(&mut self, joint: Joint) {
        if self.mode_check.is_asked {
            return;
        }
        let (now, setting) = (self.wire.now(), Setting::unknown(Object::MODE_DISPLAY, 1));
        let master = &mut self.network.master;
        self.mode_check.is_asked = master.read_back(now, joint.into(), setting, &mut self.wire.out);
        self.send_queued();
        while let Some(telegram) = self.network.master.release() {
            self.send(telegram);
        }
    }

    /// Awaits that all drives are off, then writes the planned torque limits of these joints.
    fn raise_limits(
        &mut self,
        joints: &[Joint],
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        if joints.is_empty() {
            return Ok(());
        }
        let until = self.wire.now() + POWER_OFF_TIMEOUT;
        while !self.is_off() && self.wire.now() < until {
            self.cycle();
        }
        if !self.is_off() {
            return Err(BringUpError::GivenUp);
        }
        self.mode_check.raised = [false; 6];
        let until = self.wire.now() + RAISE_TIMEOUT;
        loop {
            let now = self.wire.now();
            // Refused while its last request is under way.
            for joint in joints.iter().filter(|joint| !*joint.entry(&self.mode_check.raised)) {
                self.network.master.raise_limits(now, (*joint).into(), &mut self.wire.out);
            }
            self.send_queued();
            if give_up() || now >= until {
                return Err(BringUpError::GivenUp);
            }
            self.cycle();
            if let Some(cause) = self.cause() {
                return Err(BringUpError::NotEnabled(cause));
            }
            if !self.mode_check.refused.is_empty() {
                return Err(BringUpError::Boot(std::mem::take(&mut self.mode_check.refused)));
            }
            if joints.iter().all(|joint| *joint.entry(&self.mode_check.raised)) {
                return Ok(());
            }
        }
    }
}
