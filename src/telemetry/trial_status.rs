//! Trial of one drive, in the status.

use serde::{Deserialize, Serialize};

use node::trial::{Answer, End, Stage, TrialStatus};

/// Trial of one drive.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct TrialReport {
    /// Joint whose drive is tried, 1 at the base.
    pub joint: u8,
    /// Bound of the torque, in ‰ of the capacity.
    pub bound: u16,
    /// `switching-off`, `limiting`, `waiting` for the deadman, `enabling`, `pushing` or `ended`.
    pub state: String,
    /// Reason of the end: `done`, `let-go`, `too-far`, `too-fast`, `other-moved`, `limit-refused` or `not-enabled`.
    pub end: Option<String>,
    /// Another joint that moved.
    pub moved_instead: Option<u8>,
    /// What positive and negative torque have led to; `None` if that direction was not tried to its end.
    pub answers: [Option<TrialAnswer>; 2],
}

/// What a push in one direction has led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct TrialAnswer {
    /// Target torque at which the joint had moved, in ‰ of rated torque; 0 if it stood up to the bound.
    pub torque: i16,
    /// Motion in counts of 6064h.
    pub counts: i32,
}

impl TrialReport {
    /// Returns the trial of one cycle.
    pub fn new(status: &TrialStatus) -> Self {
        let (state, end) = match status.stage {
            Stage::SwitchingOff => ("switching-off", None),
            Stage::Limiting => ("limiting", None),
            Stage::Waiting => ("waiting", None),
            Stage::Enabling => ("enabling", None),
            Stage::Pushing => ("pushing", None),
            Stage::Ended(end) => ("ended", Some(end)),
        };
        Self {
            joint: status.request.joint.number(),
            bound: status.request.share,
            state: state.to_owned(),
            end: end.map(|end| name(end).to_owned()),
            moved_instead: match end {
                Some(End::OtherMoved(joint)) => Some(joint.number()),
                _ => None,
            },
            answers: status.answers.map(|answer| answer.map(TrialAnswer::new)),
        }
    }
}

impl TrialAnswer {
    const fn new(answer: Answer) -> Self {
        match answer {
            Answer::Still => Self { torque: 0, counts: 0 },
            Answer::Moved { torque, counts } => Self { torque, counts },
        }
    }
}

const fn name(end: End) -> &'static str {
    match end {
        End::Done => "done",
        End::LetGo => "let-go",
        End::TooFar => "too-far",
        End::TooFast => "too-fast",
        End::OtherMoved(_) => "other-moved",
        End::LimitRefused => "limit-refused",
        End::NotEnabled => "not-enabled",
    }
}
