//! Reads a `[[fault]]` entry: `at_s`, `kind`, target, `for_s` and the keys of its kind.

use std::time::Duration;

use canopen_rs::{NmtCommand, NodeId};
use toml::{Spanned, Value};

use crate::scenario::keys::{Entry, Keys};
use crate::scenario::problem::{MIN_DURATION, Misplaced, Problem, follows};
use canopen::frame::{COB_ID_MAX, Channel, Frame};
use canopen::layout::MAX_PDOS;
use canopen::nmt::Order;
use canopen::sync;
use faults::{
    ContactFault, DeviceFault, Disconnection, Disturbance, Effect, Extent, Fault, FrameFault,
    HostFault, Input, Kind, LinkFault, Selection, SensorFault, Service, Target,
};
use units::numbering::Joint;

/// Longest delay of a frame, in ms.
const MAX_DELAY_MS: f64 = 10_000.0;

/// Shortest period of foreign frames, in ms.
const MIN_PERIOD_MS: f64 = 0.1;

/// Largest offset of an encoder, in rad (m).
const MAX_ENCODER_OFFSET: f64 = 1e3;

/// Latest time of a wall clock, in s since 1970: the year 2106.
const MAX_WALL_S: f64 = 4_294_967_296.0;

/// Reads all of them. They may overlap, but none may start before the one before it.
pub(super) fn read_all(
    entries: Vec<Spanned<Entry>>,
    seconds: f64,
) -> Result<Vec<Fault>, Misplaced> {
    let mut started_s = 0.0;
    let mut faults = Vec::with_capacity(entries.len());
    for entry in entries {
        let (kind, mut keys) = Keys::of(entry)?;
        let at_s = keys.number("at_s", 0.0..=seconds)?;
        let at_s = keys.needed("at_s", at_s)?;
        follows(at_s, started_s).map_err(|problem| keys.misplaced(problem))?;
        started_s = at_s;
        faults.push(read(&kind, at_s, seconds, &mut keys)?);
        keys.end()?;
    }
    Ok(faults)
}

fn read(kind: &str, at_s: f64, seconds: f64, keys: &mut Keys) -> Result<Fault, Misplaced> {
    let (target, kind) = match kind {
        "unplug" => (device(keys)?, Kind::Disconnection(Disconnection::Unplugged)),
        "wire_cut" => (device(keys)?, Kind::Disconnection(Disconnection::WireCut)),
        "bus_off" => (device(keys)?, Kind::Disconnection(Disconnection::BusOff)),
        "drop" => frames(keys, Effect::Drop)?,
        "duplicate" => frames(keys, Effect::Duplicate)?,
        "delay" => delay(keys)?,
        "corrupt" => corrupt(keys)?,
        "freeze" => frames(keys, Effect::Freeze)?,
        "resize" => resize(keys)?,
        "heartbeat_stop" => {
            (device(keys)?, Kind::Frames(FrameFault::of(Service::Heartbeat, Effect::Drop)))
        }
        "impersonate" => imitation(keys)?,
        "reset" => (device(keys)?, Kind::Device(DeviceFault::Reboot)),
        "emergency" => emergency(keys)?,
        "fault" => (drive(keys)?, Kind::Device(DeviceFault::DriveFault(code(keys)?.unwrap_or(0)))),
        "sto" => (drive(keys)?, Kind::Device(DeviceFault::SafeTorqueOff)),
        "controlword_ignored" => (drive(keys)?, Kind::Device(DeviceFault::ControlwordIgnored)),
        "torque_offset" => torque_offset(keys)?,
        "encoder_jump" => encoder_jump(keys)?,
        "encoder_frozen" => (drive(keys)?, Kind::Sensor(SensorFault::PositionFrozen)),
        "torque_actual_scale" => torque_actual_scale(keys)?,
        "switch_stuck" => switch_stuck(keys)?,
        "switch_bounce" => (Target::SwitchBox, Kind::Contact(input(keys)?, ContactFault::Bouncing)),
        "foreign_sync" => foreign(keys, Frame::new(sync::COB_ID, []))?,
        "foreign_nmt" => foreign_nmt(keys)?,
        "foreign_frame" => foreign_frame(keys)?,
        "link_loss" => (Target::Link, Kind::Link(LinkFault::Lost)),
        "link_frozen" => (Target::Link, Kind::Link(LinkFault::Frozen)),
        "sensed_force" => (Target::Link, Kind::SensedForce(keys.any_number("force_n")?)),
        "flood" => flood(keys)?,
        "process_stopped" => process_stopped(keys)?,
        "host_suspended" => (Target::Host, Kind::Host(HostFault::Suspended)),
        "clock_set" => clock_set(keys)?,
        word => match DISTURBANCES.iter().find(|(name, _)| *name == word) {
            Some((_, disturbance)) => (bus(keys)?, Kind::Bus(*disturbance)),
            None => {
                let (key, wanted) = ("kind", "a kind of fault");
                let value = word.replace('\n', " ");
                return Err(keys.misplaced(Problem::Value { key, value, wanted }));
            }
        },
    };
    let mut fault = Fault::new(Duration::from_secs_f64(at_s), target, kind);
    if !kind.is_momentary() {
        // A host or an adapter may stand still for a part of a cycle.
        let least = if matches!(kind, Kind::Host(_) | Kind::Bus(_)) { 0.0 } else { MIN_DURATION };
        let duration = keys.number("for_s", least..=seconds - at_s)?;
        fault.duration = duration.map(Duration::from_secs_f64);
    }
    // Without an end, virtual time would never come back to the process.
    if matches!(kind, Kind::Host(_)) && !kind.is_momentary() {
        keys.needed("for_s", fault.duration)?;
    }
    Ok(fault)
}

/// Disturbances of a bus that their word alone describes.
pub(super) const DISTURBANCES: [(&str, Disturbance); 8] = [
    ("queue_full", Disturbance::QueueFull),
    ("adapter_stuck", Disturbance::AdapterStuck),
    ("adapter_stalled", Disturbance::AdapterStalled),
    ("adapter_unplugged", Disturbance::AdapterUnplugged),
    ("adapter_bus_off", Disturbance::BusOff),
    ("error_passive", Disturbance::ErrorPassive),
    ("error_warning", Disturbance::ErrorWarning),
    ("interface_down", Disturbance::InterfaceDown),
];

/// `joint = 3`, `joint = "all"` or `device = "switches"`.
fn device(keys: &mut Keys) -> Result<Target, Misplaced> {
    let switches = keys
        .word("device", "\"switches\"", |word| (word == "switches").then_some(Target::SwitchBox))?;
    if switches.is_some() { keys.needed("device", switches) } else { drive(keys) }
}

/// `joint = 3` or `joint = "all"`.
fn drive(keys: &mut Keys) -> Result<Target, Misplaced> {
    let read = |value: &Value| match value.as_str() {
        Some(word) => (word == "all").then_some(Target::Drives),
        None => joint(value).map(Target::Joint),
    };
    let target = keys.value("joint", "1 to 6 or \"all\"", read)?;
    keys.needed("joint", target)
}

fn joint(value: &Value) -> Option<Joint> {
    Joint::new(value.as_integer()?)
}

/// `bus = 1`; the first one if the key is absent.
fn bus(keys: &mut Keys) -> Result<Target, Misplaced> {
    let bus = keys.whole("bus", "a bus, from 0", |_: &u8| true)?.unwrap_or(0);
    Ok(Target::Bus(Channel(bus)))
}

fn frames(keys: &mut Keys, effect: Effect) -> Result<(Target, Kind), Misplaced> {
    let target = device(keys)?;
    let service = service(keys)?.map(Selection::Service);
    let cob_id = match service {
        Some(_) => None,
        None => cob_id(keys)?.map(Selection::CobId),
    };
    let selection = service.or(cob_id).unwrap_or(Selection::All);
    Ok((target, Kind::Frames(FrameFault { selection, effect, extent: extent(keys)? })))
}

/// `frame = "tpdo1"` and the like.
fn service(keys: &mut Keys) -> Result<Option<Service>, Misplaced> {
    let wanted = "tpdo1 to tpdo512, rpdo1 to rpdo512, emcy, heartbeat, sdo, sync or nmt";
    keys.word("frame", wanted, |word| {
        let number = |digits: &str| {
            digits.parse().ok().filter(|number: &u16| {
                (1..=MAX_PDOS).contains(number) && number.to_string() == digits
            })
        };
        match word {
            "emcy" => Some(Service::Emergency),
            "heartbeat" => Some(Service::Heartbeat),
            "sdo" => Some(Service::Sdo),
            "sync" => Some(Service::Sync),
            "nmt" => Some(Service::Nmt),
            pdo => {
                let tpdo = pdo.strip_prefix("tpdo").and_then(number).map(Service::Tpdo);
                tpdo.or_else(|| pdo.strip_prefix("rpdo").and_then(number).map(Service::Rpdo))
            }
        }
    })
}

fn cob_id(keys: &mut Keys) -> Result<Option<u16>, Misplaced> {
    keys.whole("cob_id", "0 to 0x7FF", |cob_id| *cob_id <= COB_ID_MAX)
}

/// `share` or `count`, or neither.
fn extent(keys: &mut Keys) -> Result<Extent, Misplaced> {
    if let Some(share) = keys.number("share", 0.0..=1.0)? {
        return Ok(Extent::Share(share));
    }
    let count = keys.whole("count", "1 or more", |count: &u32| *count > 0)?;
    Ok(count.map_or(Extent::Always, Extent::First))
}

fn delay(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let by = keys.number("delay_ms", 0.0..=MAX_DELAY_MS)?;
    let by = Duration::from_secs_f64(keys.needed("delay_ms", by)? * 1e-3);
    let reorders = keys.value("reorder", "true or false", Value::as_bool)?.unwrap_or(false);
    frames(keys, Effect::Delay { by, reorders })
}

fn corrupt(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let bytes = keys.bytes("xor")?;
    let bytes = keys.needed("xor", bytes)?;
    let mut mask = [0; 8];
    for (to, from) in mask.iter_mut().zip(bytes) {
        *to = from;
    }
    frames(keys, Effect::Corrupt(mask))
}

fn resize(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let bytes = keys.whole("bytes", "0 to 8", |bytes: &u8| *bytes <= 8)?;
    let bytes = keys.needed("bytes", bytes)?;
    frames(keys, Effect::Resize(bytes))
}

fn imitation(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let by = keys.value("by", "1 to 6", joint)?;
    let by = keys.needed("by", by)?;
    let service = service(keys)?.unwrap_or(Service::Tpdo(1));
    Ok((device(keys)?, Kind::Imitation { by, service }))
}

fn code(keys: &mut Keys) -> Result<Option<u16>, Misplaced> {
    keys.whole("code", "0 to 0xFFFF", |_| true)
}

fn emergency(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let code = code(keys)?;
    let code = keys.needed("code", code)?;
    let register = keys.whole("register", "0 to 0xFF", |_| true)?.unwrap_or(0);
    Ok((device(keys)?, Kind::Device(DeviceFault::Emergency { code, register })))
}

fn encoder_jump(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let by = keys.number("by_rad", -MAX_ENCODER_OFFSET..=MAX_ENCODER_OFFSET)?;
    let by = keys.needed("by_rad", by)?;
    Ok((drive(keys)?, Kind::Sensor(SensorFault::PositionOffset(by))))
}

fn torque_actual_scale(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let factor = keys.number("scale", -10.0..=10.0)?;
    let factor = keys.needed("scale", factor)?;
    Ok((drive(keys)?, Kind::Sensor(SensorFault::TorqueScaled(factor))))
}

fn torque_offset(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let per_mille =
        keys.whole("per_mille", "-1000 to 1000", |one: &i16| (-1_000..=1_000).contains(one))?;
    let per_mille = keys.needed("per_mille", per_mille)?;
    Ok((drive(keys)?, Kind::Device(DeviceFault::TorqueOffset(per_mille))))
}

fn input(keys: &mut Keys) -> Result<Input, Misplaced> {
    let input = keys.word("switch", "deadman_a, deadman_b, reference or reflection", |word| {
        Input::ALL.iter().find(|(name, _)| *name == word).map(|(_, input)| *input)
    })?;
    keys.needed("switch", input)
}

fn switch_stuck(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let stuck = keys.word("level", "\"high\" or \"low\"", |word| match word {
        "high" => Some(ContactFault::StuckHigh),
        "low" => Some(ContactFault::StuckLow),
        _ => None,
    })?;
    let stuck = keys.needed("level", stuck)?;
    Ok((Target::SwitchBox, Kind::Contact(input(keys)?, stuck)))
}

/// On `bus`; once, or every `every_ms`.
fn foreign(keys: &mut Keys, frame: Frame) -> Result<(Target, Kind), Misplaced> {
    let target = bus(keys)?;
    let period = keys.number("every_ms", MIN_PERIOD_MS..=MAX_DELAY_MS)?;
    let period = period.map(|period| Duration::from_secs_f64(period * 1e-3));
    Ok((target, Kind::ForeignFrame { frame, period }))
}

fn foreign_nmt(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let wanted = "start, stop, pre_operational, reset_node or reset_communication";
    let command = keys.word("command", wanted, |word| match word {
        "start" => Some(NmtCommand::StartRemoteNode),
        "stop" => Some(NmtCommand::StopRemoteNode),
        "pre_operational" => Some(NmtCommand::EnterPreOperational),
        "reset_node" => Some(NmtCommand::ResetNode),
        "reset_communication" => Some(NmtCommand::ResetCommunication),
        _ => None,
    })?;
    let command = keys.needed("command", command)?;
    let node = keys.whole("node_id", "1 to 127", |raw: &u8| NodeId::new(*raw).is_ok())?;
    let node = node.and_then(|raw| NodeId::new(raw).ok());
    foreign(keys, Order { command, node }.frame())
}

fn foreign_frame(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let frame = frame(keys)?;
    foreign(keys, frame)
}

/// `cob_id` and `payload`.
fn frame(keys: &mut Keys) -> Result<Frame, Misplaced> {
    let cob_id = cob_id(keys)?;
    let cob_id = keys.needed("cob_id", cob_id)?;
    let bytes = keys.bytes("payload")?;
    let bytes = keys.needed("payload", bytes)?;
    keys.needed("payload", Frame::from_slice(cob_id, &bytes))
}

fn flood(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let frame = frame(keys)?;
    Ok((bus(keys)?, Kind::Bus(Disturbance::Flood(frame))))
}

/// At once, or after the next frame with `cob_id`.
fn process_stopped(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let fault = cob_id(keys)?.map_or(HostFault::ProcessStopped, HostFault::ProcessStoppedAfter);
    Ok((Target::Host, Kind::Host(fault)))
}

fn clock_set(keys: &mut Keys) -> Result<(Target, Kind), Misplaced> {
    let wall = keys.number("wall_s", 0.0..=MAX_WALL_S)?;
    let wall = Duration::from_secs_f64(keys.needed("wall_s", wall)?);
    Ok((Target::Host, Kind::Host(HostFault::ClockSet(wall))))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use crate::scenario::Scenario;

    fn read(keys: &str) -> Result<Scenario, String> {
        let text = format!("seconds = 5\n[[fault]]\nat_s = 1\n{}\n", keys.replace(", ", "\n"));
        Scenario::parse(&text).map_err(|error| error.to_string())
    }

    #[test]
    fn fault_is_read_described_and_written_again() {
        for (keys, words) in [
            ("kind = \"unplug\", joint = 3", "joint 3: unplugged"),
            ("kind = \"reset\", joint = \"all\"", "every drive: reboots by itself"),
            ("kind = \"bus_off\", device = \"switches\"", "switch box: bus-off"),
            ("kind = \"wire_cut\", joint = 1", "joint 1: wire cut before it"),
            ("kind = \"drop\", joint = 1", "joint 1: frames lost"),
            ("kind = \"drop\", joint = 1, cob_id = 0x77F", "joint 1: 77Fh lost"),
            (
                "kind = \"drop\", joint = 1, frame = \"tpdo12\", share = 0.2",
                "joint 1: tpdo12 lost, 20 %",
            ),
            (
                "kind = \"duplicate\", joint = 1, frame = \"sdo\", count = 2",
                "joint 1: sdo twice, 2 times",
            ),
            (
                "kind = \"delay\", joint = 1, frame = \"rpdo1\", delay_ms = 1.5",
                "joint 1: rpdo1 1.5 ms late",
            ),
            (
                "kind = \"corrupt\", joint = 1, frame = \"emcy\", xor = \"01\"",
                "joint 1: emcy corrupted",
            ),
            ("kind = \"freeze\", joint = 1, frame = \"sync\"", "joint 1: sync frozen"),
            ("kind = \"resize\", joint = 1, bytes = 2", "joint 1: frames of 2 bytes"),
            ("kind = \"heartbeat_stop\", joint = 1", "joint 1: heartbeat lost"),
            (
                "kind = \"impersonate\", joint = 1, by = 2",
                "joint 1: tpdo1 sent twice, once with joint 2's data",
            ),
            ("kind = \"emergency\", joint = 1, code = 0x4210", "joint 1: emergency 4210h"),
            ("kind = \"fault\", joint = 1", "joint 1: fault 0000h"),
            ("kind = \"sto\", joint = 1", "joint 1: safe torque off"),
            (
                "kind = \"torque_offset\", joint = 1, per_mille = -300",
                "joint 1: torque offset of -300 ‰",
            ),
            ("kind = \"encoder_jump\", joint = 1, by_rad = 1", "joint 1: encoder off by 1 rad (m)"),
            ("kind = \"encoder_frozen\", joint = 1", "joint 1: encoder frozen"),
            (
                "kind = \"torque_actual_scale\", joint = 1, scale = 0.5",
                "joint 1: torque actual multiplied by 0.5",
            ),
            (
                "kind = \"switch_stuck\", switch = \"deadman_b\", level = \"low\"",
                "switch box: deadman_b stuck low",
            ),
            ("kind = \"switch_bounce\", switch = \"reference\"", "switch box: reference bounces"),
            ("kind = \"foreign_sync\", bus = 1", "bus 1: foreign frame 080#"),
            ("kind = \"foreign_nmt\", command = \"reset_node\"", "bus 0: foreign frame 000#8100"),
            (
                "kind = \"foreign_frame\", cob_id = 0x203, payload = \"0F00\"",
                "bus 0: foreign frame 203#0F00",
            ),
            ("kind = \"link_loss\", for_s = 4", "link: lost"),
            ("kind = \"link_frozen\"", "link: frozen"),
            ("kind = \"sensed_force\", force_n = -inf", "link: reports a force of -inf N"),
            ("kind = \"queue_full\", bus = 1", "bus 1: transmit queue full"),
            ("kind = \"adapter_stuck\"", "bus 0: adapter stuck"),
            ("kind = \"adapter_stalled\", for_s = 0.01", "bus 0: adapter stalled"),
            ("kind = \"adapter_unplugged\"", "bus 0: adapter unplugged"),
            ("kind = \"adapter_bus_off\"", "bus 0: adapter bus-off"),
            ("kind = \"error_passive\"", "bus 0: adapter error passive"),
            ("kind = \"error_warning\"", "bus 0: adapter error warning"),
            ("kind = \"interface_down\"", "bus 0: interface down"),
            ("kind = \"flood\", cob_id = 1, payload = \"00\"", "bus 0: flooded with 001#00"),
            ("kind = \"process_stopped\", for_s = 0.3", "host: process stopped"),
            (
                "kind = \"process_stopped\", cob_id = 0x80, for_s = 0.3",
                "host: process stopped after 080h",
            ),
            ("kind = \"host_suspended\", for_s = 0.1", "host: suspended"),
            ("kind = \"clock_set\", wall_s = 7", "host: wall clock set to 7 s"),
        ] {
            let script = read(keys).unwrap();
            let [fault] = script.faults() else { panic!("{keys}") };
            assert_eq!(format!("{}: {}", fault.target, fault.kind), words);
            assert_eq!(Scenario::parse(&script.to_toml()).unwrap(), script, "{keys}");
        }
    }

    #[test]
    fn invalid_faults_are_refused_in_one_line() {
        for (keys, reason) in [
            ("joint = 3", "line 2: `fault` needs `kind`"),
            ("kind = 3", "line 4: kind must be a word, got 3"),
            ("kind = \"burn\"", "line 2: kind must be a kind of fault, got burn"),
            ("kind = \"unplug\"", "line 2: `unplug` needs `joint`"),
            ("kind = \"unplug\", joint = 7", "line 5: joint must be 1 to 6 or \"all\", got 7"),
            (
                "kind = \"unplug\", device = \"me\"",
                "line 5: device must be \"switches\", got \"me\"",
            ),
            ("kind = \"sto\", device = \"switches\"", "line 2: `sto` needs `joint`"),
            (
                "kind = \"unplug\", joint = 1, code = 3",
                "line 6: `code` does not belong to `unplug`",
            ),
            (
                "kind = \"reset\", joint = 1, for_s = 1",
                "line 6: `for_s` does not belong to `reset`",
            ),
            (
                "kind = \"unplug\", joint = 1, for_s = 4.1",
                "line 6: for_s must be within 0.001..=4, got 4.1",
            ),
            ("kind = \"unplug\", joint = 1, for_s = nan", "line 6: for_s must be within"),
            ("kind = \"drop\", joint = 1, frame = \"tpdo0\"", "line 6: frame must be tpdo1 to"),
            ("kind = \"drop\", joint = 1, frame = \"tpdo01\"", "line 6: frame must be tpdo1 to"),
            (
                "kind = \"drop\", joint = 1, frame = \"sync\", cob_id = 128",
                "line 7: `cob_id` does not belong to `drop`",
            ),
            (
                "kind = \"drop\", joint = 1, cob_id = 0x800",
                "line 6: cob_id must be 0 to 0x7FF, got 2048",
            ),
            (
                "kind = \"drop\", joint = 1, share = 1.5",
                "line 6: share must be within 0..=1, got 1.5",
            ),
            (
                "kind = \"drop\", joint = 1, share = 1, count = 1",
                "line 7: `count` does not belong to `drop`",
            ),
            ("kind = \"drop\", joint = 1, count = 0", "line 6: count must be 1 or more, got 0"),
            ("kind = \"delay\", joint = 1", "line 2: `delay` needs `delay_ms`"),
            ("kind = \"corrupt\", joint = 1, xor = \"1\"", "line 6: xor must be up to 8 bytes"),
            ("kind = \"corrupt\", joint = 1, xor = \"+1\"", "line 6: xor must be up to 8 bytes"),
            ("kind = \"foreign_nmt\"", "line 2: `foreign_nmt` needs `command`"),
            ("kind = \"link_loss\", at_s = 2", "line 5: duplicate key"),
            ("kind = \"process_stopped\"", "line 2: `process_stopped` needs `for_s`"),
            ("kind = \"clock_set\"", "line 2: `clock_set` needs `wall_s`"),
            (
                "kind = \"sensed_force\", force_n = \"x\"",
                "line 5: force_n must be a number, got \"x\"",
            ),
            (
                "kind = \"link_loss\", [[fault]], kind = \"link_loss\", at_s = 0.5",
                "line 5: at_s must be at least 1, the end of the entry before, got 0.5",
            ),
        ] {
            let error = read(keys).unwrap_err();
            assert!(error.starts_with(reason), "{error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }

    proptest! {
        #[test]
        fn any_entry_is_parsed_or_refused(
            kind in prop::sample::select(vec!["drop", "corrupt", "delay", "foreign_frame", "emergency"]),
            key in prop::sample::select(vec!["joint", "xor", "payload", "delay_ms", "code", "frame"]),
            value in prop_oneof!["\"[^\"\\\\\\n]*\"", "-?[1-9][0-9]{0,20}(\\.[0-9]+)?", "\\[\\]"],
        ) {
            drop(read(&format!("kind = \"{kind}\", {key} = {value}")));
        }
    }
}
