//! Sections that describe the device: `[DeviceInfo]`, `[DummyUsage]`, and `[DeviceComissioning]` of a DCF (CiA 306).

use crate::NodeId;
use crate::eds::ini::Ini;
use crate::eds::read;
use crate::eds::title::{Heading, Title};

/// Device information (CiA 306, 4.4). Zero or empty if absent.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Name of the manufacturer.
    pub vendor_name: String,
    /// Vendor-ID, 1018h:1.
    pub vendor: u32,
    /// Product name of the manufacturer; not compared with the device.
    pub product_name: String,
    /// Product code, 1018h:2.
    pub product: u32,
    /// Revision number, 1018h:3.
    pub revision: u32,
    /// Supported bit rates, in kbit/s.
    pub bitrates: Vec<u32>,
    /// Minimum bits of a mapping entry; 0 if mappings are fixed.
    pub granularity: u8,
    /// Number of RPDOs.
    pub rpdos: u16,
    /// Number of TPDOs.
    pub tpdos: u16,
    /// Set if the device supports LSS (CiA 305).
    pub has_lss: bool,
}

/// Bit rates of CiA 301 (4.2), in kbit/s.
pub(super) const BITRATES: [u32; 8] = [10, 20, 50, 125, 250, 500, 800, 1_000];

/// Reads `[DeviceInfo]`.
pub(super) fn info(ini: &Ini<'_>) -> DeviceInfo {
    let Some(section) = ini.section(Title::Named(Heading::DeviceInfo)) else {
        return DeviceInfo::default();
    };
    let flag = |key: &str| section.value(key).is_some_and(|entry| read::is_set(entry.word()));
    let number = |key| read::unsigned(section, key).unwrap_or(0);
    DeviceInfo {
        vendor_name: section.text("VendorName").to_owned(),
        vendor: number("VendorNumber"),
        product_name: section.text("ProductName").to_owned(),
        product: number("ProductNumber"),
        revision: number("RevisionNumber"),
        bitrates: BITRATES.into_iter().filter(|rate| flag(&format!("BaudRate_{rate}"))).collect(),
        granularity: read::unsigned(section, "Granularity").unwrap_or(0),
        rpdos: read::unsigned(section, "NrOfRXPDO").unwrap_or(0),
        tpdos: read::unsigned(section, "NrOfTXPDO").unwrap_or(0),
        has_lss: flag("LSS_Supported"),
    }
}

/// Data types allowed as dummies in RPDOs, one bit each: `[DummyUsage]`.
pub(super) fn dummies(ini: &Ini<'_>) -> u8 {
    let Some(section) = ini.section(Title::Named(Heading::DummyUsage)) else { return 0 };
    let is_set = |index: &u8| {
        section.value(&format!("Dummy{index:04}")).is_some_and(|entry| read::is_set(entry.word()))
    };
    (1..=7).filter(is_set).fold(0, |dummies, index| dummies | 1 << index)
}

/// Commissioning of a device (CiA 306, 5.2).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Commissioning {
    /// Node-id, 1 to 127; `None` if absent or out of range.
    pub node: Option<NodeId>,
    /// Name in this system.
    pub node_name: String,
    /// Bit rate of the network, in kbit/s.
    pub bitrate: Option<u32>,
    /// Number of the network.
    pub network: Option<u32>,
    /// Name of the network in this system; empty if absent.
    pub network_name: String,
    /// Set if the device manages the network.
    pub is_manager: bool,
    /// Serial number, for LSS.
    pub serial: Option<u32>,
}

/// Reads `[DeviceComissioning]`; `None` for a plain EDS.
pub(super) fn commissioning(ini: &Ini<'_>) -> Option<Commissioning> {
    let section = ini.section(Title::Named(Heading::Commissioning))?;
    let node = read::unsigned::<u8>(section, "NodeID").and_then(|raw| NodeId::new(raw).ok());
    Some(Commissioning {
        node,
        node_name: section.text("NodeName").to_owned(),
        bitrate: read::unsigned(section, "Baudrate"),
        network: read::unsigned(section, "NetNumber"),
        network_name: section.text("NetworkName").to_owned(),
        is_manager: section.value("CANopenManager").is_some_and(|entry| read::is_set(entry.word())),
        serial: read::unsigned(section, "LSS_SerialNumber"),
    })
}
