//! What is tried, and what it has led to.

use units::numbering::Joint;

/// Drive that is tried, and the torque with which it may push.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrialRequest {
    /// Joint of the drive.
    pub joint: Joint,
    /// Bound of the torque, as a share of the capacity in ‰.
    pub share: u16,
}

/// What a push in one direction has led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// No motion up to the bound.
    Still,
    /// Motion of the joint.
    Moved {
        /// Target torque at which it had moved, in ‰ of rated torque.
        torque: i16,
        /// Motion in counts of 6064h.
        counts: i32,
    },
}

/// Reason why a trial has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Both directions were tried.
    Done,
    /// The deadman was released.
    LetGo,
    /// The joint moved farther than 2° (3.5 mm).
    TooFar,
    /// The joint moved faster than 0.6 rad/s (0.1 m/s).
    TooFast,
    /// Another joint moved.
    OtherMoved(Joint),
    /// The drive did not take the limit, or not in time.
    LimitRefused,
    /// The drive did not reach operation enabled in time, or another drive stayed on.
    NotEnabled,
}

/// What a trial does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// All drives are switched off.
    SwitchingOff,
    /// The torque limit is written.
    Limiting,
    /// The deadman is awaited.
    Waiting,
    /// The drive is enabled.
    Enabling,
    /// Its torque rises.
    Pushing,
    /// It is off again.
    Ended(End),
}

/// State of a trial in one cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrialStatus {
    /// Drive and bound.
    pub request: TrialRequest,
    /// What it does.
    pub stage: Stage,
    /// What the positive and the negative torque have led to so far.
    pub answers: [Option<Answer>; 2],
}
