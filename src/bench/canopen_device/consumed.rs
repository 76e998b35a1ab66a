//! COB-IDs that a device consumes, by its present settings.

use crate::filter::AcceptanceFilter;
use crate::rpdo::Rpdo;
use crate::{Application, Device, lss};

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
