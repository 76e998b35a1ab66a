//! Acceptance filter of a device: the COB-IDs that it consumes, as in a CAN controller.
//!
//! Remote frames always pass; they are rare, and each is for one device only. After its deadline a device also takes frames
//! of others, as an opportunity to send.

use canopen::frame::{COB_ID_MAX, Frame};

/// Number of COB-IDs in a word of the filter.
const WORD_BITS: u16 = 64;

/// Words of the filter: a bit for each COB-ID.
const WORDS: usize = 32;

/// Set of COB-IDs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct AcceptanceFilter([u64; WORDS]);

impl AcceptanceFilter {
    /// Returns whether the device must take a frame.
    pub(super) fn passes(&self, frame: &Frame) -> bool {
        let (word, bit) = place(frame.cob_id);
        frame.is_remote() || self.0.get(word).is_some_and(|word| word & bit != 0)
    }

    /// Adds a COB-ID.
    pub(super) fn accept(&mut self, cob_id: u16) {
        let (word, bit) = place(cob_id);
        self.0.get_mut(word).into_iter().for_each(|word| *word |= bit);
    }
}

/// Returns word and bit of a COB-ID.
fn place(cob_id: u16) -> (usize, u64) {
    (usize::from((cob_id & COB_ID_MAX) / WORD_BITS), 1 << (cob_id % WORD_BITS))
}
