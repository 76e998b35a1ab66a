//! Client side of block transfers, frame by frame: the sequence of CiA 301, and servers that violate it.

use std::time::Duration;

use proptest::prelude::*;

use crate::NodeId;
use crate::abort::AbortCode;
use crate::frame::Frame;
use crate::object::Object;
use crate::sdo::{Block, Outcome, SdoError, SdoOptions, Transfer};
use units::time::Instant;

const TIMEOUT: Duration = Duration::from_millis(100);
const BUFFER: Object = Object::SAMPLE_BUFFER;

/// CRC of the bytes 1 to 20, from `binascii.crc_hqx` of Python.
const SUM_OF_20: [u8; 2] = [0xD3, 0xEA];

fn at(millis: u64) -> Instant {
    Instant::ZERO + Duration::from_millis(millis)
}

/// One transfer, and the frames it has sent since the last query.
struct Talk {
    now: Instant,
    transfer: Transfer,
    out: Vec<Frame>,
}

impl Talk {
    fn read(options: SdoOptions) -> Self {
        let (node, mut out) = (NodeId::new(5).unwrap(), Vec::new());
        let transfer = Transfer::read_with(options, node, BUFFER, at(0), &mut out);
        Self { now: at(0), transfer, out }
    }

    fn write(options: SdoOptions, bytes: &[u8]) -> Self {
        let (node, mut out) = (NodeId::new(5).unwrap(), Vec::new());
        let written = Transfer::write_with(options, node, BUFFER, bytes.to_vec(), at(0), &mut out);
        Self { now: at(0), transfer: written.unwrap(), out }
    }

    fn sent(&mut self) -> Vec<[u8; 8]> {
        assert!(self.out.iter().all(|frame| frame.cob_id == 0x605));
        self.out.drain(..).map(|frame| frame.data().try_into().unwrap()).collect()
    }

    fn receive(&mut self, reply: [u8; 8]) -> Option<Outcome> {
        self.transfer.on_frame(self.now, &Frame::new(0x585, reply), &mut self.out)
    }

    /// Frames sent after a reply that does not end the transfer.
    fn answer(&mut self, reply: [u8; 8]) -> Vec<[u8; 8]> {
        self.out.clear();
        assert_eq!(self.receive(reply), None);
        self.sent()
    }

    /// Lets time pass until `millis`; returns the outcome.
    fn wait(&mut self, millis: u64) -> Option<Outcome> {
        while let Some(due) = self.transfer.deadline().filter(|due| *due <= at(millis)) {
            self.now = self.now.max(due);
            let outcome = self.transfer.on_time(self.now, &mut self.out);
            if outcome.is_some() {
                return outcome;
            }
        }
        self.now = at(millis);
        None
    }

    fn aborts(&mut self, reply: [u8; 8], code: AbortCode) {
        self.out.clear();
        assert_eq!(self.receive(reply), Some(Err(SdoError::AbortedLocally(code))));
        let [a, b, c, d] = code.0.to_le_bytes();
        assert_eq!(self.sent(), [[0x80, 0, 0x20, 0, a, b, c, d]]);
    }
}

fn block(size: u8) -> Block {
    Block::new(size).unwrap()
}

fn options(size: u8) -> SdoOptions {
    SdoOptions::block(TIMEOUT, block(size))
}

fn first(count: u8) -> Vec<u8> {
    (1..=count).collect()
}

fn segment(number: u8, from: u8) -> [u8; 8] {
    let [a, b, c, d, e, f, g] = [0, 1, 2, 3, 4, 5, 6].map(|place| from + place);
    [number, a, b, c, d, e, f, g]
}

const START: [u8; 8] = [0xA3, 0, 0, 0, 0, 0, 0, 0];
const SIZE_20: [u8; 8] = [0xC6, 0, 0x20, 0, 20, 0, 0, 0];
const GO: [u8; 8] = [0xA4, 0, 0x20, 0, 2, 0, 0, 0];
const UNKNOWN: [u8; 8] = [0x80, 0, 0x20, 0, 1, 0, 4, 5];

fn answer(arrived: u8, block_size: u8) -> [u8; 8] {
    [0xA2, arrived, block_size, 0, 0, 0, 0, 0]
}

fn end(unused: u8, sum: [u8; 2]) -> [u8; 8] {
    [0xC1 | unused << 2, sum[0], sum[1], 0, 0, 0, 0, 0]
}

#[test]
fn upload_follows_the_standard() {
    let mut talk = Talk::read(options(2));
    assert_eq!(talk.sent(), [[0xA4, 0, 0x20, 0, 2, 0, 0, 0]]);
    assert_eq!(talk.answer(SIZE_20), [START]);
    assert_eq!(talk.answer(segment(1, 1)), [[0; 8]; 0]);
    assert_eq!(talk.answer(segment(2, 8)), [answer(2, 2)]);
    assert_eq!(talk.answer(segment(0x81, 15)), [answer(1, 2)]);
    let content = talk.receive(end(1, SUM_OF_20)).unwrap().unwrap();
    assert_eq!(content.bytes(), first(20));
    assert!(content.has_size());
    assert_eq!(talk.sent(), [[0xA1, 0, 0, 0, 0, 0, 0, 0]]);
    assert_eq!(talk.transfer.deadline(), None);
}

#[test]
fn upload_may_omit_size_and_crc() {
    let mut talk = Talk::read(SdoOptions::block(TIMEOUT, block(127).without_crc()));
    assert_eq!(talk.sent(), [[0xA0, 0, 0x20, 0, 127, 0, 0, 0]]);
    talk.answer([0xC0, 0, 0x20, 0, 0, 0, 0, 0]);
    talk.answer(segment(0x81, 1));
    let content = talk.receive(end(3, [0, 0])).unwrap().unwrap();
    assert_eq!(content.bytes(), first(4));
    assert!(!content.has_size());
    assert_eq!(content.exactly(2), None, "every byte counts");
}

#[test]
fn absent_crc_is_not_compared() {
    let mut talk = Talk::read(options(127));
    talk.answer([0xC2, 0, 0x20, 0, 7, 0, 0, 0]);
    talk.answer(segment(0x81, 1));
    assert!(talk.receive(end(0, [0, 0])).unwrap().is_ok());
}

#[test]
fn lost_segments_are_requested_again() {
    let mut talk = Talk::read(options(3));
    talk.answer([0xC6, 0, 0x20, 0, 27, 0, 0, 0]);
    assert_eq!(talk.answer(segment(1, 1)), [[0; 8]; 0]);
    assert_eq!(talk.answer(segment(1, 1)), [[0; 8]; 0], "twice");
    assert_eq!(talk.answer(segment(3, 15)), [answer(1, 3)], "2 is lost");
    assert_eq!(talk.answer(segment(2, 15)), [[0; 8]; 0]);
    assert_eq!(talk.answer(segment(0x83, 22)), [answer(0, 3)], "1 is lost");
    for (number, from) in [(1, 8), (2, 15)] {
        assert_eq!(talk.answer(segment(number, from)), [[0; 8]; 0]);
    }
    assert_eq!(talk.answer(segment(0x83, 22)), [answer(3, 3)]);
    assert_eq!(talk.answer(segment(0x83, 22)), [[0; 8]; 0], "twice");
    let sum = canopen_rs::sdo::block::crc16(&first(27)).to_le_bytes();
    assert_eq!(talk.receive(end(1, sum)).unwrap().unwrap().bytes(), first(27));
}

#[test]
fn upload_that_differs_from_its_announcement_is_aborted() {
    for (opening, end, code) in [
        (SIZE_20, end(1, [0; 2]), AbortCode::CRC_ERROR),
        ([0xC2, 0, 0x20, 0, 20, 0, 0, 0], end(0, [0; 2]), AbortCode::LENGTH_TOO_HIGH),
        ([0xC2, 0, 0x20, 0, 20, 0, 0, 0], end(2, [0; 2]), AbortCode::LENGTH_TOO_LOW),
    ] {
        let mut talk = Talk::read(options(127));
        talk.answer(opening);
        talk.answer(segment(1, 1));
        talk.answer(segment(2, 8));
        talk.answer(segment(0x83, 15));
        talk.aborts(end, code);
    }
    let mut talk = Talk::read(options(127));
    talk.answer([0xC6, 0, 0x20, 0, 6, 0, 0, 0]);
    talk.answer(segment(1, 1));
    talk.aborts(segment(2, 8), AbortCode::LENGTH_TOO_HIGH);
}

#[test]
fn invalid_sequence_number_is_aborted() {
    for number in [0, 3, 0x83] {
        let mut talk = Talk::read(options(2));
        talk.answer(SIZE_20);
        talk.aborts(segment(number, 1), AbortCode::SEQUENCE_NUMBER_INVALID);
    }
}

#[test]
fn memory_grows_with_received_bytes_only() {
    let mut talk = Talk::read(options(127));
    talk.aborts([0xC6, 0, 0x20, 0, 1, 0, 0, 1], AbortCode::OUT_OF_MEMORY);
    let mut talk = Talk::read(SdoOptions { limit: 13, ..options(127) });
    talk.answer([0xC4, 0, 0x20, 0, 0, 0, 0, 0]);
    talk.answer(segment(1, 1));
    talk.answer(segment(2, 8));
    talk.aborts(segment(3, 15), AbortCode::OUT_OF_MEMORY);
    let (node, mut out) = (NodeId::new(5).unwrap(), Vec::new());
    let options = SdoOptions { limit: 13, ..options(127) };
    let written = Transfer::write_with(options, node, BUFFER, first(14), at(0), &mut out);
    assert_eq!(written.err(), Some(SdoError::AbortedLocally(AbortCode::OUT_OF_MEMORY)));
    assert_eq!(out, []);
}

#[test]
fn frames_of_other_objects_and_late_frames_are_ignored() {
    let mut talk = Talk::read(options(127));
    talk.out.clear();
    for stale in [
        [0xC6, 1, 0x20, 0, 20, 0, 0, 0],
        [0x80, 1, 0x20, 0, 0, 0, 2, 6],
        [0x41, 0, 0x20, 1, 20, 0, 0, 0],
        segment(1, 1),
        answer(1, 127),
    ] {
        assert_eq!(talk.answer(stale), [[0; 8]; 0], "{stale:02X?}");
    }
    assert_eq!(talk.answer(SIZE_20), [START]);
    let abort_of_another = [0x80, 1, 0x20, 0, 0, 0, 2, 6];
    assert_eq!(talk.answer(abort_of_another), [[0; 8]; 0]);
    let abort = [0x80, 0, 0x20, 0, 0, 0, 6, 6];
    assert_eq!(
        talk.receive(abort),
        Some(Err(SdoError::AbortedByServer(AbortCode::HARDWARE_ERROR)))
    );
}

#[test]
fn segment_that_looks_like_an_abort_is_accepted() {
    let mut talk = Talk::read(options(127));
    talk.answer([0xC2, 0, 0x20, 0, 7, 0, 0, 0]);
    assert_eq!(talk.answer([0x81, 0, 0x20, 0, 1, 2, 3, 4]), [answer(1, 127)]);
    let content = talk.receive(end(0, [0, 0])).unwrap().unwrap();
    assert_eq!(content.bytes(), [0, 0x20, 0, 1, 2, 3, 4]);
}

#[test]
fn silent_server_gets_one_retry_then_an_abort() {
    let timed_out = [0x80, 0, 0x20, 0, 0, 0, 4, 5];
    let mut talk = Talk::read(options(127));
    talk.out.clear();
    assert_eq!(talk.wait(100), Some(Err(SdoError::Timeout)));
    assert_eq!(talk.sent(), [timed_out], "no segment was received");

    let mut talk = Talk::read(options(127));
    talk.answer(SIZE_20);
    talk.out.clear();
    assert_eq!(talk.wait(150), None);
    assert_eq!(talk.sent(), [START]);
    talk.answer(segment(1, 1));
    assert_eq!(talk.wait(349), None);
    assert_eq!(talk.sent(), [answer(1, 127)]);
    assert_eq!(talk.wait(350), Some(Err(SdoError::Timeout)));
    assert_eq!(talk.sent(), [timed_out]);
}

#[test]
fn server_may_answer_a_block_request_by_segments() {
    let mut talk = Talk::read(SdoOptions::best(TIMEOUT, block(127)));
    assert_eq!(talk.sent(), [[0xA4, 0, 0x20, 0, 127, 21, 0, 0]], "threshold of 21 bytes");
    let content = talk.receive([0x4B, 0, 0x20, 0, 1, 2, 0, 0]).unwrap().unwrap();
    assert_eq!(content.bytes(), [1, 2]);
    let mut talk = Talk::read(options(127));
    assert_eq!(talk.answer([0x41, 0, 0x20, 0, 7, 0, 0, 0]), [[0x60, 0, 0, 0, 0, 0, 0, 0]]);
    let content = talk.receive(segment(0x01, 1)).unwrap().unwrap();
    assert_eq!(content.bytes(), first(7));
}

#[test]
fn server_without_block_transfer_gets_segments() {
    let best = SdoOptions::best(TIMEOUT, block(127));
    assert_eq!(Talk::read(best).answer(UNKNOWN), [[0x40, 0, 0x20, 0, 0, 0, 0, 0]]);
    let mut talk = Talk::write(best, &first(22));
    assert_eq!(talk.sent(), [[0xC6, 0, 0x20, 0, 22, 0, 0, 0]]);
    assert_eq!(talk.answer(UNKNOWN), [[0x21, 0, 0x20, 0, 22, 0, 0, 0]]);
    assert_eq!(talk.answer([0x60, 0, 0x20, 0, 0, 0, 0, 0]), [segment(0, 1)], "no data was lost");
    let refused = Some(Err(SdoError::AbortedByServer(AbortCode::COMMAND_UNKNOWN)));
    assert_eq!(talk.receive(UNKNOWN), refused, "once");
    assert_eq!(Talk::read(options(127)).receive(UNKNOWN), refused, "no fallback");
    let mut talk = Talk::read(best);
    talk.answer(SIZE_20);
    assert_eq!(talk.receive(UNKNOWN), refused, "it was under way");
}

#[test]
fn short_value_is_written_by_segments() {
    let best = SdoOptions::best(TIMEOUT, block(127));
    assert_eq!(Talk::write(best, &first(21)).sent(), [[0x21, 0, 0x20, 0, 21, 0, 0, 0]]);
    assert_eq!(Talk::write(options(127), &[9]).sent(), [[0xC6, 0, 0x20, 0, 1, 0, 0, 0]]);
}

#[test]
fn download_follows_the_standard() {
    let mut talk = Talk::write(options(127), &first(20));
    assert_eq!(talk.sent(), [SIZE_20]);
    assert_eq!(talk.answer(GO), [[0; 8]; 0], "segments are sent by on_time");
    assert_eq!(talk.wait(10), None);
    assert_eq!(talk.sent(), [segment(1, 1), segment(2, 8)]);
    assert_eq!(talk.answer(answer(2, 127)), [[0; 8]; 0]);
    assert_eq!(talk.wait(20), None);
    let [_, seven @ ..] = segment(0, 15);
    let [a, b, c, d, e, f, _] = seven;
    assert_eq!(talk.sent(), [[0x81, a, b, c, d, e, f, 0]]);
    assert_eq!(talk.answer(answer(1, 127)), [end(1, SUM_OF_20)]);
    assert!(matches!(talk.receive([0xA1, 0, 0, 0, 0, 0, 0, 0]), Some(Ok(_))));
    assert_eq!(talk.transfer.deadline(), None);
}

#[test]
fn one_segment_per_call_and_interval() {
    let every = block(127).every(Duration::from_millis(2));
    let mut talk = Talk::write(SdoOptions::block(TIMEOUT, every), &first(70));
    talk.answer([0xA4, 0, 0x20, 0, 5, 0, 0, 0]);
    for (millis, count) in [(0, 1), (1, 0), (2, 1), (9, 3), (50, 0)] {
        assert_eq!(talk.wait(millis), None);
        assert_eq!(talk.sent().len(), count, "at {millis} ms");
    }
    talk.answer(answer(5, 127));
    assert_eq!(talk.transfer.deadline(), Some(talk.now), "at once, as the interval has passed");
    talk.now = at(60);
    assert_eq!(talk.transfer.on_time(talk.now, &mut talk.out), None);
    assert_eq!(talk.sent().len(), 1, "one per call");

    let at_once = SdoOptions::block(TIMEOUT, block(127).every(Duration::ZERO));
    let mut talk = Talk::write(at_once, &first(70));
    talk.answer(GO);
    for count in [1, 1, 0] {
        let outcome = talk.transfer.on_time(talk.now, &mut talk.out);
        assert_eq!((outcome, talk.sent().len()), (None, count), "the caller sets the pace");
    }
}

#[test]
fn lost_segments_are_sent_again() {
    let mut talk = Talk::write(options(127), &first(28));
    talk.answer([0xA4, 0, 0x20, 0, 3, 0, 0, 0]);
    talk.wait(10);
    talk.answer(answer(1, 2));
    talk.wait(20);
    assert_eq!(talk.sent(), [segment(1, 8), segment(2, 15)], "the block has two from now on");
    talk.answer(answer(0, 127));
    talk.wait(30);
    assert_eq!(talk.sent(), [segment(1, 8), segment(2, 15), segment(0x83, 22)]);
    let sum = canopen_rs::sdo::block::crc16(&first(28)).to_le_bytes();
    assert_eq!(talk.answer(answer(3, 127)), [end(0, sum)]);
    assert_eq!(talk.answer(answer(3, 127)), [end(0, sum)], "the end was lost");
}

#[test]
fn early_acknowledgement_is_followed_at_once() {
    let mut talk = Talk::write(options(127), &first(70));
    talk.answer([0xA4, 0, 0x20, 0, 127, 0, 0, 0]);
    talk.wait(3);
    assert_eq!(talk.sent().len(), 4);
    talk.answer(answer(2, 127));
    talk.wait(4);
    assert_eq!(talk.sent(), [segment(1, 15)]);
}

#[test]
fn invalid_acknowledgement_is_aborted() {
    for (opening, code) in
        [(0, AbortCode::BLOCK_SIZE_INVALID), (128, AbortCode::BLOCK_SIZE_INVALID)]
    {
        let mut talk = Talk::write(options(127), &first(28));
        talk.aborts([0xA4, 0, 0x20, 0, opening, 0, 0, 0], code);
    }
    for (sent, code) in [
        (answer(3, 127), AbortCode::SEQUENCE_NUMBER_INVALID),
        (answer(1, 0), AbortCode::BLOCK_SIZE_INVALID),
        (answer(1, 128), AbortCode::BLOCK_SIZE_INVALID),
    ] {
        let mut talk = Talk::write(options(127), &first(28));
        talk.answer(GO);
        talk.wait(10);
        talk.aborts(sent, code);
    }
}

#[test]
fn server_that_never_acknowledges_is_aborted() {
    let mut talk = Talk::write(options(127), &first(28));
    talk.answer(GO);
    for round in 1..=8 {
        assert_eq!(talk.wait(10 * round), None);
        assert_eq!(talk.answer(answer(0, 2)), [[0; 8]; 0]);
    }
    talk.wait(90);
    talk.aborts(answer(0, 2), AbortCode::SEQUENCE_NUMBER_INVALID);
}

#[test]
fn cancelled_transfer_is_aborted() {
    for mut talk in [Talk::read(options(127)), Talk::write(options(127), &first(28))] {
        talk.out.clear();
        talk.transfer.cancel(&mut talk.out);
        talk.transfer.cancel(&mut talk.out);
        assert_eq!(talk.sent(), [[0x80, 0, 0x20, 0, 0, 0, 0, 8]]);
        assert_eq!(talk.receive(SIZE_20), None);
        assert_eq!(talk.transfer.deadline(), None);
    }
}

proptest! {
    #[test]
    fn any_frames_never_panic_and_end_by_the_deadline(
        write in proptest::option::of(proptest::collection::vec(any::<u8>(), 0..2_000)),
        (has_crc, is_best) in any::<(bool, bool)>(),
        steps in proptest::collection::vec((0_u64..50_000, 0_u8..20, any::<[u8; 8]>()), 0..200),
    ) {
        let block = if has_crc { block(5) } else { block(5).without_crc() };
        let options = if is_best { SdoOptions::best(TIMEOUT, block) } else { SdoOptions::block(TIMEOUT, block) };
        let mut talk = match write {
            Some(bytes) => Talk::write(options, &bytes),
            None => Talk::read(options),
        };
        talk.out.clear();
        let (mut outcomes, mut number) = (0, 0);
        for (micros, kind, random) in steps {
            talk.now = talk.now + Duration::from_micros(micros);
            outcomes += u32::from(talk.transfer.on_time(talk.now, &mut talk.out).is_some());
            prop_assert!(talk.out.len() <= 1, "one per call");
            talk.out.clear();
            let [r, size, ..] = random;
            number = if kind < 8 { number % 5 + 1 } else { number };
            let reply = match kind {
                0..8 => segment(number | if r > 200 { 0x80 } else { 0 }, size / 2),
                8 => [0xC6, 0, 0x20, 0, size, 0, 0, 0],
                9 => [0xC0, 0, 0x20, 0, 0, 0, 0, 0],
                10..13 => [0xA4, 0, 0x20, 0, size / 2, 0, 0, 0],
                13..16 => answer(size % 6, r / 2),
                16 => end(r % 8, [0, 0]),
                17 => [0x41 & (0x40 | r), 0, 0x20, 0, size, 0, 0, 0],
                _ => random,
            };
            outcomes += u32::from(talk.receive(reply).is_some());
            prop_assert!(talk.out.len() <= 1, "one per call");
            talk.out.clear();
            prop_assert!(talk.transfer.deadline().is_none_or(|due| due <= talk.now + TIMEOUT));
        }
        let over = talk.now + 500 * TIMEOUT;
        outcomes += u32::from(talk.wait(over.as_micros() / 1_000).is_some());
        prop_assert_eq!(outcomes, 1);
        prop_assert_eq!(talk.transfer.deadline(), None);
    }
}
