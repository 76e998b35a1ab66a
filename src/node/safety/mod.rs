//! The mode of the node, and the only place that changes it.
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
//! Torque is zero but in `Armed`, in `ReflectionOff` (gravity compensation alone) and in `Engaged`. Where a
//! person asks for its end the weight of the arm is laid down by a ramp, and the mode changes when that is
//! over; where a cause does, the [`table`] says how. A latch becomes worse by itself or by a worse cause,
//! never milder; it is left only by a reset, which is refused while its cause is still there, and after
//! which the deadman must be released and closed again.
//!
//! | file       | what                                                  |
//! |------------|-------------------------------------------------------|
//! | [`table`]  | what each kind of cause does in each mode             |
//! | [`causes`] | which events, bus faults and controller faults stop   |
//! | `seen`     | which causes are still there                          |
//! | `ramp`     | how shares of torque come and go                      |
//! | [`words`]  | reactions in words                                    |

pub mod causes;
mod ramp;
mod seen;
pub mod table;
pub mod words;

use std::time::Duration;

use thiserror::Error;

use crate::cause::Cause;
use crate::cause::Kind;
use crate::operator::deadman::EnableState;
use crate::permit::Permit;
use crate::reaction::Decides;
use crate::reaction::Reaction;
use crate::record::Mode;
use crate::safety::ramp::Ramp;
use crate::safety::seen::Seen;
use units::numbering::Joint;
use units::time::Instant;

/// Drives must be enabled within this.
const ENABLE_WITHIN: Duration = Duration::from_secs(2);

/// After this long at zero torque the drives are switched off.
const ZERO_TORQUE_FOR: Duration = Duration::from_millis(100);

/// In this time the weight of the arm is laid down when a person asks for it.
const LAY_DOWN: Duration = Duration::from_millis(50);

/// Why a request was not granted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Refusal {
    /// Arming starts from `Ready`.
    #[error("not ready: the node is {0}")]
    NotReady(Mode),
    /// A stop is latched: its cause says why, whatever else would refuse.
    #[error("stopped by {0}; reset first")]
    Stopped(Cause),
    /// Arming with a closed deadman would engage at once, or hide a stuck one.
    #[error("the deadman is closed: release it first")]
    DeadmanClosed,
    /// Its contacts bounce, or contradict each other.
    #[error("the deadman's contacts have not come to rest: release it")]
    DeadmanMoves,
    /// No word from the switch box.
    #[error("the switch box is silent")]
    SwitchesSilent,
    /// There is nothing to reset.
    #[error("nothing to reset: the node is {0}")]
    NotStopped(Mode),
    /// What stopped the node, or would as soon as it is armed, is still there.
    #[error("still there: {0}")]
    CausePresent(Cause),
}

/// How the ramps run, from the configuration.
#[derive(Clone, Copy, Debug)]
pub struct Ramps {
    /// Gravity compensation from zero to full, after arming.
    pub gravity: Duration,
    /// Reflection and assistance from zero to full, after engaging.
    pub reflection: Duration,
}

/// A latched stop that was left, to return to it if what must follow fails.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Latch {
    cause: Option<Cause>,
    /// Whether the network must boot again, because a node may have lost its configuration.
    pub must_boot: bool,
}

/// The mode graph.
#[derive(Clone, Debug)]
pub struct Safety {
    mode: Mode,
    since: Instant,
    /// The first cause of the latched stop.
    cause: Option<Cause>,
    /// Whether any of its causes asks for a boot.
    must_boot: bool,
    seen: Seen,
    gravity: Ramp,
    reflection: Ramp,
    /// A person has asked for the end of torque.
    lays_down: bool,
    deadman_was_held: bool,
}

impl Safety {
    /// In `Boot`.
    pub fn new(ramps: Ramps) -> Self {
        Self {
            mode: Mode::Boot,
            since: Instant::ZERO,
            cause: None,
            must_boot: false,
            seen: Seen::nothing(),
            gravity: Ramp::new(ramps.gravity, LAY_DOWN),
            // What was felt ends with the deadman, by the controller's slew.
            reflection: Ramp::new(ramps.reflection, Duration::ZERO),
            lays_down: false,
            // As if closed: the first closing counts only after an opening.
            deadman_was_held: true,
        }
    }

    /// The mode.
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// What stopped the node: the first cause is kept.
    pub const fn cause(&self) -> Option<Cause> {
        self.cause
    }

    /// The network has booted; the drives are to be enabled now. A latched stop stays.
    pub fn boot(&mut self, now: Instant) {
        if self.cause.is_none() {
            self.enter(Mode::Boot, now);
        }
    }

    /// Cause to stop for while the drive of `joint` is not enabled and reports `statusword`.
    pub fn watch_enabled(&self, now: Instant, joint: Joint, statusword: u16) -> Option<Cause> {
        match self.mode {
            Mode::Boot if now.since(self.since) <= ENABLE_WITHIN => None,
            Mode::Boot => Some(Cause::EnableTimeout { joint, statusword }),
            Mode::Ready | Mode::Armed | Mode::Engaged | Mode::ReflectionOff => {
                Some(Cause::DriveLeft { joint, statusword })
            }
            Mode::ZeroTorque | Mode::DrivesOff => None,
        }
    }

    /// The node is about to end: voltage off.
    pub fn shut_down(&mut self, now: Instant) {
        self.enter(Mode::DrivesOff, now);
    }

    /// All drives report `Operation enabled`.
    pub fn drives_are_enabled(&mut self, now: Instant) {
        if self.mode == Mode::Boot {
            self.enter(Mode::Ready, now);
        }
    }

    /// Something is wrong: does what the [`table`] says, and latches. The first cause is kept, the worst
    /// reaction taken. Whoever watches for something says so in every cycle in which it sees it.
    pub fn stop(&mut self, now: Instant, cause: Cause) {
        self.seen.note(now, cause);
        let Some(mode) = table::reaction(cause.kind(), self.mode).mode() else { return };
        self.cause.get_or_insert(cause);
        self.must_boot |= cause.kind().row().boots;
        if mode != self.mode {
            self.enter(mode, now);
        }
    }

    /// Gravity compensation on; from now on the deadman engages.
    ///
    /// # Errors
    /// Unless the mode is `Ready`, the deadman is known to be released, and nothing is there that would
    /// stop the node as soon as it is armed.
    pub fn arm(&mut self, now: Instant, enable_state: EnableState) -> Result<(), Refusal> {
        if let Some(cause) = self.cause.filter(|_| self.mode.is_latched()) {
            return Err(Refusal::Stopped(cause));
        }
        if self.mode != Mode::Ready {
            return Err(Refusal::NotReady(self.mode));
        }
        match enable_state {
            EnableState::Released => {}
            EnableState::Silent => return Err(Refusal::SwitchesSilent),
            EnableState::Moving => return Err(Refusal::DeadmanMoves),
            EnableState::Closed | EnableState::Held => return Err(Refusal::DeadmanClosed),
        }
        let would_stop = |kind: Kind| kind.row().armed > Reaction::None;
        if let Some(cause) = self.seen.present(now, would_stop) {
            return Err(Refusal::CausePresent(cause));
        }
        self.deadman_was_held = false;
        self.enter(Mode::Armed, now);
        Ok(())
    }

    /// Torque off, by a ramp. Where there is none already, nothing changes; what is latched stays so.
    pub const fn disarm(&mut self) {
        self.lays_down = self.may_push();
    }

    /// Leaves a latched stop.
    ///
    /// # Errors
    /// When there is nothing to reset, or a watch still sees a cause that the reset itself does not end.
    pub fn reset(&mut self, now: Instant) -> Result<Latch, Refusal> {
        if !self.mode.is_latched() {
            return Err(Refusal::NotStopped(self.mode));
        }
        // A boot begins anew, watches and all; what is there after it refuses to be armed.
        let present = self.seen.present(now, outlasts_a_reset);
        if let Some(cause) = present.filter(|_| !self.must_boot) {
            return Err(Refusal::CausePresent(cause));
        }
        let left = Latch { cause: self.cause.take(), must_boot: self.must_boot };
        self.must_boot = false;
        self.deadman_was_held = true;
        let carries = self.mode == Mode::ReflectionOff && !left.must_boot;
        self.enter(if carries { Mode::Armed } else { Mode::Boot }, now);
        Ok(left)
    }

    /// Returns to a stop that was left too early.
    pub fn relapse(&mut self, now: Instant, Latch { cause, must_boot }: Latch) {
        (self.cause, self.must_boot) = (cause, must_boot);
        self.enter(Mode::DrivesOff, now);
    }

    /// Follows the deadman and says what this cycle may do.
    pub fn permit(&mut self, now: Instant, is_held: bool) -> Permit {
        self.go_on(now, is_held);
        self.gravity.follow(now, self.may_push() && !self.lays_down);
        if self.lays_down && self.gravity.is_down() {
            self.enter(self.laid_down(), now);
        }
        let engaged = self.mode == Mode::Engaged;
        self.reflection.follow(now, engaged);
        Permit {
            mode: self.mode,
            gravity_share: self.gravity.share(),
            takes_up: self.may_push() && !self.lays_down && !self.gravity.is_up(),
            reflection_share: self.reflection.share(),
            engaged,
            drives_on: self.mode != Mode::DrivesOff,
        }
    }

    /// Whether anything but zero torque may be sent.
    pub const fn may_push(&self) -> bool {
        self.mode.may_push()
    }

    /// What changes by itself and with the deadman.
    fn go_on(&mut self, now: Instant, is_held: bool) {
        let presses = is_held && !self.deadman_was_held;
        self.deadman_was_held = is_held;
        match self.mode {
            // Only a closing engages, never a deadman found closed.
            Mode::Armed if presses && !self.lays_down => self.enter(Mode::Engaged, now),
            Mode::Engaged if !is_held || self.lays_down => self.enter(Mode::Armed, now),
            Mode::ZeroTorque if now.since(self.since) >= ZERO_TORQUE_FOR => {
                self.enter(Mode::DrivesOff, now);
            }
            Mode::Boot
            | Mode::Ready
            | Mode::Armed
            | Mode::Engaged
            | Mode::ReflectionOff
            | Mode::ZeroTorque
            | Mode::DrivesOff => {}
        }
    }

    /// Where the arm is when its weight has been laid down.
    const fn laid_down(&self) -> Mode {
        match self.mode {
            Mode::Armed | Mode::Engaged => Mode::Ready,
            Mode::ReflectionOff => Mode::ZeroTorque,
            Mode::Boot | Mode::Ready | Mode::ZeroTorque | Mode::DrivesOff => self.mode,
        }
    }

    fn enter(&mut self, mode: Mode, now: Instant) {
        (self.mode, self.since) = (mode, now);
        self.reflection.begin(now);
        if !self.may_push() {
            self.gravity.begin(now);
            self.lays_down = false;
        }
    }
}

/// Whether a reset does not end it: what a drive did by itself is reset in the drive, and a boot proves
/// by itself that all is well again.
const fn outlasts_a_reset(kind: Kind) -> bool {
    let row = kind.row();
    match row.decides {
        Decides::Node | Decides::Timers => !row.boots,
        Decides::Drive => false,
    }
}

#[cfg(test)]
mod tests;
