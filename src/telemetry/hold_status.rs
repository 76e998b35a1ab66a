//! Motion of the arm by itself, in the status.

use serde::Serialize;

use controller::hold::{HoldOutput, HoldState};

/// Motion of the arm by itself.
#[derive(Clone, Debug, Serialize)]
pub struct HoldStatus {
    /// `waiting` for the deadman, `moving`, `arrived`, `blocked` or `not-following`.
    pub state: &'static str,
    /// Share of the path that is travelled, 0 to 1.
    pub done: f64,
    /// Goal, in rad (m for a prismatic joint).
    pub to: [f64; 6],
}

impl HoldStatus {
    /// Returns the motion of one cycle.
    pub(crate) fn new(hold: &HoldOutput) -> Self {
        let state = match hold.state {
            HoldState::Waiting => "waiting",
            HoldState::Moving => "moving",
            HoldState::Arrived => "arrived",
            HoldState::Blocked(_) => "blocked",
            HoldState::NotFollowing(_) => "not-following",
        };
        Self { state, done: hold.done, to: hold.goal.into() }
    }
}
