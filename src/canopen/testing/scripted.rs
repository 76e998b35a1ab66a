//! Scripted node for tests: a few objects, correct replies, and the faults a test configures. It holds bytes
//! without a meaning.

use std::collections::HashMap;

use canopen_rs::{NmtCommand, NodeId};

use crate::abort::AbortCode;
use crate::frame::Frame;
use crate::master::steps::{Configuration, Stage, Step};
use crate::nmt::Order;
use crate::object::Object;
use crate::plan::NodePlan;
use crate::sdo::bytes;

/// Steps of a node without a stored configuration.
pub(crate) fn first_boot(plan: &NodePlan) -> Vec<Step> {
    let configuration = Configuration::Downloaded;
    [
        Stage::Probe,
        Stage::CheckPowerOff,
        Stage::CheckIdentity,
        Stage::Reset,
        Stage::Download,
        Stage::CommandMode(configuration),
    ]
    .into_iter()
    .flat_map(|stage| stage.steps(plan))
    .collect()
}

/// Node with scripted replies and faults.
#[derive(Debug)]
pub struct ScriptedDevice {
    pub node: NodeId,
    pub objects: HashMap<Object, Vec<u8>>,
    /// Objects whose write is aborted, with the code.
    pub refuses: HashMap<Object, AbortCode>,
    /// Objects whose write is confirmed without effect.
    pub forgets: Vec<Object>,
    /// Objects whose COB-ID is accepted only with bit 30.
    pub has_no_rtr: Vec<Object>,
    /// Objects whose upload is aborted with a general error.
    pub hides: Vec<Object>,
    /// Uploads of these objects that are left unanswered once.
    pub loses: Vec<Object>,
    /// Downloads to these objects that take effect and are left unanswered once.
    pub loses_confirmations: Vec<Object>,
    /// Set if the mode (6060h) is refused before the node is operational.
    pub takes_mode_late: bool,
    /// Requests left unanswered before the first reply.
    pub deaf_for: u32,
    /// Set if a reset is followed by a boot-up message.
    pub boots: bool,
    /// Set if the node starts itself after a reset (1F80h).
    pub starts_itself: bool,
    /// Toggle bit of the next answer to guarding.
    pub toggle: u8,
    /// NMT state in the heartbeat.
    pub state: u8,
    /// Written objects, in order.
    pub written: Vec<Object>,
}

impl ScriptedDevice {
    /// Returns a node that satisfies `plan` before its first configuration.
    pub fn suiting(plan: &NodePlan) -> Self {
        let mut objects = HashMap::new();
        for step in first_boot(plan) {
            let Step::Object(action, check) = step else { continue };
            let holds = bytes(&check.expected);
            objects.insert(
                check.object,
                if action.writes() { vec![0xEE; holds.len()] } else { holds },
            );
        }
        Self {
            node: plan.node,
            objects,
            refuses: HashMap::new(),
            forgets: Vec::new(),
            has_no_rtr: Vec::new(),
            hides: Vec::new(),
            loses: Vec::new(),
            loses_confirmations: Vec::new(),
            takes_mode_late: false,
            deaf_for: 0,
            boots: true,
            starts_itself: false,
            toggle: 0,
            state: 0x7F,
            written: Vec::new(),
        }
    }

    /// Returns a node that has stored the configuration of `plan`.
    pub fn holding(plan: &NodePlan) -> Self {
        let mut device = Self::suiting(plan);
        for (object, value) in plan.writes() {
            device.objects.insert(object, bytes(&value));
        }
        device.objects.extend(stamp(plan));
        device
    }

    /// Returns the reply to one frame.
    pub fn answer(&mut self, frame: &Frame) -> Option<Frame> {
        if frame.is_remote() {
            return self.answer_guard(frame);
        }
        let is_for_us = |order: &Order| order.node.is_none_or(|node| node == self.node);
        if let Some(order) = Order::decode(frame).filter(is_for_us) {
            match order.command {
                NmtCommand::StartRemoteNode => self.state = 0x05,
                NmtCommand::StopRemoteNode => self.state = 0x04,
                NmtCommand::EnterPreOperational => self.state = 0x7F,
                NmtCommand::ResetNode | NmtCommand::ResetCommunication => {
                    self.state = if self.starts_itself { 0x05 } else { 0x7F };
                    self.toggle = 0;
                    return self.boots.then(|| self.heartbeat(0));
                }
            }
            return None;
        }
        if frame.cob_id != 0x600 + u16::from(self.node.raw()) || self.state == 0x04 {
            return None;
        }
        let request: [u8; 8] = frame.data().try_into().ok()?;
        if request[0] == 0x80 {
            return None;
        }
        if self.deaf_for > 0 {
            self.deaf_for -= 1;
            return None;
        }
        let object =
            Object { index: u16::from_le_bytes([request[1], request[2]]), sub: request[3] };
        if let Some(lost) = self.loses.iter().position(|it| *it == object && request[0] == 0x40) {
            self.loses.remove(lost);
            return None;
        }
        let reply = self.serve(request);
        let lost = self.loses_confirmations.iter().position(|it| *it == object && reply[0] == 0x60);
        if let Some(lost) = lost {
            self.loses_confirmations.remove(lost);
            return None;
        }
        Some(Frame::new(0x580 + u16::from(self.node.raw()), reply))
    }

    /// Answers a guarding request: NMT state and toggle bit.
    fn answer_guard(&mut self, frame: &Frame) -> Option<Frame> {
        let is_asked = frame.cob_id == 0x700 + u16::from(self.node.raw()) && self.deaf_for == 0;
        let answer = is_asked.then(|| self.heartbeat(self.toggle | self.state));
        self.toggle ^= if is_asked { 0x80 } else { 0 };
        answer
    }

    /// Error control frame of this node: `byte` is its NMT state, with the toggle bit where it is guarded.
    pub fn heartbeat(&self, byte: u8) -> Frame {
        Frame::new(0x700 + u16::from(self.node.raw()), [byte])
    }

    fn serve(&mut self, [command, low, high, sub, value @ ..]: [u8; 8]) -> [u8; 8] {
        let object = Object { index: u16::from_le_bytes([low, high]), sub };
        let Some(holds) = self.objects.get_mut(&object) else {
            return abort(object, AbortCode::NO_OBJECT);
        };
        if command == 0x40 && self.hides.contains(&object) {
            return abort(object, AbortCode::GENERAL_ERROR);
        }
        if command == 0x40 {
            let mut reply =
                [0x43 | (4 - u8::try_from(holds.len()).unwrap()) << 2, low, high, sub, 0, 0, 0, 0];
            reply[4..4 + holds.len()].copy_from_slice(holds);
            return reply;
        }
        if let Some(code) = self.refuses.get(&object) {
            return abort(object, *code);
        }
        if self.takes_mode_late && object == Object::MODE_OF_OPERATION && self.state != 0x05 {
            return abort(object, AbortCode::DEVICE_STATE);
        }
        if self.has_no_rtr.contains(&object) && value[3] & 0x40 == 0 {
            return abort(object, AbortCode::VALUE_INVALID);
        }
        self.written.push(object);
        if !self.forgets.contains(&object) {
            *holds = value[..4 - usize::from(command >> 2 & 3)].to_vec();
        }
        [0x60, low, high, sub, 0, 0, 0, 0]
    }
}

/// Content of 1020h after `plan`.
pub fn stamp(plan: &NodePlan) -> [(Object, Vec<u8>); 2] {
    let stamp = plan.stamp();
    [(Object::CONFIGURATION_DATE, stamp.date), (Object::CONFIGURATION_TIME, stamp.time)]
        .map(|(object, part)| (object, part.to_le_bytes().to_vec()))
}

fn abort(object: Object, code: AbortCode) -> [u8; 8] {
    let [low, high] = object.index.to_le_bytes();
    let [a, b, c, d] = code.0.to_le_bytes();
    [0x80, low, high, object.sub, a, b, c, d]
}
