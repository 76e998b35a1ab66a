//! The cyclic exchange between master and nodes: which bits of which frame are whose.
//!
//! Resolved once from the nodes' layouts; every cycle then shifts and masks, and neither looks anything
//! up in a dictionary nor allocates. What the layouts are is in [`layout`](crate::layout).
//!
//! ```text
//!             per-drive                                grouped
//!  TPDO1   { statusword, position, torque }         { position }                      every SYNC
//!  TPDO2                                            { statusword }                    on change
//!  TPDO3                                            { torque }                        every 100th SYNC
//!  RPDO1   { controlword, target }                  { target a, target b, target c }  every SYNC
//!  RPDO2                                            { controlword }                   on change
//! ```
//!
//! The frame of a group is one frame with three takers. Each maps its own target and skips the others'
//! with dummies, so what the frame holds is the sum of what its takers map.

mod samples;
mod slot;
mod targets;

pub use samples::Inbox;
pub use samples::Told;
pub use targets::Outbox;

use thiserror::Error;

use crate::frame::Channel;
use crate::object::Object;
use crate::plan::NodePlan;
use units::numbering::NodeIndex;

/// Why layouts are no cyclic exchange.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ExchangeError {
    /// What a drive must tell or be told is in none of its PDOs.
    #[error("{name}: {object} is in none of its PDOs")]
    Missing {
        /// Whose.
        name: String,
        /// What.
        object: Object,
    },
    /// Two nodes take the same bits of one frame for different things.
    #[error("{name}: {object} in {cob_id:03X}h is where another node has something else")]
    Overlap {
        /// The second of them.
        name: String,
        /// What it takes them for.
        object: Object,
        /// The frame.
        cob_id: u16,
    },
    /// Two nodes take one frame to have different lengths, or to act at different times.
    #[error("{name}: {cob_id:03X}h is not as another node that takes it has it")]
    Unlike {
        /// The second of them.
        name: String,
        /// The frame.
        cob_id: u16,
    },
}

/// Both directions of the cyclic exchange.
#[derive(Clone, Debug)]
pub struct Exchange {
    /// TPDOs of the nodes.
    pub inbox: Inbox,
    /// RPDOs of the nodes.
    pub outbox: Outbox,
}

/// Resolves both directions for these nodes, the drives first; a node is known by its place in the list.
///
/// # Errors
/// When a drive's statusword, position, controlword or target is nowhere, or nodes contradict each
/// other about a frame they share.
pub fn resolve(plans: &[(Channel, NodePlan)]) -> Result<Exchange, ExchangeError> {
    let (inbox, outbox) = (Inbox::new(plans), Outbox::new(plans)?);
    for (node, (_, plan)) in NodeIndex::each(plans).filter(|(_, (_, plan))| plan.is_drive()) {
        for (object, is_there) in [
            (Object::STATUSWORD, inbox.tells_status(node)),
            (Object::POSITION_ACTUAL, inbox.samples(node)),
            (Object::CONTROLWORD, outbox.reaches(node, Object::CONTROLWORD)),
            (Object::TARGET_TORQUE, outbox.reaches(node, Object::TARGET_TORQUE)),
        ] {
            if !is_there {
                return Err(ExchangeError::Missing { name: plan.name.clone(), object });
            }
        }
    }
    Ok(Exchange { inbox, outbox })
}
