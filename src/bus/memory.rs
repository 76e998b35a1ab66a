//! The in-memory bus that *is* the clock: waiting on it makes time pass, and everything attached to it
//! lives in that time. The same inputs give the same outputs, bit for bit.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering;
use std::time::Duration;

use crate::Bus;
use crate::BusEvent;
use crate::BusFault;
use crate::Received;
use crate::ReopenError;
use crate::SendError;
use crate::Tap;
use crate::clock;
use crate::disturbance::Adapter;
use crate::disturbance::Agenda;
use crate::disturbance::Disturbance;
use crate::disturbance::HostFault;
use crate::disturbance::Taken;
use crate::wire::Sender;
use crate::wire::Wire;
use canopen::frame::Channel;
use canopen::frame::Telegram;
use canopen::station::Station;
use canopen::sync;
use units::time::Instant;

/// The node's frames that may wait on one bus: about a cycle's worth.
const QUEUE: usize = 32;

/// Frames that wait to be fetched at most, as in a socket's buffer; later ones are lost.
const BACKLOG: usize = 238;

/// 1 January 1984, since 1970.
const BEGINNING: Duration = Duration::from_secs(441_763_200);

/// Nanoseconds in a microsecond.
const MICRO: u64 = 1_000;

/// Buses in memory, with stations `S` attached and a tap `T` that sees every frame complete.
#[derive(Clone, Debug)]
pub struct Memory<S, T> {
    now_ns: u64,
    wires: Vec<Wire>,
    /// The node's, one for each wire.
    adapters: Vec<Adapter>,
    stations: S,
    tap: T,
    /// What has reached the node and was not yet fetched.
    arrived: VecDeque<Received>,
    /// Frames were lost since the last that arrived.
    has_overrun: bool,
    agenda: Agenda,
    /// Until when the process stands still.
    stopped_until_ns: u64,
    /// The identifier of the frame after which the process stands still, and for how long.
    stops_after: Option<(u16, Duration)>,
    suspended: Duration,
    /// What the clock on the wall showed at time zero.
    epoch: Duration,
    out: Vec<Telegram>,
    /// What the monotonic clock showed at time zero, where time is not to run faster than it.
    paced_from: Option<Duration>,
    /// Readable by others while a node has the bus.
    watch: Option<Watch>,
}

/// Time of a memory bus, readable while a node has the bus.
#[derive(Clone, Debug)]
pub struct Watch(Arc<AtomicU64>);

impl Watch {
    /// Time on the bus.
    pub fn now(&self) -> Instant {
        Instant::from_micros(self.0.load(Ordering::Relaxed) / MICRO)
    }
}

impl<S: Station, T: Tap> Memory<S, T> {
    /// One bus for each bit rate, in bit/s.
    pub fn new(bitrates: &[u32], stations: S, tap: T) -> Self {
        Self {
            now_ns: 0,
            wires: bitrates.iter().copied().map(Wire::new).collect(),
            adapters: bitrates.iter().map(|_| Adapter::new()).collect(),
            stations,
            tap,
            arrived: VecDeque::with_capacity(BACKLOG + 1),
            has_overrun: false,
            agenda: Agenda::default(),
            stopped_until_ns: 0,
            stops_after: None,
            suspended: Duration::ZERO,
            epoch: BEGINNING,
            out: Vec::with_capacity(64),
            paced_from: None,
            watch: None,
        }
    }

    /// Shows the time to whoever keeps the watch, until [`unwatch`](Self::unwatch).
    pub fn watch(&mut self) -> Watch {
        let watch = Watch(Arc::new(AtomicU64::new(self.now_ns)));
        self.watch = Some(watch.clone());
        watch
    }

    /// Shows the time to others no longer.
    pub fn unwatch(&mut self) {
        self.watch = None;
    }

    /// The same, but no faster than the clock on the wall.
    #[must_use]
    pub fn in_real_time(self) -> Self {
        Self { paced_from: Some(clock::monotonic()), ..self }
    }

    /// All that is attached.
    pub const fn stations(&self) -> &S {
        &self.stations
    }

    /// All that is attached, to change it between cycles.
    pub const fn stations_mut(&mut self) -> &mut S {
        &mut self.stations
    }

    /// Who is shown every frame.
    pub const fn tap(&self) -> &T {
        &self.tap
    }

    /// Who is shown every frame, to tell it something.
    pub const fn tap_mut(&mut self) -> &mut T {
        &mut self.tap
    }

    /// What each bus has carried so far: frames, and the bits they took.
    pub fn carried(&self) -> impl Iterator<Item = (u64, u64)> + '_ {
        self.wires.iter().map(|wire| (wire.frames, wire.bits))
    }

    /// From now on this is wrong with a bus; `None` heals it. A channel that is none is let be.
    pub fn disturb(&mut self, channel: Channel, wrong: Option<Disturbance>) {
        let (at, place) = (self.now(), usize::from(channel.0));
        let (Some(adapter), Some(wire)) = (self.adapters.get_mut(place), self.wires.get_mut(place))
        else {
            return;
        };
        for held in adapter.disturb(wrong) {
            self.arrived.push_back(Received { at, ..held });
        }
        wire.node_is_cut = !adapter.is_sending();
        if adapter.take() != Ok(Taken::Queued) {
            wire.forget_node();
        }
        if let Some(Disturbance::Fault(fault)) = wrong {
            self.arrived.push_back(Received { at, channel, event: BusEvent::Fault(fault) });
        }
        self.post();
    }

    /// Lets a host_fault come at `at`, at whatever phase of a cycle that is.
    pub fn plan(&mut self, at: Instant, host_fault: HostFault) {
        self.agenda.plan(at, host_fault);
    }

    /// What was planned for now happens.
    fn befall(&mut self) {
        while let Some(host_fault) = self.agenda.due(self.now()) {
            match host_fault {
                HostFault::Bus(channel, wrong) => self.disturb(channel, wrong),
                HostFault::Stopped(time) => self.stand_still(time),
                HostFault::StoppedAfter(cob_id, time) => self.stops_after = Some((cob_id, time)),
                HostFault::Suspended(time) => {
                    self.suspended += time;
                    self.stand_still(time);
                }
                HostFault::ClockSet(wall) => {
                    self.epoch = wall.saturating_sub(Duration::from_nanos(self.now_ns));
                }
            }
        }
    }

    fn stand_still(&mut self, time: Duration) {
        let time_ns = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        self.stopped_until_ns = self.now_ns.saturating_add(time_ns);
    }

    /// The process has sent or read a frame: lets time pass if it stands still after this one.
    fn pass(&mut self, cob_id: u16) {
        let Some((_, time)) = self.stops_after.take_if(|(after, _)| *after == cob_id) else {
            return;
        };
        self.stand_still(time);
        while self.now_ns < self.stopped_until_ns {
            self.befall();
            self.advance(self.next(self.stopped_until_ns));
        }
    }

    /// Lets time pass until `next_ns`, and happen what happens then.
    fn advance(&mut self, next_ns: u64) {
        self.now_ns = next_ns;
        if let Some(Watch(watch)) = &self.watch {
            watch.store(next_ns, Ordering::Relaxed);
        }
        if let Some(zero) = self.paced_from {
            clock::wait(zero + Duration::from_nanos(next_ns));
        }
        self.deliver();
        let now = self.now();
        if self.stations.deadline().is_some_and(|due| due <= now) {
            self.stations.on_time(now, &mut self.out);
            self.post();
            if self.stations.deadline().is_some_and(|due| due <= now) {
                // A station that is never done does not stop time.
                self.now_ns = (self.now_ns / MICRO + 1) * MICRO;
            }
        }
    }

    /// The next moment at which something happens, `until` at the latest.
    fn next(&self, until_ns: u64) -> u64 {
        let wires = self.wires.iter().filter_map(Wire::done);
        let planned = [self.stations.deadline(), self.agenda.next()].into_iter().flatten();
        let planned = planned.map(|due| due.as_micros() * MICRO);
        wires.chain(planned).fold(until_ns, u64::min).max(self.now_ns)
    }

    /// Hands every frame that is complete now to all who did not send it.
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
                adapter.witness(at);
            }
            if sender == Sender::Station && !frame.is_remote() {
                let event = BusEvent::Frame(frame);
                let received = Received { at, channel: telegram.channel, event };
                match adapter.hear(received) {
                    Some(received) if self.arrived.len() < BACKLOG => {
                        if std::mem::take(&mut self.has_overrun) {
                            let event = BusEvent::Fault(BusFault::Overrun);
                            self.arrived.push_back(Received { event, ..received });
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

    /// Puts what the stations send on the wires, and lets idle wires begin.
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

    /// What has arrived and belongs to a wait that ends at `until`.
    fn fetch(&mut self, until: Instant) -> Option<Received> {
        let is_awake = self.now_ns >= self.stopped_until_ns;
        let first = self.arrived.front()?;
        if is_awake && first.at <= until { self.arrived.pop_front() } else { None }
    }
}

impl<S: Station, T: Tap> Bus for Memory<S, T> {
    fn now(&self) -> Instant {
        Instant::from_micros(self.now_ns / MICRO)
    }

    /// As if everything had begun at midnight of the first day of CANopen's calendar.
    fn wall(&self) -> Duration {
        self.epoch + Duration::from_nanos(self.now_ns)
    }

    fn suspended(&self) -> Duration {
        self.suspended
    }

    fn transmit_confirmed_at(&self, Channel(place): Channel) -> Option<Instant> {
        self.adapters.get(usize::from(place)).map(Adapter::transmit_confirmed_at)
    }

    fn send(&mut self, telegram: Telegram) -> Result<(), SendError> {
        let Channel(place) = telegram.channel;
        let place = usize::from(place);
        let wire = self.wires.get_mut(place).ok_or(SendError::Down)?;
        let adapter = self.adapters.get(place).ok_or(SendError::Down)?;
        let taken = adapter.take()?;
        if taken == Taken::Queued && wire.waiting() >= QUEUE {
            return Err(SendError::Full);
        }
        let at = Instant::from_micros(self.now_ns / MICRO);
        self.tap.on_taken(at, &telegram);
        if taken == Taken::Lost {
            return Ok(());
        }
        wire.offer(Sender::Node, telegram.frame);
        wire.begin(self.now_ns);
        self.pass(telegram.frame.cob_id);
        Ok(())
    }

    fn receive(&mut self, until: Instant) -> Option<Received> {
        loop {
            self.befall();
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

    fn reopen(&mut self) -> Result<(), ReopenError> {
        self.arrived.clear();
        let mut adapters = (0..).zip(&self.adapters);
        match adapters.find(|(_, adapter)| adapter.take() == Err(SendError::Down)) {
            Some((place, _)) => Err(ReopenError::Gone(Channel(place))),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::bits;
    use canopen::frame::Frame;

    /// Answers every SYNC with three frames, the highest identifier first.
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
        let mut heard = Vec::new();
        while let Some(received) = bus.receive(Instant::from_micros(10_000)) {
            let BusEvent::Frame(frame) = received.event else { panic!("no fault was made") };
            heard.push((received.at, frame.cob_id));
        }
        heard
    }

    #[test]
    fn the_lowest_identifier_goes_first() {
        let order: Vec<_> = run(1_000_000).into_iter().map(|(_, id)| id).collect();
        assert_eq!(order, [0x181, 0x182, 0x183]);
    }

    #[test]
    fn frames_follow_each_other_by_their_exact_length() {
        let answer = |id| u64::from(bits::exact(&Frame::new(id, [1, 2, 3])));
        let mut done = u64::from(bits::exact(&sync().frame));
        for (at, id) in run(1_000_000) {
            done += answer(id);
            assert_eq!(at.as_micros(), done);
        }
    }

    #[test]
    fn half_the_bit_rate_takes_twice_the_time() {
        let slow = run(500_000);
        for ((fast, _), (slow, _)) in run(1_000_000).into_iter().zip(slow) {
            assert_eq!(slow.as_micros(), 2 * fast.as_micros());
        }
    }

    #[test]
    fn waiting_makes_exactly_that_time_pass() {
        let mut bus = Memory::new(&[1_000_000], Answering, ());
        let until = bus.now() + Duration::from_micros(12_345);
        assert_eq!(bus.receive(until), None);
        assert_eq!(bus.now(), until);
    }

    #[test]
    fn the_nodes_queue_holds_about_a_cycle_and_no_more() {
        let mut bus = Memory::new(&[1_000_000], Answering, ());
        let taken = (0..100).take_while(|_| bus.send(sync()).is_ok()).count();
        assert_eq!(taken, QUEUE + 1, "one is on the wire");
        assert_eq!(bus.send(sync()), Err(SendError::Full));
    }

    #[test]
    fn a_station_that_is_never_done_does_not_stop_time() {
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
