//! What the operator's console may ask between two cycles.

use thiserror::Error;

use crate::bus::Bus;
use crate::canopen::drive::PowerStage;
use crate::canopen::pdo::Deadman;
use crate::controller::switches::Mode as CommandMode;
use crate::node::BringUpError;
use crate::node::Node;
use crate::node::safety::Refusal;
use crate::node::safety::table;
use crate::remote::Remote;
use crate::telemetry::cause::Cause;
use crate::telemetry::record::Mode;
use crate::time::Instant;

/// What may be asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Gravity compensation on; from now on the deadman engages.
    Arm,
    /// Torque off.
    Disarm,
    /// Leave a latched stop. Where a node may have lost its configuration, the network boots again.
    Reset,
    /// Command rates or poses. The reference is set anew, so nothing jumps.
    Command(CommandMode),
}

/// Why it was not done.
#[derive(Debug, Error)]
pub enum Refused {
    /// The mode does not allow it.
    #[error(transparent)]
    Mode(#[from] Refusal),
    /// The network did not come up again.
    #[error(transparent)]
    Boot(#[from] BringUpError),
}

impl<B: Bus, R: Remote> Node<B, R> {
    /// Answers a request with the mode it led to.
    ///
    /// # Errors
    /// When the mode does not allow it, or a reset needs a boot that fails.
    pub fn request(&mut self, request: Request) -> Result<Mode, Refused> {
        let now = self.bus.now();
        match request {
            Request::Arm => self.safety.arm(now, self.deadman(now))?,
            Request::Disarm => self.safety.disarm(now),
            Request::Reset => self.reset(now)?,
            Request::Command(mode) => self.command_mode = mode,
        }
        Ok(self.mode())
    }

    /// The deadman's two channels, if the switch box is heard.
    pub(super) fn deadman(&self, now: Instant) -> Option<Deadman> {
        self.samples.inputs(now).map(|inputs| inputs.deadman())
    }

    fn reset(&mut self, now: Instant) -> Result<(), Refused> {
        let stopped_by = self.cause();
        let disagrees = self.deadman(now) == Some(Deadman::Disagreeing);
        self.safety.reset(now, disagrees.then_some(Cause::DeadmanDisagrees))?;
        self.power.iter_mut().for_each(PowerStage::reset_fault);
        let is_shut = self.transmission.is_shut();
        if let Some(cause) = stopped_by.filter(|cause| is_shut || table::row(cause.kind()).boots) {
            let booted = self.bring_up(&mut || false);
            if booted.is_err() {
                self.safety.stop(self.bus.now(), cause);
            }
            booted?;
        }
        Ok(())
    }
}
