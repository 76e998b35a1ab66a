//! JSON output of `decode`: one object per line.

use std::fmt::Write as _;
use std::io::{self, Write};

use serde_json::to_writer;

use crate::decode::meaning::Meaning;
use crate::decode::timestamps::GoesBack;
use ::replay::recorder_line::RecorderLine;
use canopen::drive::{Controlword, State, Statusword};
use canopen::object::Object;
use canopen_tools::candump::{Content, Line, NotALine};
use canopen_tools::decode::Message;
use canopen_tools::decode::sdo::{Action, Step};
use canopen_tools::object_text::{Command, Switches};
use canopen_tools::signals::{PdoFrame, Signal};

/// Writes a line that is not a candump line.
pub(super) fn plain(
    number: u64,
    raw: &[u8],
    error: Option<NotALine>,
    to: &mut impl Write,
) -> io::Result<()> {
    write!(to, "{{\"line\":{number},\"raw\":")?;
    to_writer(&mut *to, &String::from_utf8_lossy(raw))?;
    if let Some(error) = error {
        write!(to, ",\"error\":\"{error}\"")?;
    }
    to.write_all(b"}\n")
}

/// Writes a frame with its meaning.
pub(super) fn frame(
    number: u64,
    nanos: Option<u64>,
    line: &Line<'_>,
    meaning: &Meaning<'_>,
    back: Option<GoesBack>,
    scratch: &mut String,
    to: &mut impl Write,
) -> io::Result<()> {
    write!(to, "{{\"line\":{number}")?;
    if let Some(nanos) = nanos {
        write!(to, ",\"t\":{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000)?;
    }
    to.write_all(b",\"interface\":")?;
    to_writer(&mut *to, line.interface)?;
    let width = if line.is_extended { 8 } else { 3 };
    write!(to, ",\"id\":\"{:0width$X}\"", line.id)?;
    match &line.content {
        Content::Data(data) | Content::Fd(_, data) | Content::Error(data) => {
            to.write_all(b",\"data\":\"")?;
            hex(data, to)?;
            to.write_all(b"\"")?;
        }
        Content::Remote(_) => {}
    }
    if let Some(dlc) = line.raw_dlc {
        write!(to, ",\"dlc\":{dlc}")?;
    }
    match meaning {
        Meaning::Frame(annotation) => {
            write!(to, ",\"kind\":\"{}\"", annotation.kind())?;
            text("name", &annotation.name(), scratch, to)?;
            if let Some(who) = &annotation.who {
                text("node", who, scratch, to)?;
            }
            text("text", annotation, scratch, to)?;
            message(&annotation.message, to)?;
        }
        Meaning::RecorderLine(pseudo) => {
            write!(to, ",\"kind\":\"{}\"", pseudo.name())?;
            cycle(pseudo, to)?;
        }
        Meaning::Error(error) => {
            to.write_all(b",\"kind\":\"error frame\"")?;
            text("text", error, scratch, to)?;
        }
        Meaning::Other(kind) => write!(to, ",\"kind\":\"{kind}\"")?,
    }
    remarks(meaning, back, to)?;
    to.write_all(b"}\n")
}

/// Writes the anomalies of a line.
fn remarks(meaning: &Meaning<'_>, back: Option<GoesBack>, to: &mut impl Write) -> io::Result<()> {
    let mut lead = ",\"remarks\":[";
    if let Some(back) = back {
        write!(to, "{lead}\"{back}\"")?;
        lead = ",";
    }
    if let Meaning::Frame(annotation) = meaning {
        for remark in annotation.remarks() {
            write!(to, "{lead}\"{remark}\"")?;
            lead = ",";
        }
    }
    to.write_all(if lead == "," { b"]" } else { b"" })
}

/// Writes a string member.
fn text(
    key: &str,
    value: &impl std::fmt::Display,
    scratch: &mut String,
    to: &mut impl Write,
) -> io::Result<()> {
    scratch.clear();
    // Writing into a String cannot fail.
    write!(scratch, "{value}").ok();
    write!(to, ",\"{key}\":")?;
    to_writer(to, scratch.trim())?;
    Ok(())
}

fn hex(data: &[u8], to: &mut impl Write) -> io::Result<()> {
    let digit = |value: u8| if value < 10 { b'0' + value } else { b'A' - 10 + value };
    data.iter().try_for_each(|byte| to.write_all(&[digit(byte >> 4), digit(byte & 0xF)]))
}

/// Writes a number in the shortest form that is read as the same number; integers without a decimal point.
fn number(value: f64, to: &mut impl Write) -> io::Result<()> {
    // Most joints rest, and their zero needs no search for digits.
    let is_zero = value.to_bits() == 0;
    if is_zero { to.write_all(b"0") } else { write!(to, "{value}") }
}

/// Writes the members specific to the kind of frame.
fn message(message: &Message<'_>, to: &mut impl Write) -> io::Result<()> {
    match message {
        Message::Pdo(frame, data, length) => signals(frame, *data, *length, to),
        Message::Sync { period: Some(period), jitter_us, .. } => {
            write!(to, ",\"period_us\":{}", period.as_micros())?;
            jitter_us.map_or(Ok(()), |jitter| write!(to, ",\"jitter_us\":{jitter}"))
        }
        Message::Sdo(step) => sdo(step, to),
        Message::Emergency(emergency) => {
            write!(to, ",\"code\":{},\"register\":{}", emergency.code, emergency.register)
        }
        Message::Heartbeat(state, change) => {
            let state = canopen_tools::decode::text::state_name(*state);
            write!(to, ",\"state\":\"{state}\",\"is_new\":{}", change.is_some())
        }
        Message::Sync { .. }
        | Message::Nmt(_)
        | Message::Time(_)
        | Message::OtherPdo(..)
        | Message::Lss(_)
        | Message::Malformed(_)
        | Message::Unknown => Ok(()),
    }
}

fn sdo(step: &Step<'_>, to: &mut impl Write) -> io::Result<()> {
    let Some(object) = step.object else { return Ok(()) };
    write!(to, ",\"object\":\"{object}\"")?;
    let (action, value) = match &step.action {
        Action::RequestUpload => ("ask to read", None),
        Action::RequestDownload(value) => ("ask to write", Some(value)),
        Action::Begin(_) | Action::Part(..) => ("part", None),
        Action::Read(value) => ("read", Some(value)),
        Action::Written(value) => ("written", Some(value)),
        Action::Aborted(code) => {
            write!(to, ",\"abort\":{}", code.0)?;
            ("aborted", None)
        }
        Action::Stray => ("stray", None),
    };
    write!(to, ",\"act\":\"{action}\"")?;
    let Some(value) = value else { return Ok(()) };
    write!(to, ",\"length\":{},\"value\":\"", value.length)?;
    hex(value.bytes, to)?;
    to.write_all(b"\"")
}

/// Writes the signals of a PDO by name.
fn signals(frame: &PdoFrame, data: [u8; 8], length: usize, to: &mut impl Write) -> io::Result<()> {
    let mut lead = ",\"signals\":{";
    for signal in frame.signals.iter().filter(|signal| signal.is_in(length)) {
        to.write_all(lead.as_bytes())?;
        lead = ",";
        value(signal, signal.raw(data), to)?;
    }
    to.write_all(if lead == "," { b"}" } else { b"" })
}

fn value(signal: &Signal, raw: i64, to: &mut impl Write) -> io::Result<()> {
    let name = &signal.name;
    if let Some(measure) = &signal.measure {
        write!(to, "\"{name}\":")?;
        number(measure.value(raw), to)?;
        let Some(curve) = &measure.curve else { return Ok(()) };
        write!(to, ",\"{name}_at_{}\":", curve.place)?;
        return number(curve.at(raw), to);
    }
    write!(to, "\"{name}\":{raw}")?;
    let [low, high, ..] = raw.to_le_bytes();
    let word = u16::from_le_bytes([low, high]);
    match signal.object {
        Object::STATUSWORD => {
            let state = Statusword(word).state().map_or("unknown", State::description);
            write!(to, ",\"{name}_state\":\"{state}\"")
        }
        Object::CONTROLWORD => {
            write!(to, ",\"{name}_command\":\"{}\"", Command(Controlword(word)))
        }
        Object::DIGITAL_INPUTS => {
            let switches = Switches(low);
            let inputs = switches.inputs();
            write!(to, ",\"{name}_deadman\":\"{}\"", switches.deadman())?;
            write!(to, ",\"{name}_reference\":{}", inputs.reference)?;
            write!(to, ",\"{name}_reflection\":{}", inputs.reflection)
        }
        _ => Ok(()),
    }
}

fn cycle(pseudo: &RecorderLine, to: &mut impl Write) -> io::Result<()> {
    match pseudo {
        RecorderLine::Wrench(numbers) => {
            to.write_all(b",\"f_s\":")?;
            to_writer(to, numbers)?;
            Ok(())
        }
        RecorderLine::Cycle { mode, inputs, sampled, number } => {
            write!(to, ",\"cycle\":{number},\"mode\":\"{mode}\",\"sampled\":{sampled}")?;
            let Some(switches) = inputs else { return Ok(()) };
            let inputs = switches.inputs();
            write!(to, ",\"deadman\":\"{}\"", switches.deadman())?;
            write!(to, ",\"reference\":{}", inputs.reference)?;
            write!(to, ",\"reflection\":{}", inputs.reflection)
        }
    }
}
