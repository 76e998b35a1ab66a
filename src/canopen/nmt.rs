//! NMT: the commands that start, stop and reset nodes (CiA 301, 7.2.8.3.1), decoded and encoded.
//!
//! Who is in which state is heard from [heartbeats](crate::heartbeat); this is only what
//! is said. There is one NMT master, so a command that is *heard* is somebody else's.
//!
//! | byte | meaning                                   |
//! |------|-------------------------------------------|
//! | 0    | command specifier                         |
//! | 1    | node-id, or 0 for every node on the bus   |

use std::fmt;

use canopen_rs::NmtCommand;
use canopen_rs::NmtState;
use canopen_rs::NodeId;
use canopen_rs::nmt::NMT_COMMAND_COB_ID;
use canopen_rs::nmt::decode_command;
use canopen_rs::nmt::encode_command;

use crate::frame::Frame;

/// The highest priority on the bus.
pub const COB_ID: u16 = NMT_COMMAND_COB_ID;

/// A command and whom it is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Order {
    /// What to do.
    pub command: NmtCommand,
    /// Who: one node, or `None` for every node on the bus.
    pub node: Option<NodeId>,
}

impl Order {
    /// For one node.
    pub const fn to(node: NodeId, command: NmtCommand) -> Self {
        Self { command, node: Some(node) }
    }

    /// For every node on the bus.
    pub const fn to_all(command: NmtCommand) -> Self {
        Self { command, node: None }
    }

    /// Reads a command, `None` if the frame is none or not a valid one.
    pub fn decode(frame: &Frame) -> Option<Self> {
        if frame.cob_id != COB_ID {
            return None;
        }
        let (command, node) = decode_command(frame.data().try_into().ok()?).ok()?;
        Some(Self { command, node: Some(node).filter(|node| *node != NodeId::BROADCAST) })
    }

    /// The frame that says it.
    pub fn frame(self) -> Frame {
        Frame::new(COB_ID, encode_command(self.command, self.node.unwrap_or(NodeId::BROADCAST)))
    }
}

/// `start node 3`, `reset communication of every node`.
impl fmt::Display for Order {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = match self.command {
            NmtCommand::StartRemoteNode => "start",
            NmtCommand::StopRemoteNode => "stop",
            NmtCommand::EnterPreOperational => "pre-operational for",
            NmtCommand::ResetNode => "reset",
            NmtCommand::ResetCommunication => "reset communication of",
        };
        match self.node {
            Some(node) => write!(f, "{words} node {}", node.raw()),
            None => write!(f, "{words} every node"),
        }
    }
}

/// A state as CiA 301 calls it.
pub const fn words(state: NmtState) -> &'static str {
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
    fn what_is_said_is_what_is_understood() {
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
    fn what_no_master_says_is_no_command() {
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
    fn an_order_reads_as_a_sentence() {
        let order = Order::to_all(NmtCommand::ResetCommunication);
        assert_eq!(order.to_string(), "reset communication of every node");
    }
}
