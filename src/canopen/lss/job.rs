//! What an LSS master is to do with a slave, from its choice to its release, and what can come of it.
//!
//! ```text
//!  all to waiting ── select ── inquire ── node-id ── bit rate ── store ── activate ── all to waiting ── boot-up
//! ```

use std::fmt;
use std::time::Duration;

use canopen_rs::NodeId;
use thiserror::Error;

use crate::lss::Address;
use crate::lss::BitRate;
use crate::lss::Part;
use crate::lss::STANDARD_TABLE;
use crate::lss::codec::Answer;
use crate::lss::codec::Mode;
use crate::lss::codec::Request;
use crate::lss::node_byte;

/// Whom a job concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// Whoever an earlier job has left in configuration.
    Selected,
    /// Every slave on the bus: right where there is one only.
    Everybody,
    /// The slave of this address.
    Address(Address),
    /// The unconfigured slave a fastscan finds.
    Fastscan,
}

impl Selection {
    /// Whether it can only be one slave.
    pub(super) const fn is_one(self) -> bool {
        matches!(self, Self::Address(_) | Self::Fastscan)
    }
}

/// What is to be done, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job {
    /// With whom.
    pub selection: Selection,
    /// Find out who it is and what its node-id is.
    pub inquire: bool,
    /// Its node-id from the next reset of communication on; `Some(None)` takes it away.
    pub node: Option<Option<NodeId>>,
    /// Its bit rate from the activation on.
    pub bit_rate: Option<BitRate>,
    /// Both outlast a loss of power.
    pub store: bool,
    /// The bit rate changes after so many ms.
    pub activate: Option<u16>,
    /// All slaves go to waiting in the end.
    pub release: bool,
}

impl Job {
    /// Chooses, does nothing, and releases.
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

    /// What it comes to, one step after another.
    pub(super) fn steps(&self) -> Vec<Step> {
        let mut steps = Vec::new();
        // A slave in configuration hears neither selection nor scan, and must not be set with the other.
        if self.selection.is_one() {
            steps.push(Step::Say(TO_WAITING));
        }
        match self.selection {
            Selection::Selected => {}
            Selection::Everybody => {
                steps.push(Step::Say(Request::SwitchGlobal(Mode::Configuration)));
            }
            Selection::Address(address) => {
                let select = |part| Request::Select(part, address.part(part));
                steps.extend(
                    [Part::Vendor, Part::Product, Part::Revision].map(select).map(Step::Say),
                );
                steps.push(Step::Ask(select(Part::Serial)));
            }
            Selection::Fastscan => steps.push(Step::Scan),
        }
        if self.inquire {
            steps.extend(Part::ALL.map(Request::Inquire).map(Step::Ask));
            steps.push(Step::Ask(Request::InquireNodeId));
        }
        let node = self.node.map(|node| Request::ConfigureNodeId(node_byte(node)));
        let bit_rate = self
            .bit_rate
            .map(|rate| Request::ConfigureBitTiming { table: STANDARD_TABLE, index: rate.index() });
        let store = self.store.then_some(Request::Store);
        steps.extend(node.into_iter().chain(bit_rate).chain(store).map(Step::Ask));
        steps.extend(self.activate.map(Request::ActivateBitTiming).map(Step::Say));
        if self.release {
            steps.extend(self.activate.map(|delay| Step::Pause(silence(delay))));
            steps.push(Step::Say(TO_WAITING));
        }
        steps
    }
}

/// How long slaves have.
#[derive(Clone, Copy, Debug)]
pub struct Patience {
    /// For an answer.
    pub reply: Duration,
    /// For storing: flash memory is slow.
    pub store: Duration,
    /// For one question of a fastscan.
    pub probe: Duration,
}

/// What is known after a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Who it was, where it was chosen by that or asked for it.
    pub address: Option<Address>,
    /// Its node-id before the job, `Some(None)` if it had none; `None` if it was not asked.
    pub node: Option<Option<NodeId>>,
    /// Whether it was heard to boot up with a node-id that was its first.
    pub is_booted: bool,
}

/// Why a job was not done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum LssError {
    /// No slave has the address that was selected.
    #[error("no slave has the address {0}")]
    NoSuchSlave(Address),
    /// A fastscan found nobody.
    #[error("no unconfigured slave answers")]
    NobodyUnconfigured,
    /// A fastscan lost whom it had found.
    #[error(
        "fastscan: no slave knows the {0} that was found; answers come later than the probe's window, or a slave was taken off"
    )]
    Lost(Part),
    /// Nobody answered.
    #[error("{0}: no slave answers")]
    Silent(Request),
    /// More than one slave answered.
    #[error("{0}: more than one slave answers; select one by its identity")]
    Several(Request),
    /// The slave answered a node-id that is none.
    #[error("the slave has node-id {0}, which is none")]
    NoNodeId(u8),
    /// The slave refused.
    #[error("{request} refused: {}", Reason(*request, *answer))]
    Refused {
        /// What.
        request: Request,
        /// Why.
        answer: Answer,
    },
}

/// An error code in words, which depend on the service.
struct Reason(Request, Answer);

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(request, Answer { error, specific }) = *self;
        if error == Answer::SPECIFIC {
            return write!(f, "255 error of the manufacturer's own, number {specific}");
        }
        let words = match (request, error) {
            (Request::ConfigureNodeId(_), 1) => "node-id out of range",
            (Request::ConfigureBitTiming { .. }, 1) => "bit timing not supported",
            (Request::Store, 1) => "storing is not supported",
            (Request::Store, 2) => "storage media access error",
            _ => "reserved error code",
        };
        write!(f, "{error} {words}")
    }
}

/// One step of a job.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    /// Said to all, answered by none.
    Say(Request),
    /// Answered by one.
    Ask(Request),
    /// Nobody's identity is known yet.
    Scan,
    /// Nobody hears anything.
    Pause(Duration),
    /// The slave must be heard to boot up, or need not be, if it had a node-id.
    BootUp(NodeId),
}

/// From the activation of a bit rate until slaves hear again: its delay, twice.
fn silence(delay: u16) -> Duration {
    Duration::from_millis(u64::from(delay)) * 2
}

/// The first word of a job, and the last: nobody is selected.
pub(super) const TO_WAITING: Request = Request::SwitchGlobal(Mode::Waiting);
