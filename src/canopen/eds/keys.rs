//! Keys of CiA 306, in its order and spelling.

use crate::eds::title::{Heading, Title};

const FILE_INFO: &[&str] = &[
    "FileName",
    "FileVersion",
    "FileRevision",
    "LastEDS",
    "EDSVersion",
    "Description",
    "CreationTime",
    "CreationDate",
    "CreatedBy",
    "ModificationTime",
    "ModificationDate",
    "ModifiedBy",
];

const DEVICE_INFO: &[&str] = &[
    "VendorName",
    "VendorNumber",
    "ProductName",
    "ProductNumber",
    "RevisionNumber",
    "OrderCode",
    "BaudRate_10",
    "BaudRate_20",
    "BaudRate_50",
    "BaudRate_125",
    "BaudRate_250",
    "BaudRate_500",
    "BaudRate_800",
    "BaudRate_1000",
    "SimpleBootUpMaster",
    "SimpleBootUpSlave",
    "Granularity",
    "DynamicChannelsSupported",
    "CompactPDO",
    "GroupMessaging",
    "NrOfRXPDO",
    "NrOfTXPDO",
    "LSS_Supported",
];

const COMMISSIONING: &[&str] = &[
    "NodeID",
    "NodeName",
    "NodeRefd",
    "Baudrate",
    "NetNumber",
    "NetworkName",
    "NetRefd",
    "CANopenManager",
    "LSS_SerialNumber",
];

const DUMMY_USAGE: &[&str] =
    &["Dummy0001", "Dummy0002", "Dummy0003", "Dummy0004", "Dummy0005", "Dummy0006", "Dummy0007"];

const OBJECT: &[&str] = &[
    "SubNumber",
    "ParameterName",
    "ObjectType",
    "DataType",
    "AccessType",
    "LowLimit",
    "HighLimit",
    "DefaultValue",
    "PDOMapping",
    "ObjFlags",
    "CompactSubObj",
    "ParameterValue",
    "UploadFile",
    "DownloadFile",
    "Denotation",
    "ParamRefd",
];

/// Known keys of a section; a list continues with numbers.
pub const fn known(title: Title<'_>) -> &'static [&'static str] {
    match title {
        Title::Named(Heading::FileInfo) => FILE_INFO,
        Title::Named(Heading::DeviceInfo) => DEVICE_INFO,
        Title::Named(Heading::Commissioning) => COMMISSIONING,
        Title::Named(Heading::DummyUsage) => DUMMY_USAGE,
        Title::Named(Heading::Comments) => &["Lines"],
        Title::Named(Heading::Mandatory | Heading::Optional | Heading::Manufacturer) => {
            &["SupportedObjects"]
        }
        Title::Object(_) | Title::Sub(..) => OBJECT,
        Title::Names(_) | Title::Values(_) | Title::Denotations(_) => &["NrOfEntries"],
        Title::Links(_) => &["ObjectLinks"],
        Title::Other(_) => &[],
    }
}

/// Returns whether the value of a key is free text, in which leading zeros and `;` have no meaning.
pub fn is_text(key: &str) -> bool {
    const TEXTS: &[&str] = &[
        "ParameterName",
        "Denotation",
        "UploadFile",
        "DownloadFile",
        "ParamRefd",
        "VendorName",
        "ProductName",
        "OrderCode",
        "NodeName",
        "NodeRefd",
        "NetworkName",
        "NetRefd",
    ];
    TEXTS.iter().any(|text| text.eq_ignore_ascii_case(key))
}

/// Returns the spelling of CiA 306 for a known key.
pub fn canonical(title: Title<'_>, key: &str) -> Option<&'static str> {
    place(title, key).and_then(|place| known(title).get(place).copied())
}

/// Order of a key in CiA 306; `None` if it is unknown.
pub fn place(title: Title<'_>, key: &str) -> Option<usize> {
    known(title).iter().position(|one| one.eq_ignore_ascii_case(key))
}
