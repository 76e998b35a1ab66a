//! Changes of one node, as its master reports them to the network.

use std::time::Duration;

use crate::drive::Statusword;
use crate::heartbeat::HeartbeatEvent;
use crate::master::boot_error::BootError;
use crate::master::error_history::History;
use crate::master::monitoring_off::EndResult;
use crate::master::read_back::ReadBack;
use crate::master::steps::Configuration;
use crate::object::Object;

/// Change of a node.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Report {
    /// Configured, and monitored from now on.
    Configured(Configuration),
    /// Boot failed.
    Failed(BootError),
    /// A stage of its boot after its start is over.
    StageDone,
    /// Optional and absent. Reported once.
    Absent(Duration),
    /// Change of its NMT state, or loss of its heartbeat.
    HeartbeatEvent(HeartbeatEvent),
    /// Content of its error history (1003h).
    History(History),
    /// Content of its statusword (6041h).
    Statusword(Statusword),
    /// Outcome of a read-back.
    ReadBack(Object, ReadBack),
    /// Outcome of the end of its monitoring of the master.
    Monitoring(EndResult),
}
