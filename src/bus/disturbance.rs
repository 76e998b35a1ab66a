//! Faults between the node and a [`Memory`](crate::Memory) bus: adapter, driver, process and host clocks. The
//! simulation has the faults of devices.

use std::collections::VecDeque;
use std::time::Duration;

use crate::BusFault;
use crate::Received;
use crate::SendError;
use canopen::frame::Channel;
use canopen::frame::Frame;
use units::time::Instant;

/// Maximum frames that a stalled adapter holds back; later ones are lost.
const MAX_HELD: usize = 32;

/// Fault of one bus, until it is cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disturbance {
    /// The controller reports this once. After `Off` frames are accepted, but none is sent or received; after `Down`
    /// none is accepted; the others have no further effect.
    Fault(BusFault),
    /// The transmit queue is full: no frame is accepted. Reception works.
    Full,
    /// Frames are accepted and lost, none is received: the adapter's firmware has stopped.
    Stuck,
    /// Frames are accepted until the queue is full, none is received. At the end all are sent and received at once, as
    /// by an adapter that stalls.
    Stalled,
    /// No frame is accepted or received, and no fault is reported: the interface is down.
    Down,
    /// Another station sends this frame whenever it wins arbitration.
    Flood(Frame),
}

/// Fault of the host, scheduled at any phase of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostFault {
    /// Sets the fault of a bus; `None` clears it.
    Bus(Channel, Option<Disturbance>),
    /// The process is stopped for this time; its buses are not.
    Stopped(Duration),
    /// The process is stopped right after the next frame with this identifier was sent or read.
    StoppedAfter(u16, Duration),
    /// The host is suspended for this time; its buses are not.
    Suspended(Duration),
    /// The wall clock is set to this time since 1970.
    ClockSet(Duration),
}

/// Scheduled faults, the earliest first.
#[derive(Clone, Debug, Default)]
pub(super) struct Schedule(Vec<(Instant, HostFault)>);

impl Schedule {
    /// Schedules `host_fault`; those of the same time keep their order.
    pub(super) fn add(&mut self, at: Instant, host_fault: HostFault) {
        let place = self.0.partition_point(|(planned, _)| *planned <= at);
        self.0.insert(place, (at, host_fault));
    }

    /// Returns the time of the next fault.
    pub(super) fn next(&self) -> Option<Instant> {
        self.0.first().map(|(at, _)| *at)
    }

    /// Removes and returns the next fault, if it is due.
    pub(super) fn due(&mut self, now: Instant) -> Option<HostFault> {
        self.next().filter(|at| *at <= now)?;
        Some(self.0.remove(0).1)
    }
}

/// Node side of one bus: adapter and its fault.
#[derive(Clone, Debug)]
pub(super) struct Adapter {
    wrong: Option<Disturbance>,
    held: VecDeque<Received>,
    confirmed_at: Instant,
}

/// Fate of an accepted frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// Waits for the wire.
    Queued,
    /// Lost.
    Lost,
}

impl Adapter {
    /// Creates an adapter without fault.
    pub(super) fn new() -> Self {
        Self { wrong: None, held: VecDeque::with_capacity(MAX_HELD), confirmed_at: Instant::ZERO }
    }

    /// Sets the fault, and releases the frames held back so far.
    pub(super) fn disturb(
        &mut self,
        wrong: Option<Disturbance>,
    ) -> impl Iterator<Item = Received> + '_ {
        self.wrong = wrong;
        self.held.drain(..)
    }

    /// Accepts or refuses a frame of the node.
    pub(super) const fn take(&self) -> Result<Taken, SendError> {
        match self.wrong {
            Some(Disturbance::Full) => Err(SendError::Full),
            Some(Disturbance::Down | Disturbance::Fault(BusFault::Down)) => Err(SendError::Down),
            Some(Disturbance::Stuck | Disturbance::Fault(BusFault::Off)) => Ok(Taken::Lost),
            Some(
                Disturbance::Stalled
                | Disturbance::Flood(_)
                | Disturbance::Fault(BusFault::Warning | BusFault::Overrun | BusFault::Passive),
            )
            | None => Ok(Taken::Queued),
        }
    }

    /// Returns whether queued frames reach the wire.
    pub(super) const fn is_sending(&self) -> bool {
        !matches!(self.wrong, Some(Disturbance::Stalled))
    }

    /// Returns the received event, if the node receives it now.
    pub(super) fn receive(&mut self, received: Received) -> Option<Received> {
        match (self.wrong, self.take()) {
            (Some(Disturbance::Stalled), _) => {
                if self.held.len() < MAX_HELD {
                    self.held.push_back(received);
                }
                None
            }
            (_, Ok(Taken::Lost) | Err(SendError::Down)) => None,
            (_, Ok(Taken::Queued) | Err(SendError::Full)) => Some(received),
        }
    }

    /// Confirms the transmission of a SYNC, unless the adapter receives nothing.
    pub(super) fn confirm_transmit(&mut self, at: Instant) {
        let is_deaf = matches!(self.take(), Ok(Taken::Lost) | Err(SendError::Down));
        if self.is_sending() && !is_deaf {
            self.confirmed_at = at;
        }
    }

    /// Returns the time of the last SYNC seen on the wire.
    pub(super) const fn transmit_confirmed_at(&self) -> Instant {
        self.confirmed_at
    }

    /// Returns the frame that floods the bus.
    pub(super) const fn flood(&self) -> Option<Frame> {
        match self.wrong {
            Some(Disturbance::Flood(frame)) => Some(frame),
            Some(
                Disturbance::Fault(_)
                | Disturbance::Full
                | Disturbance::Stuck
                | Disturbance::Stalled
                | Disturbance::Down,
            )
            | None => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Bus;
    use crate::BusEvent;
    use crate::Memory;
    use canopen::frame::Telegram;
    use canopen::station::Station;

    const CHANNEL: Channel = Channel(0);

    /// Answers each frame with the next identifier: proves that a frame was sent.
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

    /// Returns the identifiers received until `until`, and the faults.
    fn received(bus: &mut Memory<Echo, ()>, until: u64) -> (Vec<u16>, Vec<BusFault>) {
        let (mut ids, mut faults) = (Vec::new(), Vec::new());
        while let Some(received) = bus.receive(at(until)) {
            match received.event {
                BusEvent::Frame(frame) => ids.push(frame.cob_id),
                BusEvent::Fault(fault) => faults.push(fault),
            }
        }
        (ids, faults)
    }

    #[test]
    fn bus_off_blocks_sending_and_receiving_until_cleared() {
        let mut bus = bus();
        bus.disturb(CHANNEL, Some(Disturbance::Fault(BusFault::Off)));
        assert_eq!(send(&mut bus, 2), Ok(()), "accepted all the same");
        assert_eq!(received(&mut bus, 1_000), (vec![], vec![BusFault::Off]));
        bus.disturb(CHANNEL, None);
        send(&mut bus, 4).unwrap();
        assert_eq!(received(&mut bus, 2_000), (vec![5], vec![]), "frames accepted before are lost");
    }

    #[test]
    fn stalled_adapter_delivers_its_queue_at_the_end() {
        let mut bus = bus();
        bus.disturb(CHANNEL, Some(Disturbance::Stalled));
        let taken = (0..100).take_while(|_| send(&mut bus, 2).is_ok()).count();
        assert_eq!((taken, send(&mut bus, 2)), (32, Err(SendError::Full)));
        assert_eq!(received(&mut bus, 5_000), (vec![], vec![]));
        bus.disturb(CHANNEL, None);
        assert_eq!(received(&mut bus, 20_000).0.len(), 32);
    }

    #[test]
    fn other_faults_fail_as_their_drivers_do() {
        for (wrong, sent, answered) in [
            (Disturbance::Full, Err(SendError::Full), false),
            (Disturbance::Down, Err(SendError::Down), false),
            (Disturbance::Fault(BusFault::Down), Err(SendError::Down), false),
            (Disturbance::Stuck, Ok(()), false),
            (Disturbance::Fault(BusFault::Passive), Ok(()), true),
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
    fn flood_with_a_low_identifier_blocks_other_frames() {
        let mut bus = bus();
        bus.disturb(CHANNEL, Some(Disturbance::Flood(Frame::new(1, []))));
        send(&mut bus, 2).unwrap();
        let (ids, _) = received(&mut bus, 10_000);
        assert!(ids.len() > 150 && ids.iter().all(|id| *id == 1), "{ids:?}");
        bus.disturb(CHANNEL, None);
        assert!(received(&mut bus, 11_000).0.contains(&3), "it is sent afterwards");
    }

    #[test]
    fn stopped_process_reads_oldest_frames_then_an_overrun() {
        let mut bus = bus();
        bus.disturb(CHANNEL, Some(Disturbance::Flood(Frame::new(1, []))));
        bus.plan(at(300), HostFault::Stopped(Duration::from_millis(50)));
        assert!(!received(&mut bus, 1_000).0.is_empty(), "frames before the stop");
        assert_eq!(bus.now(), at(50_300));
        let oldest = bus.receive(at(60_000)).unwrap();
        assert!(oldest.at < at(1_200), "{oldest:?}");
        let (_, faults) = received(&mut bus, 60_000);
        assert_eq!(faults, [BusFault::Overrun]);
    }

    #[test]
    fn host_faults_occur_during_a_wait_in_order() {
        let mut bus = bus();
        bus.plan(at(700), HostFault::Bus(CHANNEL, None));
        bus.plan(at(500), HostFault::Bus(CHANNEL, Some(Disturbance::Fault(BusFault::Off))));
        let event = bus.receive(at(1_000)).unwrap();
        assert_eq!((event.at, event.event), (at(500), BusEvent::Fault(BusFault::Off)));
        assert_eq!(bus.receive(at(1_000)), None);
        send(&mut bus, 2).unwrap();
        assert_eq!(received(&mut bus, 2_000).0, [3]);
    }

    #[test]
    fn wall_clock_step_does_not_change_bus_time() {
        let mut bus = bus();
        bus.plan(at(500), HostFault::ClockSet(Duration::from_secs(7)));
        assert_eq!(bus.receive(at(1_500)), None);
        assert_eq!((bus.now(), bus.wall()), (at(1_500), Duration::from_micros(7_001_000)));
    }
}
