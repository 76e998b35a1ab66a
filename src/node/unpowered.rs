//! Start without enabling drives: the network boots, and a stop is latched from the start.

use crate::cause::Cause;
use crate::{BringUpError, Node};
use bus::Bus;
use remote::{Command, Remote};

impl<B: Bus, R: Remote> Node<B, R> {
    /// Boots every node as [`bring_up`](Self::bring_up) does, but enables no drive. `cause` is latched until a reset,
    /// which boots again, enables the drives and runs the proof test.
    ///
    /// # Errors
    /// When a node or the bus fails, or `give_up` returns true.
    pub fn bring_up_unpowered(
        &mut self,
        cause: Cause,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        self.start_network(give_up)?;
        let now = self.wire.read_clock();
        self.timing.restart(now);
        // No sample was requested during the boot: the newest one is stale.
        self.remote_side.exchange(now, &Command::HOLD, self.safety.mode());
        // The caller's cause: no watch raises it.
        self.raise(now, [Some(cause)]);
        Ok(())
    }
}
