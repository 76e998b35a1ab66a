//! What the operator's console may ask between two cycles.

use thiserror::Error;

use crate::bus::Bus;
use crate::config::force_cap::TooMuchForce;
use crate::controller::switches::Mode as CommandMode;
use crate::node::BringUpError;
use crate::node::Node;
use crate::node::safety::Refusal;
use crate::remote::Remote;
use crate::telemetry::record::Mode;
use crate::time::Instant;

/// What may be asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Gravity compensation on; from now on the deadman engages.
    Arm,
    /// Torque off, by a ramp of 50 ms; the mode changes when it is over.
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
    /// More force than the drives' own timers allow.
    #[error(transparent)]
    Force(#[from] TooMuchForce),
    /// The network did not come up again.
    #[error(transparent)]
    Boot(#[from] BringUpError),
}

impl<B: Bus, R: Remote> Node<B, R> {
    /// Answers a request with the mode it led to. A reset may boot the network, until `give_up` says so.
    ///
    /// # Errors
    /// When the mode does not allow it, or a reset needs a boot that fails or is given up.
    pub fn request(
        &mut self,
        request: Request,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Mode, Refused> {
        let now = self.bus.now();
        match request {
            Request::Arm => {
                self.proof.allows_force()?;
                self.safety.arm(now, self.operator.grasp())?;
            }
            Request::Disarm => self.safety.disarm(),
            Request::Reset => self.reset(now, give_up)?,
            Request::Command(mode) => self.command_mode = mode,
        }
        Ok(self.mode())
    }

    /// Leaves a stop, by a boot where any of its causes asks for one; if that fails the stop remains.
    fn reset(&mut self, now: Instant, give_up: &mut dyn FnMut() -> bool) -> Result<(), Refused> {
        let left = self.safety.reset(now)?;
        self.power.reset_faults();
        if left.must_boot || self.transmission.is_shut() {
            let booted = self.bring_up(give_up);
            if booted.is_err() {
                self.safety.relapse(self.bus.now(), left);
            }
            booted?;
        }
        Ok(())
    }
}
