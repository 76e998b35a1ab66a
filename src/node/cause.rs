//! What can be wrong, with where and how much: what stopped the node, or what it was told of.

use std::fmt;

use canopen::NmtState;
use canopen::error_codes;
use canopen::nmt;
use canopen::object::Object;
use controller::Fault;
use units::numbering::Joint;
use units::numbering::NodeIndex;

/// What stopped the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A drive's samples did not come in time, several cycles in a row.
    SamplesMissing { joint: Joint, cycles: u32 },
    /// No drive of a bus answered in time, several cycles in a row.
    BusSilent { channel: u8, cycles: u32 },
    /// A drive no longer tells its state, although its positions come.
    StatusMissing { joint: Joint },
    /// So many of a joint's samples were missing within the last second that it is no longer trusted.
    SamplesRare { joint: Joint, percent: u32 },
    /// So many of a joint's samples are late or lost that those that come may be too old.
    SamplesOverdue { joint: Joint, cycles: u32 },
    /// A joint's position stands still to the last count although it is pushed and a neighbour moves.
    PositionFrozen { joint: Joint },
    /// A joint's position jumped farther than it can have moved, twice.
    PositionJumped { joint: Joint },
    /// A drive exerts another torque than it is told.
    TorqueDiffers { joint: Joint },
    /// A joint moves faster than it may.
    Overspeed { joint: Joint },
    /// The grip moves faster than it may.
    GripOverspeed,
    /// A joint is beyond its limit.
    BeyondLimit { joint: Joint },
    /// The arm moves by itself while its weight is taken up and nobody holds it.
    MovesUnheld,
    /// Motion that grows, or energy that comes from nowhere.
    Unstable,
    /// No word from the commanded side that is new enough.
    LinkLost,
    /// A drive left `Operation enabled` by itself.
    DriveLeft { joint: Joint, statusword: u16 },
    /// A node sent an emergency message.
    Emergency { node: NodeIndex, code: u16 },
    /// A node's heartbeat stopped.
    HeartbeatLost { node: NodeIndex },
    /// A node started anew in the middle of a run.
    Rebooted { node: NodeIndex },
    /// A node that runs reports another state than operational.
    LeftOperational { node: NodeIndex, state: NmtState },
    /// Two nodes seem to have one node-id.
    Duplicate { node: NodeIndex },
    /// Somebody else commands this network.
    ForeignMaster,
    /// An object does not hold what the boot has proven.
    SettingChanged { node: NodeIndex, object: Object, expected: u32, found: u32 },
    /// The controller met a number it cannot use.
    ControllerFault { fault: Fault },
    /// A torque frame could not be sent.
    QueueFull { channel: u8 },
    /// Frames are taken and do not appear on the bus.
    EchoMissing { channel: u8 },
    /// The bus is error passive.
    BusPassive { channel: u8 },
    /// The controller has left the bus.
    BusOff { channel: u8 },
    /// The interface is down.
    BusDown { channel: u8 },
    /// The deadman's two channels contradict each other.
    DeadmanDisagrees,
    /// The deadman has been closed for long, and nothing moved.
    DeadmanTaped,
    /// The loop stood still for several cycles.
    Overrun { cycles: u64 },
    /// The loop was late, too often.
    Late,
    /// The host was suspended.
    Suspended,
    /// A drive did not reach `Operation enabled`.
    EnableTimeout { joint: Joint, statusword: u16 },
    /// A run begins that a person must release first.
    AwaitsReset { awaited: Awaited },
}

/// Reason why a run begins stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Awaited {
    /// The last run crashed, was killed, or ended stopped.
    NotEnded,
    /// A crash of this run would leave no trace.
    Unmarked,
}

/// What kind of cause it is: a row of the fault table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// A drive's samples did not come in time, several cycles in a row.
    SamplesMissing,
    /// A drive no longer tells its state, although its positions come.
    StatusMissing,
    /// So many of a joint's samples were missing within the last second that it is no longer trusted.
    SamplesRare,
    /// So many of a joint's samples are late or lost that those that come may be too old.
    SamplesOverdue,
    /// A joint's position stands still to the last count although it is pushed and a neighbour moves.
    PositionFrozen,
    /// A joint's position jumped farther than it can have moved, twice.
    PositionJumped,
    /// A drive exerts another torque than it is told.
    TorqueDiffers,
    /// A joint moves faster than it may.
    Overspeed,
    /// The grip moves faster than it may.
    GripOverspeed,
    /// A joint is beyond its limit.
    BeyondLimit,
    /// The arm moves by itself while its weight is taken up and nobody holds it.
    MovesUnheld,
    /// Motion that grows, or energy that comes from nowhere.
    Unstable,
    /// No word from the commanded side that is new enough.
    LinkLost,
    /// A drive left `Operation enabled` by itself.
    DriveLeft,
    /// A node sent an emergency message.
    Emergency,
    /// A node's heartbeat stopped.
    HeartbeatLost,
    /// A node started anew in the middle of a run.
    Rebooted,
    /// A node that runs reports another state than operational.
    LeftOperational,
    /// Two nodes seem to have one node-id.
    Duplicate,
    /// Somebody else commands this network.
    ForeignMaster,
    /// An object does not hold what the boot has proven.
    SettingChanged,
    /// The controller met a number it cannot use.
    ControllerFault,
    /// A torque frame could not be sent.
    QueueFull,
    /// Frames are taken and do not appear on the bus.
    EchoMissing,
    /// The bus is error passive.
    BusPassive,
    /// The controller has left the bus.
    BusOff,
    /// The interface is down.
    BusDown,
    /// The deadman's two channels contradict each other.
    DeadmanDisagrees,
    /// The deadman has been closed for long, and nothing moved.
    DeadmanTaped,
    /// The loop stood still for several cycles.
    Overrun,
    /// The loop was late, too often.
    Late,
    /// The host was suspended.
    Suspended,
    /// A drive did not reach `Operation enabled`.
    EnableTimeout,
    /// A run begins that a person must release first.
    AwaitsReset,
}

impl Kind {
    /// All of them, in the order of their declaration.
    pub const ALL: [Self; 34] = [
        Self::SamplesMissing,
        Self::StatusMissing,
        Self::SamplesRare,
        Self::SamplesOverdue,
        Self::PositionFrozen,
        Self::PositionJumped,
        Self::TorqueDiffers,
        Self::Overspeed,
        Self::GripOverspeed,
        Self::BeyondLimit,
        Self::MovesUnheld,
        Self::Unstable,
        Self::LinkLost,
        Self::DriveLeft,
        Self::Emergency,
        Self::HeartbeatLost,
        Self::Rebooted,
        Self::LeftOperational,
        Self::Duplicate,
        Self::ForeignMaster,
        Self::SettingChanged,
        Self::ControllerFault,
        Self::QueueFull,
        Self::EchoMissing,
        Self::BusPassive,
        Self::BusOff,
        Self::BusDown,
        Self::DeadmanDisagrees,
        Self::DeadmanTaped,
        Self::Overrun,
        Self::Late,
        Self::Suspended,
        Self::EnableTimeout,
        Self::AwaitsReset,
    ];
}

impl Cause {
    /// The joint it is about, if it is about one.
    pub fn joint(&self) -> Option<Joint> {
        match *self {
            Self::SamplesMissing { joint, .. }
            | Self::StatusMissing { joint }
            | Self::SamplesRare { joint, .. }
            | Self::SamplesOverdue { joint, .. }
            | Self::PositionFrozen { joint }
            | Self::PositionJumped { joint }
            | Self::TorqueDiffers { joint }
            | Self::Overspeed { joint }
            | Self::BeyondLimit { joint }
            | Self::DriveLeft { joint, .. }
            | Self::EnableTimeout { joint, .. } => Some(joint),
            Self::Emergency { node, .. }
            | Self::HeartbeatLost { node }
            | Self::Rebooted { node }
            | Self::LeftOperational { node, .. }
            | Self::SettingChanged { node, .. }
            | Self::Duplicate { node } => node.joint(),
            Self::BusSilent { .. }
            | Self::GripOverspeed
            | Self::MovesUnheld
            | Self::Unstable
            | Self::LinkLost
            | Self::ForeignMaster
            | Self::ControllerFault { .. }
            | Self::QueueFull { .. }
            | Self::EchoMissing { .. }
            | Self::BusPassive { .. }
            | Self::BusOff { .. }
            | Self::BusDown { .. }
            | Self::DeadmanDisagrees
            | Self::DeadmanTaped
            | Self::Overrun { .. }
            | Self::Late
            | Self::Suspended
            | Self::AwaitsReset { .. } => None,
        }
    }

    /// Its row of the fault table.
    pub const fn kind(&self) -> Kind {
        match self {
            Self::SamplesMissing { .. } | Self::BusSilent { .. } => Kind::SamplesMissing,
            Self::StatusMissing { .. } => Kind::StatusMissing,
            Self::SamplesRare { .. } => Kind::SamplesRare,
            Self::SamplesOverdue { .. } => Kind::SamplesOverdue,
            Self::PositionFrozen { .. } => Kind::PositionFrozen,
            Self::PositionJumped { .. } => Kind::PositionJumped,
            Self::TorqueDiffers { .. } => Kind::TorqueDiffers,
            Self::Overspeed { .. } => Kind::Overspeed,
            Self::GripOverspeed => Kind::GripOverspeed,
            Self::BeyondLimit { .. } => Kind::BeyondLimit,
            Self::MovesUnheld => Kind::MovesUnheld,
            Self::Unstable => Kind::Unstable,
            Self::LinkLost => Kind::LinkLost,
            Self::DriveLeft { .. } => Kind::DriveLeft,
            Self::Emergency { .. } => Kind::Emergency,
            Self::HeartbeatLost { .. } => Kind::HeartbeatLost,
            Self::Rebooted { .. } => Kind::Rebooted,
            Self::LeftOperational { .. } => Kind::LeftOperational,
            Self::Duplicate { .. } => Kind::Duplicate,
            Self::ForeignMaster => Kind::ForeignMaster,
            Self::SettingChanged { .. } => Kind::SettingChanged,
            Self::ControllerFault { .. } => Kind::ControllerFault,
            Self::QueueFull { .. } => Kind::QueueFull,
            Self::EchoMissing { .. } => Kind::EchoMissing,
            Self::BusPassive { .. } => Kind::BusPassive,
            Self::BusOff { .. } => Kind::BusOff,
            Self::BusDown { .. } => Kind::BusDown,
            Self::DeadmanDisagrees => Kind::DeadmanDisagrees,
            Self::DeadmanTaped => Kind::DeadmanTaped,
            Self::Overrun { .. } => Kind::Overrun,
            Self::Late => Kind::Late,
            Self::Suspended => Kind::Suspended,
            Self::EnableTimeout { .. } => Kind::EnableTimeout,
            Self::AwaitsReset { .. } => Kind::AwaitsReset,
        }
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SamplesRare { joint, percent } => {
                write!(f, "joint {joint}: {percent} % of its samples were missing within a second")
            }
            Self::SamplesOverdue { joint, cycles } => {
                write!(f, "joint {joint}: {cycles} samples late or lost, the others may be as old")
            }
            Self::PositionFrozen { joint } => {
                write!(f, "joint {joint}: its position stands still under torque")
            }
            Self::PositionJumped { joint } => write!(f, "joint {joint}: its position jumped"),
            Self::TorqueDiffers { joint } => {
                write!(f, "joint {joint}: its drive exerts another torque than it is told")
            }
            Self::Overspeed { joint } => write!(f, "joint {joint}: faster than it may move"),
            Self::GripOverspeed => f.write_str("the grip is faster than it may move"),
            Self::BeyondLimit { joint } => write!(f, "joint {joint}: beyond its limit"),
            Self::MovesUnheld => f.write_str("the arm moves although nobody holds it"),
            Self::Unstable => f.write_str("the hand is driven to and fro"),
            Self::LinkLost => f.write_str("no new wrench from the commanded side"),
            Self::StatusMissing { joint } => write!(f, "joint {joint}: statusword missing"),
            Self::SamplesMissing { joint, cycles } => {
                write!(f, "joint {joint}: no sample for {cycles} cycles")
            }
            Self::BusSilent { channel, cycles } => {
                write!(f, "bus {channel}: no sample of any drive for {cycles} cycles")
            }
            Self::DriveLeft { joint, statusword } => {
                write!(f, "joint {joint}: drive left operation enabled (6041h = {statusword:04X}h)")
            }
            Self::Emergency { node, code } => {
                let words = error_codes::description(*code);
                write!(f, "{}: emergency {code:04X}h {words}", Who(*node))
            }
            Self::HeartbeatLost { node } => write!(f, "{}: heartbeat lost", Who(*node)),
            Self::Rebooted { node } => write!(f, "{}: rebooted", Who(*node)),
            Self::Duplicate { node } => {
                write!(f, "{}: two nodes seem to have its node-id", Who(*node))
            }
            Self::ForeignMaster => f.write_str("another master is on the bus"),
            Self::LeftOperational { node, state } => {
                write!(f, "{}: left operational, is {}", Who(*node), nmt::description(*state))
            }
            Self::SettingChanged { node, object, expected, found } => {
                let who = Who(*node);
                write!(f, "{who}: {object} is {found:X}h, was proven as {expected:X}h")
            }
            Self::ControllerFault { fault } => write!(f, "controller: {fault}"),
            Self::QueueFull { channel } => write!(f, "bus {channel}: transmit queue full"),
            Self::EchoMissing { channel } => {
                write!(f, "bus {channel}: frames are taken and do not appear on it")
            }
            Self::BusPassive { channel } => write!(f, "bus {channel}: error passive"),
            Self::BusOff { channel } => write!(f, "bus {channel}: bus off"),
            Self::BusDown { channel } => write!(f, "bus {channel}: interface down"),
            Self::DeadmanDisagrees => f.write_str("the deadman's channels contradict each other"),
            Self::DeadmanTaped => {
                f.write_str("the deadman has been closed for long, and nothing moved")
            }
            Self::Late => f.write_str("the loop was late too often"),
            Self::Suspended => f.write_str("the host was suspended"),
            Self::Overrun { cycles } => write!(f, "the loop stood still for {cycles} cycles"),
            Self::EnableTimeout { joint, statusword } => {
                write!(f, "joint {joint}: not enabled in time (6041h = {statusword:04X}h)")
            }
            Self::AwaitsReset { awaited: Awaited::NotEnded } => {
                f.write_str("the last run did not end in order: waiting for a reset")
            }
            Self::AwaitsReset { awaited: Awaited::Unmarked } => {
                f.write_str("the state folder cannot be written: waiting for a reset")
            }
        }
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
