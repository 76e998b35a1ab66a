//! Job of an LSS master with one slave: steps from selection to release, and errors.
//!
//! ```text
//!  waiting (all) ── select ── inquire ── node-id ── bit rate ── store ── activate ── waiting (all) ── boot-up
//! ```

use std::fmt;
use std::time::Duration;

use canopen_rs::NodeId;
use thiserror::Error;

use canopen_device::lss::codec::{Answer, LssState, Request};
use canopen_device::lss::{Address, BitRate, Part, STANDARD_TABLE, node_byte};

/// Selection of the slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// Slave left in configuration by an earlier job.
    Selected,
    /// All slaves on the bus: correct if there is only one.
    All,
    /// Slave with this address.
    Address(Address),
    /// Unconfigured slave found by a fastscan.
    Fastscan,
}

impl Selection {
    /// Returns whether exactly one slave can be selected.
    pub(super) const fn is_one(self) -> bool {
        matches!(self, Self::Address(_) | Self::Fastscan)
    }
}

/// Actions of a job, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job {
    /// Selection of the slave.
    pub selection: Selection,
    /// Inquires identity and node-id.
    pub inquire: bool,
    /// Node-id from the next reset of communication on; `Some(None)` removes it.
    pub node: Option<Option<NodeId>>,
    /// Bit rate from its activation on.
    pub bit_rate: Option<BitRate>,
    /// Stores node-id and bit rate.
    pub store: bool,
    /// Activates the bit rate after this delay in ms.
    pub activate: Option<u16>,
    /// Switches all slaves to waiting at the end.
    pub release: bool,
}

impl Job {
    /// Returns a job that selects and releases only.
    pub const fn new(selection: Selection) -> Self {
        Self {
            selection,
            inquire: false,
            node: None,
            bit_rate: None,
            store: false,
            activate: None,
            release: true,
        }
    }

    /// Requests, scans and pauses in the order in which they are sent.
    pub(super) fn steps(&self) -> Vec<Step> {
        let mut steps = Vec::new();
        // A slave in configuration takes neither selection nor scan and must not be configured as well.
        if self.selection.is_one() {
            steps.push(Step::Send(TO_WAITING));
        }
        match self.selection {
            Selection::Selected => {}
            Selection::All => {
                steps.push(Step::Send(Request::SwitchGlobal(LssState::Configuration)));
            }
            Selection::Address(address) => {
                let select = |part| Request::Select(part, address.part(part));
                steps.extend(
                    [Part::Vendor, Part::Product, Part::Revision].map(select).map(Step::Send),
                );
                steps.push(Step::Request(select(Part::Serial)));
            }
            Selection::Fastscan => steps.push(Step::Scan),
        }
        if self.inquire {
            steps.extend(Part::ALL.map(Request::Inquire).map(Step::Request));
            steps.push(Step::Request(Request::InquireNodeId));
        }
        let node = self.node.map(|node| Request::ConfigureNodeId(node_byte(node)));
        let bit_rate = self
            .bit_rate
            .map(|rate| Request::ConfigureBitTiming { table: STANDARD_TABLE, index: rate.index() });
        let store = self.store.then_some(Request::Store);
        steps.extend(node.into_iter().chain(bit_rate).chain(store).map(Step::Request));
        steps.extend(self.activate.map(Request::ActivateBitTiming).map(Step::Send));
        if self.release {
            steps.extend(self.activate.map(|delay| Step::Pause(switch_delay(delay))));
            steps.push(Step::Send(TO_WAITING));
        }
        steps
    }
}

/// Time limits by the kind of request.
#[derive(Clone, Copy, Debug)]
pub struct Timeouts {
    /// Time allowed for a reply.
    pub reply: Duration,
    /// Time allowed for storing, as flash memory is slow.
    pub store: Duration,
    /// Reply window of one fastscan request.
    pub probe: Duration,
}

/// Result of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Identity, where it was selected by it or inquired.
    pub address: Option<Address>,
    /// Node-id before the job, `Some(None)` for an unconfigured slave; `None` if not inquired.
    pub node: Option<Option<NodeId>>,
    /// Set if a boot-up message with the slave's first node-id was received.
    pub is_booted: bool,
}

/// Error of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum LssError {
    /// No slave has the selected address.
    #[error("no slave has the address {0}")]
    NoSuchSlave(Address),
    /// Fastscan without a reply.
    #[error("no unconfigured slave answers")]
    NoneUnconfigured,
    /// Fastscan whose slave did not confirm this part of its identity.
    #[error(
        "fastscan: no slave confirms the {0} that was found; replies exceed the probe window, or a slave was removed"
    )]
    Lost(Part),
    /// No slave replied.
    #[error("{0}: no slave answers")]
    Timeout(Request),
    /// More than one slave replied.
    #[error("{0}: more than one slave answers; select one by its identity")]
    Several(Request),
    /// Reported node-id outside 1..=127 and 255.
    #[error("the slave's node-id must be within 1..=127 or 255, got {0}")]
    NoNodeId(u8),
    /// Request that the slave answered with an error code.
    #[error("{request} refused: {}", Reason(*request, *answer))]
    Refused {
        request: Request,
        /// Error code of the reply, and the manufacturer's own.
        answer: Answer,
    },
}

/// Text of an error code, which depends on the service.
struct Reason(Request, Answer);

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(request, Answer { error, specific }) = *self;
        if error == Answer::SPECIFIC {
            return write!(f, "255 manufacturer-specific error, code {specific}");
        }
        let text = match (request, error) {
            (Request::ConfigureNodeId(_), 1) => "node-id out of range",
            (Request::ConfigureBitTiming { .. }, 1) => "bit timing not supported",
            (Request::Store, 1) => "storing is not supported",
            (Request::Store, 2) => "storage media access error",
            _ => "reserved error code",
        };
        write!(f, "{error} {text}")
    }
}

/// Step of a job.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    /// Sends a request without reply.
    Send(Request),
    /// Sends a request with one reply.
    Request(Request),
    /// Runs a fastscan.
    Scan,
    /// Waits while no slave communicates.
    Pause(Duration),
    /// Waits for the boot-up of a slave with its first node-id.
    BootUp(NodeId),
}

/// Time from the activation of a bit rate until slaves communicate again: twice its delay.
fn switch_delay(delay: u16) -> Duration {
    Duration::from_millis(u64::from(delay)) * 2
}

/// First and last request of a job: no slave is selected.
pub(super) const TO_WAITING: Request = Request::SwitchGlobal(LssState::Waiting);
