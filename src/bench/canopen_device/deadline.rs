//! Time at which a device must next be called.
//!
//! A bus queries the deadlines of all devices at every event. Most devices have not changed since, so each keeps its deadline
//! and computes it only after a change.

use canopen_rs::NmtState;

use crate::rpdo::Rpdo;
use crate::station::earlier;
use crate::tpdo::Tpdo;
use crate::{Application, Device};
use units::time::Instant;

impl<A: Application> Device<A> {
    /// Time of the next call of [`on_time`](Self::on_time).
    pub fn deadline(&self) -> Option<Instant> {
        debug_assert_eq!(self.due, self.next_deadline(), "a change did not update it");
        self.due
    }

    /// Returns whether the deadline has passed at `now`.
    pub(super) fn is_due(&self, now: Instant) -> bool {
        self.deadline().is_some_and(|due| due <= now)
    }

    /// Keeps the deadline of the present state. Follows every change from outside.
    pub(super) fn update_deadline(&mut self) {
        self.due = self.next_deadline();
    }

    /// Computes the deadline.
    pub(super) fn next_deadline(&self) -> Option<Instant> {
        let application = self.application.deadline();
        if let Some(silence) = self.layer.silence() {
            return earlier(silence.end(), application);
        }
        let is_due = self.state == NmtState::Initialising
            || self.must_compare()
            || self.errors.has_changed(self.application.error_code());
        if is_due {
            return Some(Instant::ZERO);
        }
        let rpdos = self.rpdos.iter().filter_map(Rpdo::deadline).min();
        let tpdos = self.tpdos.iter().filter_map(Tpdo::deadline).min();
        let watches = earlier(self.heartbeat.deadline(), self.guarding.deadline());
        let answers = earlier(self.sdo.deadline(), self.errors.deadline());
        earlier(earlier(application, earlier(rpdos, tpdos)), earlier(watches, answers))
    }
}
