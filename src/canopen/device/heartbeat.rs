//! A device's own heartbeat (1017h) and its watch over those of others (1016h): CiA 301, 7.2.8.3.2.
//!
//! A watch begins with the first heartbeat it hears, so a master that never spoke is never missed.

use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::NodeId;
use canopen_rs::nmt::encode_heartbeat;
use canopen_rs::nmt::heartbeat_cob_id;

use crate::abort::AbortCode;
use crate::dictionary::Dictionary;
use crate::frame::Frame;
use crate::object::Object;
use units::time::Instant;

/// Both directions.
#[derive(Clone, Debug, Default)]
pub(super) struct Heartbeat {
    period: Option<Duration>,
    next: Option<Instant>,
    watches: Vec<Watch>,
}

/// Whose heartbeat is watched, and how long it may stay away.
#[derive(Clone, Copy, Debug)]
struct Watch {
    cob_id: u16,
    timeout: Duration,
    /// When it will have stayed away for too long, once it has been heard.
    missed: Option<Instant>,
    is_lost: bool,
}

impl Heartbeat {
    /// Its own begins anew, `first` being the first one.
    pub(super) fn produce(&mut self, dictionary: &Dictionary, now: Instant, first: Duration) {
        let period = u64::from(dictionary.unsigned(Object::PRODUCER_HEARTBEAT));
        self.period = (period > 0).then_some(Duration::from_millis(period));
        self.next = self.period.map(|_| now + first);
    }

    /// The period of its own, zero if there is none.
    pub(super) fn period(dictionary: &Dictionary) -> Duration {
        Duration::from_millis(u64::from(dictionary.unsigned(Object::PRODUCER_HEARTBEAT)))
    }

    /// Watches whom the dictionary says. A watch that is there already goes on.
    pub(super) fn watch(&mut self, dictionary: &Dictionary) {
        let before = std::mem::take(&mut self.watches);
        self.watches = entries(dictionary).filter_map(Watch::of).collect();
        for watch in &mut self.watches {
            let (cob_id, timeout) = (watch.cob_id, watch.timeout);
            let same = |old: &&Watch| old.cob_id == cob_id && old.timeout == timeout;
            *watch = before.iter().find(same).copied().unwrap_or(*watch);
        }
    }

    /// After a reset: nobody has been heard.
    pub(super) fn restart(&mut self, dictionary: &Dictionary) {
        self.watches.clear();
        self.watch(dictionary);
    }

    /// Whether the frame is a heartbeat that is watched for.
    pub(super) fn on_frame(&mut self, now: Instant, frame: &Frame) -> bool {
        let is_heartbeat = frame.data().len() == 1;
        let heard = self.watches.iter_mut().find(|watch| watch.cob_id == frame.cob_id);
        let Some(watch) = heard.filter(|_| is_heartbeat) else { return false };
        watch.missed = Some(now + watch.timeout);
        watch.is_lost = false;
        true
    }

    /// Whether one has stayed away for too long since this was asked last.
    pub(super) fn loses(&mut self, now: Instant) -> bool {
        let mut loses = false;
        for watch in &mut self.watches {
            let is_lost = watch.missed.take_if(|missed| *missed <= now).is_some();
            watch.is_lost |= is_lost;
            loses |= is_lost;
        }
        loses
    }

    /// Whether one that was heard once stays away.
    pub(super) fn is_lost(&self) -> bool {
        self.watches.iter().any(|watch| watch.is_lost)
    }

    /// Its own, if one is due. Missed ones are not made up for.
    pub(super) fn due(&mut self, now: Instant, node: NodeId, state: NmtState) -> Option<Frame> {
        let (on_time, period) = (self.next.filter(|next| *next <= now)?, self.period?);
        let on_beat = on_time + period;
        self.next = Some(if on_beat > now { on_beat } else { now + period });
        Some(Frame::new(heartbeat_cob_id(node), encode_heartbeat(state)))
    }

    /// When one of the two is due.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.next.into_iter().chain(self.watches.iter().filter_map(|watch| watch.missed)).min()
    }
}

impl Watch {
    /// What an entry of 1016h asks for; `None` for nothing: without a time, or a node-id of 1 to 127.
    fn of(raw: u32) -> Option<Self> {
        let [low, high, node, _] = raw.to_le_bytes();
        let millis = u64::from(u16::from_le_bytes([low, high]));
        let cob_id = heartbeat_cob_id(NodeId::new(node).ok()?);
        let timeout = Duration::from_millis(millis);
        (millis > 0).then_some(Self { cob_id, timeout, missed: None, is_lost: false })
    }
}

/// The entries of 1016h.
fn entries(dictionary: &Dictionary) -> impl Iterator<Item = u32> {
    subs(dictionary).map(|object| dictionary.unsigned(object))
}

fn subs(dictionary: &Dictionary) -> impl Iterator<Item = Object> {
    let objects = (1..=127).map(|sub| Object { sub, ..Object::CONSUMER_HEARTBEAT });
    objects.take_while(|object| dictionary.entry(*object).is_some())
}

/// Whether an entry of 1016h may become `raw`.
///
/// # Errors
/// When reserved bits are set, or another entry watches the same node already.
pub(super) fn may_watch(
    dictionary: &Dictionary,
    object: Object,
    raw: u32,
) -> Result<(), AbortCode> {
    if raw >> 24 != 0 {
        return Err(AbortCode::VALUE_INVALID);
    }
    let Some(watch) = Watch::of(raw) else { return Ok(()) };
    let others = subs(dictionary).filter(|other| *other != object);
    let mut watched = others.filter_map(|other| Watch::of(dictionary.unsigned(other)));
    if watched.any(|other| other.cob_id == watch.cob_id) {
        return Err(AbortCode::PARAMETER_INCOMPATIBLE);
    }
    Ok(())
}
