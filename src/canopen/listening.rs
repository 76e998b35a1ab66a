//! Receive filters of a master, as patterns for the kernel.
//!
//! A master receives its nodes' TPDOs, emergencies, SDO replies and heartbeats. SYNC, NMT commands, RPDOs and
//! SDO requests show another master; emergencies and heartbeats show an unknown node. Other frames may flood
//! the bus without waking the process.

use canopen_rs::nmt::HEARTBEAT_COB_BASE;
use canopen_rs::sdo::{SDO_REQUEST_COB_BASE, SDO_RESPONSE_COB_BASE};

use crate::frame::{COB_ID_MAX, Channel, FUNCTION_CODE};
use crate::plan::NodePlan;
use crate::{nmt, sync};

/// Set of the COB-IDs that equal `cob_id` in the bits of `mask`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Pattern {
    /// Reference COB-ID.
    pub cob_id: u16,
    /// Compared bits, of 11.
    pub mask: u16,
}

impl Pattern {
    /// Matches all COB-IDs.
    pub const ANY: Self = Self { cob_id: 0, mask: 0 };

    /// Matches one COB-ID.
    pub const fn only(cob_id: u16) -> Self {
        Self { cob_id, mask: COB_ID_MAX }
    }

    /// Matches all COB-IDs with the same function code.
    const fn all_like(cob_id: u16) -> Self {
        Self { cob_id, mask: FUNCTION_CODE }
    }

    /// Returns whether the pattern matches `cob_id`.
    pub const fn has(&self, cob_id: u16) -> bool {
        (cob_id ^ self.cob_id) & self.mask == 0
    }
}

/// Receive filters of the master of `plans` on `channel`.
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
