//! Lock-free rings from the cycle thread to the recorder thread: three, with one producer and one consumer each.
//!
//! The producer makes no system call, takes no lock, does not allocate and never waits. An entry that does not fit is
//! dropped and counted by its kind. One ring holds the order of all entries, and the frames. The others hold records and
//! events, which are a hundred and four times as large as a frame, respectively.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rtrb::{Consumer, Producer, RingBuffer};

use bus::Tap;
use canopen::frame::Telegram;
use canopen::master::event::Event;
use node::record::Record;
use telemetry::losses::Losses;
use units::time::Instant;

/// Capacity in frames: more than 1.2 s of two buses at 1 Mbit/s with frames of typical length.
const FRAME_CAPACITY: usize = 3 << 13;

/// Capacity in records: 0.69 s at 1 kHz. The memory of all rings is locked, and a record has 2.5 kB.
const RECORD_CAPACITY: usize = 692;

/// Maximum number of events on the network that wait for the recorder thread.
const EVENT_CAPACITY: usize = 1 << 10;

/// Slot of the ring that orders all entries. Frames are stored inline; records and events have separate rings.
#[derive(Debug)]
enum Slot {
    Frame(Instant, Telegram),
    Record,
    Event,
}

/// Handlers of the entries that the cycle thread produces.
pub trait EntryHandler {
    /// Handles a frame that was sent or received `at` this time.
    fn on_frame(&mut self, at: Instant, telegram: &Telegram);
    /// Handles the record of a cycle.
    fn on_record(&mut self, record: &Record);
    /// Handles an event on the network.
    fn on_event(&mut self, event: &Event);
}

/// Producer of entries, owned by the cycle thread. As the [`Tap`] of the buses it also receives every frame.
#[derive(Debug)]
pub struct EntryProducer {
    order: Producer<Slot>,
    records: Producer<Record>,
    events: Producer<Event>,
    /// Set if events are pushed when the node detects them.
    takes_events: bool,
    lost: LossCounters,
}

/// Consumer of entries, which the recorder thread polls.
#[derive(Debug)]
pub struct EntryConsumer {
    order: Consumer<Slot>,
    records: Consumer<Record>,
    events: Consumer<Event>,
}

/// Counters of lost entries, shared by all threads that may drop one.
#[derive(Clone, Debug, Default)]
pub struct LossCounters(Arc<Counters>);

#[derive(Debug, Default)]
struct Counters {
    frames: AtomicU64,
    records: AtomicU64,
    inputs: AtomicU64,
    events: AtomicU64,
    of_session: AtomicU64,
    of_faults: AtomicU64,
}

impl LossCounters {
    /// Returns the losses so far.
    pub fn snapshot(&self) -> Losses {
        let Counters { frames, records, inputs, events, of_session, of_faults } = &*self.0;
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Losses {
            frames: count(frames),
            records: count(records),
            inputs: count(inputs),
            events: count(events),
            of_session: count(of_session),
            of_faults: count(of_faults),
        }
    }

    /// Adds an input that was dropped because the recorder thread was too slow.
    pub(super) fn add_input(&self) {
        self.0.inputs.fetch_add(1, Ordering::Relaxed);
    }

    /// Adds entries that were dropped because the disk of the session was too slow.
    pub(super) fn add_session(&self, entries: u64) {
        self.0.of_session.fetch_add(entries, Ordering::Relaxed);
    }

    /// Adds entries that were dropped because the disk of the fault records was too slow.
    pub(super) fn add_fault_records(&self, entries: u64) {
        self.0.of_faults.fetch_add(entries, Ordering::Relaxed);
    }
}

/// Returns producer, consumer and loss counters. Allocates all memory.
pub fn rings() -> (EntryProducer, EntryConsumer, LossCounters) {
    let (order, order_out) = RingBuffer::new(FRAME_CAPACITY);
    let (records, records_out) = RingBuffer::new(RECORD_CAPACITY);
    let (events, events_out) = RingBuffer::new(EVENT_CAPACITY);
    let lost = LossCounters::default();
    let lost_by_producer = lost.clone();
    let producer =
        EntryProducer { order, records, events, takes_events: true, lost: lost_by_producer };
    (producer, EntryConsumer { order: order_out, records: records_out, events: events_out }, lost)
}

impl EntryProducer {
    /// Pushes the record of a cycle.
    pub fn push_record(&mut self, record: &Record) {
        let is_pushed = self.order.slots() > 0 && self.records.push(*record).is_ok();
        // The free slot is still free, because this is the only producer.
        let is_pushed = is_pushed && self.order.push(Slot::Record).is_ok();
        self.lost.0.records.fetch_add(u64::from(!is_pushed), Ordering::Relaxed);
    }

    /// Sets whether events are pushed when the node detects them, or remain with the node.
    pub(super) const fn takes_events(&mut self, takes_events: bool) {
        self.takes_events = takes_events;
    }

    /// Pushes an event on the network.
    pub(super) fn push_event(&mut self, event: Event) {
        let is_pushed = self.order.slots() > 0 && self.events.push(event).is_ok();
        let is_pushed = is_pushed && self.order.push(Slot::Event).is_ok();
        self.lost.0.events.fetch_add(u64::from(!is_pushed), Ordering::Relaxed);
    }
}

impl Tap for EntryProducer {
    fn on_wire(&mut self, at: Instant, telegram: &Telegram) {
        let is_pushed = self.order.push(Slot::Frame(at, *telegram)).is_ok();
        self.lost.0.frames.fetch_add(u64::from(!is_pushed), Ordering::Relaxed);
    }

    fn on_event(&mut self, _at: Instant, event: Event) -> Option<Event> {
        if !self.takes_events {
            return Some(event);
        }
        self.push_event(event);
        None
    }
}

impl EntryConsumer {
    /// Returns whether the producer was dropped. Its last entries may still be in the rings.
    pub fn is_abandoned(&self) -> bool {
        self.order.is_abandoned()
    }

    /// Passes up to `max` entries to `handler`, oldest first; returns their number.
    pub fn take(&mut self, max: usize, handler: &mut impl EntryHandler) -> usize {
        let waiting = self.order.slots().min(max);
        for _ in 0..waiting {
            match self.order.pop() {
                Ok(Slot::Frame(at, telegram)) => handler.on_frame(at, &telegram),
                Ok(Slot::Record) => {
                    if let Ok(record) = self.records.peek() {
                        handler.on_record(record);
                    }
                    self.records.pop().ok();
                }
                Ok(Slot::Event) => {
                    if let Ok(event) = self.events.pop() {
                        handler.on_event(&event);
                    }
                }
                Err(_) => {}
            }
        }
        waiting
    }
}

#[cfg(test)]
mod tests {
    use std::mem::size_of;

    use super::*;
    use crate::scratch::any_record;
    use canopen::frame::{Channel, Frame};
    use units::numbering::NodeIndex;

    /// Logs the order of the entries.
    #[derive(Default)]
    struct Order(Vec<String>);

    impl EntryHandler for Order {
        fn on_frame(&mut self, at: Instant, _telegram: &Telegram) {
            self.0.push(format!("frame {}", at.as_micros()));
        }

        fn on_record(&mut self, record: &Record) {
            self.0.push(format!("record {}", record.cycle));
        }

        fn on_event(&mut self, event: &Event) {
            self.0.push(event.to_string());
        }
    }

    fn sync() -> Telegram {
        Telegram { channel: Channel(0), frame: Frame::new(0x80, []) }
    }

    #[test]
    fn rings_keep_the_order_of_frames_records_and_events() {
        let (mut producer, mut consumer, lost) = rings();
        let record = any_record();
        producer.on_wire(Instant::from_micros(1), &sync());
        producer.push_record(&record);
        producer.push_event(Event::HeartbeatLost { node: NodeIndex(0) });
        producer.on_wire(Instant::from_micros(2), &sync());
        producer.push_record(&Record { cycle: 7, ..record });
        let mut order = Order::default();
        assert_eq!(consumer.take(4, &mut order), 4);
        assert_eq!(consumer.take(usize::MAX, &mut order), 1);
        let first = format!("record {}", record.cycle);
        let event = Event::HeartbeatLost { node: NodeIndex(0) }.to_string();
        assert_eq!(order.0, ["frame 1", &first, &event, "frame 2", "record 7"]);
        assert_eq!(lost.snapshot(), Losses::default());
        assert!(!consumer.is_abandoned());
        drop(producer);
        assert!(consumer.is_abandoned());
    }

    #[test]
    fn full_rings_drop_entries_and_count_them_by_kind() {
        let (mut producer, mut consumer, lost) = rings();
        let record = any_record();
        for cycle in 0..5_000 {
            producer.push_record(&Record { cycle, ..record });
        }
        for micros in 0..70_000 {
            producer.on_wire(Instant::from_micros(micros), &sync());
        }
        for _ in 0..3 {
            producer.push_event(Event::HeartbeatLost { node: NodeIndex(0) });
            producer.push_record(&record);
        }
        let (frames, records) = (70_000 - (24_576 - 692), 5_000 - 692 + 3);
        assert_eq!(lost.snapshot(), Losses { frames, records, events: 3, ..Losses::default() });
        let mut order = Order::default();
        assert_eq!(consumer.take(usize::MAX, &mut order), 24_576);
        assert_eq!((order.0[0].as_str(), order.0[691].as_str()), ("record 0", "record 691"));
        // Later entries are in order again: no dropped entry has left a record or event in its ring.
        producer.push_record(&Record { cycle: 9, ..record });
        producer.on_wire(Instant::from_micros(9), &sync());
        consumer.take(usize::MAX, &mut order);
        assert_eq!(order.0[24_576..], ["record 9", "frame 9"]);
    }

    #[test]
    fn rings_fit_into_two_and_a_half_megabytes() {
        let order = FRAME_CAPACITY * size_of::<Slot>();
        let records = RECORD_CAPACITY * size_of::<Record>();
        let events = EVENT_CAPACITY * size_of::<Event>();
        let sum = order + records + events;
        assert!(size_of::<Slot>() <= 24, "{} bytes a frame", size_of::<Slot>());
        assert!(sum <= 2_500_000, "{order} + {records} + {events} bytes");
    }
}
