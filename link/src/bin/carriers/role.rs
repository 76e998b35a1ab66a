//! End of the contract in this process.

use contract::{Command, Echo, FarEnd, Feedback, Measurements, Motion, NodeEnd, Order, Reason};
use units::time::Instant;

/// Commanded motion, so that the messages are realistic.
const ORDER: Order = Order { motion: Motion::Rate([0.1; 6]), is_engaged: true, gripper: None };

/// One end of the contract.
#[derive(Debug)]
pub(crate) enum Role {
    /// Node, and the time of its newest sample.
    Near(Box<NodeEnd>, Option<Instant>),
    /// Far side.
    Far(Box<FarEnd>),
}

impl Role {
    /// Returns the next message to send, encoded.
    pub(crate) fn message(&mut self, now: Instant) -> Vec<u8> {
        match self {
            Self::Near(node, _) => node.command(now, &ORDER).to_vec(),
            Self::Far(far) => {
                let wrench = Some([1.0; 6]);
                far.feedback(now, &Measurements { wrench, ..Measurements::default() }).to_vec()
            }
        }
    }

    /// Echo in a message of the other end.
    pub(crate) fn echo(&self, bytes: &[u8]) -> Option<Echo> {
        match self {
            Self::Near(..) => Feedback::decode(bytes).ok().map(|feedback| feedback.head.echo),
            Self::Far(_) => Command::decode(bytes).ok().map(|command| command.head.echo),
        }
    }

    /// Takes a message of the other end.
    pub(crate) fn on_message(&mut self, now: Instant, bytes: &[u8]) {
        match self {
            Self::Near(node, newest) => {
                *newest = node.on_message(now, bytes).map(|sample| sample.at).max(*newest);
            }
            Self::Far(far) => far.on_message(now, bytes),
        }
    }

    /// Runs a cycle; returns the time of the newest sample.
    pub(crate) fn on_cycle(&mut self, now: Instant) -> Option<Instant> {
        match self {
            Self::Near(_, newest) => *newest,
            Self::Far(far) => {
                far.motion(now);
                None
            }
        }
    }

    /// Arms the node.
    pub(crate) fn arm(&mut self) {
        if let Self::Near(node, _) = self {
            node.begin_epoch();
        }
    }

    /// Returns whether the far side holds without a fresh command.
    pub(crate) fn is_held(&self) -> bool {
        match self {
            Self::Near(..) => false,
            Self::Far(far) => far.reason() == Reason::Silence,
        }
    }
}
