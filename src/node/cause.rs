//! Causes of a stop, with place and figures, and the fault table.
//!
//! Each row of the table declares a cause, its description, its message, and the reaction it leads to.
//! [`table`](crate::safety::table) derives the mode from the reaction.

use std::fmt;

use derive_more::Display;

use crate::joint_reading::JointReading;
use crate::reaction::{FaultTableRow, Initiator, Reaction, always, armed};
use canopen::drive::{State, Statusword};
use canopen::object::Object;
use canopen::{NmtState, error_codes, nmt};
use contract::Reason;
use controller::InvalidValue;
use remote::model::Difference;
use units::numbering::{Joint, NodeIndex};
use units::wording::listed;

/// Generates [`Cause`] and [`CauseKind`] from the table. The first field of a cause is its place: joint, node or bus. A row
/// has a second cause if one fault can occur in two places.
macro_rules! causes {
    ($(
        $kind:ident $({ $at:ident: $place:ident $(, $field:ident: $type:ty)* })?
            description $description:literal,
            message ($($message:tt)+),
            $(or $or:ident { $or_at:ident: $or_place:ident $(, $or_field:ident: $or_type:ty)* }
                description $or_description:literal,
                message ($($or_message:tt)+),)?
            reaction $row:expr;
    )+) => {
        /// A cause of a stop, with its place and figures.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Cause {
            $(
                #[doc = $description]
                $kind $({ $at: $place $(, $field: $type)* })?,
                $(
                    #[doc = $or_description]
                    $or { $or_at: $or_place $(, $or_field: $or_type)* },
                )?
            )+
        }

        /// CauseKind of a cause: a row of the fault table.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum CauseKind {
            $(#[doc = $description] $kind,)+
        }

        impl Cause {
            /// Returns the joint it occurred at, if at one.
            pub fn joint(&self) -> Option<Joint> {
                match *self {
                    $(
                        Self::$kind $({ $at, .. })? => joint!($($at: $place)?),
                        $(Self::$or { $or_at, .. } => joint!($or_at: $or_place),)?
                    )+
                }
            }

            /// Returns its row of the fault table.
            pub const fn kind(&self) -> CauseKind {
                match self {
                    $(Self::$kind { .. } $(| Self::$or { .. })? => CauseKind::$kind,)+
                }
            }
        }

        impl fmt::Display for Cause {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                match *self {
                    $(
                        Self::$kind $({ $at $(, $field)* })? => write!(f, $($message)+),
                        $(Self::$or { $or_at $(, $or_field)* } => write!(f, $($or_message)+),)?
                    )+
                }
            }
        }

        impl Cause {
            /// Returns its text, with the name of its joint from `names`, base first: `joint 3 (elbow): ...`.
            pub fn with_name(&self, names: &[impl AsRef<str>]) -> String {
                with_name(&self.to_string(), names)
            }
        }

        impl CauseKind {
            /// All kinds, in the order of the table.
            pub const ALL: [Self; [$(Self::$kind),+].len()] = [$(Self::$kind),+];

            /// Returns the fault in general, without place and figures.
            pub const fn description(self) -> &'static str {
                match self {
                    $(Self::$kind => $description,)+
                }
            }

            /// Returns its reactions and reset.
            pub const fn row(self) -> FaultTableRow {
                use Initiator::{Drive, Node, Timers};
                use Reaction::{DrivesOff, ReflectionOff, ZeroTorque};
                match self {
                    $(Self::$kind => $row,)+
                }
            }
        }
    };
}

impl CauseKind {
    /// Returns whether it is about commands or the commanded side, which do not matter while nothing is commanded or felt.
    pub(crate) const fn is_of_commanded_side(self) -> bool {
        matches!(
            self,
            Self::LinkLost
                | Self::FarSideHolds
                | Self::LinkSlow
                | Self::ModelDiffers
                | Self::GripperInputInvalid
        )
    }
}

/// Adds the names of the joints with which the text of a cause begins, and each part of it behind a semicolon; `names` are
/// base first.
pub fn with_name(text: &str, names: &[impl AsRef<str>]) -> String {
    let parts = text.split("; ").map(|part| part_with_names(part, names));
    parts.collect::<Vec<_>>().join("; ")
}

/// Returns `joint 3 (elbow): …` of `joint 3: …`, and the same of several; any other text as it is.
fn part_with_names(part: &str, names: &[impl AsRef<str>]) -> String {
    let named = || {
        let (noun, rest) =
            part.split_once(' ').filter(|(noun, _)| matches!(*noun, "joint" | "joints"))?;
        let (numbers, reason) = rest.split_once(':')?;
        let numbers = numbers.split(", ").flat_map(|some| some.split(" and "));
        let joint = |number: &str| {
            let joint = number.parse::<u8>().ok().and_then(Joint::new)?;
            Some(format!("{joint} ({})", names.get(joint.index())?.as_ref()))
        };
        let joints = numbers.map(joint).collect::<Option<Vec<_>>>()?;
        Some(format!("{noun} {}:{reason}", listed(&joints)))
    };
    named().unwrap_or_else(|| part.to_owned())
}

/// The joint that the first field of a cause names, if any.
macro_rules! joint {
    () => {
        None
    };
    ($joint:ident: Joint) => {
        Some($joint)
    };
    ($node:ident: NodeIndex) => {
        $node.joint()
    };
    ($other:ident: $place:ident) => {{
        _ = $other;
        None
    }};
}

causes! {
    SamplesMissing { joint: Joint, cycles: u32 }
        description "position samples of a drive missing for several cycles in a row",
        message ("joint {joint}: no sample for {cycles} cycles"),
        or BusSilent { channel: u8, cycles: u32 }
            description "position samples of all drives of a bus missing for several cycles in a row",
            message ("bus {channel}: no sample of any drive for {cycles} cycles"),
        reaction always(ZeroTorque, Node, true, &[1, 3, 4]);
    StatusMissing { joint: Joint }
        description "statusword of a drive missing, although its position samples arrive",
        message ("joint {joint}: statusword missing"),
        reaction always(ZeroTorque, Node, true, &[3]);
    SamplesRare { joint: Joint, percent: u32 }
        description "too many samples of a joint late or implausible within a second",
        message ("joint {joint}: {percent} % of its samples missing within a second"),
        reaction armed(ReflectionOff, &[3]);
    SamplesOverdue { joint: Joint, cycles: u32 }
        description "more samples of a joint late or lost than allowed",
        message ("joint {joint}: {cycles} samples late or lost; the newest may be {cycles} cycles old"),
        reaction always(ZeroTorque, Node, true, &[3, 4]);
    PositionFrozen { joint: Joint }
        description "position constant although the joint is under torque",
        message (
            "joint {joint}: position frozen under torque: check its encoder, and zero_counts: with a wrong zero a joint may \
             stand at its mechanical stop"
        ),
        reaction always(ZeroTorque, Node, false, &[5]);
    PositionJumped { joint: Joint }
        description "position steps farther than the joint can move, twice",
        message ("joint {joint}: position jumped"),
        reaction always(ZeroTorque, Node, false, &[12]);
    TorqueDiffers { joint: Joint }
        description "actual torque (6077h) of a drive differs from its target torque (6071h)",
        message ("joint {joint}: actual torque differs from the target torque"),
        reaction always(ZeroTorque, Node, false, &[10]);
    TargetNotTaken { joint: Joint }
        description "drive holds another torque than its targets: its RPDOs no longer arrive",
        message ("joint {joint}: drive no longer takes its target torque"),
        reaction always(ZeroTorque, Node, true, &[13]);
    Overspeed { joint: Joint }
        description "joint speed above its limit",
        message ("joint {joint}: speed above its limit"),
        reaction armed(ZeroTorque, &[11]);
    GripOverspeed
        description "grip speed above its limit",
        message ("grip speed above its limit"),
        reaction armed(ZeroTorque, &[11]);
    BeyondLimit { joint: Joint, position: JointReading, limit: JointReading }
        description "joint position beyond its limit",
        message (
            "joint {joint}: at {position}, beyond its limit of {limit}: check {} of the joint",
            limit.keys()
        ),
        reaction armed(ReflectionOff, &[43]);
    UncommandedMotion
        description "joint driven by gravity or friction compensation",
        message ("uncommanded motion: gravity or friction compensation drives a joint"),
        reaction armed(ZeroTorque, &[41]);
    Unstable
        description "oscillation of the grip that does not decay, or excess power into the hand",
        message ("unstable: the grip oscillates or receives excess power"),
        reaction armed(ReflectionOff, &[45]);
    LinkLost
        description "newest wrench from the commanded side too old",
        message ("no new wrench from the commanded side"),
        reaction armed(ReflectionOff, &[34, 35]);
    FarSideHolds { reason: Reason }
        description "robot at the commanded side holds for a reason of its own",
        message ("the far side holds: {reason}"),
        reaction armed(ReflectionOff, &[47]);
    LinkSlow { p99_us: u32, stated_us: u32 }
        description "round trips to the commanded side longer than stated",
        message (
            "1 % of the round trips to the far side take {:.1} ms or more, remote.link.round_trip_ms is {:.1}",
            f64::from(p99_us) / 1e3, f64::from(stated_us) / 1e3
        ),
        reaction armed(ReflectionOff, &[48]);
    ModelDiffers { micrometres: u32, millidegrees: u32 }
        description "robot at the commanded side farther from its predicted pose than allowed",
        message (
            "the robot does not follow: {:.1} mm and {:.1}° from where its commands lead; see remote.link.model_limit_m and \
             model_limit_deg",
            f64::from(micrometres) / 1e3, f64::from(millidegrees) / 1e3
        ),
        reaction armed(ReflectionOff, &[49]);
    DriveLeft { joint: Joint, statusword: u16 }
        description "drive leaves operation enabled by itself",
        message ("joint {joint}: drive left operation enabled (6041h = {statusword:04X}h)"),
        reaction always(ZeroTorque, Drive, false, &[8]);
    Emergency { node: NodeIndex, code: u16 }
        description "emergency message (EMCY) of a node",
        message ("{}: emergency {code:04X}h {}", NodeName(node), error_codes::description(code)),
        reaction always(ZeroTorque, Drive, false, &[7, 13]);
    HeartbeatLost { node: NodeIndex }
        description "heartbeat of a node lost",
        message ("{}: heartbeat lost", NodeName(node)),
        reaction always(DrivesOff, Node, true, &[2]);
    Rebooted { node: NodeIndex }
        description "boot-up message of a running node",
        message ("{}: rebooted", NodeName(node)),
        reaction always(DrivesOff, Drive, true, &[9]);
    LeftOperational { node: NodeIndex, state: NmtState }
        description "NMT state of a running node no longer operational",
        message ("{}: left operational, is {}", NodeName(node), nmt::description(state)),
        reaction always(ZeroTorque, Node, true, &[8]);
    Duplicate { node: NodeIndex }
        description "two nodes apparently with one node-id",
        message ("{}: node-id apparently used by two nodes", NodeName(node)),
        reaction always(ZeroTorque, Node, true, &[6]);
    ForeignMaster
        description "commands of another master on the bus",
        message ("another master is on the bus"),
        reaction always(DrivesOff, Node, true, &[26]);
    SettingChanged { node: NodeIndex, object: Object, expected: u32, found: u32 }
        description "object with another value than verified at boot",
        message ("{}: {object} is {found:X}h, was {expected:X}h at boot", NodeName(node)),
        reaction always(DrivesOff, Node, true, &[26]);
    ControllerFault { invalid: InvalidValue }
        description "input or result of the controller invalid",
        message ("controller: {invalid}"),
        reaction always(ZeroTorque, Node, false, &[42, 44]);
    QueueFull { channel: u8 }
        description "transmit queue full: a frame cannot be sent",
        message ("bus {channel}: transmit queue full"),
        reaction always(ZeroTorque, Timers, true, &[21]);
    TransmitUnconfirmed { channel: u8 }
        description "frames accepted by the adapter, but not confirmed as transmitted",
        message ("bus {channel}: frames accepted, but transmission not confirmed"),
        reaction always(DrivesOff, Timers, true, &[22]);
    BusPassive { channel: u8 }
        description "CAN controller error passive",
        message ("bus {channel}: error passive"),
        reaction always(ZeroTorque, Node, false, &[23]);
    BusOff { channel: u8 }
        description "CAN controller bus off",
        message ("bus {channel}: bus off"),
        reaction always(DrivesOff, Timers, true, &[23]);
    BusDown { channel: u8 }
        description "CAN interface down",
        message ("bus {channel}: interface down"),
        reaction always(DrivesOff, Timers, true, &[24]);
    DeadmanDisagrees
        description "antivalent channels of the deadman disagree",
        message ("deadman channels disagree"),
        reaction always(ZeroTorque, Node, false, &[39]);
    TieDown
        description "deadman closed for too long without motion of the grip",
        message ("deadman tied down: closed for too long without motion"),
        reaction armed(ReflectionOff, &[39]);
    NotFollowing { joint: Joint, position: JointReading }
        description "joint not where the hold moves it",
        message (
            "joint {joint}: at {position}, away from the path on which the arm moves itself: a hand holds it or pushes it, or its \
             drive turns the other way"
        ),
        reaction armed(ReflectionOff, &[52]);
    Blocked { joint: Joint, position: JointReading }
        description "joint blocked while the hold moves it",
        message (
            "joint {joint}: blocked at {position}: something holds it, it needs more torque than the arm may move itself with, or \
             its encoder has stopped"
        ),
        reaction armed(ReflectionOff, &[52]);
    GripperInputInvalid { counts: i16, closed: i16, open: i16 }
        description "input of the gripper outside its range, or its two inputs contradict each other",
        message (
            "gripper input at {counts} counts, beyond its range from {closed} (closed) to {open} (open): check its wire, and \
             closed_counts and open_counts of switches.gripper"
        ),
        or GripperInputsContradict { open_bit: u8, close_bit: u8 }
            description "inputs that open and close the gripper are both set",
            message ("gripper inputs contradict each other: bits {open_bit} (open) and {close_bit} (close) are both set"),
        reaction armed(ReflectionOff, &[50]);
    Overrun { cycles: u64 }
        description "loop stalled for several cycles",
        message ("loop stalled for {cycles} cycles"),
        reaction always(ZeroTorque, Timers, false, &[28, 29]);
    Late
        description "too many late cycles",
        message ("too many late cycles"),
        reaction always(ZeroTorque, Node, false, &[29]);
    Suspended
        description "host suspended during the run",
        message ("the host was suspended"),
        reaction always(DrivesOff, Timers, true, &[31]);
    EnableTimeout { joint: Joint, statusword: u16 }
        description "drive does not reach operation enabled in time",
        message ("joint {joint}: not enabled in time (6041h = {statusword:04X}h){}", start_up_remedy(statusword)),
        reaction always(ZeroTorque, Node, true, &[16]);
    NotOff { joint: Joint, statusword: u16 }
        description "drive still on although disable voltage was sent to it by RPDO and by SDO",
        message ("joint {joint}: drive still on after disable voltage (6041h = {statusword:04X}h)"),
        reaction always(DrivesOff, Node, true, &[46]);
    ZeroUnknown { joint: Joint }
        description "zero of a joint lost while torque acts",
        message ("joint {joint}: zero lost: the drive no longer knows its position; see frhc ctl status"),
        reaction armed(ZeroTorque, &[51]);
    HomingFailed { joint: Joint }
        description "homing of a drive failed: its mode and torque limit are not the planned ones",
        message ("joint {joint}: homing failed: its mode and torque limit are not the planned ones"),
        reaction always(DrivesOff, Node, true, &[51]);
    LimitReduced { joint: Joint }
        description "torque limit of a drive reduced by a trial: not the planned one",
        message ("joint {joint}: torque limit still reduced after a trial; `frhc ctl reset` boots and writes the planned one"),
        reaction always(DrivesOff, Node, true, &[53]);
    AwaitsReset { reason: ResetReason }
        description "last run without an orderly end, or this run without a latch",
        message ("{reason}; no drive is enabled before a reset"),
        reaction always(DrivesOff, Node, true, &[27]);
}

impl Cause {
    /// Returns the cause of a robot that differs from its model.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::as_conversions,
        reason = "a cast from a float saturates; for people only"
    )]
    pub(crate) fn of_model(Difference { distance, angle }: Difference) -> Self {
        let rounded = |number: f64| number.round() as u32;
        Self::ModelDiffers {
            micrometres: rounded(distance * 1e6),
            millidegrees: rounded(angle.to_degrees() * 1e3),
        }
    }

    /// Returns the joint whose drive does not follow its targets. With zero torque for `is_stopping`, another actual
    /// torque is enough.
    pub(crate) const fn unfollowing(self, is_stopping: bool) -> Option<Joint> {
        if let Self::TargetNotTaken { joint } = self {
            return Some(joint);
        }
        if let Self::TorqueDiffers { joint } = self
            && is_stopping
        {
            return Some(joint);
        }
        None
    }
}

/// Reason why a run starts stopped.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum ResetReason {
    /// The last run crashed, was killed, or ended stopped.
    #[display("the last run did not end in order")]
    UncleanEnd,
    /// The latch that would show a crash of this run cannot be written.
    #[display("the state folder cannot be written")]
    NoLatch,
}

/// Name of a node in messages: `joint 3` or `switch box`.
struct NodeName(NodeIndex);

impl fmt::Display for NodeName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.joint() {
            Some(joint) => write!(f, "joint {joint}"),
            None => f.write_str("switch box"),
        }
    }
}

/// Returns the remedy for a drive that was not enabled because it still starts up.
fn start_up_remedy(statusword: u16) -> &'static str {
    if Statusword(statusword).state() == Some(State::NotReadyToSwitchOn) {
        ": it is still \"not ready to switch on\"; if it starts up for longer, raise boot_ms in its [joint.boot]"
    } else {
        ""
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_name_their_joint_bus_or_switch_box() {
        let (joint, node) = (Joint::of::<3>(), NodeIndex(2));
        let switches = NodeIndex(6);
        for (cause, at, text) in [
            (
                Cause::DriveLeft { joint, statusword: 0x0218 },
                Some(joint),
                "joint 3: drive left operation enabled (6041h = 0218h)",
            ),
            (
                Cause::EnableTimeout { joint, statusword: 0x0600 },
                Some(joint),
                "joint 3: not enabled in time (6041h = 0600h): it is still \"not ready to switch on\"; if it starts up \
                 for longer, raise boot_ms in its [joint.boot]",
            ),
            (
                Cause::EnableTimeout { joint, statusword: 0x0650 },
                Some(joint),
                "joint 3: not enabled in time (6041h = 0650h)",
            ),
            (Cause::Rebooted { node }, Some(joint), "joint 3: rebooted"),
            (Cause::Rebooted { node: switches }, None, "switch box: rebooted"),
            (
                Cause::BusSilent { channel: 1, cycles: 3 },
                None,
                "bus 1: no sample of any drive for 3 cycles",
            ),
            (Cause::Late, None, "too many late cycles"),
        ] {
            assert_eq!((cause.joint(), cause.to_string().as_str()), (at, text));
        }
    }

    #[test]
    fn texts_get_the_names_of_their_joints_once() {
        let names = ["azimuth", "elevation", "elbow", "pitch", "yaw", "roll"];
        for (text, expected) in [
            ("joint 3: rebooted", "joint 3 (elbow): rebooted"),
            ("joint 3 (elbow): rebooted", "joint 3 (elbow): rebooted"),
            (
                "joints 1, 2 and 6: drive did not confirm; joint 4: left; all drives end",
                "joints 1 (azimuth), 2 (elevation) and 6 (roll): drive did not confirm; joint 4 (pitch): left; all drives end",
            ),
            ("joint 7: no such", "joint 7: no such"),
            ("switch box: rebooted", "switch box: rebooted"),
        ] {
            assert_eq!(with_name(text, &names), expected);
        }
    }

    #[test]
    fn cause_of_a_second_place_has_the_kind_of_its_row() {
        let cause = Cause::BusSilent { channel: 0, cycles: 3 };
        assert_eq!(cause.kind(), CauseKind::SamplesMissing);
    }
}
