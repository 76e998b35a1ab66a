//! What the node does to whom, and in which order: I6, I8, I9 and I12.

use crate::campaign::monitor::law::Breaches;
use crate::campaign::monitor::law::Law;
use crate::campaign::monitor::sheet::ERROR_CONTROL;
use crate::campaign::monitor::sheet::Member;
use crate::campaign::monitor::sheet::SDO_REPLY;
use crate::campaign::monitor::sheet::SDO_REQUEST;
use crate::campaign::monitor::sheet::Sheet;
use canopen::NmtCommand;
use canopen::drive::State;
use canopen::emcy::Emergency;
use canopen::error_codes;
use canopen::exchange::Told as Heard;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::nmt;
use canopen::nmt::Order as Nmt;
use canopen::object::Object;
use units::numbering::Joint;
use units::numbering::NodeIndex;
use units::time::Instant;

/// Bits 0 to 3 of a controlword: enable operation.
const ENABLE: u16 = 0x000F;

/// What is known of each node.
#[derive(Clone, Debug)]
pub(super) struct Order {
    nodes: Vec<Known>,
}

/// One node, as the bus has shown it.
#[derive(Clone, Debug, Default)]
struct Known {
    /// What it said of vendor, product and revision.
    identity: [Option<u32>; 3],
    /// What was written into it and not read back yet, and the four bytes.
    unread: Vec<(Object, [u8; 4])>,
    /// What its server was asked for last.
    asked: Option<Object>,
    /// It was started by NMT.
    is_started: bool,
    /// The node itself has reset it, so that its next boot-up is no surprise.
    is_reset: bool,
    /// When it booted by itself.
    booted: Option<Instant>,
    /// It has shown that it stops without RPDOs, and without heartbeats.
    proven: [bool; 2],
    state: Option<State>,
    target: i16,
    controlword: u16,
}

impl Known {
    /// Whether it has shown that it stops by every timer it has.
    fn is_proven(&self, member: &Member) -> bool {
        member.watched.iter().zip(self.proven).all(|(must, has)| !must || has)
    }

    /// Why it must not be started, if so.
    fn unready(&self, member: &Member) -> Option<String> {
        let identity = member.identity;
        if self.identity != [identity.vendor, identity.product, identity.revision].map(Some) {
            return Some("before it has said who it is".to_owned());
        }
        let (object, _) = self.unread.first()?;
        Some(format!("before {object} was read back"))
    }
}

impl Order {
    pub(super) fn new(sheet: &Sheet) -> Self {
        Self { nodes: vec![Known::default(); sheet.nodes.len()] }
    }

    /// A frame of the node's.
    pub(super) fn on_sent(
        &mut self,
        sheet: &Sheet,
        at: Instant,
        (channel, frame): (Channel, &Frame),
        breaches: &mut Breaches,
    ) {
        if !sheet.is_own(channel, frame) {
            let what = format!("{frame} is none of the configuration's");
            breaches.add(Law::OwnIdentifiers, at, what);
        } else if frame.cob_id == nmt::COB_ID {
            self.on_nmt(sheet, at, (channel, frame), breaches);
        } else if let Some(node) = sheet.node(channel, frame.cob_id, SDO_REQUEST) {
            self.on_request(sheet, at, (node, frame), breaches);
        }
    }

    /// A frame of somebody else's.
    pub(super) fn on_heard(
        &mut self,
        sheet: &Sheet,
        at: Instant,
        (channel, frame): (Channel, &Frame),
    ) {
        if let Some(node) = sheet.node(channel, frame.cob_id, SDO_REPLY) {
            self.on_reply(node, frame);
        } else if let Some(node) = sheet.crying(channel, frame.cob_id) {
            self.on_emergency(node, frame);
        } else if let Some(node) = sheet.node(channel, frame.cob_id, ERROR_CONTROL)
            && frame.data() == [0]
            && let Some(known) = self.nodes.get_mut(node.0)
        {
            // Who was reset after it had said who it is, is still the same.
            let identity = if known.is_reset { known.identity } else { [None; 3] };
            let booted = known.is_started.then_some(at);
            *known = Known { identity, booted, ..Known::default() };
        }
    }

    /// What a TPDO says of its drive's state.
    pub(super) fn on_tpdo(&mut self, heard: &Heard) {
        if let Some((known, word)) = self.nodes.get_mut(heard.node.0).zip(heard.statusword) {
            known.state = word.state();
        }
    }

    /// Whether a drive has said that it acts on no target.
    pub(super) fn is_off(&self, joint: Joint) -> bool {
        let state = self.nodes.get(joint.index()).and_then(|known| known.state);
        state.is_some_and(|state| state != State::OperationEnabled)
    }

    /// Whether every drive has shown that it stops by itself.
    pub(super) fn are_proven(&self, sheet: &Sheet) -> bool {
        let mut drives = self.nodes.iter().zip(&sheet.nodes).take(6);
        drives.all(|(known, member)| known.is_proven(member))
    }

    /// A drive that cries because its master is silent has shown that it notices.
    fn on_emergency(&mut self, node: NodeIndex, frame: &Frame) {
        let Some((known, emergency)) =
            self.nodes.get_mut(node.0).zip(Emergency::decode(frame.data()))
        else {
            return;
        };
        let codes = [error_codes::RPDO_TIMEOUT, error_codes::MASTER_LOST];
        for (proven, _) in known.proven.iter_mut().zip(codes).filter(|(_, c)| *c == emergency.code)
        {
            *proven = true;
        }
    }

    /// A target. I6: there is none before its drive has shown that it stops by itself.
    pub(super) fn on_target(
        &mut self,
        sheet: &Sheet,
        at: Instant,
        (joint, target): (Joint, i16),
        breaches: &mut Breaches,
    ) {
        let Some((known, member)) =
            self.nodes.get_mut(joint.index()).zip(sheet.nodes.get(joint.index()))
        else {
            return;
        };
        known.target = target;
        let is_on_its_way = known.booted.is_some_and(|booted| at <= booted + sheet.period * 2);
        if target != 0 && !known.is_proven(member) && !is_on_its_way {
            let what = format!("joint {joint} is told {target} per mille, not proven");
            breaches.add(Law::KnownFirst, at, what);
        }
    }

    /// A controlword. I6, and the second step of I12.
    pub(super) fn on_controlword(
        &mut self,
        sheet: &Sheet,
        at: Instant,
        (joint, word): (Joint, u16),
        breaches: &mut Breaches,
    ) {
        let Some(known) = self.nodes.get_mut(joint.index()) else { return };
        let before = std::mem::replace(&mut known.controlword, word);
        // What was on its way when it booted cannot be taken back.
        let is_on_its_way = known.booted.is_some_and(|booted| at <= booted + sheet.period * 2);
        if is_enabling(word) && !known.is_started && !is_on_its_way {
            let what = format!("joint {joint} is enabled before it was started");
            breaches.add(Law::KnownFirst, at, what);
        }
        if is_enabling(before) && !is_enabling(word) && known.target != 0 {
            let what = format!("joint {joint} is disabled at {} per mille", known.target);
            breaches.add(Law::Shutdown, at, what);
        }
    }

    fn on_nmt(
        &mut self,
        sheet: &Sheet,
        at: Instant,
        (channel, frame): (Channel, &Frame),
        breaches: &mut Breaches,
    ) {
        let Some(Nmt { command, node }) = Nmt::decode(frame) else { return };
        for (member, known) in sheet.nodes.iter().zip(&mut self.nodes) {
            if member.channel != channel || node.is_some_and(|node| node != member.node) {
                continue;
            }
            match command {
                NmtCommand::StartRemoteNode => {
                    if let Some(why) = known.unready(member).filter(|_| !known.is_started) {
                        let what = format!("node {} is started {why}", member.node.raw());
                        breaches.add(Law::KnownFirst, at, what);
                    }
                    known.is_started = true;
                }
                NmtCommand::StopRemoteNode
                | NmtCommand::EnterPreOperational
                | NmtCommand::ResetNode
                | NmtCommand::ResetCommunication => {
                    if known.target != 0 || is_enabling(known.controlword) {
                        let what =
                            format!("node {}: {} before it was off", member.node.raw(), frame);
                        breaches.add(Law::Shutdown, at, what);
                    }
                    known.is_started = false;
                    known.is_reset |= is_reset(command);
                }
            }
        }
    }

    /// A request to an SDO server: what is written must be read back, and not while it is enabled.
    fn on_request(
        &mut self,
        sheet: &Sheet,
        at: Instant,
        (node, frame): (NodeIndex, &Frame),
        breaches: &mut Breaches,
    ) {
        let Some((known, member)) = self.nodes.get_mut(node.0).zip(sheet.nodes.get(node.0)) else {
            return;
        };
        let &[command, low, high, sub, a, b, c, d] = frame.data() else { return };
        let object = Object { index: u16::from_le_bytes([low, high]), sub };
        match command & SPECIFIER {
            UPLOAD => known.asked = Some(object),
            DOWNLOAD => {
                let is_enabled = known.state == Some(State::OperationEnabled) && known.is_started;
                if is_enabled && !is_power_off(object, [a, b]) {
                    let what = format!("{object} of node {} is written", member.node.raw());
                    breaches.add(Law::HandsOff, at, what);
                }
                known.unread.retain(|(other, _)| *other != object);
                if !is_order(object) {
                    known.unread.push((object, [a, b, c, d]));
                }
            }
            _ => {}
        }
    }

    fn on_reply(&mut self, node: NodeIndex, frame: &Frame) {
        let Some(known) = self.nodes.get_mut(node.0) else { return };
        let &[command, low, high, sub, a, b, c, d] = frame.data() else { return };
        let object = Object { index: u16::from_le_bytes([low, high]), sub };
        if command & SPECIFIER == ABORT {
            // What was refused does not stand there; whether that may be is the node's to know.
            known.unread.retain(|(other, _)| *other != object);
        }
        if command & SPECIFIER != UPLOAD || known.asked != Some(object) {
            return;
        }
        let value = [a, b, c, d];
        known.unread.retain(|(other, written)| *other != object || !is_taken(*written, value));
        let objects = [Object::VENDOR_ID, Object::PRODUCT_CODE, Object::REVISION];
        for (said, _) in known.identity.iter_mut().zip(objects).filter(|(_, one)| *one == object) {
            *said = Some(u32::from_le_bytes(value));
        }
    }
}

/// The command specifier of an SDO (CiA 301, 7.2.4.3).
const SPECIFIER: u8 = 0b1110_0000;
const DOWNLOAD: u8 = 0b0010_0000;
const ABORT: u8 = 0b1000_0000;
/// Asked for, and answered.
const UPLOAD: u8 = 0b0100_0000;

/// Whether a node has taken what was written. Of a PDO that is switched off the identifier does not matter.
const fn is_taken(written: [u8; 4], read: [u8; 4]) -> bool {
    let is_off = written[3] & read[3] & INVALID != 0;
    is_off || u32::from_le_bytes(written) == u32::from_le_bytes(read)
}

/// Bit 31 of a COB-ID, in its last byte: it does not exist (CiA 301, 7.5.2.35).
const INVALID: u8 = 0x80;

/// All that may be written into a drive that is enabled: a controlword without voltage (CiA 402, bit 1), for
/// one that hears no SYNC any more.
fn is_power_off(object: Object, word: [u8; 2]) -> bool {
    object == Object::CONTROLWORD && u16::from_le_bytes(word) & VOLTAGE == 0
}

/// Bit 1 of a controlword: enable voltage.
const VOLTAGE: u16 = 0x0002;

/// Written to make something happen, not to stand there.
fn is_order(object: Object) -> bool {
    let orders = [
        Object::STORE_PARAMETERS,
        Object::RESTORE_DEFAULTS,
        Object::ERROR_HISTORY,
        Object::CONTROLWORD,
    ];
    orders.iter().any(|order| order.index == object.index)
}

const fn is_enabling(word: u16) -> bool {
    word & ENABLE == ENABLE
}

const fn is_reset(command: NmtCommand) -> bool {
    matches!(command, NmtCommand::ResetNode | NmtCommand::ResetCommunication)
}
