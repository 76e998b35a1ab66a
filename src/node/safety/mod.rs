//! Mode of the node, which only this module changes.
//!
//! ```text
//!          all enabled         arm               deadman closes
//!   Boot ──────────────► Ready ─────► Armed ◄───────────────────► Engaged
//!    ▲                         ◄─────  ▲ │     deadman opens         │
//!    │                         disarm  │ └─────────────┬─────────────┘
//!    │                      reset ┌────┘               │ a cause
//!    │                            │        ┌───────────┼──────────────┐
//!    │                      S1 ReflectionOff    S2 ZeroTorque ──► S3 DrivesOff
//!    │                            └── worse ──► 100 ms ─┘  │          │
//!    └──────────────────────────── reset, cause gone ──────┴──────────┘
//! ```
//!
//! A request leads from `Armed` to `Measuring`, in which the deadman lets the arm move by itself and engages nothing; a disarm request
//! leads on to `Ready`, a cause to a stop.
//!
//! Torque is zero except in `Armed`, in `ReflectionOff` (gravity compensation alone), in `Engaged` and in `Measuring`. After a
//! disarm request gravity compensation ramps to zero before the mode changes. After a cause the [`table`] applies.
//!
//! Causes also stop `Boot` and `Ready`, and a disarm request in S1 leads to S2. A latched stop becomes stricter with time or
//! by another cause, never milder. Only a reset ends it. It is refused while any cause is active that it does not clear,
//! unless it boots the network. After it, only a press that follows a release engages.
//!
//! | file            | content                                             |
//! |-----------------|-----------------------------------------------------|
//! | [`table`]       | reaction of each mode to each kind of cause         |
//! | [`causes`]      | causes of network events, bus errors, invalid values |
//! | `active_causes` | causes raised within the last 20 ms                 |
//! | `ramp`          | shares of gravity compensation and reflection       |

mod active_causes;
pub mod causes;
mod ramp;
pub mod table;

use std::time::Duration;

use thiserror::Error;

use crate::cause::{Cause, CauseKind};
use crate::operator::deadman::EnableState;
use crate::permit::Permit;
use crate::reaction::Reaction;
use crate::record::Mode;
use crate::safety::active_causes::ActiveCauses;
use crate::safety::ramp::Ramp;
use canopen::drive::{State, Statusword};
use config::NoSwitchBox;
use units::numbering::Joint;
use units::time::Instant;

/// Time in `ZeroTorque` after which the drives are switched off.
const DRIVES_OFF_DELAY: Duration = Duration::from_millis(100);

/// Time in which gravity compensation ramps to zero after a disarm request.
const GRAVITY_RAMP_DOWN: Duration = Duration::from_millis(50);

/// Reason why a request was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Refusal {
    /// Arming starts from `Ready`.
    #[error("not ready: the node is {0}")]
    NotReady(Mode),
    /// A stop is latched. Its cause is reported before any other reason.
    #[error("stopped: {0}. Run `frhc ctl reset` first")]
    Stopped(Cause),
    /// The arm moves itself only from `Armed`, with its weight carried.
    #[error("the arm is not carried yet: arm it first; the node is {0}")]
    NotCarried(Mode),
    /// The deadman is closed: arming would engage at once, or hide a stuck contact.
    #[error("the deadman is closed: release it first")]
    DeadmanClosed,
    /// The deadman's contacts bounce, or disagree.
    #[error("the deadman's contacts have not settled: release it")]
    DeadmanNotSettled,
    /// The inputs of the switch box are missing.
    #[error("no inputs from the switch box: check its power and cable")]
    SwitchBoxSilent,
    /// There is no switch box.
    #[error(transparent)]
    NoSwitchBox(#[from] NoSwitchBox),
    /// Trials have left a limit reduced.
    #[error("a drive was tried: its torque limit is reduced. Run `frhc ctl reset` first")]
    LimitReduced,
    /// No stop is latched.
    #[error("nothing to reset: the node is {0}")]
    NotStopped(Mode),
    /// The cause of the stop, or one that would stop the armed node, is still active.
    #[error("still active: {0}")]
    CauseActive(Cause),
}

/// Maximum times from a call of [`boot`](Safety::boot) until all drives are enabled.
#[derive(Clone, Copy, Debug)]
pub struct EnableTimes {
    /// Time for drives that have left `Not ready to switch on`: `safety.enable_ms`.
    pub enable: Duration,
    /// Time of each drive in `Not ready to switch on`, where longer: its `boot_ms`.
    pub initialise: [Duration; 6],
}

/// Times from the configuration.
#[derive(Clone, Copy, Debug)]
pub struct SafetyTimes {
    /// Maximum times until all drives are enabled.
    pub enable: EnableTimes,
    /// Time from zero to full gravity compensation, after arming.
    pub gravity: Duration,
    /// Time from zero to full reflection and assistance, after engaging.
    pub reflection: Duration,
}

/// Stop that a reset has ended; [`Safety::restore`] returns to it if the boot after the reset fails.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatchedStop {
    cause: Option<Cause>,
    /// True if the network must boot again, because a node may have lost its configuration.
    pub must_boot: bool,
}

/// Mode graph, with active causes and ramps.
#[derive(Clone, Debug)]
pub struct Safety {
    mode: Mode,
    since: Instant,
    /// Start of the enable timeout: the last time at which a drive was `Not ready to switch on`, or `since`.
    enabling_since: Instant,
    times: EnableTimes,
    /// First cause of the latched stop.
    cause: Option<Cause>,
    /// True if any cause of the latched stop requires a boot.
    must_boot: bool,
    active: ActiveCauses,
    gravity: Ramp,
    reflection: Ramp,
    /// True from a disarm request until gravity compensation is at zero.
    is_ramping_down: bool,
    /// True in a `Measuring` in which one drive alone may push: no weight is carried, and every stop switches off.
    is_alone: bool,
    deadman_was_held: bool,
}

impl Safety {
    /// Returns the mode graph in `Boot`.
    pub fn new(times: SafetyTimes) -> Self {
        Self {
            mode: Mode::Boot,
            since: Instant::ZERO,
            enabling_since: Instant::ZERO,
            times: times.enable,
            cause: None,
            must_boot: false,
            active: ActiveCauses::new(),
            gravity: Ramp::new(times.gravity, GRAVITY_RAMP_DOWN),
            // After a deadman release the controller's slew ends reflection.
            reflection: Ramp::new(times.reflection, Duration::ZERO),
            is_ramping_down: false,
            is_alone: false,
            // The first press counts only after a release.
            deadman_was_held: true,
        }
    }

    /// Returns the mode to which the newest cause, request or cycle has led.
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// Returns the first cause of the latched stop.
    pub const fn cause(&self) -> Option<Cause> {
        self.cause
    }

    /// Enters `Boot`, the mode in which drives are enabled and tested, unless a stop is latched. The enable
    /// timeout starts.
    pub fn boot(&mut self, now: Instant) {
        if self.cause.is_none() {
            self.enter(Mode::Boot, now);
        }
    }

    /// Returns the cause if the drive of `joint` reports `statusword`, which is not `Operation enabled`.
    pub fn watch_enabled(&mut self, now: Instant, joint: Joint, statusword: u16) -> Option<Cause> {
        match self.mode {
            Mode::Boot => {
                let is_late = self.is_enabled_late(now, joint, statusword);
                is_late.then_some(Cause::EnableTimeout { joint, statusword })
            }
            Mode::Ready | Mode::Armed | Mode::Engaged | Mode::ReflectionOff | Mode::Measuring => {
                Some(Cause::DriveLeft { joint, statusword })
            }
            Mode::ZeroTorque | Mode::DrivesOff => None,
        }
    }

    /// Returns whether the time to enable a drive is over. It starts when the drive leaves `Not ready to switch on`, for which
    /// it has the time of its boot.
    fn is_enabled_late(&mut self, now: Instant, joint: Joint, statusword: u16) -> bool {
        let EnableTimes { enable, initialise } = self.times;
        if Statusword(statusword).state() == Some(State::NotReadyToSwitchOn) {
            self.enabling_since = now;
            return now.since(self.since) > enable.max(*joint.entry(&initialise));
        }
        now.since(self.enabling_since) > enable
    }

    /// Enters `DrivesOff` without a cause: the orderly stop, or a bring-up that failed.
    pub fn switch_drives_off(&mut self, now: Instant) {
        self.enter(Mode::DrivesOff, now);
    }

    /// Enters `Ready` from `Boot`. Called when all drives report `Operation enabled` and the proof test has ended.
    pub fn on_drives_enabled(&mut self, now: Instant) {
        if self.mode == Mode::Boot {
            self.enter(Mode::Ready, now);
        }
    }

    /// Applies the [`table`] to a cause and latches the stop. Keeps the first cause and the strictest reaction.
    /// The node raises a cause in every cycle in which its watch returns it.
    pub fn raise(&mut self, now: Instant, cause: Cause) {
        self.active.raise(now, cause);
        let Some(mode) = table::reaction(cause.kind(), self.mode).mode() else { return };
        // Its limit is reduced, and an arm that no drive carries needs no slower stop.
        let mode = if self.is_alone { Mode::DrivesOff } else { mode };
        self.must_boot |= self.is_alone;
        self.cause.get_or_insert(cause);
        self.must_boot |= cause.kind().row().reset_boots;
        if mode != self.mode {
            self.enter(mode, now);
        }
    }

    /// Checks that the node is ready and the deadman known to be released: no torque acts, and no press waits.
    ///
    /// # Errors
    /// When a stop is latched, the mode is not `Ready`, there is no switch box, or the deadman is not known to be released.
    pub fn check_released(&self, enable_state: Option<EnableState>) -> Result<(), Refusal> {
        if let Some(cause) = self.cause.filter(|_| self.mode.is_latched()) {
            return Err(Refusal::Stopped(cause));
        }
        let enable_state = enable_state.ok_or(NoSwitchBox)?;
        if self.is_alone {
            return Err(Refusal::LimitReduced);
        }
        if self.mode != Mode::Ready {
            return Err(Refusal::NotReady(self.mode));
        }
        released(enable_state)
    }

    /// Checks that one drive alone may be tried: as [`check_released`](Self::check_released), or after another trial.
    ///
    /// # Errors
    /// As [`check_released`](Self::check_released).
    pub fn check_alone(&self, enable_state: Option<EnableState>) -> Result<(), Refusal> {
        if self.is_alone {
            return released(enable_state.ok_or(NoSwitchBox)?);
        }
        self.check_released(enable_state)
    }

    /// Enters the `Measuring` in which one drive alone may push while the deadman is held.
    pub fn try_alone(&mut self, now: Instant) {
        self.enter(Mode::Measuring, now);
        self.is_alone = true;
    }

    /// Returns whether one drive alone may push.
    pub const fn is_alone(&self) -> bool {
        self.is_alone
    }

    /// Enters `Measuring` from `Armed`, or stays in it: the deadman then lets the arm move by itself.
    ///
    /// # Errors
    /// When a stop is latched, the weight of the arm is not carried, there is no switch box, or the deadman is not known to be
    /// released.
    pub fn measure(
        &mut self,
        now: Instant,
        enable_state: Option<EnableState>,
    ) -> Result<(), Refusal> {
        if let Some(cause) = self.cause.filter(|_| self.mode.is_latched()) {
            return Err(Refusal::Stopped(cause));
        }
        released(enable_state.ok_or(NoSwitchBox)?)?;
        let is_armed = matches!(self.mode, Mode::Armed | Mode::Measuring);
        if !is_armed || !self.gravity.is_full() || self.is_ramping_down {
            return Err(Refusal::NotCarried(self.mode));
        }
        self.enter(Mode::Measuring, now);
        Ok(())
    }

    /// Enters `Armed`: gravity compensation ramps up, and the deadman engages.
    ///
    /// # Errors
    /// As [`check_released`](Self::check_released), and when an active cause would stop the armed node.
    pub fn arm(&mut self, now: Instant, enable_state: Option<EnableState>) -> Result<(), Refusal> {
        self.check_released(enable_state)?;
        let would_stop = |kind: CauseKind| kind.row().armed > Reaction::NoStop;
        if let Some(cause) = self.active.first(now, would_stop) {
            return Err(Refusal::CauseActive(cause));
        }
        self.deadman_was_held = false;
        self.enter(Mode::Armed, now);
        Ok(())
    }

    /// Starts the ramp of gravity compensation to zero. Does nothing at zero torque; a latched stop stays.
    pub const fn disarm(&mut self) {
        self.is_ramping_down = self.allows_torque();
    }

    /// Ends a `Measuring` in which one drive alone may push.
    pub fn end_alone(&mut self, now: Instant) {
        if self.is_alone {
            self.enter(Mode::DrivesOff, now);
        }
    }

    /// Ends a latched stop.
    ///
    /// # Errors
    /// When no stop is latched, or a cause is active that the reset itself does not clear.
    pub fn reset(&mut self, now: Instant) -> Result<LatchedStop, Refusal> {
        if !self.mode.is_latched() {
            return Err(Refusal::NotStopped(self.mode));
        }
        // A boot restarts all watches; a cause that is active after it refuses arming.
        let blocks = |kind: CauseKind| !kind.row().reset_boots && !kind.row().is_reset_in_drive();
        let active = self.active.first(now, blocks);
        if let Some(cause) = active.filter(|_| !self.must_boot) {
            return Err(Refusal::CauseActive(cause));
        }
        let stop = LatchedStop { cause: self.cause.take(), must_boot: self.must_boot };
        self.must_boot = false;
        self.deadman_was_held = true;
        let stays_armed = self.mode == Mode::ReflectionOff && !stop.must_boot;
        self.enter(if stays_armed { Mode::Armed } else { Mode::Boot }, now);
        Ok(stop)
    }

    /// Returns to a stop whose reset has failed, with drives off.
    pub fn restore(&mut self, now: Instant, LatchedStop { cause, must_boot }: LatchedStop) {
        (self.cause, self.must_boot) = (cause, must_boot);
        self.enter(Mode::DrivesOff, now);
    }

    /// Advances mode and ramps by the deadman and the time, and returns the permit of this cycle.
    pub fn advance(&mut self, now: Instant, is_held: bool) -> Permit {
        self.advance_mode(now, is_held);
        let carries = self.allows_torque() && !self.is_alone;
        self.gravity.advance(now, carries && !self.is_ramping_down);
        if self.is_ramping_down && self.gravity.is_zero() {
            self.enter(self.mode_after_ramp_down(), now);
        }
        let engaged = self.mode == Mode::Engaged;
        self.reflection.advance(now, engaged);
        Permit {
            mode: self.mode,
            gravity_share: self.gravity.share(),
            gravity_ramps_up: carries && !self.is_ramping_down && !self.gravity.is_full(),
            reflection_share: self.reflection.share(),
            hold: self.mode == Mode::Measuring
                && is_held
                && !self.is_ramping_down
                && !self.is_alone,
            trial: self.is_alone && is_held,
            engaged,
            drives_on: self.mode != Mode::DrivesOff,
        }
    }

    /// Returns whether torques other than zero may be sent.
    pub const fn allows_torque(&self) -> bool {
        self.mode.allows_torque()
    }

    /// Changes the mode by the deadman and the time.
    fn advance_mode(&mut self, now: Instant, is_held: bool) {
        let is_pressed = is_held && !self.deadman_was_held;
        self.deadman_was_held = is_held;
        match self.mode {
            // Only a press engages; a deadman that is already closed does not.
            Mode::Armed if is_pressed && !self.is_ramping_down => self.enter(Mode::Engaged, now),
            Mode::Engaged if !is_held || self.is_ramping_down => self.enter(Mode::Armed, now),
            Mode::ZeroTorque if now.since(self.since) >= DRIVES_OFF_DELAY => {
                self.enter(Mode::DrivesOff, now);
            }
            Mode::Boot
            | Mode::Ready
            | Mode::Armed
            | Mode::Engaged
            | Mode::ReflectionOff
            | Mode::ZeroTorque
            | Mode::DrivesOff
            | Mode::Measuring => {}
        }
    }

    /// Returns the mode after gravity compensation has ramped to zero.
    const fn mode_after_ramp_down(&self) -> Mode {
        match self.mode {
            Mode::Armed | Mode::Engaged | Mode::Measuring => Mode::Ready,
            Mode::ReflectionOff => Mode::ZeroTorque,
            Mode::Boot | Mode::Ready | Mode::ZeroTorque | Mode::DrivesOff => self.mode,
        }
    }

    fn enter(&mut self, mode: Mode, now: Instant) {
        (self.mode, self.since, self.enabling_since) = (mode, now, now);
        self.is_alone = false;
        self.reflection.reset(now);
        if !self.allows_torque() {
            self.gravity.reset(now);
            self.is_ramping_down = false;
        }
    }
}

/// Checks that the deadman is known to be released.
const fn released(enable_state: EnableState) -> Result<(), Refusal> {
    match enable_state {
        EnableState::Released => Ok(()),
        EnableState::Silent => Err(Refusal::SwitchBoxSilent),
        EnableState::Unsettled => Err(Refusal::DeadmanNotSettled),
        EnableState::ClosedWithoutRelease | EnableState::Held => Err(Refusal::DeadmanClosed),
    }
}

#[cfg(test)]
mod tests;
