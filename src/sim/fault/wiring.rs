//! Frames on their way between a device and its bus.

use std::mem;
use std::time::Duration;

use crate::fault::Faults;
use crate::fault::breakable::Breakable;
use crate::fault::breakable::Way;
use crate::fault::held::Late;
use crate::scenario::fault::Treatment;
use canopen::frame::Frame;
use canopen::frame::Telegram;
use units::numbering::NodeIndex;
use units::time::Instant;

/// What has become of a frame.
#[derive(Clone, Copy, Debug)]
struct Passing {
    frame: Frame,
    copies: usize,
    by: Duration,
    may_be_overtaken: bool,
}

impl Faults {
    /// Lets the device at `place` hear what is on a bus.
    pub fn hear(
        &mut self,
        now: Instant,
        place: NodeIndex,
        device: &mut dyn Breakable,
        heard: Telegram,
        out: &mut Vec<Telegram>,
    ) {
        if self.is_idle() {
            device.on_frame(now, heard.channel, &heard.frame, out);
        } else if heard.channel == device.channel() {
            let mut passed = mem::take(&mut self.passed);
            self.pass(now, device, (place, Way::Heard), heard, &mut passed);
            for telegram in passed.drain(..) {
                self.let_hear(now, place, device, &telegram, out);
            }
            self.passed = passed;
        }
    }

    /// Lets the device at `place` do what is due.
    pub fn wake(
        &mut self,
        now: Instant,
        place: NodeIndex,
        device: &mut dyn Breakable,
        out: &mut Vec<Telegram>,
    ) {
        if self.is_idle() {
            device.on_time(now, out);
        } else {
            let mut said = mem::take(&mut self.said);
            device.on_time(now, &mut said);
            self.say(now, place, device, &mut said, out);
            self.said = said;
        }
    }

    /// Whether nothing is broken, and nothing late.
    fn is_idle(&self) -> bool {
        self.running.is_empty() && self.held.is_empty()
    }

    /// Whether the device at `place` is off its bus.
    pub(super) fn is_cut_off(&self, place: NodeIndex) -> bool {
        self.running.iter().any(|running| running.is_cut_off(place))
    }

    /// The device hears what has passed.
    pub(super) fn let_hear(
        &mut self,
        now: Instant,
        place: NodeIndex,
        device: &mut dyn Breakable,
        heard: &Telegram,
        out: &mut Vec<Telegram>,
    ) {
        let mut said = mem::take(&mut self.said);
        device.on_frame(now, heard.channel, &heard.frame, &mut said);
        self.say(now, place, device, &mut said, out);
        self.said = said;
    }

    /// What a device says goes to its bus.
    fn say(
        &mut self,
        now: Instant,
        place: NodeIndex,
        device: &dyn Breakable,
        said: &mut Vec<Telegram>,
        out: &mut Vec<Telegram>,
    ) {
        for telegram in said.drain(..) {
            self.pass(now, device, (place, Way::Said), telegram, out);
            let again = self.running.iter().filter_map(|running| running.again(place, &telegram));
            out.extend(again);
        }
    }

    /// Lets a frame pass, or what the faults make of it.
    pub(super) fn pass(
        &mut self,
        now: Instant,
        device: &dyn Breakable,
        (place, way): (NodeIndex, Way),
        telegram: Telegram,
        to: &mut Vec<Telegram>,
    ) {
        if self.is_cut_off(place) {
            return;
        }
        let Some(passing) = self.treat(device, (place, way), telegram.frame) else { return };
        let Passing { frame, copies, by, may_be_overtaken } = passing;
        let telegram = Telegram { frame, ..telegram };
        let before = self.held.before(place, way, frame.cob_id).filter(|_| !may_be_overtaken);
        let due = before.map_or(now + by, |before| before.max(now + by));
        for _ in 0..copies {
            if due > now {
                self.held.keep(Late { due, place, way, telegram, may_be_overtaken });
            } else {
                to.push(telegram);
            }
        }
    }

    /// What the faults make of a frame; `None` if it is lost.
    fn treat(
        &mut self,
        device: &dyn Breakable,
        (place, way): (NodeIndex, Way),
        frame: Frame,
    ) -> Option<Passing> {
        let mut passing = Passing { frame, copies: 1, by: Duration::ZERO, may_be_overtaken: false };
        for running in &mut self.running {
            match running.strike(device, place, way, &frame) {
                None => {}
                Some(Treatment::Drop) => return None,
                Some(Treatment::Duplicate) => passing.copies += 1,
                Some(Treatment::Delay { by, reorders }) => {
                    passing.by += by;
                    passing.may_be_overtaken |= reorders;
                }
                Some(Treatment::Corrupt(xor)) => passing.frame = turned_over(passing.frame, xor),
                Some(Treatment::Freeze) => {
                    passing.frame = running.first(place, way, passing.frame);
                }
                Some(Treatment::Resize(bytes)) => passing.frame = resized(passing.frame, bytes),
            }
        }
        Some(passing)
    }
}

/// With some bits of its data turned over.
fn turned_over(frame: Frame, xor: [u8; 8]) -> Frame {
    let mut bytes = bytes(&frame);
    for (byte, bits) in bytes.iter_mut().zip(xor) {
        *byte ^= bits;
    }
    with_bytes(frame, bytes, frame.data().len())
}

/// Cut off, or filled with zeros.
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

/// With other data; a frame that asks for data has none.
fn with_bytes(frame: Frame, bytes: [u8; 8], length: usize) -> Frame {
    let data = bytes.get(..length).filter(|_| !frame.is_remote());
    data.and_then(|data| Frame::from_slice(frame.cob_id, data)).unwrap_or(frame)
}
