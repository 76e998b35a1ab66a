//! Names of quirks: `slow-sdo`, or `slow-sdo:300` with a value.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

use thiserror::Error;

use crate::quirks::Quirk;
use canopen::drive::CYCLIC_SYNCHRONOUS_TORQUE;
use canopen::object::Object;

/// Reasons to refuse the name of a quirk.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum UnknownQuirk {
    /// No quirk has this name.
    #[error("unknown quirk `{0}`; expected one of {list}", list = Quirk::NAMES.join(", "))]
    Name(String),
    /// The quirk has no parameter.
    #[error("quirk `{0}` takes no value")]
    NoValue(&'static str),
    /// The value is not a number within its limits.
    #[error("value of quirk `{name}` must be within {low}..={high}{unit}, got `{value}`")]
    Number {
        /// Name of the quirk.
        name: &'static str,
        /// Value given.
        value: String,
        /// Lower limit.
        low: i32,
        /// Upper limit.
        high: i32,
        /// Unit, with a space before it.
        unit: &'static str,
    },
    /// The value is not an object with a number.
    #[error(
        "value of quirk `{name}` must be an object and a number such as 6091h:1=2 or 607Eh=0x80, got `{value}`"
    )]
    Stored {
        /// Name of the quirk.
        name: &'static str,
        /// Value given.
        value: String,
    },
    /// The value is not an object.
    #[error("value of quirk `{name}` must be an object such as 6072h or 1016h:1, got `{value}`")]
    Object {
        /// Name of the quirk.
        name: &'static str,
        /// Value given.
        value: String,
    },
}

impl Quirk {
    /// Names of all quirks.
    pub const NAMES: [&'static str; 29] = [
        DEAF_TO_MASTER,
        KEEPS_TORQUE,
        HOLDS_TORQUE,
        OPEN_RPDOS,
        NO_RPDO_TIMER,
        SLOW_SDO,
        UNSIZED_REPLIES,
        FIXED_MAPPING,
        FORGETFUL,
        RUNNING_AT_START,
        LATE_BOOT,
        NO_BOOT_UP,
        HEARTBEAT_LIAR,
        EMCY_STORM,
        DOUBLE_REPLIES,
        VAGUE_ABORTS,
        WRONG_IDENTITY,
        NO_SYNC_COUNTER,
        QUIET_FAULT,
        NO_RTR,
        LOST_SDO_REPLY,
        POLARITY_REVERSED,
        SLOW_FIRST_ANSWER,
        FILTERED_TORQUE,
        STORED,
        MODE_WHEN_OPERATIONAL,
        MODE_WHEN_ENABLED,
        TWO_RESET_EDGES,
        LOST_WRITE_REPLY,
    ];

    /// Returns the name, without the value.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::DeafToMaster => DEAF_TO_MASTER,
            Self::KeepsTorque => KEEPS_TORQUE,
            Self::HoldsTorque => HOLDS_TORQUE,
            Self::OpenRpdos => OPEN_RPDOS,
            Self::NoRpdoTimer => NO_RPDO_TIMER,
            Self::SlowSdo(_) => SLOW_SDO,
            Self::UnsizedReplies => UNSIZED_REPLIES,
            Self::FixedMapping => FIXED_MAPPING,
            Self::Forgetful(_) => FORGETFUL,
            Self::RunningAtStart(_) => RUNNING_AT_START,
            Self::LateBoot(_) => LATE_BOOT,
            Self::NoBootUp => NO_BOOT_UP,
            Self::HeartbeatLiar => HEARTBEAT_LIAR,
            Self::EmcyStorm => EMCY_STORM,
            Self::DoubleReplies => DOUBLE_REPLIES,
            Self::VagueAborts => VAGUE_ABORTS,
            Self::WrongIdentity => WRONG_IDENTITY,
            Self::NoSyncCounter => NO_SYNC_COUNTER,
            Self::QuietFault => QUIET_FAULT,
            Self::NoRtr => NO_RTR,
            Self::LostSdoReply(_) => LOST_SDO_REPLY,
            Self::PolarityReversed => POLARITY_REVERSED,
            Self::SlowFirstAnswer(_) => SLOW_FIRST_ANSWER,
            Self::FilteredTorque(_) => FILTERED_TORQUE,
            Self::Stored(..) => STORED,
            Self::ModeWhenOperational => MODE_WHEN_OPERATIONAL,
            Self::ModeWhenEnabled(_) => MODE_WHEN_ENABLED,
            Self::TwoResetEdges => TWO_RESET_EDGES,
            Self::LostWriteReply(_) => LOST_WRITE_REPLY,
        }
    }

    /// Returns the quirk of this name, with its default value.
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            DEAF_TO_MASTER => Self::DeafToMaster,
            KEEPS_TORQUE => Self::KeepsTorque,
            HOLDS_TORQUE => Self::HoldsTorque,
            OPEN_RPDOS => Self::OpenRpdos,
            NO_RPDO_TIMER => Self::NoRpdoTimer,
            SLOW_SDO => Self::SlowSdo(Duration::from_millis(150)),
            UNSIZED_REPLIES => Self::UnsizedReplies,
            FIXED_MAPPING => Self::FixedMapping,
            FORGETFUL => Self::Forgetful(Object::MAX_TORQUE),
            RUNNING_AT_START => Self::RunningAtStart(300),
            LATE_BOOT => Self::LateBoot(Duration::from_millis(1_500)),
            NO_BOOT_UP => Self::NoBootUp,
            HEARTBEAT_LIAR => Self::HeartbeatLiar,
            EMCY_STORM => Self::EmcyStorm,
            DOUBLE_REPLIES => Self::DoubleReplies,
            VAGUE_ABORTS => Self::VagueAborts,
            WRONG_IDENTITY => Self::WrongIdentity,
            NO_SYNC_COUNTER => Self::NoSyncCounter,
            QUIET_FAULT => Self::QuietFault,
            NO_RTR => Self::NoRtr,
            LOST_SDO_REPLY => Self::LostSdoReply(10),
            POLARITY_REVERSED => Self::PolarityReversed,
            SLOW_FIRST_ANSWER => Self::SlowFirstAnswer(Duration::from_millis(1_500)),
            FILTERED_TORQUE => Self::FilteredTorque(5),
            STORED => Self::Stored(Object::GEAR_MOTOR_REVOLUTIONS, 2),
            MODE_WHEN_OPERATIONAL => Self::ModeWhenOperational,
            MODE_WHEN_ENABLED => Self::ModeWhenEnabled(CYCLIC_SYNCHRONOUS_TORQUE),
            TWO_RESET_EDGES => Self::TwoResetEdges,
            LOST_WRITE_REPLY => Self::LostWriteReply(10),
            _ => return None,
        })
    }

    /// Returns this quirk with another value.
    fn with_value(self, value: &str) -> Result<Self, UnknownQuirk> {
        let name = self.name();
        let millis = |value: i32| Duration::from_millis(value.unsigned_abs().into());
        match self {
            Self::SlowSdo(_) => number(name, value, SLOW_MS, " ms").map(millis).map(Self::SlowSdo),
            Self::LateBoot(_) => {
                number(name, value, LATE_MS, " ms").map(millis).map(Self::LateBoot)
            }
            Self::RunningAtStart(_) => {
                let torque = number(name, value, TORQUE, " ‰ of rated torque")?;
                Ok(Self::RunningAtStart(i16::try_from(torque).unwrap_or(0)))
            }
            Self::Forgetful(_) => {
                let wrong = || UnknownQuirk::Object { name, value: value.to_owned() };
                object(value).map(Self::Forgetful).ok_or_else(wrong)
            }
            Self::LostSdoReply(_) => {
                let reply = number(name, value, REPLY, "")?;
                Ok(Self::LostSdoReply(reply.unsigned_abs()))
            }
            Self::LostWriteReply(_) => {
                let reply = number(name, value, REPLY, "")?;
                Ok(Self::LostWriteReply(reply.unsigned_abs()))
            }
            Self::ModeWhenEnabled(_) => {
                let mode = number(name, value, MODE, "")?;
                Ok(Self::ModeWhenEnabled(i8::try_from(mode).unwrap_or(0)))
            }
            Self::SlowFirstAnswer(_) => {
                number(name, value, SLOW_MS, " ms").map(millis).map(Self::SlowFirstAnswer)
            }
            Self::FilteredTorque(_) => {
                let percent = number(name, value, TORQUE_ERROR, " %")?;
                Ok(Self::FilteredTorque(i8::try_from(percent).unwrap_or(0)))
            }
            Self::Stored(..) => {
                let wrong = || UnknownQuirk::Stored { name, value: value.to_owned() };
                stored(value).map(|(object, value)| Self::Stored(object, value)).ok_or_else(wrong)
            }
            Self::DeafToMaster
            | Self::KeepsTorque
            | Self::HoldsTorque
            | Self::OpenRpdos
            | Self::NoRpdoTimer
            | Self::UnsizedReplies
            | Self::FixedMapping
            | Self::NoBootUp
            | Self::HeartbeatLiar
            | Self::EmcyStorm
            | Self::DoubleReplies
            | Self::VagueAborts
            | Self::WrongIdentity
            | Self::NoSyncCounter
            | Self::QuietFault
            | Self::NoRtr
            | Self::PolarityReversed
            | Self::ModeWhenOperational
            | Self::TwoResetEdges => Err(UnknownQuirk::NoValue(name)),
        }
    }
}

impl FromStr for Quirk {
    type Err = UnknownQuirk;

    fn from_str(text: &str) -> Result<Self, UnknownQuirk> {
        let (name, value) = text.split_once(':').map_or((text, None), |(n, v)| (n, Some(v)));
        let quirk = Self::from_name(name).ok_or_else(|| UnknownQuirk::Name(name.to_owned()))?;
        value.map_or(Ok(quirk), |value| quirk.with_value(value))
    }
}

impl TryFrom<String> for Quirk {
    type Error = UnknownQuirk;

    fn try_from(text: String) -> Result<Self, UnknownQuirk> {
        text.parse()
    }
}

/// Writes the form that [`FromStr`] reads.
impl fmt::Display for Quirk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        match self {
            Self::SlowSdo(time) | Self::LateBoot(time) | Self::SlowFirstAnswer(time) => {
                write!(f, ":{}", time.as_millis())
            }
            Self::LostSdoReply(reply) | Self::LostWriteReply(reply) => write!(f, ":{reply}"),
            Self::Stored(object, value) => write!(f, ":{object}={value}"),
            Self::RunningAtStart(torque) => write!(f, ":{torque}"),
            Self::FilteredTorque(percent) => write!(f, ":{percent}"),
            Self::ModeWhenEnabled(mode) => write!(f, ":{mode}"),
            Self::Forgetful(object) => write!(f, ":{object}"),
            Self::DeafToMaster
            | Self::KeepsTorque
            | Self::HoldsTorque
            | Self::OpenRpdos
            | Self::NoRpdoTimer
            | Self::UnsizedReplies
            | Self::FixedMapping
            | Self::NoBootUp
            | Self::HeartbeatLiar
            | Self::EmcyStorm
            | Self::DoubleReplies
            | Self::VagueAborts
            | Self::WrongIdentity
            | Self::NoSyncCounter
            | Self::QuietFault
            | Self::NoRtr
            | Self::PolarityReversed
            | Self::ModeWhenOperational
            | Self::TwoResetEdges => Ok(()),
        }
    }
}

fn number(
    name: &'static str,
    value: &str,
    bounds: RangeInclusive<i32>,
    unit: &'static str,
) -> Result<i32, UnknownQuirk> {
    let (low, high) = (*bounds.start(), *bounds.end());
    let wrong = || UnknownQuirk::Number { name, value: value.to_owned(), low, high, unit };
    value.parse().ok().filter(|number| bounds.contains(number)).ok_or_else(wrong)
}

/// Parses an object in the form that [`Object`] displays.
fn object(text: &str) -> Option<Object> {
    let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
    let digits = index.strip_suffix('h').filter(|digits| digits.len() == 4)?;
    let is_hex = digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let index = is_hex.then(|| u16::from_str_radix(digits, 16).ok()).flatten()?;
    Some(Object { index, sub: sub.parse().ok()? })
}

/// Parses an object and its value: decimal, with `0x`, or hexadecimal with the suffix `h` of CiA 301.
fn stored(text: &str) -> Option<(Object, u32)> {
    let (name, value) = text.split_once('=')?;
    let value = match value.strip_prefix("0x").or_else(|| value.strip_suffix('h')) {
        Some(digits) if digits.bytes().all(|digit| digit.is_ascii_hexdigit()) => {
            u32::from_str_radix(digits, 16).ok()?
        }
        Some(_) => return None,
        None => value.parse().ok()?,
    };
    Some((object(name)?, value))
}

/// Range of the response delay of `slow-sdo` and `slow-first-answer`, in ms.
const SLOW_MS: RangeInclusive<i32> = 1..=10_000;
/// Range of the boot delay of `late-boot`, in ms.
const LATE_MS: RangeInclusive<i32> = 1..=60_000;
/// Range of the number of the response that `lost-sdo-reply` loses.
const REPLY: RangeInclusive<i32> = 1..=1_000_000;
/// Range of the torque of `running-at-start`, in ‰ of rated torque.
const TORQUE: RangeInclusive<i32> = -1_000..=1_000;

/// Range of the error of torque actual of `filtered-torque`, in %.
const TORQUE_ERROR: RangeInclusive<i32> = -20..=20;
/// Range of a mode of operation.
const MODE: RangeInclusive<i32> = 0..=10;

const DEAF_TO_MASTER: &str = "deaf-to-master";
const KEEPS_TORQUE: &str = "keeps-torque";
const HOLDS_TORQUE: &str = "holds-torque";
const OPEN_RPDOS: &str = "open-rpdos";
const NO_RPDO_TIMER: &str = "no-rpdo-timer";
const SLOW_SDO: &str = "slow-sdo";
const UNSIZED_REPLIES: &str = "unsized-replies";
const FIXED_MAPPING: &str = "fixed-mapping";
const FORGETFUL: &str = "forgetful";
const RUNNING_AT_START: &str = "running-at-start";
const LATE_BOOT: &str = "late-boot";
const NO_BOOT_UP: &str = "no-boot-up";
const HEARTBEAT_LIAR: &str = "heartbeat-liar";
const EMCY_STORM: &str = "emcy-storm";
const DOUBLE_REPLIES: &str = "double-replies";
const VAGUE_ABORTS: &str = "vague-aborts";
const WRONG_IDENTITY: &str = "wrong-identity";
const NO_SYNC_COUNTER: &str = "no-sync-counter";
const QUIET_FAULT: &str = "quiet-fault";
const NO_RTR: &str = "no-rtr";
const LOST_SDO_REPLY: &str = "lost-sdo-reply";
const POLARITY_REVERSED: &str = "polarity-reversed";
const SLOW_FIRST_ANSWER: &str = "slow-first-answer";
const FILTERED_TORQUE: &str = "filtered-torque";
const STORED: &str = "stored";
const MODE_WHEN_OPERATIONAL: &str = "mode-when-operational";
const MODE_WHEN_ENABLED: &str = "mode-when-enabled";
const TWO_RESET_EDGES: &str = "two-reset-edges";
const LOST_WRITE_REPLY: &str = "lost-write-reply";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quirks_survive_display_and_parse() {
        for name in Quirk::NAMES {
            let quirk: Quirk = name.parse().unwrap();
            assert_eq!(quirk.name(), name);
            assert_eq!(quirk.to_string().parse(), Ok(quirk));
        }
        for text in [
            "slow-sdo:1",
            "late-boot:60000",
            "running-at-start:-250",
            "forgetful:1016h:1",
            "lost-sdo-reply:7",
            "slow-first-answer:4000",
            "filtered-torque:-5",
            "mode-when-enabled:8",
            "lost-write-reply:7",
            "stored:6076h=176000",
            "stored:60A8h=4282449920",
        ] {
            assert_eq!(text.parse::<Quirk>().unwrap().to_string(), text);
        }
        assert_eq!("stored:607Eh=0x80".parse(), Ok(Quirk::Stored(Object::POLARITY, 0x80)));
        let unit = Quirk::Stored(Object::POSITION_UNIT, 0xFF41_0000);
        assert_eq!("stored:60A8h=FF410000h".parse(), Ok(unit));
        assert_eq!("forgetful:6007h".parse(), Ok(Quirk::Forgetful(Object::ABORT_CONNECTION)));
    }

    #[test]
    fn unknown_or_invalid_quirks_are_refused_in_one_line() {
        for (text, words) in [
            ("evil", "unknown quirk `evil`; expected one of deaf-to-master, keeps-torque, "),
            ("", "unknown quirk ``"),
            ("Slow-SDO", "unknown quirk `Slow-SDO`"),
            ("open-rpdos:3", "quirk `open-rpdos` takes no value"),
            ("slow-sdo:0", "value of quirk `slow-sdo` must be within 1..=10000 ms, got `0`"),
            (
                "slow-sdo:150ms",
                "value of quirk `slow-sdo` must be within 1..=10000 ms, got `150ms`",
            ),
            (
                "running-at-start:1001",
                "value of quirk `running-at-start` must be within -1000..=1000 ‰ of rated torque, got",
            ),
            (
                "forgetful:6072",
                "value of quirk `forgetful` must be an object such as 6072h or 1016h:1, got `6072`",
            ),
            ("forgetful:+072h", "value of quirk `forgetful` must be an object"),
            ("forgetful:1016h:256", "value of quirk `forgetful` must be an object"),
            ("lost-sdo-reply:0", "value of quirk `lost-sdo-reply` must be within 1..=1000000, got"),
            ("no-rtr:1", "quirk `no-rtr` takes no value"),
            (
                "stored:6091h:1",
                "value of quirk `stored` must be an object and a number such as 6091h:1=2 or",
            ),
            ("stored:6091=2", "value of quirk `stored` must be an object and a number"),
            ("stored:6091h:1=0x+2", "value of quirk `stored` must be an object and a number"),
            ("stored:6091h:1=5000000000", "value of quirk `stored` must be an object and a num"),
        ] {
            let error = text.parse::<Quirk>().unwrap_err().to_string();
            assert!(error.starts_with(words), "{error}");
            assert_eq!(error.lines().count(), 1);
        }
    }
}
