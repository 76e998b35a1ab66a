//! Execution of the recheck in each cycle.

use crate::Node;
use bus::Bus;
use remote::Remote;
use units::time::Instant;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Requests the next setting when due, unless the node is stopped.
    pub(crate) fn recheck(&mut self, now: Instant) {
        if !self.proof_test.is_done() || self.safety.mode().is_stopped() {
            return;
        }
        if let Some((node, setting)) = self.proof_test.recheck.due(now)
            && self.network.master.read_back(now, node, setting, &mut self.wire.out)
        {
            self.proof_test.recheck.advance(now);
            self.send_queued();
        }
    }
}
