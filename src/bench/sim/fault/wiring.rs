//! Transmission of frames between a device and its bus, with faults.

use std::mem;
use std::time::Duration;

use crate::fault::Faults;
use crate::fault::breakable::{Breakable, Direction};
use crate::fault::delay_queue::DelayedFrame;
use canopen::frame::{Frame, Telegram};
use faults::Effect;
use units::numbering::NodeIndex;
use units::time::Instant;

/// Frame after the faults.
#[derive(Clone, Copy, Debug)]
struct Passing {
    frame: Frame,
    copies: usize,
    delay: Duration,
    may_be_overtaken: bool,
}

impl Faults {
    /// Delivers a frame on a bus to the device at `place`. Not necessary while the faults are [idle](Self::is_idle).
    pub fn deliver(
        &mut self,
        now: Instant,
        place: NodeIndex,
        device: &mut dyn Breakable,
        received: Telegram,
        out: &mut Vec<Telegram>,
    ) {
        if self.spare(place) {
            device.on_frame(now, received.channel, &received.frame, out);
        } else if received.channel == device.channel() {
            let mut passed = mem::take(&mut self.passed);
            self.pass(now, device, (place, Direction::ToDevice), received, &mut passed);
            for telegram in passed.drain(..) {
                self.deliver_passed(now, place, device, &telegram, out);
            }
            self.passed = passed;
        }
    }

    /// Calls the device at `place` at its deadline, and sends its frames.
    pub fn wake(
        &mut self,
        now: Instant,
        place: NodeIndex,
        device: &mut dyn Breakable,
        out: &mut Vec<Telegram>,
    ) {
        if self.spare(place) {
            device.on_time(now, out);
        } else {
            let mut sent = mem::take(&mut self.sent);
            device.on_time(now, &mut sent);
            self.send(now, place, device, &mut sent, out);
            self.sent = sent;
        }
    }

    /// Returns whether all frames from and to the device at `place` pass unchanged.
    fn spare(&self, place: NodeIndex) -> bool {
        self.held.is_empty() && !self.running.iter().any(|running| running.changes(place))
    }

    /// Returns whether no fault runs and no frame is delayed.
    pub fn is_idle(&self) -> bool {
        self.running.is_empty() && self.held.is_empty()
    }

    /// Returns whether the device at `place` is disconnected from its bus.
    pub(super) fn is_disconnected(&self, place: NodeIndex) -> bool {
        self.running.iter().any(|running| running.is_disconnected(place))
    }

    /// Delivers a frame to which the faults were already applied.
    pub(super) fn deliver_passed(
        &mut self,
        now: Instant,
        place: NodeIndex,
        device: &mut dyn Breakable,
        received: &Telegram,
        out: &mut Vec<Telegram>,
    ) {
        let mut sent = mem::take(&mut self.sent);
        device.on_frame(now, received.channel, &received.frame, &mut sent);
        self.send(now, place, device, &mut sent, out);
        self.sent = sent;
    }

    /// Sends a device's frames to its bus, with their imitations.
    fn send(
        &mut self,
        now: Instant,
        place: NodeIndex,
        device: &dyn Breakable,
        sent: &mut Vec<Telegram>,
        out: &mut Vec<Telegram>,
    ) {
        for telegram in sent.drain(..) {
            self.pass(now, device, (place, Direction::FromDevice), telegram, out);
            let imitated =
                self.running.iter().filter_map(|running| running.imitated(place, &telegram));
            out.extend(imitated);
        }
    }

    /// Applies the faults to a frame, and appends the result unless it is delayed or lost.
    pub(super) fn pass(
        &mut self,
        now: Instant,
        device: &dyn Breakable,
        (place, direction): (NodeIndex, Direction),
        telegram: Telegram,
        to: &mut Vec<Telegram>,
    ) {
        if self.is_disconnected(place) {
            return;
        }
        let Some(passing) = self.affected(device, (place, direction), telegram.frame) else {
            return;
        };
        let Passing { frame, copies, delay, may_be_overtaken } = passing;
        let telegram = Telegram { frame, ..telegram };
        let before = self.held.before(place, direction, frame.cob_id);
        let before = before.filter(|_| !may_be_overtaken);
        let due = before.map_or(now + delay, |before| before.max(now + delay));
        for _ in 0..copies {
            if due > now {
                self.held.keep(DelayedFrame { due, place, direction, telegram, may_be_overtaken });
            } else {
                to.push(telegram);
            }
        }
    }

    /// Returns a frame with all effects; `None` if it is lost.
    fn affected(
        &mut self,
        device: &dyn Breakable,
        (place, direction): (NodeIndex, Direction),
        frame: Frame,
    ) -> Option<Passing> {
        let mut passing =
            Passing { frame, copies: 1, delay: Duration::ZERO, may_be_overtaken: false };
        for running in &mut self.running {
            match running.effect(device, place, direction, &frame) {
                None => {}
                Some(Effect::Drop) => return None,
                Some(Effect::Duplicate) => passing.copies += 1,
                Some(Effect::Delay { by, reorders }) => {
                    passing.delay += by;
                    passing.may_be_overtaken |= reorders;
                }
                Some(Effect::Corrupt(mask)) => passing.frame = inverted(passing.frame, mask),
                Some(Effect::Freeze) => {
                    passing.frame = running.first(place, direction, passing.frame);
                }
                Some(Effect::Resize(bytes)) => passing.frame = resized(passing.frame, bytes),
            }
        }
        Some(passing)
    }
}

/// Returns the frame with the bits of `mask` inverted.
fn inverted(frame: Frame, mask: [u8; 8]) -> Frame {
    let mut bytes = bytes(&frame);
    for (byte, bits) in bytes.iter_mut().zip(mask) {
        *byte ^= bits;
    }
    with_bytes(frame, bytes, frame.data().len())
}

/// Returns the frame cut off, or filled with zeros.
fn resized(frame: Frame, length: u8) -> Frame {
    with_bytes(frame, bytes(&frame), usize::from(length))
}

fn bytes(frame: &Frame) -> [u8; 8] {
    let mut bytes = [0; 8];
    for (to, from) in bytes.iter_mut().zip(frame.data()) {
        *to = *from;
    }
    bytes
}

/// Returns the frame with other data; a remote frame, which has none, is unchanged.
fn with_bytes(frame: Frame, bytes: [u8; 8], length: usize) -> Frame {
    let data = bytes.get(..length).filter(|_| !frame.is_remote());
    data.and_then(|data| Frame::from_slice(frame.cob_id, data)).unwrap_or(frame)
}
