//! What devices have said and a bus has not taken yet: kept short, sent as real devices would.
//!
//! A real device keeps a frame until the bus has taken it, and the lowest identifier goes first. So does
//! this, up to a bound: a socket's queue is shorter than a sub-block of 127 segments, which a device says
//! at once (CiA 301, 7.2.4.3), and a TPDO does not wait behind them. While nothing waits, everything goes
//! out in the order in which it was said.

use std::collections::VecDeque;

use bus::Bus;
use bus::SendError;
use canopen::frame::Channel;
use canopen::frame::Telegram;

/// Room for a whole sub-block of each of six drives, and what else is said meanwhile.
const ROOM: usize = 1_024;

/// The interface of a bus is down or gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Down(pub Channel);

/// What waits to be sent: the lowest identifier first, then the oldest.
#[derive(Debug)]
pub(super) struct Outbox {
    waiting: VecDeque<Telegram>,
    /// Buses that have just refused a frame.
    full: Vec<Channel>,
    lost: u64,
}

impl Outbox {
    /// Nothing to send.
    pub(super) fn new() -> Self {
        Self { waiting: VecDeque::with_capacity(ROOM), full: Vec::new(), lost: 0 }
    }

    /// Whether nothing waits.
    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Sends what was `said` and what waits, as far as the buses take it. What finds no room is lost.
    ///
    /// # Errors
    /// A bus whose interface is down; what is said to it is lost.
    pub(super) fn send<B: Bus>(
        &mut self,
        bus: &mut B,
        said: &mut Vec<Telegram>,
    ) -> Result<(), Down> {
        let mut down = None;
        for telegram in said.drain(..) {
            let is_behind = self.waiting.iter().any(|other| other.channel == telegram.channel);
            if is_behind || is_refused(bus, telegram, &mut down) {
                self.keep(telegram);
            }
        }
        let Self { waiting, full, .. } = self;
        full.clear();
        waiting.retain(|telegram| {
            let is_full = full.contains(&telegram.channel);
            let is_kept = is_full || is_refused(bus, *telegram, &mut down);
            if is_kept && !is_full {
                full.push(telegram.channel);
            }
            is_kept
        });
        down.map_or(Ok(()), Err)
    }

    fn keep(&mut self, telegram: Telegram) {
        if self.waiting.len() < ROOM {
            let id = telegram.frame.cob_id;
            let place = self.waiting.partition_point(|other| other.frame.cob_id <= id);
            self.waiting.insert(place, telegram);
        } else {
            if self.lost == 0 {
                tracing::warn!("a bus takes no more frames: what its devices say is lost");
            }
            self.lost += 1;
            tracing::debug!(frame = %telegram.frame, lost = self.lost, "not sent");
        }
    }
}

/// Whether a bus has no room for a frame now. One that is down takes none, ever.
fn is_refused<B: Bus>(bus: &mut B, telegram: Telegram, down: &mut Option<Down>) -> bool {
    match bus.send(telegram) {
        Ok(()) => false,
        Err(SendError::Full) => true,
        Err(SendError::Down) => {
            *down = Some(Down(telegram.channel));
            false
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;
    use bus::Received;
    use canopen::frame::Frame;
    use units::time::Instant;

    /// Takes so many frames on each of its buses before it is full.
    #[derive(Default)]
    struct Narrow {
        room: [usize; 2],
        sent: Vec<Telegram>,
    }

    impl Bus for Narrow {
        fn now(&self) -> Instant {
            Instant::ZERO
        }

        fn wall(&self) -> Duration {
            Duration::ZERO
        }

        fn send(&mut self, telegram: Telegram) -> Result<(), SendError> {
            let Channel(place) = telegram.channel;
            let room = self.room.get_mut(usize::from(place)).ok_or(SendError::Down)?;
            *room = room.checked_sub(1).ok_or(SendError::Full)?;
            self.sent.push(telegram);
            Ok(())
        }

        fn receive(&mut self, _: Instant) -> Option<Received> {
            None
        }
    }

    fn said(channel: u8, cob_id: u16, number: u16) -> Telegram {
        let frame = Frame::new(cob_id, number.to_le_bytes());
        Telegram { channel: Channel(channel), frame }
    }

    /// Numbers of what was sent on a bus with an identifier.
    fn numbers(bus: &Narrow, channel: u8, cob_id: u16) -> Vec<u16> {
        let theirs = bus.sent.iter().filter(|telegram| {
            telegram.channel == Channel(channel) && telegram.frame.cob_id == cob_id
        });
        theirs.map(|t| u16::from_le_bytes(t.frame.data().try_into().unwrap())).collect()
    }

    #[test]
    fn a_whole_sub_block_gets_out_of_a_queue_of_ten() {
        let (mut bus, mut outbox) = (Narrow::default(), Outbox::new());
        let mut block = (0..127).map(|number| said(0, 0x583, number)).collect();
        while bus.sent.len() < 127 {
            bus.room = [10, 10];
            let before = bus.sent.len();
            outbox.send(&mut bus, &mut block).unwrap();
            assert!(bus.sent.len() > before);
        }
        assert!(outbox.is_empty());
        assert_eq!(numbers(&bus, 0, 0x583), (0..127).collect::<Vec<_>>());
    }

    #[test]
    fn a_tpdo_goes_before_the_segments_that_wait_and_one_full_bus_does_not_hold_up_another() {
        let (mut bus, mut outbox) = (Narrow { room: [1, 9], ..Narrow::default() }, Outbox::new());
        outbox.send(&mut bus, &mut (0..5).map(|number| said(0, 0x583, number)).collect()).unwrap();
        outbox.send(&mut bus, &mut vec![said(0, 0x183, 7), said(1, 0x583, 8)]).unwrap();
        assert_eq!(numbers(&bus, 1, 0x583), [8]);
        bus.room = [9, 9];
        outbox.send(&mut bus, &mut Vec::new()).unwrap();
        let ids: Vec<u16> = bus.sent.iter().map(|telegram| telegram.frame.cob_id).collect();
        assert_eq!(ids, [0x583, 0x583, 0x183, 0x583, 0x583, 0x583, 0x583]);
    }

    #[test]
    fn what_a_bus_never_takes_ends_at_the_bound_and_what_is_down_is_not_kept() {
        let (mut bus, mut outbox) = (Narrow::default(), Outbox::new());
        for number in 0..3_000 {
            let sent =
                outbox.send(&mut bus, &mut vec![said(0, 0x183, number), said(7, 0x183, number)]);
            assert_eq!(sent, Err(Down(Channel(7))));
        }
        assert_eq!((outbox.waiting.len(), outbox.lost), (ROOM, 3_000 - 1_024));
        assert!(outbox.waiting.iter().all(|telegram| telegram.channel == Channel(0)));
    }

    proptest! {
        #[test]
        fn of_one_identifier_nothing_is_lost_doubled_or_overtaken(
            turns in prop::collection::vec((0..12_usize, 0..8_usize, 0..2_u8), 1..40)
        ) {
            let (mut bus, mut outbox) = (Narrow::default(), Outbox::new());
            let mut number = 0;
            for (frames, room, channel) in turns {
                bus.room = [room; 2];
                let mut now = Vec::new();
                for _ in 0..frames {
                    now.push(said(channel, 0x181 + 0x100 * (number % 5), number));
                    number += 1;
                }
                outbox.send(&mut bus, &mut now).unwrap();
            }
            bus.room = [usize::MAX; 2];
            outbox.send(&mut bus, &mut Vec::new()).unwrap();
            prop_assert!(outbox.is_empty() && bus.sent.len() == usize::from(number));
            for (channel, kind) in (0..2).flat_map(|channel| (0..5).map(move |kind| (channel, kind))) {
                prop_assert!(numbers(&bus, channel, 0x181 + 0x100 * kind).is_sorted());
            }
        }
    }
}
