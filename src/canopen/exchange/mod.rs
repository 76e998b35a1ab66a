//! Cyclic exchange between master and nodes: positions of the mapped objects in the PDOs.
//!
//! The positions are computed once from the nodes' [layouts](crate::layout). A cycle only shifts and masks; it does not
//! allocate or search a dictionary.
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
//! The RPDO of a group is one frame for three drives. Each maps its own target and dummy entries (CiA 301,
//! 7.4.8) in place of the others, so the content of the frame is the union of the mappings.

mod rpdos;
mod slot;
mod tpdos;

pub use rpdos::RpdoImage;
pub use tpdos::{TpdoMap, TpdoSample};

use thiserror::Error;

use crate::frame::Channel;
use crate::object::Object;
use crate::plan::NodePlan;
use units::numbering::NodeIndex;

/// Fault of the layouts that prevents a cyclic exchange.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ExchangeError {
    /// Required object of a drive that no PDO maps.
    #[error("{name}: {object} is in none of its PDOs")]
    NotMapped {
        /// Name of the drive.
        name: String,
        /// Required object.
        object: Object,
    },
    /// Two nodes map objects to the same bits of one frame.
    #[error("{name}: {object} in {cob_id:03X}h overlaps an object of another node")]
    Overlap {
        /// Name of the second node.
        name: String,
        /// Object of the second node.
        object: Object,
        /// COB-ID of the frame.
        cob_id: u16,
    },
    /// Two nodes define one frame with different lengths or transmission types.
    #[error("{name}: {cob_id:03X}h has another length or transmission type at another node")]
    Mismatch {
        /// Name of the second node.
        name: String,
        /// COB-ID of the frame.
        cob_id: u16,
    },
}

/// Both directions of the cyclic exchange.
#[derive(Clone, Debug)]
pub struct Exchange {
    /// TPDOs of the nodes.
    pub tpdos: TpdoMap,
    /// RPDOs of the nodes.
    pub rpdos: RpdoImage,
}

/// Resolves both directions. A [`NodeIndex`] is the index in `plans`.
///
/// # Errors
/// When a drive's statusword, position, controlword or target torque is not mapped, or the mappings of a shared
/// frame conflict.
pub fn resolve(plans: &[(Channel, NodePlan)]) -> Result<Exchange, ExchangeError> {
    let (tpdos, rpdos) = (TpdoMap::new(plans), RpdoImage::new(plans)?);
    for (node, (_, plan)) in NodeIndex::each(plans).filter(|(_, (_, plan))| plan.is_drive()) {
        for (object, is_mapped) in [
            (Object::STATUSWORD, tpdos.has_status(node)),
            (Object::POSITION_ACTUAL, tpdos.has_sync_position(node)),
            (Object::CONTROLWORD, rpdos.maps(node, Object::CONTROLWORD)),
            (Object::TARGET_TORQUE, rpdos.maps(node, Object::TARGET_TORQUE)),
        ] {
            if !is_mapped {
                return Err(ExchangeError::NotMapped { name: plan.name.clone(), object });
            }
        }
    }
    Ok(Exchange { tpdos, rpdos })
}
