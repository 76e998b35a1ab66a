//! Server side of SDO transfers, frame by frame: the sequences of the standard, and refusals.

use std::time::Duration;

use canopen_rs::NodeId;
use canopen_rs::sdo::SdoPayload;
use proptest::prelude::*;

use crate::sdo_server::segmented::{LAST, TOGGLE};
use crate::sdo_server::{
    Access, CLIENT_TIMEOUT, RETRY_TIMEOUT, SEGMENT_INTERVAL, SdoServer, abort,
};
use canopen::abort::AbortCode;
use canopen::frame::Frame;
use canopen::object::Object;
use units::time::Instant;

/// One object of any size, and one of two bytes.
#[derive(Default)]
struct Shelf {
    text: Vec<u8>,
    number: [u8; 2],
}

const TEXT: Object = Object { index: 0x2000, sub: 0 };
const NUMBER: Object = Object { index: 0x2001, sub: 3 };

impl Access for Shelf {
    fn read(&self, object: Object, bytes: &mut Vec<u8>) -> Result<(), AbortCode> {
        bytes.extend_from_slice(if object == TEXT { &self.text } else { &self.number });
        Ok(())
    }

    fn size(&self, object: Object) -> Result<Option<usize>, AbortCode> {
        match object {
            TEXT => Ok(None),
            NUMBER => Ok(Some(2)),
            _ => Err(AbortCode::NO_OBJECT),
        }
    }

    fn write(&mut self, object: Object, bytes: &[u8]) -> Result<(), AbortCode> {
        if object == TEXT {
            self.text = bytes.to_vec();
        } else {
            self.number = bytes.try_into().unwrap();
        }
        Ok(())
    }
}

fn server() -> SdoServer {
    SdoServer::new(NodeId::new(5).unwrap())
}

fn reply(server: &mut SdoServer, shelf: &mut Shelf, request: SdoPayload) -> SdoPayload {
    let replies = replies(server, shelf, request);
    assert_eq!(replies.len(), 1, "one reply");
    replies[0]
}

fn replies(server: &mut SdoServer, shelf: &mut Shelf, request: SdoPayload) -> Vec<SdoPayload> {
    let mut out = Vec::new();
    server.serve(Instant::ZERO, request, shelf, &mut out);
    while let Some(due) = server.due {
        server.on_time(due, &mut out);
    }
    assert!(out.iter().all(|frame| frame.cob_id == 0x585));
    out.iter().map(|frame| frame.data().try_into().unwrap()).collect()
}

fn refusal(object: Object, code: AbortCode) -> SdoPayload {
    abort(object, code)
}

#[test]
fn text_is_downloaded_and_uploaded_in_segments() {
    for size in [0, 1, 4, 6, 7, 8, 14, 15, 100] {
        let text: Vec<u8> = (0..size).collect();
        for initiate in [[0x21, 0, 0x20, 0, size, 0, 0, 0], [0x20, 0, 0x20, 0, 0, 0, 0, 0]] {
            let (mut server, mut shelf) = (server(), Shelf::default());
            let confirmed = reply(&mut server, &mut shelf, initiate);
            assert_eq!(confirmed, [0x60, 0, 0x20, 0, 0, 0, 0, 0]);
            let mut pieces: Vec<&[u8]> = text.chunks(7).collect();
            if pieces.is_empty() {
                pieces.push(&[]);
            }
            for (place, piece) in pieces.iter().enumerate() {
                let toggle = if place % 2 == 0 { 0 } else { TOGGLE };
                let unused = u8::try_from(7 - piece.len()).unwrap();
                let mut segment = [0; 8];
                segment[0] = toggle | unused << 1 | u8::from(place + 1 == pieces.len());
                segment[1..=piece.len()].copy_from_slice(piece);
                let confirmed = reply(&mut server, &mut shelf, segment);
                assert_eq!(confirmed, [0x20 | toggle, 0, 0, 0, 0, 0, 0, 0]);
            }
            assert_eq!(shelf.text, text);
            assert_eq!(uploaded(&mut server, &mut shelf), text);
        }
    }
}

fn uploaded(server: &mut SdoServer, shelf: &mut Shelf) -> Vec<u8> {
    let [command, _, _, _, four @ ..] = reply(server, shelf, [0x40, 0, 0x20, 0, 0, 0, 0, 0]);
    if command & 2 != 0 {
        return four[..4 - usize::from(command >> 2 & 3)].to_vec();
    }
    assert_eq!(command, 0x41);
    let (mut text, mut toggle) = (Vec::new(), 0);
    loop {
        let [command, seven @ ..] = reply(server, shelf, [0x60 | toggle, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(command & TOGGLE, toggle);
        text.extend_from_slice(&seven[..7 - usize::from(command >> 1 & 7)]);
        toggle ^= TOGGLE;
        if command & LAST != 0 {
            assert_eq!(text.len(), usize::try_from(u32::from_le_bytes(four)).unwrap());
            return text;
        }
    }
}

#[test]
fn expedited_write_may_omit_its_size() {
    let (mut server, mut shelf) = (server(), Shelf::default());
    let confirmed = reply(&mut server, &mut shelf, [0x22, 1, 0x20, 3, 7, 8, 9, 9]);
    assert_eq!(confirmed, [0x60, 1, 0x20, 3, 0, 0, 0, 0]);
    assert_eq!(shelf.number, [7, 8]);
    reply(&mut server, &mut shelf, [0x22, 0, 0x20, 0, 7, 8, 9, 9]);
    assert_eq!(shelf.text, [7, 8, 9, 9]);
}

#[test]
fn wrong_length_is_refused() {
    let (mut server, mut shelf) = (server(), Shelf::default());
    for (request, code) in [
        ([0x21, 1, 0x20, 3, 3, 0, 0, 0], AbortCode::LENGTH_TOO_HIGH),
        ([0x21, 1, 0x20, 3, 1, 0, 0, 0], AbortCode::LENGTH_TOO_LOW),
        ([0x23, 1, 0x20, 3, 0, 0, 0, 0], AbortCode::LENGTH_TOO_HIGH),
        ([0x2F, 1, 0x20, 3, 0, 0, 0, 0], AbortCode::LENGTH_TOO_LOW),
    ] {
        assert_eq!(reply(&mut server, &mut shelf, request), refusal(NUMBER, code));
    }
    for (segment, code) in [(0x09, AbortCode::LENGTH_TOO_HIGH), (0x0D, AbortCode::LENGTH_TOO_LOW)] {
        reply(&mut server, &mut shelf, [0x20, 1, 0x20, 3, 0, 0, 0, 0]);
        let refused = reply(&mut server, &mut shelf, [segment, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(refused, refusal(NUMBER, code));
    }
    assert_eq!(shelf.number, [0, 0]);
}

#[test]
fn wrong_toggle_bit_ends_the_transfer() {
    let (mut server, mut shelf) = (server(), Shelf { text: vec![1; 20], ..Shelf::default() });
    for (initiate, segment) in [(0x20, 0x10), (0x40, 0x70)] {
        reply(&mut server, &mut shelf, [initiate, 0, 0x20, 0, 0, 0, 0, 0]);
        let refused = reply(&mut server, &mut shelf, [segment, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(refused, refusal(TEXT, AbortCode::TOGGLE_NOT_ALTERNATED));
        let nothing = Object { index: 0, sub: 0 };
        let refused = reply(&mut server, &mut shelf, [segment, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(refused, refusal(nothing, AbortCode::COMMAND_UNKNOWN));
    }
}

#[test]
fn new_initiation_ends_the_running_transfer() {
    let (mut server, mut shelf) = (server(), Shelf::default());
    reply(&mut server, &mut shelf, [0x20, 0, 0x20, 0, 0, 0, 0, 0]);
    reply(&mut server, &mut shelf, [0x2B, 1, 0x20, 3, 1, 2, 0, 0]);
    let [command, ..] = reply(&mut server, &mut shelf, [0x01, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(command, 0x80, "its segment belongs to nothing");
    assert_eq!((shelf.text.len(), shelf.number), (0, [1, 2]));
}

#[test]
fn abort_ends_a_transfer_without_reply() {
    let (mut server, mut shelf) = (server(), Shelf::default());
    reply(&mut server, &mut shelf, [0x20, 0, 0x20, 0, 0, 0, 0, 0]);
    assert_eq!(replies(&mut server, &mut shelf, [0x80, 0, 0x20, 0, 0, 0, 4, 5]), NOTHING);
    let [command, ..] = reply(&mut server, &mut shelf, [0x01, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(command, 0x80);
}

const NOTHING: [SdoPayload; 0] = [];

/// Text of 21 bytes: three segments.
fn shelf_of_three() -> (SdoServer, Shelf) {
    (server(), Shelf { text: (1..=21).collect(), ..Shelf::default() })
}

fn segment(number: u8, from: u8) -> SdoPayload {
    let [a, b, c, d, e, f, g] = [0, 1, 2, 3, 4, 5, 6].map(|place| from + place);
    [number, a, b, c, d, e, f, g]
}

/// CRC of these bytes, from `binascii.crc_hqx` of Python.
const SUM: [u8; 2] = [0xF0, 0xCD];

#[test]
fn block_upload_follows_the_standard() {
    let (mut server, mut shelf) = shelf_of_three();
    let mut send = |request| replies(&mut server, &mut shelf, request);
    assert_eq!(send([0xA4, 0, 0x20, 0, 2, 0, 0, 0]), [[0xC6, 0, 0x20, 0, 21, 0, 0, 0]]);
    let start = [0xA3, 0, 0, 0, 0, 0, 0, 0];
    assert_eq!(send(start), [segment(1, 1), segment(2, 8)]);
    assert_eq!(send([0xA2, 1, 2, 0, 0, 0, 0, 0]), [segment(1, 8), segment(0x82, 15)], "one lost");
    assert_eq!(send([0xA2, 2, 2, 0, 0, 0, 0, 0]), [[0xC1, SUM[0], SUM[1], 0, 0, 0, 0, 0]]);
    assert_eq!(send([0xA1, 0, 0, 0, 0, 0, 0, 0]), NOTHING);
    assert_eq!(send(start)[0][0], 0x80, "it is over");
}

#[test]
fn block_segments_are_sent_at_their_interval() {
    let (mut server, mut shelf) = shelf_of_three();
    reply(&mut server, &mut shelf, [0xA4, 0, 0x20, 0, 127, 0, 0, 0]);
    let mut out = Vec::new();
    server.serve(Instant::ZERO, [0xA3, 0, 0, 0, 0, 0, 0, 0], &mut shelf, &mut out);
    for place in 1..=3 {
        assert_eq!(out.len(), place, "one by {:?}", server.deadline());
        let due = Instant::ZERO + SEGMENT_INTERVAL.saturating_mul(u32::try_from(place).unwrap());
        server.on_time(due - Duration::from_micros(1), &mut out);
        assert_eq!(out.len(), place, "no sooner than its time");
        server.on_time(due, &mut out);
    }
    assert_eq!(server.due, None, "three are all");
}

#[test]
fn block_download_follows_the_standard() {
    let (mut server, mut shelf) = (server(), Shelf::default());
    let opening = [0xC6, 0, 0x20, 0, 20, 0, 0, 0];
    assert_eq!(reply(&mut server, &mut shelf, opening), [0xA4, 0, 0x20, 0, 127, 0, 0, 0]);
    for (segment, sent) in [
        (segment(1, 1), None),
        (segment(1, 1), None),
        (segment(0x83, 15), Some([0xA2, 1, 127, 0, 0, 0, 0, 0])),
        (segment(1, 8), None),
        (segment(0x82, 15), Some([0xA2, 2, 127, 0, 0, 0, 0, 0])),
        (segment(0x82, 15), None),
    ] {
        assert_eq!(replies(&mut server, &mut shelf, segment), Vec::from_iter(sent));
    }
    let [low, high] = canopen_rs::sdo::block::crc16(&Vec::from_iter(1..=20)).to_le_bytes();
    let end = [0xC5, low, high, 0, 0, 0, 0, 0];
    assert_eq!(reply(&mut server, &mut shelf, end), [0xA1, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(shelf.text, Vec::from_iter(1..=20));
}

#[test]
fn wrong_crc_or_size_stores_nothing() {
    let ours = canopen_rs::sdo::block::crc16(&[1, 2, 3, 4, 5, 6, 7]).to_le_bytes();
    for (opening, end, code) in [
        ([0xC6, 7], [0xC1, ours[0] ^ 1, ours[1]], AbortCode::CRC_ERROR),
        ([0xC6, 8], [0xC1, ours[0], ours[1]], AbortCode::LENGTH_TOO_LOW),
        ([0xC2, 6], [0xC1, 0, 0], AbortCode::LENGTH_TOO_HIGH),
    ] {
        let (mut server, mut shelf) = (server(), Shelf::default());
        reply(&mut server, &mut shelf, [opening[0], 0, 0x20, 0, opening[1], 0, 0, 0]);
        reply(&mut server, &mut shelf, segment(0x81, 1));
        let end = [end[0], end[1], end[2], 0, 0, 0, 0, 0];
        assert_eq!(reply(&mut server, &mut shelf, end), refusal(TEXT, code));
        assert!(shelf.text.is_empty());
    }
}

#[test]
fn block_may_omit_size_and_crc() {
    let (mut server, mut shelf) = (server(), Shelf::default());
    reply(&mut server, &mut shelf, [0xC0, 0, 0x20, 0, 0, 0, 0, 0]);
    reply(&mut server, &mut shelf, segment(0x81, 1));
    reply(&mut server, &mut shelf, [0xD1, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(shelf.text, [1, 2, 3]);
}

#[test]
fn block_without_size_must_fit_its_object() {
    let (mut server, mut shelf) = (server(), Shelf::default());
    reply(&mut server, &mut shelf, [0xC0, 1, 0x20, 3, 0, 0, 0, 0]);
    reply(&mut server, &mut shelf, segment(0x81, 1));
    let refused = reply(&mut server, &mut shelf, [0xD1, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(refused, refusal(NUMBER, AbortCode::LENGTH_TOO_HIGH));
    assert_eq!(shelf.number, [0, 0]);
}

#[test]
fn invalid_block_requests_are_refused() {
    let (mut server, mut shelf) = shelf_of_three();
    for (requests, object, code) in [
        (vec![[0xA4, 0, 0x20, 0, 0, 0, 0, 0]], TEXT, AbortCode::BLOCK_SIZE_INVALID),
        (vec![[0xA4, 0, 0x20, 0, 128, 0, 0, 0]], TEXT, AbortCode::BLOCK_SIZE_INVALID),
        (vec![[0xC6, 0, 0x20, 0, 0, 0, 0, 2]], TEXT, AbortCode::OUT_OF_MEMORY),
        (vec![[0xC6, 1, 0x20, 3, 3, 0, 0, 0]], NUMBER, AbortCode::LENGTH_TOO_HIGH),
        (vec![[0xC6, 0, 0x20, 0, 9, 0, 0, 0], [0; 8]], TEXT, AbortCode::SEQUENCE_NUMBER_INVALID),
        (
            vec![[0xA4, 0, 0x20, 0, 2, 0, 0, 0], [0xA2, 1, 2, 0, 0, 0, 0, 0]],
            TEXT,
            AbortCode::COMMAND_UNKNOWN,
        ),
        (
            vec![
                [0xA4, 0, 0x20, 0, 2, 0, 0, 0],
                [0xA3, 0, 0, 0, 0, 0, 0, 0],
                [0xA2, 3, 2, 0, 0, 0, 0, 0],
            ],
            TEXT,
            AbortCode::SEQUENCE_NUMBER_INVALID,
        ),
    ] {
        let sent: Vec<_> =
            requests.into_iter().map(|request| replies(&mut server, &mut shelf, request)).collect();
        assert_eq!(sent.last().unwrap(), &[refusal(object, code)]);
        let [command, ..] = reply(&mut server, &mut shelf, [0x60, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(command, 0x80, "nothing is under way");
    }
}

#[test]
fn short_value_switches_to_segments_below_the_threshold() {
    let (mut server, mut shelf) = shelf_of_three();
    for (threshold, command) in [(20, 0xC6), (21, 0x41)] {
        let request = [0xA4, 0, 0x20, 0, 127, threshold, 0, 0];
        let sent = reply(&mut server, &mut shelf, request);
        assert_eq!(sent, [command, 0, 0x20, 0, 21, 0, 0, 0]);
    }
    let sent = reply(&mut server, &mut shelf, [0xA0, 1, 0x20, 3, 127, 2, 0, 0]);
    assert_eq!(sent, [0x4B, 1, 0x20, 3, 0, 0, 0, 0], "expedited");
}

#[test]
fn silent_client_is_aborted_after_its_timeout() {
    let openings: [&[SdoPayload]; 4] = [
        &[[0x20, 0, 0x20, 0, 0, 0, 0, 0]],
        &[[0x40, 0, 0x20, 0, 0, 0, 0, 0]],
        &[[0xA4, 0, 0x20, 0, 2, 0, 0, 0], [0xA3, 0, 0, 0, 0, 0, 0, 0]],
        &[[0xC6, 0, 0x20, 0, 9, 0, 0, 0], [1, 0, 0, 0, 0, 0, 0, 0]],
    ];
    for opening in openings {
        let (mut server, mut shelf) = shelf_of_three();
        for request in opening {
            replies(&mut server, &mut shelf, *request);
        }
        let mut out = Vec::new();
        while let Some(due) = server.deadline() {
            assert!(due <= Instant::ZERO + CLIENT_TIMEOUT);
            out.clear();
            server.on_time(due, &mut out);
        }
        assert_eq!(out, [Frame::new(0x585, refusal(TEXT, AbortCode::TIMED_OUT))]);
    }
}

#[test]
fn lost_segments_are_requested_after_a_timeout() {
    let (mut server, mut shelf) = (server(), Shelf::default());
    reply(&mut server, &mut shelf, [0xC6, 0, 0x20, 0, 90, 0, 0, 0]);
    let retry = |server: &mut SdoServer| {
        let mut out = Vec::new();
        server.on_time(Instant::ZERO + RETRY_TIMEOUT, &mut out);
        out
    };
    assert_eq!(retry(&mut server), [Frame::new(0x585, [0xA2, 0, 127, 0, 0, 0, 0, 0])]);
    assert_eq!(retry(&mut server), [], "once");
    assert_eq!(replies(&mut server, &mut shelf, segment(1, 1)), NOTHING);
    assert_eq!(replies(&mut server, &mut shelf, segment(2, 8)), NOTHING);
    assert_eq!(retry(&mut server), [Frame::new(0x585, [0xA2, 2, 127, 0, 0, 0, 0, 0])]);
}

proptest! {
    #[test]
    fn any_requests_get_bounded_replies_and_end(
        requests in proptest::collection::vec(
            (any::<[u8; 8]>(), 0_usize..16, any::<bool>(), 0_u64..400_000), 0..200,
        ),
    ) {
        let (mut server, mut shelf) = shelf_of_three();
        let (mut now, mut out) = (Instant::ZERO, Vec::new());
        let known = [
            0x20, 0x21, 0x23, 0x40, 0x60, 0x70, 0x80, 0xA0, 0xA1, 0xA2, 0xA3, 0xA4, 0xC1, 0xC6,
            0x01, 0x82,
        ];
        for (mut request, place, is_known, micros) in requests {
            if is_known {
                request = [known[place], 0, 0x20, 0, request[4], 0, 0, 0];
            }
            now = now + Duration::from_micros(micros);
            server.on_time(now, &mut out);
            server.serve(now, request, &mut shelf, &mut out);
            prop_assert!(out.len() <= 129);
            out.clear();
        }
        for _ in 0..2 {
            server.on_time(now + CLIENT_TIMEOUT, &mut out);
        }
        prop_assert_eq!(server.deadline(), None);
    }
}
