//! A simulated drive at the other end of a bad wire.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::common::drive::drive;
use crate::common::drive::node;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::frame::Telegram;
use canopen::object::Object;
use canopen::sdo::Block;
use canopen::sdo::Outcome;
use canopen::sdo::Queue;
use canopen::sdo::Request;
use canopen::sdo::Task;
use canopen::sdo::Terms;
use canopen::station::Station;
use sim::drive::Drive;
use units::time::Instant;

/// What happens to frames, of a thousand each.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Weather {
    /// Lost.
    pub(crate) loss: u32,
    /// Received twice.
    pub(crate) twice: u32,
    /// Overtaken by those behind.
    pub(crate) late: u32,
    /// This one is lost, whatever happens to the others.
    pub(crate) nth: Option<u64>,
}

/// On the wire for this long.
const FRAME: Duration = Duration::from_micros(130);

/// How long any transfer may take.
const WITHIN: Duration = Duration::from_secs(60);

/// Client, wire and drive.
pub(crate) struct Lossy {
    drive: Drive,
    now: Instant,
    random: u64,
    /// Frames under way by when they arrive, and to whom: the drive, if true.
    wire: BTreeMap<(Instant, u64), (bool, Frame)>,
    sent: u64,
    /// When the last frame will be complete.
    busy: Instant,
}

impl Lossy {
    /// A drive whose buffer holds `value`.
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
        let terms = Terms::block(Duration::from_secs(10), block);
        lossy.carry(Task::Write(value.to_vec()), terms, Weather::default()).unwrap();
        lossy
    }

    /// What the drive's buffer holds.
    pub(crate) fn holds(&self) -> Vec<u8> {
        self.drive.dictionary().get(Object::SAMPLE_BUFFER).unwrap().to_vec()
    }

    /// How many frames the last transfer took.
    pub(crate) const fn count(&self) -> u64 {
        self.sent
    }

    /// Carries one request to its end, which must come in time.
    pub(crate) fn carry(&mut self, task: Task, terms: Terms, weather: Weather) -> Outcome {
        let (mut queue, begun) = (Queue::default(), self.now);
        self.sent = 0;
        let request = Request { object: Object::SAMPLE_BUFFER, task, terms, within: WITHIN };
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
            let heard = replies.drain(..).map(|Telegram { frame, .. }| (false, frame));
            for (is_request, frame) in heard.chain(requests.drain(..).map(|frame| (true, frame))) {
                self.send(is_request, frame, weather);
            }
            assert!(self.now.since(begun) <= WITHIN, "it ends in time");
            if let Some(done) = done {
                assert_eq!(done.ticket, ticket);
                assert!(queue.is_empty());
                // What is under way when it ends reaches nobody.
                self.wire.clear();
                return done.outcome;
            }
        }
    }

    fn send(&mut self, is_request: bool, frame: Frame, weather: Weather) {
        self.busy = self.busy.max(self.now) + FRAME;
        self.sent += 1;
        if self.happens(weather.loss) || weather.nth == Some(self.sent - 1) {
            return;
        }
        let mut at = self.busy;
        if self.happens(weather.late) {
            at = at + FRAME * (self.random() % 64);
        }
        for copy in 0..1 + u32::from(self.happens(weather.twice)) {
            let again = if self.happens(weather.late) { self.random() % 64 } else { 0 };
            let order = 2 * self.sent + u64::from(copy);
            self.wire.insert((at + FRAME * (copy * again), order), (is_request, frame));
        }
    }

    fn happens(&mut self, of_a_thousand: u32) -> bool {
        self.random() % 1000 < of_a_thousand
    }

    /// As xorshift64* has it.
    fn random(&mut self) -> u32 {
        self.random ^= self.random >> 12;
        self.random ^= self.random << 25;
        self.random ^= self.random >> 27;
        u32::try_from(self.random.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 40).unwrap()
    }
}
