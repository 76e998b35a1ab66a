//! Changes of one node, as its master reports them to the network.

use std::time::Duration;

use crate::drive::Statusword;
use crate::heartbeat::HeartbeatEvent;
use crate::master::boot_error::BootError;
use crate::master::error_history::History;
use crate::master::monitoring_off::EndResult;
use crate::master::read_back::ReadBack;
use crate::master::steps::{Configuration, Stage};
use crate::object::Object;

/// Change of a node.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Report {
    /// Configured, and monitored from now on.
    Configured(Configuration),
    /// Boot that has failed, with its reason.
    Failed(BootError),
    /// End of a boot stage that ran after the node's start.
    StageDone(Stage),
    /// Optional node that is absent, with the time waited. Reported once.
    Absent(Duration),
    /// Change of the NMT state, or loss of the heartbeat.
    HeartbeatEvent(HeartbeatEvent),
    /// Content of the error history (1003h).
    History(History),
    /// Content of the statusword (6041h).
    Statusword(Statusword),
    /// Outcome of a read-back.
    ReadBack(Object, ReadBack),
    /// Outcome of the end of the node's monitoring of the master.
    Monitoring(EndResult),
}
