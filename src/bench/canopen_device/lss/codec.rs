//! LSS messages, encoded and decoded (CiA 305).
//!
//! Numbers are little-endian from byte 1 on. `n` is the index of a [`Part`].
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

use derive_more::Display;

use crate::lss::{Part, REPLY_COB_ID, REQUEST_COB_ID};
use canopen::frame::Frame;

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

/// State of an LSS slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LssState {
    /// Can be selected and identified, but not configured.
    Waiting,
    /// Can be inquired and configured.
    Configuration,
}

/// Condition of "identify remote slave", in the order of transmission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// Vendor-ID equals the number.
    Vendor,
    /// Product code equals the number.
    Product,
    /// Lowest revision number.
    LowestRevision,
    /// Highest revision number.
    HighestRevision,
    /// Lowest serial number.
    LowestSerial,
    /// Highest serial number.
    HighestSerial,
}

impl Condition {
    /// All conditions, in order.
    pub const ALL: [Self; 6] = [
        Self::Vendor,
        Self::Product,
        Self::LowestRevision,
        Self::HighestRevision,
        Self::LowestSerial,
        Self::HighestSerial,
    ];
}

/// Fastscan request; see the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Probe {
    /// IDNumber: value to compare.
    pub number: u32,
    /// BitCheck: lowest bit to compare; [`EVERYBODY`](Self::EVERYBODY) addresses every unconfigured slave.
    pub bit: u8,
    /// LSSSub: index of the part to compare.
    pub part: u8,
    /// LSSNext: index of the part compared next; the scan is complete when it is lower than the current one.
    pub next: u8,
}

impl Probe {
    /// BitCheck value that every unconfigured slave answers; it restarts the scan.
    pub const EVERYBODY: u8 = 0x80;
}

/// Request of the LSS master (CiA 305).
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Request {
    /// Switches the state of every slave.
    #[display("switch state global")]
    SwitchGlobal(LssState),
    /// Selects by one part; the slave matching all four enters configuration.
    #[display("switch state selective")]
    Select(Part, u32),
    /// Configures the node-id, as LSS encodes it.
    #[display("configure node-id")]
    ConfigureNodeId(u8),
    /// Configures the bit rate, which acts after its activation.
    #[display("configure bit timing")]
    ConfigureBitTiming {
        /// Table; [`STANDARD_TABLE`](crate::lss::STANDARD_TABLE) is that of CiA.
        table: u8,
        /// Index in the table.
        index: u8,
    },
    /// Activates the bit rate after this delay in ms; no node sends for twice that time.
    #[display("activate bit timing")]
    ActivateBitTiming(u16),
    /// Stores node-id and bit rate.
    #[display("store configuration")]
    Store,
    /// Inquires one part of the identity.
    #[display("inquire {_0}")]
    Inquire(Part),
    /// Inquires the node-id.
    #[display("inquire node-id")]
    InquireNodeId,
    /// Identifies by one condition; slaves that meet all six reply.
    #[display("identify remote slave")]
    IdentifyRemote(Condition, u32),
    /// Identifies unconfigured slaves.
    #[display("identify non-configured slave")]
    IdentifyNonConfigured,
    /// Compares part of the identity of unconfigured slaves.
    #[display("fastscan")]
    Fastscan(Probe),
}

impl Request {
    /// Encodes the request.
    pub fn frame(self) -> Frame {
        let bytes = match self {
            Self::SwitchGlobal(state) => {
                padded([SWITCH_GLOBAL, u8::from(state == LssState::Configuration)])
            }
            Self::Select(part, number) => numbered(SELECT + part.place(), number),
            Self::ConfigureNodeId(node) => padded([CONFIGURE_NODE_ID, node]),
            Self::ConfigureBitTiming { table, index } => {
                padded([CONFIGURE_BIT_TIMING, table, index])
            }
            Self::ActivateBitTiming(delay) => {
                let [low, high] = delay.to_le_bytes();
                padded([ACTIVATE_BIT_TIMING, low, high])
            }
            Self::Store => padded([STORE]),
            Self::Inquire(part) => padded([INQUIRE + part.place()]),
            Self::InquireNodeId => padded([INQUIRE_NODE_ID]),
            Self::IdentifyRemote(condition, number) => {
                let before = Condition::ALL.into_iter().take_while(|one| *one != condition);
                numbered(before.fold(IDENTIFY_REMOTE, |code, _| code + 1), number)
            }
            Self::IdentifyNonConfigured => padded([IDENTIFY_NON_CONFIGURED]),
            Self::Fastscan(Probe { number, bit, part, next }) => {
                let [n0, n1, n2, n3] = number.to_le_bytes();
                [FASTSCAN, n0, n1, n2, n3, bit, part, next]
            }
        };
        Frame::new(REQUEST_COB_ID, bytes)
    }

    /// Decodes a request; `None` for any other frame.
    pub fn decode(frame: &Frame) -> Option<Self> {
        if frame.cob_id != REQUEST_COB_ID {
            return None;
        }
        let &[command, a, b, c, d, bit, part, next] = frame.data() else { return None };
        let number = u32::from_le_bytes([a, b, c, d]);
        Some(match command {
            SWITCH_GLOBAL if a == 0 => Self::SwitchGlobal(LssState::Waiting),
            SWITCH_GLOBAL if a == 1 => Self::SwitchGlobal(LssState::Configuration),
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

/// Result of a configuration request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Error code, 0 for success.
    pub error: u8,
    /// Manufacturer-specific code, where `error` is [`SPECIFIC`](Self::SPECIFIC).
    pub specific: u8,
}

impl Answer {
    /// Success.
    pub const DONE: Self = Self { error: 0, specific: 0 };
    /// Node-id out of range; bit timing, or storing, not supported.
    pub const REFUSED: Self = Self { error: 1, specific: 0 };
    /// Error code of a manufacturer-specific error.
    pub const SPECIFIC: u8 = 0xFF;
}

/// Reply of an LSS slave (CiA 305).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reply {
    /// Confirmation of the slave that was selected by its address; it is in configuration now.
    Selected,
    /// Result of "configure node-id".
    NodeIdConfigured(Answer),
    /// Result of "configure bit timing".
    BitTimingConfigured(Answer),
    /// Result of "store configuration".
    Stored(Answer),
    /// One part of the identity.
    Inquired(Part, u32),
    /// Node-id, as LSS encodes it.
    NodeId(u8),
    /// All conditions, or the compared bits, match.
    Identified,
    /// Presence of a slave without a node-id.
    NonConfigured,
}

impl Reply {
    /// Encodes the reply.
    pub fn frame(self) -> Frame {
        let answer = |command, Answer { error, specific }| padded([command, error, specific]);
        let bytes = match self {
            Self::Selected => padded([SELECTED]),
            Self::NodeIdConfigured(to) => answer(CONFIGURE_NODE_ID, to),
            Self::BitTimingConfigured(to) => answer(CONFIGURE_BIT_TIMING, to),
            Self::Stored(to) => answer(STORE, to),
            Self::Inquired(part, number) => numbered(INQUIRE + part.place(), number),
            Self::NodeId(node) => padded([INQUIRE_NODE_ID, node]),
            Self::Identified => padded([IDENTIFIED]),
            Self::NonConfigured => padded([NON_CONFIGURED]),
        };
        Frame::new(REPLY_COB_ID, bytes)
    }

    /// Decodes a reply; `None` for any other frame.
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

    /// Returns whether this replies to `request`.
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

/// Encodes a command specifier with a number.
fn numbered(command: u8, number: u32) -> [u8; 8] {
    let [n0, n1, n2, n3] = number.to_le_bytes();
    [command, n0, n1, n2, n3, 0, 0, 0]
}

/// Pads a message with zeros for its reserved bytes.
fn padded<const N: usize>(message: [u8; N]) -> [u8; 8] {
    let mut bytes = message.into_iter();
    std::array::from_fn(|_| bytes.next().unwrap_or(0))
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
    fn requests_equal_those_of_canopen_rs() {
        let ours = |request: Request| request.frame().data().to_vec();
        assert_eq!(
            ours(Request::SwitchGlobal(LssState::Waiting)),
            lss::encode_switch_global(false)
        );
        assert_eq!(
            ours(Request::SwitchGlobal(LssState::Configuration)),
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
    fn further_requests_follow_the_standard() {
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
    fn frames_of_wrong_length_or_cob_id_do_not_decode() {
        for frame in [Frame::new(0x7E5, [0x17; 7]), Frame::new(0x7E4, [0x17; 8])] {
            assert_eq!(Request::decode(&frame), None);
        }
        for frame in [Frame::new(0x7E4, [0x44]), Frame::new(0x7E5, [0x44; 8])] {
            assert_eq!(Reply::decode(&frame), None);
        }
        assert_eq!(
            Request::decode(&Frame::new(0x7E5, [4, 2, 0, 0, 0, 0, 0, 0])),
            None,
            "no LSS state"
        );
    }

    proptest! {
        #[test]
        fn encoded_messages_decode_to_themselves(bytes in any::<[u8; 8]>(), command in 0_u8..0x60) {
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
