//! Layer setting services (LSS, CiA 305): configuration of node-id and bit rate over the bus.
//!
//! A device without a node-id takes LSS only. Its LSS address is its identity (1018h), which is unique. An
//! LSS slave has two states, *waiting* and *configuration*; only the second allows inquiry and configuration.
//!
//! | COB-ID | from → to      |
//! |--------|----------------|
//! | 7E5h   | master → slave |
//! | 7E4h   | slave → master |
//!
//! Every frame has eight bytes, first a command specifier; [`codec`] has the table.

pub mod codec;
pub(crate) mod layer;
pub mod slave;

use canopen_rs::NodeId;
use canopen_rs::lss::{LSS_MASTER_COB_ID, LSS_SLAVE_COB_ID, UNCONFIGURED_NODE_ID};
use derive_more::Display;

/// COB-ID of requests, 7E5h (CiA 305).
pub const REQUEST_COB_ID: u16 = LSS_MASTER_COB_ID;
/// COB-ID of LSS replies, shared by all slaves.
pub const REPLY_COB_ID: u16 = LSS_SLAVE_COB_ID;

/// Part of an LSS address, in the order of 1018h:1 to 4.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Part {
    /// Vendor-ID, 1018h:1.
    #[display("vendor-ID")]
    Vendor,
    /// Product code, 1018h:2.
    #[display("product code")]
    Product,
    /// Revision number, 1018h:3.
    #[display("revision number")]
    Revision,
    /// Serial number, 1018h:4.
    #[display("serial number")]
    Serial,
}

impl Part {
    /// All parts, in order.
    pub const ALL: [Self; 4] = [Self::Vendor, Self::Product, Self::Revision, Self::Serial];

    /// Index of the part, 0 to 3.
    pub const fn place(self) -> u8 {
        match self {
            Self::Vendor => 0,
            Self::Product => 1,
            Self::Revision => 2,
            Self::Serial => 3,
        }
    }

    /// Returns the part at an index; `None` beyond 3.
    pub fn at(place: u8) -> Option<Self> {
        Self::ALL.get(usize::from(place)).copied()
    }
}

/// LSS address: the identity (1018h) of one device.
#[derive(Clone, Copy, Debug, Display, Default, PartialEq, Eq, Hash)]
#[display("{vendor:08X}h {product:08X}h {revision:08X}h {serial:08X}h")]
pub struct Address {
    /// Vendor-ID, 1018h:1.
    pub vendor: u32,
    /// Product code, 1018h:2.
    pub product: u32,
    /// Revision number, 1018h:3.
    pub revision: u32,
    /// Serial number, 1018h:4.
    pub serial: u32,
}

impl Address {
    /// Value of a part.
    pub const fn part(&self, part: Part) -> u32 {
        match part {
            Part::Vendor => self.vendor,
            Part::Product => self.product,
            Part::Revision => self.revision,
            Part::Serial => self.serial,
        }
    }

    /// Replaces a part.
    #[must_use]
    pub const fn with(mut self, part: Part, number: u32) -> Self {
        match part {
            Part::Vendor => self.vendor = number,
            Part::Product => self.product = number,
            Part::Revision => self.revision = number,
            Part::Serial => self.serial = number,
        }
        self
    }
}

/// Bit rate of CiA 301, by its index in table 0 of CiA 305.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BitRate {
    kilobits: u16,
    index: u8,
}

/// Standard table of CiA 305. Index 5 is reserved, index 9 is automatic detection.
pub const STANDARD_TABLE: u8 = 0;

/// Bit rate in kbit/s, and its index in [`STANDARD_TABLE`].
const BIT_RATES: [(u16, u8); 8] =
    [(1_000, 0), (800, 1), (500, 2), (250, 3), (125, 4), (50, 6), (20, 7), (10, 8)];

impl BitRate {
    /// Returns the bit rate of `kilobits` kbit/s; `None` if the table lacks it.
    pub fn of_kilobits(kilobits: u16) -> Option<Self> {
        let (kilobits, index) = *BIT_RATES.iter().find(|(known, _)| *known == kilobits)?;
        Some(Self { kilobits, index })
    }

    /// Returns the bit rate at an index of the table; `None` if it is not defined.
    pub fn of_index(index: u8) -> Option<Self> {
        let (kilobits, index) = *BIT_RATES.iter().find(|(_, known)| *known == index)?;
        Some(Self { kilobits, index })
    }

    /// Bit rate in kbit/s.
    pub const fn kilobits(self) -> u16 {
        self.kilobits
    }

    /// Index in [`STANDARD_TABLE`].
    pub const fn index(self) -> u8 {
        self.index
    }
}

/// Encodes a node-id for LSS: FFh for an unconfigured device.
pub fn node_byte(node: Option<NodeId>) -> u8 {
    node.map_or(UNCONFIGURED_NODE_ID, NodeId::raw)
}

/// Decodes a node-id of LSS: 1 to 127, or `None` for FFh.
///
/// # Errors
/// Returns an error for any other byte.
pub fn node_of(byte: u8) -> Result<Option<NodeId>, NoNodeId> {
    if byte == UNCONFIGURED_NODE_ID {
        return Ok(None);
    }
    NodeId::new(byte).map(Some).map_err(|_| NoNodeId)
}

/// Error of an invalid node-id byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoNodeId;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_id_is_within_1_to_127_or_absent() {
        for byte in 0..=u8::MAX {
            match node_of(byte) {
                Ok(node) => assert_eq!(node_byte(node), byte),
                Err(NoNodeId) => assert!(byte == 0 || (128..255).contains(&byte), "{byte}"),
            }
        }
    }

    #[test]
    fn bit_rate_is_found_by_rate_and_index() {
        for (kilobits, index) in BIT_RATES {
            let rate = BitRate::of_kilobits(kilobits).unwrap();
            assert_eq!((rate.index(), BitRate::of_index(index)), (index, Some(rate)));
        }
        assert_eq!((BitRate::of_kilobits(100), BitRate::of_index(5)), (None, None));
    }

    #[test]
    fn address_consists_of_four_parts() {
        let address = Address { vendor: 1, product: 2, revision: 3, serial: 0xABC };
        let again = Part::ALL.into_iter().fold(Address::default(), |again, part| {
            assert_eq!(Part::at(part.place()), Some(part));
            again.with(part, address.part(part))
        });
        assert_eq!(again, address);
        assert_eq!(address.to_string(), "00000001h 00000002h 00000003h 00000ABCh");
    }
}
