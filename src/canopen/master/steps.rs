//! Steps that boot one node, as data: CiA 302-2, "Boot NMT slave", in stages.
//!
//! ```text
//!  Probe ──► CheckPowerOff ─────► CheckIdentity
//!              power on └► SwitchOff ──┘
//!
//!  CheckIdentity ──► Reset ──► CheckStoredConfig ──► Verify ──► CommandMode: skipped
//!     │ keep alive     ▲           │ stamp differs    │ differs
//!     ▼        differs │           ▼                  ▼
//!  CheckRunning ───────┘        Download ◄────────────┘──► CommandMode: downloaded
//!     └──► kept                    └──► Store ──► CommandMode: stored
//! ```
//!
//! A drive that refuses the mode before it is operational (08000022h) gets it again after its start. The torque limit of
//! one that shows its mode only when enabled is raised to the planned one by `RaiseLimits`, after the mode was seen.
//! `PrepareHoming` and `LeaveHoming` are around a homing, `LimitTorque` before a trial, both of which an operator requests.
//!
//! [`commission`](crate::master::commission) runs the steps.

use std::collections::HashSet;

use canopen_rs::{NmtCommand, Value};
use derive_more::Display;

use crate::drive::{self, Controlword, Statusword};
use crate::master::check::Check;
use crate::nameplate::Nameplate;
use crate::object::Object;
use crate::plan::{HomingPlan, NodePlan, Revisions, ShownMode};
use crate::setting::{Need, Setting};

/// Stage of a boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Waits for a reply and compares the device profile (1000h).
    Probe,
    /// Checks that a drive is not in an enabled state (6041h bit 2 = 0); high voltage (bit 4) may be on.
    CheckPowerOff,
    /// Switches a drive's power off and waits for standstill.
    SwitchOff,
    /// Compares the identity (1018h) and further admission criteria.
    CheckIdentity,
    /// Checks that the node is operational and configured exactly as planned.
    CheckRunning,
    /// Resets the node, waits for its boot-up, and switches a drive's power off.
    Reset,
    /// Compares the stamp of the stored configuration (1020h).
    CheckStoredConfig,
    /// Reads every object once: a wrong PDO layout would move the hand controller.
    Verify,
    /// Writes every object and reads it back.
    Download,
    /// Writes the stamp, then "save" (1010h).
    Store,
    /// Commands the mode (6060h); the rest of the boot is over. Not stored.
    CommandMode(Configuration),
    /// Writes the planned torque limits, in place of the reduced ones under which the mode was checked.
    RaiseLimits,
    /// Prepares a drive that is off for a homing: reduced torque limits, offset, method, mode.
    PrepareHoming,
    /// Commands the planned mode again after a homing, then writes the planned torque limits.
    LeaveHoming,
    /// Limits the torque of a drive that is off to a share of the planned limits, in ‰.
    LimitTorque(u16),
}

/// Origin of a node's configuration.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Hash)]
pub enum Configuration {
    /// Every object was written and read back.
    #[display("downloaded")]
    Downloaded,
    /// Written, read back and stored by the node.
    #[display("downloaded and stored")]
    Stored,
    /// Already stored by the node: only read.
    #[display("already stored, verified")]
    Skipped,
    /// Found in the node, which was operational: not even reset.
    #[display("kept, node not reset")]
    Kept,
}

/// Successor of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Another stage.
    Stage(Stage),
    /// End of the boot with a configured node.
    Done(Configuration),
}

impl Stage {
    /// Returns the successor after all steps have succeeded.
    pub const fn next(self, plan: &NodePlan) -> Next {
        match self {
            Self::Probe if plan.is_drive() => Next::Stage(Self::CheckPowerOff),
            Self::Probe | Self::CheckPowerOff | Self::SwitchOff => Next::Stage(Self::CheckIdentity),
            Self::CheckIdentity if plan.keep_alive => Next::Stage(Self::CheckRunning),
            Self::CheckIdentity => Next::Stage(Self::Reset),
            Self::CheckRunning => Next::Done(Configuration::Kept),
            Self::Reset => Next::Stage(Self::CheckStoredConfig),
            Self::CheckStoredConfig => Next::Stage(Self::Verify),
            Self::Verify => Next::Stage(Self::CommandMode(Configuration::Skipped)),
            Self::Download if plan.stores_configuration => Next::Stage(Self::Store),
            Self::Download => Next::Stage(Self::CommandMode(Configuration::Downloaded)),
            Self::RaiseLimits | Self::PrepareHoming | Self::LeaveHoming | Self::LimitTorque(_) => {
                Next::Done(Configuration::Downloaded)
            }
            Self::Store => Next::Stage(Self::CommandMode(Configuration::Stored)),
            Self::CommandMode(configuration) => Next::Done(configuration),
        }
    }

    /// Returns the successor after a mismatch or an abort; `None` where that is a failure.
    pub const fn on_mismatch(self) -> Option<Next> {
        match self {
            Self::Probe
            | Self::SwitchOff
            | Self::CheckIdentity
            | Self::Reset
            | Self::Download
            | Self::CommandMode(_)
            | Self::RaiseLimits
            | Self::PrepareHoming
            | Self::LeaveHoming
            | Self::LimitTorque(_) => None,
            Self::CheckPowerOff => Some(Next::Stage(Self::SwitchOff)),
            Self::CheckRunning => Some(Next::Stage(Self::Reset)),
            Self::CheckStoredConfig | Self::Verify => Some(Next::Stage(Self::Download)),
            // A node that cannot store the configuration gets it again at the next boot.
            Self::Store => Some(Next::Stage(Self::CommandMode(Configuration::Downloaded))),
        }
    }

    /// Returns the steps of the stage, in order.
    pub fn steps(self, plan: &NodePlan) -> Vec<Step> {
        match self {
            Self::Probe => vec![Step::Object(Action::Probe, device_type(plan))],
            Self::CheckPowerOff => vec![Step::Object(Action::Compare, power_is_off())],
            Self::SwitchOff => switch_off(plan),
            Self::CheckIdentity => check_identity(plan),
            Self::CheckRunning => {
                let mode = shown_mode(plan).map(|check| Step::Object(Action::Compare, check));
                std::iter::once(Step::AwaitHeartbeat).chain(verify(plan)).chain(mode).collect()
            }
            Self::Reset => reset(plan),
            Self::CheckStoredConfig => stamp(plan, Action::Compare).to_vec(),
            Self::Verify => verify(plan).chain(nameplate(plan)).collect(),
            Self::Download => {
                let written = plan.settings().into_iter().map(download);
                written.chain(nameplate(plan)).collect()
            }
            Self::CommandMode(_) => command_mode(plan),
            Self::RaiseLimits => plan.limits_to_raise().into_iter().map(download).collect(),
            Self::PrepareHoming => {
                plan.homing.as_ref().map(|homing| prepare_homing(plan, homing)).unwrap_or_default()
            }
            Self::LeaveHoming => leave_homing(plan),
            Self::LimitTorque(share) => limit_torque(plan, share),
            Self::Store => {
                let save = Check::exactly(Object::STORE_PARAMETERS, Value::Unsigned32(SAVE));
                let save = Step::Object(Action::Command, save);
                stamp(plan, Action::Write).into_iter().chain([save]).collect()
            }
        }
    }
}

/// Part of a stage: an awaited message, a reset, or access to one object.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Waits for a heartbeat that reports operational.
    AwaitHeartbeat,
    /// Resets the node and waits for its boot-up message.
    Reset(NmtCommand),
    /// Brings an object to its expected value, or checks it.
    Object(Action, Check),
    /// Reads an object of the nameplate; an absent one passes.
    Read(Object),
    /// Compares all that was read with the nameplate of the plan.
    CompareNameplate,
}

/// Access to an object in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Reads until the node replies, then compares: the node may be powering up.
    Probe,
    /// Read and compare.
    Compare,
    /// As `Compare`; an absent object passes.
    CompareIfPresent,
    /// Reads until the value compares: it may be changing.
    Await,
    /// Reads the position until the drive is at standstill.
    AwaitStandstill,
    /// Write, read back and compare.
    Write,
    /// As `Write`; an absent object passes.
    WriteIfPresent,
    /// As `WriteIfPresent`; an object that refuses the value passes, too.
    WriteIfAccepted,
    /// Writes without read-back: the object reads as something else.
    Command,
}

impl Action {
    /// Returns whether the action downloads a value.
    pub const fn writes(self) -> bool {
        match self {
            Self::Write | Self::WriteIfPresent | Self::WriteIfAccepted | Self::Command => true,
            Self::Probe
            | Self::Compare
            | Self::CompareIfPresent
            | Self::Await
            | Self::AwaitStandstill => false,
        }
    }

    /// Returns whether an absent object passes.
    pub const fn is_optional(self) -> bool {
        match self {
            Self::CompareIfPresent | Self::WriteIfPresent | Self::WriteIfAccepted => true,
            Self::Probe
            | Self::Compare
            | Self::Await
            | Self::AwaitStandstill
            | Self::Write
            | Self::Command => false,
        }
    }
}

/// Switches the power off before the identity is known: no master commands the drive (CiA 402-2, 6.1). The
/// next stage waits for standstill.
fn switch_off(plan: &NodePlan) -> Vec<Step> {
    let mut steps = power_off().to_vec();
    let position = Check::exactly(Object::POSITION_ACTUAL, Value::Integer32(0));
    steps.extend(plan.standstill_counts.map(|_| Step::Object(Action::AwaitStandstill, position)));
    steps
}

/// Compares the identity and the further criteria of the plan.
fn check_identity(plan: &NodePlan) -> Vec<Step> {
    let compare = |check| Step::Object(Action::Compare, check);
    let number = |object, value| compare(Check::exactly(object, Value::Unsigned32(value)));
    let revision = plan.identity.revision;
    let revision = match plan.admission.revisions {
        Revisions::Exact => Check::exactly(Object::REVISION, Value::Unsigned32(revision)),
        Revisions::Compatible => Check::revision_from(Object::REVISION, revision),
    };
    let mut steps = vec![
        number(Object::VENDOR_ID, plan.identity.vendor),
        number(Object::PRODUCT_CODE, plan.identity.product),
        compare(revision),
    ];
    let admission = &plan.admission;
    steps.extend(admission.serial.map(|serial| number(Object::SERIAL, serial)));
    steps.extend(admission.software.map(|version| {
        compare(Check::exactly(Object::SOFTWARE_VERSION, Value::VisibleString(version)))
    }));
    steps.extend(admission.program.map(|id| number(Object::PROGRAM_IDENTIFICATION, id)));
    steps
}

/// Resets the node. Restored defaults act only after a reset of the whole node (CiA 301, 7.5.2.14).
fn reset(plan: &NodePlan) -> Vec<Step> {
    let mut steps = Vec::new();
    let mut command = NmtCommand::ResetCommunication;
    if plan.restores_defaults {
        let load = Check::exactly(Object::RESTORE_DEFAULTS, Value::Unsigned32(LOAD));
        steps.push(Step::Object(Action::Command, load));
        command = NmtCommand::ResetNode;
    }
    steps.extend([Step::Reset(command), Step::Object(Action::Probe, device_type(plan))]);
    if plan.is_drive() {
        steps.extend(power_off());
    }
    steps
}

fn device_type(plan: &NodePlan) -> Check {
    let expected = Value::Unsigned32(u32::from(plan.profile));
    Check { mask: 0xFFFF, ..Check::exactly(Object::DEVICE_TYPE, expected) }
}

/// Switches a drive's power off before any object is changed.
fn power_off() -> [Step; 2] {
    let off = Value::Unsigned16(Controlword::DISABLE_VOLTAGE.0);
    [
        Step::Object(Action::Write, Check::exactly(Object::CONTROLWORD, off)),
        Step::Object(Action::Await, power_is_off()),
    ]
}

fn power_is_off() -> Check {
    Check {
        mask: u64::from(Statusword::OPERATION_ENABLED),
        ..Check::exactly(Object::STATUSWORD, Value::Unsigned16(0))
    }
}

fn stamp(plan: &NodePlan, action: Action) -> [Step; 2] {
    let stamp = plan.stamp();
    [(Object::CONFIGURATION_DATE, stamp.date), (Object::CONFIGURATION_TIME, stamp.time)]
        .map(|(object, part)| (object, Value::Unsigned32(part)))
        .map(|(object, part)| Step::Object(action, Check::exactly(object, part)))
}

fn download(Setting { check, need }: Setting) -> Step {
    let action = match need {
        Need::Must => Action::Write,
        Need::IfPresent => Action::WriteIfPresent,
        Need::IfAccepted => Action::WriteIfAccepted,
    };
    Step::Object(action, check)
}

/// Reads every configured object once and compares its last value.
fn verify(plan: &NodePlan) -> impl Iterator<Item = Step> + use<> {
    let mut seen = HashSet::new();
    let mut last: Vec<Setting> = plan.settings();
    last.reverse();
    last.retain(|setting| seen.insert(setting.check.object));
    last.into_iter().rev().map(|Setting { check, need }| {
        let action = if need.is_must() { Action::Compare } else { Action::CompareIfPresent };
        Step::Object(action, check)
    })
}

/// Reads and compares the nameplate, if the plan has one.
fn nameplate(plan: &NodePlan) -> impl Iterator<Item = Step> + use<> {
    let objects = plan.nameplate.as_ref().map(|_| Nameplate::OBJECTS);
    let compare = objects.map(|_| Step::CompareNameplate);
    objects.into_iter().flatten().map(Step::Read).chain(compare)
}

/// Commands the mode (6060h), reads it back, and waits until the drive displays it (6061h). A drive that displays it only
/// when enabled gets a reduced torque limit first.
fn command_mode(plan: &NodePlan) -> Vec<Step> {
    let Some(mode) = plan.mode else { return Vec::new() };
    let mode = Check::exactly(Object::MODE_OF_OPERATION, Value::Integer8(mode));
    let command = Step::Object(Action::Write, mode);
    match &plan.shown_mode {
        ShownMode::Always => {
            let shown = shown_mode(plan).map(|check| Step::Object(Action::Await, check));
            std::iter::once(command).chain(shown).collect()
        }
        ShownMode::WhenEnabled { reduced_limits } => {
            let limits =
                reduced_limits.iter().map(|(object, value)| Check::exactly(*object, *value));
            let limits = limits.map(|check| Step::Object(Action::Write, check));
            limits.chain([command]).collect()
        }
    }
}

/// Writes reduced limits, then home offset, method and mode, to a drive that reports that it is off.
fn prepare_homing(plan: &NodePlan, homing: &HomingPlan) -> Vec<Step> {
    let write = |(object, value)| Step::Object(Action::Write, Check::exactly(object, value));
    let mut steps = vec![Step::Object(Action::Compare, power_is_off())];
    steps.extend(homing.reduced_limits.iter().cloned().map(write));
    steps.extend(homing.offset.map(|at| write((Object::HOME_OFFSET, Value::Integer32(at)))));
    steps.push(write((Object::HOMING_METHOD, Value::Integer8(homing.method))));
    steps.extend(mode_steps(plan, drive::HOMING));
    steps
}

/// Writes a share of the planned limits, in ‰, to a drive that reports that it is off.
fn limit_torque(plan: &NodePlan, share: u16) -> Vec<Step> {
    let write = |(object, value)| Step::Object(Action::Write, Check::exactly(object, value));
    let off = Step::Object(Action::Compare, power_is_off());
    std::iter::once(off).chain(plan.limits_at(share).into_iter().map(write)).collect()
}

/// Commands the planned mode, then writes the planned limits, to a drive that reports that it is off.
fn leave_homing(plan: &NodePlan) -> Vec<Step> {
    let mut steps = vec![Step::Object(Action::Compare, power_is_off())];
    steps.extend(plan.mode.into_iter().flat_map(|mode| mode_steps(plan, mode)));
    steps.extend(plan.limits_after_homing().into_iter().map(download));
    steps
}

/// Writes 6060h, and awaits it in 6061h unless the drive displays it only when enabled.
fn mode_steps(plan: &NodePlan, mode: i8) -> Vec<Step> {
    let write = Check::exactly(Object::MODE_OF_OPERATION, Value::Integer8(mode));
    let mut steps = vec![Step::Object(Action::Write, write)];
    if plan.shown_mode == ShownMode::Always {
        let shown = Check::exactly(Object::MODE_DISPLAY, Value::Integer8(mode));
        steps.push(Step::Object(Action::Await, shown));
    }
    steps
}

fn shown_mode(plan: &NodePlan) -> Option<Check> {
    let mode = plan.mode.map(Value::Integer8)?;
    Some(Check::exactly(Object::MODE_DISPLAY, mode))
}

/// Signature "save" of 1010h.
const SAVE: u32 = u32::from_le_bytes(*b"save");
/// Signature "load" of 1011h.
const LOAD: u32 = u32::from_le_bytes(*b"load");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::plans::{IDENTITY, elbow, guarded_elbow, switch_box};
    use crate::testing::scripted::first_boot;

    /// Index of each write, with its object.
    fn writes(steps: &[Step]) -> Vec<(usize, Object)> {
        let written = |step: &Step| match step {
            Step::Object(action, check) if action.writes() => Some(check.object),
            Step::Object(..)
            | Step::Reset(_)
            | Step::AwaitHeartbeat
            | Step::Read(_)
            | Step::CompareNameplate => None,
        };
        steps.iter().enumerate().filter_map(|(at, step)| Some((at, written(step)?))).collect()
    }

    #[test]
    fn identity_and_reset_come_before_every_write() {
        for plan in [elbow(), switch_box(), guarded_elbow()] {
            let steps = first_boot(&plan);
            let is_reset = |step: &Step| *step == Step::Reset(NmtCommand::ResetCommunication);
            let reset = steps.iter().position(is_reset).unwrap();
            let revision = Value::Unsigned32(IDENTITY.revision);
            let identity =
                Step::Object(Action::Compare, Check::exactly(Object::REVISION, revision));
            assert!(steps[..reset].contains(&identity));
            assert!(writes(&steps).iter().all(|(at, _)| *at > reset));
        }
    }

    #[test]
    fn power_off_precedes_pdos_and_stop_options_precede_the_mode() {
        let writes = writes(&first_boot(&elbow()));
        let at = |object| writes.iter().find(|(_, written)| *written == object).unwrap().0;
        assert!(at(Object::CONTROLWORD) < at(Object::tpdo_communication(1, 1)));
        assert!(at(Object::rpdo_communication(4, 1)) < at(Object::CONSUMER_HEARTBEAT));
        assert!(at(Object::CONSUMER_HEARTBEAT) < at(Object::MODE_OF_OPERATION));
    }

    #[test]
    fn stored_configuration_is_read_once_and_not_written() {
        let plan = elbow();
        let steps = Stage::Verify.steps(&plan);
        assert_eq!(writes(&steps), []);
        let command = Stage::CommandMode(Configuration::Skipped).steps(&plan);
        assert_eq!(writes(&command), [(0, Object::MODE_OF_OPERATION)], "a mode is a command");
        let mut objects: Vec<_> = plan.writes().into_iter().map(|(object, _)| object).collect();
        objects.sort_unstable();
        objects.dedup();
        assert_eq!(steps.len(), objects.len(), "every object");
        let cob_id = Check::cob_id(Object::tpdo_communication(1, 1), Value::Unsigned32(0x183));
        assert!(steps.contains(&Step::Object(Action::Compare, cob_id)), "the last value counts");
    }

    #[test]
    fn enabled_drive_is_switched_off_before_any_other_request() {
        let plan = NodePlan { standstill_counts: Some(200), ..elbow() };
        assert_eq!(Stage::Probe.next(&plan), Next::Stage(Stage::CheckPowerOff));
        assert_eq!(Stage::CheckPowerOff.on_mismatch(), Some(Next::Stage(Stage::SwitchOff)));
        let steps = Stage::SwitchOff.steps(&plan);
        assert_eq!(writes(&steps), [(0, Object::CONTROLWORD)]);
        let last = steps.last().unwrap();
        assert!(
            matches!(last, Step::Object(Action::AwaitStandstill, check) if check.object == Object::POSITION_ACTUAL)
        );
        assert_eq!(Stage::Probe.next(&switch_box()), Next::Stage(Stage::CheckIdentity), "no drive");
    }

    #[test]
    fn stamp_is_written_before_save() {
        let steps = Stage::Store.steps(&elbow());
        let objects = writes(&steps).into_iter().map(|(_, object)| object);
        let stored =
            [Object::CONFIGURATION_DATE, Object::CONFIGURATION_TIME, Object::STORE_PARAMETERS];
        assert!(objects.eq(stored));
    }

    #[test]
    fn defaults_are_loaded_before_the_node_reset() {
        let plan = NodePlan { restores_defaults: true, ..elbow() };
        let steps = Stage::Reset.steps(&plan);
        assert_eq!(writes(&steps[..1]), [(0, Object::RESTORE_DEFAULTS)]);
        assert_eq!(steps[1], Step::Reset(NmtCommand::ResetNode));
    }

    #[test]
    fn only_planned_criteria_are_compared_beyond_the_identity() {
        let count = |plan: &NodePlan| Stage::CheckIdentity.steps(plan).len();
        let mut plan = elbow();
        assert_eq!(count(&plan), 3);
        plan.admission.serial = Some(7);
        plan.admission.program = Some(8);
        assert_eq!(count(&plan), 5);
    }

    #[test]
    fn every_stage_reaches_an_end() {
        for keep_alive in [false, true] {
            for stores_configuration in [false, true] {
                let plan = NodePlan { keep_alive, stores_configuration, ..elbow() };
                let mut ways = vec![(Stage::Probe, 0)];
                while let Some((stage, length)) = ways.pop() {
                    assert!(length < 12, "stages form a cycle");
                    for next in [Some(stage.next(&plan)), stage.on_mismatch()].into_iter().flatten()
                    {
                        if let Next::Stage(next) = next {
                            ways.push((next, length + 1));
                        }
                    }
                }
            }
        }
    }
}
