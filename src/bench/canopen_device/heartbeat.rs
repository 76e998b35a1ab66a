//! Heartbeat producer (1017h) and consumer (1016h) of a device: CiA 301, 7.2.8.3.2.
//!
//! Monitoring starts with the first received heartbeat, so a master that never sent one is never lost.

use std::time::Duration;

use canopen_rs::nmt::{encode_heartbeat, heartbeat_cob_id};
use canopen_rs::{NmtState, NodeId};

use crate::dictionary::Dictionary;
use crate::station::earlier;
use canopen::abort::AbortCode;
use canopen::frame::Frame;
use canopen::object::Object;
use units::time::Instant;

/// Producer and consumers.
#[derive(Clone, Debug, Default)]
pub(super) struct Heartbeat {
    period: Option<Duration>,
    next: Option<Instant>,
    consumers: Vec<ConsumerEntry>,
}

/// Consumer heartbeat entry (1016h).
#[derive(Clone, Copy, Debug)]
struct ConsumerEntry {
    cob_id: u16,
    timeout: Duration,
    /// Time at which the heartbeat is lost; `None` before the first one.
    missed: Option<Instant>,
    is_lost: bool,
}

impl Heartbeat {
    /// Restarts the producer by 1017h; its first heartbeat is due after `first`.
    pub(super) fn configure_producer(
        &mut self,
        dictionary: &Dictionary,
        now: Instant,
        first: Duration,
    ) {
        let period = u64::from(dictionary.unsigned(Object::PRODUCER_HEARTBEAT));
        self.period = (period > 0).then_some(Duration::from_millis(period));
        self.next = self.period.map(|_| now + first);
    }

    /// Producer heartbeat time; zero if disabled.
    pub(super) fn period(dictionary: &Dictionary) -> Duration {
        Duration::from_millis(u64::from(dictionary.unsigned(Object::PRODUCER_HEARTBEAT)))
    }

    /// Applies 1016h. Unchanged entries keep their state.
    pub(super) fn configure_consumers(&mut self, dictionary: &Dictionary) {
        let before = std::mem::take(&mut self.consumers);
        self.consumers = entries(dictionary).filter_map(ConsumerEntry::decode).collect();
        for consumer in &mut self.consumers {
            let (cob_id, timeout) = (consumer.cob_id, consumer.timeout);
            let same = |old: &&ConsumerEntry| old.cob_id == cob_id && old.timeout == timeout;
            *consumer = before.iter().find(same).copied().unwrap_or(*consumer);
        }
    }

    /// Restarts after a reset: no heartbeat received.
    pub(super) fn restart(&mut self, dictionary: &Dictionary) {
        self.consumers.clear();
        self.configure_consumers(dictionary);
    }

    /// COB-IDs of the monitored heartbeats.
    pub(super) fn cob_ids(&self) -> impl Iterator<Item = u16> {
        self.consumers.iter().map(|consumer| consumer.cob_id)
    }

    /// Takes a heartbeat; returns whether it is monitored.
    pub(super) fn on_frame(&mut self, now: Instant, frame: &Frame) -> bool {
        let is_heartbeat = frame.data().len() == 1;
        let consumer = self.consumers.iter_mut().find(|consumer| consumer.cob_id == frame.cob_id);
        let Some(consumer) = consumer.filter(|_| is_heartbeat) else { return false };
        consumer.missed = Some(now + consumer.timeout);
        consumer.is_lost = false;
        true
    }

    /// Returns whether a heartbeat was lost since the last call.
    pub(super) fn detect_loss(&mut self, now: Instant) -> bool {
        let mut has_lost = false;
        for consumer in &mut self.consumers {
            let is_lost = consumer.missed.take_if(|missed| *missed <= now).is_some();
            consumer.is_lost |= is_lost;
            has_lost |= is_lost;
        }
        has_lost
    }

    /// Returns whether a monitored heartbeat is lost.
    pub(super) fn is_lost(&self) -> bool {
        self.consumers.iter().any(|consumer| consumer.is_lost)
    }

    /// Returns the own heartbeat if one is due. Missed ones are skipped.
    pub(super) fn due(&mut self, now: Instant, node: NodeId, state: NmtState) -> Option<Frame> {
        let (on_time, period) = (self.next.filter(|next| *next <= now)?, self.period?);
        let on_beat = on_time + period;
        self.next = Some(if on_beat > now { on_beat } else { now + period });
        Some(Frame::new(heartbeat_cob_id(node), encode_heartbeat(state)))
    }

    /// Time of the next heartbeat, or of the next loss.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.consumers.iter().map(|consumer| consumer.missed).fold(self.next, earlier)
    }
}

impl ConsumerEntry {
    /// Decodes an entry of 1016h; `None` without a time or without a node-id of 1 to 127.
    fn decode(raw: u32) -> Option<Self> {
        let [low, high, node, _] = raw.to_le_bytes();
        let millis = u64::from(u16::from_le_bytes([low, high]));
        let cob_id = heartbeat_cob_id(NodeId::new(node).ok()?);
        let timeout = Duration::from_millis(millis);
        (millis > 0).then_some(Self { cob_id, timeout, missed: None, is_lost: false })
    }
}

/// Entries of 1016h.
fn entries(dictionary: &Dictionary) -> impl Iterator<Item = u32> {
    subs(dictionary).map(|object| dictionary.unsigned(object))
}

fn subs(dictionary: &Dictionary) -> impl Iterator<Item = Object> {
    let objects = (1..=127).map(|sub| Object { sub, ..Object::CONSUMER_HEARTBEAT });
    objects.take_while(|object| dictionary.entry(*object).is_some())
}

/// Checks a write to an entry of 1016h.
///
/// # Errors
/// Returns an abort code if reserved bits are set, or if another entry already monitors the node.
pub(super) fn check_entry(
    dictionary: &Dictionary,
    object: Object,
    raw: u32,
) -> Result<(), AbortCode> {
    if raw >> 24 != 0 {
        return Err(AbortCode::VALUE_INVALID);
    }
    let Some(consumer) = ConsumerEntry::decode(raw) else { return Ok(()) };
    let others = subs(dictionary).filter(|other| *other != object);
    let mut entries = others.filter_map(|other| ConsumerEntry::decode(dictionary.unsigned(other)));
    if entries.any(|other| other.cob_id == consumer.cob_id) {
        return Err(AbortCode::PARAMETER_INCOMPATIBLE);
    }
    Ok(())
}
