//! What master and slaves say to each other, byte for byte (CiA 305).
//!
//! Numbers are little-endian from byte 1 on. `n` is the place of a [`Part`].
//!
//! | first byte | request                        | bytes 1 …                       | reply                        |
//! |------------|--------------------------------|---------------------------------|------------------------------|
//! | 04h        | switch state global            | mode                            | –                            |
//! | 11h        | configure node-id              | node-id                         | 11h, error, specific error   |
//! | 13h        | configure bit timing           | table, place in it              | 13h, error, specific error   |
//! | 15h        | activate bit timing            | delay in ms, 16 bits            | –                            |
//! | 17h        | store configuration            |                                 | 17h, error, specific error   |
//! | 40h + n    | switch state selective         | number                          | 44h after the fourth         |
//! | 46h – 4Bh  | identify remote slave          | number                          | 4Fh after the sixth          |
//! | 4Ch        | identify non-configured slave  |                                 | 50h                          |
//! | 51h        | fastscan                       | number, bit, part, next part    | 4Fh                          |
//! | 5Ah + n    | inquire identity               |                                 | 5Ah + n, number              |
//! | 5Eh        | inquire node-id                |                                 | 5Eh, node-id                 |

use std::fmt;

use crate::frame::Frame;
use crate::lss::Part;
use crate::lss::REPLY_COB_ID;
use crate::lss::REQUEST_COB_ID;

const SWITCH_GLOBAL: u8 = 0x04;
const CONFIGURE_NODE_ID: u8 = 0x11;
const CONFIGURE_BIT_TIMING: u8 = 0x13;
const ACTIVATE_BIT_TIMING: u8 = 0x15;
const STORE: u8 = 0x17;
const SELECT: u8 = 0x40;
const SELECTED: u8 = 0x44;
const IDENTIFY_REMOTE: u8 = 0x46;
const IDENTIFY_NON_CONFIGURED: u8 = 0x4C;
const IDENTIFIED: u8 = 0x4F;
const NON_CONFIGURED: u8 = 0x50;
const FASTSCAN: u8 = 0x51;
const INQUIRE: u8 = 0x5A;
const INQUIRE_NODE_ID: u8 = 0x5E;

/// The two states of a slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// It can be found, not set.
    Waiting,
    /// It is asked and set.
    Configuration,
}

/// One of the six conditions of an identification, in the order they are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// This vendor-ID.
    Vendor,
    /// This product code.
    Product,
    /// At least this revision number.
    LowestRevision,
    /// At most this revision number.
    HighestRevision,
    /// At least this serial number.
    LowestSerial,
    /// At most this serial number.
    HighestSerial,
}

impl Condition {
    /// All of them, in order.
    pub const ALL: [Self; 6] = [
        Self::Vendor,
        Self::Product,
        Self::LowestRevision,
        Self::HighestRevision,
        Self::LowestSerial,
        Self::HighestSerial,
    ];
}

/// One question of a [fastscan](crate::lss::fastscan).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Probe {
    /// What the number may be.
    pub number: u32,
    /// The lowest bit that must agree; [`EVERYBODY`](Self::EVERYBODY) asks who is there at all.
    pub bit: u8,
    /// Which number, by its place.
    pub part: u8,
    /// Which is asked for next, by its place: all that has been asked is said when it comes first again.
    pub next: u8,
}

impl Probe {
    /// In place of a bit: every unconfigured slave answers, and begins anew.
    pub const EVERYBODY: u8 = 0x80;
}

/// What the master says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Every slave changes its state.
    SwitchGlobal(Mode),
    /// A quarter of an address: the slave of all four enters configuration.
    Select(Part, u32),
    /// The node-id from now on, as LSS writes it.
    ConfigureNodeId(u8),
    /// The bit rate from its activation on.
    ConfigureBitTiming {
        /// Which table, [`STANDARD_TABLE`](crate::lss::STANDARD_TABLE) for that of CiA.
        table: u8,
        /// Which place in it.
        index: u8,
    },
    /// The bit rate changes after this delay in ms, and for as long again nobody speaks.
    ActivateBitTiming(u16),
    /// Node-id and bit rate outlast a loss of power.
    Store,
    /// What one number of the identity is.
    Inquire(Part),
    /// What the node-id is.
    InquireNodeId,
    /// A sixth of a description: all slaves that fit all six answer.
    IdentifyRemote(Condition, u32),
    /// All slaves without a node-id answer.
    IdentifyNonConfigured,
    /// All slaves without a node-id that a number fits answer.
    Fastscan(Probe),
}

impl Request {
    /// The frame that says it.
    pub fn frame(self) -> Frame {
        let bytes = match self {
            Self::SwitchGlobal(mode) => {
                [SWITCH_GLOBAL, u8::from(mode == Mode::Configuration)].padded()
            }
            Self::Select(part, number) => numbered(SELECT + part.place(), number),
            Self::ConfigureNodeId(node) => [CONFIGURE_NODE_ID, node].padded(),
            Self::ConfigureBitTiming { table, index } => {
                [CONFIGURE_BIT_TIMING, table, index].padded()
            }
            Self::ActivateBitTiming(delay) => {
                let [low, high] = delay.to_le_bytes();
                [ACTIVATE_BIT_TIMING, low, high].padded()
            }
            Self::Store => [STORE].padded(),
            Self::Inquire(part) => [INQUIRE + part.place()].padded(),
            Self::InquireNodeId => [INQUIRE_NODE_ID].padded(),
            Self::IdentifyRemote(condition, number) => {
                let before = Condition::ALL.into_iter().take_while(|one| *one != condition);
                numbered(before.fold(IDENTIFY_REMOTE, |code, _| code + 1), number)
            }
            Self::IdentifyNonConfigured => [IDENTIFY_NON_CONFIGURED].padded(),
            Self::Fastscan(Probe { number, bit, part, next }) => {
                let [n0, n1, n2, n3] = number.to_le_bytes();
                [FASTSCAN, n0, n1, n2, n3, bit, part, next]
            }
        };
        Frame::new(REQUEST_COB_ID, bytes)
    }

    /// Reads a request, `None` if the frame is none.
    pub fn decode(frame: &Frame) -> Option<Self> {
        if frame.cob_id != REQUEST_COB_ID {
            return None;
        }
        let &[command, a, b, c, d, bit, part, next] = frame.data() else { return None };
        let number = u32::from_le_bytes([a, b, c, d]);
        Some(match command {
            SWITCH_GLOBAL if a == 0 => Self::SwitchGlobal(Mode::Waiting),
            SWITCH_GLOBAL if a == 1 => Self::SwitchGlobal(Mode::Configuration),
            CONFIGURE_NODE_ID => Self::ConfigureNodeId(a),
            CONFIGURE_BIT_TIMING => Self::ConfigureBitTiming { table: a, index: b },
            ACTIVATE_BIT_TIMING => Self::ActivateBitTiming(u16::from_le_bytes([a, b])),
            STORE => Self::Store,
            SELECT..SELECTED => Self::Select(Part::at(command - SELECT)?, number),
            IDENTIFY_REMOTE..IDENTIFY_NON_CONFIGURED => {
                let place = usize::from(command - IDENTIFY_REMOTE);
                Self::IdentifyRemote(*Condition::ALL.get(place)?, number)
            }
            IDENTIFY_NON_CONFIGURED => Self::IdentifyNonConfigured,
            FASTSCAN => Self::Fastscan(Probe { number, bit, part, next }),
            INQUIRE..INQUIRE_NODE_ID => Self::Inquire(Part::at(command - INQUIRE)?),
            INQUIRE_NODE_ID => Self::InquireNodeId,
            _ => return None,
        })
    }
}

/// As it reads in a sentence: `configure node-id`, `inquire serial number`.
impl fmt::Display for Request {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SwitchGlobal(_) => f.write_str("switch state global"),
            Self::Select(..) => f.write_str("switch state selective"),
            Self::ConfigureNodeId(_) => f.write_str("configure node-id"),
            Self::ConfigureBitTiming { .. } => f.write_str("configure bit timing"),
            Self::ActivateBitTiming(_) => f.write_str("activate bit timing"),
            Self::Store => f.write_str("store configuration"),
            Self::Inquire(part) => write!(f, "inquire {part}"),
            Self::InquireNodeId => f.write_str("inquire node-id"),
            Self::IdentifyRemote(..) => f.write_str("identify remote slave"),
            Self::IdentifyNonConfigured => f.write_str("identify non-configured slave"),
            Self::Fastscan(_) => f.write_str("fastscan"),
        }
    }
}

/// Whether something was configured, and if not, why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// 0 for done.
    pub error: u8,
    /// The manufacturer's own, where `error` is [`SPECIFIC`](Self::SPECIFIC).
    pub specific: u8,
}

impl Answer {
    /// It is done.
    pub const DONE: Self = Self { error: 0, specific: 0 };
    /// Node-id out of range; bit timing, or storing, not supported.
    pub const REFUSED: Self = Self { error: 1, specific: 0 };
    /// Storing failed.
    pub const NO_ACCESS: Self = Self { error: 2, specific: 0 };
    /// `error` for which the manufacturer has his own number.
    pub const SPECIFIC: u8 = 0xFF;
}

/// What a slave answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reply {
    /// The address is its own, and it is in configuration.
    Selected,
    /// To a node-id.
    NodeIdConfigured(Answer),
    /// To a bit rate.
    BitTimingConfigured(Answer),
    /// To being told to store.
    Stored(Answer),
    /// One number of its identity.
    Inquired(Part, u32),
    /// Its node-id, as LSS writes it.
    NodeId(u8),
    /// What was described or probed fits.
    Identified,
    /// It has no node-id.
    NonConfigured,
}

impl Reply {
    /// The frame that says it.
    pub fn frame(self) -> Frame {
        let answer = |command, Answer { error, specific }| [command, error, specific].padded();
        let bytes = match self {
            Self::Selected => [SELECTED].padded(),
            Self::NodeIdConfigured(to) => answer(CONFIGURE_NODE_ID, to),
            Self::BitTimingConfigured(to) => answer(CONFIGURE_BIT_TIMING, to),
            Self::Stored(to) => answer(STORE, to),
            Self::Inquired(part, number) => numbered(INQUIRE + part.place(), number),
            Self::NodeId(node) => [INQUIRE_NODE_ID, node].padded(),
            Self::Identified => [IDENTIFIED].padded(),
            Self::NonConfigured => [NON_CONFIGURED].padded(),
        };
        Frame::new(REPLY_COB_ID, bytes)
    }

    /// Reads a reply, `None` if the frame is none.
    pub fn decode(frame: &Frame) -> Option<Self> {
        if frame.cob_id != REPLY_COB_ID {
            return None;
        }
        let &[command, a, b, c, d, ..] = frame.data() else { return None };
        let answer = Answer { error: a, specific: b };
        Some(match command {
            SELECTED => Self::Selected,
            CONFIGURE_NODE_ID => Self::NodeIdConfigured(answer),
            CONFIGURE_BIT_TIMING => Self::BitTimingConfigured(answer),
            STORE => Self::Stored(answer),
            INQUIRE..INQUIRE_NODE_ID => {
                Self::Inquired(Part::at(command - INQUIRE)?, u32::from_le_bytes([a, b, c, d]))
            }
            INQUIRE_NODE_ID => Self::NodeId(a),
            IDENTIFIED => Self::Identified,
            NON_CONFIGURED => Self::NonConfigured,
            _ => return None,
        })
    }

    /// Whether it is what `request` asks for.
    pub fn answers(self, request: Request) -> bool {
        match self {
            Self::Selected => matches!(request, Request::Select(..)),
            Self::NodeIdConfigured(_) => matches!(request, Request::ConfigureNodeId(_)),
            Self::BitTimingConfigured(_) => matches!(request, Request::ConfigureBitTiming { .. }),
            Self::Stored(_) => request == Request::Store,
            Self::Inquired(part, _) => request == Request::Inquire(part),
            Self::NodeId(_) => request == Request::InquireNodeId,
            Self::Identified => {
                matches!(request, Request::IdentifyRemote(..) | Request::Fastscan(_))
            }
            Self::NonConfigured => request == Request::IdentifyNonConfigured,
        }
    }
}

/// A command and a number.
fn numbered(command: u8, number: u32) -> [u8; 8] {
    let [n0, n1, n2, n3] = number.to_le_bytes();
    [command, n0, n1, n2, n3, 0, 0, 0]
}

/// Zeros behind the bytes that mean something: they are reserved.
trait Padded {
    fn padded(self) -> [u8; 8];
}

impl<const N: usize> Padded for [u8; N] {
    fn padded(self) -> [u8; 8] {
        let mut bytes = self.into_iter();
        std::array::from_fn(|_| bytes.next().unwrap_or(0))
    }
}

#[cfg(test)]
mod tests {
    use canopen_rs::lss;
    use proptest::prelude::*;

    use super::*;

    const ADDRESS: lss::LssAddress = lss::LssAddress {
        vendor_id: 0x1234_5678,
        product_code: 0x9ABC_DEF0,
        revision_number: 3,
        serial_number: 4,
    };

    #[test]
    fn requests_are_those_of_another_implementation() {
        let ours = |request: Request| request.frame().data().to_vec();
        assert_eq!(ours(Request::SwitchGlobal(Mode::Waiting)), lss::encode_switch_global(false));
        assert_eq!(
            ours(Request::SwitchGlobal(Mode::Configuration)),
            lss::encode_switch_global(true)
        );
        assert_eq!(ours(Request::ConfigureNodeId(0x7F)), lss::encode_configure_node_id(0x7F));
        assert_eq!(ours(Request::Store), lss::encode_store());
        assert_eq!(ours(Request::InquireNodeId), lss::encode_inquire_node_id());
        let parts = [0x1234_5678, 0x9ABC_DEF0, 3, 4];
        let select = Part::ALL.into_iter().zip(parts).map(|(p, n)| ours(Request::Select(p, n)));
        assert!(select.eq(lss::encode_switch_selective(&ADDRESS)));
        let probe = Probe { number: 0x1234_5678, bit: 31, part: 2, next: 3 };
        assert_eq!(ours(Request::Fastscan(probe)), lss::encode_fastscan(0x1234_5678, 31, 2, 3));
    }

    #[test]
    fn what_the_other_implementation_lacks_is_as_the_standard_has_it() {
        for (request, bytes) in [
            (Request::ConfigureBitTiming { table: 0, index: 3 }, [0x13, 0, 3, 0, 0, 0, 0, 0]),
            (Request::ActivateBitTiming(1_000), [0x15, 0xE8, 3, 0, 0, 0, 0, 0]),
            (Request::Inquire(Part::Serial), [0x5D, 0, 0, 0, 0, 0, 0, 0]),
            (
                Request::IdentifyRemote(Condition::HighestSerial, 0x0403_0201),
                [0x4B, 1, 2, 3, 4, 0, 0, 0],
            ),
            (Request::IdentifyNonConfigured, [0x4C, 0, 0, 0, 0, 0, 0, 0]),
        ] {
            assert_eq!(request.frame(), Frame::new(0x7E5, bytes));
        }
        assert_eq!(Reply::NonConfigured.frame(), Frame::new(0x7E4, [0x50, 0, 0, 0, 0, 0, 0, 0]));
    }

    #[test]
    fn a_frame_of_another_length_or_identifier_says_nothing() {
        for frame in [Frame::new(0x7E5, [0x17; 7]), Frame::new(0x7E4, [0x17; 8])] {
            assert_eq!(Request::decode(&frame), None);
        }
        for frame in [Frame::new(0x7E4, [0x44]), Frame::new(0x7E5, [0x44; 8])] {
            assert_eq!(Reply::decode(&frame), None);
        }
        assert_eq!(Request::decode(&Frame::new(0x7E5, [4, 2, 0, 0, 0, 0, 0, 0])), None, "no mode");
    }

    proptest! {
        #[test]
        fn what_is_read_is_what_was_said(bytes in any::<[u8; 8]>(), command in 0_u8..0x60) {
            let bytes = { let mut bytes = bytes; bytes[0] = command; bytes };
            if let Some(request) = Request::decode(&Frame::new(0x7E5, bytes)) {
                prop_assert_eq!(Request::decode(&request.frame()), Some(request));
            }
            if let Some(reply) = Reply::decode(&Frame::new(0x7E4, bytes)) {
                prop_assert_eq!(Reply::decode(&reply.frame()), Some(reply));
            }
        }
    }
}
