//! What a block transfer does, seen from the client: frame by frame as CiA 301 has it, and when the
//! server does not keep to it.

use std::time::Duration;

use proptest::prelude::*;

use crate::NodeId;
use crate::abort::AbortCode;
use crate::frame::Frame;
use crate::object::Object;
use crate::sdo::Block;
use crate::sdo::Outcome;
use crate::sdo::SdoError;
use crate::sdo::Terms;
use crate::sdo::Transfer;
use units::time::Instant;

const TIMEOUT: Duration = Duration::from_millis(100);
const BUFFER: Object = Object::SAMPLE_BUFFER;

/// Of the bytes 1 to 20, as `binascii.crc_hqx` of Python has it.
const SUM_OF_20: [u8; 2] = [0xD3, 0xEA];

fn at(millis: u64) -> Instant {
    Instant::ZERO + Duration::from_millis(millis)
}

/// One transfer, and what it has said since it was asked last.
struct Talk {
    now: Instant,
    transfer: Transfer,
    out: Vec<Frame>,
}

impl Talk {
    fn read(terms: Terms) -> Self {
        let (node, mut out) = (NodeId::new(5).unwrap(), Vec::new());
        let transfer = Transfer::read_on(terms, node, BUFFER, at(0), &mut out);
        Self { now: at(0), transfer, out }
    }

    fn write(terms: Terms, bytes: &[u8]) -> Self {
        let (node, mut out) = (NodeId::new(5).unwrap(), Vec::new());
        let written = Transfer::write_on(terms, node, BUFFER, bytes.to_vec(), at(0), &mut out);
        Self { now: at(0), transfer: written.unwrap(), out }
    }

    fn said(&mut self) -> Vec<[u8; 8]> {
        assert!(self.out.iter().all(|frame| frame.cob_id == 0x605));
        self.out.drain(..).map(|frame| frame.data().try_into().unwrap()).collect()
    }

    fn hear(&mut self, reply: [u8; 8]) -> Option<Outcome> {
        self.transfer.on_frame(self.now, &Frame::new(0x585, reply), &mut self.out)
    }

    /// What it says to a reply that does not end it.
    fn answer(&mut self, reply: [u8; 8]) -> Vec<[u8; 8]> {
        self.out.clear();
        assert_eq!(self.hear(reply), None);
        self.said()
    }

    /// Does what is due until `millis`, and tells the outcome.
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

    fn breaks_off(&mut self, reply: [u8; 8], code: AbortCode) {
        self.out.clear();
        assert_eq!(self.hear(reply), Some(Err(SdoError::BrokenOff(code))));
        let [a, b, c, d] = code.0.to_le_bytes();
        assert_eq!(self.said(), [[0x80, 0, 0x20, 0, a, b, c, d]]);
    }
}

fn block(size: u8) -> Block {
    Block::new(size).unwrap()
}

fn terms(size: u8) -> Terms {
    Terms::block(TIMEOUT, block(size))
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
fn an_upload_is_as_the_standard_has_it() {
    let mut talk = Talk::read(terms(2));
    assert_eq!(talk.said(), [[0xA4, 0, 0x20, 0, 2, 0, 0, 0]]);
    assert_eq!(talk.answer(SIZE_20), [START]);
    assert_eq!(talk.answer(segment(1, 1)), [[0; 8]; 0]);
    assert_eq!(talk.answer(segment(2, 8)), [answer(2, 2)]);
    assert_eq!(talk.answer(segment(0x81, 15)), [answer(1, 2)]);
    let content = talk.hear(end(1, SUM_OF_20)).unwrap().unwrap();
    assert_eq!(content.bytes(), first(20));
    assert!(content.is_size_told());
    assert_eq!(talk.said(), [[0xA1, 0, 0, 0, 0, 0, 0, 0]]);
    assert_eq!(talk.transfer.deadline(), None);
}

#[test]
fn an_upload_may_leave_size_and_checksum_open() {
    let mut talk = Talk::read(Terms::block(TIMEOUT, block(127).without_crc()));
    assert_eq!(talk.said(), [[0xA0, 0, 0x20, 0, 127, 0, 0, 0]]);
    talk.answer([0xC0, 0, 0x20, 0, 0, 0, 0, 0]);
    talk.answer(segment(0x81, 1));
    let content = talk.hear(end(3, [0, 0])).unwrap().unwrap();
    assert_eq!(content.bytes(), first(4));
    assert!(!content.is_size_told());
    assert_eq!(content.exactly(2), None, "every byte counts");
}

#[test]
fn a_checksum_the_server_does_not_have_is_not_compared() {
    let mut talk = Talk::read(terms(127));
    talk.answer([0xC2, 0, 0x20, 0, 7, 0, 0, 0]);
    talk.answer(segment(0x81, 1));
    assert!(talk.hear(end(0, [0, 0])).unwrap().is_ok());
}

#[test]
fn lost_segments_are_asked_for_again() {
    let mut talk = Talk::read(terms(3));
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
    assert_eq!(talk.hear(end(1, sum)).unwrap().unwrap().bytes(), first(27));
}

#[test]
fn an_upload_that_is_not_what_was_announced_is_broken_off() {
    for (opening, end, code) in [
        (SIZE_20, end(1, [0; 2]), AbortCode::CRC_ERROR),
        ([0xC2, 0, 0x20, 0, 20, 0, 0, 0], end(0, [0; 2]), AbortCode::LENGTH_TOO_HIGH),
        ([0xC2, 0, 0x20, 0, 20, 0, 0, 0], end(2, [0; 2]), AbortCode::LENGTH_TOO_LOW),
    ] {
        let mut talk = Talk::read(terms(127));
        talk.answer(opening);
        talk.answer(segment(1, 1));
        talk.answer(segment(2, 8));
        talk.answer(segment(0x83, 15));
        talk.breaks_off(end, code);
    }
    let mut talk = Talk::read(terms(127));
    talk.answer([0xC6, 0, 0x20, 0, 6, 0, 0, 0]);
    talk.answer(segment(1, 1));
    talk.breaks_off(segment(2, 8), AbortCode::LENGTH_TOO_HIGH);
}

#[test]
fn a_segment_number_that_is_none_is_broken_off() {
    for number in [0, 3, 0x83] {
        let mut talk = Talk::read(terms(2));
        talk.answer(SIZE_20);
        talk.breaks_off(segment(number, 1), AbortCode::SEQUENCE_NUMBER_INVALID);
    }
}

#[test]
fn memory_is_for_what_comes_and_not_for_what_is_announced() {
    let mut talk = Talk::read(terms(127));
    talk.breaks_off([0xC6, 0, 0x20, 0, 1, 0, 0, 1], AbortCode::OUT_OF_MEMORY);
    let mut talk = Talk::read(Terms { limit: 13, ..terms(127) });
    talk.answer([0xC4, 0, 0x20, 0, 0, 0, 0, 0]);
    talk.answer(segment(1, 1));
    talk.answer(segment(2, 8));
    talk.breaks_off(segment(3, 15), AbortCode::OUT_OF_MEMORY);
    let (node, mut out) = (NodeId::new(5).unwrap(), Vec::new());
    let terms = Terms { limit: 13, ..terms(127) };
    let written = Transfer::write_on(terms, node, BUFFER, first(14), at(0), &mut out);
    assert_eq!(written.err(), Some(SdoError::BrokenOff(AbortCode::OUT_OF_MEMORY)));
    assert_eq!(out, []);
}

#[test]
fn what_is_about_another_object_or_late_is_passed_over() {
    let mut talk = Talk::read(terms(127));
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
    assert_eq!(talk.hear(abort), Some(Err(SdoError::Refused(AbortCode::HARDWARE_ERROR))));
}

#[test]
fn a_segment_that_looks_like_an_abort_is_none() {
    let mut talk = Talk::read(terms(127));
    talk.answer([0xC2, 0, 0x20, 0, 7, 0, 0, 0]);
    assert_eq!(talk.answer([0x81, 0, 0x20, 0, 1, 2, 3, 4]), [answer(1, 127)]);
    let content = talk.hear(end(0, [0, 0])).unwrap().unwrap();
    assert_eq!(content.bytes(), [0, 0x20, 0, 1, 2, 3, 4]);
}

#[test]
fn a_silent_server_is_asked_once_more_and_then_told_that_it_is_over() {
    let timed_out = [0x80, 0, 0x20, 0, 0, 0, 4, 5];
    let mut talk = Talk::read(terms(127));
    talk.out.clear();
    assert_eq!(talk.wait(100), Some(Err(SdoError::Silent)));
    assert_eq!(talk.said(), [timed_out], "nothing has begun");

    let mut talk = Talk::read(terms(127));
    talk.answer(SIZE_20);
    talk.out.clear();
    assert_eq!(talk.wait(150), None);
    assert_eq!(talk.said(), [START]);
    talk.answer(segment(1, 1));
    assert_eq!(talk.wait(349), None);
    assert_eq!(talk.said(), [answer(1, 127)]);
    assert_eq!(talk.wait(350), Some(Err(SdoError::Silent)));
    assert_eq!(talk.said(), [timed_out]);
}

#[test]
fn a_server_may_answer_a_block_request_by_the_other_protocol() {
    let mut talk = Talk::read(Terms::best(TIMEOUT, block(127)));
    assert_eq!(talk.said(), [[0xA4, 0, 0x20, 0, 127, 21, 0, 0]], "up to 21 bytes it should");
    let content = talk.hear([0x4B, 0, 0x20, 0, 1, 2, 0, 0]).unwrap().unwrap();
    assert_eq!(content.bytes(), [1, 2]);
    let mut talk = Talk::read(terms(127));
    assert_eq!(talk.answer([0x41, 0, 0x20, 0, 7, 0, 0, 0]), [[0x60, 0, 0, 0, 0, 0, 0, 0]]);
    let content = talk.hear(segment(0x01, 1)).unwrap().unwrap();
    assert_eq!(content.bytes(), first(7));
}

#[test]
fn a_server_without_block_transfer_is_served_by_segments_where_that_is_allowed() {
    let best = Terms::best(TIMEOUT, block(127));
    assert_eq!(Talk::read(best).answer(UNKNOWN), [[0x40, 0, 0x20, 0, 0, 0, 0, 0]]);
    let mut talk = Talk::write(best, &first(22));
    assert_eq!(talk.said(), [[0xC6, 0, 0x20, 0, 22, 0, 0, 0]]);
    assert_eq!(talk.answer(UNKNOWN), [[0x21, 0, 0x20, 0, 22, 0, 0, 0]]);
    assert_eq!(talk.answer([0x60, 0, 0x20, 0, 0, 0, 0, 0]), [segment(0, 1)], "all is still there");
    let refused = Some(Err(SdoError::Refused(AbortCode::COMMAND_UNKNOWN)));
    assert_eq!(talk.hear(UNKNOWN), refused, "once");
    assert_eq!(Talk::read(terms(127)).hear(UNKNOWN), refused, "not allowed");
    let mut talk = Talk::read(best);
    talk.answer(SIZE_20);
    assert_eq!(talk.hear(UNKNOWN), refused, "it had begun");
}

#[test]
fn a_short_value_is_written_by_segments_where_that_is_allowed() {
    let best = Terms::best(TIMEOUT, block(127));
    assert_eq!(Talk::write(best, &first(21)).said(), [[0x21, 0, 0x20, 0, 21, 0, 0, 0]]);
    assert_eq!(Talk::write(terms(127), &[9]).said(), [[0xC6, 0, 0x20, 0, 1, 0, 0, 0]]);
}

#[test]
fn a_download_is_as_the_standard_has_it() {
    let mut talk = Talk::write(terms(127), &first(20));
    assert_eq!(talk.said(), [SIZE_20]);
    assert_eq!(talk.answer(GO), [[0; 8]; 0], "segments have their time");
    assert_eq!(talk.wait(10), None);
    assert_eq!(talk.said(), [segment(1, 1), segment(2, 8)]);
    assert_eq!(talk.answer(answer(2, 127)), [[0; 8]; 0]);
    assert_eq!(talk.wait(20), None);
    let [_, seven @ ..] = segment(0, 15);
    let [a, b, c, d, e, f, _] = seven;
    assert_eq!(talk.said(), [[0x81, a, b, c, d, e, f, 0]]);
    assert_eq!(talk.answer(answer(1, 127)), [end(1, SUM_OF_20)]);
    assert!(matches!(talk.hear([0xA1, 0, 0, 0, 0, 0, 0, 0]), Some(Ok(_))));
    assert_eq!(talk.transfer.deadline(), None);
}

#[test]
fn segments_go_out_one_a_call_and_no_sooner_than_they_may() {
    let every = block(127).every(Duration::from_millis(2));
    let mut talk = Talk::write(Terms::block(TIMEOUT, every), &first(70));
    talk.answer([0xA4, 0, 0x20, 0, 5, 0, 0, 0]);
    for (millis, sent) in [(0, 1), (1, 0), (2, 1), (9, 3), (50, 0)] {
        assert_eq!(talk.wait(millis), None);
        assert_eq!(talk.said().len(), sent, "at {millis} ms");
    }
    talk.answer(answer(5, 127));
    assert_eq!(talk.transfer.deadline(), Some(talk.now), "at once, after so long");
    talk.now = at(60);
    assert_eq!(talk.transfer.on_time(talk.now, &mut talk.out), None);
    assert_eq!(talk.said().len(), 1, "one, however late");

    let at_once = Terms::block(TIMEOUT, block(127).every(Duration::ZERO));
    let mut talk = Talk::write(at_once, &first(70));
    talk.answer(GO);
    for sent in [1, 1, 0] {
        let outcome = talk.transfer.on_time(talk.now, &mut talk.out);
        assert_eq!((outcome, talk.said().len()), (None, sent), "the owner keeps the pace");
    }
}

#[test]
fn what_has_not_arrived_is_sent_again() {
    let mut talk = Talk::write(terms(127), &first(28));
    talk.answer([0xA4, 0, 0x20, 0, 3, 0, 0, 0]);
    talk.wait(10);
    talk.answer(answer(1, 2));
    talk.wait(20);
    assert_eq!(talk.said(), [segment(1, 8), segment(2, 15)], "the block has two from now on");
    talk.answer(answer(0, 127));
    talk.wait(30);
    assert_eq!(talk.said(), [segment(1, 8), segment(2, 15), segment(0x83, 22)]);
    let sum = canopen_rs::sdo::block::crc16(&first(28)).to_le_bytes();
    assert_eq!(talk.answer(answer(3, 127)), [end(0, sum)]);
    assert_eq!(talk.answer(answer(3, 127)), [end(0, sum)], "the end was lost");
}

#[test]
fn an_early_answer_is_followed_at_once() {
    let mut talk = Talk::write(terms(127), &first(70));
    talk.answer([0xA4, 0, 0x20, 0, 127, 0, 0, 0]);
    talk.wait(3);
    assert_eq!(talk.said().len(), 4);
    talk.answer(answer(2, 127));
    talk.wait(4);
    assert_eq!(talk.said(), [segment(1, 15)]);
}

#[test]
fn an_answer_that_cannot_be_is_broken_off() {
    for (opening, code) in
        [(0, AbortCode::BLOCK_SIZE_INVALID), (128, AbortCode::BLOCK_SIZE_INVALID)]
    {
        let mut talk = Talk::write(terms(127), &first(28));
        talk.breaks_off([0xA4, 0, 0x20, 0, opening, 0, 0, 0], code);
    }
    for (said, code) in [
        (answer(3, 127), AbortCode::SEQUENCE_NUMBER_INVALID),
        (answer(1, 0), AbortCode::BLOCK_SIZE_INVALID),
        (answer(1, 128), AbortCode::BLOCK_SIZE_INVALID),
    ] {
        let mut talk = Talk::write(terms(127), &first(28));
        talk.answer(GO);
        talk.wait(10);
        talk.breaks_off(said, code);
    }
}

#[test]
fn a_server_that_never_gets_anything_is_given_up() {
    let mut talk = Talk::write(terms(127), &first(28));
    talk.answer(GO);
    for round in 1..=8 {
        assert_eq!(talk.wait(10 * round), None);
        assert_eq!(talk.answer(answer(0, 2)), [[0; 8]; 0]);
    }
    talk.wait(90);
    talk.breaks_off(answer(0, 2), AbortCode::SEQUENCE_NUMBER_INVALID);
}

#[test]
fn a_cancelled_transfer_tells_the_server() {
    for mut talk in [Talk::read(terms(127)), Talk::write(terms(127), &first(28))] {
        talk.out.clear();
        talk.transfer.cancel(&mut talk.out);
        talk.transfer.cancel(&mut talk.out);
        assert_eq!(talk.said(), [[0x80, 0, 0x20, 0, 0, 0, 0, 8]]);
        assert_eq!(talk.hear(SIZE_20), None);
        assert_eq!(talk.transfer.deadline(), None);
    }
}

proptest! {
    #[test]
    fn any_frames_at_any_time_neither_panic_nor_outlast_the_deadline(
        write in proptest::option::of(proptest::collection::vec(any::<u8>(), 0..2_000)),
        (has_crc, is_best) in any::<(bool, bool)>(),
        steps in proptest::collection::vec((0_u64..50_000, 0_u8..20, any::<[u8; 8]>()), 0..200),
    ) {
        let block = if has_crc { block(5) } else { block(5).without_crc() };
        let terms = if is_best { Terms::best(TIMEOUT, block) } else { Terms::block(TIMEOUT, block) };
        let mut talk = match write {
            Some(bytes) => Talk::write(terms, &bytes),
            None => Talk::read(terms),
        };
        talk.out.clear();
        let (mut outcomes, mut number) = (0, 0);
        for (micros, kind, random) in steps {
            talk.now = talk.now + Duration::from_micros(micros);
            outcomes += u32::from(talk.transfer.on_time(talk.now, &mut talk.out).is_some());
            prop_assert!(talk.out.len() <= 1, "one a call");
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
            outcomes += u32::from(talk.hear(reply).is_some());
            prop_assert!(talk.out.len() <= 1, "one a call");
            talk.out.clear();
            prop_assert!(talk.transfer.deadline().is_none_or(|due| due <= talk.now + TIMEOUT));
        }
        let over = talk.now + 500 * TIMEOUT;
        outcomes += u32::from(talk.wait(over.as_micros() / 1_000).is_some());
        prop_assert_eq!(outcomes, 1);
        prop_assert_eq!(talk.transfer.deadline(), None);
    }
}
