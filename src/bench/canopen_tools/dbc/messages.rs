//! Messages of a network's DBC file: PDOs of the effective layout, and the services of every CANopen bus.

use thiserror::Error;

use crate::dbc::{Database, Field, Message, Number};
use crate::object_text::{self, Command};
use crate::signals::{self, ACTUATOR_POSITION, Member, PdoFrame, Signal};
use canopen::drive::{Controlword, State, Statusword};
use canopen::object::Object;
use canopen::{error_codes, nmt, sync};

/// Messages of the master itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Master {
    /// Node-id in its heartbeat.
    pub node: u8,
    /// SYNC period, in µs.
    pub period_us: u32,
    /// Producer heartbeat time, in ms.
    pub heartbeat_ms: u32,
}

/// Error of two buses that do not fit one file.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{id:03X}h is {first} on one bus and {second} on another")]
pub struct Collision {
    /// Identifier of both frames.
    pub id: u32,
    /// Meaning on one bus.
    pub first: String,
    /// Meaning on another bus.
    pub second: String,
}

/// Returns the database of `members`, on one bus or several.
///
/// # Errors
/// Returns an error for an identifier with two meanings.
pub fn database(members: &[Member], master: &Master) -> Result<Database, Collision> {
    let mut nodes = vec![(MASTER.to_owned(), "the node that runs the hand controller".to_owned())];
    nodes.extend(members.iter().map(|member| {
        let comment = format!("{}, node-id {}", member.plan.name, member.node().raw());
        (member.name.clone(), comment)
    }));
    let mut messages = vec![nmt_command(members), sync(master)];
    messages.push(heartbeat(MASTER, master.node, master.heartbeat_ms));
    messages.extend(signals::frames(members).iter().map(|frame| pdo(frame, members, master)));
    for member in members {
        let node = member.node().raw();
        messages.push(emergency(member));
        let period_ms = u32::from(member.plan.error_control.period_ms());
        messages.push(heartbeat(&member.name, node, period_ms));
        messages.extend(sdo(&member.name, node));
    }
    messages.sort_by_key(|message| message.id);
    for (first, second) in messages.iter().zip(messages.iter().skip(1)) {
        if first.id == second.id {
            let names = (first.name.clone(), second.name.clone());
            return Err(Collision { id: first.id, first: names.0, second: names.1 });
        }
    }
    Ok(Database { nodes, messages })
}

/// Name of the master.
const MASTER: &str = "master";

fn to_master() -> Vec<String> {
    vec![MASTER.to_owned()]
}

/// Unsigned field without scale and unit.
fn number(name: &str, start: u16, bits: u16) -> Field {
    let most = (1_u128 << bits) - 1;
    let most = u32::try_from(most).map_or(0.0, f64::from);
    Field { name: name.to_owned(), start, bits, range: [0.0, most], ..Field::default() }
}

fn nmt_command(members: &[Member]) -> Message {
    let commands = vec![
        (1, "start"),
        (2, "stop"),
        (128, "enter pre-operational"),
        (129, "reset node"),
        (130, "reset communication"),
    ];
    let receivers: Vec<_> = members.iter().map(|member| member.name.clone()).collect();
    let command =
        Field { values: commands, receivers: receivers.clone(), ..number("command", 0, 8) };
    let node = Field { values: vec![(0, "every node")], receivers, ..number("node", 8, 8) };
    message(nmt::COB_ID, "NMT", 2, MASTER, vec![command, node], "starts, stops and resets nodes")
}

fn sync(master: &Master) -> Message {
    let cycle_ms = Some(master.period_us.div_ceil(1_000));
    let comment =
        format!("every {} us: drives sample, and act on the targets before it", master.period_us);
    Message { cycle_ms, ..message(sync::COB_ID, "SYNC", 0, MASTER, Vec::new(), &comment) }
}

fn heartbeat(name: &str, node: u8, period_ms: u32) -> Message {
    let states = vec![(0, "boot-up"), (4, "stopped"), (5, "operational"), (127, "pre-operational")];
    let state = Field { values: states, receivers: watchers(name), ..number("state", 0, 8) };
    let cob_id = 0x700 + u16::from(node);
    let message = message(cob_id, &format!("Heartbeat_{name}"), 1, name, vec![state], "");
    Message { cycle_ms: Some(period_ms), ..message }
}

fn watchers(name: &str) -> Vec<String> {
    if name == MASTER { Vec::new() } else { to_master() }
}

fn emergency(member: &Member) -> Message {
    let codes = error_codes::all().map(|(code, text)| (i64::from(code), text)).collect();
    let mut fields = vec![Field { values: codes, ..number("error_code", 0, 16) }];
    let classes = [
        ("generic", 16),
        ("current", 17),
        ("voltage", 18),
        ("temperature", 19),
        ("communication", 20),
        ("profile", 21),
        ("manufacturer", 23),
    ];
    fields.extend(classes.map(|(name, bit)| number(name, bit, 1)));
    fields.push(number("manufacturer_bytes", 24, 40));
    for field in &mut fields {
        field.receivers = to_master();
    }
    let name = format!("EMCY_{}", member.name);
    let comment = "an error that has come or, with code 0, gone; the register has all there are";
    message(member.plan.emcy_cob_id, &name, 8, &member.name, fields, comment)
}

fn sdo(name: &str, node: u8) -> [Message; 2] {
    let requests = vec![
        (0x23, "write 4 bytes"),
        (0x27, "write 3 bytes"),
        (0x2B, "write 2 bytes"),
        (0x2F, "write 1 byte"),
        (0x21, "write in segments"),
        (0x40, "read"),
        (0x60, "next segment"),
        (0x70, "next segment, toggled"),
        (0x80, "abort"),
    ];
    let responses = vec![
        (0x43, "read 4 bytes"),
        (0x47, "read 3 bytes"),
        (0x4B, "read 2 bytes"),
        (0x4F, "read 1 byte"),
        (0x41, "read in segments"),
        (0x60, "written"),
        (0x20, "segment written"),
        (0x30, "segment written, toggled"),
        (0x80, "abort"),
    ];
    let fields = |values: Vec<(i64, &'static str)>, receiver: &str| {
        let command = Field { values, ..number("command", 0, 8) };
        let rest =
            [number("object_index", 8, 16), number("sub_index", 24, 8), number("value", 32, 32)];
        let fields = [command].into_iter().chain(rest);
        fields.map(|field| Field { receivers: vec![receiver.to_owned()], ..field }).collect()
    };
    let comment = "segments carry seven bytes of the value behind the command; an abort carries its code as value";
    let (request, response) = (format!("SDO_request_{name}"), format!("SDO_response_{name}"));
    let (requests, responses) = (fields(requests, name), fields(responses, MASTER));
    [
        message(0x600 + u16::from(node), &request, 8, MASTER, requests, comment),
        message(0x580 + u16::from(node), &response, 8, name, responses, comment),
    ]
}

fn message(
    cob_id: u16,
    name: &str,
    bytes: usize,
    sender: &str,
    fields: Vec<Field>,
    comment: &str,
) -> Message {
    Message {
        id: u32::from(cob_id),
        format: super::Format::Standard,
        name: name.to_owned(),
        bytes,
        sender: sender.to_owned(),
        comment: comment.to_owned(),
        cycle_ms: None,
        fields,
    }
}

fn pdo(frame: &PdoFrame, members: &[Member], master: &Master) -> Message {
    let names = |places: &[usize]| -> Vec<String> {
        let name = |place: &usize| members.get(*place).map(|member| member.name.clone());
        let names: Vec<_> = places.iter().filter_map(name).collect();
        if names.is_empty() { to_master() } else { names }
    };
    let receivers = names(&frame.receivers);
    let mut fields = Vec::new();
    let mut comment = frame.transmission.to_string();
    for signal in &frame.signals {
        if signal.is_disputed {
            comment.push_str(&format!("; {} is on bits of another: ", signal.name));
            comment.push_str(&format!("{} bits from {}", signal.bits, signal.start));
            continue;
        }
        // Each receiver of a shared RPDO takes its own signals.
        let is_from_master = frame.senders.is_empty();
        let takers = if is_from_master { names(&[signal.member]) } else { receivers.clone() };
        fields.extend(
            parts(signal).into_iter().map(|field| Field { receivers: takers.clone(), ..field }),
        );
    }
    let syncs = frame.transmission.syncs().filter(|_| frame.transmission.0 != 0);
    let by_sync = syncs.map(|syncs| (master.period_us * u32::from(syncs)).div_ceil(1_000));
    let cycle_ms = by_sync.or(frame.event_timer_ms.map(u32::from));
    let sender = names(&frame.senders).into_iter().next().unwrap_or_else(|| MASTER.to_owned());
    let message = message(frame.cob_id, &frame.name, frame.bytes, &sender, fields, &comment);
    Message { cycle_ms, ..message }
}

/// Splits bit fields into signals.
fn parts(signal: &Signal) -> Vec<Field> {
    // Name of the object, its fields, and the explained one: place, values and comment.
    let (object, named, (place, values, comment)) = match (signal.object, signal.bits) {
        (Object::STATUSWORD, 16) => {
            let comment = "bits 0 to 6 of the statusword: the state, and bit 4, voltage";
            ("statusword", STATUS, (0, states(), comment))
        }
        (Object::CONTROLWORD, 16) => {
            ("controlword", CONTROL, (0, commands(), "bits 0 to 3 of the controlword"))
        }
        (Object::DIGITAL_INPUTS, 8) => {
            let comment = "antivalent: clear while the deadman is pressed";
            ("digital_inputs", INPUTS, (1, Vec::new(), comment))
        }
        (Object::MODE_DISPLAY | Object::MODE_OF_OPERATION, _) => {
            let modes = (-1..=11_i8).filter(|mode| *mode != 5);
            let values = modes.map(|mode| (i64::from(mode), object_text::mode_of_operation(mode)));
            return vec![Field { values: values.collect(), ..scaled(signal) }];
        }
        _ => return vec![scaled(signal)],
    };
    let stem = signal.name.strip_suffix(object).unwrap_or(&signal.name);
    let field = |(name, bit, bits): &(&str, u16, u16)| {
        number(&format!("{stem}{name}"), u16::from(signal.start) + bit, *bits)
    };
    let mut fields: Vec<Field> = named.iter().map(field).collect();
    if let Some(explained) = fields.get_mut(place) {
        (explained.values, explained.comment) = (values, comment.to_owned());
    }
    fields
}

/// Field of a signal, with its scale, unit and range if it has a measure.
fn scaled(signal: &Signal) -> Field {
    let plain = number(&signal.name, u16::from(signal.start), u16::from(signal.bits));
    let plain = if signal.is_signed {
        Field { number: Number::Signed, range: [0.0; 2], ..plain }
    } else {
        plain
    };
    let Some(measure) = &signal.measure else {
        return Field { comment: signal.object.to_string(), ..plain };
    };
    let mut comment = signal.object.to_string();
    if let Some(curve) = &measure.curve {
        comment.push_str(" of the motor; the torque of the ");
        comment.push_str(curve.place);
        comment.push_str(" is on the calibrated curve, which is no straight line");
    } else if measure.quantity == ACTUATOR_POSITION {
        comment.push_str(" of the actuator; the joints are coupled");
    }
    Field {
        step: measure.step,
        offset: measure.offset(),
        range: measure.range.unwrap_or_default(),
        unit: measure.unit,
        comment,
        ..plain
    }
}

/// Fields of a statusword: name, first bit, bits.
const STATUS: &[(&str, u16, u16)] = &[
    ("state", 0, 7),
    ("warning", 7, 1),
    ("manufacturer_8", 8, 1),
    ("remote", 9, 1),
    ("target_reached", 10, 1),
    ("internal_limit", 11, 1),
    ("target_followed", 12, 1),
    ("mode_13", 13, 1),
    ("manufacturer_14", 14, 2),
];

/// Fields of a controlword.
const CONTROL: &[(&str, u16, u16)] = &[
    ("command", 0, 4),
    ("mode_4", 4, 3),
    ("fault_reset", 7, 1),
    ("halt", 8, 1),
    ("mode_9", 9, 1),
    ("manufacturer_11", 11, 5),
];

/// Fields of the switch box's inputs.
const INPUTS: &[(&str, u16, u16)] =
    &[("deadman_a", 0, 1), ("deadman_b", 1, 1), ("reference", 2, 1), ("reflection", 3, 1)];

/// States with their values of bits 0 to 6 of the statusword.
fn states() -> Vec<(i64, &'static str)> {
    let named =
        |bits: u16| Some((i64::from(bits), Statusword(bits).state().map(State::description)?));
    (0..128).filter_map(named).collect()
}

/// Commands with their values of bits 0 to 3 of the controlword.
fn commands() -> Vec<(i64, &'static str)> {
    (0..16).map(|bits| (i64::from(bits), Command(Controlword(bits)).description())).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::signals::tests::{grouped, per_drive};
    use canopen::frame::Channel;

    const THE_MASTER: Master = Master { node: 127, period_us: 1_000, heartbeat_ms: 5 };

    fn messages(members: &[Member]) -> Vec<Message> {
        database(members, &THE_MASTER).unwrap().messages
    }

    #[test]
    fn fields_of_a_message_are_disjoint_and_unique() {
        let mut disputed = grouped();
        disputed[1].plan.pdos[0] = disputed[0].plan.pdos[0].clone();
        for members in [per_drive(), grouped(), disputed] {
            for message in messages(&members) {
                let mut bits = HashSet::new();
                let mut names = HashSet::new();
                for field in &message.fields {
                    assert!(names.insert(&field.name), "{}: {}", message.name, field.name);
                    for bit in field.start..field.start + field.bits {
                        assert!(bits.insert(bit), "{}: bit {bit}", message.name);
                        assert!(usize::from(bit) < 8 * message.bytes, "{}", message.name);
                    }
                }
            }
        }
    }

    #[test]
    fn shared_frame_lists_its_receivers() {
        let all = messages(&grouped());
        let torques = all.iter().find(|message| message.name == "RPDO1_group1").unwrap();
        assert_eq!((torques.id, torques.bytes, torques.cycle_ms), (0x201, 6, Some(1)));
        let takers: Vec<_> = torques.fields.iter().map(|field| field.receivers.join(",")).collect();
        assert_eq!(takers, ["shoulder", "elbow", "wrist"]);
    }

    #[test]
    fn every_state_pattern_has_its_name() {
        let states = states();
        for bits in 0..128_u16 {
            let named = states.iter().find(|(value, _)| *value == i64::from(bits));
            let state = Statusword(bits).state().map(State::description);
            assert_eq!(named.map(|(_, text)| *text), state);
        }
        assert_eq!(commands().len(), 16);
    }

    #[test]
    fn two_buses_share_a_file_unless_identifiers_collide() {
        let mut members = per_drive();
        members[0].channel = Channel(1);
        assert!(database(&members, &THE_MASTER).is_ok());
        let twin = Member { name: "twin".to_owned(), channel: Channel(1), ..members[1].clone() };
        members.push(twin);
        let collision = database(&members, &THE_MASTER).unwrap_err();
        let message = "082h is EMCY_elbow on one bus and EMCY_twin on another";
        assert_eq!(collision.to_string(), message);
    }
}
