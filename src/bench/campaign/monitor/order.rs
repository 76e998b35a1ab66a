//! Order of the node's commands to each device: I6, I8, I9, I12 and I13.

use crate::monitor::drive_timers::Proof;
use crate::monitor::invariant::{Invariant, Moment};
use crate::monitor::sheet::{ERROR_CONTROL, Member, SDO_REPLY, SDO_REQUEST, Sheet};
use canopen::NmtCommand;
use canopen::drive::{Controlword, State};
use canopen::emcy::Emergency;
use canopen::exchange::TpdoSample;
use canopen::frame::{Frame, Telegram};
use canopen::nmt::{self, Order as Nmt};
use canopen::object::Object;
use units::numbering::{Joint, NodeIndex};
use units::time::Instant;

/// State of every node.
#[derive(Clone, Debug)]
pub(super) struct Order {
    nodes: Vec<NodeState>,
}

/// State of one node, as reported by its frames.
#[derive(Clone, Debug, Default)]
struct NodeState {
    /// Reported vendor-ID, product code and revision number (1018h).
    identity: [Option<u32>; 3],
    /// Objects written and not read back, with their four bytes.
    unread: Vec<(Object, [u8; 4])>,
    /// Object of the last upload request.
    requested: Option<Object>,
    /// Started by NMT.
    is_started: bool,
    /// Reset by the master, so that its boot-up message is expected.
    is_reset: bool,
    /// Time of a boot-up message without a reset by the master.
    booted: Option<Instant>,
    proof: Proof,
    state: Option<State>,
    /// Time of the first report that its power stage is off.
    off_since: Option<Instant>,
    target: i16,
    controlword: u16,
}

impl NodeState {
    /// Returns whether the drive has stopped by every timer of its plan.
    const fn is_proven(&self, member: &Member) -> bool {
        self.proof.covers(&member.timers)
    }

    /// Checks a command that switches off a drive which does not follow its RPDO (I13). It violates I13 if the drive has
    /// reported off for more than two periods.
    fn check_last_resort(&self, moment: &mut Moment<'_>, member: &Member, how: &str) {
        let latest = moment.sheet.period * 2;
        let is_known = self.off_since.is_some_and(|since| moment.at.since(since) > latest);
        if self.is_started && is_known {
            let what = format!("node {} is {how}, and has reported off", member.node.raw());
            moment.violates(Invariant::LastResort, what);
        }
    }

    /// Returns the reason why the node must not be started yet.
    fn unready(&self, member: &Member) -> Option<String> {
        let identity = member.identity;
        if self.identity != [identity.vendor, identity.product, identity.revision].map(Some) {
            return Some("before its identity was read".to_owned());
        }
        let (object, _) = self.unread.first()?;
        Some(format!("before {object} was read back"))
    }
}

impl Order {
    pub(super) fn new(sheet: &Sheet) -> Self {
        Self { nodes: vec![NodeState::default(); sheet.nodes.len()] }
    }

    /// Takes a frame of the node.
    pub(super) fn on_sent(&mut self, moment: &mut Moment<'_>, telegram: &Telegram) {
        let sheet = moment.sheet;
        let &Telegram { channel, ref frame } = telegram;
        if !sheet.is_own(channel, frame) {
            let what = format!("{frame} is not configured");
            moment.violates(Invariant::OwnIdentifiers, what);
        } else if frame.cob_id == nmt::COB_ID {
            self.on_nmt(moment, telegram);
        } else if let Some(node) = sheet.guarded(channel, frame) {
            self.nodes.get_mut(node.0).into_iter().for_each(|known| known.proof.on_poll(moment.at));
        } else if let Some(node) = sheet.node(channel, frame.cob_id, SDO_REQUEST) {
            self.on_request(moment, node, frame);
        }
    }

    /// Takes a frame of a device.
    pub(super) fn on_wire(&mut self, sheet: &Sheet, at: Instant, telegram: &Telegram) {
        let &Telegram { channel, ref frame } = telegram;
        if let Some(node) = sheet.node(channel, frame.cob_id, SDO_REPLY) {
            self.on_reply(node, frame);
        } else if let Some(node) = sheet.emergency_producer(channel, frame.cob_id) {
            self.on_emergency(sheet, at, (node, frame));
        } else if let Some(node) = sheet.node(channel, frame.cob_id, ERROR_CONTROL)
            && frame.data() == [0]
            && let Some(known) = self.nodes.get_mut(node.0)
        {
            // A reset by the master does not change the identity.
            let identity = if known.is_reset { known.identity } else { [None; 3] };
            let booted = known.is_started.then_some(at);
            *known = NodeState { identity, booted, ..NodeState::default() };
        }
    }

    /// Takes a TPDO with a statusword.
    pub(super) fn on_tpdo(&mut self, at: Instant, sample: &TpdoSample, is_received: bool) {
        if let Some((known, word)) = self.nodes.get_mut(sample.node.0).zip(sample.statusword) {
            known.state = word.state();
            let is_off = is_received && known.state.is_some_and(is_off);
            known.off_since = is_off.then(|| known.off_since.unwrap_or(at));
        }
    }

    /// Returns the last target of a joint.
    pub(super) fn target(&self, joint: Joint) -> i16 {
        self.nodes.get(joint.index()).map_or(0, |known| known.target)
    }

    /// Returns whether a drive reports a state without torque.
    pub(super) fn is_off(&self, joint: Joint) -> bool {
        let state = self.nodes.get(joint.index()).and_then(|known| known.state);
        state.is_some_and(|state| state != State::OperationEnabled)
    }

    /// Returns whether all drives have passed their proof test and at least one is started, so that targets act.
    pub(super) fn are_driven(&self, sheet: &Sheet) -> bool {
        let mut drives = self.nodes.iter().zip(&sheet.nodes).take(6);
        let is_started = drives.clone().any(|(known, _)| known.is_started);
        is_started && drives.all(|(known, member)| known.is_proven(member))
    }

    fn on_emergency(&mut self, sheet: &Sheet, at: Instant, (node, frame): (NodeIndex, &Frame)) {
        let node = self.nodes.get_mut(node.0).zip(sheet.nodes.get(node.0));
        if let Some(((known, member), emergency)) = node.zip(Emergency::decode(frame.data())) {
            known.proof.on_emergency(&member.timers, at, emergency.code);
        }
    }

    /// Takes a target. I6: no non-zero target before the proof test of its drive.
    pub(super) fn on_target(&mut self, moment: &mut Moment<'_>, joint: Joint, target: i16) {
        let (sheet, at) = (moment.sheet, moment.at);
        let Some((known, member)) =
            self.nodes.get_mut(joint.index()).zip(sheet.nodes.get(joint.index()))
        else {
            return;
        };
        known.target = target;
        let is_on_its_way = known.booted.is_some_and(|booted| at <= booted + sheet.period * 2);
        if target != 0 && !known.is_proven(member) && !is_on_its_way {
            let what = format!("joint {joint}: target {target} per mille, not proven");
            moment.violates(Invariant::KnownFirst, what);
        }
    }

    /// Takes a controlword. I6, and the second step of I12.
    pub(super) fn on_controlword(&mut self, moment: &mut Moment<'_>, joint: Joint, word: u16) {
        let (sheet, at) = (moment.sheet, moment.at);
        let Some(known) = self.nodes.get_mut(joint.index()) else { return };
        let before = std::mem::replace(&mut known.controlword, word);
        // A frame that was queued when the drive booted cannot be recalled.
        let is_on_its_way = known.booted.is_some_and(|booted| at <= booted + sheet.period * 2);
        if is_enabling(word) && !known.is_started && !is_on_its_way {
            let what = format!("joint {joint} is enabled before it was started");
            moment.violates(Invariant::KnownFirst, what);
        }
        if is_enabling(before) && !is_enabling(word) && known.target != 0 {
            let what = format!("joint {joint} is disabled at {} per mille", known.target);
            moment.violates(Invariant::Shutdown, what);
        }
    }

    fn on_nmt(&mut self, moment: &mut Moment<'_>, &Telegram { channel, ref frame }: &Telegram) {
        let Some(Nmt { command, node: addressed }) = Nmt::decode(frame) else { return };
        for (member, known) in moment.sheet.nodes.iter().zip(&mut self.nodes) {
            if member.channel != channel || addressed.is_some_and(|node| node != member.node) {
                continue;
            }
            if command == NmtCommand::StopRemoteNode && addressed.is_some() {
                known.check_last_resort(moment, member, "stopped by NMT");
            }
            match command {
                NmtCommand::StartRemoteNode => {
                    if let Some(why) = known.unready(member).filter(|_| !known.is_started) {
                        let what = format!("node {} is started {why}", member.node.raw());
                        moment.violates(Invariant::KnownFirst, what);
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
                        moment.violates(Invariant::Shutdown, what);
                    }
                    known.is_started = false;
                    known.is_reset |= is_reset(command);
                }
            }
        }
    }

    /// Takes an SDO request. Downloads must be read back, and none go to an enabled drive.
    fn on_request(&mut self, moment: &mut Moment<'_>, node: NodeIndex, frame: &Frame) {
        let member = moment.sheet.nodes.get(node.0);
        let Some((known, member)) = self.nodes.get_mut(node.0).zip(member) else { return };
        let &[command, low, high, sub, a, b, c, d] = frame.data() else { return };
        let object = Object { index: u16::from_le_bytes([low, high]), sub };
        match command & SPECIFIER {
            UPLOAD => known.requested = Some(object),
            DOWNLOAD => {
                let is_enabled = known.state == Some(State::OperationEnabled) && known.is_started;
                if is_enabled && !is_power_off(object, [a, b]) {
                    let what = format!("{object} of node {} is written", member.node.raw());
                    moment.violates(Invariant::HandsOff, what);
                }
                if object == Object::CONTROLWORD {
                    known.check_last_resort(moment, member, "switched off by SDO");
                }
                known.unread.retain(|(other, _)| *other != object);
                if !is_command(object) {
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
            // An aborted download changed nothing.
            known.unread.retain(|(other, _)| *other != object);
        }
        if command & SPECIFIER != UPLOAD || known.requested != Some(object) {
            return;
        }
        let value = [a, b, c, d];
        known.unread.retain(|(other, written)| *other != object || !is_taken(*written, value));
        let objects = [Object::VENDOR_ID, Object::PRODUCT_CODE, Object::REVISION];
        for (value_read, _) in
            known.identity.iter_mut().zip(objects).filter(|(_, one)| *one == object)
        {
            *value_read = Some(u32::from_le_bytes(value));
        }
    }
}

/// Command specifier of an SDO (CiA 301, 7.2.4.3).
const SPECIFIER: u8 = 0b1110_0000;
const DOWNLOAD: u8 = 0b0010_0000;
const ABORT: u8 = 0b1000_0000;
/// Upload: request and response.
const UPLOAD: u8 = 0b0100_0000;

/// Returns whether the value read is the one written. The COB-ID of an invalid PDO is ignored.
const fn is_taken(written: [u8; 4], read: [u8; 4]) -> bool {
    let is_off = written[3] & read[3] & INVALID != 0;
    is_off || u32::from_le_bytes(written) == u32::from_le_bytes(read)
}

/// Bit 31 of a COB-ID, in its last byte: invalid (CiA 301, 7.5.2.35).
const INVALID: u8 = 0x80;

/// Returns whether a download to an enabled drive is allowed: a controlword with voltage disabled (bit 1, CiA 402), for a
/// drive that receives no SYNC.
fn is_power_off(object: Object, word: [u8; 2]) -> bool {
    object == Object::CONTROLWORD && u16::from_le_bytes(word) & VOLTAGE == 0
}

/// Returns whether a drive in this state has no voltage on its motor (CiA 402-2, 6.1).
pub(crate) const fn is_off(state: State) -> bool {
    match state {
        State::NotReadyToSwitchOn
        | State::SwitchOnDisabled
        | State::ReadyToSwitchOn
        | State::Fault => true,
        State::SwitchedOn
        | State::OperationEnabled
        | State::QuickStopActive
        | State::FaultReactionActive => false,
    }
}

/// Bit 1 of a controlword: enable voltage.
const VOLTAGE: u16 = 0x0002;

/// Returns whether an object is a command, whose value is not stored.
fn is_command(object: Object) -> bool {
    let orders = [
        Object::STORE_PARAMETERS,
        Object::RESTORE_DEFAULTS,
        Object::ERROR_HISTORY,
        Object::CONTROLWORD,
    ];
    orders.iter().any(|order| order.index == object.index)
}

const fn is_enabling(word: u16) -> bool {
    Controlword(word).enables()
}

const fn is_reset(command: NmtCommand) -> bool {
    matches!(command, NmtCommand::ResetNode | NmtCommand::ResetCommunication)
}
