//! Homing of drives at rest (`zero = "homing"`): each drive alone takes its current position for home, by method 37 or 35.
//!
//! ```text
//!  ready ──► all drives off ──► each drive: reduced torque limit, 607Ch, 6098h, 6060h = 6 ──► enabled alone, started
//!                                              attained ◄─┘     └► moves, faults, too late: off, stop S3
//!  ready ◄── proof test ◄── 6060h = 10 and planned limits, read back ◄── all attained
//! ```
//!
//! In homing mode a drive holds its position with up to 5 % of its torque. One that searches its home in spite of the method
//! is off again before the joint has moved by 0.3° (0.5 mm), and the way of the time to disable it.

mod run;

use thiserror::Error;

use canopen::master::event::Event;
use units::numbering::Joint;

/// Reason why a drive was not homed. Every drive is off then, and the next reset boots the network.
#[derive(Clone, Debug, PartialEq, Error)]
#[error(
    "joint {joint} ({name}): {reason}; all drives are off, its zero is unknown: `frhc ctl reset` boots the network and writes \
     mode and torque limits again"
)]
pub struct HomingError {
    /// Joint whose drive was not homed.
    pub joint: Joint,
    /// Its name.
    pub name: String,
    /// Reason.
    pub reason: HomingFailure,
}

/// Reason why a homing failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum HomingFailure {
    /// Position that is neither the one before the homing nor home.
    #[error(
        "6064h is {found} in the homing, was {before} before, and must be {home} at home: the drive moves in spite of its method, \
         the joint was moved, or 607Ch acts otherwise"
    )]
    Moved {
        /// Counts found.
        found: i32,
        /// Counts before the homing.
        before: i32,
        /// Counts at home.
        home: i32,
    },
    /// Bit 13 of the statusword.
    #[error("the drive reports a homing error (6041h = {0:04X}h)")]
    Reported(u16),
    /// Homing not attained in time.
    #[error("homing not attained in time (6041h = {0:04X}h): see homing_s and referenced_bit")]
    TooLate(u16),
    /// Deadman no longer known to be released.
    #[error("the deadman was pressed during the homing")]
    DeadmanClosed,
    /// Writes before or after the homing that the drive did not answer.
    #[error("the drive did not answer within 5 s")]
    Unanswered,
    /// Drive that does not report that it is off.
    #[error("a drive does not report that it is off")]
    StillOn,
}

/// Progress of a homing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HomingProgress {
    is_running: bool,
    /// Drives that have answered since the start of the stage.
    has_answered: [bool; 6],
}

impl HomingProgress {
    /// Returns whether drives are homed.
    pub(super) const fn is_running(&self) -> bool {
        self.is_running
    }

    /// Takes an event of the master.
    pub(super) fn on_event(&mut self, event: &Event) {
        if let Event::HomingPrepared { node } | Event::HomingLeft { node } = event
            && let Some(joint) = node.joint()
        {
            *joint.entry_mut(&mut self.has_answered) = true;
        }
    }
}
