//! The steps that boot one node, as data: CiA 302-2, "Boot NMT slave", in stages.
//!
//! ```text
//!  Finding ──► Looking ─────────► Meeting
//!              power on └► Disabling ──┘
//!
//!  Meeting ──► Resetting ──► Recalling ──► Verifying ──► skipped
//!     │ keep alive  ▲            │ another     │ differs
//!     ▼     differs │            ▼ stamp       ▼
//!  Keeping ─────────┘        Downloading ◄─────┘──► downloaded
//!     └──► kept                  └──► Storing ──► stored
//! ```
//!
//! Takes no steps: that is [`commission`](crate::master::commission).

use std::collections::HashSet;
use std::fmt;

use canopen_rs::NmtCommand;
use canopen_rs::Value;

use crate::drive::Controlword;
use crate::drive::Statusword;
use crate::master::check::Check;
use crate::object::Object;
use crate::plan::NodePlan;
use crate::plan::Revisions;
use crate::plan::Setting;

/// One part of a boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Whether anybody is there, and of which profile.
    Finding,
    /// Whether a drive has its power off, as one that nobody commands has.
    Looking,
    /// It has not: whatever it is doing, that ends, and it comes to rest.
    Disabling,
    /// Who is there.
    Meeting,
    /// Whether it may go on as it is: operational, and set exactly as planned.
    Keeping,
    /// To a known beginning: reset, met again, its power off.
    Resetting,
    /// Whether it holds the stamp of this configuration (1020h).
    Recalling,
    /// Whether it holds what the stamp says: everything is read once, for a wrong layout moves a hand.
    Verifying,
    /// Everything is written and read back.
    Downloading,
    /// It is to keep that: stamp, then "save" (1010h).
    Storing,
}

/// How a node came to its configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Configuration {
    /// Everything was written and read back.
    Downloaded,
    /// The same, and the node has stored it.
    Stored,
    /// The node had it stored: only read.
    Skipped,
    /// The node was found operational with it and was not even reset.
    Kept,
}

/// As in "configuration downloaded".
impl fmt::Display for Configuration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Downloaded => "downloaded",
            Self::Stored => "downloaded and stored",
            Self::Skipped => "already stored, verified",
            Self::Kept => "kept, node not reset",
        })
    }
}

/// Where a stage leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// To another one.
    Stage(Stage),
    /// To a configured node.
    Done(Configuration),
}

impl Stage {
    /// Where it leads once all its steps are done.
    pub const fn next(self, plan: &NodePlan) -> Next {
        match self {
            Self::Finding if plan.is_drive() => Next::Stage(Self::Looking),
            Self::Finding | Self::Looking | Self::Disabling => Next::Stage(Self::Meeting),
            Self::Meeting if plan.keep_alive => Next::Stage(Self::Keeping),
            Self::Meeting => Next::Stage(Self::Resetting),
            Self::Keeping => Next::Done(Configuration::Kept),
            Self::Resetting => Next::Stage(Self::Recalling),
            Self::Recalling => Next::Stage(Self::Verifying),
            Self::Verifying => Next::Done(Configuration::Skipped),
            Self::Downloading if plan.stores_configuration => Next::Stage(Self::Storing),
            Self::Downloading => Next::Done(Configuration::Downloaded),
            Self::Storing => Next::Done(Configuration::Stored),
        }
    }

    /// Where it leads when the node holds something else, or refuses; `None` where that is a failure.
    pub const fn otherwise(self) -> Option<Next> {
        match self {
            Self::Finding
            | Self::Disabling
            | Self::Meeting
            | Self::Resetting
            | Self::Downloading => None,
            Self::Looking => Some(Next::Stage(Self::Disabling)),
            Self::Keeping => Some(Next::Stage(Self::Resetting)),
            Self::Recalling | Self::Verifying => Some(Next::Stage(Self::Downloading)),
            // A node that cannot keep it gets it again the next time.
            Self::Storing => Some(Next::Done(Configuration::Downloaded)),
        }
    }

    /// Everything there is to do in it, in order.
    pub fn steps(self, plan: &NodePlan) -> Vec<Step> {
        match self {
            Self::Finding => vec![Step::Object(Action::Meet, device_type(plan))],
            Self::Looking => vec![Step::Object(Action::Compare, power_is_off())],
            Self::Disabling => disabling(plan),
            Self::Meeting => meeting(plan),
            Self::Keeping => {
                let mode = shown_mode(plan).map(|check| Step::Object(Action::Compare, check));
                std::iter::once(Step::Listen).chain(verifying(plan)).chain(mode).collect()
            }
            Self::Resetting => resetting(plan),
            Self::Recalling => stamp(plan, Action::Compare).to_vec(),
            Self::Verifying => verifying(plan).chain(mode(plan)).collect(),
            Self::Downloading => {
                plan.settings().into_iter().map(download).chain(mode(plan)).collect()
            }
            Self::Storing => {
                let save = Check::exactly(Object::STORE_PARAMETERS, Value::Unsigned32(SAVE));
                let save = Step::Object(Action::Command, save);
                stamp(plan, Action::Write).into_iter().chain([save]).collect()
            }
        }
    }
}

/// One thing to do with a node.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Hear it say that it is operational.
    Listen,
    /// Back to what it has stored, or to its defaults, and wait for its boot-up message.
    Reset(NmtCommand),
    /// Bring an object to what it must hold, or see that it is there.
    Object(Action, Check),
}

/// How an object is brought to what it must hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Read until the node answers, and compare: it may be powering up.
    Meet,
    /// Read and compare.
    Compare,
    /// The same, but what does not exist is off.
    CompareIfThere,
    /// Read until it compares: it may be changing.
    Await,
    /// Read until it changes no more than something at rest does.
    Settle,
    /// Write, read back and compare.
    Write,
    /// The same, but what does not exist is off.
    WriteIfThere,
    /// Write: the node acts on it, and what is read is something else.
    Command,
}

impl Action {
    /// Whether it writes.
    pub const fn writes(self) -> bool {
        match self {
            Self::Write | Self::WriteIfThere | Self::Command => true,
            Self::Meet | Self::Compare | Self::CompareIfThere | Self::Await | Self::Settle => false,
        }
    }

    /// Returns whether another value than expected ends the step.
    pub const fn compares_once(self) -> bool {
        match self {
            Self::Meet
            | Self::Compare
            | Self::CompareIfThere
            | Self::Write
            | Self::WriteIfThere => true,
            Self::Await | Self::Settle | Self::Command => false,
        }
    }

    /// Whether an object that does not exist is as good.
    pub const fn may_be_missing(self) -> bool {
        match self {
            Self::CompareIfThere | Self::WriteIfThere => true,
            Self::Meet
            | Self::Compare
            | Self::Await
            | Self::Settle
            | Self::Write
            | Self::Command => false,
        }
    }
}

/// Off at once, before it is known whose drive it is: nobody commands it any more, and an arm that is
/// driven by nobody is nobody's (CiA 402-2, 6.1). The next stage waits until it stands still.
fn disabling(plan: &NodePlan) -> Vec<Step> {
    let mut steps = power_off().to_vec();
    let position = Check::exactly(Object::POSITION_ACTUAL, Value::Integer32(0));
    steps.extend(plan.rest.map(|_| Step::Object(Action::Settle, position)));
    steps
}

/// Identity, and what more is asked for.
fn meeting(plan: &NodePlan) -> Vec<Step> {
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

/// A node restored to its defaults is reset as a whole, as only then they hold (CiA 301, 7.5.2.14).
fn resetting(plan: &NodePlan) -> Vec<Step> {
    let mut steps = Vec::new();
    let mut command = NmtCommand::ResetCommunication;
    if plan.restores_defaults {
        let load = Check::exactly(Object::RESTORE_DEFAULTS, Value::Unsigned32(LOAD));
        steps.push(Step::Object(Action::Command, load));
        command = NmtCommand::ResetNode;
    }
    steps.extend([Step::Reset(command), Step::Object(Action::Meet, device_type(plan))]);
    if plan.is_drive() {
        steps.extend(power_off());
    }
    steps
}

fn device_type(plan: &NodePlan) -> Check {
    let expected = Value::Unsigned32(u32::from(plan.profile));
    Check { mask: 0xFFFF, ..Check::exactly(Object::DEVICE_TYPE, expected) }
}

/// Takes the power off a drive, before anything is changed in it.
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

fn download(Setting { check, if_there }: Setting) -> Step {
    Step::Object(if if_there { Action::WriteIfThere } else { Action::Write }, check)
}

/// One read of every object that is set, for the last value it is set to.
fn verifying(plan: &NodePlan) -> impl Iterator<Item = Step> + use<> {
    let mut seen = HashSet::new();
    let mut last: Vec<Setting> = plan.settings();
    last.reverse();
    last.retain(|setting| seen.insert(setting.check.object));
    last.into_iter().rev().map(|Setting { check, if_there }| {
        let action = if if_there { Action::CompareIfThere } else { Action::Compare };
        Step::Object(action, check)
    })
}

/// The mode is commanded, and there when the drive shows it.
fn mode(plan: &NodePlan) -> impl Iterator<Item = Step> + use<> {
    let mode = plan.mode.map(Value::Integer8);
    let command = mode.map(|mode| Check::exactly(Object::MODE_OF_OPERATION, mode));
    let command = command.map(|check| Step::Object(Action::Write, check));
    let shown = shown_mode(plan).map(|check| Step::Object(Action::Await, check));
    command.into_iter().chain(shown)
}

fn shown_mode(plan: &NodePlan) -> Option<Check> {
    let mode = plan.mode.map(Value::Integer8)?;
    Some(Check::exactly(Object::MODE_DISPLAY, mode))
}

/// "save", as 1010h takes it.
const SAVE: u32 = u32::from_le_bytes(*b"save");
/// "load", as 1011h takes it.
const LOAD: u32 = u32::from_le_bytes(*b"load");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::plans::IDENTITY;
    use crate::testing::plans::elbow;
    use crate::testing::plans::guarded_elbow;
    use crate::testing::plans::switch_box;
    use crate::testing::scripted::first_boot;

    /// Where each object is written.
    fn writes(steps: &[Step]) -> Vec<(usize, Object)> {
        let written = |step: &Step| match step {
            Step::Object(action, check) if action.writes() => Some(check.object),
            Step::Object(..) | Step::Reset(_) | Step::Listen => None,
        };
        steps.iter().enumerate().filter_map(|(at, step)| Some((at, written(step)?))).collect()
    }

    #[test]
    fn nothing_is_written_before_identity_and_reset() {
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
    fn a_drive_is_off_before_a_pdo_is_touched_and_its_stops_are_set_before_its_mode() {
        let writes = writes(&first_boot(&elbow()));
        let at = |object| writes.iter().find(|(_, written)| *written == object).unwrap().0;
        assert!(at(Object::CONTROLWORD) < at(Object::tpdo_communication(1, 1)));
        assert!(at(Object::rpdo_communication(4, 1)) < at(Object::CONSUMER_HEARTBEAT));
        assert!(at(Object::CONSUMER_HEARTBEAT) < at(Object::MODE_OF_OPERATION));
    }

    #[test]
    fn a_stored_configuration_is_read_once_and_not_written() {
        let plan = elbow();
        let steps = Stage::Verifying.steps(&plan);
        let written = writes(&steps).into_iter().map(|(_, object)| object);
        assert!(written.eq([Object::MODE_OF_OPERATION]), "a mode is a command");
        let mut objects: Vec<_> = plan.writes().into_iter().map(|(object, _)| object).collect();
        objects.sort_unstable();
        objects.dedup();
        assert_eq!(steps.len(), objects.len() + 2, "every object, and the mode");
        let cob_id = Check::cob_id(Object::tpdo_communication(1, 1), Value::Unsigned32(0x183));
        assert!(steps.contains(&Step::Object(Action::Compare, cob_id)), "the last value counts");
    }

    #[test]
    fn a_drive_with_its_power_on_is_taken_off_it_before_anything_else_is_asked_or_told() {
        let plan = NodePlan { rest: Some(200), ..elbow() };
        assert_eq!(Stage::Finding.next(&plan), Next::Stage(Stage::Looking));
        assert_eq!(Stage::Looking.otherwise(), Some(Next::Stage(Stage::Disabling)));
        let steps = Stage::Disabling.steps(&plan);
        assert_eq!(writes(&steps), [(0, Object::CONTROLWORD)]);
        let last = steps.last().unwrap();
        assert!(
            matches!(last, Step::Object(Action::Settle, check) if check.object == Object::POSITION_ACTUAL)
        );
        assert_eq!(Stage::Finding.next(&switch_box()), Next::Stage(Stage::Meeting), "it has none");
    }

    #[test]
    fn the_stamp_stands_before_the_configuration_is_saved() {
        let steps = Stage::Storing.steps(&elbow());
        let objects = writes(&steps).into_iter().map(|(_, object)| object);
        let stored =
            [Object::CONFIGURATION_DATE, Object::CONFIGURATION_TIME, Object::STORE_PARAMETERS];
        assert!(objects.eq(stored));
    }

    #[test]
    fn defaults_are_loaded_before_a_reset_of_the_whole_node() {
        let plan = NodePlan { restores_defaults: true, ..elbow() };
        let steps = Stage::Resetting.steps(&plan);
        assert_eq!(writes(&steps[..1]), [(0, Object::RESTORE_DEFAULTS)]);
        assert_eq!(steps[1], Step::Reset(NmtCommand::ResetNode));
    }

    #[test]
    fn only_what_is_asked_for_is_compared_beyond_the_identity() {
        let count = |plan: &NodePlan| Stage::Meeting.steps(plan).len();
        let mut plan = elbow();
        assert_eq!(count(&plan), 3);
        plan.admission.serial = Some(7);
        plan.admission.program = Some(8);
        assert_eq!(count(&plan), 5);
    }

    #[test]
    fn every_stage_comes_to_an_end() {
        for keep_alive in [false, true] {
            for stores_configuration in [false, true] {
                let plan = NodePlan { keep_alive, stores_configuration, ..elbow() };
                let mut ways = vec![(Stage::Finding, 0)];
                while let Some((stage, length)) = ways.pop() {
                    assert!(length < 10, "it goes round in circles");
                    for next in [Some(stage.next(&plan)), stage.otherwise()].into_iter().flatten() {
                        if let Next::Stage(next) = next {
                            ways.push((next, length + 1));
                        }
                    }
                }
            }
        }
    }
}
