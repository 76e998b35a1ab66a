//! The node's end: sends the commands, and says which feedback of the far side may act, and how old it is.

use std::time::Duration;

use crate::capability::Capability;
use crate::command::{Command, Motion};
use crate::feedback::Feedback;
use crate::head::{Echo, Head};
use crate::peers::Peers;
use crate::reject::{Reject, Rejects};
use crate::round_trips::RoundTrips;
use crate::sent::Sent;
use units::time::Instant;

/// Maximum age of what may act (ADR 16).
const MAX_AGE: Duration = Duration::from_millis(100);

/// Command of the node for one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    /// Motion of {MRF}.
    pub motion: Motion,
    /// True while the motion comes from the operator's hand.
    pub is_engaged: bool,
}

/// A feedback that may act.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time on the node's clock at which it was measured, or before.
    pub at: Instant,
    /// Feedback.
    pub feedback: Feedback,
}

/// The node's end of the link.
#[derive(Clone, Debug)]
pub struct NodeEnd {
    arm: u16,
    epoch: u32,
    sent: Sent,
    peers: Peers,
    /// Capability, and the far side's session that it is of.
    capability: Option<(u64, Capability)>,
    round_trips: RoundTrips,
    rejects: Rejects,
}

impl NodeEnd {
    /// Creates the end of `arm` with a session, which must be random. Allocates once.
    pub fn new(arm: u16, session: u64) -> Self {
        Self {
            arm,
            epoch: 0,
            sent: Sent::new(session.max(1)),
            peers: Peers::new(MAX_AGE),
            capability: None,
            round_trips: RoundTrips::new(),
            rejects: Rejects::default(),
        }
    }

    /// Begins a new epoch: at each arming and each reset.
    pub const fn begin_epoch(&mut self) {
        self.epoch = self.epoch.saturating_add(1);
    }

    /// Returns the epoch.
    pub const fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Returns the session.
    pub const fn session(&self) -> u64 {
        self.sent.session()
    }

    /// Returns the next message to the far side.
    pub fn command(&mut self, now: Instant, order: &Order) -> [u8; Command::LENGTH] {
        let Order { motion, is_engaged } = *order;
        let head = Head {
            arm: self.arm,
            epoch: self.epoch,
            own: self.sent.stamp(now),
            echo: self.peers.echo(),
        };
        let asks_capability = self.peers.session() != 0 && self.capability().is_none();
        Command { head, motion, is_engaged, asks_capability, gripper: None }.encode()
    }

    /// Takes a message; returns it if it is a feedback that may act.
    pub fn on_message(&mut self, now: Instant, bytes: &[u8]) -> Option<Sample> {
        let taken = match Capability::decode(bytes) {
            Ok((head, capability)) => self.on_capability(now, &head, capability),
            Err(Reject::Foreign) => self.on_feedback(now, bytes),
            Err(reject) => Err(reject),
        };
        taken.unwrap_or_else(|reject| {
            self.rejects.count(reject);
            None
        })
    }

    fn on_capability(
        &mut self,
        now: Instant,
        head: &Head,
        capability: Capability,
    ) -> Result<Option<Sample>, Reject> {
        self.admit(now, head)?;
        if self.peers.session() == head.own.session {
            self.capability = Some((head.own.session, capability));
        }
        Ok(None)
    }

    fn on_feedback(&mut self, now: Instant, bytes: &[u8]) -> Result<Option<Sample>, Reject> {
        let feedback = Feedback::decode(bytes)?;
        let at = self.admit(now, &feedback.head)?;
        Ok(at.map(|at| Sample { at, feedback }))
    }

    /// Returns the send time of the message's echo; `None` for a first message.
    fn admit(&mut self, now: Instant, head: &Head) -> Result<Option<Instant>, Reject> {
        if head.arm != self.arm {
            return Err(Reject::Arm);
        }
        let sent_at = self.sent.time_of(head.echo, now, MAX_AGE);
        let admitted = self.peers.admit(now, head.own, head.echo, sent_at);
        if admitted == Err(Reject::Overtaken) {
            self.round_trips.found();
        }
        let Some(admission) = admitted? else { return Ok(None) };
        self.round_trips.add(now.since(admission.at), admission.skipped);
        Ok(Some(admission.at))
    }

    /// Returns the current session of the far side, zero for none.
    pub fn far_session(&self) -> u64 {
        self.peers.session()
    }

    /// Returns the capability of the current session of the far side.
    pub fn capability(&self) -> Option<&Capability> {
        let current = self.peers.session();
        self.capability.as_ref().filter(|(session, _)| *session == current).map(|(_, it)| it)
    }

    /// Returns the newest message of the far side.
    pub const fn newest(&self) -> Echo {
        self.peers.echo()
    }

    /// Returns round trips and losses.
    pub const fn round_trips(&self) -> &RoundTrips {
        &self.round_trips
    }

    /// Returns the counts of messages that had no effect.
    pub const fn rejects(&self) -> &Rejects {
        &self.rejects
    }
}
