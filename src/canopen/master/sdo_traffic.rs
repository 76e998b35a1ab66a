//! SDO frames of one node outside this master's transfers: another client reads or writes.
//!
//! The bus does not return a master's own frames, so every received request comes from another client. A
//! download (CiA 301, 7.2.4.3: ccs 1 initiates, ccs 6 by blocks, ccs 0 carries a segment) changes the
//! configuration. An upload only disturbs: a server serves one transfer at a time.
//!
//! The confirmation of a download that this master did not request shows one whose request was not
//! received. During another client's block upload, a segment may look like any reply.

use std::time::Duration;

use crate::frame::Frame;
use crate::object::Object;
use crate::sdo::command::{
    CCS_BLOCK_DOWNLOAD, CCS_BLOCK_UPLOAD, CCS_DOWNLOAD, CCS_DOWNLOAD_SEGMENT, CCS_UPLOAD, CS_ABORT,
    SCS_BLOCK_DOWNLOAD, SCS_DOWNLOAD,
};
use units::time::Instant;

/// Maximum downloads of this master awaiting confirmation; the oldest is forgotten first.
const MAX_OPEN: usize = 8;

/// Time without a request after which a block upload is over: a sub-block takes 1.7 s at 10 kbit/s.
const BLOCK_TIMEOUT: Duration = Duration::from_secs(3);

/// Request of another client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Foreign {
    /// Initiates or continues a download: another master.
    Download,
    /// Initiates an upload.
    Upload,
    /// Continues an upload, or aborts a transfer.
    Other,
}

/// SDO requests and confirmations of one node's server.
#[derive(Clone, Debug, Default)]
pub(super) struct SdoTraffic {
    /// Unconfirmed downloads of this master, the newest first.
    open: [Option<Object>; MAX_OPEN],
    /// Time of the last request in another client's block upload.
    block_upload: Option<Instant>,
}

impl SdoTraffic {
    /// Takes a request that this master sends.
    pub(super) fn on_sent(&mut self, frame: &Frame) {
        let (Some(command), Some(object)) = (specifier(frame), object(frame)) else { return };
        if matches!(command, CCS_DOWNLOAD | CCS_BLOCK_DOWNLOAD) {
            self.open.rotate_right(1);
            if let Some(newest) = self.open.first_mut() {
                *newest = Some(object);
            }
        }
    }

    /// Takes a request of another client. A request that is too short counts, as some servers accept it.
    pub(super) fn on_request(&mut self, now: Instant, frame: &Frame) -> Option<Foreign> {
        let command = *frame.data().first()?;
        match command >> 5 {
            CCS_DOWNLOAD_SEGMENT | CCS_DOWNLOAD | CCS_BLOCK_DOWNLOAD => Some(Foreign::Download),
            CCS_UPLOAD => Some(Foreign::Upload),
            CCS_BLOCK_UPLOAD => {
                let subcommand = command & BLOCK_SUBCOMMAND;
                self.block_upload = (subcommand != BLOCK_END).then_some(now);
                let is_first = subcommand == BLOCK_INITIATE;
                Some(if is_first { Foreign::Upload } else { Foreign::Other })
            }
            CS_ABORT => {
                self.block_upload = None;
                Some(Foreign::Other)
            }
            _ => Some(Foreign::Other),
        }
    }

    /// Takes a reply. Returns whether it confirms a download that this master did not request.
    pub(super) fn is_foreign_reply(&mut self, now: Instant, frame: &Frame) -> bool {
        if self.block_upload.is_some_and(|last| now.since(last) < BLOCK_TIMEOUT) {
            return false;
        }
        match specifier(frame) {
            Some(SCS_DOWNLOAD) => !self.is_confirmed(object(frame)),
            Some(CS_ABORT) => {
                self.is_confirmed(object(frame));
                false
            }
            // This master never downloads by blocks.
            Some(SCS_BLOCK_DOWNLOAD) => true,
            _ => false,
        }
    }

    /// Removes a download from the unconfirmed ones; returns whether it was among them.
    fn is_confirmed(&mut self, object: Option<Object>) -> bool {
        let mut open = self.open.iter_mut().rev();
        let place = open.find(|place| place.is_some() && **place == object);
        place.is_some_and(|place| place.take().is_some())
    }
}

/// Returns the command specifier of an eight-byte frame.
fn specifier(frame: &Frame) -> Option<u8> {
    let &[command, _, _, _, _, _, _, _] = frame.data() else { return None };
    Some(command >> 5)
}

/// Returns the object that a request or a reply names.
fn object(frame: &Frame) -> Option<Object> {
    let &[_, low, high, sub, ..] = frame.data() else { return None };
    Some(Object { index: u16::from_le_bytes([low, high]), sub })
}

/// Subcommand bits of a block upload request.
const BLOCK_SUBCOMMAND: u8 = 0b11;
const BLOCK_INITIATE: u8 = 0;
const BLOCK_END: u8 = 1;

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Instant = Instant::ZERO;

    fn request(command: u8, index: u16, sub: u8) -> Frame {
        let [low, high] = index.to_le_bytes();
        Frame::new(0x603, [command, low, high, sub, 0, 0, 0, 0])
    }

    fn reply(command: u8, index: u16, sub: u8) -> Frame {
        let [low, high] = index.to_le_bytes();
        Frame::new(0x583, [command, low, high, sub, 0, 0, 0, 0])
    }

    #[test]
    fn foreign_write_requests_are_downloads() {
        let mut traffic = SdoTraffic::default();
        for (command, foreign) in [
            (0x2B, Foreign::Download),
            (0x23, Foreign::Download),
            (0x21, Foreign::Download),
            (0xC2, Foreign::Download),
            (0x00, Foreign::Download),
            (0x10, Foreign::Download),
            (0x40, Foreign::Upload),
            (0xA0, Foreign::Upload),
            (0x60, Foreign::Other),
            (0xA3, Foreign::Other),
            (0xA2, Foreign::Other),
            (0x80, Foreign::Other),
        ] {
            let request = request(command, 0x1400, 5);
            assert_eq!(traffic.on_request(NOW, &request), Some(foreign), "{command:02X}");
        }
        let short = Frame::new(0x603, [0x2F, 0x00, 0x14, 5, 0]);
        assert_eq!(traffic.on_request(NOW, &short), Some(Foreign::Download));
        assert_eq!(traffic.on_request(NOW, &Frame::new(0x603, [])), None);
    }

    #[test]
    fn confirmation_without_own_request_is_foreign() {
        let mut traffic = SdoTraffic::default();
        let confirmed = reply(0x60, 0x1400, 5);
        assert!(traffic.is_foreign_reply(NOW, &confirmed));
        traffic.on_sent(&request(0x2B, 0x1400, 5));
        assert!(!traffic.is_foreign_reply(NOW, &confirmed), "ours, however late");
        assert!(traffic.is_foreign_reply(NOW, &confirmed), "one more than was requested");
        assert!(traffic.is_foreign_reply(NOW, &reply(0xA4, 0x1400, 5)), "by blocks");
    }

    #[test]
    fn own_downloads_are_each_confirmed_once() {
        let mut traffic = SdoTraffic::default();
        for (index, sub) in [(0x6040, 0), (0x1400, 5), (0x6040, 0)] {
            traffic.on_sent(&request(0x2B, index, sub));
        }
        assert!(!traffic.is_foreign_reply(NOW, &reply(0x80, 0x1400, 5)), "refused");
        assert!(traffic.is_foreign_reply(NOW, &reply(0x60, 0x1400, 5)));
        for _ in 0..2 {
            assert!(!traffic.is_foreign_reply(NOW, &reply(0x60, 0x6040, 0)));
        }
        assert!(traffic.is_foreign_reply(NOW, &reply(0x60, 0x6040, 0)));
    }

    #[test]
    fn reads_and_their_replies_are_no_downloads() {
        let mut traffic = SdoTraffic::default();
        traffic.on_sent(&request(0x40, 0x1018, 1));
        for command in [0x43, 0x41, 0x00, 0x10, 0x20, 0x80, 0xC4] {
            assert!(!traffic.is_foreign_reply(NOW, &reply(command, 0x1018, 1)), "{command:02X}");
        }
    }

    #[test]
    fn segments_of_a_foreign_block_upload_confirm_nothing() {
        let mut traffic = SdoTraffic::default();
        traffic.on_request(NOW, &request(0xA4, 0x1008, 0));
        let segment = reply(0x61, 0x4141, 0x41);
        assert!(!traffic.is_foreign_reply(NOW, &segment));
        traffic.on_request(NOW, &request(0xA1, 0, 0));
        assert!(traffic.is_foreign_reply(NOW, &segment), "it has ended");
        traffic.on_request(NOW, &request(0xA4, 0x1008, 0));
        assert!(traffic.is_foreign_reply(NOW + BLOCK_TIMEOUT, &segment), "its client is gone");
    }
}
