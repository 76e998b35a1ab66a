//! Requests of the operator's console, executed between two cycles.

use thiserror::Error;

use crate::park::ParkError;
use crate::record::Mode;
use crate::rest::NotAtRest;
use crate::safety::Refusal;
use crate::trial::{TrialError, TrialRequest};
use crate::zero::{UnknownZeros, ZeroError};
use crate::{BringUpError, Node};
use bus::Bus;
use config::facts::FactsError;
use config::force_cap::ForceAboveCap;
use controller::adjustment::AdjustmentError;
use controller::switches::CommandMode;
use remote::Remote;
use remote::stated::Misfit;
use units::adjustment::Adjustment;
use units::numbering::Joint;
use units::time::Instant;
use units::wording::in_one_line;

/// A request of the operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// Ramp gravity compensation up; afterwards the deadman engages.
    Arm,
    /// Ramp torque to zero in 50 ms; the mode changes when it is at zero.
    Disarm,
    /// End a latched stop. If a node may have lost its configuration, the network boots again.
    Reset,
    /// Set the zero of a joint and of all tied to it, or of all joints, by the rest posture in which the arm lies.
    Zero(Option<Joint>),
    /// Let the hold bring the arm to its rest posture while the deadman is held.
    Park,
    /// Let the deadman push one drive alone within a bound, all others being off.
    Trial(TrialRequest),
    /// Command rates or poses. The reference is set again, so the command does not jump.
    Command(CommandMode),
    /// Change a scale, lock an axis, or align the object.
    Adjust(Adjustment),
}

impl Request {
    /// Returns whether it may boot the network or home drives, which takes seconds.
    pub const fn may_boot(self) -> bool {
        match self {
            Self::Reset | Self::Zero(_) => true,
            Self::Arm
            | Self::Disarm
            | Self::Park
            | Self::Trial(_)
            | Self::Command(_)
            | Self::Adjust(_) => false,
        }
    }
}

/// Reason why a request was not executed.
#[derive(Debug, Error)]
pub enum RequestError {
    /// Refused in this mode.
    #[error(transparent)]
    Mode(#[from] Refusal),
    /// The arm must not be armed: every reason.
    #[error("{}", in_one_line(.0))]
    Unfit(Vec<Unfit>),
    /// Zeros cannot be set now.
    #[error(transparent)]
    Zero(#[from] ZeroError),
    /// The arm cannot be parked.
    #[error(transparent)]
    Park(#[from] ParkError),
    /// The drive is not tried.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// The adjustment is out of bounds, or not possible now.
    #[error(transparent)]
    Adjustment(#[from] AdjustmentError),
    /// The boot after a reset failed.
    #[error(transparent)]
    Boot(#[from] BringUpError),
}

/// Reason against arming that no change of mode ends.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Unfit {
    /// Facts of drives are stated only, by the values that the boot read.
    #[error(transparent)]
    Facts(#[from] FactsError),
    /// The configured force exceeds the cap that follows from the proof test.
    #[error(transparent)]
    Force(#[from] ForceAboveCap),
    /// The arm is not in its rest posture.
    #[error(transparent)]
    NotAtRest(#[from] NotAtRest),
    /// The zero of a joint is unknown.
    #[error(transparent)]
    UnknownZeros(#[from] UnknownZeros),
    /// The commanded side does not fit the configuration.
    #[error(transparent)]
    FarSide(#[from] Misfit),
}

impl<B: Bus, R: Remote> Node<B, R> {
    /// Executes a request and returns the mode after it. A reset may boot the network, until `give_up` returns true.
    ///
    /// # Errors
    /// When the mode does not allow the request, or the boot of a reset fails or is given up. Arming also fails if a fact
    /// of a drive is stated only, the force exceeds its cap, a zero is unknown, the arm is not at rest, or the commanded side
    /// does not fit; a zero is not set unless the arm is at rest in its posture; a change of the command mode while armed, if the commanded side does not follow it.
    pub fn request(
        &mut self,
        request: Request,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Mode, RequestError> {
        let now = self.wire.read_clock();
        match request {
            Request::Arm => {
                // A latched stop is refused by its cause, not by a proof test that its boot has not run.
                if !self.mode().is_latched() && !self.safety.is_alone() {
                    self.check_fitness(now)?;
                }
                self.safety.arm(now, self.operator.enable_state())?;
                self.take_zeros(&self.zeros.set_by_arming(self.samples.latest()));
                self.rest.on_armed();
                self.remote_side.remote.begin_epoch();
            }
            Request::Disarm => {
                self.leave_trial(now);
                self.safety.disarm();
            }
            Request::Reset => self.reset(now, give_up)?,
            Request::Zero(joint) => self.set_zero(now, joint, give_up)?,
            Request::Park => self.park(now)?,
            Request::Trial(trial) => self.begin_trial(now, trial)?,
            Request::Command(mode) => self.set_command_mode(mode)?,
            Request::Adjust(adjustment) => self.control.adjust(adjustment)?,
        }
        Ok(self.mode())
    }

    /// Changes the command mode. While armed, the commanded side must follow it; otherwise the next arming or reset compares.
    fn set_command_mode(&mut self, mode: CommandMode) -> Result<(), RequestError> {
        if matches!(self.mode(), Mode::Armed | Mode::Engaged) {
            let misfit = self.remote_side.remote.mode_misfit(mode);
            refuse(misfit.into_iter().map(Unfit::from).collect())?;
        }
        self.control.command_mode = mode;
        Ok(())
    }

    /// Checks facts, force, posture and the commanded side.
    fn check_fitness(&mut self, now: Instant) -> Result<(), RequestError> {
        let facts = self.proof_test.check_facts().err().into_iter().flatten().map(Unfit::from);
        let force = self.proof_test.check_force().err().map(Unfit::from);
        // Before the boot there is no sample of any joint.
        let posture = (self.mode() != Mode::Boot).then(|| self.check_posture());
        let all: Vec<_> = facts.chain(force).chain(posture.into_iter().flatten()).collect();
        refuse(all.into_iter().chain(self.misfits(now)).collect())
    }

    /// Returns name and position of each joint that the next arming does not verify, as the first one since a boot without a
    /// rest position.
    pub fn unverified_posture(&self) -> Vec<String> {
        let q = self.zeros.positions_with(&[false; 6], self.samples.latest());
        self.rest.unverified(&self.joint_names, &q)
    }

    /// Returns unknown zeros, and joints with a known one that are not at rest although they must be.
    fn check_posture(&self) -> impl Iterator<Item = Unfit> + use<B, R> {
        let (names, samples) = (&self.joint_names, self.samples.latest());
        let set_by_arming = self.zeros.set_by_arming(samples);
        let unknown = self.zeros.unknown(names, samples, &set_by_arming).err().map(Unfit::from);
        let q = self.zeros.positions_with(&set_by_arming, samples);
        let known = self.zeros.known();
        let has_position =
            Joint::ALL.map(|joint| *joint.entry(&known) || *joint.entry(&set_by_arming));
        let rest = self.rest.check(names, &q, &has_position).err().map(Unfit::from);
        unknown.into_iter().chain(rest)
    }

    /// Returns each reason against arming with this commanded side.
    fn misfits(&mut self, now: Instant) -> impl Iterator<Item = Unfit> {
        let mode = self.control.command_mode;
        self.remote_side.remote.misfits(now, mode).into_iter().map(Unfit::from)
    }

    /// Ends a stop, with a boot if any of its causes requires one. If the boot fails the stop remains.
    fn reset(
        &mut self,
        now: Instant,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), RequestError> {
        if self.mode() == Mode::ReflectionOff {
            // The node stays armed, with a far side that may be another one by now.
            refuse(self.misfits(now).collect())?;
        }
        self.leave_trial(now);
        let stop = self.safety.reset(now)?;
        self.drives.power.allow_enabling();
        let was_silent = self.network.is_silent();
        let unconfirmed = self.unconfirmed();
        self.power_off.restart();
        if stop.must_boot || self.wire.transmission.is_shut() {
            let booted = self.bring_up(give_up);
            if booted.is_err() {
                self.safety.restore(self.wire.read_clock(), stop);
                self.restore_unconfirmed(&unconfirmed);
                if was_silent {
                    // A drive that did not confirm power off may still be on.
                    self.network.end_error_control();
                }
            }
            booted?;
        }
        self.remote_side.remote.begin_epoch();
        Ok(())
    }
}

fn refuse(reasons: Vec<Unfit>) -> Result<(), RequestError> {
    if reasons.is_empty() { Ok(()) } else { Err(RequestError::Unfit(reasons)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::silent_bus::node;

    fn execute(request: Request) -> (Result<Mode, RequestError>, Mode) {
        let mut node = node();
        let answer = node.request(request, &mut || false);
        (answer, node.mode())
    }

    #[test]
    fn arming_before_the_boot_is_refused() {
        let (answer, mode) = execute(Request::Arm);
        assert!(
            matches!(answer, Err(RequestError::Mode(_) | RequestError::Unfit(_))),
            "{answer:?}"
        );
        assert_eq!(mode, Mode::Boot);
    }

    #[test]
    fn reset_without_a_stop_is_refused_and_sends_nothing() {
        let mut node = node();
        let answer = node.request(Request::Reset, &mut || false);
        assert!(matches!(answer, Err(RequestError::Mode(Refusal::NotStopped(Mode::Boot)))));
        assert_eq!(node.bus().sent.len(), 0);
    }

    #[test]
    fn disarming_is_never_refused() {
        assert!(matches!(execute(Request::Disarm), (Ok(Mode::Boot), Mode::Boot)));
    }

    #[test]
    fn command_mode_changes_and_the_mode_stays() {
        let mut node = node();
        for mode in [CommandMode::Pose, CommandMode::Rate] {
            let answer = node.request(Request::Command(mode), &mut || false);
            assert_eq!((answer.unwrap(), node.control.command_mode), (Mode::Boot, mode));
        }
    }

    #[test]
    fn reset_with_a_failed_boot_returns_to_its_stop() {
        let mut node = node();
        (0..5).for_each(|_| _ = node.cycle());
        let cause = node.cause();
        assert!(cause.is_some() && node.mode().is_stopped(), "no samples");
        let answer = node.request(Request::Reset, &mut || false);
        assert!(matches!(answer, Err(RequestError::Boot(_))), "{answer:?}");
        assert_eq!((node.mode(), node.cause()), (Mode::DrivesOff, cause));
    }
}
