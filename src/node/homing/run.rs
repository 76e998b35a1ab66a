//! Homing of the drives of a request, one after the other.

use std::time::Duration;

use crate::cause::Cause;
use crate::homing::{HomingError, HomingFailure};
use crate::operator::deadman::EnableState;
use crate::record::Mode;
use crate::{BringUpError, Node};
use bus::Bus;
use canopen::drive::Statusword;
use canopen::frame::Telegram;
use canopen::master::Master;
use remote::Remote;
use units::drive::Counts;
use units::numbering::{Joint, NodeIndex};
use units::time::Instant;

/// Maximum time until drives report that they are off.
const POWER_OFF_TIMEOUT: Duration = Duration::from_millis(500);

/// Maximum time for the writes to a drive before and after its homing.
const STAGE_TIMEOUT: Duration = Duration::from_secs(5);

impl<B: Bus, R: Remote> Node<B, R> {
    /// Homes the drives of `joints`, one after the other, and proves again that all drives stop. Ends in `Ready`.
    ///
    /// # Errors
    /// When a drive is not homed or a cause is raised: the next reset boots the network. When `give_up` returns true: the
    /// node must be shut down.
    pub(crate) fn home(
        &mut self,
        joints: &[Joint],
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        let Some(first) = joints.first().copied() else { return Ok(()) };
        let mut current = first;
        self.homing.is_running = true;
        let homed = self.home_each(joints, &mut current, give_up);
        self.homing.is_running = false;
        self.samples.end_homing();
        self.drives.power.set_homing(None);
        self.mode_check.enable_all();
        homed.inspect_err(|error| {
            if matches!(error, BringUpError::GivenUp) {
                // The run ends, and switches the drives off in order.
                return;
            }
            let now = self.wire.read_clock();
            self.raise(now, [Some(Cause::HomingFailed { joint: current })]);
            self.cycle();
        })
    }

    fn home_each(
        &mut self,
        joints: &[Joint],
        current: &mut Joint,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        // What was proved holds no longer, and `Ready` must be left before drives are off.
        self.proof_test.restart();
        self.mode_check.enable_only(None);
        self.mode_check.take_refused();
        self.safety.boot(self.wire.read_clock());
        self.keep_all_off(*current)?;
        for joint in joints {
            *current = *joint;
            self.run_stage(*joint, Master::prepare_homing, give_up)?;
            self.home_one(*joint, give_up)?;
        }
        for joint in joints {
            *current = *joint;
            self.run_stage(*joint, Master::leave_homing, give_up)?;
        }
        self.mode_check.enable_all();
        self.homing.is_running = false;
        self.become_ready(give_up)
    }

    /// Enables one drive, lets it take its position for home, and disables it.
    fn home_one(
        &mut self,
        joint: Joint,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        self.mode_check.enable_only(Some(joint));
        let attained = self.enable(give_up).and_then(|_| self.await_home(joint, give_up));
        self.drives.power.set_homing(None);
        self.drives.power.keep_off(joint);
        self.network.master.power_off(self.wire.read_clock(), joint.into(), &mut self.wire.out);
        self.send_queued();
        self.mode_check.enable_only(None);
        attained?;
        self.keep_all_off(joint)
    }

    /// Starts the homing of an enabled drive, and runs cycles until it is attained.
    fn await_home(
        &mut self,
        joint: Joint,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        let Counts(before) = joint.entry(self.samples.latest()).position;
        let until = self.wire.read_clock() + self.zeros.homing_timeout(joint);
        self.samples.start_homing(joint);
        self.drives.power.set_homing(Some(joint));
        loop {
            self.watched_cycle(give_up)?;
            let sample = *joint.entry(self.samples.latest());
            let Statusword(word) = sample.statusword;
            let Counts(found) = sample.position;
            let failure = if self.operator.enable_state() != Some(EnableState::Released) {
                HomingFailure::DeadmanClosed
            } else if !self.zeros.is_still_or_home(joint, before, found) {
                let home = self.zeros.home_counts(joint);
                HomingFailure::Moved { found, before, home }
            } else if word & Statusword::HOMING_ERROR != 0 {
                HomingFailure::Reported(word)
            } else if self.is_homed(joint, sample.statusword) {
                return Ok(());
            } else if self.wire.read_clock() >= until {
                HomingFailure::TooLate(word)
            } else {
                continue;
            };
            return Err(self.homing_error(joint, failure).into());
        }
    }

    /// Returns whether a drive has attained its home, and says so in the bit by which it is asked later.
    fn is_homed(&self, joint: Joint, statusword: Statusword) -> bool {
        let is_attained = statusword.0 & Statusword::HOMING_ATTAINED != 0;
        is_attained && self.zeros.is_referenced(joint, statusword) != Some(false)
    }

    /// Keeps all drives off until they report it.
    fn keep_all_off(&mut self, joint: Joint) -> Result<(), BringUpError> {
        let until = self.wire.read_clock() + POWER_OFF_TIMEOUT;
        Joint::ALL.into_iter().for_each(|joint| self.drives.power.keep_off(joint));
        while !self.is_off() {
            if self.wire.read_clock() >= until {
                return Err(self.homing_error(joint, HomingFailure::StillOn).into());
            }
            self.watched_cycle(&mut || false)?;
        }
        Ok(())
    }

    /// Writes to a drive that is off, and runs cycles until it has answered.
    fn run_stage(
        &mut self,
        joint: Joint,
        start: fn(&mut Master, Instant, NodeIndex, &mut Vec<Telegram>) -> bool,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        let until = self.wire.read_clock() + STAGE_TIMEOUT;
        let mut is_started = false;
        self.homing.has_answered = [false; 6];
        while !joint.entry(&self.homing.has_answered) {
            let now = self.wire.read_clock();
            // Refused while another request to the drive is pending.
            is_started = is_started
                || start(&mut self.network.master, now, joint.into(), &mut self.wire.out);
            self.send_queued();
            if now >= until {
                return Err(self.homing_error(joint, HomingFailure::Unanswered).into());
            }
            self.watched_cycle(give_up)?;
            let refused = self.mode_check.take_refused();
            if !refused.is_empty() {
                return Err(BringUpError::Boot(refused));
            }
        }
        Ok(())
    }

    /// Runs one cycle at zero torque. A drive in homing mode holds its position: its torque differs from the target.
    fn watched_cycle(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        if give_up() {
            return Err(BringUpError::GivenUp);
        }
        self.plausibility.restart();
        debug_assert_eq!(self.mode(), Mode::Boot, "no other mode follows before the proof test");
        self.cycle();
        self.cause().map_or(Ok(()), |cause| Err(BringUpError::NotEnabled(cause)))
    }

    fn homing_error(&self, joint: Joint, reason: HomingFailure) -> HomingError {
        HomingError { joint, name: joint.entry(&self.joint_names).clone(), reason }
    }
}
