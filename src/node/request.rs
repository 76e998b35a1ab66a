//! What the operator's console may ask between two cycles.

use thiserror::Error;

use crate::BringUpError;
use crate::Node;
use crate::record::Mode;
use crate::safety::Refusal;
use bus::Bus;
use config::force_cap::TooMuchForce;
use controller::switches::Mode as CommandMode;
use remote::Remote;
use units::time::Instant;

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
        let now = self.wire.now();
        match request {
            Request::Arm => {
                // Of a latched stop the cause is the reason, and not what its boot has not proven.
                if !self.mode().is_latched() {
                    self.proof.allows_force()?;
                }
                self.safety.arm(now, self.operator.enable_state())?;
            }
            Request::Disarm => self.safety.disarm(),
            Request::Reset => self.reset(now, give_up)?,
            Request::Command(mode) => self.control.command_mode = mode,
        }
        Ok(self.mode())
    }

    /// Leaves a stop, by a boot where any of its causes asks for one; if that fails the stop remains.
    fn reset(&mut self, now: Instant, give_up: &mut dyn FnMut() -> bool) -> Result<(), Refused> {
        let left = self.safety.reset(now)?;
        self.drives.power.reset_faults();
        if left.must_boot || self.wire.transmission.is_shut() {
            let booted = self.bring_up(give_up);
            if booted.is_err() {
                self.safety.relapse(self.wire.now(), left);
            }
            booted?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::silent::node;

    fn ask(request: Request) -> (Result<Mode, Refused>, Mode) {
        let mut node = node();
        let answer = node.request(request, &mut || false);
        (answer, node.mode())
    }

    #[test]
    fn arming_before_the_boot_is_refused() {
        let (answer, mode) = ask(Request::Arm);
        assert!(matches!(answer, Err(Refused::Mode(_) | Refused::Force(_))), "{answer:?}");
        assert_eq!(mode, Mode::Boot);
    }

    #[test]
    fn reset_where_nothing_is_stopped_is_refused_and_boots_nothing() {
        let mut node = node();
        let answer = node.request(Request::Reset, &mut || false);
        assert!(matches!(answer, Err(Refused::Mode(Refusal::NotStopped(Mode::Boot)))));
        assert_eq!(node.bus().sent.len(), 0);
    }

    #[test]
    fn disarming_is_never_refused() {
        assert!(matches!(ask(Request::Disarm), (Ok(Mode::Boot), Mode::Boot)));
    }

    #[test]
    fn command_mode_is_taken_and_the_mode_stays() {
        let mut node = node();
        for mode in [CommandMode::Pose, CommandMode::Rate] {
            let answer = node.request(Request::Command(mode), &mut || false);
            assert_eq!((answer.unwrap(), node.control.command_mode), (Mode::Boot, mode));
        }
    }

    #[test]
    fn reset_that_does_not_boot_goes_back_to_its_stop() {
        let mut node = node();
        (0..5).for_each(|_| _ = node.cycle());
        let cause = node.cause();
        assert!(cause.is_some() && node.mode().is_stopped(), "no samples");
        let answer = node.request(Request::Reset, &mut || false);
        assert!(matches!(answer, Err(Refused::Boot(_))), "{answer:?}");
        assert_eq!((node.mode(), node.cause()), (Mode::DrivesOff, cause));
    }
}
