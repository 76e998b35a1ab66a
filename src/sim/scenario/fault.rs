//! What may break, and how: an entry `[[fault]]` of a script, checked.
//!
//! What becomes of it is in [`sim::fault`](crate::fault).

use std::fmt;
use std::time::Duration;

use canopen::frame::Channel;
use canopen::frame::Frame;
use units::numbering::Joint;

/// Something breaks, once or for a while.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// When, after the first SYNC.
    pub begins: Duration,
    /// For how long; `None` for once, or for ever.
    pub lasts: Option<Duration>,
    /// Whom it befalls.
    pub whom: Whom,
    /// What it is.
    pub kind: Kind,
}

/// Whom a fault befalls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Whom {
    /// The drive of one joint, from 1.
    Joint(Joint),
    /// Every drive.
    Drives,
    /// The switch box.
    Switches,
    /// A bus as a whole.
    Bus(Channel),
    /// The commanded side, or the way there.
    Link,
}

/// What breaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// It is off its bus.
    Cut(Cut),
    /// Something happens to some of its frames.
    Frames(Frames),
    /// Another node says what that joint's drive says, under this node's identifier.
    Impersonated {
        /// The joint, from 1, whose drive is heard twice.
        by: Joint,
        /// What it says.
        service: Service,
    },
    /// It is not well.
    Trouble(Trouble),
    /// Its drive senses what is not so.
    Sense(Sense),
    /// An input of the switch box is not what its switch is.
    Contact(Input, Contact),
    /// A stranger speaks, once or again and again.
    Stranger {
        /// What it says.
        frame: Frame,
        /// How often, if more than once.
        every: Option<Duration>,
    },
    /// The commanded side is not reached.
    Link(Link),
}

/// How a device comes to be off its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Its plug is pulled, with bus and supply: no torque, no word. Put back, it boots up.
    Plug,
    /// The bus ends before it: it and all behind it neither hear the node nor are heard.
    Wire,
    /// Its controller has left the bus; if it comes back, it tells so (8140h).
    BusOff,
}

/// What befalls a device itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// It boots up by itself.
    Reboots,
    /// It tells of an error, and nothing follows.
    Emergency {
        /// The error code.
        code: u16,
        /// The error register (1001h) it tells.
        register: u8,
    },
    /// It goes into its state Fault, and tells this error code; 0 for none.
    Fails(u16),
    /// Its safe torque off is asked for.
    SafeTorqueOff,
}

/// What a drive senses of its motor otherwise than it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sense {
    /// Its encoder is off by so much of its joint, in rad (m).
    EncoderOff(f64),
    /// Its encoder stands still.
    EncoderFrozen,
    /// So many times its torque.
    TorqueScaled(f64),
}

/// What a contact does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    /// The input is high, whatever its switch is.
    StuckHigh,
    /// It is low.
    StuckLow,
    /// It is what its switch is, and is not, by turns.
    Bounces,
}

/// How the commanded side is reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Link {
    /// As it should be.
    #[default]
    Up,
    /// What comes from it is not new any more.
    Frozen,
    /// Nothing comes from it, and nothing reaches it.
    Lost,
}

/// What happens to which frames of a device, and how often.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frames {
    /// Which.
    pub selection: Selection,
    /// What.
    pub treatment: Treatment,
    /// How often.
    pub often: Often,
}

/// Which frames of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// All it says and hears.
    All,
    /// Those of one service.
    Service(Service),
    /// Those of one identifier that it says or hears.
    CobId(u16),
}

/// A service whose identifier a device knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// A TPDO, from 1.
    Tpdo(u16),
    /// An RPDO, from 1.
    Rpdo(u16),
    /// Its emergencies.
    Emergency,
    /// Its heartbeat, its boot-up message and its answers to guarding.
    Heartbeat,
    /// Requests to its SDO server, and replies.
    Sdo,
    /// The SYNC it hears.
    Sync,
    /// The NMT commands it hears.
    Nmt,
}

/// How often something happens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Often {
    /// To every frame.
    Always,
    /// To this share of them, 0 to 1, by chance.
    Share(f64),
    /// To the first so many.
    First(u32),
}

/// What happens to a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Treatment {
    /// It is lost.
    Drop,
    /// It comes twice.
    Duplicate,
    /// It comes later.
    Delay {
        /// By so much.
        by: Duration,
        /// Whether those behind it may overtake it.
        reorders: bool,
    },
    /// These bits of its data are turned over.
    Corrupt([u8; 8]),
    /// It says what the first one said.
    Freeze,
    /// It has so many bytes, 0 to 8.
    Resize(u8),
}

/// An input of the switch box. Its bits are stated here apart from those the node reads, so that a mistake in one
/// does not cancel itself out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// High while the deadman is closed.
    DeadmanA,
    /// Low while the deadman is closed.
    DeadmanB,
    /// High while the reference is held.
    Reference,
    /// High while reflection is asked for.
    Reflection,
}

impl Input {
    /// All of them by their names.
    pub const ALL: [(&'static str, Self); 4] = [
        ("deadman_a", Self::DeadmanA),
        ("deadman_b", Self::DeadmanB),
        ("reference", Self::Reference),
        ("reflection", Self::Reflection),
    ];

    /// Its bit among the inputs.
    pub const fn bit(self) -> u8 {
        match self {
            Self::DeadmanA => 1,
            Self::DeadmanB => 1 << 1,
            Self::Reference => 1 << 2,
            Self::Reflection => 1 << 3,
        }
    }
}

impl fmt::Display for Whom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Joint(joint) => write!(f, "joint {joint}"),
            Self::Drives => f.write_str("every drive"),
            Self::Switches => f.write_str("switch box"),
            Self::Bus(Channel(bus)) => write!(f, "bus {bus}"),
            Self::Link => f.write_str("link"),
        }
    }
}

/// As in "joint 3: unplugged".
impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cut(Cut::Plug) => f.write_str("unplugged"),
            Self::Cut(Cut::Wire) => f.write_str("wire cut before it"),
            Self::Cut(Cut::BusOff) => f.write_str("bus-off"),
            Self::Frames(frames) => write!(f, "{frames}"),
            Self::Impersonated { by, service } => {
                write!(f, "{service} also comes as joint {by} says it")
            }
            Self::Trouble(trouble) => write!(f, "{trouble}"),
            Self::Sense(Sense::EncoderOff(by)) => write!(f, "encoder off by {by} rad (m)"),
            Self::Sense(Sense::EncoderFrozen) => f.write_str("encoder frozen"),
            Self::Sense(Sense::TorqueScaled(times)) => write!(f, "senses {times} of its torque"),
            Self::Contact(input, Contact::StuckHigh) => write!(f, "{input} stuck high"),
            Self::Contact(input, Contact::StuckLow) => write!(f, "{input} stuck low"),
            Self::Contact(input, Contact::Bounces) => write!(f, "{input} bounces"),
            Self::Stranger { frame, .. } => write!(f, "a stranger says {frame}"),
            Self::Link(Link::Up) => f.write_str("up"),
            Self::Link(Link::Frozen) => f.write_str("frozen"),
            Self::Link(Link::Lost) => f.write_str("lost"),
        }
    }
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Reboots => f.write_str("reboots by itself"),
            Self::Emergency { code, .. } => write!(f, "emergency {code:04X}h"),
            Self::Fails(code) => write!(f, "fault {code:04X}h"),
            Self::SafeTorqueOff => f.write_str("safe torque off"),
        }
    }
}

impl fmt::Display for Frames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.selection, self.treatment)?;
        match self.often {
            Often::Always => Ok(()),
            Often::Share(share) => write!(f, ", {} %", 100.0 * share),
            Often::First(1) => f.write_str(", once"),
            Often::First(count) => write!(f, ", {count} times"),
        }
    }
}

impl fmt::Display for Selection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str("frames"),
            Self::Service(service) => write!(f, "{service}"),
            Self::CobId(cob_id) => write!(f, "{cob_id:03X}h"),
        }
    }
}

/// As a script names it.
impl fmt::Display for Service {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tpdo(number) => write!(f, "tpdo{number}"),
            Self::Rpdo(number) => write!(f, "rpdo{number}"),
            Self::Emergency => f.write_str("emcy"),
            Self::Heartbeat => f.write_str("heartbeat"),
            Self::Sdo => f.write_str("sdo"),
            Self::Sync => f.write_str("sync"),
            Self::Nmt => f.write_str("nmt"),
        }
    }
}

impl fmt::Display for Treatment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Drop => f.write_str("lost"),
            Self::Duplicate => f.write_str("twice"),
            Self::Delay { by, .. } => write!(f, "{} ms late", by.as_secs_f64() * 1e3),
            Self::Corrupt(_) => f.write_str("corrupted"),
            Self::Freeze => f.write_str("frozen"),
            Self::Resize(bytes) => write!(f, "of {bytes} bytes"),
        }
    }
}

/// As a script names it.
impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::ALL.iter().find(|(_, input)| input == self);
        f.write_str(name.map_or("", |(name, _)| name))
    }
}
