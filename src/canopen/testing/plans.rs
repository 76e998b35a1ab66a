//! Node plans of the tests.

use canopen_rs::NodeId;

use crate::guarding::Guarding;
use crate::layout;
use crate::plan::{HeartbeatSettings, Identity, NodePlan};

pub const IDENTITY: Identity =
    Identity { vendor: 0x0F8C, product: 0x0402_0010, revision: 0x0001_0000 };

pub fn heartbeats() -> HeartbeatSettings {
    HeartbeatSettings {
        master: NodeId::new(127).unwrap(),
        master_lost_ms: 22,
        heartbeat_ms: 25,
        node_lost_ms: 60,
    }
}

/// Plan of a drive, named elbow.
pub fn elbow() -> NodePlan {
    let node = NodeId::new(3).unwrap();
    let pdos = layout::per_drive(node, Some(5));
    NodePlan::drive("joint 3 (elbow)".into(), node, IDENTITY, pdos, &heartbeats(), 1_000)
}

/// Plan of a CiA 401 switch box.
pub fn switch_box() -> NodePlan {
    let node = NodeId::new(16).unwrap();
    NodePlan::switches("switch box".into(), node, IDENTITY, None, &heartbeats())
}

/// Plan of the elbow drive with guarding in place of heartbeats.
pub fn guarded_elbow() -> NodePlan {
    elbow().guarded(Guarding { guard_time_ms: 10, life_time_factor: 3 })
}
