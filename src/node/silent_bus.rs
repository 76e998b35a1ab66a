//! Test bus without any other node: `receive` advances the time, `send` keeps the frames. A test may plan frames to receive.

use std::path::Path;
use std::time::Duration;

use crate::Node;
use bus::{Bus, BusError, BusEvent, ReceivedEvent, SendError, Wake};
use canopen::frame::{Channel, Telegram};
use canopen::sync;
use config::Config;
use remote::{Command, Remote, RemoteSample};
use units::time::Instant;

/// Bus without any other node.
#[derive(Clone, Debug, Default)]
pub(super) struct SilentBus {
    pub(super) now: Instant,
    /// Every sent frame, with its time.
    pub(super) sent: Vec<(Instant, Telegram)>,
    /// Error of every `send`, if any.
    pub(super) refuses: Option<SendError>,
    /// Frames of other nodes, with the times of their reception in ascending order.
    pub(super) received: Vec<(Instant, Telegram)>,
    /// Fault of channel 0, and the time at which it is reported.
    pub(super) error: Option<(Instant, BusError)>,
    /// Stall of the process, added to the next wait.
    pub(super) stall: Duration,
    /// Stall of the process, added to the next wait directly after a SYNC.
    pub(super) stall_after_sync: Duration,
}

impl Bus for SilentBus {
    fn now(&self) -> Instant {
        self.now
    }

    fn wall(&self) -> Duration {
        Duration::ZERO
    }

    fn send_at(&mut self, _: Instant, telegram: Telegram) -> Result<(), SendError> {
        self.refuses.map_or(Ok(()), Err)?;
        self.sent.push((self.now, telegram));
        Ok(())
    }

    fn wait(&mut self, _: Instant, from: Instant, until: Instant) -> Wake {
        self.now = self.now.max(from);
        let received = self.next(until);
        Wake { now: self.now, received }
    }
}

impl SilentBus {
    /// Waits until `until` for a planned event.
    fn next(&mut self, until: Instant) -> Option<ReceivedEvent> {
        if let Some((at, error)) = self.error.take_if(|(at, _)| *at <= until) {
            self.now = self.now.max(at);
            return Some(ReceivedEvent { at, channel: Channel(0), event: BusEvent::Error(error) });
        }
        if self.received.first().is_some_and(|(at, _)| *at <= until) {
            let (at, Telegram { channel, frame }) = self.received.remove(0);
            self.now = self.now.max(at);
            return Some(ReceivedEvent { at, channel, event: BusEvent::Frame(frame) });
        }
        self.now = self.now.max(until) + std::mem::take(&mut self.stall);
        if self.sent.last().is_some_and(|(_, telegram)| telegram.frame.cob_id == sync::COB_ID) {
            self.now = self.now + std::mem::take(&mut self.stall_after_sync);
        }
        None
    }

    /// Takes the COB-IDs of the frames since the last call, in order.
    pub(super) fn identifiers(&mut self) -> Vec<u16> {
        self.sent.drain(..).map(|(_, telegram)| telegram.frame.cob_id).collect()
    }
}

/// Commanded side that never sends a sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct NoRemote;

impl Remote for NoRemote {
    fn exchange(&mut self, _: Instant, _: &Command) -> Option<RemoteSample> {
        None
    }
}

/// Returns a node before its boot, on one bus at 1 kHz with grouped targets.
pub(super) fn node() -> Node<SilentBus, NoRemote> {
    let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
    Node::new(&config, SilentBus::default(), NoRemote)
}
