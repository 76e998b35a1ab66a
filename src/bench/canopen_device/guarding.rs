//! Guarding of a device (CiA 301, 7.2.8.2.1): it answers its master's remote frames, and detects a lost master
//! by their absence (life guarding, 100Ch × 100Dh).
//!
//! A device with a heartbeat is not guarded. Life guarding starts with the first poll.

use std::time::Duration;

use canopen_rs::nmt::{encode_heartbeat, heartbeat_cob_id};
use canopen_rs::{NmtState, NodeId};

use crate::dictionary::Dictionary;
use canopen::frame::Frame;
use canopen::object::Object;
use units::time::Instant;

/// Toggle bit, and life guarding of the master.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Guarding {
    toggle: u8,
    missed: Option<Instant>,
    is_lost: bool,
}

impl Guarding {
    /// Restarts after a reset: toggle bit 0, no poll received.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }

    /// Restarts life guarding at the next poll, after a change of its time or of the heartbeat.
    pub(super) const fn forget(&mut self) {
        self.missed = None;
        self.is_lost = false;
    }

    /// Answers a remote frame, if it polls this device and the device is guarded.
    pub(super) fn answer(
        &mut self,
        now: Instant,
        poll: &Frame,
        node: NodeId,
        state: NmtState,
        dictionary: &Dictionary,
    ) -> Option<Frame> {
        let cob_id = heartbeat_cob_id(node);
        let has_heartbeat = dictionary.unsigned(Object::PRODUCER_HEARTBEAT) > 0;
        if poll.cob_id != cob_id || has_heartbeat || !dictionary.has_index(GUARD_TIME) {
            return None;
        }
        self.missed = life_time(dictionary).map(|life_time| now + life_time);
        self.is_lost = false;
        let [state] = encode_heartbeat(state);
        let answer = Frame::new(cob_id, [state | self.toggle]);
        self.toggle ^= TOGGLE;
        Some(answer)
    }

    /// Returns whether the life time has expired since the last call.
    pub(super) fn detect_loss(&mut self, now: Instant) -> bool {
        let is_expired = self.missed.take_if(|missed| *missed <= now).is_some();
        self.is_lost |= is_expired;
        is_expired
    }

    /// Returns whether the master is lost.
    pub(super) const fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// Time at which the life time expires.
    pub(super) const fn deadline(&self) -> Option<Instant> {
        self.missed
    }
}

const GUARD_TIME: u16 = Object::GUARD_TIME.index;

/// Toggle bit of an answer.
const TOGGLE: u8 = 0x80;

/// Life time: guard time by life time factor; `None` while either is zero.
fn life_time(dictionary: &Dictionary) -> Option<Duration> {
    let guard_time = dictionary.unsigned(Object::GUARD_TIME);
    let factor = dictionary.unsigned(Object::LIFE_TIME_FACTOR);
    let millis = u64::from(guard_time) * u64::from(factor);
    (millis > 0).then_some(Duration::from_millis(millis))
}
