//! Table of faults: a row has the word of `kind`, the target, the keys, and the kind of fault that they make.

use std::time::Duration;

use canopen_rs::{NmtCommand, NodeId};
use toml::Value;

use crate::scenario::keys::{Key, KeyList, KeyValue, Keys};
use crate::scenario::problem::{LocatedProblem, Problem};
use canopen::frame::{COB_ID_MAX, Channel, Frame};
use canopen::layout::MAX_PDOS;
use canopen::nmt::Order;
use canopen::sync;
use faults::{
    ContactFault, DeviceFault, Disconnection, Disturbance, Effect, Extent, FaultKind, FrameFault,
    HostFault, Input, LinkFault, Selection, SensorFault, Service, Target,
};
use units::numbering::Joint;

/// Generates the functions that read and write by the table. The kind of a row is an expression to read it and a
/// pattern to write it, with the values of its keys. A row serves the kinds that no row before it has. Short forms are
/// only read.
macro_rules! fault_table {
    (
        $($word:literal $(by $target:ident)? $(on $fixed:path)? $(, $value:ident: $key:expr)*
            => ($($kind:tt)+);)+
        short forms:
        $($short:literal by $short_target:ident $(, $short_value:ident: $short_key:expr)*
            => $short_kind:expr;)+
    ) => {
        /// Reads target and kind of the fault that `word` names.
        pub(super) fn read(word: &str, keys: &mut Keys) -> Result<(Target, FaultKind), LocatedProblem> {
            Ok(match word {
                $($word => {
                    $(let $value = $key.read(keys)?;)*
                    ($($target.read(keys)?)? $($fixed)?, $($kind)+)
                })+
                $($short => {
                    $(let $short_value = $short_key.read(keys)?;)*
                    ($short_target.read(keys)?, $short_kind)
                })+
                word => {
                    let (key, wanted) = ("kind", "a kind of fault");
                    let value = word.replace('\n', " ");
                    return Err(keys.misplaced(Problem::Value { key, value, wanted }));
                }
            })
        }

        /// Writes `kind`, the target and the keys.
        pub(super) fn write(target: Target, kind: FaultKind, keys: &mut KeyList) {
            match kind {
                $($($kind)+ => {
                    keys.push(("kind", $word.into()));
                    $($target.write(target, keys);)?
                    $($key.write($value, keys);)*
                })+
            }
        }
    };
}

fault_table! {
    "unplug" by DEVICE => (FaultKind::Disconnection(Disconnection::Unplugged));
    "wire_cut" by DEVICE => (FaultKind::Disconnection(Disconnection::WireCut));
    "bus_off" by DEVICE => (FaultKind::Disconnection(Disconnection::BusOff));
    "drop" by DEVICE, selection: SELECTION, extent: EXTENT
        => (FaultKind::Frames(FrameFault { selection, effect: Effect::Drop, extent }));
    "duplicate" by DEVICE, selection: SELECTION, extent: EXTENT
        => (FaultKind::Frames(FrameFault { selection, effect: Effect::Duplicate, extent }));
    "delay" by DEVICE, selection: SELECTION, by: DELAY, reorders: REORDER, extent: EXTENT
        => (FaultKind::Frames(FrameFault { selection, effect: Effect::Delay { by, reorders }, extent }));
    "corrupt" by DEVICE, selection: SELECTION, mask: MASK, extent: EXTENT
        => (FaultKind::Frames(FrameFault { selection, effect: Effect::Corrupt(mask), extent }));
    "freeze" by DEVICE, selection: SELECTION, extent: EXTENT
        => (FaultKind::Frames(FrameFault { selection, effect: Effect::Freeze, extent }));
    "resize" by DEVICE, selection: SELECTION, bytes: BYTES, extent: EXTENT
        => (FaultKind::Frames(FrameFault { selection, effect: Effect::Resize(bytes), extent }));
    "impersonate" by DEVICE, by: IMITATED, service: SERVICE => (FaultKind::Imitation { by, service });
    "reset" by DEVICE => (FaultKind::Device(DeviceFault::Reboot));
    "emergency" by DEVICE, code: CODE, register: REGISTER
        => (FaultKind::Device(DeviceFault::Emergency { code, register }));
    "fault" by DRIVE, code: CODE.or(0) => (FaultKind::Device(DeviceFault::DriveFault(code)));
    "sto" by DRIVE => (FaultKind::Device(DeviceFault::SafeTorqueOff));
    "controlword_ignored" by DRIVE => (FaultKind::Device(DeviceFault::ControlwordIgnored));
    "torque_offset" by DRIVE, torque: TORQUE => (FaultKind::Device(DeviceFault::TorqueOffset(torque)));
    "encoder_jump" by DRIVE, by: OFFSET => (FaultKind::Sensor(SensorFault::PositionOffset(by)));
    "encoder_frozen" by DRIVE => (FaultKind::Sensor(SensorFault::PositionFrozen));
    "torque_actual_scale" by DRIVE, factor: SCALE
        => (FaultKind::Sensor(SensorFault::TorqueScaled(factor)));
    "switch_bounce" on Target::SwitchBox, input: SWITCH
        => (FaultKind::Contact(input, ContactFault::Bouncing));
    "switch_stuck" on Target::SwitchBox, input: SWITCH, level: LEVEL => (FaultKind::Contact(input, level));
    "foreign_frame" by BUS, frame: FRAME, period: PERIOD => (FaultKind::ForeignFrame { frame, period });
    "link_loss" on Target::Link => (FaultKind::Link(LinkFault::Lost));
    "link_slow" on Target::Link => (FaultKind::Link(LinkFault::Slow));
    "link_foreign" on Target::Link => (FaultKind::Link(LinkFault::Foreign));
    "far_side_holds" on Target::Link => (FaultKind::Link(LinkFault::Held));
    "link_frozen" on Target::Link => (FaultKind::Link(LinkFault::Frozen));
    "sensed_force" on Target::Link, force: FORCE => (FaultKind::SensedForce(force));
    "queue_full" by BUS => (FaultKind::Bus(Disturbance::QueueFull));
    "adapter_stuck" by BUS => (FaultKind::Bus(Disturbance::AdapterStuck));
    "adapter_stalled" by BUS => (FaultKind::Bus(Disturbance::AdapterStalled));
    "adapter_unplugged" by BUS => (FaultKind::Bus(Disturbance::AdapterUnplugged));
    "adapter_bus_off" by BUS => (FaultKind::Bus(Disturbance::BusOff));
    "error_passive" by BUS => (FaultKind::Bus(Disturbance::ErrorPassive));
    "error_warning" by BUS => (FaultKind::Bus(Disturbance::ErrorWarning));
    "interface_down" by BUS => (FaultKind::Bus(Disturbance::InterfaceDown));
    "flood" by BUS, frame: FRAME => (FaultKind::Bus(Disturbance::Flood(frame)));
    "host_suspended" on Target::Host, after: AFTER => (FaultKind::Host(HostFault::Suspended(after)));
    "clock_set" on Target::Host, wall: WALL => (FaultKind::Host(HostFault::ClockSet(wall)));
    "process_stopped" on Target::Host, stop: STOP => (FaultKind::Host(stop));

    short forms:
    "heartbeat_stop" by DEVICE => FaultKind::Frames(FrameFault::on_service(Service::Heartbeat, Effect::Drop));
    "foreign_sync" by BUS, period: PERIOD
        => FaultKind::ForeignFrame { frame: Frame::new(sync::COB_ID, []), period };
    "foreign_nmt" by BUS, command: COMMAND, node: NODE, period: PERIOD
        => FaultKind::ForeignFrame { frame: Order { command, node }.frame(), period };
}

/// `joint = 3`, `joint = "all"` or `device = "switches"`.
const DEVICE: Key<Target> =
    Key::words("device", "\"switches\"", &[("switches", Target::SwitchBox)]).or_else(&DRIVE);

/// `joint = 3` or `joint = "all"`.
const DRIVE: Key<Target> = Key::new(
    "joint",
    |it| {
        it.any("1 to 6 or \"all\"", |value| match value.as_str() {
            Some(word) => (word == "all").then_some(Target::Drives),
            None => joint(value).map(Target::Joint),
        })
    },
    |target| match target {
        Target::Joint(joint) => integer(joint.number()),
        Target::Drives => Some("all".into()),
        Target::SwitchBox | Target::Bus(_) | Target::Link | Target::Host => None,
    },
);

/// Bus, with the host's adapter to it.
const BUS: Key<Target> = Key::new(
    "bus",
    |it| it.whole("a bus, from 0", 0..=u8::MAX).map(|bus| Target::Bus(Channel(bus))),
    |target| if let Target::Bus(Channel(bus)) = target { integer(bus) } else { None },
)
.or(Target::Bus(Channel(0)));

/// `frame` or `cob_id`, or neither.
const SELECTION: Key<Selection> = Key::new(
    "frame",
    |it| service(it).map(Selection::Service),
    |to| if let Selection::Service(service) = to { written(service) } else { None },
)
.or_else(&SELECTED_COB_ID);

const SELECTED_COB_ID: Key<Selection> = Key::new(
    "cob_id",
    |it| cob_id(it).map(Selection::CobId),
    |to| if let Selection::CobId(cob_id) = to { integer(cob_id) } else { None },
)
.or(Selection::All);

/// `share` or `count`, or neither.
const EXTENT: Key<Extent> = Key::new(
    "share",
    |it| it.number(0.0..=1.0).map(Extent::Share),
    |extent| if let Extent::Share(share) = extent { Some(share.into()) } else { None },
)
.or_else(&COUNT);

const COUNT: Key<Extent> = Key::new(
    "count",
    |it| it.whole("1 or more", 1..=u32::MAX).map(Extent::First),
    |extent| if let Extent::First(count) = extent { integer(count) } else { None },
)
.or(Extent::Always);

const DELAY: Key<Duration> = Key::new(
    "delay_ms",
    |it| it.number(0.0..=MAX_DELAY_MS).map(from_millis),
    |by| Some(millis(by).into()),
);

/// Later frames may overtake it.
const REORDER: Key<bool> = Key::new(
    "reorder",
    |it| it.any("true or false", Value::as_bool),
    |reorders| reorders.then(|| true.into()),
)
.or(false);

/// Bits to invert.
const MASK: Key<[u8; 8]> = Key::new(
    "xor",
    |it| {
        let bytes = it.bytes()?;
        Ok(std::array::from_fn(|place| bytes.get(place).copied().unwrap_or(0)))
    },
    |mask| Some(digits(&mask).into()),
);

const BYTES: Key<u8> = Key::new("bytes", |it| it.whole("0 to 8", 0..=8), integer);

const IMITATED: Key<Joint> =
    Key::new("by", |it| it.any("1 to 6", joint), |by| integer(by.number()));

const SERVICE: Key<Service> = Key::new("frame", service, written).or(Service::Tpdo(1));

const CODE: Key<u16> = Key::new("code", |it| it.whole("0 to 0xFFFF", 0..=u16::MAX), integer);

const REGISTER: Key<u8> =
    Key::new("register", |it| it.whole("0 to 0xFF", 0..=u8::MAX), integer).or(0);

/// In ‰ of rated torque.
const TORQUE: Key<i16> =
    Key::new("per_mille", |it| it.whole("-1000 to 1000", -1_000..=1_000), integer);

/// Offset of an encoder, in rad (m).
const OFFSET: Key<f64> = Key::new("by_rad", |it| it.number(-1e3..=1e3), |by| Some(by.into()));

const SCALE: Key<f64> =
    Key::new("scale", |it| it.number(-10.0..=10.0), |factor| Some(factor.into()));

const SWITCH: Key<Input> =
    Key::words("switch", "deadman_a, deadman_b, reference or reflection", &Input::ALL);

const LEVEL: Key<ContactFault> = Key::words(
    "level",
    "\"high\" or \"low\"",
    &[("high", ContactFault::StuckHigh), ("low", ContactFault::StuckLow)],
);

/// Time between two foreign frames; `None` for a single one.
const PERIOD: Key<Option<Duration>> = Key::new(
    "every_ms",
    |it| it.number(0.1..=MAX_DELAY_MS).map(|period| Some(from_millis(period))),
    |period| Some(millis(period?).into()),
)
.or(None);

const COMMAND: Key<NmtCommand> = Key::words(
    "command",
    "start, stop, pre_operational, reset_node or reset_communication",
    &[
        ("start", NmtCommand::StartRemoteNode),
        ("stop", NmtCommand::StopRemoteNode),
        ("pre_operational", NmtCommand::EnterPreOperational),
        ("reset_node", NmtCommand::ResetNode),
        ("reset_communication", NmtCommand::ResetCommunication),
    ],
);

/// Node that a command is for; `None` for all.
const NODE: Key<Option<NodeId>> = Key::new(
    "node_id",
    |it| it.whole("1 to 127", 1..=127).map(|raw| NodeId::new(raw).ok()),
    |_| None,
)
.or(None);

/// Sensed force, in N; NaN and infinities are valid.
const FORCE: Key<f64> = Key::new("force_n", |it| it.any_number(), |force| Some(force.into()));

/// Time of a wall clock since 1970, up to the year 2106.
const WALL: Key<Duration> = Key::new(
    "wall_s",
    |it| it.number(0.0..=4_294_967_296.0).map(Duration::from_secs_f64),
    |wall| Some(seconds(wall).into()),
);

/// At once, or after the next frame with `cob_id`.
const STOP: Key<HostFault> = Key::new(
    "cob_id",
    |it| cob_id(it).map(HostFault::ProcessStoppedAfter),
    |stop| if let HostFault::ProcessStoppedAfter(cob_id) = stop { integer(cob_id) } else { None },
)
.or(HostFault::ProcessStopped);

/// At once, or after the next frame with it.
const AFTER: Key<Option<u16>> =
    Key::new("cob_id", |it| cob_id(it).map(Some), |after| after.and_then(integer)).or(None);

/// `cob_id` and `payload`.
const FRAME: FrameKeys = FrameKeys;

/// Two keys of [`FRAME`].
#[derive(Debug)]
pub(super) struct FrameKeys;

impl FrameKeys {
    /// Reads `cob_id` and `payload`.
    pub(super) fn read(&self, keys: &mut Keys) -> Result<Frame, LocatedProblem> {
        let cob_id = keys.value("cob_id", cob_id)?;
        let cob_id = keys.needed("cob_id", cob_id)?;
        let bytes = keys.value("payload", |it| it.bytes())?;
        let bytes = keys.needed("payload", bytes)?;
        keys.needed("payload", Frame::from_slice(cob_id, &bytes))
    }

    /// Writes `cob_id` and `payload`.
    pub(super) fn write(&self, frame: Frame, to: &mut KeyList) {
        to.push(("cob_id", i64::from(frame.cob_id).into()));
        to.push(("payload", digits(frame.data()).into()));
    }
}

/// Longest delay of a frame and period of foreign ones, in ms.
const MAX_DELAY_MS: f64 = 10_000.0;

fn joint(value: &Value) -> Option<Joint> {
    Joint::new(value.as_integer()?)
}

fn cob_id(it: &KeyValue<'_>) -> Result<u16, Problem> {
    it.whole("0 to 0x7FF", 0..=COB_ID_MAX)
}

/// `tpdo1` and the like.
fn service(it: &KeyValue<'_>) -> Result<Service, Problem> {
    it.word("tpdo1 to tpdo512, rpdo1 to rpdo512, emcy, heartbeat, sdo, sync or nmt", |word| {
        let pdos = (1..=MAX_PDOS).flat_map(|number| [Service::Tpdo(number), Service::Rpdo(number)]);
        Service::UNNUMBERED.into_iter().chain(pdos).find(|service| service.to_string() == word)
    })
}

fn written(service: Service) -> Option<Value> {
    Some(service.to_string().into())
}

fn integer(number: impl Into<i64>) -> Option<Value> {
    Some(number.into().into())
}

fn digits(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

fn from_millis(millis: f64) -> Duration {
    Duration::from_secs_f64(millis * 1e-3)
}

/// Returns the shortest number that is read as this duration, in s.
pub(super) fn seconds(duration: Duration) -> f64 {
    (duration.as_secs_f64() * 1e9).round() / 1e9
}

fn millis(duration: Duration) -> f64 {
    (duration.as_secs_f64() * 1e9).round() / 1e6
}
