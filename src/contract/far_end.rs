//! Far side's end of the link: leading node, effective command, and hold.
//!
//! ```text
//!                   fresh echo                          a later epoch
//!    no leader ───────────────► holding: not armed ───────────────────────► following
//!                                  ▲    ▲                 a later epoch         │
//!              another session,    │    └──── holding: why ◄────────────────────┘
//!              once this is silent └────────────┘              silence, sensor, limit, end, fault
//! ```

use std::time::Duration;

use crate::capability::Capability;
use crate::command::{Command, Gripper, Motion};
use crate::feedback::{Feedback, Measurements, Reason};
use crate::link_end::LinkEnd;
use crate::reject::{Reject, Rejects};
use units::time::Instant;

/// Far side's end of the link.
#[derive(Clone, Debug)]
pub struct FarEnd {
    end: LinkEnd,
    hold_after: Duration,
    /// Epoch of the leading session.
    epoch: u32,
    command: Option<Newest>,
    /// Number of the newest command that has taken effect.
    acted: u64,
    /// Newest gripper command that has taken effect.
    gripper: Option<Gripper>,
    hold: Reason,
    asks_capability: bool,
}

/// Newest command of the leading session.
#[derive(Clone, Copy, Debug)]
struct Newest {
    /// Send time of the message that the command echoes.
    at: Instant,
    sequence: u64,
    motion: Motion,
    is_engaged: bool,
    gripper: Option<Gripper>,
}

impl FarEnd {
    /// Creates the end of `arm` with a random session. It holds if the newest command is older than `hold_after`. Allocates
    /// once.
    pub fn new(arm: u16, session: u64, hold_after: Duration) -> Self {
        Self {
            end: LinkEnd::new(arm, session, hold_after),
            hold_after,
            epoch: 0,
            command: None,
            acted: 0,
            gripper: None,
            hold: Reason::NotArmed,
            asks_capability: false,
        }
    }

    /// Receives a message of a node.
    pub fn on_message(&mut self, now: Instant, bytes: &[u8]) {
        if let Err(reject) = self.take(now, bytes) {
            self.end.rejects.count(reject);
        }
    }

    fn take(&mut self, now: Instant, bytes: &[u8]) -> Result<(), Reject> {
        let Command { head, motion, is_engaged, asks_capability, gripper } =
            Command::decode(bytes)?;
        let Some(admission) = self.end.admit(now, &head)? else { return Ok(()) };
        if admission.is_new_session {
            // The node may have been armed for another far side, so its present epoch does not end the hold.
            (self.epoch, self.acted, self.hold) = (head.epoch, 0, Reason::NotArmed);
        } else if head.epoch < self.epoch {
            return Err(Reject::Left);
        } else if head.epoch > self.epoch {
            (self.epoch, self.hold) = (head.epoch, Reason::None);
        }
        let sequence = head.own.sequence;
        self.command = Some(Newest { at: admission.at, sequence, motion, is_engaged, gripper });
        self.asks_capability |= asks_capability;
        Ok(())
    }

    /// Returns the motion to perform at `now`. Without a fresh command it holds, until a new epoch.
    pub fn motion(&mut self, now: Instant) -> Motion {
        let fresh = self.command.filter(|newest| now.since(newest.at) <= self.hold_after);
        let Some(fresh) = fresh else {
            self.hold(Reason::Silence);
            return Motion::Hold;
        };
        if self.hold != Reason::None {
            return Motion::Hold;
        }
        self.acted = fresh.sequence;
        self.gripper = fresh.gripper.or(self.gripper);
        fresh.motion
    }

    /// Returns the last effective opening and maximum force; `None` before the first. They remain during a hold and without
    /// gripper commands, so that a gripper does not drop its object.
    pub const fn gripper(&self) -> Option<Gripper> {
        self.gripper
    }

    /// Holds for a reason of the robot until a new epoch. The first reason is kept.
    pub fn hold(&mut self, reason: Reason) {
        let is_silent_unarmed = self.hold == Reason::NotArmed && reason == Reason::Silence;
        if matches!(self.hold, Reason::None | Reason::NotArmed) && !is_silent_unarmed {
            self.hold = reason;
        }
    }

    /// Returns the next message to the node.
    pub fn feedback(&mut self, now: Instant, measured: &Measurements) -> [u8; Feedback::LENGTH] {
        let feedback = Feedback {
            head: self.end.head(now, self.epoch),
            reason: self.hold,
            obeyed_session: self.end.peers.session(),
            acted_sequence: self.acted,
            measured: *measured,
        };
        feedback.encode()
    }

    /// Returns the capability message with these figures, if the node has requested it.
    pub fn capability(
        &mut self,
        now: Instant,
        figures: &Capability,
    ) -> Option<[u8; Capability::LENGTH]> {
        let is_asked = std::mem::take(&mut self.asks_capability);
        is_asked.then(|| figures.encode(&self.end.head(now, self.epoch)))
    }

    /// Returns the reason of the hold; [`Reason::None`] while following.
    pub const fn reason(&self) -> Reason {
        self.hold
    }

    /// Returns session and epoch of the leading node; session zero without one.
    pub fn leader(&self) -> (u64, u32) {
        (self.end.peers.session(), self.epoch)
    }

    /// Returns whether the operator's hand commands the motion of the newest command.
    pub fn is_engaged(&self) -> bool {
        self.command.is_some_and(|newest| newest.is_engaged)
    }

    /// Returns the counts of rejected messages.
    pub const fn rejects(&self) -> &Rejects {
        &self.end.rejects
    }
}
