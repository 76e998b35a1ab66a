//! Commanded side in another process: the node's end of the [`contract`] over a Unix socket.
//!
//! ```text
//!  cycle's thread                    link's thread, below its priority                  far side
//!   [`LinkSide`] ── newest Lead ──►   [`LinkThread`]  ── Command, once a period ──────►
//!                ◄── newest FarView ──                ◄── Feedback, Capability ────────
//! ```
//!
//! Two triple buffers connect the threads; a new value replaces the last one. Access does not block, allocate or call
//! the kernel. The link's thread receives at most 16 messages per period. It drops messages if the peer's queue is full, so a
//! far side that hangs finds no backlog. If the cycle stalls, it sends holds. Messages that are old, forged or of another
//! session have no effect ([`NodeEnd`]).

mod far_view;
mod status;
#[cfg(test)]
mod tests;
mod thread;

pub use far_view::FarView;
pub use status::{LatestLink, LinkStatus};
pub use thread::LinkThread;

use std::io;
use std::time::Duration;

use socket2::Socket;
use triple_buffer::{Input, Output, triple_buffer};

use crate::stated::{Misfit, StatedCapability, mode_misfit};
use crate::{Command, Remote, RemoteSample, SideError, messages};
use contract::{NodeEnd, Order};
use units::spatial::CommandMode;
use units::time::Instant;
use unix_socket::Door;

/// Maximum age of the feedback on which an arming relies.
const MAX_ANSWER_AGE: Duration = Duration::from_millis(100);

/// Newest command of the cycle, with its time and epoch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lead {
    pub(crate) at: Instant,
    pub(crate) order: Order,
    pub(crate) epoch: u32,
}

/// Parameters of a link, and the figures of the far side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkSettings {
    /// Arm number of the contract.
    pub arm: u16,
    /// Session of this node; must be random.
    pub session: u64,
    /// Period of the commands.
    pub period: Duration,
    /// Maximum 99th percentile of the round trips.
    pub round_trip: Duration,
    /// Configured figures of the far side.
    pub stated: StatedCapability,
}

/// Link as the cycle uses it.
#[derive(Debug)]
pub struct LinkSide {
    leads: Input<Lead>,
    views: Output<FarView>,
    settings: LinkSettings,
    epoch: u32,
    /// Session of the far side compared at the last arming or reset; `None` while not armed.
    compared: Option<u64>,
}

/// Creates both parts of a link that listens on a SEQPACKET socket.
///
/// # Errors
/// Returns the error of the socket's setup.
pub fn link(listener: Socket, settings: &LinkSettings) -> io::Result<(LinkSide, LinkThread)> {
    let lead = Lead { at: Instant::ZERO, order: messages::order(&Command::HOLD), epoch: 0 };
    let (leads, newest_lead) = triple_buffer(&lead);
    let (newest_view, views) = triple_buffer(&FarView::default());
    let end = NodeEnd::new(settings.arm, settings.session);
    let settings = LinkSettings { session: end.session(), ..*settings };
    let side = LinkSide { leads, views, settings, epoch: 0, compared: None };
    let thread = LinkThread::new(Door::new(listener)?, end, &settings, newest_lead, newest_view);
    Ok((side, thread))
}

impl Remote for LinkSide {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        let order = messages::order(command);
        self.leads.write(Lead { at: now, order, epoch: self.epoch });
        let compared = self.compared;
        let view = self.views.read();
        // The capability of a far side that has started since the last arming has not been compared.
        view.sensed.filter(|_| compared.is_none_or(|session| session == view.session()))
    }

    fn begin_epoch(&mut self) {
        self.epoch = self.epoch.saturating_add(1);
        self.compared = Some(self.views.read().session());
    }

    fn end_epoch(&mut self) {
        self.compared = None;
    }

    fn misfits(&mut self, now: Instant, mode: CommandMode) -> Vec<Misfit> {
        let LinkSettings { session, stated, .. } = self.settings;
        let view = self.views.read();
        let is_new = view.sample_at.is_some_and(|at| now.since(at) <= MAX_ANSWER_AGE);
        let Some(feedback) = view.feedback.filter(|_| is_new) else {
            return vec![view.foreign.map_or(Misfit::Absent, Misfit::Foreign)];
        };
        match feedback.obeyed_session {
            0 => return vec![Misfit::Unled],
            leader if leader != session => return vec![Misfit::Led(leader)],
            _ => {}
        }
        let Some(capability) = &view.capability else { return vec![view.no_capability()] };
        let measured = feedback.measured;
        let mut misfits = stated.misfits(capability, mode, measured.pose.as_ref());
        let is_valid = measured.wrench.is_some() && measured.pose.is_some();
        if !is_valid && misfits.is_empty() {
            misfits.push(Misfit::Senseless);
        }
        misfits
    }

    fn mode_misfit(&mut self, mode: CommandMode) -> Option<Misfit> {
        let view = self.views.read();
        let capability = view.capability.as_ref();
        capability.map_or_else(|| Some(view.no_capability()), |has| mode_misfit(has, mode))
    }

    fn error(&mut self) -> Option<SideError> {
        let round_trip = self.settings.round_trip;
        let view = self.views.read();
        let slow = view.p99.filter(|p99| *p99 > round_trip);
        let holds = view.hold(self.epoch).map(SideError::Holds);
        holds.or(slow.map(|p99| SideError::slow(p99, round_trip)))
    }
}
