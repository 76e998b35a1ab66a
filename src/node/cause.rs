//! What can be wrong, with where and how much: what stopped the node, or what it was told of.
//!
//! A cause is one row of one table: its declaration, what is wrong in general, what one such cause says, and what
//! it leads to. How a mode follows from that is in [`table`](crate::safety::table).

use std::fmt;

use crate::reaction::Decides;
use crate::reaction::Reaction;
use crate::reaction::Row;
use crate::reaction::always;
use crate::reaction::armed;
use canopen::NmtState;
use canopen::error_codes;
use canopen::nmt;
use canopen::object::Object;
use controller::Fault;
use units::numbering::Joint;
use units::numbering::NodeIndex;

/// Makes [`Cause`] and [`Kind`] of the table. The first field of a cause is where it is. A row has a second cause if
/// one thing can be wrong in two places.
macro_rules! causes {
    ($(
        $kind:ident $({ $at:ident: $place:ident $(, $field:ident: $type:ty)* })?
            is $general:literal,
            says ($($words:tt)+),
            $(or $or:ident { $or_at:ident: $or_place:ident $(, $or_field:ident: $or_type:ty)* }
                is $or_general:literal,
                says ($($or_words:tt)+),)?
            leads to $row:expr;
    )+) => {
        /// What stopped the node.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Cause {
            $(
                #[doc = $general]
                $kind $({ $at: $place $(, $field: $type)* })?,
                $(
                    #[doc = $or_general]
                    $or { $or_at: $or_place $(, $or_field: $or_type)* },
                )?
            )+
        }

        /// What kind of cause it is: a row of the fault table.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Kind {
            $(#[doc = $general] $kind,)+
        }

        impl Cause {
            /// The joint it is about, if it is about one.
            pub fn joint(&self) -> Option<Joint> {
                match *self {
                    $(
                        Self::$kind $({ $at, .. })? => joint!($($at: $place)?),
                        $(Self::$or { $or_at, .. } => joint!($or_at: $or_place),)?
                    )+
                }
            }

            /// Its row of the fault table.
            pub const fn kind(&self) -> Kind {
                match self {
                    $(Self::$kind { .. } $(| Self::$or { .. })? => Kind::$kind,)+
                }
            }
        }

        impl fmt::Display for Cause {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                match *self {
                    $(
                        Self::$kind $({ $at $(, $field)* })? => write!(f, $($words)+),
                        $(Self::$or { $or_at $(, $or_field)* } => write!(f, $($or_words)+),)?
                    )+
                }
            }
        }

        impl Kind {
            /// All of them, in the order of the table.
            pub const ALL: [Self; [$(Self::$kind),+].len()] = [$(Self::$kind),+];

            /// What is wrong.
            pub const fn words(self) -> &'static str {
                match self {
                    $(Self::$kind => $general,)+
                }
            }

            /// What it leads to.
            pub const fn row(self) -> Row {
                use Decides::Drive;
                use Decides::Node;
                use Decides::Timers;
                use Reaction::DrivesOff;
                use Reaction::ReflectionOff;
                use Reaction::ZeroTorque;
                match self {
                    $(Self::$kind => $row,)+
                }
            }
        }
    };
}

/// The joint that the first field of a cause names, if it names one.
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
        is "a drive's samples do not come, several cycles in a row",
        says ("joint {joint}: no sample for {cycles} cycles"),
        or BusSilent { channel: u8, cycles: u32 }
            is "no drive of a bus answers in time, several cycles in a row",
            says ("bus {channel}: no sample of any drive for {cycles} cycles"),
        leads to always(ZeroTorque, Node, true, &[1, 3, 4]);
    StatusMissing { joint: Joint }
        is "a drive does not tell its state, although its positions come",
        says ("joint {joint}: statusword missing"),
        leads to always(ZeroTorque, Node, true, &[3]);
    SamplesRare { joint: Joint, percent: u32 }
        is "too many of a joint's samples within a second are late or impossible",
        says ("joint {joint}: {percent} % of its samples were missing within a second"),
        leads to armed(ReflectionOff, &[3]);
    SamplesOverdue { joint: Joint, cycles: u32 }
        is "more of a joint's samples are late or lost than may be",
        says ("joint {joint}: {cycles} samples late or lost, the others may be as old"),
        leads to always(ZeroTorque, Node, true, &[3, 4]);
    PositionFrozen { joint: Joint }
        is "a position stands still although the joint is pushed",
        says ("joint {joint}: its position stands still under torque"),
        leads to always(ZeroTorque, Node, false, &[5]);
    PositionJumped { joint: Joint }
        is "a position jumps farther than the joint can move, twice",
        says ("joint {joint}: its position jumped"),
        leads to always(ZeroTorque, Node, false, &[12]);
    TorqueDiffers { joint: Joint }
        is "a drive exerts another torque than it is told",
        says ("joint {joint}: its drive exerts another torque than it is told"),
        leads to always(ZeroTorque, Node, false, &[10]);
    Overspeed { joint: Joint }
        is "a joint is faster than it may be",
        says ("joint {joint}: faster than it may move"),
        leads to armed(ZeroTorque, &[11]);
    GripOverspeed
        is "the grip is faster than it may be",
        says ("the grip is faster than it may move"),
        leads to armed(ZeroTorque, &[11]);
    BeyondLimit { joint: Joint }
        is "a joint is beyond its limit",
        says ("joint {joint}: beyond its limit"),
        leads to armed(ReflectionOff, &[43]);
    MovesUnheld
        is "the arm is driven away while its weight is taken up",
        says ("the arm moves although nobody holds it"),
        leads to armed(ZeroTorque, &[41]);
    Unstable
        is "the hand is driven to and fro, or with too much power",
        says ("the hand is driven to and fro"),
        leads to armed(ReflectionOff, &[45]);
    LinkLost
        is "no wrench from the commanded side that is new enough",
        says ("no new wrench from the commanded side"),
        leads to armed(ReflectionOff, &[34, 35]);
    DriveLeft { joint: Joint, statusword: u16 }
        is "a drive leaves operation enabled by itself",
        says ("joint {joint}: drive left operation enabled (6041h = {statusword:04X}h)"),
        leads to always(ZeroTorque, Drive, false, &[8]);
    Emergency { node: NodeIndex, code: u16 }
        is "a node sends an emergency message",
        says ("{}: emergency {code:04X}h {}", Who(node), error_codes::description(code)),
        leads to always(ZeroTorque, Drive, false, &[7, 13]);
    HeartbeatLost { node: NodeIndex }
        is "a node's heartbeat stops",
        says ("{}: heartbeat lost", Who(node)),
        leads to always(DrivesOff, Node, true, &[2]);
    Rebooted { node: NodeIndex }
        is "a node starts anew in the middle of a run",
        says ("{}: rebooted", Who(node)),
        leads to always(DrivesOff, Drive, true, &[9]);
    LeftOperational { node: NodeIndex, state: NmtState }
        is "a running node reports another state than operational",
        says ("{}: left operational, is {}", Who(node), nmt::description(state)),
        leads to always(ZeroTorque, Node, true, &[8]);
    Duplicate { node: NodeIndex }
        is "two nodes seem to have one node-id",
        says ("{}: two nodes seem to have its node-id", Who(node)),
        leads to always(ZeroTorque, Node, true, &[6]);
    ForeignMaster
        is "somebody else commands the network",
        says ("another master is on the bus"),
        leads to always(DrivesOff, Node, true, &[26]);
    SettingChanged { node: NodeIndex, object: Object, expected: u32, found: u32 }
        is "an object does not hold what the boot has proven",
        says ("{}: {object} is {found:X}h, was proven as {expected:X}h", Who(node)),
        leads to always(DrivesOff, Node, true, &[26]);
    ControllerFault { fault: Fault }
        is "a number that the controller cannot use",
        says ("controller: {fault}"),
        leads to always(ZeroTorque, Node, false, &[42, 44]);
    QueueFull { channel: u8 }
        is "a torque frame cannot be sent",
        says ("bus {channel}: transmit queue full"),
        leads to always(ZeroTorque, Timers, true, &[21]);
    EchoMissing { channel: u8 }
        is "frames are taken and do not appear on the bus",
        says ("bus {channel}: frames are taken and do not appear on it"),
        leads to always(DrivesOff, Timers, true, &[22]);
    BusPassive { channel: u8 }
        is "the bus is error passive",
        says ("bus {channel}: error passive"),
        leads to always(ZeroTorque, Node, false, &[23]);
    BusOff { channel: u8 }
        is "the CAN controller has left the bus",
        says ("bus {channel}: bus off"),
        leads to always(DrivesOff, Timers, true, &[23]);
    BusDown { channel: u8 }
        is "the interface is down",
        says ("bus {channel}: interface down"),
        leads to always(DrivesOff, Timers, true, &[24]);
    DeadmanDisagrees
        is "the deadman's contacts contradict each other",
        says ("the deadman's channels contradict each other"),
        leads to always(ZeroTorque, Node, false, &[39]);
    DeadmanTaped
        is "the deadman is held for long, and nothing moves",
        says ("the deadman has been closed for long, and nothing moved"),
        leads to armed(ReflectionOff, &[39]);
    Overrun { cycles: u64 }
        is "the loop stands still for several cycles",
        says ("the loop stood still for {cycles} cycles"),
        leads to always(ZeroTorque, Timers, false, &[28, 29]);
    Late
        is "the loop is late, too often",
        says ("the loop was late too often"),
        leads to always(ZeroTorque, Node, false, &[29]);
    Suspended
        is "the host was suspended",
        says ("the host was suspended"),
        leads to always(DrivesOff, Timers, true, &[31]);
    EnableTimeout { joint: Joint, statusword: u16 }
        is "a drive does not reach operation enabled",
        says ("joint {joint}: not enabled in time (6041h = {statusword:04X}h)"),
        leads to always(ZeroTorque, Node, true, &[16]);
    AwaitsReset { awaited: Awaited }
        is "the last run did not end in order, or this one cannot be marked",
        says ("{awaited}: waiting for a reset"),
        leads to always(DrivesOff, Node, true, &[27]);
}

/// Reason why a run begins stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Awaited {
    /// The last run crashed, was killed, or ended stopped.
    NotEnded,
    /// A crash of this run would leave no trace.
    Unmarked,
}

impl fmt::Display for Awaited {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotEnded => "the last run did not end in order",
            Self::Unmarked => "the state folder cannot be written",
        })
    }
}

/// A node in words.
struct Who(NodeIndex);

impl fmt::Display for Who {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.joint() {
            Some(joint) => write!(f, "joint {joint}"),
            None => f.write_str("switch box"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cause_at_a_drive_is_about_its_joint_and_one_at_the_switch_box_about_none() {
        let (joint, node) = (Joint::of::<3>(), NodeIndex(2));
        let switches = NodeIndex(6);
        for (cause, about, words) in [
            (
                Cause::DriveLeft { joint, statusword: 0x0218 },
                Some(joint),
                "joint 3: drive left operation enabled (6041h = 0218h)",
            ),
            (Cause::Rebooted { node }, Some(joint), "joint 3: rebooted"),
            (Cause::Rebooted { node: switches }, None, "switch box: rebooted"),
            (
                Cause::BusSilent { channel: 1, cycles: 3 },
                None,
                "bus 1: no sample of any drive for 3 cycles",
            ),
            (Cause::Late, None, "the loop was late too often"),
        ] {
            assert_eq!((cause.joint(), cause.to_string().as_str()), (about, words));
        }
    }

    #[test]
    fn cause_of_a_second_place_has_the_kind_of_its_row() {
        let cause = Cause::BusSilent { channel: 0, cycles: 3 };
        assert_eq!(cause.kind(), Kind::SamplesMissing);
    }
}
