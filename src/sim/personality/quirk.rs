//! One thing that is bad about a drive, and which real ones are like that.
//!
//! What is told of real drives is from their manuals' defaults and from what users of open CANopen
//! masters report.

use std::time::Duration;

use serde::Deserialize;

use canopen::object::Object;

/// What is bad. Its name, on the command line and in a scenario, stands in [`names`](Quirk::NAMES).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub enum Quirk {
    /// Watches nobody: a heartbeat to be watched for (1016h:1) is accepted and not kept. Every drive is
    /// like this out of the box; some firmware clears the entry again when it is written too early.
    DeafToMaster,
    /// Does nothing about a lost master: 6007h stays 0 whatever is written. The default of several
    /// servo drives, whose manuals call it "the operating point is maintained".
    KeepsTorque,
    /// Says it would, and does not: 6007h reads as written, the emergency comes, the last torque stays.
    /// So did positioning drives in a cyclic mode that went on after a master that no longer existed.
    HoldsTorque,
    /// RPDO 2 to 4 are on, each a controlword and a target torque that act at once. Many drives power up
    /// with all four on, as the predefined connection set suggests.
    OpenRpdos,
    /// Has no event timer of its RPDOs (sub-index 5), as many drives with a fixed set of entries.
    NoRpdoTimer,
    /// Takes so long for every SDO reply. Drives that serve SDO in their idle task do, and gateways.
    SlowSdo(Duration),
    /// Does not tell how many bytes an SDO reply holds: 42h for all, 40h for more than four. Legal, and
    /// what small stacks do.
    UnsizedReplies,
    /// Its PDO mapping cannot be changed, as in drives from before dynamic mapping.
    FixedMapping,
    /// Confirms a write to this object, and does not keep the value: a range the firmware clips without
    /// a word, or a parameter that needs a restart.
    Forgetful(Object),
    /// Is enabled and pushes with so many ‰ of rated torque when the master comes: the master was
    /// restarted in the middle of a motion, or the drive is set to start by itself.
    RunningAtStart(i16),
    /// Says its boot-up message, and hears anything at all, so much later: big drives boot an operating
    /// system.
    LateBoot(Duration),
    /// Never says that it has booted, as devices older than CiA 301 version 4.
    NoBootUp,
    /// Sends no heartbeat sooner than 100 ms after the one before, whatever 1017h says and reads: a
    /// coarse timer.
    HeartbeatLiar,
    /// Sends an emergency every 5 ms while it is pre-operational: an encoder or a supply that is not
    /// there yet, told over and over.
    EmcyStorm,
    /// Sends every SDO reply twice, as two drives of one node-id do, or a gateway that repeats.
    DoubleReplies,
    /// Refuses for one reason only, 08000000h "general error".
    VagueAborts,
    /// Is another product (1018h:2): the spare part from the shelf.
    WrongIdentity,
    /// Knows no SYNC counter (1019h), as everything older than CiA 301 version 4.1.
    NoSyncCounter,
    /// Never says an emergency: a fault is seen in the statusword or nowhere.
    QuietFault,
}
