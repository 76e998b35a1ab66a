//! Scan of a bus: reads the identity of every node and listens. Writes nothing.
//!
//! Several nodes are polled in parallel, a few frames each, so an empty bus is recognised soon. A node that replies
//! about its device type exists; its other objects are read one by one, and absent ones stay open.
//!
//! A second reply or a second boot-up indicates two nodes with one node-id, unless another master reads the same
//! object, or a node reboots. Identical simultaneous replies merge, so not every pair is detected.

use std::collections::VecDeque;
use std::time::Duration;

use canopen_rs::nmt::{decode_heartbeat, heartbeat_cob_id};
use canopen_rs::sdo::response_cob_id;
use canopen_rs::{NmtState, NodeId};

use crate::procedure::Procedure;
use crate::value::visible;
use canopen::emcy::{self, Emergency};
use canopen::frame::Frame;
use canopen::object::Object;
use canopen::sdo::{Content, Outcome, SdoError, Transfer};
use canopen_device::lss::Address;
use units::time::Instant;

/// Nodes polled in parallel: their requests fit any transmit queue; 127 absent nodes take seven rounds.
const MAX_PARALLEL: usize = 20;

/// Objects to read, in this order; a timeout of the first means that the node is absent.
const OBJECTS: [Object; 8] = [
    Object::DEVICE_TYPE,
    Object::VENDOR_ID,
    Object::PRODUCT_CODE,
    Object::REVISION,
    Object::SERIAL,
    Object::DEVICE_NAME,
    Object::HARDWARE_VERSION,
    Object::SOFTWARE_VERSION,
];

/// Toggle bit of an answer to node guarding.
const TOGGLE: u8 = 0x80;

/// Properties of one node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeReport {
    pub node: NodeId,
    /// Set if the node replied; otherwise it only sent unrequested frames.
    pub answers: bool,
    /// NMT state in its heartbeat.
    pub state: Option<NmtState>,
    /// 1000h; the low word is the device profile.
    pub device_type: Option<u32>,
    /// 1018h:1
    pub vendor: Option<u32>,
    /// 1018h:2
    pub product: Option<u32>,
    /// 1018h:3
    pub revision: Option<u32>,
    /// 1018h:4
    pub serial: Option<u32>,
    /// 1008h
    pub name: Option<String>,
    /// 1009h
    pub hardware: Option<String>,
    /// 100Ah
    pub software: Option<String>,
    /// Last emergency received.
    pub emergency: Option<Emergency>,
    /// Number of boot-ups received.
    pub boot_ups: u32,
    /// Set if one request got two replies.
    pub is_answered_twice: bool,
}

impl NodeReport {
    const fn new(node: NodeId) -> Self {
        Self {
            node,
            answers: false,
            state: None,
            device_type: None,
            vendor: None,
            product: None,
            revision: None,
            serial: None,
            name: None,
            hardware: None,
            software: None,
            emergency: None,
            boot_ups: 0,
            is_answered_twice: false,
        }
    }

    /// Returns a node that only reports its NMT state.
    pub const fn with_state(node: NodeId, state: NmtState) -> Self {
        let mut found = Self::new(node);
        found.state = Some(state);
        found
    }

    /// LSS address, if all four numbers are known.
    pub fn address(&self) -> Option<Address> {
        let (vendor, product) = (self.vendor?, self.product?);
        Some(Address { vendor, product, revision: self.revision?, serial: self.serial? })
    }

    /// Returns whether the node exists.
    pub const fn is_there(&self) -> bool {
        self.answers || self.state.is_some() || self.emergency.is_some()
    }

    /// Returns whether two nodes seem to share its node-id.
    pub const fn is_duplicate(&self) -> bool {
        self.is_answered_twice || self.boot_ups > 1
    }

    /// Stores the content of one of [`OBJECTS`]; numbers without four bytes count as unread.
    fn record(&mut self, object: Object, content: &Content) {
        let number = || content.exactly(4).and_then(|bytes| bytes.try_into().ok());
        let number = || number().map(u32::from_le_bytes);
        let text = || Some(visible(content.bytes()));
        match object {
            Object::DEVICE_TYPE => self.device_type = number(),
            Object::VENDOR_ID => self.vendor = number(),
            Object::PRODUCT_CODE => self.product = number(),
            Object::REVISION => self.revision = number(),
            Object::SERIAL => self.serial = number(),
            Object::DEVICE_NAME => self.name = text(),
            Object::HARDWARE_VERSION => self.hardware = text(),
            Object::SOFTWARE_VERSION => self.software = text(),
            _ => {}
        }
    }

    /// Takes a heartbeat, an answer to the guarding of another master, or an emergency.
    fn on_frame(&mut self, frame: &Frame) {
        if frame.cob_id == heartbeat_cob_id(self.node) {
            let &[byte] = frame.data() else { return };
            let Ok(state) = decode_heartbeat(&[byte & !TOGGLE]) else { return };
            self.boot_ups += u32::from(state == NmtState::Initialising);
            let booted = state == NmtState::Initialising;
            self.state = Some(if booted { NmtState::PreOperational } else { state });
        } else if frame.cob_id == emcy::default_cob_id(self.node) {
            self.emergency = Emergency::decode(frame.data()).or(self.emergency);
        }
    }
}

/// Node that is polled, or sends unrequested frames.
#[derive(Clone, Debug)]
struct Node {
    found: NodeReport,
    /// Index of the current object in [`OBJECTS`].
    next: usize,
    transfer: Option<Transfer>,
    /// Object replied last.
    answered: Option<Object>,
}

/// Scan in progress.
#[derive(Clone, Debug)]
pub struct Scan {
    timeout: Duration,
    waiting: VecDeque<NodeId>,
    /// Polled nodes in their order, among those that are not polled.
    nodes: Vec<Node>,
    /// Minimum end of listening, even if all replies arrive sooner.
    listens_until: Instant,
    is_over: bool,
}

impl Scan {
    /// Polls `nodes` with `timeout` per reply, and listens at least for `listen`.
    pub fn start(
        nodes: &[NodeId],
        timeout: Duration,
        listen: Duration,
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Self {
        let mut scan = Self {
            timeout,
            waiting: nodes.iter().copied().collect(),
            nodes: Vec::with_capacity(nodes.len()),
            listens_until: now + listen,
            is_over: false,
        };
        scan.poll_more(now, out);
        scan
    }

    /// Polls further nodes in free slots.
    fn poll_more(&mut self, now: Instant, out: &mut Vec<Frame>) {
        let busy = self.nodes.iter().filter(|node| node.transfer.is_some()).count();
        for id in self.waiting.drain(..self.waiting.len().min(MAX_PARALLEL.saturating_sub(busy))) {
            let known = self.nodes.iter().position(|node| node.found.node == id);
            let mut node = known.map_or(Node::new(id), |place| self.nodes.remove(place));
            node.request(self.timeout, now, out);
            self.nodes.push(node);
        }
    }

    /// Takes a heartbeat or emergency of any node.
    fn listen(&mut self, frame: &Frame) {
        let Some(id) = sender(frame) else { return };
        if let Some(node) = self.nodes.iter_mut().find(|node| node.found.node == id) {
            node.found.on_frame(frame);
        } else {
            let mut node = Node::new(id);
            node.found.on_frame(frame);
            self.nodes.push(node);
        }
    }

    fn outcome(&mut self, now: Instant) -> Option<Vec<NodeReport>> {
        let is_busy = self.nodes.iter().any(|node| node.transfer.is_some());
        if self.is_over || is_busy || !self.waiting.is_empty() || now < self.listens_until {
            return None;
        }
        self.is_over = true;
        let all = self.nodes.drain(..).map(|node| node.found);
        let mut found: Vec<NodeReport> = all.filter(NodeReport::is_there).collect();
        found.sort_by_key(|found| found.node);
        Some(found)
    }
}

impl Node {
    const fn new(node: NodeId) -> Self {
        Self { found: NodeReport::new(node), next: 0, transfer: None, answered: None }
    }

    /// Sends the next request, if there is one.
    fn request(&mut self, timeout: Duration, now: Instant, out: &mut Vec<Frame>) {
        let read = |object: &Object| Transfer::read(self.found.node, *object, timeout, now, out);
        self.transfer = OBJECTS.get(self.next).map(read);
    }

    /// Records the outcome of a request and sends the next.
    fn conclude(
        &mut self,
        outcome: Outcome,
        timeout: Duration,
        now: Instant,
        out: &mut Vec<Frame>,
    ) {
        let object = OBJECTS.get(self.next).copied();
        self.transfer = None;
        self.next += 1;
        match outcome {
            // No reply: no further requests.
            Err(SdoError::Timeout) => return,
            Err(SdoError::AbortedByServer(_) | SdoError::AbortedLocally(_)) => {}
            Ok(content) => {
                if let Some(object) = object {
                    self.found.record(object, &content);
                }
            }
        }
        self.found.answers = true;
        self.answered = object;
        self.request(timeout, now, out);
    }

    /// Returns whether a reply concerns the object replied last.
    fn is_repeated(&self, frame: &Frame) -> bool {
        let &[command, low, high, sub, ..] = frame.data() else { return false };
        let about = Object { index: u16::from_le_bytes([low, high]), sub };
        let is_reply = matches!(command >> 5, UPLOAD_RESPONSE | ABORT);
        is_reply && self.answered == Some(about)
    }
}

/// Server command specifiers of replies to a read: the three highest bits.
const UPLOAD_RESPONSE: u8 = 2;
const ABORT: u8 = 4;

impl Procedure for Scan {
    /// Existing nodes, by node-id.
    type Outcome = Vec<NodeReport>;

    fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Vec<NodeReport>> {
        let is_reply = |node: &&mut Node| frame.cob_id == response_cob_id(node.found.node);
        if let Some(node) = self.nodes.iter_mut().find(is_reply) {
            node.found.is_answered_twice |= node.is_repeated(frame);
            let transfer = node.transfer.as_mut();
            if let Some(outcome) = transfer.and_then(|transfer| transfer.on_frame(now, frame, out))
            {
                node.conclude(outcome, self.timeout, now, out);
            }
        } else {
            self.listen(frame);
        }
        self.poll_more(now, out);
        self.outcome(now)
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Vec<NodeReport>> {
        for node in &mut self.nodes {
            let transfer = node.transfer.as_mut();
            if let Some(outcome) = transfer.and_then(|transfer| transfer.on_time(now, out)) {
                node.conclude(outcome, self.timeout, now, out);
            }
        }
        self.poll_more(now, out);
        self.outcome(now)
    }

    fn deadline(&self) -> Option<Instant> {
        let transfers = self.nodes.iter().filter_map(|node| node.transfer.as_ref());
        let soonest = transfers.filter_map(Transfer::deadline).min();
        (!self.is_over).then_some(soonest.unwrap_or(self.listens_until))
    }

    fn abandon(&mut self, now: Instant, out: &mut Vec<Frame>) {
        for transfer in self.nodes.iter_mut().filter_map(|node| node.transfer.as_mut()) {
            transfer.abandon(now, out);
        }
    }
}

/// Returns the node of a heartbeat or emergency, by the predefined connection set.
fn sender(frame: &Frame) -> Option<NodeId> {
    let [_, low] = frame.cob_id.to_be_bytes();
    let node = NodeId::new(low & 0x7F).ok()?;
    let is_of_node = [heartbeat_cob_id(node), emcy::default_cob_id(node)].contains(&frame.cob_id);
    is_of_node.then_some(node)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TIMEOUT: Duration = Duration::from_millis(100);
    const LISTEN: Duration = Duration::from_millis(200);

    fn nodes(raw: impl IntoIterator<Item = u8>) -> Vec<NodeId> {
        raw.into_iter().map(|raw| NodeId::new(raw).unwrap()).collect()
    }

    /// Runs a scan to its end; `answer` replies to each request. Also returns its end, and the maximum number of
    /// frames sent at once.
    fn scan(
        nodes: &[NodeId],
        mut answer: impl FnMut(&Frame) -> Vec<Frame>,
    ) -> (Vec<NodeReport>, Instant, usize) {
        let (mut now, mut out, mut most) = (Instant::ZERO, Vec::new(), 0);
        let mut scan = Scan::start(nodes, TIMEOUT, LISTEN, now, &mut out);
        loop {
            let requests: Vec<Frame> = std::mem::take(&mut out);
            most = most.max(requests.len());
            for reply in requests.iter().flat_map(&mut answer) {
                if let Some(found) = scan.on_frame(now, &reply, &mut out) {
                    return (found, now, most);
                }
            }
            if out.is_empty() {
                now = now.max(scan.deadline().unwrap());
                if let Some(found) = scan.on_time(now, &mut out) {
                    return (found, now, most);
                }
            }
        }
    }

    /// Node with this serial number and without names.
    fn device(cob_id: u16, serial: u8, frame: &Frame) -> Option<Frame> {
        let &[0x40, low, high, sub, ..] = frame.data() else { return None };
        if frame.cob_id != cob_id {
            return None;
        }
        let about = [low, high, sub];
        let reply = match (u16::from_le_bytes([low, high]), sub) {
            (0x1000, 0) => [0x43, low, high, sub, 0x92, 1, 2, 0],
            (0x1018, 4) => [0x43, low, high, sub, serial, 0, 0, 0],
            (0x1018, _) => [0x43, low, high, sub, 1, 0, 0, 0],
            _ => [0x80, about[0], about[1], about[2], 0, 0, 2, 6],
        };
        Some(Frame::new(cob_id - 0x80, reply))
    }

    #[test]
    fn empty_bus_is_recognised_within_a_second() {
        let (found, end, most) = scan(&nodes(1..=127), |_| Vec::new());
        assert_eq!(found, []);
        assert!(end <= Instant::from_micros(800_000), "{end:?}");
        assert!(most <= 2 * MAX_PARALLEL, "{most}: new requests, and aborts of the old");
    }

    #[test]
    fn identities_are_read_without_writes() {
        let answer = |frame: &Frame| {
            assert!(matches!(frame.data(), [0x40 | 0x80, ..]), "neither read nor abort: {frame}");
            device(0x603, 7, frame).into_iter().collect()
        };
        let (found, _, _) = scan(&nodes(1..=20), answer);
        let expected = NodeReport {
            answers: true,
            device_type: Some(0x0002_0192),
            vendor: Some(1),
            product: Some(1),
            revision: Some(1),
            serial: Some(7),
            ..NodeReport::new(NodeId::new(3).unwrap())
        };
        assert_eq!(found, [expected]);
    }

    #[test]
    fn node_that_only_sends_is_found() {
        let (mut now, mut out) = (Instant::ZERO, Vec::new());
        let mut scan = Scan::start(&nodes([3]), TIMEOUT, LISTEN, now, &mut out);
        for frame in [
            Frame::new(0x705, [5]),
            Frame::new(0x703, [0]),
            Frame::new(0x083, [0x10, 0x23, 3, 0, 0, 0, 0, 0]),
            Frame::new(0x080, []),
            Frame::new(0x706, [5, 5]),
            Frame::new(0x707, [0x85]),
        ] {
            assert_eq!(scan.on_frame(now, &frame, &mut out), None);
        }
        let found = loop {
            now = scan.deadline().unwrap();
            if let Some(found) = scan.on_time(now, &mut out) {
                break found;
            }
        };
        assert_eq!(now, Instant::ZERO + LISTEN);
        let summary =
            |found: &NodeReport| (found.node.raw(), found.answers, found.state, found.boot_ups);
        let (three, five) = (summary(&found[0]), summary(&found[1]));
        assert_eq!(three, (3, false, Some(NmtState::PreOperational), 1));
        assert_eq!(five, (5, false, Some(NmtState::Operational), 0));
        assert_eq!(found[0].emergency.unwrap().code, 0x2310);
        assert_eq!(found[2].state, Some(NmtState::Operational), "another master guards it");
        assert_eq!(found.len(), 3);
    }

    #[test]
    fn two_nodes_with_one_node_id_are_detected() {
        let pair = |frame: &Frame| {
            [7, 8].into_iter().filter_map(|serial| device(0x603, serial, frame)).collect()
        };
        assert!(scan(&nodes(1..=5), pair).0[0].is_duplicate());
        let alone = |frame: &Frame| device(0x603, 7, frame).into_iter().collect();
        assert!(!scan(&nodes(1..=5), alone).0[0].is_duplicate());
        let twice = |frame: &Frame| match frame.cob_id {
            0x601 => vec![Frame::new(0x709, [0]); 2],
            _ => Vec::new(),
        };
        let found = scan(&nodes([1]), twice).0;
        assert!(found[0].is_duplicate() && !found[0].answers);
    }

    proptest! {
        #[test]
        fn any_frames_end_in_time_without_writes(
            frames in proptest::collection::vec(
                (
                    0_u64..20_000,
                    prop::sample::select(vec![0x581_u16, 0x582, 0x701, 0x081, 0x082, 0x783]),
                    prop::sample::select(vec![0x43_u8, 0x41, 0x00, 0x01, 0x10, 0x11, 0x80, 5]),
                    0..OBJECTS.len(),
                    any::<[u8; 4]>(),
                    1_usize..9,
                ),
                0..200,
            ),
        ) {
            let (mut now, mut out) = (Instant::ZERO, Vec::new());
            let mut scan = Scan::start(&nodes([1, 2]), TIMEOUT, LISTEN, now, &mut out);
            let mut outcome = None;
            for (step, cob_id, command, place, [a, b, c, d], length) in frames {
                now = now + Duration::from_micros(step);
                outcome = scan.on_time(now, &mut out);
                if outcome.is_some() {
                    break;
                }
                let Object { index, sub } = OBJECTS[place];
                let [low, high] = index.to_le_bytes();
                let bytes = [command, low, high, sub, a, b, c, d];
                let frame = Frame::from_slice(cob_id, &bytes[..length]).unwrap();
                outcome = scan.on_frame(now, &frame, &mut out);
                if outcome.is_some() {
                    break;
                }
            }
            let latest = now + TIMEOUT * 2 + LISTEN;
            while outcome.is_none() {
                now = scan.deadline().unwrap().max(now);
                prop_assert!(now <= latest);
                outcome = scan.on_time(now, &mut out);
            }
            let is_reading = |frame: &Frame| matches!(frame.data()[0], 0x40 | 0x60 | 0x70 | 0x80);
            prop_assert!(out.iter().all(is_reading));
            prop_assert_eq!(scan.deadline(), None);
        }
    }
}
