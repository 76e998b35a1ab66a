//! Error of a failed boot, with the node, the object, the expected and the found value.

use std::time::Duration;

use canopen_rs::NodeId;
use thiserror::Error;

use crate::abort::AbortCode;
use crate::master::check::{Check, DisplayedValue};
use crate::master::duplicate::Sign;
use crate::nameplate::Misfit;
use crate::object::Object;
use crate::plan::NodePlan;
use crate::sdo::{Content, SdoError};
use crate::setting::remedy;

/// Error of a failed boot.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{name}, node {}: {problem}", node.raw())]
pub struct BootError {
    /// Name of the node in the configuration.
    pub name: String,
    /// Node-id.
    pub node: NodeId,
    /// Reason.
    pub problem: Problem,
}

/// Reason why a node cannot be booted.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Problem {
    /// It never replied.
    #[error("does not answer, waited {:.1} s", waited.as_secs_f64())]
    Absent {
        /// Time waited.
        waited: Duration,
    },
    /// It stopped replying.
    #[error("{0}: no answer")]
    Timeout(Object),
    /// An object differs: another device, or a write without effect.
    #[error("{object} is {found}, expected {expected}{}", remedy(*object))]
    Differs {
        /// Object.
        object: Object,
        /// Expected value.
        expected: DisplayedValue,
        /// Value found.
        found: DisplayedValue,
    },
    /// Sign, scale or ratings stored in the drive are not those of the configuration.
    #[error(transparent)]
    Misfit(#[from] Misfit),
    /// As `Misfit`, but another drive of the configuration, which does not fit its place either, is meant to hold these
    /// values.
    #[error(
        "{} ({}) is {}, expected {}: it fits {owner}, so the drives seem to be swapped: exchange their node-ids or cables, \
         not their keys",
        misfit.name, misfit.object, misfit.found, misfit.expected
    )]
    Swapped {
        /// Its own misfit.
        misfit: Misfit,
        /// Drive that is meant to hold these values.
        owner: String,
    },
    /// The node aborted a transfer.
    #[error("{0} refused: {1}{remedy}", remedy = remedy(*.0))]
    AbortedByServer(Object, AbortCode),
    /// The node does not let its PDO mapping be written, and an entry is not as planned.
    #[error("{0} refused: {1}; {2}: choose a layout that the device has")]
    FixedMapping(Object, AbortCode, Box<Self>),
    /// The master aborted a transfer.
    #[error("{0} aborted by the master: {1}")]
    AbortedLocally(Object, AbortCode),
    /// The drive was found with its power on and keeps moving without it.
    #[error("still moves, {:.1} s after its power was taken off", waited.as_secs_f64())]
    Moving {
        /// Time waited.
        waited: Duration,
    },
    /// No boot-up message after a reset.
    #[error("did not boot up after its reset")]
    NoBootUp,
    /// A boot-up message during the boot: its configuration is lost.
    #[error("rebooted by itself")]
    Rebooted,
    /// Two nodes seem to share the node-id.
    #[error("{0}: are there two nodes with this node-id?")]
    Duplicate(Sign),
    /// The node is configured, but no heartbeat or answer to guarding was received.
    #[error("no heartbeat")]
    NoHeartbeat,
    /// Started, but it did not report operational.
    #[error("did not become operational")]
    NotStarted,
}

impl BootError {
    /// Returns the error of the node of `plan`.
    pub fn new(plan: &NodePlan, problem: Problem) -> Self {
        Self { name: plan.name.clone(), node: plan.node, problem }
    }
}

impl Problem {
    /// Returns whether a later boot may succeed without intervention; false for a wrong device.
    pub const fn is_passing(&self) -> bool {
        match self {
            Self::Absent { .. }
            | Self::Timeout(_)
            | Self::NoBootUp
            | Self::Rebooted
            | Self::NoHeartbeat
            | Self::NotStarted => true,
            Self::Differs { .. }
            | Self::Misfit(_)
            | Self::Swapped { .. }
            | Self::AbortedByServer(..)
            | Self::FixedMapping(..)
            | Self::AbortedLocally(..)
            | Self::Moving { .. }
            | Self::Duplicate(_) => false,
        }
    }

    /// Converts the error of a transfer.
    pub const fn of_transfer(object: Object, error: SdoError) -> Self {
        match error {
            SdoError::AbortedByServer(code) => Self::AbortedByServer(object, code),
            SdoError::AbortedLocally(code) => Self::AbortedLocally(object, code),
            SdoError::Timeout => Self::Timeout(object),
        }
    }

    /// Returns the problem of an object that differs from `check`.
    pub fn differs(check: &Check, content: &Content) -> Self {
        let (expected, found) = (check.expected_value(), check.found_value(content));
        Self::Differs { object: check.object, expected, found }
    }
}
