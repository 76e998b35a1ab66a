//! SDO frames of one node that are not part of this master's transfers: another client reads, or commands.
//!
//! The bus does not deliver a master its own frames, so every request it receives is another client's. A
//! download (CiA 301, 7.2.4.3: ccs 1 initiates one, ccs 6 one by blocks, ccs 0 carries a segment of it)
//! changes what was configured. An upload changes nothing; it may disturb a transfer of this master, as a
//! server has one at a time.
//!
//! The confirmation of a download that this master did not request shows one whose request was not
//! received. While another client reads by blocks, the bytes of a segment may look like any reply.

use std::time::Duration;

use crate::frame::Frame;
use crate::object::Object;
use units::time::Instant;

/// Downloads of this master whose confirmation may still come; the oldest is forgotten first.
const MAX_OPEN: usize = 8;

/// Time without a request after which an upload by blocks is over: a sub-block takes 1.7 s at 10 kbit/s.
const BLOCK_TIMEOUT: Duration = Duration::from_secs(3);

/// Request of another client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Foreign {
    /// Begins or carries a download: another master.
    Download,
    /// Begins an upload.
    Upload,
    /// Continues an upload, or aborts a transfer.
    Other,
}

/// Requests and confirmations of one node's SDO server.
#[derive(Clone, Debug, Default)]
pub(super) struct SdoTraffic {
    /// What this master has written and not seen confirmed, the newest first.
    open: [Option<Object>; MAX_OPEN],
    /// When the last request of another client's upload by blocks was received.
    block_upload: Option<Instant>,
}

impl SdoTraffic {
    /// Takes a request that this master sends to the node.
    pub(super) fn on_sent(&mut self, frame: &Frame) {
        let (Some(command), Some(object)) = (specifier(frame), object(frame)) else { return };
        if matches!(command, CCS_DOWNLOAD | CCS_BLOCK_DOWNLOAD) {
            self.open.rotate_right(1);
            if let Some(newest) = self.open.first_mut() {
                *newest = Some(object);
            }
        }
    }

    /// Takes a request that another client has sent to the node. One that is too short counts, as some
    /// servers take it.
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

    /// Takes a reply of the node; returns whether it confirms a download that this master did not request.
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

    /// Takes a download from those that are open; returns whether it was one of them.
    fn is_confirmed(&mut self, object: Option<Object>) -> bool {
        let mut open = self.open.iter_mut().rev();
        let place = open.find(|place| place.is_some() && **place == object);
        place.is_some_and(|place| place.take().is_some())
    }
}

/// The command specifier of a frame as long as every SDO is.
fn specifier(frame: &Frame) -> Option<u8> {
    let &[command, _, _, _, _, _, _, _] = frame.data() else { return None };
    Some(command >> 5)
}

/// The object that a request or a reply names.
fn object(frame: &Frame) -> Option<Object> {
    let &[_, low, high, sub, ..] = frame.data() else { return None };
    Some(Object { index: u16::from_le_bytes([low, high]), sub })
}

/// The three highest bits of a client's request (CiA 301, 7.2.4.3).
const CCS_DOWNLOAD_SEGMENT: u8 = 0;
const CCS_DOWNLOAD: u8 = 1;
const CCS_UPLOAD: u8 = 2;
const CCS_BLOCK_UPLOAD: u8 = 5;
const CCS_BLOCK_DOWNLOAD: u8 = 6;
/// Those of a server's reply.
const SCS_DOWNLOAD: u8 = 3;
const SCS_BLOCK_DOWNLOAD: u8 = 5;
/// Those of an abort, of either side.
const CS_ABORT: u8 = 4;
/// The bits of a request of an upload by blocks that say what it does.
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
    fn foreign_requests_that_write_are_downloads() {
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
    fn a_confirmation_without_a_request_of_ours_is_foreign() {
        let mut traffic = SdoTraffic::default();
        let confirmed = reply(0x60, 0x1400, 5);
        assert!(traffic.is_foreign_reply(NOW, &confirmed));
        traffic.on_sent(&request(0x2B, 0x1400, 5));
        assert!(!traffic.is_foreign_reply(NOW, &confirmed), "ours, however late");
        assert!(traffic.is_foreign_reply(NOW, &confirmed), "one more than was requested");
        assert!(traffic.is_foreign_reply(NOW, &reply(0xA4, 0x1400, 5)), "by blocks");
    }

    #[test]
    fn several_downloads_of_ours_are_each_confirmed_once() {
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
