//! Quirks, each with the real drives that have it.
//!
//! Sources: defaults in drive manuals, and reports by users of open-source CANopen masters.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use serde::{Deserialize, Serialize, Serializer};
use thiserror::Error;

use crate::quirks::value::{manufacturer_bit, millis, number, object, revolutions, stored};
use canopen::object::Object;

/// Generates [`Quirk`] and its names from the table. A row with a value has its default, the function that reads it
/// within its limits, and the form in which it is written.
macro_rules! quirks {
    ($(
        $(#[$doc:meta])+
        $quirk:ident $(($($field:ident: $type:ty),+))? $name:literal
        $(, default $default:literal, read $read:ident($($limit:expr),*), shown $shown:expr)?;
    )+) => {
        /// One deviation. [`NAMES`](Quirk::NAMES) lists the names used in scenarios and on the command line.
        #[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
        #[serde(try_from = "String")]
        pub enum Quirk {
            $($(#[$doc])+ $quirk $(($($type),+))?,)+
        }

        impl Quirk {
            /// Names of all quirks.
            pub const NAMES: [&'static str; [$($name),+].len()] = [$($name),+];

            /// Returns the name, without the value.
            pub const fn name(&self) -> &'static str {
                match self {
                    $(Self::$quirk { .. } => $name,)+
                }
            }
        }

        impl FromStr for Quirk {
            type Err = UnknownQuirk;

            fn from_str(text: &str) -> Result<Self, UnknownQuirk> {
                let (name, value) = text.split_once(':').map_or((text, None), |(n, v)| (n, Some(v)));
                match name {
                    $($name => quirk!(
                        $quirk $(($($field),+))? $name, value
                        $(, $default, |value| $read(value, $($limit),*))?
                    ),)+
                    _ => Err(UnknownQuirk::Name(name.to_owned())),
                }
            }
        }

        /// Writes the form that [`FromStr`] reads.
        impl fmt::Display for Quirk {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.name())?;
                match *self {
                    $(Self::$quirk $(($($field),+))? => { $(write!(f, ":{}", $shown)?;)? })+
                }
                Ok(())
            }
        }
    };
}

/// Quirk of one row with `value`, or with its default.
macro_rules! quirk {
    ($quirk:ident $name:literal, $value:ident) => {
        $value.map_or(Ok(Self::$quirk), |_| Err(UnknownQuirk::NoValue($name)))
    };
    ($quirk:ident($($field:ident),+) $name:literal, $value:ident, $default:literal, $read:expr) => {{
        let value = $value.unwrap_or($default);
        #[allow(unused_parens, reason = "a quirk has one field or several")]
        let quirk = |($($field),+)| Self::$quirk($($field),+);
        let invalid = |wanted| UnknownQuirk::Value { name: $name, wanted, value: value.to_owned() };
        $read(value).map(quirk).map_err(invalid)
    }};
}

quirks! {
    /// Confirms a write of the consumer heartbeat (1016h:1) but does not store it. Every drive ships with an
    /// empty 1016h; some firmware clears an entry written too early.
    DeafToMaster "deaf-to-master";
    /// Keeps 6007h at 0 (no action on connection loss) whatever is written. Default of several servo drives;
    /// their manuals call it "the operating point is maintained".
    KeepsTorque "keeps-torque";
    /// Stores 6007h and sends the EMCY, but keeps the last torque. Seen on positioning drives in cyclic
    /// modes that kept moving after their master had gone.
    HoldsTorque "holds-torque";
    /// Enables RPDO 2 to 4 at power-up, each with controlword and target torque, asynchronous. Common: the
    /// predefined connection set suggests all four.
    OpenRpdos "open-rpdos";
    /// Lacks the event timer of RPDOs (sub-index 5). Common in drives with fixed communication parameters.
    NoRpdoTimer "no-rpdo-timer";
    /// Delays every SDO response. Seen on gateways, and on drives that serve SDO in an idle task.
    SlowSdo(time: Duration) "slow-sdo",
        default "150", read millis(1..=10_000), shown time.as_millis();
    /// Omits the size in SDO upload responses: command bytes 42h and 40h. Legal, and common in small stacks.
    UnsizedReplies "unsized-replies";
    /// Has a read-only PDO mapping, as drives older than dynamic mapping.
    FixedMapping "fixed-mapping";
    /// Confirms a write of this object but does not store the value: firmware clips it silently, or needs a
    /// restart.
    Forgetful(object: Object) "forgetful",
        default "6072h", read object(), shown object;
    /// Is already in operation enabled with this torque, in ‰ of rated torque: the master restarted during motion, or the
    /// drive enables itself at power-up.
    RunningAtStart(torque: i16) "running-at-start",
        default "300", read number(-1_000..=1_000, " ‰ of rated torque"), shown torque;
    /// Boots late: sends no boot-up message and receives nothing for this time. Large drives boot an
    /// operating system.
    LateBoot(time: Duration) "late-boot",
        default "1500", read millis(1..=60_000), shown time.as_millis();
    /// Never sends a boot-up message, as devices older than CiA 301 version 4.
    NoBootUp "no-boot-up";
    /// Sends heartbeats at least 100 ms apart, although 1017h reads back as written: a coarse timer.
    HeartbeatLiar "heartbeat-liar";
    /// Sends an EMCY every 5 ms in pre-operational: a missing encoder or supply, reported repeatedly.
    EmcyStorm "emcy-storm";
    /// Sends every SDO response twice, as two drives with one node-id do, or a gateway that repeats.
    DoubleReplies "double-replies";
    /// Uses one SDO abort code for everything: 0800 0000h, general error.
    VagueAborts "vague-aborts";
    /// Has another product code (1018h:2): a spare part of another type.
    WrongIdentity "wrong-identity";
    /// Lacks the synchronous counter overflow (1019h), as devices older than CiA 301 version 4.1.
    NoSyncCounter "no-sync-counter";
    /// Never sends an EMCY: only the statusword shows a fault.
    QuietFault "quiet-fault";
    /// Refuses a COB-ID of a TPDO without bit 30 (no remote frames): abort 0609 0030h. Reported of motor controllers
    /// whose TPDOs have the bit by default.
    NoRtr "no-rtr";
    /// Loses one SDO upload response since power-up, the one of this number: a disturbed frame, or a gateway whose
    /// buffer was full.
    LostSdoReply(number: u32) "lost-sdo-reply",
        default "10", read number(1..=1_000_000, ""), shown number;
    /// Has 607Eh = 80h, stored by its maker's tool: positions have the other sign, torques do not.
    PolarityReversed "polarity-reversed";
    /// Sends its first SDO response since power-up after this time: its file system or encoder starts first.
    SlowFirstAnswer(time: Duration) "slow-first-answer",
        default "1500", read millis(1..=10_000), shown time.as_millis();
    /// Reports torque actual (6077h) behind a low pass of 10 ms and off by this share, in %. Current sensors and their
    /// filters do so within their makers' tolerances.
    FilteredTorque(percent: i8) "filtered-torque",
        default "5", read number(-20..=20, " %"), shown percent;
    /// Has this value in an object since before power-up: a maker's tool stored it. Low bytes count.
    Stored(object: Object, value: u32) "stored",
        default "6091h:1=2", read stored(), shown format_args!("{object}={value}");
    /// Refuses the mode (6060h) before it is operational: abort 0800 0022h. Documented for drives that take a mode only
    /// by PDO or when their application runs.
    ModeWhenOperational "mode-when-operational";
    /// Displays its mode (6061h) only when enabled, and obeys this one then, whatever 6060h says; by default it obeys
    /// 6060h. Documented for drives that adopt the mode at the transition to operation enabled.
    ModeWhenEnabled(mode: i8) "mode-when-enabled",
        default "10", read number(0..=10, ""), shown mode;
    /// Leaves a fault at the second edge of bit 7 since the fault: the first one acknowledges the message.
    TwoResetEdges "two-reset-edges";
    /// Loses one SDO download response since power-up, the one of this number. The write has taken effect.
    LostWriteReply(number: u32) "lost-write-reply",
        default "10", read number(1..=1_000_000, ""), shown number;
    /// Counts its position (6064h) from 0 at each power-up and NMT reset node, in any posture: the motor has an
    /// incremental encoder, or an absolute one whose battery is empty.
    Incremental "incremental";
    /// Has an encoder turned on its shaft by this since before power-up, in degrees (mm) of the joint: a coupling has
    /// slipped, or the motor was replaced. Of an incremental encoder only the index pulse moves.
    EncoderSlipped(degrees: f64) "encoder-slipped",
        default "20", read number(-180.0..=180.0, " ° (mm of a prismatic joint)"), shown degrees;
    /// Reports a position (6064h) off by this number of motor revolutions since power-up: its multi-turn counter was
    /// turned without battery, or its maker's tool has cleared it.
    WrongRevolution(revolutions: i8) "wrong-revolution",
        default "1", read revolutions(-100..=100), shown revolutions;
    /// Searches the index pulse in positive direction by homing methods 35 and 37, as by 34, and does not take the
    /// current position. Documented for drives whose firmware numbers its methods differently.
    HomingMoves "homing-moves";
    /// Shows in this bit of the statusword, in every mode, that a homing has completed since power-up. Makers use bits
    /// 8, 14 and 15; a fault of the feedback (73xxh) clears it.
    ReferencedBit(bit: u8) "referenced-bit",
        default "15", read manufacturer_bit(), shown bit;
}

/// Reasons to refuse the name of a quirk.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum UnknownQuirk {
    /// No quirk has this name.
    #[error("unknown quirk `{0}`; expected one of {list}", list = Quirk::NAMES.join(", "))]
    Name(String),
    /// Value of a quirk that has no parameter.
    #[error("quirk `{0}` takes no value")]
    NoValue(&'static str),
    /// Invalid value.
    #[error("value of quirk `{name}` must be {wanted}, got `{value}`")]
    Value {
        /// Name without the value: `slow-sdo`.
        name: &'static str,
        /// Values allowed.
        wanted: String,
        /// Value given.
        value: String,
    },
}

impl Quirk {
    /// Returns the object that must exist for the quirk to have an effect, with the value it stores there.
    pub const fn stores(&self) -> Option<(Object, u32)> {
        if let Self::Stored(object, value) = *self {
            return Some((object, value));
        }
        if let Self::PolarityReversed = self {
            return Some((Object::POLARITY, POSITION_REVERSED));
        }
        None
    }
}

/// Polarity (607Eh) with positions reversed.
const POSITION_REVERSED: u32 = 0x80;

impl TryFrom<String> for Quirk {
    type Error = UnknownQuirk;

    fn try_from(text: String) -> Result<Self, UnknownQuirk> {
        text.parse()
    }
}

/// Writes the form used in scenarios.
impl Serialize for Quirk {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
