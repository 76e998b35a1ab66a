//! Parser of `[[fault]]` entries: `at_s`, `kind`, the device, `for_s`, and the keys of the kind.

use std::time::Duration;

use canopen_rs::NmtCommand;
use canopen_rs::NodeId;
use toml::Spanned;
use toml::Value;

use crate::scenario::fault::Contact;
use crate::scenario::fault::Cut;
use crate::scenario::fault::Fault;
use crate::scenario::fault::Frames;
use crate::scenario::fault::Input;
use crate::scenario::fault::Kind;
use crate::scenario::fault::Link;
use crate::scenario::fault::Often;
use crate::scenario::fault::Selection;
use crate::scenario::fault::Sense;
use crate::scenario::fault::Service;
use crate::scenario::fault::Treatment;
use crate::scenario::fault::Trouble;
use crate::scenario::fault::Whom;
use crate::scenario::keys::Entry;
use crate::scenario::keys::Keys;
use crate::scenario::problem::MIN_DURATION;
use crate::scenario::problem::Misplaced;
use crate::scenario::problem::Problem;
use crate::scenario::problem::follows;
use canopen::frame::COB_ID_MAX;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::layout::MAX_PDOS;
use canopen::nmt::Order;
use canopen::sync;
use units::numbering::Joint;

/// Maximum delay of a frame, in ms.
const MAX_DELAY_MS: f64 = 10_000.0;

/// Minimum period of frames from an unknown station, in ms.
const MIN_PERIOD_MS: f64 = 0.1;

/// Maximum encoder offset, in rad (m).
const MAX_ENCODER_OFFSET: f64 = 1e3;

/// Reads all faults, in order of their begin; they may overlap.
pub(super) fn read_all(
    entries: Vec<Spanned<Entry>>,
    seconds: f64,
) -> Result<Vec<Fault>, Misplaced> {
    let mut begun_s = 0.0;
    let mut faults = Vec::with_capacity(entries.len());
    for entry in entries {
        let (kind, mut keys) = Keys::of(entry)?;
        let at_s = keys.number("at_s", 0.0..=seconds)?;
        let at_s = keys.needed("at_s", at_s)?;
        follows(at_s, begun_s).map_err(|problem| keys.misplaced(problem))?;
        begun_s = at_s;
        faults.push(read(&kind, at_s, seconds, &mut keys)?);
        keys.end()?;
    }
    Ok(faults)
}

fn read(kind: &str, at_s: f64, seconds: f64, keys: &mut Keys) -> Result<Fault, Misplaced> {
    let (whom, kind) = match kind {
        "unplug" => (device(keys)?, Kind::Cut(Cut::Plug)),
        "wire_cut" => (device(keys)?, Kind::Cut(Cut::Wire)),
        "bus_off" => (device(keys)?, Kind::Cut(Cut::BusOff)),
        "drop" => frames(keys, Treatment::Drop)?,
        "duplicate" => frames(keys, Treatment::Duplicate)?,
        "delay" => delay(keys)?,
        "corrupt" => corrupt(keys)?,
        "freeze" => frames(keys, Treatment::Freeze)?,
        "resize" => resize(keys)?,
        "heartbeat_stop" => (device(keys)?, heartbeat_stop()),
        "impersonate" => impersonate(keys)?,
        "reset" => (device(keys)?, Kind::Trouble(Trouble::Reboots)),
        "emergency" => emergency(keys)?,
        "fault" => (drive(keys)?, Kind::Trouble(Trouble::Fails(code(keys)?.unwrap_or(0)))),
        "sto" => (drive(keys)?, Kind::Trouble(Trouble::SafeTorqueOff)),
        "encoder_jump" => encoder_jump(keys)?,
        "encoder_frozen" => (drive(keys)?, Kind::Sense(Sense::EncoderFrozen)),
        "torque_actual_scale" => torque_actual_scale(keys)?,
        "switch_stuck" => switch_stuck(keys)?,
        "switch_bounce" => (Whom::Switches, Kind::Contact(input(keys)?, Contact::Bounces)),
        "foreign_sync" => stranger(keys, Frame::new(sync::COB_ID, []))?,
        "foreign_nmt" => foreign_nmt(keys)?,
        "foreign_frame" => foreign_frame(keys)?,
        "link_loss" => (Whom::Link, Kind::Link(Link::Lost)),
        "link_frozen" => (Whom::Link, Kind::Link(Link::Frozen)),
        unknown => {
            let (key, wanted) = ("kind", "a kind of fault");
            let value = unknown.replace('\n', " ");
            return Err(keys.misplaced(Problem::Value { key, value, wanted }));
        }
    };
    let lasts = if is_momentary(&kind) {
        None
    } else {
        keys.number("for_s", MIN_DURATION..=seconds - at_s)?.map(Duration::from_secs_f64)
    };
    Ok(Fault { begins: Duration::from_secs_f64(at_s), lasts, whom, kind })
}

/// Returns whether the fault has no duration.
const fn is_momentary(kind: &Kind) -> bool {
    match kind {
        Kind::Trouble(trouble) => match trouble {
            Trouble::Reboots | Trouble::Emergency { .. } | Trouble::Fails(_) => true,
            Trouble::SafeTorqueOff => false,
        },
        Kind::Stranger { every, .. } => every.is_none(),
        Kind::Cut(_)
        | Kind::Frames(_)
        | Kind::Impersonated { .. }
        | Kind::Sense(_)
        | Kind::Contact(..)
        | Kind::Link(_) => false,
    }
}

/// Reads `joint = 3`, `joint = "all"` or `device = "switches"`.
fn device(keys: &mut Keys) -> Result<Whom, Misplaced> {
    let switches =
        keys.word("device", "\"switches\"", |word| (word == "switches").then_some(Whom::Switches))?;
    if switches.is_some() { keys.needed("device", switches) } else { drive(keys) }
}

/// Reads `joint = 3` or `joint = "all"`.
fn drive(keys: &mut Keys) -> Result<Whom, Misplaced> {
    let read = |value: &Value| match value.as_str() {
        Some(word) => (word == "all").then_some(Whom::Drives),
        None => joint(value).map(Whom::Joint),
    };
    let whom = keys.value("joint", "1 to 6 or \"all\"", read)?;
    keys.needed("joint", whom)
}

fn joint(value: &Value) -> Option<Joint> {
    Joint::new(value.as_integer()?)
}

fn frames(keys: &mut Keys, treatment: Treatment) -> Result<(Whom, Kind), Misplaced> {
    let whom = device(keys)?;
    let service = service(keys)?.map(Selection::Service);
    let cob_id = match service {
        Some(_) => None,
        None => cob_id(keys)?.map(Selection::CobId),
    };
    let selection = service.or(cob_id).unwrap_or(Selection::All);
    Ok((whom, Kind::Frames(Frames { selection, treatment, often: often(keys)? })))
}

/// Reads a communication object, as `frame = "tpdo1"`.
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

/// Reads `share` or `count`, if one is present.
fn often(keys: &mut Keys) -> Result<Often, Misplaced> {
    if let Some(share) = keys.number("share", 0.0..=1.0)? {
        return Ok(Often::Share(share));
    }
    let count = keys.whole("count", "1 or more", |count: &u32| *count > 0)?;
    Ok(count.map_or(Often::Always, Often::First))
}

fn delay(keys: &mut Keys) -> Result<(Whom, Kind), Misplaced> {
    let by = keys.number("delay_ms", 0.0..=MAX_DELAY_MS)?;
    let by = Duration::from_secs_f64(keys.needed("delay_ms", by)? * 1e-3);
    let reorders = keys.value("reorder", "true or false", Value::as_bool)?.unwrap_or(false);
    frames(keys, Treatment::Delay { by, reorders })
}

fn corrupt(keys: &mut Keys) -> Result<(Whom, Kind), Misplaced> {
    let bytes = keys.bytes("xor")?;
    let bytes = keys.needed("xor", bytes)?;
    let mut xor = [0; 8];
    for (to, from) in xor.iter_mut().zip(bytes) {
        *to = from;
    }
    frames(keys, Treatment::Corrupt(xor))
}

fn resize(keys: &mut Keys) -> Result<(Whom, Kind), Misplaced> {
    let bytes = keys.whole("bytes", "0 to 8", |bytes: &u8| *bytes <= 8)?;
    let bytes = keys.needed("bytes", bytes)?;
    frames(keys, Treatment::Resize(bytes))
}

const fn heartbeat_stop() -> Kind {
    let selection = Selection::Service(Service::Heartbeat);
    Kind::Frames(Frames { selection, treatment: Treatment::Drop, often: Often::Always })
}

fn impersonate(keys: &mut Keys) -> Result<(Whom, Kind), Misplaced> {
    let by = keys.value("by", "1 to 6", joint)?;
    let by = keys.needed("by", by)?;
    let service = service(keys)?.unwrap_or(Service::Tpdo(1));
    Ok((device(keys)?, Kind::Impersonated { by, service }))
}

fn code(keys: &mut Keys) -> Result<Option<u16>, Misplaced> {
    keys.whole("code", "0 to 0xFFFF", |_| true)
}

fn emergency(keys: &mut Keys) -> Result<(Whom, Kind), Misplaced> {
    let code = code(keys)?;
    let code = keys.needed("code", code)?;
    let register = keys.whole("register", "0 to 0xFF", |_| true)?.unwrap_or(0);
    Ok((device(keys)?, Kind::Trouble(Trouble::Emergency { code, register })))
}

fn encoder_jump(keys: &mut Keys) -> Result<(Whom, Kind), Misplaced> {
    let by = keys.number("by_rad", -MAX_ENCODER_OFFSET..=MAX_ENCODER_OFFSET)?;
    Ok((drive(keys)?, Kind::Sense(Sense::EncoderOff(keys.needed("by_rad", by)?))))
}

fn torque_actual_scale(keys: &mut Keys) -> Result<(Whom, Kind), Misplaced> {
    let times = keys.number("scale", -10.0..=10.0)?;
    Ok((drive(keys)?, Kind::Sense(Sense::TorqueScaled(keys.needed("scale", times)?))))
}

fn input(keys: &mut Keys) -> Result<Input, Misplaced> {
    let input = keys.word("switch", "deadman_a, deadman_b, reference or reflection", |word| {
        Input::ALL.iter().find(|(name, _)| *name == word).map(|(_, input)| *input)
    })?;
    keys.needed("switch", input)
}

fn switch_stuck(keys: &mut Keys) -> Result<(Whom, Kind), Misplaced> {
    let stuck = keys.word("level", "\"high\" or \"low\"", |word| match word {
        "high" => Some(Contact::StuckHigh),
        "low" => Some(Contact::StuckLow),
        _ => None,
    })?;
    let stuck = keys.needed("level", stuck)?;
    Ok((Whom::Switches, Kind::Contact(input(keys)?, stuck)))
}

/// Reads `bus` (default 0) and `every_ms`; without that the frame is sent once.
fn stranger(keys: &mut Keys, frame: Frame) -> Result<(Whom, Kind), Misplaced> {
    let bus = keys.whole("bus", "a bus, from 0", |_: &u8| true)?.unwrap_or(0);
    let every = keys.number("every_ms", MIN_PERIOD_MS..=MAX_DELAY_MS)?;
    let every = every.map(|every| Duration::from_secs_f64(every * 1e-3));
    Ok((Whom::Bus(Channel(bus)), Kind::Stranger { frame, every }))
}

fn foreign_nmt(keys: &mut Keys) -> Result<(Whom, Kind), Misplaced> {
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
    stranger(keys, Order { command, node }.frame())
}

fn foreign_frame(keys: &mut Keys) -> Result<(Whom, Kind), Misplaced> {
    let cob_id = cob_id(keys)?;
    let cob_id = keys.needed("cob_id", cob_id)?;
    let bytes = keys.bytes("payload")?;
    let bytes = keys.needed("payload", bytes)?;
    let frame = Frame::from_slice(cob_id, &bytes);
    stranger(keys, keys.needed("payload", frame)?)
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
    fn faults_are_described_as_configured() {
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
                "joint 1: tpdo1 also comes as joint 2 says it",
            ),
            ("kind = \"emergency\", joint = 1, code = 0x4210", "joint 1: emergency 4210h"),
            ("kind = \"fault\", joint = 1", "joint 1: fault 0000h"),
            ("kind = \"sto\", joint = 1", "joint 1: safe torque off"),
            ("kind = \"encoder_jump\", joint = 1, by_rad = 1", "joint 1: encoder off by 1 rad (m)"),
            ("kind = \"encoder_frozen\", joint = 1", "joint 1: encoder frozen"),
            (
                "kind = \"torque_actual_scale\", joint = 1, scale = 0.5",
                "joint 1: senses 0.5 of its torque",
            ),
            (
                "kind = \"switch_stuck\", switch = \"deadman_b\", level = \"low\"",
                "switch box: deadman_b stuck low",
            ),
            ("kind = \"switch_bounce\", switch = \"reference\"", "switch box: reference bounces"),
            ("kind = \"foreign_sync\", bus = 1", "bus 1: a stranger says 080#"),
            ("kind = \"foreign_nmt\", command = \"reset_node\"", "bus 0: a stranger says 000#8100"),
            (
                "kind = \"foreign_frame\", cob_id = 0x203, payload = \"0F00\"",
                "bus 0: a stranger says 203#0F00",
            ),
            ("kind = \"link_loss\", for_s = 4", "link: lost"),
            ("kind = \"link_frozen\"", "link: frozen"),
        ] {
            let script = read(keys).unwrap();
            let [fault] = script.faults() else { panic!("{keys}") };
            assert_eq!(format!("{}: {}", fault.whom, fault.kind), words);
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
