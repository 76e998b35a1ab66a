//! The PDOs of a device (CiA 301, 7.2.2): which objects go into which frame, and when.
//!
//! A synchronous TPDO is sampled at the SYNC and sent a little later. A synchronous RPDO waits for the
//! *next* SYNC before it acts. Set up anew whenever the dictionary's PDO objects change; after that,
//! nothing is allocated.

use std::time::Duration;

use crate::canopen::device::rules::IDENTIFIER;
use crate::canopen::device::rules::INVALID;
use crate::canopen::device::rules::PdoObject;
use crate::canopen::device::rules::dummy_bits;
use crate::canopen::dictionary::Dictionary;
use crate::canopen::frame::Frame;
use crate::canopen::object::Object;
use crate::canopen::sync::Transmission;
use crate::time::Instant;

/// PDOs of each direction a device may have here.
const MOST: u16 = 8;

/// What a device of ours is told about an RPDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Received {
    /// Its objects have been written.
    Applied,
    /// It acts at the next SYNC.
    Waits,
    /// Shorter than its mapping: not applied.
    TooShort,
}

/// One object of a mapping, by its bytes in the frame.
#[derive(Clone, Copy, Debug)]
struct Field {
    object: Object,
    bytes: usize,
}

/// What both directions have.
#[derive(Clone, Debug)]
struct Shape {
    cob_id: u16,
    transmission: Transmission,
    event_timer: Option<Duration>,
    fields: Vec<Field>,
    bytes: usize,
}

/// A TPDO that exists.
#[derive(Clone, Debug)]
struct Transmit {
    shape: Shape,
    inhibit: Duration,
    /// Sampled, and to be sent then.
    pending: Option<(Instant, Frame)>,
    last: Option<(Instant, Frame)>,
    syncs: u8,
}

/// An RPDO that exists.
#[derive(Clone, Debug)]
struct Receive {
    shape: Shape,
    waiting: Option<Frame>,
    /// When it is overdue; `None` until the first has come.
    due: Option<Instant>,
}

/// All PDOs of a device.
#[derive(Clone, Debug, Default)]
pub(super) struct Pdos {
    transmit: Vec<Transmit>,
    receive: Vec<Receive>,
}

impl Pdos {
    /// As the dictionary says now; what waited is forgotten.
    pub(super) fn of(dictionary: &Dictionary) -> Self {
        let shapes = |is_transmit| {
            (1..=MOST).filter_map(move |number| {
                let pdo = PdoObject { number, is_transmit, is_mapping: false };
                Some((pdo, shape(dictionary, pdo)?))
            })
        };
        let transmit = shapes(true).map(|(pdo, shape)| Transmit {
            shape,
            inhibit: Duration::from_micros(
                u64::from(dictionary.unsigned(pdo.communication(3))) * 100,
            ),
            pending: None,
            last: None,
            syncs: 0,
        });
        let receive = shapes(false).map(|(_, shape)| Receive { shape, waiting: None, due: None });
        Self { transmit: transmit.collect(), receive: receive.collect() }
    }

    /// Takes a frame; `None` if it is no RPDO of this device.
    pub(super) fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        dictionary: &mut Dictionary,
    ) -> Option<Received> {
        let rpdo = self.receive.iter_mut().find(|rpdo| rpdo.shape.cob_id == frame.cob_id)?;
        if frame.data().len() < rpdo.shape.bytes {
            return Some(Received::TooShort);
        }
        rpdo.due = rpdo.shape.event_timer.map(|timer| now + timer);
        if rpdo.shape.transmission.syncs().is_some() {
            rpdo.waiting = Some(*frame);
            return Some(Received::Waits);
        }
        rpdo.shape.write(frame, dictionary);
        Some(Received::Applied)
    }

    /// At a SYNC, first: the RPDOs that waited for it act. Whether there was one.
    pub(super) fn apply(&mut self, dictionary: &mut Dictionary) -> bool {
        let mut acted = false;
        for rpdo in &mut self.receive {
            if let Some(frame) = rpdo.waiting.take() {
                rpdo.shape.write(&frame, dictionary);
                acted = true;
            }
        }
        acted
    }

    /// At a SYNC, second: the TPDOs that belong to it are sampled, and sent after `latency`.
    pub(super) fn sample(&mut self, now: Instant, latency: Duration, dictionary: &Dictionary) {
        for tpdo in &mut self.transmit {
            let frame = tpdo.shape.read(dictionary);
            let is_due = match tpdo.shape.transmission {
                Transmission::SYNC_ON_CHANGE => tpdo.last.is_none_or(|(_, last)| last != frame),
                other => other.syncs().is_some_and(|every| {
                    tpdo.syncs = (tpdo.syncs + 1) % every;
                    tpdo.syncs == 0
                }),
            };
            if is_due {
                tpdo.pending = Some((now + latency, frame));
                tpdo.last = Some((now, frame));
            }
        }
    }

    /// The event-driven TPDOs whose content has changed, or whose timer has run out, become due.
    pub(super) fn refresh(&mut self, now: Instant, dictionary: &Dictionary) {
        for tpdo in &mut self.transmit {
            if tpdo.shape.transmission.syncs().is_some() || tpdo.pending.is_some() {
                continue;
            }
            let frame = tpdo.shape.read(dictionary);
            let due = match tpdo.last {
                None => Some(now),
                Some((at, last)) if last != frame => Some(now.max(at + tpdo.inhibit)),
                Some((at, _)) => {
                    tpdo.shape.event_timer.map(|timer| at + timer).filter(|due| *due <= now)
                }
            };
            tpdo.pending = due.map(|due| (due, frame));
        }
    }

    /// Sends what is due; event-driven ones with what they hold now.
    pub(super) fn send(&mut self, now: Instant, dictionary: &Dictionary, out: &mut Vec<Frame>) {
        for tpdo in &mut self.transmit {
            let Some((_, sampled)) = tpdo.pending.take_if(|(due, _)| *due <= now) else { continue };
            let is_synchronous = tpdo.shape.transmission.syncs().is_some();
            let frame = if is_synchronous { sampled } else { tpdo.shape.read(dictionary) };
            tpdo.last = Some((now, frame));
            out.push(frame);
        }
    }

    /// Whether an RPDO is overdue; said once for each time it stays away.
    pub(super) fn is_overdue(&mut self, now: Instant) -> bool {
        let late = |rpdo: &mut Receive| rpdo.due.take_if(|due| *due <= now).is_some();
        self.receive.iter_mut().filter_map(|rpdo| late(rpdo).then_some(())).count() > 0
    }

    /// When something must be looked at.
    pub(super) fn deadline(&self) -> Option<Instant> {
        let timers = self.transmit.iter().filter(|tpdo| tpdo.shape.transmission.syncs().is_none());
        let timers = timers.filter_map(|tpdo| Some(tpdo.last?.0 + tpdo.shape.event_timer?));
        let pending = self.transmit.iter().filter_map(|tpdo| Some(tpdo.pending?.0));
        let overdue = self.receive.iter().filter_map(|rpdo| rpdo.due);
        timers.chain(pending).chain(overdue).min()
    }
}

impl Shape {
    /// Writes a frame's bytes into the objects they belong to; dummies swallow theirs.
    fn write(&self, frame: &Frame, dictionary: &mut Dictionary) {
        let mut rest = frame.data();
        for field in &self.fields {
            let Some((bytes, behind)) = rest.split_at_checked(field.bytes) else { return };
            rest = behind;
            let in_range =
                dictionary.entry(field.object).is_some_and(|entry| entry.in_range(bytes).is_ok());
            if in_range {
                dictionary.set(field.object, bytes);
            }
        }
    }

    /// The frame that carries what the objects hold now.
    fn read(&self, dictionary: &Dictionary) -> Frame {
        let mut data = [0; 8];
        let mut free = data.iter_mut();
        for field in &self.fields {
            let value = dictionary.get(field.object).unwrap_or_default();
            for (to, from) in free.by_ref().take(field.bytes).zip(value) {
                *to = *from;
            }
        }
        let data = data.get(..self.bytes).unwrap_or_default();
        Frame::from_slice(self.cob_id, data).unwrap_or_else(|| Frame::new(self.cob_id, []))
    }
}

/// How a PDO is set up; `None` if it does not exist.
fn shape(dictionary: &Dictionary, pdo: PdoObject) -> Option<Shape> {
    dictionary.entry(pdo.communication(1))?;
    let cob_id = dictionary.unsigned(pdo.communication(1));
    if cob_id & INVALID != 0 {
        return None;
    }
    let [transmission, ..] = dictionary.unsigned(pdo.communication(2)).to_le_bytes();
    let timer = dictionary.unsigned(pdo.communication(5));
    let event_timer = (timer > 0).then(|| Duration::from_millis(u64::from(timer)));
    let count = dictionary.unsigned(pdo.mapping(0)).min(64);
    let fields: Vec<Field> = (1..=count)
        .filter_map(|sub| {
            let mapped = dictionary.unsigned(pdo.mapping(u8::try_from(sub).ok()?));
            let [bits, sub, i0, i1] = mapped.to_le_bytes();
            let object = Object { index: u16::from_le_bytes([i0, i1]), sub };
            let bits = dummy_bits(object).unwrap_or(bits);
            Some(Field { object, bytes: usize::from(bits.div_ceil(8)) })
        })
        .collect();
    Some(Shape {
        cob_id: u16::try_from(cob_id & IDENTIFIER).ok()?,
        transmission: Transmission(transmission),
        event_timer,
        bytes: fields.iter().map(|field| field.bytes).sum(),
        fields,
    })
}
