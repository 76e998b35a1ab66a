//! Node's end of the link: sends commands, and accepts feedback of the far side with a bound on its age.

use std::time::Duration;

use crate::capability::{Capability, InvalidCapability};
use crate::command::{Command, Gripper, Motion};
use crate::feedback::Feedback;
use crate::head::{Head, Kind};
use crate::link_end::LinkEnd;
use crate::reject::{Reject, Rejects};
use crate::round_trips::RoundTrips;
use units::time::Instant;

/// Maximum age of an accepted message (ADR 16).
const MAX_AGE: Duration = Duration::from_millis(100);

/// Command of the node for one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    /// Commanded motion of {MRF}.
    pub motion: Motion,
    /// Set if the operator's hand commands the motion.
    pub is_engaged: bool,
    /// Opening and maximum force of the gripper; `None` without a gripper command.
    pub gripper: Option<Gripper>,
}

/// Accepted feedback.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Lower bound of the time of measurement, on the node's clock.
    pub at: Instant,
    /// Decoded message.
    pub feedback: Feedback,
}

/// Node's end of the link.
#[derive(Clone, Debug)]
pub struct NodeEnd {
    end: LinkEnd,
    epoch: u32,
    /// Session of a far side, and its newest valid capability; without a valid one the reason why the newest was rejected.
    capability: Option<(u64, Result<Capability, InvalidCapability>)>,
    /// Reason why the newest message was rejected.
    rejected: Option<Reject>,
    round_trips: RoundTrips,
}

impl NodeEnd {
    /// Creates the end of `arm` with a random session. Allocates once.
    pub fn new(arm: u16, session: u64) -> Self {
        Self {
            end: LinkEnd::new(arm, session, MAX_AGE),
            epoch: 0,
            capability: None,
            rejected: None,
            round_trips: RoundTrips::new(),
        }
    }

    /// Begins a new epoch, at each arming and each reset.
    pub const fn begin_epoch(&mut self) {
        self.epoch = self.epoch.saturating_add(1);
    }

    /// Returns the present epoch, from 0.
    pub const fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Returns the random number of this node's process, never zero.
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

    /// Receives a message; returns it if it is an accepted feedback.
    pub fn on_message(&mut self, now: Instant, bytes: &[u8]) -> Option<Sample> {
        let taken = match Kind::read(bytes) {
            Some(Kind::Capability) => self.on_capability(now, bytes).map(|()| None),
            _ => self.on_feedback(now, bytes),
        };
        self.rejected = taken.err();
        if let Some(reject) = self.rejected {
            self.end.rejects.count(reject);
        }
        taken.ok().flatten()
    }

    /// Returns the reason why the newest message was rejected; `None` if it was accepted.
    pub const fn rejected(&self) -> Option<Reject> {
        self.rejected
    }

    fn on_capability(&mut self, now: Instant, bytes: &[u8]) -> Result<(), Reject> {
        let received = Capability::decode(bytes).and_then(|(head, capability)| {
            Ok(self.admit(now, &head)?.map(|_| (head.own.session, capability)))
        });
        match received {
            Ok(None) => {}
            Ok(Some((session, capability))) => self.capability = Some((session, Ok(capability))),
            Err(invalid) => {
                let current = self.far_session();
                // A message without a valid head has no session: it is of the one peer.
                let head = Head::open(bytes, Kind::Capability, Capability::LENGTH).ok();
                let is_own = head.is_none_or(|(head, _)| head.own.session == current);
                if is_own && self.capability().is_none() {
                    self.capability = Some((current, Err(invalid)));
                }
                return Err(invalid.reject());
            }
        }
        Ok(())
    }

    fn on_feedback(&mut self, now: Instant, bytes: &[u8]) -> Result<Option<Sample>, Reject> {
        let feedback = Feedback::decode(bytes)?;
        let at = self.admit(now, &feedback.head)?;
        Ok(at.map(|at| Sample { at, feedback }))
    }

    /// Returns the send time of the message that the received one echoes; `None` for a first message.
    fn admit(&mut self, now: Instant, head: &Head) -> Result<Option<Instant>, Reject> {
        let Some(admission) = self.end.admit(now, head)? else { return Ok(None) };
        self.round_trips.add(now.since(admission.at));
        Ok(Some(admission.at))
    }

    /// Returns the current session of the far side; zero without one.
    pub fn far_session(&self) -> u64 {
        self.end.peers.session()
    }

    /// Returns the capability of the far side's current session; `None` before it is received.
    pub fn capability(&self) -> Option<&Capability> {
        self.received_capability()?.as_ref().ok()
    }

    /// Returns why the newest capability of that session was rejected; `None` with a valid one, and before the first.
    pub fn invalid_capability(&self) -> Option<InvalidCapability> {
        self.received_capability()?.as_ref().err().copied()
    }

    fn received_capability(&self) -> Option<&Result<Capability, InvalidCapability>> {
        let current = self.end.peers.session();
        self.capability.as_ref().filter(|(session, _)| *session == current).map(|(_, it)| it)
    }

    /// Returns the record of the newest round trips.
    pub const fn round_trips(&self) -> &RoundTrips {
        &self.round_trips
    }

    /// Returns the number of messages lost from the far side.
    pub const fn lost(&self) -> u64 {
        self.end.peers.lost()
    }

    /// Returns the counts of rejected messages.
    pub const fn rejects(&self) -> &Rejects {
        &self.end.rejects
    }
}
