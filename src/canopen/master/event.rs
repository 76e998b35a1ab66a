//! Events of a master, and their text.
//!
//! `node::safety` decides the reaction to each.

use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::nmt::HEARTBEAT_COB_BASE;
use canopen_rs::sdo::{SDO_REQUEST_COB_BASE, SDO_RESPONSE_COB_BASE};
use derive_more::Display;

use crate::abort::AbortCode;
use crate::drive::Statusword;
use crate::emcy::Emergency;
use crate::frame::{Channel, FUNCTION_CODE, Frame};
use crate::master::boot_error::BootError;
use crate::master::duplicate::Sign;
use crate::master::error_history::History;
use crate::master::read_back::ReadBack;
use crate::master::steps::Configuration;
use crate::nmt;
use crate::object::Object;
use crate::sdo::SdoError;
use units::numbering::NodeIndex;

/// Event of the master.
#[derive(Clone, Debug, Display, PartialEq)]
pub enum Event {
    /// End of the boot: every mandatory node is configured, started and operational.
    #[display("every node is operational")]
    Booted,
    /// Node that could not be booted. The others are booted further, but none is started.
    #[display("{_0}")]
    BootFailed(BootError),
    /// Drive that was enabled before its boot. The boot disabled voltage and awaited standstill.
    #[display("was found enabled; it is disabled now")]
    FoundEnabled {
        /// Index of the node in the list of plans.
        node: NodeIndex,
    },
    /// End of a node's configuration; the node is not started yet.
    #[display("configuration {configuration}")]
    Configured {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Origin of the configuration.
        configuration: Configuration,
    },
    /// Node that refuses the value of an object that is only a means; the boot has gone on without it.
    #[display("{object}: value refused: {code}; goes on as if it had no such object")]
    ValueRefused {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Object whose write was refused.
        object: Object,
        /// Reason that the node gave.
        code: AbortCode,
    },
    /// Optional node that is absent. The others continue; it is booted when it appears.
    #[display("missing, waited {:.1} s; optional, so the others start without it", waited.as_secs_f64())]
    Absent {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Time waited.
        waited: Duration,
    },
    /// Optional node that was absent and now is operational.
    #[display("has appeared and is operational")]
    Joined {
        /// Index of the node in the list of plans.
        node: NodeIndex,
    },
    /// Emergency of a node: an error, or an error reset.
    #[display("emergency {emergency}")]
    Emergency {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Content of the EMCY message.
        emergency: Emergency,
    },
    /// Warning of a node: an emergency without an error, with a code that its plan lists.
    #[display("warning {emergency} (emcy_warnings)")]
    EmergencyWarning {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Content of the EMCY message.
        emergency: Emergency,
    },
    /// Emergency of a drive that the test of its watchdog has caused.
    #[display("proof test of its watchdog: emergency {emergency}")]
    Tested {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Content of the EMCY message.
        emergency: Emergency,
    },
    /// Error history (1003h) of a node, read after an emergency.
    #[display("error history (1003h): {history}")]
    ErrorHistory {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Error codes, the newest first.
        history: History,
    },
    /// Statusword (6041h) of a drive, read on request.
    #[display("6041h = {:04X}h", statusword.0)]
    Statusword {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Value read.
        statusword: Statusword,
    },
    /// Drive that did not report in time that its power stage is off, so the next step follows.
    #[display("does not report power off after disable voltage (6041h = {:04X}h); next: {step}", statusword.0)]
    StillOn {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Last statusword received.
        statusword: Statusword,
        /// Step that follows.
        step: PowerOffStep,
    },
    /// Drive that did not follow disable voltage in its RPDO, and now reports that its power stage is off.
    #[display("confirmed power off after {step}")]
    PowerOffConfirmed {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Last step before.
        step: PowerOffStep,
    },
    /// Read-back of an object that the boot has verified.
    #[display("{object} {read}")]
    ReadBack {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Object read.
        object: Object,
        /// Comparison with the verified value, or the reason of a failed read.
        read: ReadBack,
    },
    /// Planned torque limits of a drive in effect again, after its mode was checked under reduced ones.
    #[display("shows the planned mode when enabled; torque limit raised to the planned one")]
    LimitsRaised {
        /// Index of the node in the list of plans.
        node: NodeIndex,
    },
    /// Drive that is off, its torque limited to a share of the planned limits.
    #[display("torque limit reduced for a trial")]
    TorqueLimited {
        /// Index of the node in the list of plans.
        node: NodeIndex,
    },
    /// Drive that is off and prepared for a homing.
    #[display("prepared for homing: torque limit reduced, home offset, method and mode written")]
    HomingPrepared {
        /// Index of the node in the list of plans.
        node: NodeIndex,
    },
    /// Drive that is off, with planned mode and torque limits after a homing.
    #[display("left homing: planned mode and torque limit in effect again")]
    HomingLeft {
        /// Index of the node in the list of plans.
        node: NodeIndex,
    },
    /// End of a node's monitoring of its master, on request.
    #[display("no longer monitors this master")]
    MonitoringEnded {
        /// Index of the node in the list of plans.
        node: NodeIndex,
    },
    /// Failed write that should end a node's monitoring of its master; the node keeps monitoring it.
    #[display("still monitors this master, so it will report 8130h: {object} = 0 {error}")]
    MonitoringKept {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Object that could not be written.
        object: Object,
        /// Failure of the write.
        error: SdoError,
    },
    /// Loss of a node: no heartbeat or answer to guarding within the time allowed.
    #[display("heartbeat lost")]
    HeartbeatLost {
        /// Index of the node in the list of plans.
        node: NodeIndex,
    },
    /// Reboot of a node without a command: its configuration is lost.
    #[display("rebooted by itself")]
    Rebooted {
        /// Index of the node in the list of plans.
        node: NodeIndex,
    },
    /// Change of a node's NMT state, or its heartbeat's return after a loss.
    #[display("is {}", nmt::description(*state))]
    StateChanged {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// NMT state now.
        state: NmtState,
    },
    /// Sign of two nodes that share one node-id.
    #[display("{sign}: are there two nodes with this node-id?")]
    Duplicate {
        /// Index of the node in the list of plans.
        node: NodeIndex,
        /// Evidence.
        sign: Sign,
    },
    /// Frame of a node that is in no plan. Reported once for each such node.
    #[display("bus {}: node {node_id} is not in the configuration", channel.0)]
    UnknownNode {
        /// Bus of the node.
        channel: Channel,
        /// Node-id, 1 to 127.
        node_id: u8,
    },
    /// Upload by another SDO client. Reported once for each node and boot.
    #[display("another SDO client reads from it; transfers may disturb each other")]
    ReadByAnother {
        /// Index of the node in the list of plans.
        node: NodeIndex,
    },
    /// Frame of another master that commands this network.
    #[display("bus {}: {} {frame}", channel.0, evidence(frame))]
    ForeignMaster {
        /// Bus of the frame.
        channel: Channel,
        /// Frame that only the master may send: NMT command, SYNC, RPDO, SDO download or its heartbeat; or the
        /// confirmation of such a download.
        frame: Frame,
    },
}

/// Step to a power stage that is off, mildest first.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, PartialOrd, Ord)]
pub enum PowerOffStep {
    /// 6040h = 0 by SDO, and 6041h read.
    #[display("6040h = 0 by SDO")]
    Download,
    /// NMT stop of the node, on which its abort connection option (6007h) acts.
    #[display("NMT stop")]
    NmtStop,
    /// NMT pre-operational of the node, in which it answers SDO again, and 6041h read.
    #[display("NMT pre-operational")]
    PreOperational,
    /// End of heartbeat and guarding for all nodes: the watchdogs of all drives expire.
    #[display("end of heartbeat and guarding for all nodes")]
    NoErrorControl,
}

impl Event {
    /// Index of the affected node in the list of plans; `None` if the event concerns no planned node or
    /// carries the name itself.
    pub const fn node(&self) -> Option<NodeIndex> {
        match self {
            Self::FoundEnabled { node }
            | Self::Configured { node, .. }
            | Self::ValueRefused { node, .. }
            | Self::Absent { node, .. }
            | Self::Joined { node }
            | Self::Emergency { node, .. }
            | Self::EmergencyWarning { node, .. }
            | Self::Tested { node, .. }
            | Self::ErrorHistory { node, .. }
            | Self::Statusword { node, .. }
            | Self::StillOn { node, .. }
            | Self::PowerOffConfirmed { node, .. }
            | Self::HeartbeatLost { node }
            | Self::Rebooted { node }
            | Self::StateChanged { node, .. }
            | Self::LimitsRaised { node }
            | Self::HomingPrepared { node }
            | Self::HomingLeft { node }
            | Self::TorqueLimited { node }
            | Self::ReadBack { node, .. }
            | Self::MonitoringEnded { node }
            | Self::MonitoringKept { node, .. }
            | Self::ReadByAnother { node }
            | Self::Duplicate { node, .. } => Some(*node),
            Self::Booted
            | Self::BootFailed(_)
            | Self::UnknownNode { .. }
            | Self::ForeignMaster { .. } => None,
        }
    }
}

/// Evidence of another master that `frame` gives, to be followed by the frame.
const fn evidence(frame: &Frame) -> &'static str {
    match frame.cob_id & FUNCTION_CODE {
        SDO_REQUEST_COB_BASE => "another master writes:",
        SDO_RESPONSE_COB_BASE => "a write of another master is confirmed:",
        HEARTBEAT_COB_BASE => "another master sent this node's heartbeat:",
        _ => "another master sent",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn event_reads_as_a_sentence() {
        let configuration = Configuration::Skipped;
        for (event, text) in [
            (
                Event::Configured { node: NodeIndex(0), configuration },
                "configuration already stored, verified",
            ),
            (
                Event::Absent { node: NodeIndex(6), waited: Duration::from_secs(2) },
                "missing, waited 2.0 s; optional, so the others start without it",
            ),
            (
                Event::UnknownNode { channel: Channel(1), node_id: 9 },
                "bus 1: node 9 is not in the configuration",
            ),
            (Event::StateChanged { node: NodeIndex(0), state: NmtState::Stopped }, "is stopped"),
        ] {
            assert_eq!(event.to_string(), text);
        }
    }
}
