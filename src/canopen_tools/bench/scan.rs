//! Who is on the bus: asks every node who it is, and listens meanwhile. Never writes anything.
//!
//! Several nodes are asked at once, a few frames each, so that an empty bus is known to be empty soon. A
//! node that answers its device type is there; the rest is read from it one object after another, and
//! what it does not have is left open.
//!
//! A second answer to one question, or a second boot-up, says that two nodes share a node-id, unless
//! another master reads the same object just now, or a node boots again and again. Answers that are the
//! same, bit for bit and at once, are one on the wire: not every such pair can be seen.

use std::collections::VecDeque;
use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::NodeId;
use canopen_rs::nmt::decode_heartbeat;
use canopen_rs::nmt::heartbeat_cob_id;
use canopen_rs::sdo::response_cob_id;

use canopen::emcy;
use canopen::emcy::Emergency;
use canopen::frame::Frame;
use canopen::lss::Address;
use canopen::object::Object;
use canopen::procedure::Procedure;
use canopen::sdo::Content;
use canopen::sdo::SdoError;
use canopen::sdo::Transfer;
use canopen::value::visible;
use units::time::Instant;

/// Nodes asked at once: their requests fit into any transmit queue, and 127 silent ones take seven turns.
const AT_ONCE: usize = 20;

/// What is read, in this order; silence at the first means that nobody is there.
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

/// What was found out about one node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Where it is.
    pub node: NodeId,
    /// Whether it answered a question; if not, it was only heard.
    pub answers: bool,
    /// Its NMT state, if it was heard.
    pub state: Option<NmtState>,
    /// 1000h: the device profile in the low word.
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
    /// The last emergency that was heard.
    pub emergency: Option<Emergency>,
    /// Boot-ups that were heard.
    pub boot_ups: u32,
    /// A question was answered twice.
    pub is_answered_twice: bool,
}

impl Found {
    const fn nothing(node: NodeId) -> Self {
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

    /// All four numbers of its identity, if it has told them.
    pub fn address(&self) -> Option<Address> {
        let (vendor, product) = (self.vendor?, self.product?);
        Some(Address { vendor, product, revision: self.revision?, serial: self.serial? })
    }

    /// Whether anything tells that it is there.
    pub const fn is_there(&self) -> bool {
        self.answers || self.state.is_some() || self.emergency.is_some()
    }

    /// Whether two nodes seem to share its node-id.
    pub const fn is_double(&self) -> bool {
        self.is_answered_twice || self.boot_ups > 1
    }

    /// Takes what an object holds.
    fn learn(&mut self, object: Object, content: &Content) {
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

    /// Listens.
    fn hear(&mut self, frame: &Frame) {
        if frame.cob_id == heartbeat_cob_id(self.node) {
            let state = frame.data().try_into().ok().and_then(|data| decode_heartbeat(data).ok());
            let Some(state) = state else { return };
            self.boot_ups += u32::from(state == NmtState::Initialising);
            let booted = state == NmtState::Initialising;
            self.state = Some(if booted { NmtState::PreOperational } else { state });
        } else if frame.cob_id == emcy::default_cob_id(self.node) {
            self.emergency = Emergency::decode(frame.data()).or(self.emergency);
        }
    }
}

/// One node that is asked, or was.
#[derive(Clone, Debug)]
struct Asked {
    found: Found,
    /// What is asked now; the place in [`OBJECTS`].
    question: usize,
    transfer: Option<Transfer>,
    /// What was answered last.
    answered: Option<Object>,
}

/// A scan under way.
#[derive(Clone, Debug)]
pub struct Scan {
    timeout: Duration,
    waiting: VecDeque<NodeId>,
    asked: Vec<Asked>,
    /// Nodes that were heard and are not to be asked.
    heard: Vec<Found>,
    /// Listened to until then, however soon all is answered.
    listens_until: Instant,
    is_over: bool,
}

impl Scan {
    /// Asks `nodes`, each question having `timeout` for its answer, and listens at least for `listen`.
    pub fn begin(
        nodes: &[NodeId],
        timeout: Duration,
        listen: Duration,
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Self {
        let mut scan = Self {
            timeout,
            waiting: nodes.iter().copied().collect(),
            asked: Vec::with_capacity(nodes.len()),
            heard: Vec::new(),
            listens_until: now + listen,
            is_over: false,
        };
        scan.ask_more(now, out);
        scan
    }

    /// Fills up the places that have become free.
    fn ask_more(&mut self, now: Instant, out: &mut Vec<Frame>) {
        let busy = self.asked.iter().filter(|asked| asked.transfer.is_some()).count();
        for node in self.waiting.drain(..self.waiting.len().min(AT_ONCE.saturating_sub(busy))) {
            let known = self.heard.iter().position(|found| found.node == node);
            let found = known.map_or(Found::nothing(node), |place| self.heard.swap_remove(place));
            let mut asked = Asked { found, question: 0, transfer: None, answered: None };
            asked.ask(self.timeout, now, out);
            self.asked.push(asked);
        }
    }

    /// The node a heartbeat or an emergency is of, asked already or not.
    fn listen(&mut self, frame: &Frame) {
        let Some(node) = speaker(frame) else { return };
        if let Some(asked) = self.asked.iter_mut().find(|asked| asked.found.node == node) {
            asked.found.hear(frame);
        } else if let Some(found) = self.heard.iter_mut().find(|found| found.node == node) {
            found.hear(frame);
        } else {
            let mut found = Found::nothing(node);
            found.hear(frame);
            self.heard.push(found);
        }
    }

    fn outcome(&mut self, now: Instant) -> Option<Vec<Found>> {
        let is_busy = self.asked.iter().any(|asked| asked.transfer.is_some());
        if self.is_over || is_busy || !self.waiting.is_empty() || now < self.listens_until {
            return None;
        }
        self.is_over = true;
        let asked = self.asked.drain(..).map(|asked| asked.found);
        let all = asked.chain(self.heard.drain(..));
        let mut there: Vec<Found> = all.filter(Found::is_there).collect();
        there.sort_by_key(|found| found.node);
        Some(there)
    }
}

impl Asked {
    /// Asks the next question, if there is one.
    fn ask(&mut self, timeout: Duration, now: Instant, out: &mut Vec<Frame>) {
        let read = |object: &Object| Transfer::read(self.found.node, *object, timeout, now, out);
        self.transfer = OBJECTS.get(self.question).map(read);
    }

    /// Takes what a question has come to, and asks the next.
    fn conclude(
        &mut self,
        outcome: Result<Content, SdoError>,
        timeout: Duration,
        now: Instant,
        out: &mut Vec<Frame>,
    ) {
        let object = OBJECTS.get(self.question).copied();
        self.transfer = None;
        self.question += 1;
        match outcome {
            // Nobody, or somebody who has left: nothing more is asked.
            Err(SdoError::Timeout) => return,
            Err(SdoError::AbortedByServer(_) | SdoError::AbortedLocally(_)) => {}
            Ok(content) => {
                if let Some(object) = object {
                    self.found.learn(object, &content);
                }
            }
        }
        self.found.answers = true;
        self.answered = object;
        self.ask(timeout, now, out);
    }

    /// Whether an answer is about what has been answered already.
    fn is_repeated(&self, frame: &Frame) -> bool {
        let &[command, low, high, sub, ..] = frame.data() else { return false };
        let about = Object { index: u16::from_le_bytes([low, high]), sub };
        let is_answer = matches!(command >> 5, UPLOAD_RESPONSE | ABORT);
        is_answer && self.answered == Some(about)
    }
}

/// Server command specifiers, in the three highest bits: what begins the answer to a read.
const UPLOAD_RESPONSE: u8 = 2;
const ABORT: u8 = 4;

impl Procedure for Scan {
    /// The nodes that are there, by node-id.
    type Outcome = Vec<Found>;

    fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<Vec<Found>> {
        let timeout = self.timeout;
        let is_answer = |asked: &&mut Asked| frame.cob_id == response_cob_id(asked.found.node);
        if let Some(asked) = self.asked.iter_mut().find(is_answer) {
            asked.found.is_answered_twice |= asked.is_repeated(frame);
            let transfer = asked.transfer.as_mut();
            if let Some(outcome) = transfer.and_then(|transfer| transfer.on_frame(now, frame, out))
            {
                asked.conclude(outcome, timeout, now, out);
            }
        } else {
            self.listen(frame);
        }
        self.ask_more(now, out);
        self.outcome(now)
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<Vec<Found>> {
        for asked in &mut self.asked {
            let transfer = asked.transfer.as_mut();
            if let Some(outcome) = transfer.and_then(|transfer| transfer.on_time(now, out)) {
                asked.conclude(outcome, self.timeout, now, out);
            }
        }
        self.ask_more(now, out);
        self.outcome(now)
    }

    fn deadline(&self) -> Option<Instant> {
        let transfers = self.asked.iter().filter_map(|asked| asked.transfer.as_ref());
        let soonest = transfers.filter_map(Transfer::deadline).min();
        (!self.is_over).then_some(soonest.unwrap_or(self.listens_until))
    }

    fn abandon(&mut self, now: Instant, out: &mut Vec<Frame>) {
        for transfer in self.asked.iter_mut().filter_map(|asked| asked.transfer.as_mut()) {
            transfer.abandon(now, out);
        }
    }
}

/// Whose heartbeat or emergency a frame is, by the predefined connection set.
fn speaker(frame: &Frame) -> Option<NodeId> {
    let [_, low] = frame.cob_id.to_be_bytes();
    let node = NodeId::new(low & 0x7F).ok()?;
    let is_heard = [heartbeat_cob_id(node), emcy::default_cob_id(node)].contains(&frame.cob_id);
    is_heard.then_some(node)
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

    /// Carries a scan to its end: `answer` is shown what is asked. Also when it ended, and the most
    /// frames it had for the bus at once.
    fn scan(
        nodes: &[NodeId],
        mut answer: impl FnMut(&Frame) -> Vec<Frame>,
    ) -> (Vec<Found>, Instant, usize) {
        let (mut now, mut out, mut most) = (Instant::ZERO, Vec::new(), 0);
        let mut scan = Scan::begin(nodes, TIMEOUT, LISTEN, now, &mut out);
        loop {
            let asked: Vec<Frame> = std::mem::take(&mut out);
            most = most.max(asked.len());
            for reply in asked.iter().flat_map(&mut answer) {
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

    /// A node of this serial number, which has no names.
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
    fn an_empty_bus_is_known_to_be_empty_within_a_second() {
        let (found, end, most) = scan(&nodes(1..=127), |_| Vec::new());
        assert_eq!(found, []);
        assert!(end <= Instant::from_micros(800_000), "{end:?}");
        assert!(most <= 2 * AT_ONCE, "{most}: new requests, and aborts of the old");
    }

    #[test]
    fn nodes_tell_who_they_are_and_nothing_is_written() {
        let answer = |frame: &Frame| {
            assert!(matches!(frame.data(), [0x40 | 0x80, ..]), "neither read nor abort: {frame}");
            device(0x603, 7, frame).into_iter().collect()
        };
        let (found, _, _) = scan(&nodes(1..=20), answer);
        let expected = Found {
            answers: true,
            device_type: Some(0x0002_0192),
            vendor: Some(1),
            product: Some(1),
            revision: Some(1),
            serial: Some(7),
            ..Found::nothing(NodeId::new(3).unwrap())
        };
        assert_eq!(found, [expected]);
    }

    #[test]
    fn a_node_that_is_only_heard_is_there() {
        let (mut now, mut out) = (Instant::ZERO, Vec::new());
        let mut scan = Scan::begin(&nodes([3]), TIMEOUT, LISTEN, now, &mut out);
        for frame in [
            Frame::new(0x705, [5]),
            Frame::new(0x703, [0]),
            Frame::new(0x083, [0x10, 0x23, 3, 0, 0, 0, 0, 0]),
            Frame::new(0x080, []),
            Frame::new(0x706, [5, 5]),
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
        let told = |found: &Found| (found.node.raw(), found.answers, found.state, found.boot_ups);
        let (three, five) = (told(&found[0]), told(&found[1]));
        assert_eq!(three, (3, false, Some(NmtState::PreOperational), 1));
        assert_eq!(five, (5, false, Some(NmtState::Operational), 0));
        assert_eq!(found[0].emergency.unwrap().code, 0x2310);
        assert_eq!(found.len(), 2);
    }

    #[test]
    fn two_nodes_of_one_node_id_are_told() {
        let pair = |frame: &Frame| {
            [7, 8].into_iter().filter_map(|serial| device(0x603, serial, frame)).collect()
        };
        assert!(scan(&nodes(1..=5), pair).0[0].is_double());
        let alone = |frame: &Frame| device(0x603, 7, frame).into_iter().collect();
        assert!(!scan(&nodes(1..=5), alone).0[0].is_double());
        let twice = |frame: &Frame| match frame.cob_id {
            0x601 => vec![Frame::new(0x709, [0]); 2],
            _ => Vec::new(),
        };
        let found = scan(&nodes([1]), twice).0;
        assert!(found[0].is_double() && !found[0].answers);
    }

    proptest! {
        #[test]
        fn any_frames_at_any_time_end_in_bounds_and_nothing_is_written(
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
            let mut scan = Scan::begin(&nodes([1, 2]), TIMEOUT, LISTEN, now, &mut out);
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
