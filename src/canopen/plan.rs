//! What a node must be and how it must be set, as data.
//!
//! Takes no steps itself: which steps there are, and in which order, is in
//! [`steps`](crate::master::steps); taking them is [`commission`](crate::master::commission).

use std::fmt;
use std::time::Duration;

use canopen_rs::ByteString;
use canopen_rs::NodeId;
use canopen_rs::Value;

use crate::drive;
use crate::emcy;
use crate::guarding::Guarding;
use crate::layout;
use crate::layout::Direction;
use crate::layout::Pdo;
use crate::master::check::COB_ID_INVALID;
use crate::master::check::Check;
use crate::master::configuration::Stamp;
use crate::object::Object;

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

/// What more a node must say to be taken. Nothing, unless it is asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Admission {
    /// Which revisions are taken.
    pub revisions: Revisions,
    /// Serial number, 1018h:4: this very device and no spare one.
    pub serial: Option<u32>,
    /// Manufacturer software version, 100Ah.
    pub software: Option<ByteString>,
    /// Program software identification, 1F56h:1.
    pub program: Option<u32>,
}

/// Which revisions of a device are taken (1018h:3: major revision in the high word, minor in the low).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Revisions {
    /// The planned one alone.
    #[default]
    Exact,
    /// The planned one, and later minor ones of the same major one, which behave the same and may do
    /// more (CiA 301, 7.5.2.19).
    Compatible,
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

/// How the master sees that a node is alive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorControl {
    /// The node says so by itself.
    Heartbeat {
        /// How often (1017h), in ms.
        period_ms: u16,
        /// Without one for so long it is lost.
        lost_after: Duration,
    },
    /// The master asks.
    Guarding(Guarding),
}

impl ErrorControl {
    /// How often the node says that it is alive, in ms; 0 for never.
    pub const fn period_ms(self) -> u16 {
        match self {
            Self::Heartbeat { period_ms, .. } => period_ms,
            Self::Guarding(guarding) => guarding.guard_time_ms,
        }
    }

    /// Without a word for so long it is lost.
    pub fn lost_after(self) -> Duration {
        match self {
            Self::Heartbeat { lost_after, .. } => lost_after,
            Self::Guarding(guarding) => guarding.life_time(),
        }
    }
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
    /// What more it must say.
    pub admission: Admission,
    /// Whether the others are started without it. It may be missing; it may not be another one.
    pub is_optional: bool,
    /// Whether it may go on, without a reset, where it is found operational and set exactly as planned.
    /// Not for what can push: a drive begins anew.
    pub keep_alive: bool,
    /// Whether it gets its maker's defaults back first (1011h:1), by a reset of the whole node.
    pub restores_defaults: bool,
    /// Whether what is set in it is stored (1010h:1) with its [stamp](Stamp), so that the next boot
    /// need not set it again.
    pub stores_configuration: bool,
    /// Every PDO it has, those switched off included.
    pub pdos: Vec<Pdo>,
    /// What it does after an error of communication (1029h:1), if it has the choice: 0 leaves
    /// operational for pre-operational, 1 changes nothing, 2 stops. `None` leaves it alone.
    pub error_behaviour: Option<u8>,
    /// What makes it stop by itself, and its limits. A device without one of these objects refuses
    /// it by name, unless it [need not have](OPTIONAL) it.
    pub safety: Vec<(Object, Value)>,
    /// Mode of operation (6060h), confirmed by the node (6061h): commanded at every boot, not stored.
    pub mode: Option<i8>,
    /// Where its emergencies are: by default 80h + node-id, which outranks every PDO.
    pub emcy_cob_id: u16,
    /// How it is watched.
    pub error_control: ErrorControl,
    /// A drive found with its power on must come to rest, once it is off: how far (6064h) one at rest
    /// turns in 100 ms at most, in counts. `None` for what does not move, or is not waited for.
    pub rest: Option<u32>,
}

/// Device profile of drives.
const PROFILE_DRIVE: u16 = 402;
/// Device profile of input and output modules.
const PROFILE_INPUTS: u16 = 401;

/// 6007h: a lost connection is a malfunction, so 605Eh is done.
const MALFUNCTION: Value = Value::Integer16(1);
/// 605Ah, 605Bh, 605Ch, 605Eh: the drive function is disabled at once, the motor turns freely.
const DISABLE_DRIVE: Value = Value::Integer16(0);
/// 1029h: what CiA 301 does by default.
const TO_PRE_OPERATIONAL: u8 = 0;
/// 605Dh: ramp down, stay enabled. The master does not use the halt bit.
const SLOW_DOWN: Value = Value::Integer16(1);

/// What a drive need not have (CiA 402-2): without them it has no choice how to stop, and no highest speed
/// of its own.
pub const OPTIONAL: [Object; 5] = [
    Object::QUICK_STOP_OPTION,
    Object::SHUTDOWN_OPTION,
    Object::DISABLE_OPERATION_OPTION,
    Object::HALT_OPTION,
    Object::MAX_MOTOR_SPEED,
];

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
            admission: Admission::default(),
            is_optional: false,
            keep_alive: false,
            restores_defaults: false,
            stores_configuration: false,
            pdos,
            error_behaviour: Some(TO_PRE_OPERATIONAL),
            safety: Vec::new(),
            mode: None,
            emcy_cob_id: emcy::default_cob_id(node),
            error_control: ErrorControl::Heartbeat {
                period_ms: watch.heartbeat_ms,
                lost_after: Duration::from_millis(u64::from(watch.node_lost_ms)),
            },
            rest: None,
        }
    }

    /// The same drive, whose motor may turn so fast at most (6080h), in turns per minute.
    #[must_use]
    pub fn no_faster_than(mut self, turns_per_minute: u32) -> Self {
        self.safety.push((Object::MAX_MOTOR_SPEED, Value::Unsigned32(turns_per_minute)));
        self
    }

    /// The same node without what it `lacks` and need not have.
    #[must_use]
    pub fn lacking(mut self, lacks: impl Fn(Object) -> bool) -> Self {
        self.safety.retain(|(object, _)| !OPTIONAL.contains(object) || !lacks(*object));
        self
    }

    /// The same node for SYNCs that are counted up to `last` (1019h).
    #[must_use]
    pub fn counting(mut self, last: u8) -> Self {
        self.safety.push((Object::SYNC_OVERFLOW, Value::Unsigned8(last)));
        self
    }

    /// The same node without a heartbeat: guarded by the master, and guarding it in turn, in place of
    /// the watch over the master's heartbeat (1016h).
    #[must_use]
    pub fn guarded(mut self, guarding: Guarding) -> Self {
        self.safety.retain(|(object, _)| *object != Object::CONSUMER_HEARTBEAT);
        Self { error_control: ErrorControl::Guarding(guarding), ..self }
    }

    /// Whether it is a drive, which can push.
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
        let watch = self.watch_settings();
        let watch = watch.into_iter().filter(|setting| !setting.if_there);
        let watch = watch.map(|setting| setting.check.object);
        let written = pdos.chain(safety).chain(mode).chain(watch);
        mapped.chain(written.map(|object| (object, Demand::Write)))
    }

    /// Everything that is set in it, in the order in which it is written: PDOs, emergencies, what it
    /// does without its master, its limits, how it is watched. Its mode is no setting but a command.
    pub fn settings(&self) -> Vec<Setting> {
        let mut settings = Vec::new();
        for pdo in &self.pdos {
            for (object, value) in pdo.writes() {
                let is_cob_id = object == pdo.communication(1);
                let check = if is_cob_id { Check::cob_id } else { Check::exactly };
                // Whether a drive has the timer is known after the boot; what it means, to who arms it.
                let is_timer =
                    pdo.direction == Direction::Receive && object == pdo.communication(5);
                let if_there = pdo.service.is_none() || is_timer;
                settings.push(Setting { check: check(object, value), if_there });
            }
        }
        if self.emcy_cob_id != emcy::default_cob_id(self.node) {
            let valid = u32::from(self.emcy_cob_id);
            for raw in [COB_ID_INVALID | valid, valid] {
                let check = Check::cob_id(Object::EMCY_COB_ID, Value::Unsigned32(raw));
                settings.push(Setting { check, if_there: false });
            }
        }
        settings.extend(self.error_behaviour.map(|behaviour| Setting {
            check: Check::exactly(Object::ERROR_BEHAVIOUR, Value::Unsigned8(behaviour)),
            if_there: true,
        }));
        settings.extend(self.safety.iter().map(|(object, value)| Setting {
            if_there: OPTIONAL.contains(object),
            ..must(*object, *value)
        }));
        settings.extend(self.watch_settings());
        settings
    }

    /// The same as bare writes.
    pub fn writes(&self) -> Vec<(Object, Value)> {
        let settings = self.settings().into_iter();
        settings.map(|Setting { check, .. }| (check.object, check.expected)).collect()
    }

    /// What 1020h holds once all of this is set and stored.
    pub fn stamp(&self) -> Stamp {
        Stamp::of(&self.writes())
    }

    /// How the node and its master watch each other. A guarded one has no heartbeat, which would
    /// outrank the guarding.
    fn watch_settings(&self) -> Vec<Setting> {
        match self.error_control {
            ErrorControl::Heartbeat { period_ms, .. } => {
                vec![must(Object::PRODUCER_HEARTBEAT, Value::Unsigned16(period_ms))]
            }
            ErrorControl::Guarding(Guarding { guard_time_ms, life_time_factor }) => {
                let none = Check::exactly(Object::PRODUCER_HEARTBEAT, Value::Unsigned16(0));
                vec![
                    Setting { check: none, if_there: true },
                    must(Object::GUARD_TIME, Value::Unsigned16(guard_time_ms)),
                    must(Object::LIFE_TIME_FACTOR, Value::Unsigned8(life_time_factor)),
                ]
            }
        }
    }
}

/// One value that is set in a node.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Which object, what is written, and what is compared when it is read back.
    pub check: Check,
    /// Whether a node without this object is as good: what does not exist is off.
    pub if_there: bool,
}

/// A value that a node must take.
const fn must(object: Object, value: Value) -> Setting {
    Setting { check: Check::exactly(object, value), if_there: false }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::plans::elbow;
    use crate::testing::plans::guarded_elbow;

    #[test]
    fn the_masters_heartbeat_is_watched_as_the_standard_packs_it() {
        let safety = elbow().safety;
        assert!(safety.contains(&(Object::CONSUMER_HEARTBEAT, Value::Unsigned32(0x007F_0016))));
    }

    #[test]
    fn an_emergency_elsewhere_is_moved_while_it_is_off() {
        let moved = |plan: &NodePlan| -> Vec<Value> {
            let writes = plan.writes().into_iter();
            writes.filter(|(object, _)| *object == Object::EMCY_COB_ID).map(|(_, v)| v).collect()
        };
        let mut plan = elbow();
        assert_eq!(moved(&plan), []);
        plan.emcy_cob_id = 0x683;
        assert_eq!(moved(&plan), [Value::Unsigned32(0x8000_0683), Value::Unsigned32(0x0000_0683)]);
    }

    #[test]
    fn a_guarded_node_has_no_heartbeat_and_watches_none() {
        let writes = guarded_elbow().writes();
        let of = |object| writes.iter().find(|(o, _)| *o == object).map(|(_, value)| *value);
        assert_eq!(of(Object::CONSUMER_HEARTBEAT), None);
        assert_eq!(of(Object::PRODUCER_HEARTBEAT), Some(Value::Unsigned16(0)));
        assert_eq!(of(Object::GUARD_TIME), Some(Value::Unsigned16(10)));
        assert_eq!(of(Object::LIFE_TIME_FACTOR), Some(Value::Unsigned8(3)));
        assert!(guarded_elbow().demands().all(|(o, _)| o != Object::PRODUCER_HEARTBEAT));
    }
}
