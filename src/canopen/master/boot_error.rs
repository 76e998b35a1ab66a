//! Why a node could not be booted, in words: which node, which object, what was expected and what was
//! found.

use std::time::Duration;

use canopen_rs::NodeId;
use thiserror::Error;

use crate::abort::AbortCode;
use crate::master::check::Check;
use crate::master::check::Shown;
use crate::master::duplicate::Sign;
use crate::object::Object;
use crate::plan::NodePlan;
use crate::sdo::Content;
use crate::sdo::SdoError;

/// Why a node could not be booted.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{name}, node {}: {problem}", node.raw())]
pub struct BootError {
    /// What people call it.
    pub name: String,
    /// Where it is.
    pub node: NodeId,
    /// What is wrong.
    pub problem: Problem,
}

/// What is wrong with a node that cannot be booted.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Problem {
    /// It never answered.
    #[error("does not answer, waited {:.1} s", waited.as_secs_f64())]
    Absent {
        /// For so long.
        waited: Duration,
    },
    /// It fell silent.
    #[error("{0}: no answer")]
    Silent(Object),
    /// An object is not what it should be: another device, or a write that was not taken.
    #[error("{object} is {found}, expected {expected}")]
    Differs {
        /// Which object.
        object: Object,
        /// What it should hold.
        expected: Shown,
        /// What it holds.
        found: Shown,
    },
    /// It aborted a transfer.
    #[error("{0} refused: {1}")]
    Refused(Object, AbortCode),
    /// A transfer went wrong and was aborted here.
    #[error("{0} broken off: {1}")]
    BrokenOff(Object, AbortCode),
    /// Found with its power on, it does not come to rest without it.
    #[error("still moves, {:.1} s after its power was taken off", waited.as_secs_f64())]
    Moving {
        /// For so long.
        waited: Duration,
    },
    /// No boot-up message after a reset.
    #[error("did not boot up after its reset")]
    NoBootUp,
    /// A boot-up message in between: its settings are gone.
    #[error("rebooted by itself")]
    Rebooted,
    /// It is probably two.
    #[error("{0}: are there two nodes with this node-id?")]
    Duplicate(Sign),
    /// Configured, but neither a heartbeat nor an answer to its guard came.
    #[error("no heartbeat")]
    NoHeartbeat,
    /// Told to start, but it did not say it had.
    #[error("did not become operational")]
    NotStarted,
}

impl BootError {
    /// What is wrong with the node of `plan`.
    pub fn new(plan: &NodePlan, problem: Problem) -> Self {
        Self { name: plan.name.clone(), node: plan.node, problem }
    }
}

impl Problem {
    /// Whether it is of a node that comes and goes, rather than of a wrong one.
    pub const fn is_passing(&self) -> bool {
        match self {
            Self::Absent { .. }
            | Self::Silent(_)
            | Self::NoBootUp
            | Self::Rebooted
            | Self::NoHeartbeat
            | Self::NotStarted => true,
            Self::Differs { .. }
            | Self::Refused(..)
            | Self::BrokenOff(..)
            | Self::Moving { .. }
            | Self::Duplicate(_) => false,
        }
    }

    /// What a failed transfer says about its object.
    pub const fn of_transfer(object: Object, error: SdoError) -> Self {
        match error {
            SdoError::Refused(code) => Self::Refused(object, code),
            SdoError::BrokenOff(code) => Self::BrokenOff(object, code),
            SdoError::Silent => Self::Silent(object),
        }
    }

    /// An object that holds something else than it must.
    pub fn differs(check: &Check, content: &Content) -> Self {
        let (expected, found) = (check.wanted(), check.found(content));
        Self::Differs { object: check.object, expected, found }
    }
}
