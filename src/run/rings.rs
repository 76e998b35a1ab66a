//! The way from the cycle's thread to everything that may wait: three rings with one producer each.
//!
//! The cycle's end makes no system call, takes no lock, allocates nothing and never waits: an entry that finds
//! no room is dropped and counted by its kind. One ring holds the order of all entries and the frames
//! themselves, the other two the cycles' records and the network's events, which are a hundred and four times
//! as large as a frame.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering;

use rtrb::Consumer;
use rtrb::Producer;
use rtrb::RingBuffer;

use bus::Tap;
use canopen::frame::Telegram;
use canopen::master::event::Event;
use node::record::Record;
use telemetry::losses::Losses;
use units::time::Instant;

/// Frames that may wait: more than 3 s of two buses at 1 Mbit/s with frames of usual length.
const FRAMES: usize = 1 << 16;

/// Records that may wait: 4 s at 1 kHz.
const RECORDS: usize = 1 << 12;

/// Events that may wait.
const EVENTS: usize = 1 << 10;

/// An entry's place in the order of all; a frame stands there itself.
#[derive(Debug)]
enum Step {
    Frame(Instant, Telegram),
    Record,
    Event,
}

/// What the cycle's thread hands over.
pub trait Entries {
    /// A frame that passed by.
    fn frame(&mut self, at: Instant, telegram: &Telegram);
    /// A cycle.
    fn record(&mut self, record: &Record);
    /// An event on the network.
    fn event(&mut self, event: &Event);
}

/// The cycle's end. It overhears the buses.
#[derive(Debug)]
pub struct Offer {
    order: Producer<Step>,
    records: Producer<Record>,
    events: Producer<Event>,
    lost: Lost,
}

/// The other end, which looks for entries from time to time.
#[derive(Debug)]
pub struct Taker {
    order: Consumer<Step>,
    records: Consumer<Record>,
    events: Consumer<Event>,
}

/// Entries lost so far, counted where they are lost.
#[derive(Clone, Debug, Default)]
pub struct Lost(Arc<Counters>);

#[derive(Debug, Default)]
struct Counters {
    frames: AtomicU64,
    records: AtomicU64,
    events: AtomicU64,
    of_session: AtomicU64,
    of_faults: AtomicU64,
}

impl Lost {
    /// The losses so far.
    pub(super) fn so_far(&self) -> Losses {
        let Counters { frames, records, events, of_session, of_faults } = &*self.0;
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Losses {
            frames: count(frames),
            records: count(records),
            events: count(events),
            of_session: count(of_session),
            of_faults: count(of_faults),
        }
    }

    /// Counts entries that the session's disk was too slow for.
    pub(super) fn of_session(&self, entries: u64) {
        self.0.of_session.fetch_add(entries, Ordering::Relaxed);
    }

    /// Counts entries that the disk of the fault records was too slow for.
    pub(super) fn of_faults(&self, entries: u64) {
        self.0.of_faults.fetch_add(entries, Ordering::Relaxed);
    }
}

/// Both ends, and what is lost between them. All memory is taken here.
pub fn rings() -> (Offer, Taker, Lost) {
    let (order, steps) = RingBuffer::new(FRAMES);
    let (records, recorded) = RingBuffer::new(RECORDS);
    let (events, happened) = RingBuffer::new(EVENTS);
    let lost = Lost::default();
    let offer = Offer { order, records, events, lost: lost.clone() };
    (offer, Taker { order: steps, records: recorded, events: happened }, lost)
}

impl Offer {
    /// Hands over a record.
    pub fn record(&mut self, record: &Record) {
        let is_kept = self.order.slots() > 0 && self.records.push(*record).is_ok();
        // A place that was free stays free: nobody else writes here.
        let is_kept = is_kept && self.order.push(Step::Record).is_ok();
        self.lost.0.records.fetch_add(u64::from(!is_kept), Ordering::Relaxed);
    }

    /// Hands over an event.
    pub(super) fn event(&mut self, event: Event) {
        let is_kept = self.order.slots() > 0 && self.events.push(event).is_ok();
        let is_kept = is_kept && self.order.push(Step::Event).is_ok();
        self.lost.0.events.fetch_add(u64::from(!is_kept), Ordering::Relaxed);
    }
}

impl Tap for Offer {
    fn on_wire(&mut self, at: Instant, telegram: &Telegram) {
        let is_kept = self.order.push(Step::Frame(at, *telegram)).is_ok();
        self.lost.0.frames.fetch_add(u64::from(!is_kept), Ordering::Relaxed);
    }
}

impl Taker {
    /// Returns whether the other end is gone. What it left is still to be taken.
    pub fn is_abandoned(&self) -> bool {
        self.order.is_abandoned()
    }

    /// Takes what waits, oldest first, `most` entries at most; returns how many there were.
    pub fn take(&mut self, most: usize, by: &mut impl Entries) -> usize {
        let waiting = self.order.slots().min(most);
        for _ in 0..waiting {
            match self.order.pop() {
                Ok(Step::Frame(at, telegram)) => by.frame(at, &telegram),
                Ok(Step::Record) => {
                    if let Ok(record) = self.records.peek() {
                        by.record(record);
                    }
                    self.records.pop().ok();
                }
                Ok(Step::Event) => {
                    if let Ok(event) = self.events.pop() {
                        by.event(&event);
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
    use std::path::Path;

    use super::*;
    use canopen::frame::Channel;
    use canopen::frame::Frame;
    use config::Config;
    use lab::bench::Bench;
    use sim::scenario::Scenario;
    use units::numbering::NodeIndex;

    /// Keeps the order of what it takes.
    #[derive(Default)]
    struct Order(Vec<String>);

    impl Entries for Order {
        fn frame(&mut self, at: Instant, _telegram: &Telegram) {
            self.0.push(format!("frame {}", at.as_micros()));
        }

        fn record(&mut self, record: &Record) {
            self.0.push(format!("record {}", record.cycle));
        }

        fn event(&mut self, event: &Event) {
            self.0.push(event.to_string());
        }
    }

    fn sync() -> Telegram {
        Telegram { channel: Channel(0), frame: Frame::new(0x80, []) }
    }

    fn bench<T: Tap>(tap: T) -> Bench<T> {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let script = "seconds = 2\n[[console]]\nat_s = 0.05\nrequest = \"arm\"\n";
        Bench::new(&config, Scenario::parse(script).unwrap(), 1, false, tap)
    }

    #[test]
    fn rings_keep_the_order_of_frames_records_and_events() {
        let (mut offer, mut taker, lost) = rings();
        let record = bench(()).cycle();
        offer.on_wire(Instant::from_micros(1), &sync());
        offer.record(&record);
        offer.event(Event::HeartbeatLost { node: NodeIndex(0) });
        offer.on_wire(Instant::from_micros(2), &sync());
        offer.record(&Record { cycle: 7, ..record });
        let mut order = Order::default();
        assert_eq!(taker.take(4, &mut order), 4);
        assert_eq!(taker.take(usize::MAX, &mut order), 1);
        let first = format!("record {}", record.cycle);
        let event = Event::HeartbeatLost { node: NodeIndex(0) }.to_string();
        assert_eq!(order.0, ["frame 1", &first, &event, "frame 2", "record 7"]);
        assert_eq!(lost.so_far(), Losses::default());
        assert!(!taker.is_abandoned());
        drop(offer);
        assert!(taker.is_abandoned());
    }

    #[test]
    fn full_rings_drop_entries_and_count_them_by_kind() {
        let (mut offer, mut taker, lost) = rings();
        let record = bench(()).cycle();
        for cycle in 0..5_000 {
            offer.record(&Record { cycle, ..record });
        }
        for micros in 0..70_000 {
            offer.on_wire(Instant::from_micros(micros), &sync());
        }
        for _ in 0..3 {
            offer.event(Event::HeartbeatLost { node: NodeIndex(0) });
            offer.record(&record);
        }
        let (frames, records) = (70_000 - (65_536 - 4_096), 5_000 - 4_096 + 3);
        assert_eq!(lost.so_far(), Losses { frames, records, events: 3, ..Losses::default() });
        let mut order = Order::default();
        assert_eq!(taker.take(usize::MAX, &mut order), 65_536);
        assert_eq!((order.0[0].as_str(), order.0[4_095].as_str()), ("record 0", "record 4095"));
        // What comes later stands in its place again: nothing is left behind in a ring.
        offer.record(&Record { cycle: 9, ..record });
        offer.on_wire(Instant::from_micros(9), &sync());
        taker.take(usize::MAX, &mut order);
        assert_eq!(order.0[65_536..], ["record 9", "frame 9"]);
    }

    #[test]
    fn rings_fit_into_fifteen_megabytes() {
        let order = FRAMES * size_of::<Step>();
        let records = RECORDS * size_of::<Record>();
        let events = EVENTS * size_of::<Event>();
        let sum = order + records + events;
        assert!(size_of::<Step>() <= 24, "{} bytes a frame", size_of::<Step>());
        assert!(sum <= 15_000_000, "{order} + {records} + {events} bytes");
    }

    /// The torques of so many cycles, arm carried, while the other end does as it likes.
    fn torques(tap: impl Tap, cycles: usize) -> Vec<(Instant, [i16; 6])> {
        let mut bench = bench(tap);
        bench.bring_up().unwrap();
        (0..cycles).map(|_| bench.cycle()).map(|record| (record.at, record.targets)).collect()
    }

    #[test]
    fn promise_13_a_recorder_that_hangs_or_is_gone_changes_no_torque() {
        let alone = torques((), 10_000);
        assert!(alone.iter().any(|(_, targets)| targets.iter().any(|target| *target != 0)));
        let (hanging, taker, lost) = rings();
        assert_eq!(torques(hanging, 10_000), alone);
        assert!(lost.so_far().frames > 0, "its ring was full");
        drop(taker);
        let (orphan, taker, _) = rings();
        drop(taker);
        assert_eq!(torques(orphan, 300), alone[..300]);
    }
}
