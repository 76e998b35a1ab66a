//! Reassembly of SDO transfers from the frames of both sides (CiA 301, 7.2.4.3).
//!
//! Tolerant: an unexpected frame is decoded without its transfer. Covers expedited, segmented and block transfers. The first
//! bytes and the length of long values are kept.

use canopen::abort::AbortCode;
use canopen::object::Object;

/// Maximum stored bytes of a value.
const MAX_STORED: usize = 256;

/// Data bytes of a segment.
const SEGMENT: usize = 7;

/// Side of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Sender of the request, or of a segment of a download.
    Client,
    /// Node that holds the object: a response, or a segment of an upload.
    Server,
}

/// Step of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step<'t> {
    /// Sender of the frame.
    pub side: Side,
    /// Object, if known.
    pub object: Option<Object>,
    /// Effect of the frame on its transfer.
    pub action: Action<'t>,
}

/// Action of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action<'t> {
    /// Requests an upload (ccs 2).
    RequestUpload,
    /// Requests an expedited download.
    RequestDownload(Value<'t>),
    /// Initiates a longer transfer, with the indicated size.
    Begin(Option<u32>),
    /// Continues a transfer: bytes so far, and the indicated size.
    Part(usize, Option<u32>),
    /// Completes an upload.
    Read(Value<'t>),
    /// Completes a download.
    Written(Value<'t>),
    /// Aborts a transfer.
    Aborted(AbortCode),
    /// Part of a transfer whose initiation was not received.
    Stray,
}

/// Value of an object, or its beginning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Value<'t> {
    /// First bytes, at most 256, little-endian.
    pub bytes: &'t [u8],
    /// Total length, in bytes.
    pub length: usize,
    /// Indicated size, if it differs.
    pub announced: Option<u32>,
}

/// Transfer state of one server.
#[derive(Clone, Debug, Default)]
pub(super) struct Listener {
    phase: Phase,
    object: Option<Object>,
    announced: Option<u32>,
    kept: Vec<u8>,
    length: usize,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Idle,
    AskedRead,
    AskedWrite,
    Reading,
    /// Set if the last segment was sent.
    Writing(bool),
    /// Block transfer between segments.
    BlockAsked,
    /// Sub-block sent by this side.
    Block(Side, Block),
    /// Block transfer after its last segment.
    BlockEnding,
}

/// Sub-block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Block {
    /// Bytes before the sub-block.
    before: usize,
    /// Next sequence number.
    next: u8,
    /// Set if it contains the last segment.
    has_last: bool,
}

impl Listener {
    /// Takes one frame of eight bytes; [`step`](Self::step) adds its value.
    pub(super) fn on_frame(&mut self, side: Side, data: [u8; 8]) -> ActionKind {
        if let Phase::Block(sender, block) = self.phase
            && sender == side
        {
            return self.on_block_segment(block, data);
        }
        match side {
            Side::Client => self.on_request(data),
            Side::Server => self.on_response(data),
        }
    }

    /// Step of the newest frame, with the current value.
    pub(super) fn step(&self, side: Side, kind: ActionKind) -> Step<'_> {
        let is_wrong = |size: &u32| usize::try_from(*size) != Ok(self.length);
        let announced = self.announced.filter(is_wrong);
        let value = Value { bytes: &self.kept, length: self.length, announced };
        let action = match kind {
            ActionKind::RequestUpload => Action::RequestUpload,
            ActionKind::RequestDownload => Action::RequestDownload(value),
            ActionKind::Begin => Action::Begin(self.announced),
            ActionKind::Part => Action::Part(self.length, self.announced),
            ActionKind::Read => Action::Read(value),
            ActionKind::Written => Action::Written(value),
            ActionKind::Aborted(code) => Action::Aborted(code),
            ActionKind::Stray => return Step { side, object: None, action: Action::Stray },
        };
        Step { side, object: self.object, action }
    }

    fn on_request(&mut self, data: [u8; 8]) -> ActionKind {
        let [command, .., a, b, c, d] = data;
        let object = multiplexor(data);
        match command >> 5 {
            0 => self.on_segment(data, matches!(self.phase, Phase::Writing(false)), false),
            1 if command & EXPEDITED != 0 => {
                self.start(object, Phase::AskedWrite);
                self.take_expedited(data);
                ActionKind::RequestDownload
            }
            1 => {
                self.start(object, Phase::Writing(false));
                self.announced = announced(command & 1 != 0, [a, b, c, d]);
                ActionKind::Begin
            }
            2 => {
                self.start(object, Phase::AskedRead);
                ActionKind::RequestUpload
            }
            3 => self.part_if(self.phase == Phase::Reading),
            4 => self.abort(data),
            5 => match (command & 3, self.phase) {
                (0, _) => {
                    self.start(object, Phase::BlockAsked);
                    ActionKind::RequestUpload
                }
                (3, Phase::BlockAsked) => self.open_block(Side::Server),
                (2, Phase::Block(Side::Server, block)) => {
                    self.acknowledge(block, data, Side::Server)
                }
                (1, Phase::BlockEnding) => self.finish(ActionKind::Read),
                _ => ActionKind::Stray,
            },
            6 if command & 1 == 0 => {
                self.start(object, Phase::BlockAsked);
                self.announced = announced(command & 2 != 0, [a, b, c, d]);
                ActionKind::Begin
            }
            6 if self.phase == Phase::BlockEnding => self.trim(command),
            _ => ActionKind::Stray,
        }
    }

    fn on_response(&mut self, data: [u8; 8]) -> ActionKind {
        let [command, .., a, b, c, d] = data;
        let object = multiplexor(data);
        let is_same = self.object == Some(object);
        match command >> 5 {
            0 => self.on_segment(data, self.phase == Phase::Reading, true),
            1 if self.phase == Phase::Writing(true) => self.finish(ActionKind::Written),
            1 => self.part_if(self.phase == Phase::Writing(false)),
            2 if command & EXPEDITED != 0 => {
                self.start(object, Phase::Idle);
                self.take_expedited(data);
                ActionKind::Read
            }
            2 => {
                self.start(object, Phase::Reading);
                self.announced = announced(command & 1 != 0, [a, b, c, d]);
                ActionKind::Begin
            }
            3 if is_same && self.phase == Phase::AskedWrite => self.finish(ActionKind::Written),
            3 if is_same && self.phase == Phase::Writing(false) => ActionKind::Part,
            4 => self.abort(data),
            5 => match (command & 3, self.phase) {
                (0, Phase::BlockAsked) if is_same => self.open_block(Side::Client),
                (2, Phase::Block(Side::Client, block)) => {
                    self.acknowledge(block, data, Side::Client)
                }
                (1, Phase::BlockEnding) => self.finish(ActionKind::Written),
                _ => ActionKind::Stray,
            },
            6 if command & 1 == 0 && is_same && self.phase == Phase::BlockAsked => {
                self.announced = announced(command & 2 != 0, [a, b, c, d]);
                ActionKind::Begin
            }
            6 if command & 1 != 0 && self.phase == Phase::BlockEnding => self.trim(command),
            _ => ActionKind::Stray,
        }
    }

    /// Takes a segment of up to seven bytes.
    fn on_segment(&mut self, data: [u8; 8], is_expected: bool, is_read: bool) -> ActionKind {
        let [command, segment @ ..] = data;
        if !is_expected {
            return ActionKind::Stray;
        }
        let unused = usize::from(command >> 1 & 7);
        self.append(segment.get(..SEGMENT - unused).unwrap_or_default());
        match (command & 1 != 0, is_read) {
            (true, true) => self.finish(ActionKind::Read),
            (true, false) => {
                self.phase = Phase::Writing(true);
                ActionKind::Part
            }
            (false, _) => ActionKind::Part,
        }
    }

    /// Takes a block segment: a sequence number, and seven bytes that count if they are next.
    fn on_block_segment(&mut self, mut block: Block, data: [u8; 8]) -> ActionKind {
        let [command, segment @ ..] = data;
        if command == ABORT {
            return self.abort(data);
        }
        let Phase::Block(sender, _) = self.phase else { return ActionKind::Stray };
        if command & 0x7F == block.next && !block.has_last {
            self.append(&segment);
            block.next = block.next.saturating_add(1);
            block.has_last = command & 0x80 != 0;
            self.phase = Phase::Block(sender, block);
        }
        ActionKind::Part
    }

    fn open_block(&mut self, sender: Side) -> ActionKind {
        let block = Block { before: self.length, next: 1, has_last: false };
        self.phase = Phase::Block(sender, block);
        ActionKind::Part
    }

    /// Takes an acknowledgement; segments after the acknowledged one are sent again.
    fn acknowledge(&mut self, block: Block, data: [u8; 8], sender: Side) -> ActionKind {
        let [_, last, ..] = data;
        if last.saturating_add(1) < block.next {
            self.length = block.before + SEGMENT * usize::from(last);
            self.kept.truncate(self.length);
            self.open_block(sender)
        } else if block.has_last {
            self.phase = Phase::BlockEnding;
            ActionKind::Part
        } else {
            self.open_block(sender)
        }
    }

    /// Removes the unused bytes of the last segment.
    fn trim(&mut self, command: u8) -> ActionKind {
        self.length = self.length.saturating_sub(usize::from(command >> 2 & 7));
        self.kept.truncate(self.length);
        ActionKind::Part
    }

    fn start(&mut self, object: Object, phase: Phase) {
        self.phase = phase;
        self.object = Some(object);
        self.announced = None;
        self.kept.clear();
        self.length = 0;
    }

    fn take_expedited(&mut self, data: [u8; 8]) {
        let [command, _, _, _, four @ ..] = data;
        let unused = if command & 1 == 0 { 0 } else { usize::from(command >> 2 & 3) };
        self.append(four.get(..4 - unused).unwrap_or_default());
    }

    fn append(&mut self, bytes: &[u8]) {
        let room = MAX_STORED.saturating_sub(self.kept.len());
        self.kept.extend(bytes.iter().take(room));
        self.length = self.length.saturating_add(bytes.len());
    }

    const fn part_if(&self, is_expected: bool) -> ActionKind {
        if is_expected { ActionKind::Part } else { ActionKind::Stray }
    }

    const fn finish(&mut self, kind: ActionKind) -> ActionKind {
        self.phase = Phase::Idle;
        kind
    }

    fn abort(&mut self, data: [u8; 8]) -> ActionKind {
        let [.., a, b, c, d] = data;
        self.start(multiplexor(data), Phase::Idle);
        ActionKind::Aborted(AbortCode(u32::from_le_bytes([a, b, c, d])))
    }
}

/// [`Action`] without its borrowed value.
#[derive(Clone, Copy, Debug)]
pub(super) enum ActionKind {
    RequestUpload,
    RequestDownload,
    Begin,
    Part,
    Read,
    Written,
    Aborted(AbortCode),
    Stray,
}

/// Bit e: the frame carries the value.
const EXPEDITED: u8 = 1 << 1;
/// Command byte of an abort.
const ABORT: u8 = 0x80;

/// Decodes index and sub-index.
const fn multiplexor(data: [u8; 8]) -> Object {
    let [_, low, high, sub, ..] = data;
    Object { index: u16::from_le_bytes([low, high]), sub }
}

fn announced(is_said: bool, bytes: [u8; 4]) -> Option<u32> {
    is_said.then(|| u32::from_le_bytes(bytes))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Text of the steps of these frames.
    fn steps_of(listener: &mut Listener, frames: &[(Side, [u8; 8])]) -> Vec<String> {
        let step = |(side, data): &(Side, [u8; 8])| {
            let kind = listener.on_frame(*side, *data);
            format!("{:?}", listener.step(*side, kind).action)
        };
        frames.iter().map(step).collect()
    }

    /// Frames of a segmented value after its initiation.
    fn segments(side: Side, bytes: &[u8]) -> Vec<(Side, [u8; 8])> {
        let count = bytes.chunks(SEGMENT).count();
        let other = if side == Side::Client { Side::Server } else { Side::Client };
        let frame = |(place, chunk): (usize, &[u8])| {
            let toggle = u8::from(place % 2 == 1) << 4;
            let unused = u8::try_from(SEGMENT - chunk.len()).unwrap() << 1;
            let mut data = [0; 8];
            data[0] = toggle | unused | u8::from(place + 1 == count);
            data[1..=chunk.len()].copy_from_slice(chunk);
            let answer = if side == Side::Client { 0x20 } else { 0x60 } | toggle;
            let answer = (other, [answer, 0, 0, 0, 0, 0, 0, 0]);
            if side == Side::Client { [(side, data), answer] } else { [answer, (side, data)] }
        };
        bytes.chunks(SEGMENT).enumerate().flat_map(frame).collect()
    }

    const NAME: [u8; 3] = [0x08, 0x10, 0];

    fn initiate(command: u8, length: usize) -> [u8; 8] {
        let [a, b, c] = NAME;
        let [l0, l1, l2, l3] = u32::try_from(length).unwrap().to_le_bytes();
        [command, a, b, c, l0, l1, l2, l3]
    }

    #[test]
    fn expedited_transfer_is_a_request_and_a_reply() {
        let mut listener = Listener::default();
        let steps = steps_of(
            &mut listener,
            &[
                (Side::Client, [0x40, 0x18, 0x10, 1, 0, 0, 0, 0]),
                (Side::Server, [0x4B, 0x18, 0x10, 1, 0x8C, 0x0F, 0, 0]),
                (Side::Client, [0x2F, 0x60, 0x60, 0, 10, 0, 0, 0]),
                (Side::Server, [0x60, 0x60, 0x60, 0, 0, 0, 0, 0]),
                (Side::Server, [0x80, 0x60, 0x60, 0, 0x11, 0, 9, 6]),
            ],
        );
        assert_eq!(
            steps,
            [
                "RequestUpload",
                "Read(Value { bytes: [140, 15], length: 2, announced: None })",
                "RequestDownload(Value { bytes: [10], length: 1, announced: None })",
                "Written(Value { bytes: [10], length: 1, announced: None })",
                "Aborted(AbortCode(101253137))",
            ]
        );
    }

    #[test]
    fn reply_about_another_object_confirms_nothing() {
        let mut listener = Listener::default();
        let steps = steps_of(
            &mut listener,
            &[
                (Side::Client, [0x2F, 0x60, 0x60, 0, 10, 0, 0, 0]),
                (Side::Server, [0x60, 0x61, 0x60, 0, 0, 0, 0, 0]),
            ],
        );
        assert_eq!(steps[1], "Stray");
    }

    /// Block transfer of `sender` with one lost segment in the first sub-block.
    fn block(sender: Side, bytes: &[u8]) -> Vec<(Side, [u8; 8])> {
        let other = if sender == Side::Client { Side::Server } else { Side::Client };
        let mut frames = match sender {
            Side::Client => {
                vec![(sender, initiate(0xC6, bytes.len())), (other, initiate(0xA4, 127))]
            }
            Side::Server => vec![
                (other, initiate(0xA4, 127)),
                (sender, initiate(0xC6, bytes.len())),
                (other, [0xA3, 0, 0, 0, 0, 0, 0, 0]),
            ],
        };
        let count = bytes.len().div_ceil(SEGMENT);
        let segment = |place: usize, number: usize| {
            let from = place * SEGMENT;
            let chunk = &bytes[from..bytes.len().min(from + SEGMENT)];
            let last = u8::from(place + 1 == count) << 7;
            let mut data = [0xEE; 8];
            data[0] = u8::try_from(number).unwrap() | last;
            data[1..=chunk.len()].copy_from_slice(chunk);
            (sender, data)
        };
        let lost = usize::from(count > 2);
        if lost == 1 {
            frames.extend([segment(0, 1), segment(2, 3)]);
            frames.push((other, [0xA2, 1, 127, 0, 0, 0, 0, 0]));
        }
        frames.extend((lost..count).map(|place| segment(place, place - lost + 1)));
        let last = u8::try_from(count - lost).unwrap();
        frames.push((other, [0xA2, last, 127, 0, 0, 0, 0, 0]));
        let unused = u8::try_from(count * SEGMENT - bytes.len()).unwrap();
        frames.push((sender, [0xC1 | unused << 2, 0, 0, 0, 0, 0, 0, 0]));
        frames.push((other, [0xA1, 0, 0, 0, 0, 0, 0, 0]));
        frames
    }

    proptest! {
        #[test]
        fn segmented_values_are_reassembled(
            bytes in proptest::collection::vec(any::<u8>(), 1..400),
        ) {
            let kept = bytes.get(..MAX_STORED).unwrap_or(&bytes);
            let value = Value { bytes: kept, length: bytes.len(), announced: None };
            let mut read = vec![
                (Side::Client, initiate(0x40, 0)),
                (Side::Server, initiate(0x41, bytes.len())),
            ];
            read.extend(segments(Side::Server, &bytes));
            let mut written = vec![
                (Side::Client, initiate(0x21, bytes.len())),
                (Side::Server, initiate(0x60, 0)),
            ];
            written.extend(segments(Side::Client, &bytes));
            let transfers = [
                (read, Action::Read(value)),
                (written, Action::Written(value)),
                (block(Side::Client, &bytes), Action::Written(value)),
                (block(Side::Server, &bytes), Action::Read(value)),
            ];
            let mut listener = Listener::default();
            for (frames, action) in transfers {
                let steps = steps_of(&mut listener, &frames);
                prop_assert_eq!(steps.last(), Some(&format!("{action:?}")));
                prop_assert!(!steps.contains(&"Stray".to_owned()), "{:?}", steps);
            }
        }

        #[test]
        fn any_frames_keep_memory_bounded(
            frames in proptest::collection::vec((any::<bool>(), any::<[u8; 8]>()), 0..300),
        ) {
            let mut listener = Listener::default();
            for (is_client, data) in frames {
                let side = if is_client { Side::Client } else { Side::Server };
                listener.on_frame(side, data);
                prop_assert!(listener.kept.len() <= MAX_STORED);
                prop_assert!(listener.kept.len() == listener.length.min(MAX_STORED));
            }
        }
    }
}
