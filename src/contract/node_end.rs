//! The node's end: sends the commands, and says which feedback of the far side may act, and how old it is.

use std::time::Duration;

use crate::capability::Capability;
use crate::command::{Command, Gripper, Motion};
use crate::feedback::Feedback;
use crate::head::{Head, Kind};
use crate::link_end::LinkEnd;
use crate::reject::{Reject, Rejects};
use crate::round_trips::RoundTrips;
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
    /// Opening and maximum force of the gripper, where the hand controller has one.
    pub gripper: Option<Gripper>,
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
    end: LinkEnd,
    epoch: u32,
    /// Capability, and the far side's session that it is of.
    capability: Option<(u64, Capability)>,
    /// Why the newest message had no effect.
    rejected: Option<Reject>,
    round_trips: RoundTrips,
}

impl NodeEnd {
    /// Creates the end of `arm` with a session, which must be random. Allocates once.
    pub fn new(arm: u16, session: u64) -> Self {
        Self {
            end: LinkEnd::new(arm, session, MAX_AGE),
            epoch: 0,
            capability: None,
            rejected: None,
            round_trips: RoundTrips::new(),
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
        self.end.session()
    }

    /// Returns the next message to the far side.
    pub fn command(&mut self, now: Instant, order: &Order) -> [u8; Command::LENGTH] {
        let Order { motion, is_engaged, gripper } = *order;
        let head = self.end.head(now, self.epoch);
        let asks_capability = self.end.peers.session() != 0 && self.capability().is_none();
        Command { head, motion, is_engaged, asks_capability, gripper }.encode()
    }

    /// Takes a message; returns it if it is a feedback that may act.
    pub fn on_message(&mut self, now: Instant, bytes: &[u8]) -> Option<Sample> {
        let taken = match Kind::of(bytes) {
            Some(Kind::Capability) => self.on_capability(now, bytes).map(|()| None),
            _ => self.on_feedback(now, bytes),
        };
        self.rejected = taken.err();
        if let Some(reject) = self.rejected {
            self.end.rejects.count(reject);
        }
        taken.ok().flatten()
    }

    /// Returns why the newest message had no effect; `None` if it had one.
    pub const fn rejected(&self) -> Option<Reject> {
        self.rejected
    }

    fn on_capability(&mut self, now: Instant, bytes: &[u8]) -> Result<(), Reject> {
        let (head, capability) = Capability::decode(bytes)?;
        if self.admit(now, &head)?.is_some() {
            self.capability = Some((head.own.session, capability));
        }
        Ok(())
    }

    fn on_feedback(&mut self, now: Instant, bytes: &[u8]) -> Result<Option<Sample>, Reject> {
        let feedback = Feedback::decode(bytes)?;
        let at = self.admit(now, &feedback.head)?;
        Ok(at.map(|at| Sample { at, feedback }))
    }

    /// Returns the send time of the message's echo; `None` for a first message.
    fn admit(&mut self, now: Instant, head: &Head) -> Result<Option<Instant>, Reject> {
        let Some(admission) = self.end.admit(now, head)? else { return Ok(None) };
        self.round_trips.add(now.since(admission.at));
        Ok(Some(admission.at))
    }

    /// Returns the current session of the far side, zero for none.
    pub fn far_session(&self) -> u64 {
        self.end.peers.session()
    }

    /// Returns the capability of the current session of the far side.
    pub fn capability(&self) -> Option<&Capability> {
        let current = self.end.peers.session();
        self.capability.as_ref().filter(|(session, _)| *session == current).map(|(_, it)| it)
    }

    /// Returns the newest round trips.
    pub const fn round_trips(&self) -> &RoundTrips {
        &self.round_trips
    }

    /// Returns the number of messages of the far side that were lost.
    pub const fn lost(&self) -> u64 {
        self.end.peers.lost()
    }

    /// Returns the counts of messages that had no effect.
    pub const fn rejects(&self) -> &Rejects {
        &self.end.rejects
    }
}
