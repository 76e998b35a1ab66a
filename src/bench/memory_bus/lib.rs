//! Bus in memory that is also the clock: waiting on it advances time for all stations. Equal inputs give equal outputs, bit
//! for bit.
#![forbid(unsafe_code)]

mod disturbance;
mod wire;

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::disturbance::{Adapter, Change, FrameFate, Schedule, Stop, reported};
use crate::wire::{Sender, Wire};
use bus::{Bus, BusError, BusEvent, ReceivedEvent, ReopenError, SendError, Tap, Wake, clock};
use canopen::frame::{Channel, Telegram};
use canopen::master::event::Event;
use canopen::sync;
use canopen_device::station::Station;
use faults::{Disturbance, Fault};
use units::time::Instant;

/// Maximum frames in the node's transmit queue: about one cycle.
const MAX_QUEUED: usize = 32;

/// Maximum received frames not yet read, as in a socket's buffer; later ones are lost.
const MAX_UNREAD: usize = 238;

/// Initial wall clock: 1 January 1984, the epoch of CANopen's TIME (CiA 301, 7.1.6.5), since 1970.
const CANOPEN_EPOCH: Duration = Duration::from_secs(441_763_200);

/// Nanoseconds in a microsecond.
const MICRO: u64 = 1_000;

/// Buses in memory with stations `S`, observed by `T`.
#[derive(Clone, Debug)]
pub struct Memory<S, T> {
    now_ns: u64,
    wires: Vec<Wire>,
    /// Node's adapter of each bus.
    adapters: Vec<Adapter>,
    stations: S,
    tap: T,
    /// Events received by the node and not yet read.
    arrived: VecDeque<ReceivedEvent>,
    /// Frames were lost since the last received one.
    has_overrun: bool,
    schedule: Schedule,
    /// End of the time in which the process is stopped.
    stopped_until_ns: u64,
    /// COB-ID of the frame after which the process stops, and the duration of the stop.
    stops_after: Option<(u16, Stop)>,
    suspended: Duration,
    /// Wall clock at time zero.
    epoch: Duration,
    out: Vec<Telegram>,
    /// Upper bound of the speed of virtual time.
    pace: Option<Pace>,
    /// Copy of the time for other threads.
    shared_time: Option<SharedTime>,
}

/// Bound of the speed of a bus.
#[derive(Clone, Copy, Debug)]
struct Pace {
    /// Host clock at time zero.
    zero: Duration,
    /// Seconds of the bus in a second of the host; positive.
    speed: f64,
}

/// Time of a memory bus, for other threads.
#[derive(Clone, Debug)]
pub struct SharedTime(Arc<AtomicU64>);

impl SharedTime {
    /// Returns the time of the bus.
    pub fn now(&self) -> Instant {
        Instant::from_micros(self.0.load(Ordering::Relaxed) / MICRO)
    }
}

impl<S: Station, T: Tap> Memory<S, T> {
    /// Creates one bus for each bit rate, in bit/s.
    pub fn new(bitrates: &[u32], stations: S, tap: T) -> Self {
        Self {
            now_ns: 0,
            wires: bitrates.iter().copied().map(Wire::new).collect(),
            adapters: bitrates.iter().map(|_| Adapter::new()).collect(),
            stations,
            tap,
            arrived: VecDeque::with_capacity(MAX_UNREAD + 1),
            has_overrun: false,
            schedule: Schedule::default(),
            stopped_until_ns: 0,
            stops_after: None,
            suspended: Duration::ZERO,
            epoch: CANOPEN_EPOCH,
            out: Vec::with_capacity(64),
            pace: None,
            shared_time: None,
        }
    }

    /// Publishes the time, until [`stop_sharing_time`](Self::stop_sharing_time).
    pub fn share_time(&mut self) -> SharedTime {
        let shared_time = SharedTime(Arc::new(AtomicU64::new(self.now_ns)));
        self.shared_time = Some(shared_time.clone());
        shared_time
    }

    /// Stops publishing the time.
    pub fn stop_sharing_time(&mut self) {
        self.shared_time = None;
    }

    /// Lets at most `speed` seconds pass in a second of the wall clock: 1 is real time.
    #[must_use]
    pub fn at_speed(self, speed: f64) -> Self {
        Self { pace: Some(Pace { zero: clock::monotonic(), speed }), ..self }
    }

    /// Returns the devices on the buses.
    pub const fn stations(&self) -> &S {
        &self.stations
    }

    /// Returns the stations, to change them between cycles.
    pub const fn stations_mut(&mut self) -> &mut S {
        &mut self.stations
    }

    /// Returns the observer.
    pub const fn tap(&self) -> &T {
        &self.tap
    }

    /// Returns the observer, to change it.
    pub const fn tap_mut(&mut self) -> &mut T {
        &mut self.tap
    }

    /// Returns the frames and bits transmitted on each bus.
    pub fn carried(&self) -> impl Iterator<Item = (u64, u64)> + '_ {
        self.wires.iter().map(|wire| (wire.frames, wire.bits))
    }

    /// Disturbs a bus from now on; `None` ends it. An unknown channel is ignored.
    pub fn disturb(&mut self, channel: Channel, disturbance: Option<Disturbance>) {
        let (at, place) = (self.now(), usize::from(channel.0));
        let (Some(adapter), Some(wire)) = (self.adapters.get_mut(place), self.wires.get_mut(place))
        else {
            return;
        };
        for held in adapter.disturb(disturbance) {
            self.arrived.push_back(ReceivedEvent { at, ..held });
        }
        wire.node_is_cut = !adapter.is_sending();
        if adapter.take() != Ok(FrameFate::Queued) {
            wire.forget_node();
        }
        if let Some(error) = disturbance.and_then(reported) {
            self.arrived.push_back(ReceivedEvent { at, channel, event: BusEvent::Error(error) });
        }
        self.post();
    }

    /// Schedules a fault of a bus or of the host, at any phase of a cycle; `zero` is the first SYNC. Faults of devices
    /// are the stations'.
    pub fn inject(&mut self, zero: Instant, fault: &Fault) {
        self.schedule.add_fault(zero, fault);
    }

    /// Applies the changes whose time has come.
    fn apply_changes(&mut self) {
        while let Some(change) = self.schedule.due(self.now()) {
            match change {
                Change::Bus(channel, disturbance) => self.disturb(channel, disturbance),
                Change::Stop(stop) => self.stop_process(stop),
                Change::StopAfter(cob_id, stop) => self.stops_after = Some((cob_id, stop)),
                Change::SetClock(wall) => {
                    self.epoch = wall.saturating_sub(Duration::from_nanos(self.now_ns));
                }
            }
        }
    }

    fn stop_process(&mut self, Stop { span, is_suspension }: Stop) {
        if is_suspension {
            self.suspended += span;
        }
        let time_ns = u64::try_from(span.as_nanos()).unwrap_or(u64::MAX);
        self.stopped_until_ns = self.now_ns.saturating_add(time_ns);
    }

    /// Stops the process if this frame triggers a stop.
    fn pass(&mut self, cob_id: u16) {
        let Some((_, stop)) = self.stops_after.take_if(|(after, _)| *after == cob_id) else {
            return;
        };
        self.stop_process(stop);
        while self.now_ns < self.stopped_until_ns {
            self.apply_changes();
            self.advance(self.next(self.stopped_until_ns));
        }
    }

    /// Advances time to `next_ns`, and delivers the frames and events of that time.
    fn advance(&mut self, next_ns: u64) {
        self.now_ns = next_ns;
        if let Some(SharedTime(shared_time)) = &self.shared_time {
            shared_time.store(next_ns, Ordering::Relaxed);
        }
        if let Some(Pace { zero, speed }) = self.pace {
            clock::wait(zero + Duration::from_nanos(next_ns).div_f64(speed));
        }
        self.deliver();
        let now = self.now();
        if self.stations.deadline().is_some_and(|due| due <= now) {
            self.stations.on_time(now, &mut self.out);
            self.post();
            if self.stations.deadline().is_some_and(|due| due <= now) {
                // Time must advance even if a station's deadline never does.
                self.now_ns = (self.now_ns / MICRO + 1) * MICRO;
            }
        }
    }

    /// Returns the time of the next event, at most `until`.
    fn next(&self, until_ns: u64) -> u64 {
        let wires = self.wires.iter().filter_map(Wire::done);
        let planned = [self.stations.deadline(), self.schedule.next()].into_iter().flatten();
        let planned = planned.map(|due| due.as_micros() * MICRO);
        wires.chain(planned).fold(until_ns, u64::min).max(self.now_ns)
    }

    /// Delivers complete frames to all receivers.
    fn deliver(&mut self) {
        for ((place, wire), adapter) in (0..).zip(&mut self.wires).zip(&mut self.adapters) {
            let Some((sender, frame)) = wire.complete(self.now_ns) else { continue };
            let at = Instant::from_micros(self.now_ns / MICRO);
            let telegram = Telegram { channel: Channel(place), frame };
            match sender {
                Sender::Node => self.tap.on_sent(at, &telegram),
                Sender::Station => self.tap.on_wire(at, &telegram),
            }
            self.stations.on_frame(at, telegram.channel, &frame, &mut self.out);
            if frame.cob_id == sync::COB_ID {
                adapter.confirm_transmit(at);
            }
            if sender == Sender::Station && !frame.is_remote() {
                let event = BusEvent::Frame(frame);
                let received = ReceivedEvent { at, channel: telegram.channel, event };
                match adapter.receive(received) {
                    Some(received) if self.arrived.len() < MAX_UNREAD => {
                        if std::mem::take(&mut self.has_overrun) {
                            let event = BusEvent::Error(BusError::Overrun);
                            self.arrived.push_back(ReceivedEvent { event, ..received });
                        }
                        self.arrived.push_back(received);
                    }
                    Some(_) => self.has_overrun = true,
                    None => {}
                }
            }
        }
        self.post();
    }

    /// Queues the frames of the stations, and starts transmissions.
    fn post(&mut self) {
        for Telegram { channel: Channel(place), frame } in self.out.drain(..) {
            if let Some(wire) = self.wires.get_mut(usize::from(place)) {
                wire.offer(Sender::Station, frame);
            }
        }
        for (wire, adapter) in self.wires.iter_mut().zip(&self.adapters) {
            if let Some(frame) = adapter.flood() {
                wire.flood(frame);
            }
            wire.begin(self.now_ns);
        }
    }

    /// Returns the next received event up to `until`, unless the process is stopped.
    fn fetch(&mut self, until: Instant) -> Option<ReceivedEvent> {
        let is_running = self.now_ns >= self.stopped_until_ns;
        let first = self.arrived.front()?;
        if is_running && first.at <= until { self.arrived.pop_front() } else { None }
    }
}

impl<S: Station, T: Tap> Bus for Memory<S, T> {
    fn now(&self) -> Instant {
        Instant::from_micros(self.now_ns / MICRO)
    }

    /// Returns the wall clock as if time zero were the CANopen epoch, unless it was set.
    fn wall(&self) -> Duration {
        self.epoch + Duration::from_nanos(self.now_ns)
    }

    fn suspended(&self) -> Duration {
        self.suspended
    }

    fn transmit_confirmed_at(&mut self, Channel(place): Channel) -> Option<Instant> {
        self.adapters.get(usize::from(place)).map(Adapter::transmit_confirmed_at)
    }

    fn send_at(&mut self, _: Instant, telegram: Telegram) -> Result<(), SendError> {
        let Channel(place) = telegram.channel;
        let place = usize::from(place);
        let wire = self.wires.get_mut(place).ok_or(SendError::Down)?;
        let adapter = self.adapters.get(place).ok_or(SendError::Down)?;
        let taken = adapter.take()?;
        if taken == FrameFate::Queued && wire.waiting() >= MAX_QUEUED {
            return Err(SendError::Full);
        }
        let at = Instant::from_micros(self.now_ns / MICRO);
        self.tap.on_taken(at, &telegram);
        if taken == FrameFate::Lost {
            return Ok(());
        }
        wire.offer(Sender::Node, telegram.frame);
        wire.begin(self.now_ns);
        self.pass(telegram.frame.cob_id);
        Ok(())
    }

    fn wait(&mut self, _: Instant, from: Instant, until: Instant) -> Wake {
        self.pass_time(from.min(until));
        let received = self.next_received(until);
        Wake { now: self.now(), received }
    }

    fn reopen(&mut self) -> Result<(), ReopenError> {
        self.arrived.clear();
        let mut adapters = (0..).zip(&self.adapters);
        match adapters.find(|(_, adapter)| adapter.take() == Err(SendError::Down)) {
            Some((place, _)) => Err(ReopenError::Gone(Channel(place))),
            None => Ok(()),
        }
    }

    fn report(&mut self, at: Instant, event: Event) -> Option<Event> {
        self.tap.on_event(at, event)
    }
}

impl<S: Station, T: Tap> Memory<S, T> {
    /// Lets time pass until `until`, whatever is received.
    fn pass_time(&mut self, until: Instant) {
        let until_ns = until.as_micros() * MICRO;
        while self.now_ns < until_ns {
            self.apply_changes();
            self.advance(self.next(until_ns));
        }
    }

    /// Lets time pass until the next event, until `until` at the latest.
    fn next_received(&mut self, until: Instant) -> Option<ReceivedEvent> {
        loop {
            self.apply_changes();
            if let Some(received) = self.fetch(until) {
                if let BusEvent::Frame(frame) = received.event {
                    self.pass(frame.cob_id);
                }
                return Some(received);
            }
            let until_ns = (until.as_micros() * MICRO).max(self.stopped_until_ns);
            let next = self.next(until_ns);
            if next >= until_ns && self.now_ns >= until_ns {
                return None;
            }
            self.advance(next);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::bits;
    use canopen::frame::Frame;

    /// Answers each SYNC with three frames, the highest identifier first.
    #[derive(Debug, Default)]
    struct Answering;

    impl Station for Answering {
        fn on_frame(
            &mut self,
            _: Instant,
            channel: Channel,
            frame: &Frame,
            out: &mut Vec<Telegram>,
        ) {
            if frame.cob_id == 0x80 {
                let answers = [0x183, 0x182, 0x181].map(|id| Frame::new(id, [1, 2, 3]));
                out.extend(answers.map(|frame| Telegram { channel, frame }));
            }
        }

        fn on_time(&mut self, _: Instant, _: &mut Vec<Telegram>) {}

        fn deadline(&self) -> Option<Instant> {
            None
        }
    }

    fn sync() -> Telegram {
        Telegram { channel: Channel(0), frame: Frame::new(0x80, []) }
    }

    fn run(bitrate: u32) -> Vec<(Instant, u16)> {
        let mut bus = Memory::new(&[bitrate], Answering, ());
        bus.send(sync()).unwrap();
        let mut frames = Vec::new();
        while let Some(received) = bus.receive(Instant::from_micros(10_000)) {
            let BusEvent::Frame(frame) = received.event else { panic!("no error was made") };
            frames.push((received.at, frame.cob_id));
        }
        frames
    }

    #[test]
    fn lowest_identifier_wins_arbitration() {
        let order: Vec<_> = run(1_000_000).into_iter().map(|(_, id)| id).collect();
        assert_eq!(order, [0x181, 0x182, 0x183]);
    }

    #[test]
    fn frames_take_their_exact_length() {
        let answer = |id| u64::from(bits::exact(&Frame::new(id, [1, 2, 3])));
        let mut done = u64::from(bits::exact(&sync().frame));
        for (at, id) in run(1_000_000) {
            done += answer(id);
            assert_eq!(at.as_micros(), done);
        }
    }

    #[test]
    fn half_the_bit_rate_doubles_the_time() {
        let slow = run(500_000);
        for ((fast, _), (slow, _)) in run(1_000_000).into_iter().zip(slow) {
            assert_eq!(slow.as_micros(), 2 * fast.as_micros());
        }
    }

    #[test]
    fn waiting_advances_time_exactly() {
        let mut bus = Memory::new(&[1_000_000], Answering, ());
        let until = bus.now() + Duration::from_micros(12_345);
        assert_eq!(bus.receive(until), None);
        assert_eq!(bus.now(), until);
    }

    #[test]
    fn transmit_queue_is_bounded() {
        let mut bus = Memory::new(&[1_000_000], Answering, ());
        let taken = (0..100).take_while(|_| bus.send(sync()).is_ok()).count();
        assert_eq!(taken, MAX_QUEUED + 1, "one is on the wire");
        assert_eq!(bus.send(sync()), Err(SendError::Full));
    }

    #[test]
    fn station_that_is_always_due_does_not_stop_time() {
        struct Restless;
        impl Station for Restless {
            fn on_frame(&mut self, _: Instant, _: Channel, _: &Frame, _: &mut Vec<Telegram>) {}
            fn on_time(&mut self, _: Instant, _: &mut Vec<Telegram>) {}
            fn deadline(&self) -> Option<Instant> {
                Some(Instant::ZERO)
            }
        }
        let mut bus = Memory::new(&[1_000_000], Restless, ());
        assert_eq!(bus.receive(Instant::from_micros(50)), None);
    }
}
