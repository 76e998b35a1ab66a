//! Frames of devices that a bus has not accepted yet, sent in the order of real devices.
//!
//! A real device keeps a frame until the bus accepts it, and the lowest COB-ID is sent first. This queue does so, up to a
//! bound. A device sends a sub-block of 127 segments at once (CiA 301, 7.2.4.3): more than the queue of a socket holds,
//! and a TPDO must not wait behind them. While the queue is empty, frames are sent in their order.

use std::collections::VecDeque;

use bus::{Bus, SendError};
use canopen::frame::{Channel, Telegram};

/// Capacity: a sub-block of each of six drives, and their other frames meanwhile.
const CAPACITY: usize = 1_024;

/// Bus whose interface is down or gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Down(pub Channel);

/// Frames to be sent: the lowest COB-ID first, then the oldest.
#[derive(Debug)]
pub(super) struct TransmitQueue {
    waiting: VecDeque<Telegram>,
    /// Buses that refused a frame in this call.
    full: Vec<Channel>,
    lost: u64,
}

impl TransmitQueue {
    pub(super) fn new() -> Self {
        Self { waiting: VecDeque::with_capacity(CAPACITY), full: Vec::new(), lost: 0 }
    }

    /// Returns whether no frame waits.
    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Sends `frames` and the waiting ones, as far as the buses accept them. Frames beyond the capacity are lost.
    ///
    /// # Errors
    /// Returns an error for a bus whose interface is down; its frames are lost.
    pub(super) fn send<B: Bus>(
        &mut self,
        bus: &mut B,
        frames: &mut Vec<Telegram>,
    ) -> Result<(), Down> {
        let mut down = None;
        for telegram in frames.drain(..) {
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
        if self.waiting.len() < CAPACITY {
            let id = telegram.frame.cob_id;
            let place = self.waiting.partition_point(|other| other.frame.cob_id <= id);
            self.waiting.insert(place, telegram);
        } else {
            if self.lost == 0 {
                tracing::warn!("a bus accepts no more frames: those of its devices are lost");
            }
            self.lost += 1;
            tracing::debug!(frame = %telegram.frame, lost = self.lost, "not sent");
        }
    }
}

/// Returns whether a bus cannot accept a frame yet. A bus that is down loses it.
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
    use bus::Wake;
    use canopen::frame::Frame;
    use units::time::Instant;

    /// Accepts a number of frames on each of its buses before it is full.
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

        fn send_at(&mut self, _: Instant, telegram: Telegram) -> Result<(), SendError> {
            let Channel(place) = telegram.channel;
            let room = self.room.get_mut(usize::from(place)).ok_or(SendError::Down)?;
            *room = room.checked_sub(1).ok_or(SendError::Full)?;
            self.sent.push(telegram);
            Ok(())
        }

        fn wait(&mut self, now: Instant, _: Instant, _: Instant) -> Wake {
            Wake { now, received: None }
        }
    }

    fn telegram(channel: u8, cob_id: u16, number: u16) -> Telegram {
        let frame = Frame::new(cob_id, number.to_le_bytes());
        Telegram { channel: Channel(channel), frame }
    }

    /// Returns the numbers of the frames sent on a bus with a COB-ID.
    fn numbers(bus: &Narrow, channel: u8, cob_id: u16) -> Vec<u16> {
        let theirs = bus.sent.iter().filter(|telegram| {
            telegram.channel == Channel(channel) && telegram.frame.cob_id == cob_id
        });
        theirs.map(|t| u16::from_le_bytes(t.frame.data().try_into().unwrap())).collect()
    }

    #[test]
    fn whole_sub_block_passes_a_queue_of_ten() {
        let (mut bus, mut queue) = (Narrow::default(), TransmitQueue::new());
        let mut block = (0..127).map(|number| telegram(0, 0x583, number)).collect();
        while bus.sent.len() < 127 {
            bus.room = [10, 10];
            let before = bus.sent.len();
            queue.send(&mut bus, &mut block).unwrap();
            assert!(bus.sent.len() > before);
        }
        assert!(queue.is_empty());
        assert_eq!(numbers(&bus, 0, 0x583), (0..127).collect::<Vec<_>>());
    }

    #[test]
    fn tpdo_overtakes_segments_and_a_full_bus_blocks_no_other() {
        let (mut bus, mut queue) =
            (Narrow { room: [1, 9], ..Narrow::default() }, TransmitQueue::new());
        queue
            .send(&mut bus, &mut (0..5).map(|number| telegram(0, 0x583, number)).collect())
            .unwrap();
        queue.send(&mut bus, &mut vec![telegram(0, 0x183, 7), telegram(1, 0x583, 8)]).unwrap();
        assert_eq!(numbers(&bus, 1, 0x583), [8]);
        bus.room = [9, 9];
        queue.send(&mut bus, &mut Vec::new()).unwrap();
        let ids: Vec<u16> = bus.sent.iter().map(|telegram| telegram.frame.cob_id).collect();
        assert_eq!(ids, [0x583, 0x583, 0x183, 0x583, 0x583, 0x583, 0x583]);
    }

    #[test]
    fn queue_is_bounded_and_keeps_nothing_for_a_bus_that_is_down() {
        let (mut bus, mut queue) = (Narrow::default(), TransmitQueue::new());
        for number in 0..3_000 {
            let sent = queue
                .send(&mut bus, &mut vec![telegram(0, 0x183, number), telegram(7, 0x183, number)]);
            assert_eq!(sent, Err(Down(Channel(7))));
        }
        assert_eq!((queue.waiting.len(), queue.lost), (CAPACITY, 3_000 - 1_024));
        assert!(queue.waiting.iter().all(|telegram| telegram.channel == Channel(0)));
    }

    proptest! {
        #[test]
        fn frames_of_one_cob_id_are_sent_once_in_order(
            turns in prop::collection::vec((0..12_usize, 0..8_usize, 0..2_u8), 1..40)
        ) {
            let (mut bus, mut queue) = (Narrow::default(), TransmitQueue::new());
            let mut number = 0;
            for (frames, room, channel) in turns {
                bus.room = [room; 2];
                let mut now = Vec::new();
                for _ in 0..frames {
                    now.push(telegram(channel, 0x181 + 0x100 * (number % 5), number));
                    number += 1;
                }
                queue.send(&mut bus, &mut now).unwrap();
            }
            bus.room = [usize::MAX; 2];
            queue.send(&mut bus, &mut Vec::new()).unwrap();
            prop_assert!(queue.is_empty() && bus.sent.len() == usize::from(number));
            for (channel, kind) in (0..2).flat_map(|channel| (0..5).map(move |kind| (channel, kind))) {
                prop_assert!(numbers(&bus, channel, 0x181 + 0x100 * kind).is_sorted());
            }
        }
    }
}
