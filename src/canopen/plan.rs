//! Plan of a node: its required identity and its configuration, as data.
//!
//! [`steps`](crate::master::steps) derives the boot steps and their order from it;
//! [`commission`](crate::master::commission) runs them.

mod settings;

pub use settings::mapped;

use std::time::Duration;

use canopen_rs::{ByteString, NodeId, Value};

use crate::guarding::Guarding;
use crate::layout::{self, Pdo};
use crate::nameplate::Nameplate;
use crate::object::Object;
use crate::setting::{self, Need, OFFSETS, interpolation_time};
use crate::{drive, emcy};

/// Required identity of a node (1000h and 1018h).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Vendor-ID, 1018h:1.
    pub vendor: u32,
    /// Product code, 1018h:2.
    pub product: u32,
    /// Revision number, 1018h:3.
    pub revision: u32,
}

/// Homing of a drive at rest: it takes its current position for home (CiA 402-2, 11).
#[derive(Clone, Debug, PartialEq)]
pub struct HomingPlan {
    /// Homing method (6098h): 37, or 35 in older drives.
    pub method: i8,
    /// Home offset (607Ch): position that 6064h reads at home; `None` if the drive has no such object.
    pub offset: Option<i32>,
    /// Reduced torque limits during the homing.
    pub reduced_limits: Vec<(Object, Value)>,
}

/// Further criteria for accepting a node; none by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Admission {
    /// Accepted revisions.
    pub revisions: Revisions,
    /// Serial number, 1018h:4: accepts this very device and no spare one.
    pub serial: Option<u32>,
    /// Manufacturer software version, 100Ah.
    pub software: Option<ByteString>,
    /// Program software identification, 1F56h:1.
    pub program: Option<u32>,
}

/// Accepted revisions of a device (1018h:3: major revision in the high word, minor in the low).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Revisions {
    /// Only the planned revision.
    #[default]
    Exact,
    /// Accepts the planned revision and later minor ones of the same major revision, which behave the same and may do
    /// more (CiA 301, 7.5.2.19).
    Compatible,
}

/// Heartbeat settings of master and node, which monitor each other (1016h, 1017h).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeartbeatSettings {
    /// Node-id under which the master sends its heartbeat.
    pub master: NodeId,
    /// Consumer heartbeat time of a drive (1016h:1), in ms: without the master's heartbeat it faults.
    pub master_lost_ms: u16,
    /// Producer heartbeat time of the node (1017h), in ms.
    pub heartbeat_ms: u16,
    /// Consumer heartbeat time of the master for the node, in ms.
    pub node_lost_ms: u16,
}

/// Error control service of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorControl {
    /// Heartbeat that the node produces.
    Heartbeat {
        /// Producer heartbeat time (1017h), in ms.
        period_ms: u16,
        /// Consumer heartbeat time of the master.
        lost_after: Duration,
    },
    /// Guarding: the master polls the node by remote frames.
    Guarding(Guarding),
}

impl ErrorControl {
    /// Period at which the node reports its state, in ms; 0 for never.
    pub const fn period_ms(self) -> u16 {
        match self {
            Self::Heartbeat { period_ms, .. } => period_ms,
            Self::Guarding(guarding) => guarding.guard_time_ms,
        }
    }

    /// Time without a report after which the node is lost.
    pub fn lost_after(self) -> Duration {
        match self {
            Self::Heartbeat { lost_after, .. } => lost_after,
            Self::Guarding(guarding) => guarding.life_time(),
        }
    }
}

/// Default time for one SDO reply.
pub(crate) const REPLY_TIMEOUT: Duration = Duration::from_millis(500);
/// Default time for a node to become ready.
pub(crate) const BOOT_TIMEOUT: Duration = Duration::from_secs(2);

/// Time limits of a boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeouts {
    /// For one SDO reply.
    pub reply: Duration,
    /// For the node to become ready: to power up, to boot, to change its mode.
    pub boot: Duration,
}

impl Default for Timeouts {
    fn default() -> Self {
        Self { reply: REPLY_TIMEOUT, boot: BOOT_TIMEOUT }
    }
}

/// Condition under which a drive displays its mode (6061h).
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ShownMode {
    /// Always: displayed as soon as the drive has taken the mode.
    #[default]
    Always,
    /// Drive enabled: the boot reads 6060h back, and the mode is checked under reduced torque limits.
    WhenEnabled {
        /// Torque limits of the boot, in place of those among the [settings](NodePlan::settings).
        reduced_limits: Vec<(Object, Value)>,
    },
}

/// Plan of one node: its identity, and its configuration before it is started.
#[derive(Clone, Debug, PartialEq)]
pub struct NodePlan {
    /// Name in the configuration: `joint 3 (elbow)`.
    pub name: String,
    /// Node-id, 1 to 127, unique on its bus.
    pub node: NodeId,
    /// Device profile, the low word of 1000h: 402 for drives, 401 for inputs.
    pub profile: u16,
    /// Required identity.
    pub identity: Identity,
    /// Further criteria for accepting the node.
    pub admission: Admission,
    /// Set if the other nodes start without it. It may be absent, but must not be another device.
    pub is_optional: bool,
    /// Set if the boot keeps the node running, without a reset, if it is operational and configured exactly as planned.
    /// Drives are always reset.
    pub keep_alive: bool,
    /// Set if the boot first restores the default parameters (1011h:1), followed by NMT reset node.
    pub restores_defaults: bool,
    /// Set if the node stores its configuration (1010h:1) with its [stamp](NodePlan::stamp), so that the next boot need
    /// not write it again.
    pub stores_configuration: bool,
    /// Time limits of the boot.
    pub timeouts: Timeouts,
    /// Writes that the configuration adds; they precede all others of the plan.
    pub first_writes: Vec<(Object, Value)>,
    /// PDOs of the node, those switched off included.
    pub pdos: Vec<Pdo>,
    /// Reaction to a communication error (1029h:1): 0 enters pre-operational, 1 changes nothing, 2 stops.
    /// `None` leaves the node's value; a node without 1029h passes.
    pub error_behaviour: Option<u8>,
    /// Reactions to errors, limits, and the period of the cycle. A device that lacks one of these objects is refused by
    /// that object, unless it is only a [means](Need).
    pub safety: Vec<(Object, Value)>,
    /// Objects of `safety` that limit the torque of a drive.
    pub torque_limits: Vec<Object>,
    /// Mode of operation (6060h), confirmed by the display (6061h). Commanded at every boot, not stored.
    pub mode: Option<i8>,
    /// Condition under which the drive displays its mode.
    pub shown_mode: ShownMode,
    /// Homing without motion, which an operator may request.
    pub homing: Option<HomingPlan>,
    /// Error codes of its emergencies that are warnings while their error register is 0.
    pub emcy_warnings: Vec<u16>,
    /// COB-ID of its emergencies: by default 80h + node-id, ahead of every PDO.
    pub emcy_cob_id: u16,
    /// Error control service.
    pub error_control: ErrorControl,
    /// Sign, scale and ratings that the drive must hold; `None` compares none.
    pub nameplate: Option<Nameplate>,
    /// Maximum motion of a drive at standstill, in counts of 6064h per 100 ms. The boot of a drive found with its power on
    /// waits for standstill; `None` skips the wait.
    pub standstill_counts: Option<u32>,
}

/// Device profile of drives.
const PROFILE_DRIVE: u16 = 402;
/// Device profile of input and output modules.
const PROFILE_INPUTS: u16 = 401;

/// 6007h: a lost connection is a malfunction, so 605Eh applies.
const MALFUNCTION: Value = Value::Integer16(1);
/// 605Ah, 605Bh, 605Ch, 605Eh: the drive function is disabled at once and the motor coasts.
const DISABLE_DRIVE: Value = Value::Integer16(0);
/// 1029h: default of CiA 301.
const TO_PRE_OPERATIONAL: u8 = 0;
/// 605Dh: ramp down, stay enabled. The master does not use the halt bit.
const SLOW_DOWN: Value = Value::Integer16(1);

impl NodePlan {
    /// Plans a CiA 402 drive in cyclic synchronous torque mode that stops when the master is lost. `max_torque` (6072h) is
    /// in ‰ of rated torque.
    pub fn drive(
        name: String,
        node: NodeId,
        identity: Identity,
        pdos: Vec<Pdo>,
        heartbeats: &HeartbeatSettings,
        max_torque: u16,
    ) -> Self {
        let consumer =
            u32::from(heartbeats.master.raw()) << 16 | u32::from(heartbeats.master_lost_ms);
        let mut safety = setting::no_offsets().to_vec();
        safety.extend([
            (Object::CONSUMER_HEARTBEAT, Value::Unsigned32(consumer)),
            (Object::ABORT_CONNECTION, MALFUNCTION),
            (Object::QUICK_STOP_OPTION, DISABLE_DRIVE),
            (Object::SHUTDOWN_OPTION, DISABLE_DRIVE),
            (Object::DISABLE_OPERATION_OPTION, DISABLE_DRIVE),
            (Object::HALT_OPTION, SLOW_DOWN),
            (Object::FAULT_REACTION, DISABLE_DRIVE),
            (Object::MAX_TORQUE, Value::Unsigned16(max_torque)),
        ]);
        let mode = Some(drive::CYCLIC_SYNCHRONOUS_TORQUE);
        let torque_limits = vec![Object::MAX_TORQUE];
        let device = Self::device(name, node, PROFILE_DRIVE, identity, pdos, heartbeats);
        Self { safety, torque_limits, mode, ..device }
    }

    /// Plans a CiA 401 switch box, with one analogue input by its number or none. It moves nothing and consumes no
    /// heartbeat.
    pub fn switches(
        name: String,
        node: NodeId,
        identity: Identity,
        analogue: Option<u8>,
        heartbeats: &HeartbeatSettings,
    ) -> Self {
        let pdos = layout::switches(node, analogue);
        Self::device(name, node, PROFILE_INPUTS, identity, pdos, heartbeats)
    }

    fn device(
        name: String,
        node: NodeId,
        profile: u16,
        identity: Identity,
        pdos: Vec<Pdo>,
        heartbeats: &HeartbeatSettings,
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
            timeouts: Timeouts::default(),
            first_writes: Vec::new(),
            pdos,
            error_behaviour: Some(TO_PRE_OPERATIONAL),
            safety: Vec::new(),
            torque_limits: Vec::new(),
            mode: None,
            shown_mode: ShownMode::Always,
            homing: None,
            emcy_warnings: Vec::new(),
            emcy_cob_id: emcy::default_cob_id(node),
            error_control: ErrorControl::Heartbeat {
                period_ms: heartbeats.heartbeat_ms,
                lost_after: Duration::from_millis(u64::from(heartbeats.node_lost_ms)),
            },
            nameplate: None,
            standstill_counts: None,
        }
    }

    /// Limits the motor speed (6080h), in revolutions per minute.
    #[must_use]
    pub fn no_faster_than(mut self, turns_per_minute: u32) -> Self {
        self.safety.push((Object::MAX_MOTOR_SPEED, Value::Unsigned32(turns_per_minute)));
        self
    }

    /// Limits the torque by these objects in place of 6072h; without any, by nothing that the master writes.
    #[must_use]
    pub fn limited_by(mut self, limits: &[(Object, Value)]) -> Self {
        self.safety.retain(|(limit, _)| *limit != Object::MAX_TORQUE);
        self.safety.extend_from_slice(limits);
        self.torque_limits = limits.iter().map(|(object, _)| *object).collect();
        self
    }

    /// States the period of SYNC: communication cycle period (1006h) and interpolation time period (60C2h).
    #[must_use]
    pub fn every(mut self, period_us: u64) -> Self {
        let period = u32::try_from(period_us).map(Value::Unsigned32);
        self.safety.extend(period.ok().map(|period| (Object::CYCLE_PERIOD, period)));
        let time = interpolation_time(period_us).map(|(count, index)| {
            [
                (Object::INTERPOLATION_TIME, Value::Unsigned8(count)),
                (Object::INTERPOLATION_TIME_INDEX, Value::Integer8(index)),
            ]
        });
        self.safety.extend(time.into_iter().flatten());
        self
    }

    /// Removes means that the device `lacks`, and the heartbeat consumer: another watchdog may stop the drive. Offsets
    /// stay: a data sheet that omits one says nothing about the drive.
    #[must_use]
    pub fn lacking(mut self, lacks: impl Fn(Object) -> bool) -> Self {
        let is_dispensable = |object| {
            let is_means = !Need::for_object(object).is_must() && !OFFSETS.contains(&object);
            object == Object::CONSUMER_HEARTBEAT || is_means
        };
        self.safety.retain(|(object, _)| !(is_dispensable(*object) && lacks(*object)));
        self
    }

    /// Sets the synchronous counter overflow value (1019h). It can be changed only while the period (1006h) is zero
    /// (CiA 301, 7.5.2.22), so call [`every`](Self::every) afterwards.
    #[must_use]
    pub fn counting(mut self, last: u8) -> Self {
        self.safety.push((Object::CYCLE_PERIOD, Value::Unsigned32(0)));
        self.safety.push((Object::SYNC_OVERFLOW, Value::Unsigned8(last)));
        self
    }

    /// Replaces the heartbeats by guarding: the master guards the node, and the node its master (life guarding).
    #[must_use]
    pub fn guarded(mut self, guarding: Guarding) -> Self {
        self.safety.retain(|(object, _)| *object != Object::CONSUMER_HEARTBEAT);
        Self { error_control: ErrorControl::Guarding(guarding), ..self }
    }

    /// Returns whether the node is a drive, which can apply torque.
    pub const fn is_drive(&self) -> bool {
        self.profile == PROFILE_DRIVE
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::plans::elbow;

    #[test]
    fn consumer_heartbeat_is_packed_as_the_standard_defines() {
        let safety = elbow().safety;
        assert!(safety.contains(&(Object::CONSUMER_HEARTBEAT, Value::Unsigned32(0x007F_0016))));
    }
}
