//! A start that enables nothing: the network boots and is read, and a stop is latched from the beginning.

use crate::BringUpError;
use crate::Node;
use crate::cause::Cause;
use bus::Bus;
use remote::Remote;
use units::spatial::Motion;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Boots every node as [`bring_up`](Self::bring_up) does, and enables none. `cause` is latched until a reset, which
    /// boots again, enables the drives and lets them prove that they stop by themselves.
    ///
    /// # Errors
    /// When a node or the bus fails, or `give_up` says so.
    pub fn bring_up_unpowered(
        &mut self,
        cause: Cause,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        self.start_network(give_up)?;
        let now = self.wire.now();
        self.timing.restart(now);
        // While there were no cycles the commanded side was not asked: what is known has aged.
        self.remote.exchange(now, &Motion::Hold);
        // No watch sees it: it is the caller's.
        self.raise(now, [Some(cause)]);
        Ok(())
    }
}
