//! A device's own heartbeat (1017h) and its watch over the master's (1016h:1): CiA 301, 7.2.8.3.2.
//!
//! The watch begins with the first heartbeat it hears, so a master that never spoke is never missed.

use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::NodeId;
use canopen_rs::nmt::encode_heartbeat;
use canopen_rs::nmt::heartbeat_cob_id;

use crate::canopen::dictionary::Dictionary;
use crate::canopen::frame::Frame;
use crate::canopen::object::Object;
use crate::time::Instant;

/// Both directions.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Heartbeat {
    period: Option<Duration>,
    next: Option<Instant>,
    master: Option<Master>,
    missed: Option<Instant>,
}

/// Whose heartbeat is watched, and how long it may stay away.
#[derive(Clone, Copy, Debug)]
struct Master {
    cob_id: u16,
    timeout: Duration,
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

    /// The watch begins anew, with the first heartbeat that is heard.
    pub(super) fn watch(&mut self, dictionary: &Dictionary) {
        self.missed = None;
        self.master = watched(dictionary.unsigned(Object::CONSUMER_HEARTBEAT))
            .map(|(node, timeout)| Master { cob_id: heartbeat_cob_id(node), timeout });
    }

    /// Whether the frame is the heartbeat that is watched for.
    pub(super) fn on_frame(&mut self, now: Instant, frame: &Frame) -> bool {
        let Some(master) = self.master.filter(|master| master.cob_id == frame.cob_id) else {
            return false;
        };
        let is_heartbeat = frame.data().len() == 1;
        if is_heartbeat {
            self.missed = Some(now + master.timeout);
        }
        is_heartbeat
    }

    /// Whether the master has been silent for too long. Said once.
    pub(super) fn is_lost(&mut self, now: Instant) -> bool {
        self.missed.take_if(|missed| *missed <= now).is_some()
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
        self.next.into_iter().chain(self.missed).min()
    }
}

/// Whose heartbeat an entry of 1016h asks to watch, and how long it may stay away; `None` for nobody's.
fn watched(raw: u32) -> Option<(NodeId, Duration)> {
    let [low, high, node, _] = raw.to_le_bytes();
    let millis = u64::from(u16::from_le_bytes([low, high]));
    let node = NodeId::new(node).ok()?;
    (millis > 0).then_some((node, Duration::from_millis(millis)))
}

/// Whether an entry of 1016h names somebody, or clearly nobody.
pub(super) fn is_valid(raw: u32) -> bool {
    let [.., node, reserved] = raw.to_le_bytes();
    reserved == 0 && node <= 127
}
