//! Effective PDOs of a node, read by SDO: its actual configuration, independent of EDS and plan.
//!
//! Writes nothing. Returns every existing PDO, disabled ones included.

use std::time::Duration;

use canopen_rs::pdo::PDO_COB_ID_INVALID;
use canopen_rs::{MappingEntry, NodeId};
use thiserror::Error;

use crate::procedure::Procedure;
use canopen::abort::AbortCode;
use canopen::frame::{COB_ID_MAX, Frame};
use canopen::layout::{Direction, MAX_PDOS, MappedObject, Pdo, Service};
use canopen::object::Object;
use canopen::sdo::{Outcome, SdoError, Transfer};
use canopen::sync::TransmissionType;
use units::time::Instant;

/// Maximum gap in the numbers of PDOs; further ones are not found.
const MAX_GAP: u16 = 8;

/// Maximum number of objects in a PDO: one per bit.
const MAX_OBJECTS: u8 = 64;

/// Error of a node whose PDOs cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("node {}: {object}: {error}", node.raw())]
pub struct Unreadable {
    pub node: NodeId,
    pub object: Object,
    /// Abort or timeout of the read.
    pub error: SdoError,
}

/// Reader of one node's PDOs.
#[derive(Clone, Debug)]
pub struct Reader {
    node: NodeId,
    timeout: Duration,
    transfer: Option<Transfer>,
    query: Query,
    /// Current PDO.
    pdo: Pdo,
    /// Consecutive numbers without a PDO.
    gap: u16,
    found: Vec<Pdo>,
}

/// Object being read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Query {
    CobId,
    TransmissionType,
    InhibitTime,
    EventTimer,
    Count,
    Entry { sub: u8, count: u8 },
    Nothing,
}

impl Reader {
    /// Returns a reader that starts with the first call of [`on_time`](Procedure::on_time); `timeout` applies to each
    /// reply.
    pub const fn new(node: NodeId, timeout: Duration) -> Self {
        Self {
            node,
            timeout,
            transfer: None,
            query: Query::CobId,
            pdo: blank(Direction::Receive, 1),
            gap: 0,
            found: Vec::new(),
        }
    }

    fn object(&self) -> Object {
        match self.query {
            Query::CobId | Query::Nothing => self.pdo.communication(1),
            Query::TransmissionType => self.pdo.communication(2),
            Query::InhibitTime => self.pdo.communication(3),
            Query::EventTimer => self.pdo.communication(5),
            Query::Count => self.pdo.mapping(0),
            Query::Entry { sub, .. } => self.pdo.mapping(sub),
        }
    }

    fn request(&mut self, now: Instant, out: &mut Vec<Frame>) {
        let is_over = self.query == Query::Nothing;
        let object = Some(self.object()).filter(|_| !is_over);
        self.transfer =
            object.map(|object| Transfer::read(self.node, object, self.timeout, now, out));
    }

    fn on_outcome(
        &mut self,
        now: Instant,
        outcome: Outcome,
        out: &mut Vec<Frame>,
    ) -> Option<Result<Vec<Pdo>, Unreadable>> {
        match outcome {
            Ok(content) => self.query = self.learn(number(content.bytes())),
            Err(SdoError::AbortedByServer(AbortCode::NO_OBJECT | AbortCode::NO_SUB_INDEX)) => {
                self.query = self.learn_absent();
            }
            Err(error) => {
                let (node, object) = (self.node, self.object());
                self.query = Query::Nothing;
                self.transfer = None;
                return Some(Err(Unreadable { node, object, error }));
            }
        }
        self.request(now, out);
        (self.query == Query::Nothing).then(|| Ok(std::mem::take(&mut self.found)))
    }

    /// Records the value read; returns the next query.
    fn learn(&mut self, number: u32) -> Query {
        let [lowest, second, ..] = number.to_le_bytes();
        let pair = u16::from_le_bytes([lowest, second]);
        match self.query {
            Query::CobId => {
                self.gap = 0;
                self.pdo.cob_id = pair & COB_ID_MAX;
                if number & PDO_COB_ID_INVALID != 0 {
                    return self.next_pdo();
                }
                self.pdo.service = Some(unknown_service());
                return Query::TransmissionType;
            }
            Query::TransmissionType => self.service(|s| s.transmission = TransmissionType(lowest)),
            Query::InhibitTime => self.service(|s| s.inhibit_100us = Some(pair)),
            Query::EventTimer => self.service(|s| s.event_timer_ms = Some(pair)),
            Query::Count => {
                return self.entry(1, lowest.min(MAX_OBJECTS));
            }
            Query::Entry { sub, count } => {
                let MappingEntry { address, bit_length, .. } = MappingEntry::from_u32(number);
                let object = Object { index: address.index, sub: address.subindex };
                self.service(|s| s.mapping.push(MappedObject { object, bits: bit_length }));
                return self.entry(sub.saturating_add(1), count);
            }
            Query::Nothing => {}
        }
        self.next_question()
    }

    /// Records an absent object; returns the next query.
    fn learn_absent(&mut self) -> Query {
        match self.query {
            Query::CobId => {
                self.gap += 1;
                self.pdo.cob_id = 0;
                self.skip_pdo()
            }
            // An enabled PDO without a mapping parameter has an unknown, fixed mapping.
            Query::Count | Query::Entry { .. } => self.next_pdo(),
            Query::TransmissionType | Query::InhibitTime | Query::EventTimer | Query::Nothing => {
                self.next_question()
            }
        }
    }

    const fn next_question(&self) -> Query {
        match self.query {
            Query::TransmissionType => Query::InhibitTime,
            Query::InhibitTime => Query::EventTimer,
            Query::EventTimer => Query::Count,
            Query::CobId | Query::Count | Query::Entry { .. } | Query::Nothing => Query::Nothing,
        }
    }

    fn entry(&mut self, sub: u8, count: u8) -> Query {
        if sub <= count { Query::Entry { sub, count } } else { self.next_pdo() }
    }

    /// Completes the current PDO.
    fn next_pdo(&mut self) -> Query {
        let blank = blank(self.pdo.direction, self.pdo.number);
        self.found.push(std::mem::replace(&mut self.pdo, blank));
        self.skip_pdo()
    }

    fn skip_pdo(&mut self) -> Query {
        let Pdo { direction, number, .. } = self.pdo;
        let is_last = number == MAX_PDOS || self.gap > MAX_GAP;
        self.pdo = match (direction, is_last) {
            (_, false) => blank(direction, number + 1),
            (Direction::Receive, true) => blank(Direction::Transmit, 1),
            (Direction::Transmit, true) => return Query::Nothing,
        };
        if is_last {
            self.gap = 0;
        }
        Query::CobId
    }

    fn service(&mut self, learn: impl FnOnce(&mut Service)) {
        if let Some(service) = &mut self.pdo.service {
            learn(service);
        }
    }
}

impl Procedure for Reader {
    type Outcome = Result<Vec<Pdo>, Unreadable>;

    fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Self::Outcome> {
        let outcome = self.transfer.as_mut()?.on_frame(now, frame, out)?;
        self.on_outcome(now, outcome, out)
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Self::Outcome> {
        match &mut self.transfer {
            None => {
                self.request(now, out);
                None
            }
            Some(transfer) => {
                let outcome = transfer.on_time(now, out)?;
                self.on_outcome(now, outcome, out)
            }
        }
    }

    fn deadline(&self) -> Option<Instant> {
        match &self.transfer {
            Some(transfer) => transfer.deadline(),
            None => (self.query != Query::Nothing).then_some(Instant::ZERO),
        }
    }

    /// Aborts the transfer at the node.
    fn abandon(&mut self, now: Instant, out: &mut Vec<Frame>) {
        if let Some(transfer) = &mut self.transfer {
            transfer.abandon(now, out);
        }
    }
}

const fn blank(direction: Direction, number: u16) -> Pdo {
    Pdo { direction, number, cob_id: 0, has_no_rtr: false, service: None }
}

const fn unknown_service() -> Service {
    Service {
        transmission: TransmissionType::EVENT_OF_PROFILE,
        inhibit_100us: None,
        event_timer_ms: None,
        mapping: Vec::new(),
    }
}

/// Lowest 32 bits of a value, little-endian.
fn number(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use canopen::layout::{self, Group};
    use canopen::plan::NodePlan;
    use canopen::sdo::bytes;
    use canopen::testing::plans::elbow;
    use canopen::testing::scripted::ScriptedDevice;

    const TIMEOUT: Duration = Duration::from_millis(50);

    fn node() -> NodeId {
        NodeId::new(3).unwrap()
    }

    fn configured(plan: &NodePlan) -> ScriptedDevice {
        let mut device = ScriptedDevice::suiting(plan);
        for (object, value) in plan.pdos.iter().flat_map(Pdo::writes) {
            device.objects.insert(object, bytes(&value));
        }
        device
    }

    fn read(device: &mut ScriptedDevice) -> Result<Vec<Pdo>, Unreadable> {
        let (mut reader, mut queue) = (Reader::new(node(), TIMEOUT), Vec::new());
        loop {
            let now = reader.deadline().expect("a reader without an outcome has a deadline");
            let mut outcome = reader.on_time(now, &mut queue);
            while !queue.is_empty() {
                let request = queue.remove(0);
                if let Some(answer) = device.answer(&request) {
                    outcome = outcome.or(reader.on_frame(now, &answer, &mut queue));
                }
            }
            if let Some(outcome) = outcome {
                assert_eq!(reader.deadline(), None);
                return outcome;
            }
        }
    }

    /// PDOs of the plan in reading order, with the values a device always has.
    fn expected(plan: &NodePlan) -> Vec<Pdo> {
        let mut pdos = plan.pdos.clone();
        pdos.sort_by_key(|pdo| (pdo.direction == Direction::Transmit, pdo.number));
        pdos
    }

    #[test]
    fn configured_pdos_are_read_back() {
        let group = Group { cob_id: 0x201, size: 3, slot: 2 };
        for pdos in [
            layout::per_drive(node(), Some(5)),
            layout::grouped(node(), 2, group, Some(5)),
            layout::grouped(node(), 2, group, None),
        ] {
            let plan = NodePlan { pdos, ..elbow() };
            assert_eq!(read(&mut configured(&plan)).unwrap(), expected(&plan));
        }
    }

    #[test]
    fn gap_in_the_numbers_is_crossed() {
        let mut plan = elbow();
        let far = Pdo { number: 9, cob_id: 0x3A5, ..plan.pdos[0].clone() };
        plan.pdos.push(far);
        assert_eq!(read(&mut configured(&plan)).unwrap(), expected(&plan));
    }

    #[test]
    fn timeout_names_node_and_object() {
        let mut device = ScriptedDevice { deaf_for: u32::MAX, ..configured(&elbow()) };
        let message = "node 3: 1400h:1: no answer";
        assert_eq!(read(&mut device).unwrap_err().to_string(), message);
    }

    proptest! {
        #[test]
        fn any_replies_lead_to_an_end(answers in proptest::collection::vec(any::<[u8; 8]>(), 0..300)) {
            let (mut reader, mut out) = (Reader::new(node(), TIMEOUT), Vec::new());
            let (mut now, mut outcomes) = (Instant::ZERO, 0);
            for mut payload in answers {
                outcomes += u32::from(reader.on_time(now, &mut out).is_some());
                if let Some(request) = out.pop() {
                    payload[..4].copy_from_slice(&[0x43, request.data()[1], request.data()[2], request.data()[3]]);
                }
                let frame = Frame::new(0x583, payload);
                outcomes += u32::from(reader.on_frame(now, &frame, &mut out).is_some());
            }
            while let Some(due) = reader.deadline() {
                now = now.max(due);
                outcomes += u32::from(reader.on_time(now, &mut out).is_some());
            }
            prop_assert_eq!(outcomes, 1);
        }
    }
}
