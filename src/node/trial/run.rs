//! A trial as the node runs it in each cycle.

use std::time::Duration;

use crate::Node;
use crate::cause::Cause;
use crate::permit::Permit;
use crate::record::Mode;
use crate::trial::ramp::Ramp;
use crate::trial::status::{End, Stage, TrialRequest, TrialStatus};
use crate::trial::{Trial, TrialError, Trials};
use bus::Bus;
use canopen::drive::State;
use canopen::pdo::DriveSample;
use controller::breakaway::Breakaway;
use remote::Remote;
use units::drive::PerMille;
use units::numbering::Joint;
use units::time::Instant;

/// Maximum time until all drives report that they are off.
const POWER_OFF_TIMEOUT: Duration = Duration::from_millis(500);

/// Maximum time until a reduced limit is written and read back.
const LIMIT_TIMEOUT: Duration = Duration::from_secs(5);

/// Full scale of a share.
const ALL: i32 = 1_000;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Switches all drives off, and lets the deadman push one of them within a bound.
    ///
    /// # Errors
    /// When the node is neither ready nor between two trials, the deadman is not known to be released or is at the grip, the bound
    /// is higher than the joint can need, a zero is unknown, or the arm is not at rest.
    pub(crate) fn begin_trial(
        &mut self,
        now: Instant,
        request: TrialRequest,
    ) -> Result<(), TrialError> {
        self.safety.check_alone(self.operator.enable_state())?;
        if !self.trials.is_deadman_apart {
            return Err(TrialError::DeadmanAtGrip);
        }
        if let Some(TrialStatus { request, stage, .. }) = self.trials.status()
            && !matches!(stage, Stage::Ended(_))
        {
            return Err(TrialError::Busy(request.joint));
        }
        self.check_resting()?;
        let TrialRequest { joint, share } = request;
        let most = self.breakaway(joint).most_share();
        if share == 0 || share > most {
            return Err(TrialError::Bound { joint, share, most });
        }
        // What was proved holds no longer.
        self.proof_test.restart();
        self.mode_check.enable_only(None);
        self.mode_check.take_refused();
        self.drives.power.enable_alone(None);
        Joint::ALL.into_iter().for_each(|joint| self.drives.power.keep_off(joint));
        self.safety.try_alone(now);
        self.trials.begin(now, request, self.samples.latest());
        Ok(())
    }

    /// Checks that the position of each joint is known, and that of its rest.
    fn check_resting(&self) -> Result<(), TrialError> {
        let (names, samples) = (&self.joint_names, self.samples.latest());
        self.zeros.unknown(names, samples, &[false; 6])?;
        let q = self.zeros.positions_with(&[false; 6], samples);
        self.rest.check_joints(names, &q, &[true; 6])?;
        Ok(())
    }

    /// Returns the breakaway of a joint as described, where the arm is.
    fn breakaway(&self, joint: Joint) -> Breakaway {
        let q = self.zeros.positions_with(&[false; 6], self.samples.latest());
        self.control.breakaway(joint, &q)
    }

    /// Ends the trial of a node that a request leads away from it: its limit is reduced, so only a boot leads on.
    pub(crate) fn leave_trial(&mut self, now: Instant) {
        if let Some(TrialStatus { request, .. }) = self.trials.status()
            && self.safety.is_alone()
        {
            self.switch_tried_off(now, End::LetGo);
            self.raise(now, [Some(Cause::LimitReduced { joint: request.joint })]);
        }
    }

    /// Takes the next step of a trial.
    pub(crate) fn advance_trial(&mut self, now: Instant, permit: &Permit) {
        let Some(trial) = self.trials.current else { return };
        if matches!(trial.status.stage, Stage::Ended(_)) {
            return;
        }
        if permit.mode != Mode::Measuring {
            // A stop: safety has switched the drives off.
            return self.switch_tried_off(now, End::LetGo);
        }
        let joint = trial.status.request.joint;
        let late = |limit: Duration| now.since(trial.since) > limit;
        match trial.status.stage {
            Stage::SwitchingOff if self.is_off() => self.enter_trial_stage(now, Stage::Limiting),
            Stage::SwitchingOff if late(POWER_OFF_TIMEOUT) => {
                self.switch_tried_off(now, End::NotEnabled);
            }
            Stage::Limiting => self.limit_tried(now, &trial),
            Stage::Waiting if permit.trial => {
                self.drives.power.enable_alone(Some(joint));
                self.enter_trial_stage(now, Stage::Enabling);
            }
            Stage::Enabling | Stage::Pushing if !permit.trial => {
                self.switch_tried_off(now, End::LetGo);
            }
            Stage::Enabling if self.is_enabled(joint) => {
                self.mode_check.enable_only(Some(joint));
                self.trials.push(now, self.samples.latest());
            }
            Stage::Enabling if late(self.trials.enable_timeout) => {
                self.switch_tried_off(now, End::NotEnabled);
            }
            Stage::Pushing => {
                if let Err(end) = self.trials.advance(self.samples.latest()) {
                    self.switch_tried_off(now, end);
                }
            }
            Stage::SwitchingOff | Stage::Waiting | Stage::Enabling | Stage::Ended(_) => {}
        }
    }

    /// Writes the reduced limit, and awaits that it reads back.
    fn limit_tried(&mut self, now: Instant, trial: &Trial) {
        let TrialRequest { joint, share } = trial.status.request;
        if trial.is_limited {
            return self.enter_trial_stage(now, Stage::Waiting);
        }
        let is_refused = !self.mode_check.take_refused().is_empty();
        if is_refused || now.since(trial.since) > LIMIT_TIMEOUT {
            return self.switch_tried_off(now, End::LimitRefused);
        }
        if !trial.is_requested {
            // Refused while another request to the drive is pending.
            let (master, out) = (&mut self.network.master, &mut self.wire.out);
            let is_requested = master.limit_torque(now, joint.into(), share, out);
            self.trials.set_requested(is_requested);
            self.send_queued();
        }
    }

    fn is_enabled(&self, joint: Joint) -> bool {
        let statusword = joint.entry(self.samples.latest()).statusword;
        statusword.state() == Some(State::OperationEnabled)
    }

    fn enter_trial_stage(&mut self, now: Instant, stage: Stage) {
        if let Some(trial) = &mut self.trials.current {
            (trial.status.stage, trial.since) = (stage, now);
        }
    }

    /// Ends a trial: zero torque and disable voltage in this cycle, the latter by SDO, too, which acts before the next SYNC.
    fn switch_tried_off(&mut self, now: Instant, end: End) {
        let Some(TrialStatus { request: TrialRequest { joint, .. }, stage, .. }) =
            self.trials.status()
        else {
            return;
        };
        if matches!(stage, Stage::Ended(_)) {
            return;
        }
        self.drives.power.enable_alone(None);
        self.drives.power.keep_off(joint);
        self.mode_check.enable_only(None);
        if matches!(stage, Stage::Enabling | Stage::Pushing) {
            self.network.master.power_off(now, joint.into(), &mut self.wire.out);
            self.send_queued();
        }
        self.enter_trial_stage(now, Stage::Ended(end));
    }
}

impl Trials {
    fn begin(&mut self, now: Instant, request: TrialRequest, samples: &[DriveSample; 6]) {
        let settings = *request.joint.entry(&self.ramps);
        let bound = i32::from(settings.capacity) * i32::from(request.share) / ALL;
        let bound = i16::try_from(bound).unwrap_or_default();
        let from = samples.map(|sample| sample.position);
        self.current = Some(Trial {
            status: TrialStatus { request, stage: Stage::SwitchingOff, answers: [None; 2] },
            since: now,
            is_requested: false,
            is_limited: false,
            ramp: Ramp::new(request.joint, self.ramps, bound, &from),
            target: PerMille(0),
        });
    }

    const fn set_requested(&mut self, is_requested: bool) {
        if let Some(trial) = &mut self.current {
            trial.is_requested = is_requested;
        }
    }

    /// Begins to push from where the joints are.
    fn push(&mut self, now: Instant, samples: &[DriveSample; 6]) {
        if let Some(trial) = &mut self.current {
            trial.ramp = trial.ramp.from(&samples.map(|sample| sample.position));
            (trial.status.stage, trial.since) = (Stage::Pushing, now);
        }
    }

    /// Takes the samples of a cycle.
    fn advance(&mut self, samples: &[DriveSample; 6]) -> Result<(), End> {
        let Some(trial) = &mut self.current else { return Ok(()) };
        trial.target = PerMille(0);
        let stepped = trial.ramp.step(&samples.map(|sample| sample.position));
        trial.status.answers = trial.ramp.answers;
        trial.target = stepped?;
        Ok(())
    }
}
