//! Permission to send on each bus: no frame may be transmitted late.
//!
//! After a frame that the bus does not accept, the rest of its cycle is not sent. After a SYNC without transmit
//! confirmation the next cycle sends nothing. Frames held by the adapter then meet no SYNC and do not act.
//!
//! The second such cycle, bus-off, or an interface that is down ends all transmission on the bus, including the heartbeat.
//! The drives' timers then stop them. Only a boot of the network permits sending again.

use std::time::Duration;

use crate::cause::Cause;
use bus::{BusError, SendError};
use canopen::frame::{Channel, Telegram};
use canopen::sync;
use units::time::Instant;

/// Number of failed cycles after which a bus is shut.
const MAX_FAILED_CYCLES: u32 = 2;

/// Maximum time by which a transmit confirmation may precede its SYNC. The two clocks are read one after the other.
const CLOCK_TOLERANCE: Duration = Duration::from_micros(100);

/// Permission to send on each bus.
#[derive(Clone, Debug)]
pub(super) struct Transmission {
    buses: Vec<BusState>,
}

/// Permission to send on one bus, and its reasons.
#[derive(Clone, Copy, Debug)]
struct BusState {
    channel: Channel,
    permission: Permission,
    /// Cycles with a frame that was not accepted, since the network was booted.
    failed_cycles: u32,
    /// Time of the last accepted SYNC.
    last_sync: Option<Instant>,
    /// Time of the last confirmed SYNC; `None` if the bus confirms none.
    confirmed_at: Option<Instant>,
    /// Cycles since then without its transmit confirmation.
    unconfirmed_cycles: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Permission {
    Open,
    /// No frame for the rest of this cycle.
    ClosedForCycle,
    /// No frame until the network boots.
    Shut,
}

impl Transmission {
    /// Permits sending on these buses.
    pub(super) fn on(channels: &[Channel]) -> Self {
        let permission = Permission::Open;
        let bus = |channel: &Channel| BusState {
            channel: *channel,
            permission,
            failed_cycles: 0,
            last_sync: None,
            confirmed_at: None,
            unconfirmed_cycles: 0,
        };
        Self { buses: channels.iter().map(bus).collect() }
    }

    /// Permits sending on all buses again, when the network boots.
    pub(super) fn reopen(&mut self) {
        for bus in &mut self.buses {
            *bus = BusState {
                permission: Permission::Open,
                failed_cycles: 0,
                last_sync: None,
                confirmed_at: None,
                unconfirmed_cycles: 0,
                ..*bus
            };
        }
    }

    /// Returns whether a bus is shut until the network boots.
    pub(super) fn is_shut(&self) -> bool {
        self.buses.iter().any(|bus| bus.permission == Permission::Shut)
    }

    /// Returns the first bus on which no frame may be sent now.
    pub(super) fn first_closed(&self) -> Option<Channel> {
        self.buses.iter().find(|bus| bus.permission != Permission::Open).map(|bus| bus.channel)
    }

    /// Returns whether a frame may be sent on this bus now.
    pub(super) fn is_open(&self, channel: Channel) -> bool {
        self.buses.iter().any(|bus| bus.channel == channel && bus.permission == Permission::Open)
    }

    /// Returns whether an open bus was left without the SYNC sent at `sync_at` on others: its drives have a target for
    /// their last SYNC already.
    pub(super) fn lacks_sync(&self, channel: Channel, sync_at: Instant) -> bool {
        let is_before = |bus: &BusState| bus.last_sync.is_some_and(|last| last < sync_at);
        self.is_open(channel)
            && self.buses.iter().any(|bus| bus.channel == channel && is_before(bus))
    }

    /// Updates the transmit confirmation of each bus whose last SYNC has none. `confirmed_at` returns the time of the
    /// last SYNC confirmed on a bus, or `None` if the bus confirms none.
    pub(super) fn confirm(&mut self, mut confirmed_at: impl FnMut(Channel) -> Option<Instant>) {
        for bus in self.buses.iter_mut().filter(|bus| !bus.is_confirmed()) {
            bus.confirmed_at = confirmed_at(bus.channel);
        }
    }

    /// Returns the time at which the last SYNC was confirmed on all buses; `None` if it was not.
    pub(super) fn confirmed_at(&self) -> Option<Instant> {
        let is_confirmed = self.buses.iter().all(BusState::is_confirmed);
        self.buses.iter().filter_map(|bus| bus.confirmed_at).max().filter(|_| is_confirmed)
    }

    /// Starts a cycle, after [`confirm`](Self::confirm). Returns a cause when a bus is shut for missing confirmations.
    pub(super) fn start_cycle(&mut self) -> Option<Cause> {
        let mut unconfirmed = None;
        for bus in &mut self.buses {
            if bus.start_cycle() {
                unconfirmed =
                    unconfirmed.or(Some(Cause::TransmitUnconfirmed { channel: bus.channel.0 }));
            }
        }
        unconfirmed
    }

    /// Updates the permission by the outcome of a `send` at `at`; returns the cause of a failure.
    pub(super) fn on_send(
        &mut self,
        at: Instant,
        telegram: &Telegram,
        outcome: Result<(), SendError>,
    ) -> Option<Cause> {
        let bus = self.buses.iter_mut().find(|bus| bus.channel == telegram.channel)?;
        let Channel(channel) = bus.channel;
        match outcome {
            Ok(()) => {
                if telegram.frame.cob_id == sync::COB_ID {
                    bus.last_sync = Some(at);
                }
                None
            }
            Err(SendError::Full) => {
                bus.failed_cycles += 1;
                // A queue that stays full is a bus that does not transmit, even if its driver reports it up.
                let is_down = bus.failed_cycles >= MAX_FAILED_CYCLES;
                bus.permission =
                    if is_down { Permission::Shut } else { Permission::ClosedForCycle };
                let down = Cause::BusDown { channel };
                Some(if is_down { down } else { Cause::QueueFull { channel } })
            }
            Err(SendError::Down) => {
                bus.permission = Permission::Shut;
                Some(Cause::BusDown { channel })
            }
        }
    }

    /// Shuts a bus that is off or down.
    pub(super) fn on_bus_error(&mut self, channel: Channel, error: BusError) {
        match error {
            BusError::Off | BusError::Down => {
                let buses = self.buses.iter_mut().filter(|bus| bus.channel == channel);
                buses.for_each(|bus| bus.permission = Permission::Shut);
            }
            BusError::Warning | BusError::Overrun | BusError::Passive => {}
        }
    }
}

impl BusState {
    /// Returns whether the last SYNC is confirmed.
    fn is_confirmed(&self) -> bool {
        let is_of = |sync| self.confirmed_at.is_some_and(|at| at + CLOCK_TOLERANCE >= sync);
        self.last_sync.is_none_or(is_of)
    }

    /// Starts a cycle; returns true if it shuts the bus.
    fn start_cycle(&mut self) -> bool {
        if self.permission == Permission::Shut {
            return false;
        }
        let is_unconfirmed = self.confirmed_at.is_some() && !self.is_confirmed();
        self.unconfirmed_cycles = if is_unconfirmed { self.unconfirmed_cycles + 1 } else { 0 };
        self.permission = match self.unconfirmed_cycles {
            0 => Permission::Open,
            1..MAX_FAILED_CYCLES => Permission::ClosedForCycle,
            MAX_FAILED_CYCLES.. => Permission::Shut,
        };
        self.permission == Permission::Shut
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::frame::Frame;

    const BUS: Channel = Channel(0);
    const OTHER: Channel = Channel(1);

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    fn sync(channel: Channel) -> Telegram {
        Telegram { channel, frame: Frame::new(sync::COB_ID, []) }
    }

    fn both() -> Transmission {
        Transmission::on(&[BUS, OTHER])
    }

    impl Transmission {
        /// Starts a cycle with these confirmations.
        fn start(&mut self, confirmed_at: impl FnMut(Channel) -> Option<Instant>) -> Option<Cause> {
            self.confirm(confirmed_at);
            self.start_cycle()
        }
    }

    #[test]
    fn hazard_21_second_full_queue_shuts_the_bus() {
        let mut transmission = both();
        assert_eq!(transmission.start(|_| None), None);
        let full = Err(SendError::Full);
        let cause = transmission.on_send(at(1), &sync(BUS), full);
        assert_eq!(cause, Some(Cause::QueueFull { channel: 0 }));
        assert!(!transmission.is_open(BUS) && transmission.is_open(OTHER));
        transmission.start(|_| None);
        assert!(transmission.is_open(BUS), "open in the next cycle");
        let cause = transmission.on_send(at(2), &sync(BUS), full);
        assert_eq!(cause, Some(Cause::BusDown { channel: 0 }));
        transmission.start(|_| None);
        assert!(
            !transmission.is_open(BUS) && transmission.is_open(OTHER) && transmission.is_shut()
        );
        transmission.reopen();
        assert!(transmission.is_open(BUS) && !transmission.is_shut());
    }

    #[test]
    fn hazard_22_two_unconfirmed_syncs_shut_the_bus() {
        let mut transmission = both();
        let confirmed = |millis: u64| move |channel| (channel == BUS).then(|| at(millis));
        transmission.start(confirmed(0));
        transmission.on_send(at(1), &sync(BUS), Ok(()));
        assert_eq!(transmission.start(confirmed(1)), None);
        transmission.on_send(at(2), &sync(BUS), Ok(()));
        assert_eq!(transmission.start(confirmed(1)), None);
        assert!(!transmission.is_open(BUS), "no SYNC for frames that the adapter holds");
        let cause = transmission.start(confirmed(1));
        assert_eq!(cause, Some(Cause::TransmitUnconfirmed { channel: 0 }));
        assert_eq!(transmission.start(confirmed(9)), None, "raised once");
        assert!(!transmission.is_open(BUS), "a late confirmation does not open it");
    }

    #[test]
    fn hazard_29_bus_left_without_a_sync_lacks_it_until_the_next() {
        let mut transmission = both();
        for bus in [BUS, OTHER] {
            transmission.on_send(at(1), &sync(bus), Ok(()));
        }
        assert!(!transmission.lacks_sync(OTHER, at(1)));
        transmission.on_send(at(2), &sync(BUS), Ok(()));
        assert!(!transmission.lacks_sync(BUS, at(2)) && transmission.lacks_sync(OTHER, at(2)));
        transmission.on_send(at(3), &sync(OTHER), Ok(()));
        assert!(!transmission.lacks_sync(OTHER, at(3)));
    }

    #[test]
    fn sync_confirmed_a_cycle_late_closes_one_cycle() {
        let mut transmission = both();
        transmission.on_send(at(1), &sync(BUS), Ok(()));
        assert_eq!((transmission.start(|_| Some(at(0))), transmission.is_open(BUS)), (None, false));
        assert_eq!((transmission.start(|_| Some(at(2))), transmission.is_open(BUS)), (None, true));
    }

    #[test]
    fn hazard_23_hazard_24_bus_off_and_down_shut_the_bus() {
        for (error, may) in [
            (BusError::Warning, true),
            (BusError::Overrun, true),
            (BusError::Passive, true),
            (BusError::Off, false),
            (BusError::Down, false),
        ] {
            let mut transmission = both();
            transmission.on_bus_error(BUS, error);
            assert_eq!(
                (transmission.is_open(BUS), transmission.is_open(OTHER)),
                (may, true),
                "{error:?}"
            );
        }
        let mut transmission = both();
        let cause = transmission.on_send(at(1), &sync(BUS), Err(SendError::Down));
        assert_eq!(
            (cause, transmission.is_open(BUS)),
            (Some(Cause::BusDown { channel: 0 }), false)
        );
    }
}
