//! Whether the node may send, on each bus: fresh or nothing.
//!
//! A frame that does not get out now must not get out later. So where a frame is not taken, the rest of
//! its cycle is not sent either; where the last SYNC has not been seen on the wire, the next cycle sends
//! nothing, and whatever the adapter still holds meets no SYNC to act on. What happens a second time, and a
//! controller that has left its bus, ends all sending on that bus, the heartbeat included: the drives
//! stop by their own timers. It begins again only with a boot of the network.

use std::time::Duration;

use crate::cause::Cause;
use bus::BusFault;
use bus::SendError;
use canopen::frame::Channel;
use canopen::frame::Telegram;
use canopen::sync;
use units::time::Instant;

/// Cycles that do not get out until a bus is given up.
const PATIENCE: u32 = 2;

/// A SYNC may seem to have been seen so long before it was sent: clocks are not read at once.
const SLACK: Duration = Duration::from_micros(100);

/// What may be sent on every bus.
#[derive(Clone, Debug)]
pub(super) struct Transmission {
    lines: Vec<Line>,
}

/// One bus.
#[derive(Clone, Copy, Debug)]
struct Line {
    channel: Channel,
    gate: Gate,
    /// Cycles in which a frame was not taken, since the network was booted.
    full: u32,
    /// The last SYNC that was taken.
    sync: Option<Instant>,
    /// Cycles since then in which it was not seen on the wire.
    unseen: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Gate {
    Open,
    /// For the rest of this cycle.
    Closed,
    /// Until the network boots.
    Shut,
}

impl Transmission {
    /// Nothing was sent yet.
    pub(super) fn on(channels: &[Channel]) -> Self {
        let gate = Gate::Open;
        let line =
            |channel: &Channel| Line { channel: *channel, gate, full: 0, sync: None, unseen: 0 };
        Self { lines: channels.iter().map(line).collect() }
    }

    /// The network boots.
    pub(super) fn reopen(&mut self) {
        for line in &mut self.lines {
            *line = Line { gate: Gate::Open, full: 0, sync: None, unseen: 0, ..*line };
        }
    }

    /// Whether nothing may be sent on some bus until the network boots.
    pub(super) fn is_shut(&self) -> bool {
        self.lines.iter().any(|line| line.gate == Gate::Shut)
    }

    /// The first bus on which nothing may be sent now.
    pub(super) fn closed(&self) -> Option<Channel> {
        self.lines.iter().find(|line| line.gate != Gate::Open).map(|line| line.channel)
    }

    /// Whether a frame may be sent on this bus now.
    pub(super) fn may(&self, channel: Channel) -> bool {
        self.lines.iter().any(|line| line.channel == channel && line.gate == Gate::Open)
    }

    /// A cycle begins. `echoed` says of a bus when a SYNC was last seen on its wire, if it can.
    pub(super) fn begin(&mut self, echoed: impl Fn(Channel) -> Option<Instant>) -> Option<Cause> {
        let mut missing = None;
        for line in &mut self.lines {
            if line.begin(echoed(line.channel)) {
                missing = missing.or(Some(Cause::EchoMissing { channel: line.channel.0 }));
            }
        }
        missing
    }

    /// A frame was offered at `at`.
    pub(super) fn offered(
        &mut self,
        at: Instant,
        telegram: &Telegram,
        outcome: Result<(), SendError>,
    ) -> Option<Cause> {
        let line = self.lines.iter_mut().find(|line| line.channel == telegram.channel)?;
        let Channel(channel) = line.channel;
        match outcome {
            Ok(()) => {
                if telegram.frame.cob_id == sync::COB_ID {
                    line.sync = Some(at);
                }
                None
            }
            Err(SendError::Full) => {
                line.full += 1;
                // A bus that takes nothing for so long is as good as down, whatever its driver says.
                let is_down = line.full >= PATIENCE;
                line.gate = if is_down { Gate::Shut } else { Gate::Closed };
                let down = Cause::BusDown { channel };
                Some(if is_down { down } else { Cause::QueueFull { channel } })
            }
            Err(SendError::Down) => {
                line.gate = Gate::Shut;
                Some(Cause::BusDown { channel })
            }
        }
    }

    /// Takes a fault of a bus: one that is off or down is shut.
    pub(super) fn on_fault(&mut self, channel: Channel, fault: BusFault) {
        match fault {
            BusFault::Off | BusFault::Down => {
                let lines = self.lines.iter_mut().filter(|line| line.channel == channel);
                lines.for_each(|line| line.gate = Gate::Shut);
            }
            BusFault::Warning | BusFault::Overrun | BusFault::Passive => {}
        }
    }
}

impl Line {
    /// Whether the last SYNC has just been given up.
    fn begin(&mut self, echoed: Option<Instant>) -> bool {
        if self.gate == Gate::Shut {
            return false;
        }
        let is_unseen = match (self.sync, echoed) {
            (Some(sync), Some(echoed)) => echoed + SLACK < sync,
            (None, _) | (_, None) => false,
        };
        self.unseen = if is_unseen { self.unseen + 1 } else { 0 };
        self.gate = match self.unseen {
            0 => Gate::Open,
            1..PATIENCE => Gate::Closed,
            PATIENCE.. => Gate::Shut,
        };
        self.gate == Gate::Shut
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

    #[test]
    fn hazard_21_a_frame_that_is_not_taken_ends_its_cycle_and_a_second_ends_sending() {
        let mut sending = both();
        assert_eq!(sending.begin(|_| None), None);
        let full = Err(SendError::Full);
        let cause = sending.offered(at(1), &sync(BUS), full);
        assert_eq!(cause, Some(Cause::QueueFull { channel: 0 }));
        assert!(!sending.may(BUS) && sending.may(OTHER));
        sending.begin(|_| None);
        assert!(sending.may(BUS), "the next cycle is tried");
        let cause = sending.offered(at(2), &sync(BUS), full);
        assert_eq!(cause, Some(Cause::BusDown { channel: 0 }));
        sending.begin(|_| None);
        assert!(!sending.may(BUS) && sending.may(OTHER) && sending.is_shut());
        sending.reopen();
        assert!(sending.may(BUS) && !sending.is_shut());
    }

    #[test]
    fn hazard_22_after_a_sync_that_is_not_seen_nothing_follows_and_after_two_cycles_nothing_more() {
        let mut sending = both();
        let seen =
            |heard: Option<u64>| move |channel| if channel == BUS { heard.map(at) } else { None };
        sending.begin(seen(Some(0)));
        sending.offered(at(1), &sync(BUS), Ok(()));
        assert_eq!(sending.begin(seen(Some(1))), None);
        sending.offered(at(2), &sync(BUS), Ok(()));
        assert_eq!(sending.begin(seen(Some(1))), None);
        assert!(!sending.may(BUS), "what is held must meet no SYNC");
        let cause = sending.begin(seen(Some(1)));
        assert_eq!(cause, Some(Cause::EchoMissing { channel: 0 }));
        assert_eq!(sending.begin(seen(Some(9))), None, "said once");
        assert!(!sending.may(BUS), "and an echo that comes later opens nothing");
    }

    #[test]
    fn a_sync_that_is_seen_a_cycle_late_costs_one_cycle() {
        let mut sending = both();
        sending.offered(at(1), &sync(BUS), Ok(()));
        assert_eq!((sending.begin(|_| Some(at(0))), sending.may(BUS)), (None, false));
        assert_eq!((sending.begin(|_| Some(at(2))), sending.may(BUS)), (None, true));
    }

    #[test]
    fn hazard_23_hazard_24_off_the_bus_or_down_ends_sending_at_once_and_warnings_do_not() {
        for (fault, may) in [
            (BusFault::Warning, true),
            (BusFault::Overrun, true),
            (BusFault::Passive, true),
            (BusFault::Off, false),
            (BusFault::Down, false),
        ] {
            let mut sending = both();
            sending.on_fault(BUS, fault);
            assert_eq!((sending.may(BUS), sending.may(OTHER)), (may, true), "{fault:?}");
        }
        let mut sending = both();
        let cause = sending.offered(at(1), &sync(BUS), Err(SendError::Down));
        assert_eq!((cause, sending.may(BUS)), (Some(Cause::BusDown { channel: 0 }), false));
    }
}
