//! A bus on which nothing answers, for tests of the node alone: waiting makes time pass, frames are kept.

use std::path::Path;
use std::time::Duration;

use crate::Node;
use bus::Bus;
use bus::BusEvent;
use bus::BusFault;
use bus::Received;
use bus::SendError;
use canopen::frame::Channel;
use canopen::frame::Telegram;
use canopen::sync;
use config::Config;
use remote::Remote;
use remote::Sensed;
use units::spatial::Motion;
use units::time::Instant;

/// The bus.
#[derive(Clone, Debug, Default)]
pub(super) struct Silent {
    pub(super) now: Instant,
    /// Every frame that was handed over, and when.
    pub(super) sent: Vec<(Instant, Telegram)>,
    /// Frames are refused with this.
    pub(super) refuses: Option<SendError>,
    /// A fault of its only bus, and when it is reported.
    pub(super) fault: Option<(Instant, BusFault)>,
    /// The next wait takes so much longer: the process stands still.
    pub(super) stands_still: Duration,
    /// The next wait right behind a SYNC does.
    pub(super) stands_still_over_samples: Duration,
}

impl Bus for Silent {
    fn now(&self) -> Instant {
        self.now
    }

    fn wall(&self) -> Duration {
        Duration::ZERO
    }

    fn send(&mut self, telegram: Telegram) -> Result<(), SendError> {
        self.refuses.map_or(Ok(()), Err)?;
        self.sent.push((self.now, telegram));
        Ok(())
    }

    fn receive(&mut self, until: Instant) -> Option<Received> {
        if let Some((at, fault)) = self.fault.take_if(|(at, _)| *at <= until) {
            self.now = self.now.max(at);
            return Some(Received { at, channel: Channel(0), event: BusEvent::Fault(fault) });
        }
        self.now = self.now.max(until) + std::mem::take(&mut self.stands_still);
        if self.sent.last().is_some_and(|(_, telegram)| telegram.frame.cob_id == sync::COB_ID) {
            self.now = self.now + std::mem::take(&mut self.stands_still_over_samples);
        }
        None
    }
}

impl Silent {
    /// The identifiers of the frames since the last call, in their order.
    pub(super) fn identifiers(&mut self) -> Vec<u16> {
        self.sent.drain(..).map(|(_, telegram)| telegram.frame.cob_id).collect()
    }
}

/// A commanded side that never reports.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nowhere;

impl Remote for Nowhere {
    fn exchange(&mut self, _: Instant, _: &Motion) -> Option<Sensed> {
        None
    }
}

/// A node that was not booted, on one bus at 1 kHz with grouped targets.
pub(super) fn node() -> Node<Silent, Nowhere> {
    let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
    Node::new(&config, Silent::default(), Nowhere)
}
