//! Causes of a stop, with place and figures, and the fault table.
//!
//! Each row of the table declares a cause, its description, its message, and the reaction it leads to.
//! [`table`](crate::safety::table) derives the mode from the reaction.

use std::fmt;

use crate::reaction::Initiator;
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

/// Generates [`Cause`] and [`Kind`] from the table. The first field of a cause is its place: joint, node or bus. A row
/// has a second cause if one fault can occur in two places.
macro_rules! causes {
    ($(
        $kind:ident $({ $at:ident: $place:ident $(, $field:ident: $type:ty)* })?
            is $general:literal,
            says ($($message:tt)+),
            $(or $or:ident { $or_at:ident: $or_place:ident $(, $or_field:ident: $or_type:ty)* }
                is $or_general:literal,
                says ($($or_message:tt)+),)?
            leads to $row:expr;
    )+) => {
        /// A cause of a stop, with its place and figures.
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

        /// Kind of a cause: a row of the fault table.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Kind {
            $(#[doc = $general] $kind,)+
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
                        Self::$kind $({ $at $(, $field)* })? => write!(f, $($message)+),
                        $(Self::$or { $or_at $(, $or_field)* } => write!(f, $($or_message)+),)?
                    )+
                }
            }
        }

        impl Kind {
            /// All kinds, in the order of the table.
            pub const ALL: [Self; [$(Self::$kind),+].len()] = [$(Self::$kind),+];

            /// Returns the fault in general, without place and figures.
            pub const fn description(self) -> &'static str {
                match self {
                    $(Self::$kind => $general,)+
                }
            }

            /// Returns its reactions and reset.
            pub const fn row(self) -> Row {
                use Initiator::Drive;
                use Initiator::Node;
                use Initiator::Timers;
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
        is "position samples of a drive missing for several cycles in a row",
        says ("joint {joint}: no sample for {cycles} cycles"),
        or BusSilent { channel: u8, cycles: u32 }
            is "position samples of all drives of a bus missing for several cycles in a row",
            says ("bus {channel}: no sample of any drive for {cycles} cycles"),
        leads to always(ZeroTorque, Node, true, &[1, 3, 4]);
    StatusMissing { joint: Joint }
        is "statusword of a drive missing, although its position samples arrive",
        says ("joint {joint}: statusword missing"),
        leads to always(ZeroTorque, Node, true, &[3]);
    SamplesRare { joint: Joint, percent: u32 }
        is "too many samples of a joint late or implausible within a second",
        says ("joint {joint}: {percent} % of its samples missing within a second"),
        leads to armed(ReflectionOff, &[3]);
    SamplesOverdue { joint: Joint, cycles: u32 }
        is "more samples of a joint late or lost than allowed",
        says ("joint {joint}: {cycles} samples late or lost; the newest may be {cycles} cycles old"),
        leads to always(ZeroTorque, Node, true, &[3, 4]);
    PositionFrozen { joint: Joint }
        is "position constant although the joint is under torque",
        says ("joint {joint}: position frozen under torque"),
        leads to always(ZeroTorque, Node, false, &[5]);
    PositionJumped { joint: Joint }
        is "position steps farther than the joint can move, twice",
        says ("joint {joint}: position jumped"),
        leads to always(ZeroTorque, Node, false, &[12]);
    TorqueDiffers { joint: Joint }
        is "actual torque (6077h) of a drive differs from its target torque (6071h)",
        says ("joint {joint}: actual torque differs from the target torque"),
        leads to always(ZeroTorque, Node, false, &[10]);
    Overspeed { joint: Joint }
        is "joint speed above its limit",
        says ("joint {joint}: speed above its limit"),
        leads to armed(ZeroTorque, &[11]);
    GripOverspeed
        is "grip speed above its limit",
        says ("grip speed above its limit"),
        leads to armed(ZeroTorque, &[11]);
    BeyondLimit { joint: Joint }
        is "joint position beyond its limit",
        says ("joint {joint}: position beyond its limit"),
        leads to armed(ReflectionOff, &[43]);
    UncommandedMotion
        is "joint driven by gravity compensation while it ramps up",
        says ("uncommanded motion while gravity compensation ramps up"),
        leads to armed(ZeroTorque, &[41]);
    Unstable
        is "oscillation of the grip that does not decay, or excess power into the hand",
        says ("unstable: the grip oscillates or receives excess power"),
        leads to armed(ReflectionOff, &[45]);
    LinkLost
        is "newest wrench from the commanded side too old",
        says ("no new wrench from the commanded side"),
        leads to armed(ReflectionOff, &[34, 35]);
    DriveLeft { joint: Joint, statusword: u16 }
        is "drive leaves operation enabled by itself",
        says ("joint {joint}: drive left operation enabled (6041h = {statusword:04X}h)"),
        leads to always(ZeroTorque, Drive, false, &[8]);
    Emergency { node: NodeIndex, code: u16 }
        is "emergency message (EMCY) of a node",
        says ("{}: emergency {code:04X}h {}", NodeName(node), error_codes::description(code)),
        leads to always(ZeroTorque, Drive, false, &[7, 13]);
    HeartbeatLost { node: NodeIndex }
        is "heartbeat of a node lost",
        says ("{}: heartbeat lost", NodeName(node)),
        leads to always(DrivesOff, Node, true, &[2]);
    Rebooted { node: NodeIndex }
        is "boot-up message of a running node",
        says ("{}: rebooted", NodeName(node)),
        leads to always(DrivesOff, Drive, true, &[9]);
    LeftOperational { node: NodeIndex, state: NmtState }
        is "NMT state of a running node no longer operational",
        says ("{}: left operational, is {}", NodeName(node), nmt::description(state)),
        leads to always(ZeroTorque, Node, true, &[8]);
    Duplicate { node: NodeIndex }
        is "two nodes apparently with one node-id",
        says ("{}: node-id apparently used by two nodes", NodeName(node)),
        leads to always(ZeroTorque, Node, true, &[6]);
    ForeignMaster
        is "commands of another master on the bus",
        says ("another master is on the bus"),
        leads to always(DrivesOff, Node, true, &[26]);
    SettingChanged { node: NodeIndex, object: Object, expected: u32, found: u32 }
        is "object with another value than verified at boot",
        says ("{}: {object} is {found:X}h, was {expected:X}h at boot", NodeName(node)),
        leads to always(DrivesOff, Node, true, &[26]);
    ControllerFault { fault: Fault }
        is "input or result of the controller invalid",
        says ("controller: {fault}"),
        leads to always(ZeroTorque, Node, false, &[42, 44]);
    QueueFull { channel: u8 }
        is "transmit queue full: a frame cannot be sent",
        says ("bus {channel}: transmit queue full"),
        leads to always(ZeroTorque, Timers, true, &[21]);
    TransmitUnconfirmed { channel: u8 }
        is "frames accepted by the adapter, but not confirmed as transmitted",
        says ("bus {channel}: frames accepted, but transmission not confirmed"),
        leads to always(DrivesOff, Timers, true, &[22]);
    BusPassive { channel: u8 }
        is "CAN controller error passive",
        says ("bus {channel}: error passive"),
        leads to always(ZeroTorque, Node, false, &[23]);
    BusOff { channel: u8 }
        is "CAN controller bus off",
        says ("bus {channel}: bus off"),
        leads to always(DrivesOff, Timers, true, &[23]);
    BusDown { channel: u8 }
        is "CAN interface down",
        says ("bus {channel}: interface down"),
        leads to always(DrivesOff, Timers, true, &[24]);
    DeadmanDisagrees
        is "antivalent channels of the deadman disagree",
        says ("deadman channels disagree"),
        leads to always(ZeroTorque, Node, false, &[39]);
    TieDown
        is "deadman closed for too long without motion of the grip",
        says ("deadman tied down: closed for too long without motion"),
        leads to armed(ReflectionOff, &[39]);
    Overrun { cycles: u64 }
        is "loop stalled for several cycles",
        says ("loop stalled for {cycles} cycles"),
        leads to always(ZeroTorque, Timers, false, &[28, 29]);
    Late
        is "too many late cycles",
        says ("too many late cycles"),
        leads to always(ZeroTorque, Node, false, &[29]);
    Suspended
        is "host suspended during the run",
        says ("the host was suspended"),
        leads to always(DrivesOff, Timers, true, &[31]);
    EnableTimeout { joint: Joint, statusword: u16 }
        is "drive does not reach operation enabled in time",
        says ("joint {joint}: not enabled in time (6041h = {statusword:04X}h)"),
        leads to always(ZeroTorque, Node, true, &[16]);
    AwaitsReset { reason: ResetReason }
        is "last run without an orderly end, or this run without a latch",
        says ("{reason}: waiting for a reset"),
        leads to always(DrivesOff, Node, true, &[27]);
}

/// Reason why a run starts stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetReason {
    /// The last run crashed, was killed, or ended stopped.
    UncleanEnd,
    /// The latch that would show a crash of this run cannot be written.
    NoLatch,
}

impl fmt::Display for ResetReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::UncleanEnd => "the last run did not end in order",
            Self::NoLatch => "the state folder cannot be written",
        })
    }
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
    fn cause_of_a_second_place_has_the_kind_of_its_row() {
        let cause = Cause::BusSilent { channel: 0, cycles: 3 };
        assert_eq!(cause.kind(), Kind::SamplesMissing);
    }
}
