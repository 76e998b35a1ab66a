//! What a node must be and how it must be set, as data, and the steps that get it there.
//!
//! Takes no steps itself: that is [`commission`](crate::canopen::commission). The order is CiA 302-2's
//! boot-up of one node: identity, reset, communication, parameters.

use std::fmt;
use std::time::Duration;

use canopen_rs::NodeId;
use canopen_rs::Value;

use crate::canopen::drive;
use crate::canopen::drive::Controlword;
use crate::canopen::drive::Statusword;
use crate::canopen::emcy;
use crate::canopen::layout;
use crate::canopen::layout::Direction;
use crate::canopen::layout::Pdo;
use crate::canopen::object::Object;
use crate::canopen::sdo::Content;

/// Who a node must say it is (1000h and 1018h).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Vendor-ID, 1018h:1.
    pub vendor: u32,
    /// Product code, 1018h:2.
    pub product: u32,
    /// Revision number, 1018h:3.
    pub revision: u32,
}

/// What a node must be able to do with an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demand {
    /// Take it by SDO.
    Write,
    /// Have it in a TPDO.
    Transmit,
    /// Have it in an RPDO.
    Receive,
    /// Skip as many bits of an RPDO as this data type has.
    Skip,
}

/// As in "cannot be …".
impl fmt::Display for Demand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Write => "written",
            Self::Transmit => "mapped into a TPDO",
            Self::Receive => "mapped into an RPDO",
            Self::Skip => "mapped into an RPDO as a dummy",
        })
    }
}

/// How master and node watch each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watch {
    /// Node-id of the master's heartbeat.
    pub master: NodeId,
    /// A drive without that heartbeat for so long takes this for a fault (1016h:1), in ms.
    pub master_lost_ms: u16,
    /// How often the node sends its own (1017h), in ms.
    pub heartbeat_ms: u16,
    /// A node without a heartbeat for so long is lost, in ms.
    pub node_lost_ms: u16,
}

/// One node: who it is, and everything that is set in it before it is started.
#[derive(Clone, Debug, PartialEq)]
pub struct NodePlan {
    /// What people call it: `joint 3 (elbow)`.
    pub name: String,
    /// Where it is.
    pub node: NodeId,
    /// Number of its device profile, the low word of 1000h: 402 for drives, 401 for inputs.
    pub profile: u16,
    /// Who it is.
    pub identity: Identity,
    /// Every PDO it has, those switched off included.
    pub pdos: Vec<Pdo>,
    /// What makes it stop by itself, and its limits. A device without one of these objects refuses
    /// it by name; take it out where the EDS says so.
    pub safety: Vec<(Object, Value)>,
    /// Mode of operation (6060h), confirmed by the node (6061h).
    pub mode: Option<i8>,
    /// Where its emergencies are: by default 80h + node-id, which outranks every PDO.
    pub emcy_cob_id: u16,
    /// How often it sends its heartbeat (1017h), in ms.
    pub heartbeat_ms: u16,
    /// Without a heartbeat for so long it is lost.
    pub lost_after: Duration,
}

/// Device profile of drives.
const PROFILE_DRIVE: u16 = 402;
/// Device profile of input and output modules.
const PROFILE_INPUTS: u16 = 401;

/// 6007h: a lost connection is a malfunction, so 605Eh is done.
const MALFUNCTION: Value = Value::Integer16(1);
/// 605Ah, 605Bh, 605Ch, 605Eh: the drive function is disabled at once, the motor turns freely.
const DISABLE_DRIVE: Value = Value::Integer16(0);
/// 605Dh: ramp down, stay enabled. The master does not use the halt bit.
const SLOW_DOWN: Value = Value::Integer16(1);

impl NodePlan {
    /// A CiA 402 drive in cyclic synchronous torque mode that stops when the master does, and never
    /// exceeds `max_torque`, in per mille of rated torque (6072h).
    pub fn drive(
        name: String,
        node: NodeId,
        identity: Identity,
        pdos: Vec<Pdo>,
        watch: &Watch,
        max_torque: u16,
    ) -> Self {
        let consumer = u32::from(watch.master.raw()) << 16 | u32::from(watch.master_lost_ms);
        let safety = vec![
            (Object::CONSUMER_HEARTBEAT, Value::Unsigned32(consumer)),
            (Object::ABORT_CONNECTION, MALFUNCTION),
            (Object::QUICK_STOP_OPTION, DISABLE_DRIVE),
            (Object::SHUTDOWN_OPTION, DISABLE_DRIVE),
            (Object::DISABLE_OPERATION_OPTION, DISABLE_DRIVE),
            (Object::HALT_OPTION, SLOW_DOWN),
            (Object::FAULT_REACTION, DISABLE_DRIVE),
            (Object::MAX_TORQUE, Value::Unsigned16(max_torque)),
        ];
        let mode = Some(drive::CYCLIC_SYNCHRONOUS_TORQUE);
        Self { safety, mode, ..Self::device(name, node, PROFILE_DRIVE, identity, pdos, watch) }
    }

    /// The CiA 401 switch box, which moves nothing and so watches nobody.
    pub fn switches(name: String, node: NodeId, identity: Identity, watch: &Watch) -> Self {
        Self::device(name, node, PROFILE_INPUTS, identity, layout::switches(node), watch)
    }

    fn device(
        name: String,
        node: NodeId,
        profile: u16,
        identity: Identity,
        pdos: Vec<Pdo>,
        watch: &Watch,
    ) -> Self {
        Self {
            name,
            node,
            profile,
            identity,
            pdos,
            safety: Vec::new(),
            mode: None,
            emcy_cob_id: emcy::default_cob_id(node),
            heartbeat_ms: watch.heartbeat_ms,
            lost_after: Duration::from_millis(u64::from(watch.node_lost_ms)),
        }
    }

    /// Whether it is a CiA 402 drive.
    pub const fn is_drive(&self) -> bool {
        self.profile == PROFILE_DRIVE
    }

    /// What the node must be able to do with which objects, for all of this to succeed.
    pub fn demands(&self) -> impl Iterator<Item = (Object, Demand)> + '_ {
        let in_use = self.pdos.iter().filter_map(|pdo| Some((pdo, pdo.service.as_ref()?)));
        let mapped = in_use.clone().flat_map(|(pdo, service)| {
            let demand = match pdo.direction {
                Direction::Receive => Demand::Receive,
                Direction::Transmit => Demand::Transmit,
            };
            service.mapping.iter().map(move |mapped| {
                (mapped.object, if mapped.object.is_dummy() { Demand::Skip } else { demand })
            })
        });
        let pdos = in_use.flat_map(|(pdo, _)| pdo.writes()).map(|(object, _)| object);
        let safety = self.safety.iter().map(|(object, _)| *object);
        let mode = self.mode.map(|_| Object::MODE_OF_OPERATION);
        let heartbeat = [Object::PRODUCER_HEARTBEAT];
        let written = pdos.chain(safety).chain(mode).chain(heartbeat);
        mapped.chain(written.map(|object| (object, Demand::Write)))
    }

    /// Everything there is to do before the node is started, in order.
    pub fn steps(&self) -> Vec<Step> {
        let mut steps = self.meeting();
        if self.is_drive() {
            steps.extend(power_off());
        }
        for pdo in &self.pdos {
            let action = if pdo.service.is_some() { Action::Write } else { Action::SwitchOff };
            for (object, value) in pdo.writes() {
                let is_cob_id = object == pdo.communication(1);
                let check = if is_cob_id { cob_id } else { Check::exactly };
                steps.push(Step::Object(action, check(object, value)));
            }
        }
        if self.emcy_cob_id != emcy::default_cob_id(self.node) {
            let valid = u32::from(self.emcy_cob_id);
            for raw in [COB_ID_INVALID | valid, valid] {
                let check = cob_id(Object::EMCY_COB_ID, Value::Unsigned32(raw));
                steps.push(Step::Object(Action::Write, check));
            }
        }
        let heartbeat = (Object::PRODUCER_HEARTBEAT, Value::Unsigned16(self.heartbeat_ms));
        for (object, value) in self.safety.iter().copied().chain([heartbeat]) {
            steps.push(Step::Object(Action::Write, Check::exactly(object, value)));
        }
        if let Some(mode) = self.mode.map(Value::Integer8) {
            let display = Check::exactly(Object::MODE_DISPLAY, mode);
            let mode = Check::exactly(Object::MODE_OF_OPERATION, mode);
            steps.extend([Step::Object(Action::Write, mode), Step::Object(Action::Await, display)]);
        }
        steps
    }

    /// Who is there, and from there to a known beginning.
    fn meeting(&self) -> Vec<Step> {
        let device_type = Check {
            object: Object::DEVICE_TYPE,
            expected: Value::Unsigned32(u32::from(self.profile)),
            mask: 0xFFFF,
        };
        let mut steps = vec![Step::Object(Action::Meet, device_type.clone())];
        for (object, value) in [
            (Object::VENDOR_ID, self.identity.vendor),
            (Object::PRODUCT_CODE, self.identity.product),
            (Object::REVISION, self.identity.revision),
        ] {
            let check = Check::exactly(object, Value::Unsigned32(value));
            steps.push(Step::Object(Action::Compare, check));
        }
        steps.extend([Step::ResetCommunication, Step::Object(Action::Meet, device_type)]);
        steps
    }
}

/// Takes the power off a drive that a former master left enabled, before anything is changed in it.
fn power_off() -> [Step; 2] {
    let off = Value::Unsigned16(Controlword::DISABLE_VOLTAGE.0);
    let disabled = Check {
        object: Object::STATUSWORD,
        expected: Value::Unsigned16(0),
        mask: u64::from(Statusword::OPERATION_ENABLED),
    };
    [
        Step::Object(Action::Write, Check::exactly(Object::CONTROLWORD, off)),
        Step::Object(Action::Await, disabled),
    ]
}

/// Bit 31 of a COB-ID: the service is off.
const COB_ID_INVALID: u32 = 1 << 31;

/// What is compared of a COB-ID: bit 31 while it is off, else everything but bit 30, by which a
/// device says whether it answers remote frames.
fn cob_id(object: Object, expected: Value) -> Check {
    let is_off = matches!(expected, Value::Unsigned32(raw) if raw & COB_ID_INVALID != 0);
    let mask = if is_off { COB_ID_INVALID } else { !(1 << 30) };
    Check { object, expected, mask: u64::from(mask) }
}

/// One thing to do with a node.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Back to the device's own communication parameters, and wait for its boot-up message.
    ResetCommunication,
    /// Bring an object to what it must hold, or see that it is there.
    Object(Action, Check),
}

/// How an object is brought to what it must hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Read until the node answers, and compare: it may be powering up.
    Meet,
    /// Read and compare.
    Compare,
    /// Read until it compares: it may be changing.
    Await,
    /// Write, read back and compare.
    Write,
    /// The same, but what does not exist is off.
    SwitchOff,
}

/// What an object must hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// Which object.
    pub object: Object,
    /// What it must hold; what is written, too.
    pub expected: Value,
    /// The bits that are compared.
    pub mask: u64,
}

impl Check {
    /// Every bit is compared.
    pub const fn exactly(object: Object, expected: Value) -> Self {
        Self { object, expected, mask: u64::MAX }
    }

    /// Whether `content` is of the right size and every compared bit is as expected.
    pub fn accepts(&self, content: &Content) -> bool {
        let expected = bytes(&self.expected);
        content.exactly(expected.len()).is_some_and(|found| {
            let masks = self.mask.to_le_bytes().into_iter().chain(std::iter::repeat(u8::MAX));
            found.iter().zip(&expected).zip(masks).all(|((a, b), mask)| (a ^ b) & mask == 0)
        })
    }

    /// The expected value as people read it: `04020010h`, with `x` for what is not compared.
    pub fn wanted(&self) -> Hex {
        Hex { bytes: bytes(&self.expected), mask: self.mask }
    }

    /// What was found, as people read it, cut to the expected size where its own is not told.
    pub fn found(&self, content: &Content) -> Hex {
        let size = bytes(&self.expected).len();
        let found = content.exactly(size).unwrap_or(content.bytes());
        Hex { bytes: found.to_vec(), mask: u64::MAX }
    }
}

/// A value as SDO carries it, little-endian.
pub fn bytes(value: &Value) -> Vec<u8> {
    let mut bytes = vec![0; value.size()];
    // It fails only for a buffer that is too small, and then writes nothing.
    value.encode_le(&mut bytes).map_or_else(|_| Vec::new(), |_| bytes)
}

/// Bytes of a value as CiA 301 writes numbers, the most significant first and an `h` at the end;
/// `x` for a digit that does not count, and the mask where a part of a digit does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hex {
    bytes: Vec<u8>,
    mask: u64,
}

impl fmt::Display for Hex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.bytes.is_empty() {
            return f.write_str("empty");
        }
        if self.bytes.len() > 8 {
            return write!(f, "{} bytes", self.bytes.len());
        }
        let masks = self.mask.to_le_bytes();
        let digits = || {
            let bytes = self.bytes.iter().zip(masks).rev();
            bytes.flat_map(|(byte, mask)| [(byte >> 4, mask >> 4), (byte & 0xF, mask & 0xF)])
        };
        for (digit, counts) in digits() {
            if counts == 0 { f.write_str("x") } else { write!(f, "{digit:X}") }?;
        }
        f.write_str("h")?;
        if digits().all(|(_, counts)| counts == 0 || counts == 0xF) {
            return Ok(());
        }
        f.write_str(" in the bits ")?;
        digits().try_for_each(|(_, counts)| write!(f, "{counts:X}"))?;
        f.write_str("h")
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) const IDENTITY: Identity =
        Identity { vendor: 0x0F8C, product: 0x0402_0010, revision: 0x0001_0000 };

    pub(crate) fn watch() -> Watch {
        Watch {
            master: NodeId::new(127).unwrap(),
            master_lost_ms: 22,
            heartbeat_ms: 25,
            node_lost_ms: 60,
        }
    }

    /// The elbow of the examples.
    pub(crate) fn elbow() -> NodePlan {
        let node = NodeId::new(3).unwrap();
        let pdos = layout::per_drive(node, Some(5));
        NodePlan::drive("joint 3 (elbow)".into(), node, IDENTITY, pdos, &watch(), 1_000)
    }

    /// The switch box of the examples.
    pub(crate) fn switch_box() -> NodePlan {
        let node = NodeId::new(16).unwrap();
        NodePlan::switches("switch box".into(), node, IDENTITY, &watch())
    }

    /// Where each object is written.
    fn writes(steps: &[Step]) -> Vec<(usize, Object)> {
        let written = |step: &Step| match step {
            Step::Object(Action::Write | Action::SwitchOff, check) => Some(check.object),
            Step::Object(..) | Step::ResetCommunication => None,
        };
        steps.iter().enumerate().filter_map(|(at, step)| Some((at, written(step)?))).collect()
    }

    #[test]
    fn nothing_is_written_before_identity_and_reset() {
        for plan in [elbow(), switch_box()] {
            let steps = plan.steps();
            let reset = steps.iter().position(|step| *step == Step::ResetCommunication).unwrap();
            let revision = Value::Unsigned32(IDENTITY.revision);
            let identity =
                Step::Object(Action::Compare, Check::exactly(Object::REVISION, revision));
            assert!(steps[..reset].contains(&identity));
            assert!(writes(&steps).iter().all(|(at, _)| *at > reset));
        }
    }

    #[test]
    fn a_drive_is_off_before_a_pdo_is_touched_and_its_stops_are_set_before_its_mode() {
        let writes = writes(&elbow().steps());
        let at = |object| writes.iter().find(|(_, written)| *written == object).unwrap().0;
        assert!(at(Object::CONTROLWORD) < at(Object::tpdo_communication(1, 1)));
        assert!(at(Object::rpdo_communication(4, 1)) < at(Object::CONSUMER_HEARTBEAT));
        assert!(at(Object::CONSUMER_HEARTBEAT) < at(Object::MODE_OF_OPERATION));
    }

    #[test]
    fn the_masters_heartbeat_is_watched_as_the_standard_packs_it() {
        let safety = elbow().safety;
        assert!(safety.contains(&(Object::CONSUMER_HEARTBEAT, Value::Unsigned32(0x007F_0016))));
    }

    #[test]
    fn an_emergency_elsewhere_is_moved_while_it_is_off() {
        let moved = |plan: &NodePlan| -> Vec<Value> {
            let of_emcy = |step| match step {
                Step::Object(_, check) if check.object == Object::EMCY_COB_ID => {
                    Some(check.expected)
                }
                Step::Object(..) | Step::ResetCommunication => None,
            };
            plan.steps().into_iter().filter_map(of_emcy).collect()
        };
        let mut plan = elbow();
        assert_eq!(moved(&plan), []);
        plan.emcy_cob_id = 0x683;
        assert_eq!(moved(&plan), [Value::Unsigned32(0x8000_0683), Value::Unsigned32(0x0000_0683)]);
    }

    #[test]
    fn what_is_not_compared_reads_as_x() {
        let check =
            Check { object: Object::DEVICE_TYPE, expected: Value::Unsigned32(402), mask: 0xFFFF };
        assert_eq!(check.wanted().to_string(), "xxxx0192h");
        let check = Check { mask: 0x8000_0000, ..check };
        assert_eq!(check.wanted().to_string(), "0xxxxxxxh in the bits 80000000h");
        let mode = Check::exactly(Object::MODE_DISPLAY, Value::Integer8(-1));
        assert_eq!(mode.wanted().to_string(), "FFh");
    }
}
