//! Text of annotations: name, content and remarks.

use std::fmt;

use canopen_rs::NmtState;

use crate::decode::bus_monitor::{Change, Remark};
use crate::decode::lss::Clock;
use crate::decode::sdo::{Action, Side, Step, Value};
use crate::decode::{Annotation, Message, Who};
use crate::fixed::FixedDecimal;
use crate::object_text::{self, Command, ObjectText, Status, Switches, ValueText};
use crate::signals::{ACTUATOR_POSITION, PdoFrame, Signal};
use canopen::drive::{Controlword, Statusword};
use canopen::layout::Direction;
pub use canopen::nmt::description as state_name;
use canopen::object::Object;

/// `elbow`, `node 3`
impl fmt::Display for Who<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Named(name) => f.write_str(name),
            Self::Node(node) => write!(f, "node {node}"),
        }
    }
}

/// Kind and node of a frame: `TPDO1_elbow`, `SDO elbow`, `SYNC`
#[derive(Clone, Copy, Debug)]
pub struct Name<'a, 'd>(pub(super) &'a Annotation<'d>);

impl fmt::Display for Name<'_, '_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Annotation { message, who, .. } = self.0;
        if let Message::Pdo(frame, ..) = message {
            return f.write_str(&frame.name);
        }
        f.write_str(match message {
            Message::Nmt(_) => "NMT",
            Message::Sync { .. } => "SYNC",
            Message::Time(_) => "TIME",
            Message::Emergency(_) => "EMCY",
            Message::OtherPdo(Direction::Transmit, _) => "TPDO",
            Message::OtherPdo(Direction::Receive, _) => "RPDO",
            Message::Sdo(_) => "SDO",
            Message::Heartbeat(..) => "heartbeat",
            Message::Lss(_) => "LSS",
            Message::Malformed(_) => "malformed",
            Message::Pdo(..) | Message::Unknown => "unknown",
        })?;
        if let Message::OtherPdo(_, number) = message {
            write!(f, "{number}")?;
        }
        who.map_or(Ok(()), |who| write!(f, " {who}"))
    }
}

impl fmt::Display for Annotation<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.message {
            Message::Nmt(order) => write!(f, "{order}"),
            Message::Sync { counter, period, jitter_us } => {
                counter.map_or(Ok(()), |counter| write!(f, "counter {counter} "))?;
                period.map_or(Ok(()), |period| write!(f, "{} µs", period.as_micros()))?;
                jitter_us.map_or(Ok(()), |jitter| write!(f, " {jitter:+}"))
            }
            Message::Time(time) => write!(f, "{}", Clock(*time)),
            Message::Emergency(emergency) => write!(f, "{emergency}"),
            Message::Pdo(frame, data, length) => pdo(frame, *data, *length, self, f),
            Message::OtherPdo(..) if self.member.is_some() => f.write_str("off in this layout"),
            Message::OtherPdo(..) | Message::Unknown => Ok(()),
            Message::Sdo(step) => self.sdo(step, f),
            Message::Heartbeat(state, change) => heartbeat(*state, *change, f),
            Message::Lss(lss) => write!(f, "{lss}"),
            Message::Malformed(expected) => write!(f, "not {expected}"),
        }
    }
}

impl<'d> Annotation<'d> {
    /// Kind and node of the frame: `TPDO1_elbow`, `SDO elbow`, `SYNC`
    pub const fn name(&self) -> Name<'_, 'd> {
        Name(self)
    }

    /// Kind of the frame in one word.
    pub const fn kind(&self) -> &'static str {
        match self.message {
            Message::Nmt(_) => "nmt",
            Message::Sync { .. } => "sync",
            Message::Time(_) => "time",
            Message::Emergency(_) => "emcy",
            Message::Pdo(..) | Message::OtherPdo(..) => "pdo",
            Message::Sdo(_) => "sdo",
            Message::Heartbeat(..) => "heartbeat",
            Message::Lss(_) => "lss",
            Message::Malformed(_) => "malformed",
            Message::Unknown => "unknown",
        }
    }

    /// Remarks on the frame.
    pub fn remarks(&self) -> impl Iterator<Item = RemarkText<'_, 'd>> {
        self.remarks.iter().map(|remark| RemarkText { remark, of: self })
    }

    /// Returns whether the frame needs attention: an emergency, an SDO abort, a drive fault, an invalid frame.
    pub fn is_alarming(&self) -> bool {
        match &self.message {
            Message::Emergency(emergency) => !emergency.is_reset(),
            Message::Sdo(step) => matches!(step.action, Action::Aborted(_)),
            Message::Pdo(frame, data, length) => frame.signals.iter().any(|signal| {
                signal.object == Object::STATUSWORD
                    && signal.is_in(*length)
                    && signal.raw(*data) & i64::from(Statusword::FAULT) != 0
            }),
            Message::Malformed(_) => true,
            Message::Nmt(_)
            | Message::Sync { .. }
            | Message::Time(_)
            | Message::OtherPdo(..)
            | Message::Heartbeat(..)
            | Message::Lss(_)
            | Message::Unknown => false,
        }
    }

    /// Returns whether the frame concerns a member: sent or received by it, or with a remark on it.
    pub fn is_about(&self, member: usize) -> bool {
        let is_in =
            |frame: &PdoFrame| frame.senders.contains(&member) || frame.receivers.contains(&member);
        let is_remarked = self.remarks.iter().any(|remark| match remark {
            Remark::Missing(frame) => self.decoder.frames.get(*frame).is_some_and(is_in),
            Remark::Silent(node, _) => {
                let network = self.decoder.networks.get(self.network);
                network.and_then(|network| network.member(*node)) == Some(member)
            }
            Remark::SyncGap(_) | Remark::Late(_) | Remark::Length(_) => false,
        });
        let shared = match &self.message {
            Message::Pdo(frame, ..) => is_in(frame),
            Message::Nmt(order) => {
                let node = self.decoder.members.get(member).map(|member| member.node());
                order.node.is_none() || order.node == node
            }
            Message::Sync { .. }
            | Message::Time(_)
            | Message::Emergency(_)
            | Message::OtherPdo(..)
            | Message::Sdo(_)
            | Message::Heartbeat(..)
            | Message::Lss(_)
            | Message::Malformed(_)
            | Message::Unknown => false,
        };
        is_remarked || shared || self.member == Some(member)
    }

    fn sdo(&self, step: &Step<'_>, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match step.side {
            Side::Client => "→ ",
            Side::Server => "← ",
        })?;
        let Some(object) = step.object else { return f.write_str("of an unknown transfer") };
        let member = self.member.and_then(|member| self.decoder.members.get(member));
        let described = member.and_then(|member| member.eds.as_ref()?.object(object));
        let called = ObjectText { object, fallback: described.map(|it| it.name.as_str()) };
        let else_type = described.map(|described| described.data_type);
        match &step.action {
            Action::RequestUpload => write!(f, "read {called}"),
            Action::RequestDownload(value) => {
                write!(f, "write {called} = {}", value.text(object, else_type))
            }
            Action::Begin(None) => write!(f, "{called}, in pieces"),
            Action::Begin(Some(length)) => write!(f, "{called}, {length} bytes in pieces"),
            Action::Part(done, None) => write!(f, "{called}, {done} bytes"),
            Action::Part(done, Some(all)) => write!(f, "{called}, {done} of {all} bytes"),
            Action::Read(value) => {
                write!(f, "{called} = {}{}", value.text(object, else_type), Cut(*value))
            }
            Action::Written(value) => {
                write!(f, "written {called} = {}{}", value.text(object, else_type), Cut(*value))
            }
            Action::Aborted(code) => {
                f.write_str(if step.side == Side::Client { "broken off " } else { "refused " })?;
                write!(f, "{called}: {code}")
            }
            Action::Stray => Ok(()),
        }
    }
}

impl<'t> Value<'t> {
    const fn text(&self, object: Object, fallback_type: Option<u16>) -> ValueText<'t> {
        ValueText { object, bytes: self.bytes, length: self.length, fallback_type }
    }
}

/// Note on a value whose length differs from the indicated size.
struct Cut<'t>(Value<'t>);

impl fmt::Display for Cut<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Value { length, announced, .. } = self.0;
        announced.map_or(Ok(()), |announced| write!(f, " ({length} of {announced} bytes)"))
    }
}

fn heartbeat(state: NmtState, change: Option<Change>, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    match change {
        None => Ok(()),
        Some(Change::BootUp) => f.write_str("boot-up"),
        Some(Change::First) => f.write_str(state_name(state)),
        Some(Change::From(before)) => {
            write!(f, "{}, was {}", state_name(state), state_name(before))
        }
        Some(Change::Back(silent)) => {
            write!(f, "{}, back after {} ms", state_name(state), silent.as_millis())
        }
    }
}

/// Writes every signal in a column, with its node if there are several.
fn pdo(
    frame: &PdoFrame,
    data: [u8; 8],
    length: usize,
    of: &Annotation<'_>,
    f: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    let is_shared = frame.is_shared();
    let common = frame.common_units().filter(|_| is_shared);
    let mut separator = "";
    for signal in frame.signals.iter().filter(|signal| signal.is_in(length)) {
        f.write_str(separator)?;
        separator = "  ";
        if is_shared {
            let member = of.decoder.members.get(signal.member);
            write!(f, "{} ", member.map_or("?", |member| member.name.as_str()))?;
        }
        if signal.is_disputed {
            f.write_str("(disputed) ")?;
        }
        let raw = signal.raw(data);
        match (common, signal.measured()) {
            (Some(_), Some((measure, curve))) => {
                let [motor, joint] = [measure.value(raw), curve.at(raw)].map(torque);
                write!(f, "{motor} /{joint}")?;
            }
            (None, _) | (_, None) => value(signal, raw, f)?,
        }
    }
    common.map_or(Ok(()), |[motor, joint]| {
        if motor == joint { write!(f, "  {motor}") } else { write!(f, "  {motor} / {joint}") }?;
        f.write_str(" motor / joint")
    })
}

/// Returns a torque or force for its column.
const fn torque(value: f64) -> FixedDecimal {
    FixedDecimal::new(value, 8, 4)
}

/// Width of the longest state.
const STATE: usize = 22;

fn value(signal: &Signal, raw: i64, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    if let Some((measure, curve)) = signal.measured() {
        let (value, unit) = (torque(measure.value(raw)), measure.unit);
        let (at, place) = (torque(curve.at(raw)), curve.place);
        return write!(f, "{value} {unit} motor {at} {} {place}", curve.unit);
    }
    if let Some(measure) = &signal.measure {
        let place = if measure.quantity == ACTUATOR_POSITION { " actuator" } else { "" };
        return write!(
            f,
            "{} {}{place}",
            FixedDecimal::new(measure.value(raw), 9, 5),
            measure.unit
        );
    }
    let [low, high, ..] = raw.to_le_bytes();
    let word = u16::from_le_bytes([low, high]);
    match signal.object {
        Object::STATUSWORD => write!(f, "{:STATE$}", Status(Statusword(word))),
        Object::CONTROLWORD => write!(f, "{:STATE$}", Command(Controlword(word))),
        Object::MODE_DISPLAY | Object::MODE_OF_OPERATION => {
            f.write_str(object_text::mode_of_operation(i8::from_le_bytes([low])))
        }
        Object::DIGITAL_INPUTS => write!(f, "{}", Switches(low)),
        object => {
            write!(f, "{} {raw}", ObjectText { object, fallback: None })
        }
    }
}

/// Text of a remark: `TPDO1_elbow missing`, `912 µs after SYNC`
#[derive(Clone, Copy, Debug)]
pub struct RemarkText<'a, 'd> {
    remark: &'a Remark,
    of: &'a Annotation<'d>,
}

impl fmt::Display for RemarkText<'_, '_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Annotation { decoder, network, .. } = self.of;
        match self.remark {
            Remark::SyncGap(periods) => write!(f, "SYNC gap of {periods} periods"),
            Remark::Missing(frame) => {
                let name = decoder.frames.get(*frame).map_or("a PDO", |frame| frame.name.as_str());
                write!(f, "{name} missing")
            }
            Remark::Late(after) => write!(f, "{} µs after SYNC", after.as_micros()),
            Remark::Silent(node, silent) => {
                let who = decoder.who(*network, *node);
                write!(f, "no heartbeat of {who} for {} ms", silent.as_millis())
            }
            Remark::Length(mapped) => write!(f, "{mapped} bytes are mapped"),
        }
    }
}
