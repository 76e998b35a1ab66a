//! Cyclic exchange between master and nodes: positions of the mapped objects in the PDOs.
//!
//! The positions are computed once from the [layouts](crate::layout) of the nodes. A cycle only shifts and masks. It does
//! not allocate or search a dictionary.
//!
//! ```text
//!             per-drive                                grouped
//!  TPDO1   { statusword, position, torque }         { position }                      every SYNC
//!  TPDO2                                            { statusword }                    on change
//!  TPDO2   { torque demand }, without RPDO timer                                      every 10th SYNC
//!  TPDO3                                            { torque }                        every 100th SYNC
//!  RPDO1   { controlword, target }                  { target a, target b, target c }  every SYNC
//!  RPDO2                                            { controlword }                   on change
//! ```
//!
//! The RPDO of a group is one frame for three drives. Each maps its own target, and dummy entries (CiA 301, 7.4.8) in
//! place of the others. The content of the frame is the union of the mappings.

mod rpdos;
mod slot;
mod tpdos;

pub use rpdos::RpdoImage;
pub use tpdos::{TpdoMap, TpdoSample};

use std::time::Duration;

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

impl Exchange {
    /// Maximum time until a drive's statusword reports "disable voltage", from the SYNC after which its RPDO carries it.
    /// Without lost frames it is 2 T for one synchronous PDO in each direction.
    ///
    /// For a controlword in a separate RPDO, adds (2 n + 1) T: a bus sends its n such RPDOs in every other cycle. For
    /// a statusword in a separate TPDO, adds the inhibit time.
    pub fn power_off_time(&self, node: NodeIndex, period: Duration) -> Duration {
        let turns = self.rpdos.controlword_turns(node);
        let wait = if turns > 0 { 2 * turns + 1 } else { 0 };
        period * (2 + wait) + self.tpdos.status_inhibit(node)
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NodeId;
    use crate::layout::{self, Group};
    use crate::testing::plans::elbow;

    const MS: Duration = Duration::from_millis(1);

    fn power_off_time(count: u8, period: Duration, is_grouped: bool) -> Duration {
        let nodes: Vec<NodeId> = (1..=count).map(|raw| NodeId::new(raw).unwrap()).collect();
        let plan = |(node, group): (&NodeId, &Group)| {
            let pdos = match is_grouped {
                true => layout::grouped(*node, 0, *group, Some(5)),
                false => layout::per_drive(*node, None),
            };
            (Channel(0), NodePlan { node: *node, pdos, ..elbow() })
        };
        let plans: Vec<_> = nodes.iter().zip(&Group::threes(&nodes)).map(plan).collect();
        resolve(&plans).unwrap().power_off_time(NodeIndex(2), period)
    }

    #[test]
    fn hazard_46_statusword_follows_in_2_cycles_or_25_ms() {
        assert_eq!(power_off_time(6, MS * 2, false), MS * 4, "two cycles");
        assert_eq!(power_off_time(6, MS, true), MS * 25);
        assert_eq!(power_off_time(3, MS, true), MS * 19);
    }
}
