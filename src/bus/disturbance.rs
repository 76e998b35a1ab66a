//! What can go wrong between the node and a bus of the [`Memory`](crate::Memory), at any moment: the
//! adapter, its driver, the process and the host's clocks. What goes wrong with the devices is the
//! simulation's.

use std::collections::VecDeque;
use std::time::Duration;

use crate::BusFault;
use crate::Received;
use crate::SendError;
use canopen::frame::Channel;
use canopen::frame::Frame;
use units::time::Instant;

/// Frames an adapter holds back at most while it stalls; later ones are lost.
const HELD: usize = 32;

/// What is wrong with one bus, until it is healed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disturbance {
    /// The controller reports this, once. After `Off` nothing is sent or heard, although frames are
    /// taken; after `Down` none is taken either; the others change nothing.
    Fault(BusFault),
    /// No frame is taken: the transmit queue is full. All is heard.
    Full,
    /// Frames are taken and lost, and nothing is event: the adapter's peer is gone.
    Stuck,
    /// Frames are taken until the queue is full, nothing is heard; at the end all of it is sent and heard
    /// at once, as by an adapter that stalls.
    Stalled,
    /// No frame is taken, nothing is heard, and nobody says why: the interface is down.
    Down,
    /// Somebody else sends this frame whenever the bus is idle or its identifier wins.
    Flood(Frame),
}

/// What can be planned for a moment, so that it comes at any phase of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostFault {
    /// A bus is disturbed; `None` heals it.
    Bus(Channel, Option<Disturbance>),
    /// The process stands still for so long. Its buses do not.
    Stopped(Duration),
    /// The same, right after the next frame with this identifier was sent or read: in the middle of a cycle.
    StoppedAfter(u16, Duration),
    /// The host is suspended for so long. Its buses are not.
    Suspended(Duration),
    /// Somebody sets the clock on the wall to this, since 1970.
    ClockSet(Duration),
}

/// What was planned and has not come yet, the earliest first.
#[derive(Clone, Debug, Default)]
pub(super) struct Agenda(Vec<(Instant, HostFault)>);

impl Agenda {
    /// Adds `host_fault`; of those of one moment, the first added comes first.
    pub(super) fn plan(&mut self, at: Instant, host_fault: HostFault) {
        let place = self.0.partition_point(|(planned, _)| *planned <= at);
        self.0.insert(place, (at, host_fault));
    }

    /// When the next one comes.
    pub(super) fn next(&self) -> Option<Instant> {
        self.0.first().map(|(at, _)| *at)
    }

    /// The next one, if it has come.
    pub(super) fn due(&mut self, now: Instant) -> Option<HostFault> {
        self.next().filter(|at| *at <= now)?;
        Some(self.0.remove(0).1)
    }
}

/// The node's side of one bus: its adapter, and what is wrong with it.
#[derive(Clone, Debug)]
pub(super) struct Adapter {
    wrong: Option<Disturbance>,
    held: VecDeque<Received>,
    echoed: Instant,
}

/// What becomes of a frame that was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// It waits for the wire.
    Queued,
    /// It is never seen again.
    Lost,
}

impl Adapter {
    /// A good one.
    pub(super) fn new() -> Self {
        Self { wrong: None, held: VecDeque::with_capacity(HELD), echoed: Instant::ZERO }
    }

    /// From now on this is wrong. What was held back until now is handed over.
    pub(super) fn disturb(
        &mut self,
        wrong: Option<Disturbance>,
    ) -> impl Iterator<Item = Received> + '_ {
        self.wrong = wrong;
        self.held.drain(..)
    }

    /// What becomes of a frame of the node's.
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

    /// Whether the node's frames get from the queue to the wire.
    pub(super) const fn is_sending(&self) -> bool {
        !matches!(self.wrong, Some(Disturbance::Stalled))
    }

    /// What the node hears of what came in: nothing, this, or this at some later time.
    pub(super) fn hear(&mut self, received: Received) -> Option<Received> {
        match (self.wrong, self.take()) {
            (Some(Disturbance::Stalled), _) => {
                if self.held.len() < HELD {
                    self.held.push_back(received);
                }
                None
            }
            (_, Ok(Taken::Lost) | Err(SendError::Down)) => None,
            (_, Ok(Taken::Queued) | Err(SendError::Full)) => Some(received),
        }
    }

    /// A SYNC is complete on the wire: it is seen there, unless the adapter sees nothing.
    pub(super) fn witness(&mut self, at: Instant) {
        let is_blind = matches!(self.take(), Ok(Taken::Lost) | Err(SendError::Down));
        if self.is_sending() && !is_blind {
            self.echoed = at;
        }
    }

    /// When a SYNC was last seen on the wire.
    pub(super) const fn transmit_confirmed_at(&self) -> Instant {
        self.echoed
    }

    /// What somebody else floods the bus with.
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

    /// Repeats every frame with the next identifier, so that what was sent is heard.
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

    /// The identifiers heard until `until`, and the faults.
    fn heard(bus: &mut Memory<Echo, ()>, until: u64) -> (Vec<u16>, Vec<BusFault>) {
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
    fn after_bus_off_nothing_is_sent_or_heard_until_it_is_healed() {
        let mut bus = bus();
        bus.disturb(CHANNEL, Some(Disturbance::Fault(BusFault::Off)));
        assert_eq!(send(&mut bus, 2), Ok(()), "taken all the same");
        assert_eq!(heard(&mut bus, 1_000), (vec![], vec![BusFault::Off]));
        bus.disturb(CHANNEL, None);
        send(&mut bus, 4).unwrap();
        assert_eq!(heard(&mut bus, 2_000), (vec![5], vec![]), "what was taken before is gone");
    }

    #[test]
    fn an_adapter_that_stalls_takes_a_queue_of_frames_and_delivers_them_all_at_the_end() {
        let mut bus = bus();
        bus.disturb(CHANNEL, Some(Disturbance::Stalled));
        let taken = (0..100).take_while(|_| send(&mut bus, 2).is_ok()).count();
        assert_eq!((taken, send(&mut bus, 2)), (32, Err(SendError::Full)));
        assert_eq!(heard(&mut bus, 5_000), (vec![], vec![]));
        bus.disturb(CHANNEL, None);
        assert_eq!(heard(&mut bus, 20_000).0.len(), 32);
    }

    #[test]
    fn each_of_the_others_fails_as_its_driver_does() {
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
            assert_eq!(!heard(&mut bus, 1_000).0.is_empty(), answered, "{wrong:?}");
            bus.disturb(CHANNEL, None);
            assert_eq!((send(&mut bus, 2), heard(&mut bus, 2_000).0), (Ok(()), vec![3]));
        }
    }

    #[test]
    fn a_flood_of_a_winning_identifier_lets_nothing_else_pass() {
        let mut bus = bus();
        bus.disturb(CHANNEL, Some(Disturbance::Flood(Frame::new(1, []))));
        send(&mut bus, 2).unwrap();
        let (ids, _) = heard(&mut bus, 10_000);
        assert!(ids.len() > 150 && ids.iter().all(|id| *id == 1), "{ids:?}");
        bus.disturb(CHANNEL, None);
        assert!(heard(&mut bus, 11_000).0.contains(&3), "then it comes at last");
    }

    #[test]
    fn a_process_that_stands_still_finds_the_oldest_frames_and_is_told_of_the_loss() {
        let mut bus = bus();
        bus.disturb(CHANNEL, Some(Disturbance::Flood(Frame::new(1, []))));
        bus.plan(at(300), HostFault::Stopped(Duration::from_millis(50)));
        assert!(!heard(&mut bus, 1_000).0.is_empty(), "those before it stood still");
        assert_eq!(bus.now(), at(50_300));
        let oldest = bus.receive(at(60_000)).unwrap();
        assert!(oldest.at < at(1_200), "{oldest:?}");
        let (_, faults) = heard(&mut bus, 60_000);
        assert_eq!(faults, [BusFault::Overrun]);
    }

    #[test]
    fn mishaps_come_in_the_middle_of_a_wait_and_in_their_order() {
        let mut bus = bus();
        bus.plan(at(700), HostFault::Bus(CHANNEL, None));
        bus.plan(at(500), HostFault::Bus(CHANNEL, Some(Disturbance::Fault(BusFault::Off))));
        let told = bus.receive(at(1_000)).unwrap();
        assert_eq!((told.at, told.event), (at(500), BusEvent::Fault(BusFault::Off)));
        assert_eq!(bus.receive(at(1_000)), None);
        send(&mut bus, 2).unwrap();
        assert_eq!(heard(&mut bus, 2_000).0, [3]);
    }

    #[test]
    fn the_clock_on_the_wall_can_be_set_and_time_goes_on_as_before() {
        let mut bus = bus();
        bus.plan(at(500), HostFault::ClockSet(Duration::from_secs(7)));
        assert_eq!(bus.receive(at(1_500)), None);
        assert_eq!((bus.now(), bus.wall()), (at(1_500), Duration::from_micros(7_001_000)));
    }
}
