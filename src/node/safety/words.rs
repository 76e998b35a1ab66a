//! The fault table in words, for those who read it.

use crate::cause::Kind;
use crate::safety::table::Decides;
use crate::safety::table::Reaction;

/// What is wrong.
pub const fn of_kind(kind: Kind) -> &'static str {
    match kind {
        Kind::SamplesMissing => "a drive's samples do not come, several cycles in a row",
        Kind::StatusMissing => "a drive does not tell its state, although its positions come",
        Kind::SamplesRare => "too many of a joint's samples within a second are late or impossible",
        Kind::SamplesOverdue => "more of a joint's samples are late or lost than may be",
        Kind::PositionFrozen => "a position stands still although the joint is pushed",
        Kind::PositionJumped => "a position jumps farther than the joint can move, twice",
        Kind::TorqueDiffers => "a drive exerts another torque than it is told",
        Kind::Overspeed => "a joint is faster than it may be",
        Kind::GripOverspeed => "the grip is faster than it may be",
        Kind::BeyondLimit => "a joint is beyond its limit",
        Kind::MovesUnheld => "the arm is driven away while its weight is taken up",
        Kind::Unstable => "the hand is driven to and fro, or with too much power",
        Kind::LinkLost => "no wrench from the commanded side that is new enough",
        Kind::DriveLeft => "a drive leaves operation enabled by itself",
        Kind::Emergency => "a node sends an emergency message",
        Kind::HeartbeatLost => "a node's heartbeat stops",
        Kind::Rebooted => "a node starts anew in the middle of a run",
        Kind::LeftOperational => "a running node reports another state than operational",
        Kind::Duplicate => "two nodes seem to have one node-id",
        Kind::ForeignMaster => "somebody else commands the network",
        Kind::SettingChanged => "an object does not hold what the boot has proven",
        Kind::ControllerFault => "a number that the controller cannot use",
        Kind::QueueFull => "a torque frame cannot be sent",
        Kind::EchoMissing => "frames are taken and do not appear on the bus",
        Kind::BusPassive => "the bus is error passive",
        Kind::BusOff => "the CAN controller has left the bus",
        Kind::BusDown => "the interface is down",
        Kind::DeadmanDisagrees => "the deadman's contacts contradict each other",
        Kind::DeadmanTaped => "the deadman is held for long, and nothing moves",
        Kind::Overrun => "the loop stands still for several cycles",
        Kind::Late => "the loop is late, too often",
        Kind::Suspended => "the host was suspended",
        Kind::EnableTimeout => "a drive does not reach operation enabled",
        Kind::AwaitsReset => "the last run did not end in order, or this one cannot be marked",
    }
}

/// What is done.
pub const fn of_reaction(reaction: Reaction) -> &'static str {
    match reaction {
        Reaction::None => {
            "nothing: no torque flows that it could harm, but nothing is armed while it is there"
        }
        Reaction::ReflectionOff => {
            "reflection off: the weight of the arm is carried on, the rest ends, the command holds"
        }
        Reaction::ZeroTorque => {
            "zero torque: all six in the next frame, and drives off 100 ms later"
        }
        Reaction::DrivesOff => "drives off: all six torques zero and voltage off in the next frame",
    }
}

/// Who takes the torque away first.
pub const fn of_decides(decides: Decides) -> &'static str {
    match decides {
        Decides::Node => "node",
        Decides::Drive => "drive",
        Decides::Timers => "drives' timers",
    }
}
