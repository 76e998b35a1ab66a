//! What a master has to say, in words for people.
//!
//! Only what is told; what follows from it is `node::safety`'s.

use std::fmt;
use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::sdo::SDO_REQUEST_COB_BASE;
use canopen_rs::sdo::SDO_RESPONSE_COB_BASE;

use crate::drive::Statusword;
use crate::emcy::Emergency;
use crate::frame::Channel;
use crate::frame::Frame;
use crate::master::boot_error::BootError;
use crate::master::duplicate::Sign;
use crate::master::error_history::History;
use crate::master::read_back::ReadBack;
use crate::master::steps::Configuration;
use crate::nmt;
use crate::object::Object;
use units::numbering::NodeIndex;

/// What the master has to say.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// Every node that must be there is configured, started, and says it is operational.
    Booted,
    /// A node is not what it should be. The others are booted on, but none is started.
    BootFailed(BootError),
    /// A drive had its power on before anybody had told it to; it was taken off, and it stood still.
    FoundEnabled {
        /// Which.
        node: NodeIndex,
    },
    /// A node holds its configuration.
    Configured {
        /// Which.
        node: NodeIndex,
        /// How it came to it.
        configuration: Configuration,
    },
    /// An optional node is missing; the others go on, and it is booted when it appears.
    Absent {
        /// Which.
        node: NodeIndex,
        /// For so long it was waited for.
        waited: Duration,
    },
    /// An optional node that was missing is now operational.
    Joined {
        /// Which.
        node: NodeIndex,
    },
    /// A node reports an error, or that one is gone.
    Emergency {
        /// Which.
        node: NodeIndex,
        /// What.
        emergency: Emergency,
    },
    /// What a node remembers of its errors (1003h), read because of a new one.
    ErrorHistory {
        /// Which.
        node: NodeIndex,
        /// What it remembers, the newest first.
        history: History,
    },
    /// A drive has said what its power stage is in (6041h), because it was asked.
    Statusword {
        /// Which.
        node: NodeIndex,
        /// What it said.
        statusword: Statusword,
    },
    /// An object that a boot has proven was read again.
    ReadBack {
        /// Of which node.
        node: NodeIndex,
        /// Which object.
        object: Object,
        /// What came of it.
        read: ReadBack,
    },
    /// A node was silent for too long.
    HeartbeatLost {
        /// Which.
        node: NodeIndex,
    },
    /// A node has booted by itself: everything set in it is gone.
    Rebooted {
        /// Which.
        node: NodeIndex,
    },
    /// A node has changed its NMT state, or is heard again after it was lost.
    StateChanged {
        /// Which.
        node: NodeIndex,
        /// What it is in now.
        state: NmtState,
    },
    /// Two nodes seem to have one node-id.
    Duplicate {
        /// Which.
        node: NodeIndex,
        /// What they gave themselves away by.
        sign: Sign,
    },
    /// A node is on the bus that is in no plan. Said once.
    Stranger {
        /// On which bus.
        channel: Channel,
        /// Its node-id, 1 to 127.
        node_id: u8,
    },
    /// Another SDO client reads from a node. Reported once for each node and boot.
    ReadByAnother {
        /// Which.
        node: NodeIndex,
    },
    /// Somebody else commands this network.
    ForeignMaster {
        /// On which bus.
        channel: Channel,
        /// An NMT command, a SYNC, an RPDO or an SDO download that only the master may send, or the
        /// confirmation of such a download.
        frame: Frame,
    },
}

impl Event {
    /// The node it is about, by its place in the list of plans, unless it names that itself.
    pub const fn node(&self) -> Option<NodeIndex> {
        match self {
            Self::FoundEnabled { node }
            | Self::Configured { node, .. }
            | Self::Absent { node, .. }
            | Self::Joined { node }
            | Self::Emergency { node, .. }
            | Self::ErrorHistory { node, .. }
            | Self::Statusword { node, .. }
            | Self::HeartbeatLost { node }
            | Self::Rebooted { node }
            | Self::StateChanged { node, .. }
            | Self::ReadBack { node, .. }
            | Self::ReadByAnother { node }
            | Self::Duplicate { node, .. } => Some(*node),
            Self::Booted
            | Self::BootFailed(_)
            | Self::Stranger { .. }
            | Self::ForeignMaster { .. } => None,
        }
    }
}

/// What has happened, without the node's name: `emergency 3210h DC link over-voltage (voltage)`.
impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Booted => f.write_str("every node is operational"),
            Self::BootFailed(error) => write!(f, "{error}"),
            Self::FoundEnabled { .. } => f.write_str("was found with its power on; it is off now"),
            Self::Configured { configuration, .. } => write!(f, "configuration {configuration}"),
            Self::Absent { waited, .. } => {
                let waited = waited.as_secs_f64();
                write!(f, "missing, waited {waited:.1} s; optional, so the others start without it")
            }
            Self::Joined { .. } => f.write_str("has appeared and is operational"),
            Self::Emergency { emergency, .. } => write!(f, "emergency {emergency}"),
            Self::ErrorHistory { history, .. } => write!(f, "error history (1003h): {history}"),
            Self::Statusword { statusword, .. } => {
                write!(f, "6041h = {:04X}h", statusword.0)
            }
            Self::ReadBack { object, read, .. } => write!(f, "{object} {read}"),
            Self::HeartbeatLost { .. } => f.write_str("heartbeat lost"),
            Self::Rebooted { .. } => f.write_str("rebooted by itself"),
            Self::StateChanged { state, .. } => write!(f, "is {}", nmt::words(*state)),
            Self::Duplicate { sign, .. } => {
                write!(f, "{sign}: are there two nodes with this node-id?")
            }
            Self::Stranger { channel, node_id } => {
                write!(f, "bus {}: node {node_id} is not in the configuration", channel.0)
            }
            Self::ReadByAnother { .. } => {
                f.write_str("another SDO client reads from it; transfers may disturb each other")
            }
            Self::ForeignMaster { channel, frame } => match frame.cob_id & FUNCTION {
                SDO_REQUEST_COB_BASE => {
                    write!(f, "bus {}: another master writes: {frame}", channel.0)
                }
                SDO_RESPONSE_COB_BASE => {
                    write!(f, "bus {}: a write of another master is confirmed: {frame}", channel.0)
                }
                _ => write!(f, "bus {}: another master sent {frame}", channel.0),
            },
        }
    }
}

/// The bits of a COB-ID that say what it is for; the others are the node-id.
const FUNCTION: u16 = 0x780;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_event_reads_as_a_sentence() {
        let configuration = Configuration::Skipped;
        for (event, words) in [
            (
                Event::Configured { node: NodeIndex(0), configuration },
                "configuration already stored, verified",
            ),
            (
                Event::Absent { node: NodeIndex(6), waited: Duration::from_secs(2) },
                "missing, waited 2.0 s; optional, so the others start without it",
            ),
            (
                Event::Stranger { channel: Channel(1), node_id: 9 },
                "bus 1: node 9 is not in the configuration",
            ),
            (Event::StateChanged { node: NodeIndex(0), state: NmtState::Stopped }, "is stopped"),
        ] {
            assert_eq!(event.to_string(), words);
        }
    }
}
