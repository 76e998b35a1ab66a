//! NMT commands (CiA 301, 7.2.8.3.1): start, stop and reset nodes, decoded and encoded.
//!
//! The state of each node comes from its [heartbeat](crate::heartbeat). There is one NMT master, so a
//! received command comes from another master.
//!
//! | byte | meaning                                   |
//! |------|-------------------------------------------|
//! | 0    | command specifier                         |
//! | 1    | node-id, or 0 for every node on the bus   |

use std::fmt;

pub use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::nmt::{NMT_COMMAND_COB_ID, decode_command, encode_command};
use canopen_rs::{NmtCommand, NmtState, NodeId};

use crate::frame::Frame;

/// COB-ID of NMT commands: the highest priority on the bus.
pub const COB_ID: u16 = NMT_COMMAND_COB_ID;

/// NMT command with its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Order {
    /// Command specifier.
    pub command: NmtCommand,
    /// Target node; `None` for every node on the bus.
    pub node: Option<NodeId>,
}

impl Order {
    /// Addresses one node.
    pub const fn to(node: NodeId, command: NmtCommand) -> Self {
        Self { command, node: Some(node) }
    }

    /// Addresses every node on the bus.
    pub const fn to_all(command: NmtCommand) -> Self {
        Self { command, node: None }
    }

    /// Decodes a command; `None` for any other frame and for invalid commands.
    pub fn decode(frame: &Frame) -> Option<Self> {
        if frame.cob_id != COB_ID {
            return None;
        }
        let (command, node) = decode_command(frame.data().try_into().ok()?).ok()?;
        Some(Self { command, node: Some(node).filter(|node| *node != NodeId::BROADCAST) })
    }

    /// Encodes the command.
    pub fn frame(self) -> Frame {
        Frame::new(COB_ID, encode_command(self.command, self.node.unwrap_or(NodeId::BROADCAST)))
    }
}

/// `start node 3`, `reset communication of every node`.
impl fmt::Display for Order {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self.command {
            NmtCommand::StartRemoteNode => "start",
            NmtCommand::StopRemoteNode => "stop",
            NmtCommand::EnterPreOperational => "pre-operational for",
            NmtCommand::ResetNode => "reset",
            NmtCommand::ResetCommunication => "reset communication of",
        };
        match self.node {
            Some(node) => write!(f, "{text} node {}", node.raw()),
            None => write!(f, "{text} every node"),
        }
    }
}

/// Name of an NMT state in CiA 301.
pub const fn description(state: NmtState) -> &'static str {
    match state {
        NmtState::Initialising => "initialising",
        NmtState::Stopped => "stopped",
        NmtState::Operational => "operational",
        NmtState::PreOperational => "pre-operational",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMMANDS: [(NmtCommand, u8); 5] = [
        (NmtCommand::StartRemoteNode, 0x01),
        (NmtCommand::StopRemoteNode, 0x02),
        (NmtCommand::EnterPreOperational, 0x80),
        (NmtCommand::ResetNode, 0x81),
        (NmtCommand::ResetCommunication, 0x82),
    ];

    #[test]
    fn encoded_commands_decode_to_themselves() {
        for (command, specifier) in COMMANDS {
            let one = Order::to(NodeId::new(3).unwrap(), command);
            assert_eq!(one.frame(), Frame::new(0, [specifier, 3]));
            assert_eq!(Order::decode(&one.frame()), Some(one));
            let all = Order::to_all(command);
            assert_eq!(all.frame(), Frame::new(0, [specifier, 0]));
            assert_eq!(Order::decode(&all.frame()), Some(all));
        }
    }

    #[test]
    fn invalid_commands_do_not_decode() {
        for frame in [
            Frame::new(0, []),
            Frame::new(0, [1]),
            Frame::new(0, [1, 2, 3]),
            Frame::new(0, [3, 1]),
            Frame::new(0, [1, 128]),
            Frame::new(0x701, [1, 2]),
        ] {
            assert_eq!(Order::decode(&frame), None, "{frame}");
        }
    }

    #[test]
    fn command_reads_as_a_sentence() {
        let order = Order::to_all(NmtCommand::ResetCommunication);
        assert_eq!(order.to_string(), "reset communication of every node");
    }
}
