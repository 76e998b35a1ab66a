//! The quirks, each with the real drives that have it.
//!
//! Sources: defaults in drive manuals, and reports by users of open-source CANopen masters.

use std::time::Duration;

use serde::{Deserialize, Serialize, Serializer};

use canopen::object::Object;

/// One deviation. [`NAMES`](Quirk::NAMES) lists the names used in scenarios and on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub enum Quirk {
    /// Confirms a write of the consumer heartbeat (1016h:1) but does not store it. Every drive ships with an
    /// empty 1016h; some firmware clears an entry written too early.
    DeafToMaster,
    /// Keeps 6007h at 0 (no action on connection loss) whatever is written. Default of several servo drives;
    /// their manuals call it "the operating point is maintained".
    KeepsTorque,
    /// Stores 6007h and sends the EMCY, but keeps the last torque. Seen on positioning drives in cyclic
    /// modes that kept moving after their master had gone.
    HoldsTorque,
    /// Enables RPDO 2 to 4 at power-up, each with controlword and target torque, asynchronous. Common: the
    /// predefined connection set suggests all four.
    OpenRpdos,
    /// Lacks the event timer of RPDOs (sub-index 5). Common in drives with fixed communication parameters.
    NoRpdoTimer,
    /// Delays every SDO response. Seen on gateways, and on drives that serve SDO in an idle task.
    SlowSdo(Duration),
    /// Omits the size in SDO upload responses: command bytes 42h and 40h. Legal, and common in small stacks.
    UnsizedReplies,
    /// Has a read-only PDO mapping, as drives older than dynamic mapping.
    FixedMapping,
    /// Confirms a write of this object but does not store the value: firmware clips it silently, or needs a
    /// restart.
    Forgetful(Object),
    /// Is already in operation enabled with this torque, in ‰ of rated torque: the master restarted during
    /// motion, or the drive starts by itself.
    RunningAtStart(i16),
    /// Boots late: sends no boot-up message and receives nothing for this time. Large drives boot an
    /// operating system.
    LateBoot(Duration),
    /// Never sends a boot-up message, as devices older than CiA 301 version 4.
    NoBootUp,
    /// Sends heartbeats at least 100 ms apart, although 1017h reads back as written: a coarse timer.
    HeartbeatLiar,
    /// Sends an EMCY every 5 ms in pre-operational: a missing encoder or supply, reported repeatedly.
    EmcyStorm,
    /// Sends every SDO response twice, as two drives with one node-id do, or a gateway that repeats.
    DoubleReplies,
    /// Uses one SDO abort code for everything: 0800 0000h, general error.
    VagueAborts,
    /// Has another product code (1018h:2): a spare part of another type.
    WrongIdentity,
    /// Lacks the synchronous counter overflow (1019h), as devices older than CiA 301 version 4.1.
    NoSyncCounter,
    /// Never sends an EMCY: only the statusword shows a fault.
    QuietFault,
    /// Refuses a COB-ID of a TPDO without bit 30 (no remote frames): abort 0609 0030h. Reported of motor controllers
    /// whose TPDOs have the bit by default.
    NoRtr,
    /// Loses one SDO upload response since power-up, the one of this number: a disturbed frame, or a gateway whose
    /// buffer was full.
    LostSdoReply(u32),
    /// Has 607Eh = 80h, stored by its maker's tool: positions have the other sign, torques do not.
    PolarityReversed,
    /// Sends its first SDO response since power-up after this time: its file system or encoder starts first.
    SlowFirstAnswer(Duration),
    /// Reports torque actual (6077h) behind a low pass of 10 ms and off by this share, in %: current sensors and the
    /// filters behind them, within their makers' tolerances.
    FilteredTorque(i8),
    /// Refuses the mode (6060h) before it is operational: abort 0800 0022h. Documented for drives that take a mode only
    /// by PDO or when their application runs.
    ModeWhenOperational,
    /// Displays its mode (6061h) only when enabled, and obeys this one then, whatever 6060h says; by default it obeys
    /// 6060h. Documented for drives that adopt the mode at the transition to operation enabled.
    ModeWhenEnabled(i8),
    /// Leaves a fault at the second edge of bit 7 since the fault: the first one acknowledges the message.
    TwoResetEdges,
    /// Loses one SDO download response since power-up, the one of this number. The write has taken effect.
    LostWriteReply(u32),
    /// Has this value in an object since before power-up: a maker's tool stored it. Low bytes count.
    Stored(Object, u32),
}

impl Quirk {
    /// Returns the object that must exist for the quirk to have an effect, with the value it stores there.
    pub const fn stores(&self) -> Option<(Object, u32)> {
        match *self {
            Self::Stored(object, value) => Some((object, value)),
            Self::PolarityReversed => Some((Object::POLARITY, POSITION_REVERSED)),
            Self::DeafToMaster
            | Self::KeepsTorque
            | Self::HoldsTorque
            | Self::OpenRpdos
            | Self::NoRpdoTimer
            | Self::SlowSdo(_)
            | Self::UnsizedReplies
            | Self::FixedMapping
            | Self::Forgetful(_)
            | Self::RunningAtStart(_)
            | Self::LateBoot(_)
            | Self::NoBootUp
            | Self::HeartbeatLiar
            | Self::EmcyStorm
            | Self::DoubleReplies
            | Self::VagueAborts
            | Self::WrongIdentity
            | Self::NoSyncCounter
            | Self::QuietFault
            | Self::NoRtr
            | Self::LostSdoReply(_)
            | Self::SlowFirstAnswer(_)
            | Self::FilteredTorque(_)
            | Self::ModeWhenOperational
            | Self::ModeWhenEnabled(_)
            | Self::TwoResetEdges
            | Self::LostWriteReply(_) => None,
        }
    }
}

/// Polarity (607Eh) with positions reversed.
const POSITION_REVERSED: u32 = 0x80;

/// The name used in scenarios.
impl Serialize for Quirk {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
