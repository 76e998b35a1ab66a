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
//! Torque is zero but in `Armed`, in `ReflectionOff` (gravity compensation alone) and in `Engaged`. What a
//! cause leads to is the fault [`table`]'s. A latch becomes worse by itself or by a worse cause, never
//! milder; it is left only by a reset, after which the deadman must be released and closed again.

pub mod table;

use std::time::Duration;

use thiserror::Error;

use crate::bus::BusFault;
use crate::canopen::frame::Channel;
use crate::canopen::master::event::Event;
use crate::canopen::pdo::Deadman;
use crate::controller::Fault;
use crate::telemetry::cause::Cause;
use crate::telemetry::record::Mode;
use crate::time::Instant;

/// Two antivalent deadman channels may disagree for so long while a finger moves.
const DISAGREEMENT: Duration = Duration::from_millis(50);

/// Drives must be enabled within this.
const ENABLE_WITHIN: Duration = Duration::from_secs(2);

/// After this long at zero torque the drives are switched off.
const ZERO_TORQUE_FOR: Duration = Duration::from_millis(100);

/// Why a request was not granted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Refusal {
    /// Arming starts from `Ready`.
    #[error("not ready: the node is {0}")]
    NotReady(Mode),
    /// Arming with a closed deadman would engage at once, or hide a stuck one.
    #[error("the deadman is closed: release it first")]
    DeadmanClosed,
    /// No word from the switch box.
    #[error("the switch box is silent")]
    SwitchesSilent,
    /// There is nothing to reset.
    #[error("nothing to reset: the node is {0}")]
    NotStopped(Mode),
    /// The cause of the stop is still there.
    #[error("still there: {0}")]
    CausePresent(Cause),
}

/// What an event of the network stops the node for, if it does.
pub const fn cause_of_event(event: &Event) -> Option<Cause> {
    match event {
        Event::Emergency { node, emergency } if !emergency.is_reset() => {
            Some(Cause::Emergency { node: *node, code: emergency.code })
        }
        Event::HeartbeatLost { node } => Some(Cause::HeartbeatLost { node: *node }),
        Event::Rebooted { node } => Some(Cause::Rebooted { node: *node }),
        Event::Duplicate { node, .. } => Some(Cause::Duplicate { node: *node }),
        Event::ForeignMaster { .. } => Some(Cause::ForeignMaster),
        Event::Emergency { .. }
        | Event::Booted
        | Event::BootFailed(_)
        | Event::FoundEnabled { .. }
        | Event::Configured { .. }
        | Event::Absent { .. }
        | Event::Joined { .. }
        | Event::ErrorHistory { .. }
        | Event::Statusword { .. }
        | Event::Stranger { .. }
        | Event::StateChanged { .. } => None,
    }
}

/// What a fault of a bus stops the node for, if it does. What an overrun loses shows as missing samples.
pub const fn cause_of_fault(Channel(channel): Channel, fault: BusFault) -> Option<Cause> {
    match fault {
        BusFault::Warning | BusFault::Overrun => None,
        BusFault::Passive => Some(Cause::BusPassive { channel }),
        BusFault::Off => Some(Cause::BusOff { channel }),
        BusFault::Down => Some(Cause::BusDown { channel }),
    }
}

/// Whether what the controller met is more than a hand turned too far, which only holds the command.
pub const fn is_serious(fault: &Fault) -> bool {
    match fault {
        Fault::TurnedTooFar => false,
        Fault::TorqueNotFinite
        | Fault::WrenchNotFinite
        | Fault::WrenchTooLarge
        | Fault::ObjectPoseNotFinite
        | Fault::ShareOutOfRange => true,
    }
}

/// How the ramps run, from the configuration.
#[derive(Clone, Copy, Debug)]
pub struct Ramps {
    /// Gravity compensation from zero to full, after arming.
    pub gravity: Duration,
    /// Reflection and assistance from zero to full, after engaging.
    pub reflection: Duration,
}

/// What one cycle may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Permit {
    /// The mode.
    pub mode: Mode,
    /// Share of gravity compensation, 0 to 1.
    pub gravity_share: f64,
    /// Share of reflection, centring and damping, 0 to 1.
    pub reflection_share: f64,
    /// Whether commands and reflection may flow.
    pub engaged: bool,
    /// Whether the drives are to be enabled.
    pub drives_on: bool,
}

/// The mode graph.
#[derive(Clone, Copy, Debug)]
pub struct Safety {
    mode: Mode,
    since: Instant,
    cause: Option<Cause>,
    ramps: Ramps,
    deadman_was_closed: bool,
    disagreeing_since: Option<Instant>,
    gravity_since: Instant,
}

impl Safety {
    /// In `Boot`.
    pub const fn new(ramps: Ramps) -> Self {
        Self {
            mode: Mode::Boot,
            since: Instant::ZERO,
            cause: None,
            ramps,
            // As if closed: the first closing counts only after an opening.
            deadman_was_closed: true,
            disagreeing_since: None,
            gravity_since: Instant::ZERO,
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

    /// A drive is still not enabled: its joint and statusword.
    pub fn not_enabled(&mut self, now: Instant, (joint, statusword): (usize, u16)) {
        match self.mode {
            Mode::Boot if now.since(self.since) <= ENABLE_WITHIN => {}
            Mode::Boot => self.stop(now, Cause::EnableTimeout { joint, statusword }),
            Mode::Ready | Mode::Armed | Mode::Engaged | Mode::ReflectionOff => {
                self.stop(now, Cause::DriveLeft { joint, statusword });
            }
            Mode::ZeroTorque | Mode::DrivesOff => {}
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
    /// reaction taken.
    pub fn stop(&mut self, now: Instant, cause: Cause) {
        let Some(mode) = table::reaction(cause.kind(), self.mode).mode() else { return };
        self.cause.get_or_insert(cause);
        if mode != self.mode {
            self.enter(mode, now);
        }
    }

    /// Gravity compensation on; from now on the deadman engages.
    ///
    /// # Errors
    /// Unless the mode is `Ready` and the deadman is known to be open.
    pub fn arm(&mut self, now: Instant, deadman: Option<Deadman>) -> Result<(), Refusal> {
        if self.mode != Mode::Ready {
            return Err(Refusal::NotReady(self.mode));
        }
        match deadman.ok_or(Refusal::SwitchesSilent)? {
            Deadman::Released => {}
            Deadman::Pressed | Deadman::Disagreeing => return Err(Refusal::DeadmanClosed),
        }
        self.deadman_was_closed = false;
        self.gravity_since = now;
        self.enter(Mode::Armed, now);
        Ok(())
    }

    /// Torque off. Where there is none already, nothing changes; what is latched stays so.
    pub fn disarm(&mut self, now: Instant) {
        match self.mode {
            Mode::Armed | Mode::Engaged => self.enter(Mode::Ready, now),
            Mode::ReflectionOff => self.enter(Mode::ZeroTorque, now),
            Mode::Boot | Mode::Ready | Mode::ZeroTorque | Mode::DrivesOff => {}
        }
    }

    /// Leaves a latched stop. `present` is a cause that is still there.
    ///
    /// # Errors
    /// When there is nothing to reset, or the cause is still there.
    pub fn reset(&mut self, now: Instant, present: Option<Cause>) -> Result<(), Refusal> {
        if !self.mode.is_latched() {
            return Err(Refusal::NotStopped(self.mode));
        }
        if let Some(cause) = present {
            return Err(Refusal::CausePresent(cause));
        }
        self.cause = None;
        self.deadman_was_closed = true;
        let carries = self.mode == Mode::ReflectionOff;
        self.enter(if carries { Mode::Armed } else { Mode::Boot }, now);
        Ok(())
    }

    /// Follows the deadman (`None`: the switch box is silent) and says what this cycle may do.
    pub fn permit(&mut self, now: Instant, deadman: Option<Deadman>) -> Permit {
        let closed = deadman == Some(Deadman::Pressed);
        match (self.mode, closed) {
            // Only a closing engages, never a deadman found closed.
            (Mode::Armed, true) if !self.deadman_was_closed => self.enter(Mode::Engaged, now),
            (Mode::Engaged, false) => self.enter(Mode::Armed, now),
            (Mode::ZeroTorque, _) if now.since(self.since) >= ZERO_TORQUE_FOR => {
                self.enter(Mode::DrivesOff, now);
            }
            (
                Mode::Boot
                | Mode::Ready
                | Mode::Armed
                | Mode::Engaged
                | Mode::ReflectionOff
                | Mode::ZeroTorque
                | Mode::DrivesOff,
                _,
            ) => {}
        }
        self.deadman_was_closed = closed;
        self.watch_channels(now, deadman);

        let engaged = self.mode == Mode::Engaged;
        Permit {
            mode: self.mode,
            gravity_share: if self.may_push() {
                share(now.since(self.gravity_since), self.ramps.gravity)
            } else {
                0.0
            },
            reflection_share: if engaged {
                share(now.since(self.since), self.ramps.reflection)
            } else {
                0.0
            },
            engaged,
            drives_on: self.mode != Mode::DrivesOff,
        }
    }

    /// Whether anything but zero torque may be sent.
    pub const fn may_push(&self) -> bool {
        match self.mode {
            Mode::Armed | Mode::Engaged | Mode::ReflectionOff => true,
            Mode::Boot | Mode::Ready | Mode::ZeroTorque | Mode::DrivesOff => false,
        }
    }

    /// A channel that sticks shows as both channels agreeing for longer than a finger takes.
    fn watch_channels(&mut self, now: Instant, deadman: Option<Deadman>) {
        if deadman != Some(Deadman::Disagreeing) {
            self.disagreeing_since = None;
            return;
        }
        let since = *self.disagreeing_since.get_or_insert(now);
        if now.since(since) > DISAGREEMENT {
            self.stop(now, Cause::DeadmanDisagrees);
        }
    }

    fn enter(&mut self, mode: Mode, now: Instant) {
        self.mode = mode;
        self.since = now;
    }
}

/// How far a ramp of length `whole` has come after `elapsed`.
fn share(elapsed: Duration, whole: Duration) -> f64 {
    if elapsed >= whole { 1.0 } else { elapsed.as_secs_f64() / whole.as_secs_f64() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPEN: Option<Deadman> = Some(Deadman::Released);
    const CLOSED: Option<Deadman> = Some(Deadman::Pressed);
    const RAMPS: Ramps =
        Ramps { gravity: Duration::from_secs(1), reflection: Duration::from_millis(300) };

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    fn armed() -> Safety {
        let mut safety = Safety::new(RAMPS);
        safety.drives_are_enabled(at(0));
        safety.arm(at(0), OPEN).unwrap();
        safety
    }

    #[test]
    fn nothing_pushes_before_it_is_armed() {
        let mut safety = Safety::new(RAMPS);
        for deadman in [None, OPEN, CLOSED] {
            let permit = safety.permit(at(1), deadman);
            assert_eq!((permit.gravity_share, permit.reflection_share), (0.0, 0.0));
            assert!(!permit.engaged);
        }
        assert_eq!(safety.arm(at(2), OPEN), Err(Refusal::NotReady(Mode::Boot)));
    }

    #[test]
    fn a_deadman_found_closed_does_not_arm_or_engage() {
        let mut safety = Safety::new(RAMPS);
        safety.drives_are_enabled(at(0));
        assert_eq!(safety.arm(at(1), CLOSED), Err(Refusal::DeadmanClosed));
        assert_eq!(safety.arm(at(1), None), Err(Refusal::SwitchesSilent));
        safety.arm(at(2), OPEN).unwrap();
        assert!(!safety.permit(at(3), OPEN).engaged);
        assert!(safety.permit(at(4), CLOSED).engaged);
    }

    #[test]
    fn letting_go_or_a_silent_switch_box_disengages_at_once() {
        for quiet in [OPEN, None, Some(Deadman::Disagreeing)] {
            let mut safety = armed();
            assert!(safety.permit(at(10), CLOSED).engaged);
            let permit = safety.permit(at(11), quiet);
            assert_eq!((permit.mode, permit.reflection_share), (Mode::Armed, 0.0));
        }
    }

    #[test]
    fn torque_comes_on_by_ramps() {
        let mut safety = armed();
        assert!((safety.permit(at(500), OPEN).gravity_share - 0.5).abs() < 1e-12);
        safety.permit(at(2_000), CLOSED);
        let permit = safety.permit(at(2_150), CLOSED);
        assert!((permit.reflection_share - 0.5).abs() < 1e-12);
        assert!((permit.gravity_share - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_stop_latches_until_reset_and_a_new_press() {
        let mut safety = armed();
        safety.permit(at(10), CLOSED);
        let cause = Cause::DriveLeft { joint: 3, statusword: 0x218 };
        safety.stop(at(20), cause);
        safety.stop(at(21), Cause::ForeignMaster);
        assert_eq!(safety.cause(), Some(cause), "the first cause is kept");
        assert!(!safety.permit(at(22), CLOSED).engaged);
        assert_eq!(safety.reset(at(30), Some(cause)), Err(Refusal::CausePresent(cause)));
        safety.reset(at(31), None).unwrap();
        safety.drives_are_enabled(at(40));
        assert_eq!(safety.arm(at(41), CLOSED), Err(Refusal::DeadmanClosed));
    }

    #[test]
    fn the_worst_reaction_wins_whatever_the_order() {
        let mild = Cause::DriveLeft { joint: 1, statusword: 0 };
        let worst = Cause::ForeignMaster;
        for order in [[mild, worst], [worst, mild]] {
            let mut safety = armed();
            order.into_iter().for_each(|cause| safety.stop(at(20), cause));
            assert!(!safety.permit(at(20), OPEN).drives_on);
        }
        let mut safety = armed();
        safety.stop(at(20), mild);
        assert!(safety.permit(at(119), OPEN).drives_on);
        assert!(!safety.permit(at(120), OPEN).drives_on);
    }

    #[test]
    fn where_only_reflection_ends_the_arm_is_carried_on_until_worse_comes() {
        let mut safety = armed();
        assert!(safety.permit(at(2_000), CLOSED).engaged);
        safety.stop(at(2_001), Cause::LinkLost);
        let permit = safety.permit(at(2_002), CLOSED);
        assert_eq!((permit.mode, permit.engaged), (Mode::ReflectionOff, false));
        assert!((permit.gravity_share - 1.0).abs() < 1e-12 && permit.reflection_share < 1e-12);
        safety.stop(at(2_003), Cause::ForeignMaster);
        assert_eq!((safety.mode(), safety.cause()), (Mode::DrivesOff, Some(Cause::LinkLost)));

        let mut safety = armed();
        safety.stop(at(20), Cause::LinkLost);
        safety.reset(at(30), None).unwrap();
        assert!(!safety.permit(at(31), CLOSED).engaged, "closed before the reset");
        assert!(!safety.permit(at(32), OPEN).engaged);
        assert!(safety.permit(at(33), CLOSED).engaged);
    }

    #[test]
    fn a_cause_that_can_harm_nothing_yet_stops_nothing() {
        let mut safety = Safety::new(RAMPS);
        safety.drives_are_enabled(at(0));
        safety.stop(at(1), Cause::LinkLost);
        assert_eq!((safety.mode(), safety.cause()), (Mode::Ready, None));
    }

    #[test]
    fn a_channel_that_sticks_is_found_within_fifty_milliseconds() {
        let mut safety = armed();
        let stuck = Some(Deadman::Disagreeing);
        safety.permit(at(100), stuck);
        safety.permit(at(150), stuck);
        assert_eq!(safety.mode(), Mode::Armed);
        safety.permit(at(151), stuck);
        assert_eq!(safety.cause(), Some(Cause::DeadmanDisagrees));
    }
}
