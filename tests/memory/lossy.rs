//! SDO client and simulated drive on a disturbed bus.

use std::collections::BTreeMap;

use crate::common::drive::{drive, node};
use crate::common::prelude::*;
use crate::sdo_queue::{Queue, Request, Task};
use canopen::sdo::{Block, Outcome, SdoOptions};
use canopen_device::station::Station;
use sim::drive::Drive;

/// Frame faults, per thousand frames.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ErrorRates {
    /// Rate of loss.
    pub(crate) loss: u32,
    /// Rate of repetition.
    pub(crate) repeated: u32,
    /// Rate of delay, which reorders frames.
    pub(crate) delayed: u32,
    /// Number of one frame that is lost in any case.
    pub(crate) nth: Option<u64>,
}

/// Duration of a frame on the bus.
const FRAME_TIME: Duration = Duration::from_micros(130);

/// Limit on the duration of a transfer.
const TIMEOUT: Duration = Duration::from_secs(60);

/// Client, wire and drive.
pub(crate) struct Lossy {
    drive: Drive,
    now: Instant,
    random: u64,
    /// Frames in flight by arrival time and order; true: to the drive.
    wire: BTreeMap<(Instant, u64), (bool, Frame)>,
    sent: u64,
    /// End of the last frame on the bus.
    busy: Instant,
}

impl Lossy {
    /// Drive with `value` in its sample buffer.
    pub(crate) fn new(seed: u64, value: &[u8]) -> Self {
        let mut lossy = Self {
            drive: drive(),
            now: Instant::ZERO,
            random: seed | 1,
            wire: BTreeMap::new(),
            sent: 0,
            busy: Instant::ZERO,
        };
        lossy.drive.on_time(lossy.now, &mut Vec::new());
        let block = Block::default().every(Duration::ZERO);
        let options = SdoOptions::block(Duration::from_secs(10), block);
        lossy.carry(Task::Write(value.to_vec()), options, ErrorRates::default()).unwrap();
        lossy
    }

    /// Content of the drive's sample buffer.
    pub(crate) fn buffer(&self) -> Vec<u8> {
        self.drive.dictionary().get(Object::SAMPLE_BUFFER).unwrap().to_vec()
    }

    /// Number of frames of the last transfer.
    pub(crate) const fn sent(&self) -> u64 {
        self.sent
    }

    /// Runs one request to its end, which must come within [`TIMEOUT`].
    pub(crate) fn carry(&mut self, task: Task, options: SdoOptions, rates: ErrorRates) -> Outcome {
        let (mut queue, start) = (Queue::default(), self.now);
        self.sent = 0;
        let request = Request { object: Object::SAMPLE_BUFFER, task, options, within: TIMEOUT };
        let ticket = queue.submit(self.now, node(), request);
        let (mut requests, mut replies) = (Vec::new(), Vec::new());
        loop {
            let first = self.wire.keys().next().map(|(at, _)| *at);
            let due = queue.deadline().into_iter().chain(first).chain(self.drive.deadline()).min();
            self.now = due.expect("something is due").max(self.now);
            let mut done = None;
            if let Some(entry) = self.wire.first_entry().filter(|entry| entry.key().0 <= self.now) {
                let (is_request, frame) = entry.remove();
                if is_request {
                    self.drive.on_frame(self.now, Channel(0), &frame, &mut replies);
                } else {
                    done = queue.on_frame(self.now, &frame, &mut requests);
                }
            }
            done = done.or_else(|| queue.on_time(self.now, &mut requests));
            self.drive.on_time(self.now, &mut replies);
            let received = replies.drain(..).map(|Telegram { frame, .. }| (false, frame));
            for (is_request, frame) in received.chain(requests.drain(..).map(|frame| (true, frame)))
            {
                self.send(is_request, frame, rates);
            }
            assert!(self.now.since(start) <= TIMEOUT, "it ends in time");
            if let Some(done) = done {
                assert_eq!(done.ticket, ticket);
                assert!(queue.is_empty());
                // Frames in flight at the end are dropped.
                self.wire.clear();
                return done.outcome;
            }
        }
    }

    fn send(&mut self, is_request: bool, frame: Frame, rates: ErrorRates) {
        self.busy = self.busy.max(self.now) + FRAME_TIME;
        self.sent += 1;
        if self.occurs(rates.loss) || rates.nth == Some(self.sent - 1) {
            return;
        }
        let mut at = self.busy;
        if self.occurs(rates.delayed) {
            at = at + FRAME_TIME * (self.random() % 64);
        }
        for copy in 0..1 + u32::from(self.occurs(rates.repeated)) {
            let again = if self.occurs(rates.delayed) { self.random() % 64 } else { 0 };
            let order = 2 * self.sent + u64::from(copy);
            self.wire.insert((at + FRAME_TIME * (copy * again), order), (is_request, frame));
        }
    }

    fn occurs(&mut self, per_mille: u32) -> bool {
        self.random() % 1000 < per_mille
    }

    /// Generator xorshift64*.
    fn random(&mut self) -> u32 {
        self.random ^= self.random >> 12;
        self.random ^= self.random << 25;
        self.random ^= self.random >> 27;
        u32::try_from(self.random.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 40).unwrap()
    }
}
