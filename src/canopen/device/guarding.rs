//! A device that is guarded (CiA 301, 7.2.8.2.1): it answers its master's remote frame, and guards it in
//! turn by waiting for the next one (100Ch × 100Dh).
//!
//! A device with a heartbeat is not guarded; the watch begins with the first question it hears.

use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::NodeId;
use canopen_rs::nmt::encode_heartbeat;
use canopen_rs::nmt::heartbeat_cob_id;

use crate::dictionary::Dictionary;
use crate::frame::Frame;
use crate::object::Object;
use units::time::Instant;

/// The toggle bit, and the watch over whoever asks.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Guarding {
    toggle: u8,
    missed: Option<Instant>,
    is_lost: bool,
}

impl Guarding {
    /// As after a reset: the first toggle bit is 0, and nobody has asked.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }

    /// The watch begins anew with the next question: its time has changed, or a heartbeat takes its place.
    pub(super) const fn forget(&mut self) {
        self.missed = None;
        self.is_lost = false;
    }

    /// The answer to a remote frame, if it is a question of error control and the device answers those.
    pub(super) fn answer(
        &mut self,
        now: Instant,
        question: &Frame,
        node: NodeId,
        state: NmtState,
        dictionary: &Dictionary,
    ) -> Option<Frame> {
        let cob_id = heartbeat_cob_id(node);
        let has_heartbeat = dictionary.unsigned(Object::PRODUCER_HEARTBEAT) > 0;
        if question.cob_id != cob_id || has_heartbeat || !dictionary.has_index(GUARD_TIME) {
            return None;
        }
        self.missed = life_time(dictionary).map(|life_time| now + life_time);
        self.is_lost = false;
        let [state] = encode_heartbeat(state);
        let answer = Frame::new(cob_id, [state | self.toggle]);
        self.toggle ^= TOGGLE;
        Some(answer)
    }

    /// Whether nobody has asked for too long, since this was asked last.
    pub(super) fn loses(&mut self, now: Instant) -> bool {
        let loses = self.missed.take_if(|missed| *missed <= now).is_some();
        self.is_lost |= loses;
        loses
    }

    /// Whether nobody asks any more.
    pub(super) const fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// When the next question will be overdue.
    pub(super) const fn deadline(&self) -> Option<Instant> {
        self.missed
    }
}

const GUARD_TIME: u16 = Object::GUARD_TIME.index;

/// The bit that alternates.
const TOGGLE: u8 = 0x80;

/// Guard time by life time factor; `None` while either is zero.
fn life_time(dictionary: &Dictionary) -> Option<Duration> {
    let guard_time = dictionary.unsigned(Object::GUARD_TIME);
    let factor = dictionary.unsigned(Object::LIFE_TIME_FACTOR);
    let millis = u64::from(guard_time) * u64::from(factor);
    (millis > 0).then_some(Duration::from_millis(millis))
}
