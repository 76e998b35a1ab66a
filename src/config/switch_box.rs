//! `[switches]`: the switch box (CiA 401) as a node of the network. [`switch_inputs`](crate::switch_inputs) assigns its
//! bits.
//!
//! The section is optional. Without it the network boots and the drives' timers are proven, but arming is refused by
//! [`NoSwitchBox`], because the deadman is absent.

use std::path::Path;
use std::sync::Arc;

use thiserror::Error;

use crate::boot::{self, BootSettings, OtherSections};
use crate::gripper::{self, GripperInput};
use crate::problem::Problems;
use crate::section::Sections;
use crate::{lookup, raw};
use canopen::NodeId;
use canopen::eds::Eds;
use canopen::frame::Channel;
use canopen::plan::Identity;
use controller::adjustment::Bounds;
use units::adjustment::{Adjustment, InvalidAdjustment};

/// Switch box as a node of the network.
#[derive(Clone, Debug)]
pub struct SwitchBox {
    /// Bus of the switch box.
    pub channel: Channel,
    /// Node-id, 1 to 127, unique on its bus.
    pub node: NodeId,
    /// Identity that the switch box must report (1018h).
    pub identity: Identity,
    /// Criteria of admission, time limits and error control, where they differ from the defaults.
    pub boot: BootSettings,
    /// EDS, shared by the nodes that name the same file.
    pub eds: Arc<Eds>,
    /// Set if the deadman is not at the grip, so that it can be held without a hand on the arm.
    pub is_deadman_apart: bool,
    /// Adjustments made by the buttons at input bits 4 to 7.
    pub buttons: [Option<Adjustment>; 4],
    /// Input for a gripper, if configured.
    pub gripper: Option<GripperInput>,
}

/// Error of arming without a switch box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "nothing can be armed: there is no deadman; add [switches], a CiA 401 switch box with a deadman of two contacts"
)]
pub struct NoSwitchBox;

/// Reads the optional section. Returns the outer `None` after a problem, the inner one without the section.
pub(super) fn given(
    file: &Path,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<Option<SwitchBox>> {
    match &raw.switches {
        None => Some(None),
        Some(section) => read(file, section, raw, problems).map(Some),
    }
}

/// Reads the switch box of a section. Returns `None` after a problem.
fn read(
    file: &Path,
    switches: &raw::Switches,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<SwitchBox> {
    let channel = lookup::channel(&switches.bus, raw, problems);
    let node = lookup::node_id(&switches.node_id, problems);
    let eds = lookup::eds(&switches.eds, file, problems);
    let lost_ms = raw.safety.drive_lost_ms.get();
    let given = OtherSections { lost_ms, eds: eds.as_deref(), period: None, limit: None };
    if let Some(boot) = switches.boot.as_ref().filter(|boot| !boot.mode_shown.is_absent()) {
        problems.add(&boot.mode_shown, "only a drive has a mode");
    }
    let boot = boot::of_node(switches.boot.as_ref(), given, problems);
    let places = [("grip", false), ("apart", true)];
    let deadman_at = switches.deadman_at.or("grip".to_owned());
    let is_deadman_apart = problems.one_of(&deadman_at, &places).unwrap_or_default();
    let buttons = buttons(switches.button.as_ref(), problems);
    let gripper = gripper::input(switches, problems);
    let identity = Identity {
        vendor: switches.vendor_id.get()?,
        product: switches.product_code.get()?,
        revision: switches.revision.get()?,
    };
    let (channel, node, eds, gripper) = (channel?, node?, eds?, gripper?);
    Some(SwitchBox { channel, node, identity, boot, eds, is_deadman_apart, buttons, gripper })
}

/// Reads the adjustments of the buttons, in the order of bits 4 to 7.
fn buttons(
    given: Option<&Sections<raw::Button>>,
    problems: &mut Problems<'_>,
) -> [Option<Adjustment>; 4] {
    let mut buttons = [None; 4];
    for button in given.into_iter().flat_map(Sections::all) {
        let bit = problems.within(&button.bit, 4..=7);
        let Some(press) = button.press.as_ref() else { continue };
        let adjustment = match press.parse() {
            Ok(Adjustment::Lock(_, false)) => {
                problems.add(&button.press, "a press locks and releases in turn; write \"on\"");
                continue;
            }
            Ok(adjustment) => adjustment,
            Err(invalid) => {
                let invalid: InvalidAdjustment = invalid;
                problems.add(&button.press, invalid);
                continue;
            }
        };
        let place = bit.and_then(|bit| bit.checked_sub(4));
        let Some(place) = place.and_then(|place| buttons.get_mut(usize::from(place))) else {
            continue;
        };
        if place.replace(adjustment).is_some() {
            problems.add(&button.bit, "another button has this bit");
        }
    }
    buttons
}

/// Checks that the scales that buttons set are within their bounds.
pub(super) fn check(
    switches: Option<&SwitchBox>,
    bounds: &Bounds,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) {
    let Some(place) = raw.switches.as_ref().and_then(|switches| switches.button.as_ref()) else {
        return;
    };
    for adjustment in switches.into_iter().flat_map(|switches| switches.buttons).flatten() {
        if let Adjustment::Scale(quantity, factor) = adjustment
            && let Err(refused) = bounds.check_scale(quantity, factor)
        {
            problems.add(place, refused);
        }
    }
}
