//! Error of a failed boot, with the node, the object, the expected and the found value.

use std::time::Duration;

use canopen_rs::NodeId;
use thiserror::Error;

use crate::abort::AbortCode;
use crate::master::check::{Check, DisplayedValue};
use crate::master::duplicate::Sign;
use crate::nameplate::NameplateMisfit;
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
    /// Node-id of the failed node.
    pub node: NodeId,
    /// Reason.
    pub problem: Problem,
}

/// Reason why a node cannot be booted.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Problem {
    /// No reply since the boot began.
    #[error("does not answer, waited {:.1} s", waited.as_secs_f64())]
    Absent {
        /// Time waited.
        waited: Duration,
    },
    /// No reply to a later request.
    #[error("{0}: no answer")]
    Timeout(Object),
    /// Value of an object that differs: another device, or a write without effect.
    #[error("{object} is {found}, expected {expected}{}", remedy(*object))]
    Differs {
        /// Object that was compared.
        object: Object,
        /// Planned value, with the bits that are compared.
        expected: DisplayedValue,
        /// Value that the node holds.
        found: DisplayedValue,
    },
    /// Stored sign, scale or ratings of the drive that differ from the configuration.
    #[error(transparent)]
    Misfit(#[from] NameplateMisfit),
    /// Misfit of a drive that holds the values of another drive of the configuration, which does not fit its place
    /// either.
    #[error(
        "{} ({}) is {}, expected {}: it fits {owner}, so the drives seem to be swapped: exchange their node-ids or cables, \
         not their keys",
        misfit.name, misfit.object, misfit.found, misfit.expected
    )]
    Swapped {
        /// Mismatch of this drive.
        misfit: NameplateMisfit,
        /// Drive that is meant to hold these values.
        owner: String,
    },
    /// Transfer that the node aborted.
    #[error("{0} refused: {1}{remedy}", remedy = remedy(*.0))]
    AbortedByServer(Object, AbortCode),
    /// Mapping entry that is not as planned, in a node that does not let its PDO mapping be written.
    #[error("{0} refused: {1}; {2}: choose a layout that the device has")]
    FixedMapping(Object, AbortCode, Box<Self>),
    /// Transfer that the master aborted.
    #[error("{0} aborted by the master: {1}")]
    AbortedLocally(Object, AbortCode),
    /// Motion of a drive that was found with its power on, after it was switched off.
    #[error("still moves, {:.1} s after its power was taken off", waited.as_secs_f64())]
    Moving {
        /// Time waited.
        waited: Duration,
    },
    /// No boot-up message after a reset.
    #[error("did not boot up after its reset")]
    NoBootUp,
    /// Boot-up message during the boot: the configuration of the node is lost.
    #[error("rebooted by itself")]
    Rebooted,
    /// Sign of two nodes that share the node-id.
    #[error("{0}: are there two nodes with this node-id?")]
    Duplicate(Sign),
    /// No heartbeat or answer to guarding from a configured node.
    #[error("no heartbeat")]
    NoHeartbeat,
    /// No report of operational after the start.
    #[error("did not become operational")]
    NotStarted,
}

impl BootError {
    /// Adds name and node-id of `plan` to `problem`.
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
