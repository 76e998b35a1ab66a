//! Server side of block transfers (CiA 301, 7.2.4.3.9 to 7.2.4.3.16). The client's `block_upload` and
//! `block_download` in [`sdo`](canopen::sdo) show the frames.

use canopen_rs::sdo::SdoPayload;

use canopen::abort::AbortCode;
use canopen::sdo::{Receiver, SegmentEffect, Sender};

/// Block upload in progress.
#[derive(Clone, Debug)]
pub(super) struct Upload {
    sender: Sender,
    has_crc: bool,
    state: State,
}

#[derive(Clone, Copy, Debug)]
enum State {
    /// Initiated; waits for the start request.
    Opened,
    Sending,
    /// All segments have arrived; waits for the end response.
    Ending(SdoPayload),
}

/// Consequence of a request in an upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
    /// Sends a sub-block.
    Segments,
    /// Sends a reply.
    Reply(SdoPayload),
    /// Ends the transfer.
    Over,
}

impl Upload {
    /// Returns an upload of `bytes` in sub-blocks of `block_size` segments.
    ///
    /// # Errors
    /// Returns an abort code unless `block_size` is within 1..=127.
    pub(super) fn new(bytes: Vec<u8>, block_size: u8, has_crc: bool) -> Result<Self, AbortCode> {
        let sender = Sender::new(bytes, block_size)?;
        Ok(Self { sender, has_crc, state: State::Opened })
    }

    /// Takes a start, an acknowledgement of a sub-block, or the end response.
    ///
    /// # Errors
    /// Returns an abort code for any other request, or one out of order.
    pub(super) fn on_request(
        &mut self,
        [command, arrived, block_size, ..]: SdoPayload,
    ) -> Result<Next, AbortCode> {
        match (command & 3, self.state) {
            (START, State::Opened) => self.state = State::Sending,
            // The client has received no segment yet.
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
            // The client has not received the end request.
            (ANSWER, State::Ending(end)) => return Ok(Next::Reply(end)),
            (END, State::Ending(_)) => return Ok(Next::Over),
            _ => return Err(AbortCode::COMMAND_UNKNOWN),
        }
        Ok(Next::Segments)
    }

    /// Returns the next segment of the sub-block.
    pub(super) fn next(&mut self) -> Option<SdoPayload> {
        match self.state {
            State::Sending => self.sender.next_segment(),
            State::Opened | State::Ending(_) => None,
        }
    }

    /// Returns whether [`next`](Self::next) has a segment.
    pub(super) const fn has_next(&self) -> bool {
        matches!(self.state, State::Sending) && self.sender.has_next()
    }
}

/// Takes a segment of a download; returns the acknowledgement at the end of a sub-block.
///
/// # Errors
/// Returns an abort code for an invalid segment.
pub(super) fn on_segment(
    download: &mut Receiver,
    segment: &SdoPayload,
) -> Result<Option<SdoPayload>, AbortCode> {
    Ok(match download.take(segment)? {
        SegmentEffect::InSequence | SegmentEffect::Ignored => None,
        SegmentEffect::EndOfBlock => Some(download.answer()),
    })
}

/// Bit s of block transfers.
pub(super) const SIZE_INDICATED_IN_BLOCK: u8 = 1 << 1;
/// End response of a block download.
pub(super) const CONFIRMED: SdoPayload = [SCS_BLOCK_DOWNLOAD << 5 | END, 0, 0, 0, 0, 0, 0, 0];

pub(super) const SCS_BLOCK_DOWNLOAD: u8 = 5;
pub(super) const SCS_BLOCK_UPLOAD: u8 = 6;

// Subcommands of a block transfer.
const END: u8 = 1;
const ANSWER: u8 = 2;
const START: u8 = 3;
