//! Acceptance filter of a device: the COB-IDs that it consumes, as in a CAN controller.
//!
//! Remote frames always pass; they are rare, and each is for one device only. While something is due, a device also
//! takes the frames of others: they are an opportunity to send.

use crate::lss;
use crate::rpdo::Rpdo;
use crate::{Application, Device};
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
    fn accept(&mut self, cob_id: u16) {
        let (word, bit) = place(cob_id);
        self.0.get_mut(word).into_iter().for_each(|word| *word |= bit);
    }
}

/// Returns word and bit of a COB-ID.
fn place(cob_id: u16) -> (usize, u64) {
    (usize::from((cob_id & COB_ID_MAX) / WORD_BITS), 1 << (cob_id % WORD_BITS))
}

impl<A: Application> Device<A> {
    /// Sets the filter to what the device consumes. Follows every change of its settings.
    pub(super) fn update_filter(&mut self) {
        self.filter = self.consumed();
    }

    /// Returns the COB-IDs that the device consumes, in any NMT state.
    pub(super) fn consumed(&self) -> AcceptanceFilter {
        let mut filter = AcceptanceFilter::default();
        let own =
            [lss::REQUEST_COB_ID, canopen::nmt::COB_ID, self.sync.cob_id(), self.sdo.cob_id()];
        let others = self.heartbeat.cob_ids().chain(self.clock.cob_id());
        let rpdos = self.rpdos.iter().filter_map(Rpdo::cob_id);
        own.into_iter().chain(others).chain(rpdos).for_each(|cob_id| filter.accept(cob_id));
        filter
    }
}
