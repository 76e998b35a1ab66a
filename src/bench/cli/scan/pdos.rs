//! `frhc scan --pdos`: the effective PDO configuration of nodes.

use std::time::Duration;

use crate::live_bus::{Session, SessionError};
use bus::Bus;
use canopen::NodeId;
use canopen::layout::{Direction, Pdo};
use canopen_tools::diagnostics::effective::{Reader, Unreadable};

/// PDOs of one node, or the reason why they could not be read.
pub(super) type Pdos = (NodeId, Result<Vec<Pdo>, Unreadable>);

/// Reads the PDOs of `nodes`, one after the other.
///
/// # Errors
/// Returns an error if the bus fails, or the command is interrupted.
pub(super) fn read<B: Bus>(
    session: &mut Session<B>,
    nodes: impl Iterator<Item = NodeId>,
    timeout: Duration,
) -> Result<Vec<Pdos>, SessionError> {
    nodes.map(|node| Ok((node, session.run(|_, _| Reader::new(node, timeout))?))).collect()
}

/// Formats a PDO as `node 3 RPDO1 201h every SYNC, timer 5 ms: 6071h/16 0003h/16 0003h/16`: the mapped objects with
/// their lengths in bits.
pub(super) fn line(node: NodeId, pdo: &Pdo) -> String {
    let kind = name(pdo);
    let Some(service) = &pdo.service else {
        return format!("node {:>3} {kind:<6} off", node.raw());
    };
    let inhibit = service.inhibit_100us.filter(|inhibit| *inhibit > 0);
    let inhibit = inhibit.map(|t| format!(", inhibit {} ms", f64::from(t) / 10.0));
    let timer = service.event_timer_ms.filter(|timer| *timer > 0);
    let timer = timer.map(|t| format!(", timer {t} ms"));
    let mapped: String =
        service.mapping.iter().map(|one| format!(" {}/{}", one.object, one.bits)).collect();
    format!(
        "node {:>3} {kind:<6} {:03X}h {}{}{}:{mapped}",
        node.raw(),
        pdo.cob_id,
        service.transmission,
        inhibit.unwrap_or_default(),
        timer.unwrap_or_default(),
    )
}

/// Returns a PDO as JSON.
pub(super) fn json(pdo: &Pdo) -> serde_json::Value {
    let service = pdo.service.as_ref().map(|service| {
        let mapped = service
            .mapping
            .iter()
            .map(|one| serde_json::json!({ "object": one.object.to_string(), "bits": one.bits }));
        serde_json::json!({
            "transmission": service.transmission.0,
            "inhibit_100us": service.inhibit_100us,
            "event_timer_ms": service.event_timer_ms,
            "mapping": mapped.collect::<Vec<_>>(),
        })
    });
    let cob_id = service.as_ref().map(|_| pdo.cob_id);
    serde_json::json!({ "pdo": name(pdo), "cob_id": cob_id, "service": service })
}

fn name(pdo: &Pdo) -> String {
    let kind = match pdo.direction {
        Direction::Receive => "RPDO",
        Direction::Transmit => "TPDO",
    };
    format!("{kind}{}", pdo.number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::layout::{self, Group};

    #[test]
    fn pdo_is_formatted_as_one_line() {
        let node = NodeId::new(3).unwrap();
        let group = Group { cob_id: 0x201, size: 3, slot: 2 };
        let lines: Vec<_> =
            layout::grouped(node, 2, group, Some(5)).iter().map(|pdo| line(node, pdo)).collect();
        assert_eq!(lines[0], "node   3 TPDO1  183h every SYNC: 6064h/32");
        assert_eq!(lines[1], "node   3 TPDO2  283h on event, inhibit 10 ms, timer 50 ms: 6041h/16");
        assert_eq!(lines[3], "node   3 TPDO4  off");
        assert_eq!(
            lines[4],
            "node   3 RPDO1  201h every SYNC, timer 5 ms: 0003h/16 0003h/16 6071h/16"
        );
    }
}
