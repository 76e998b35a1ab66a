//! Faults that the [`Memory`](crate::Memory) applies at any time: those of adapter and driver, of the process, and of the
//! host's clocks. The simulation applies faults of devices.

use std::collections::VecDeque;
use std::time::Duration;

use bus::{BusError, ReceivedEvent, SendError};
use canopen::frame::{Channel, Frame};
use faults::{Disturbance, Fault, FaultKind, HostFault, Target};
use units::time::Instant;

/// Maximum number of frames that a stalled adapter keeps; later ones are lost.
const MAX_HELD: usize = 32;

/// Change of a bus or of the host at a virtual time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    /// Disturbance of a bus; `None` ends it.
    Bus(Channel, Option<Disturbance>),
    /// Stop of the process.
    Stop(Stop),
    /// Stop of the process after the next frame with this COB-ID.
    StopAfter(u16, Stop),
    /// New time of the wall clock, since 1970.
    SetClock(Duration),
}

/// Time for which the process does not run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stop {
    pub(super) span: Duration,
    /// Set if the host is suspended.
    pub(super) is_suspension: bool,
}

/// Changes to come, the earliest first.
#[derive(Clone, Debug, Default)]
pub(super) struct Schedule(Vec<(Instant, Change)>);

impl Schedule {
    /// Adds the changes of a fault; `zero` is the first SYNC. Faults of devices are ignored.
    pub(super) fn add_fault(&mut self, zero: Instant, fault: &Fault) {
        let at = zero + fault.start;
        if let (FaultKind::Bus(disturbance), Target::Bus(channel)) = (fault.kind, fault.target) {
            self.add(at, Change::Bus(channel, Some(disturbance)));
            if let Some(duration) = fault.duration {
                self.add(at + duration, Change::Bus(channel, None));
            }
        }
        if let FaultKind::Host(host) = fault.kind {
            let span = fault.duration.unwrap_or_default();
            let stop = |is_suspension| Stop { span, is_suspension };
            let change = match host {
                HostFault::ProcessStopped => Change::Stop(stop(false)),
                HostFault::ProcessStoppedAfter(cob_id) => Change::StopAfter(cob_id, stop(false)),
                HostFault::Suspended(None) => Change::Stop(stop(true)),
                HostFault::Suspended(Some(cob_id)) => Change::StopAfter(cob_id, stop(true)),
                HostFault::ClockSet(wall) => Change::SetClock(wall),
            };
            self.add(at, change);
        }
    }

    /// Adds a change, behind those of the same moment.
    fn add(&mut self, at: Instant, change: Change) {
        let place = self.0.partition_point(|(planned, _)| *planned <= at);
        self.0.insert(place, (at, change));
    }

    /// Returns the time of the next change.
    pub(super) fn next(&self) -> Option<Instant> {
        self.0.first().map(|(at, _)| *at)
    }

    /// Takes the next change if its time has come.
    pub(super) fn due(&mut self, now: Instant) -> Option<Change> {
        self.next().filter(|at| *at <= now)?;
        Some(self.0.remove(0).1)
    }
}

/// Node's adapter to one bus, and its disturbance.
#[derive(Clone, Debug)]
pub(super) struct Adapter {
    disturbance: Option<Disturbance>,
    held: VecDeque<ReceivedEvent>,
    confirmed_at: Instant,
}

/// State of a frame that the adapter has accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FrameFate {
    /// Accepted frame that waits for the wire.
    Queued,
    /// Accepted frame that never reaches the wire.
    Lost,
}

impl Adapter {
    /// Adapter without a disturbance.
    pub(super) fn new() -> Self {
        Self {
            disturbance: None,
            held: VecDeque::with_capacity(MAX_HELD),
            confirmed_at: Instant::ZERO,
        }
    }

    /// Sets the disturbance, and returns the frames that were held back until now.
    pub(super) fn disturb(
        &mut self,
        disturbance: Option<Disturbance>,
    ) -> impl Iterator<Item = ReceivedEvent> + '_ {
        self.disturbance = disturbance;
        self.held.drain(..)
    }

    /// Returns the fate of a frame of the node.
    pub(super) const fn take(&self) -> Result<FrameFate, SendError> {
        match self.disturbance {
            Some(Disturbance::QueueFull) => Err(SendError::Full),
            Some(Disturbance::InterfaceDown | Disturbance::AdapterUnplugged) => {
                Err(SendError::Down)
            }
            Some(Disturbance::AdapterStuck | Disturbance::BusOff) => Ok(FrameFate::Lost),
            Some(
                Disturbance::AdapterStalled
                | Disturbance::Flood(_)
                | Disturbance::ErrorPassive
                | Disturbance::ErrorWarning,
            )
            | None => Ok(FrameFate::Queued),
        }
    }

    /// Returns whether queued frames are transmitted.
    pub(super) const fn is_sending(&self) -> bool {
        !matches!(self.disturbance, Some(Disturbance::AdapterStalled))
    }

    /// Passes a received frame to the node, keeps it until the adapter goes on, or loses it.
    pub(super) fn receive(&mut self, received: ReceivedEvent) -> Option<ReceivedEvent> {
        match (self.disturbance, self.take()) {
            (Some(Disturbance::AdapterStalled), _) => {
                if self.held.len() < MAX_HELD {
                    self.held.push_back(received);
                }
                None
            }
            (_, Ok(FrameFate::Lost) | Err(SendError::Down)) => None,
            (_, Ok(FrameFate::Queued) | Err(SendError::Full)) => Some(received),
        }
    }

    /// Records that a SYNC is complete on the wire, unless the adapter receives nothing.
    pub(super) fn confirm_transmit(&mut self, at: Instant) {
        let is_deaf = matches!(self.take(), Ok(FrameFate::Lost) | Err(SendError::Down));
        if self.is_sending() && !is_deaf {
            self.confirmed_at = at;
        }
    }

    /// Returns the time of the last SYNC that was seen on the wire.
    pub(super) const fn transmit_confirmed_at(&self) -> Instant {
        self.confirmed_at
    }

    /// Returns the frame with which another node floods the bus.
    pub(super) const fn flood(&self) -> Option<Frame> {
        if let Some(Disturbance::Flood(frame)) = self.disturbance { Some(frame) } else { None }
    }
}

/// Returns the report of controller or driver at the start of a disturbance.
pub(super) const fn reported(disturbance: Disturbance) -> Option<BusError> {
    match disturbance {
        Disturbance::BusOff => Some(BusError::Off),
        Disturbance::ErrorPassive => Some(BusError::Passive),
        Disturbance::ErrorWarning => Some(BusError::Warning),
        Disturbance::AdapterUnplugged => Some(BusError::Down),
        Disturbance::QueueFull
        | Disturbance::AdapterStuck
        | Disturbance::AdapterStalled
        | Disturbance::InterfaceDown
        | Disturbance::Flood(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Memory;
    use bus::{Bus, BusEvent};
    use canopen::frame::Telegram;
    use canopen_device::station::Station;

    const CHANNEL: Channel = Channel(0);

    /// Repeats every frame with the next COB-ID, so that a sent frame has an answer.
    struct Echo;

    impl Station for Echo {
        fn on_frame(
            &mut self,
            _: Instant,
            channel: Channel,
            frame: &Frame,
            out: &mut Vec<Telegram>,
        ) {
            if frame.cob_id.is_multiple_of(2) {
                out.push(Telegram { channel, frame: Frame::new(frame.cob_id + 1, []) });
            }
        }

        fn on_time(&mut self, _: Instant, _: &mut Vec<Telegram>) {}

        fn deadline(&self) -> Option<Instant> {
            None
        }
    }

    fn bus() -> Memory<Echo, ()> {
        Memory::new(&[1_000_000], Echo, ())
    }

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    fn send(bus: &mut Memory<Echo, ()>, cob_id: u16) -> Result<(), SendError> {
        bus.send(Telegram { channel: CHANNEL, frame: Frame::new(cob_id, []) })
    }

    /// COB-IDs received until `until`, and the bus errors.
    fn received(bus: &mut Memory<Echo, ()>, until: u64) -> (Vec<u16>, Vec<BusError>) {
        let (mut ids, mut errors) = (Vec::new(), Vec::new());
        while let Some(received) = bus.receive(at(until)) {
            match received.event {
                BusEvent::Frame(frame) => ids.push(frame.cob_id),
                BusEvent::Error(error) => errors.push(error),
            }
        }
        (ids, errors)
    }

    #[test]
    fn bus_off_sends_and_receives_nothing_until_its_end() {
        let mut bus = bus();
        bus.disturb(CHANNEL, Some(Disturbance::BusOff));
        assert_eq!(send(&mut bus, 2), Ok(()), "accepted all the same");
        assert_eq!(received(&mut bus, 1_000), (vec![], vec![BusError::Off]));
        bus.disturb(CHANNEL, None);
        send(&mut bus, 4).unwrap();
        assert_eq!(received(&mut bus, 2_000), (vec![5], vec![]), "accepted frames are lost");
    }

    #[test]
    fn stalled_adapter_delivers_its_queue_at_the_end() {
        let mut bus = bus();
        bus.disturb(CHANNEL, Some(Disturbance::AdapterStalled));
        let taken = (0..100).take_while(|_| send(&mut bus, 2).is_ok()).count();
        assert_eq!((taken, send(&mut bus, 2)), (32, Err(SendError::Full)));
        assert_eq!(received(&mut bus, 5_000), (vec![], vec![]));
        bus.disturb(CHANNEL, None);
        assert_eq!(received(&mut bus, 20_000).0.len(), 32);
    }

    #[test]
    fn disturbance_fails_as_its_driver_does() {
        for (wrong, sent, answered) in [
            (Disturbance::QueueFull, Err(SendError::Full), false),
            (Disturbance::InterfaceDown, Err(SendError::Down), false),
            (Disturbance::AdapterUnplugged, Err(SendError::Down), false),
            (Disturbance::AdapterStuck, Ok(()), false),
            (Disturbance::ErrorPassive, Ok(()), true),
        ] {
            let mut bus = bus();
            bus.disturb(CHANNEL, Some(wrong));
            assert_eq!(send(&mut bus, 2), sent, "{wrong:?}");
            assert_eq!(!received(&mut bus, 1_000).0.is_empty(), answered, "{wrong:?}");
            bus.disturb(CHANNEL, None);
            assert_eq!((send(&mut bus, 2), received(&mut bus, 2_000).0), (Ok(()), vec![3]));
        }
    }

    #[test]
    fn flood_that_wins_the_arbitration_blocks_all_others() {
        let mut bus = bus();
        bus.disturb(CHANNEL, Some(Disturbance::Flood(Frame::new(1, []))));
        send(&mut bus, 2).unwrap();
        let (ids, _) = received(&mut bus, 10_000);
        assert!(ids.len() > 150 && ids.iter().all(|id| *id == 1), "{ids:?}");
        bus.disturb(CHANNEL, None);
        assert!(received(&mut bus, 11_000).0.contains(&3), "the frame is sent after the flood");
    }

    #[test]
    fn stopped_process_finds_the_oldest_frames_and_an_overrun() {
        let mut bus = bus();
        bus.disturb(CHANNEL, Some(Disturbance::Flood(Frame::new(1, []))));
        let start = Duration::from_micros(300);
        let stop = Fault::of_host(start, HostFault::ProcessStopped, Duration::from_millis(50));
        bus.inject(Instant::ZERO, &stop);
        assert!(!received(&mut bus, 1_000).0.is_empty(), "those before the stop");
        assert_eq!(bus.now(), at(50_300));
        let oldest = bus.receive(at(60_000)).unwrap();
        assert!(oldest.at < at(1_200), "{oldest:?}");
        let (_, errors) = received(&mut bus, 60_000);
        assert_eq!(errors, [BusError::Overrun]);
    }

    #[test]
    fn faults_start_and_end_in_the_middle_of_a_wait() {
        let mut bus = bus();
        let off = Fault::of_bus(Duration::from_micros(500), CHANNEL, Disturbance::BusOff);
        bus.inject(Instant::ZERO, &off.lasting(Duration::from_micros(200)));
        let first = bus.receive(at(1_000)).unwrap();
        assert_eq!((first.at, first.event), (at(500), BusEvent::Error(BusError::Off)));
        assert_eq!(bus.receive(at(1_000)), None);
        send(&mut bus, 2).unwrap();
        assert_eq!(received(&mut bus, 2_000).0, [3]);
    }

    #[test]
    fn set_wall_clock_leaves_the_time_on_the_bus() {
        let mut bus = bus();
        let set = FaultKind::Host(HostFault::ClockSet(Duration::from_secs(7)));
        bus.inject(Instant::ZERO, &Fault::new(Duration::from_micros(500), Target::Host, set));
        assert_eq!(bus.receive(at(1_500)), None);
        assert_eq!((bus.now(), bus.wall()), (at(1_500), Duration::from_micros(7_001_000)));
    }
}
