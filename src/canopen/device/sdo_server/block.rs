//! Block transfer, seen from the server (CiA 301, 7.2.4.3.9 to 7.2.4.3.16). The frames are shown with the
//! client's [`block_upload`](crate::sdo) and `block_download`.

use canopen_rs::sdo::SdoPayload;

use crate::abort::AbortCode;
use crate::sdo::Receiver;
use crate::sdo::Sender;
use crate::sdo::Taken;

/// A value on its way up.
#[derive(Clone, Debug)]
pub(super) struct Upload {
    sender: Sender,
    has_crc: bool,
    state: State,
}

#[derive(Clone, Copy, Debug)]
enum State {
    /// Agreed; the client says when to start.
    Opened,
    Sending,
    /// All is there; the client confirms.
    Ending(SdoPayload),
}

/// What follows from a request in an upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
    /// A sub-block.
    Segments,
    /// A reply.
    Reply(SdoPayload),
    /// Nothing: it is over.
    Over,
}

impl Upload {
    /// Of `bytes`, in sub-blocks of `block_size` segments.
    ///
    /// # Errors
    /// When that is not 1 to 127.
    pub(super) fn new(bytes: Vec<u8>, block_size: u8, has_crc: bool) -> Result<Self, AbortCode> {
        let sender = Sender::new(bytes, block_size)?;
        Ok(Self { sender, has_crc, state: State::Opened })
    }

    /// Takes a start, the answer to a sub-block, or the confirmation of all.
    ///
    /// # Errors
    /// When it is none of these, or not its turn.
    pub(super) fn on_request(
        &mut self,
        [command, arrived, block_size, ..]: SdoPayload,
    ) -> Result<Next, AbortCode> {
        match (command & 3, self.state) {
            (START, State::Opened) => self.state = State::Sending,
            // The client has heard nothing yet.
            (START, State::Sending) => self.sender.again()?,
            (ANSWER, State::Sending) => {
                if self.sender.answered(arrived, block_size)? {
                    let [low, high] =
                        if self.has_crc { self.sender.sum() } else { 0 }.to_le_bytes();
                    let command = SCS_BLOCK_UPLOAD << 5 | self.sender.unused() << 2 | END;
                    let end = [command, low, high, 0, 0, 0, 0, 0];
                    self.state = State::Ending(end);
                    return Ok(Next::Reply(end));
                }
            }
            // The client has not heard the end.
            (ANSWER, State::Ending(end)) => return Ok(Next::Reply(end)),
            (END, State::Ending(_)) => return Ok(Next::Over),
            _ => return Err(AbortCode::COMMAND_UNKNOWN),
        }
        Ok(Next::Segments)
    }

    /// The next segment of the sub-block.
    pub(super) fn next(&mut self) -> Option<SdoPayload> {
        match self.state {
            State::Sending => self.sender.next(),
            State::Opened | State::Ending(_) => None,
        }
    }

    /// Whether [`next`](Self::next) has a segment.
    pub(super) const fn has_next(&self) -> bool {
        matches!(self.state, State::Sending) && self.sender.has_next()
    }
}

/// A value on its way down.
#[derive(Clone, Debug)]
pub(super) struct Download {
    receiver: Receiver,
}

impl Download {
    pub(super) const fn new(receiver: Receiver) -> Self {
        Self { receiver }
    }

    /// Whether segments come, whose first byte may be any but that of an abort.
    pub(super) const fn is_receiving(&self) -> bool {
        !self.receiver.is_complete()
    }

    /// Takes a segment; at the end of a sub-block it is answered.
    ///
    /// # Errors
    /// When it can be none.
    pub(super) fn on_segment(
        &mut self,
        segment: &SdoPayload,
    ) -> Result<Option<SdoPayload>, AbortCode> {
        Ok(match self.receiver.take(segment)? {
            Taken::InSequence | Taken::Passed => None,
            Taken::EndOfBlock => Some(self.receiver.answer()),
        })
    }

    /// The whole value, at its end.
    ///
    /// # Errors
    /// When it is not what was sent.
    pub(super) fn on_end(
        &mut self,
        [command, low, high, ..]: SdoPayload,
    ) -> Result<Vec<u8>, AbortCode> {
        self.receiver.finish(command >> 2 & 7, u16::from_le_bytes([low, high]))
    }

    /// Whether a frame is the last segment, come again.
    pub(super) fn is_again(&self, frame: &SdoPayload) -> bool {
        self.receiver.is_again(frame)
    }

    /// What to say when nothing comes.
    pub(super) fn nudge(&mut self) -> Option<SdoPayload> {
        self.receiver.nudge()
    }
}

/// What a server says at the very end of a download.
pub(super) const CONFIRMED: SdoPayload = [SCS_BLOCK_DOWNLOAD << 5 | END, 0, 0, 0, 0, 0, 0, 0];

pub(super) const SCS_BLOCK_DOWNLOAD: u8 = 5;
pub(super) const SCS_BLOCK_UPLOAD: u8 = 6;

// Subcommands: what a frame of a block transfer is.
const END: u8 = 1;
const ANSWER: u8 = 2;
const START: u8 = 3;
