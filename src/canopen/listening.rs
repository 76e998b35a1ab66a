//! What a master must hear of a bus, as patterns that a kernel can filter by.
//!
//! Of its nodes: their TPDOs, emergencies, SDO answers, heartbeats. Of others: SYNC, NMT commands, RPDOs and
//! SDO requests, which are a foreign master's, and emergencies and heartbeats, which are a stranger's.
//! Anything else may flood the bus without waking the node.

use canopen_rs::nmt::HEARTBEAT_COB_BASE;
use canopen_rs::sdo::SDO_REQUEST_COB_BASE;
use canopen_rs::sdo::SDO_RESPONSE_COB_BASE;

use crate::frame::COB_ID_MAX;
use crate::frame::Channel;
use crate::nmt;
use crate::plan::NodePlan;
use crate::sync;

/// The bits of a COB-ID that say what it is for; the others are the node-id.
const FUNCTION: u16 = 0x780;

/// COB-IDs that agree with `cob_id` in the bits of `mask`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Pattern {
    /// What they agree with.
    pub cob_id: u16,
    /// In which bits, of 11.
    pub mask: u16,
}

impl Pattern {
    /// All COB-IDs.
    pub const ANY: Self = Self { cob_id: 0, mask: 0 };

    /// This one alone.
    pub const fn only(cob_id: u16) -> Self {
        Self { cob_id, mask: COB_ID_MAX }
    }

    /// All that are for the same as this one, whosever they are.
    const fn all_like(cob_id: u16) -> Self {
        Self { cob_id, mask: FUNCTION }
    }

    /// Whether this COB-ID is one of them.
    pub const fn has(&self, cob_id: u16) -> bool {
        (cob_id ^ self.cob_id) & self.mask == 0
    }
}

/// What the master of `plans` must hear on `channel`.
pub fn patterns(channel: Channel, plans: &[(Channel, NodePlan)]) -> Vec<Pattern> {
    let mut patterns = vec![
        Pattern::only(nmt::COB_ID),
        // SYNC, and every emergency of the predefined connection set.
        Pattern::all_like(sync::COB_ID),
        Pattern::all_like(HEARTBEAT_COB_BASE),
    ];
    for (_, plan) in plans.iter().filter(|(bus, _)| *bus == channel) {
        let node_id = u16::from(plan.node.raw());
        let sdo = [SDO_REQUEST_COB_BASE, SDO_RESPONSE_COB_BASE].map(|base| base + node_id);
        patterns.extend(sdo.map(Pattern::only));
        patterns.extend(plan.pdos.iter().map(|pdo| Pattern::only(pdo.cob_id)));
        patterns.push(Pattern::only(plan.emcy_cob_id));
    }
    patterns.sort_unstable();
    patterns.dedup();
    patterns
}
