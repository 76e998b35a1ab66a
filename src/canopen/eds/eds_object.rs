//! Description of one object in an EDS (CiA 306, 4.6).

use crate::eds::value::{self, Number};
use crate::object::Object;
use crate::{NodeId, data_type};

/// Access to an object by SDO and PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Readable; the value never changes.
    Constant,
    /// Readable.
    ReadOnly,
    /// Writable.
    WriteOnly,
    /// Readable and writable.
    ReadWrite,
    /// Readable and writable; a process input for TPDOs only.
    ReadWriteInput,
    /// Readable and writable; a process output for RPDOs only.
    ReadWriteOutput,
}

impl Access {
    /// Parses `AccessType`, in any case; also accepts `r` and `w`. `None` for any other word.
    pub(super) fn read(word: &str) -> Option<Self> {
        Some(match word.to_ascii_lowercase().as_str() {
            "const" => Self::Constant,
            "ro" | "r" => Self::ReadOnly,
            "wo" | "w" => Self::WriteOnly,
            "rw" => Self::ReadWrite,
            "rwr" => Self::ReadWriteInput,
            "rww" => Self::ReadWriteOutput,
            _ => return None,
        })
    }

    /// Word of `AccessType`.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Constant => "const",
            Self::ReadOnly => "ro",
            Self::WriteOnly => "wo",
            Self::ReadWrite => "rw",
            Self::ReadWriteInput => "rwr",
            Self::ReadWriteOutput => "rww",
        }
    }

    /// Returns whether SDO may read the object.
    pub const fn is_readable(self) -> bool {
        !matches!(self, Self::WriteOnly)
    }

    /// Returns whether SDO may write the object.
    pub const fn is_writable(self) -> bool {
        !matches!(self, Self::Constant | Self::ReadOnly)
    }

    /// Returns whether a TPDO may contain the object, if it can be mapped.
    pub const fn is_input(self) -> bool {
        !matches!(self, Self::WriteOnly | Self::ReadWriteOutput)
    }

    /// Returns whether an RPDO may contain the object, if it can be mapped.
    pub const fn is_output(self) -> bool {
        matches!(self, Self::WriteOnly | Self::ReadWrite | Self::ReadWriteOutput)
    }
}

/// Object description of an EDS: name, data type, access, limits and default.
#[derive(Clone, Debug, PartialEq)]
pub struct EdsObject {
    /// Index and sub-index.
    pub object: Object,
    /// Name by the manufacturer.
    pub name: String,
    /// Data type, by its number in CiA 301, 7.4.7.1; zero if absent or invalid.
    pub data_type: u16,
    /// Access; read-only if absent.
    pub access: Access,
    /// Default value, as written.
    pub default: String,
    /// Default value as a number, for integer types.
    pub number: Option<Number>,
    /// Low limit; `None` if absent, or not a value of the type.
    pub low: Option<Number>,
    /// High limit; `None` if absent, or not a value of the type.
    pub high: Option<Number>,
    /// Set if a PDO may contain the object.
    pub is_mappable: bool,
    /// `ObjFlags`: bit 0, not written when a configuration is downloaded; bit 1, not read when a device is
    /// scanned.
    pub flags: u32,
    /// Entries of a DCF.
    pub setting: DcfEntries,
}

/// DCF entries of one object (CiA 306, 5.3).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DcfEntries {
    /// Configured value, as written.
    pub value: Option<String>,
    /// Name in this system.
    pub denotation: Option<String>,
    /// File for the uploaded content (DOMAIN).
    pub upload_file: Option<String>,
    /// File with the content for download (DOMAIN).
    pub download_file: Option<String>,
    /// Reference of the configuration tool.
    pub reference: Option<String>,
}

impl EdsObject {
    /// Length of a value in bits; `None` for texts, domains and unknown types.
    pub fn bits(&self) -> Option<u8> {
        data_type::find(self.data_type)?.bits
    }

    /// Value after power-up, little-endian: its default, else zeros or empty.
    pub fn initial(&self, node: NodeId) -> Vec<u8> {
        let written = Some(&self.default).filter(|text| !text.is_empty());
        written.and_then(|text| self.bytes(text, node)).unwrap_or_else(|| {
            match data_type::size(self.data_type) {
                Some(size) => vec![0; size],
                // Some files describe bytes in words.
                None => self.default.clone().into_bytes(),
            }
        })
    }

    /// Configured value of a DCF, little-endian.
    pub fn configured(&self, node: NodeId) -> Option<Vec<u8>> {
        self.bytes(self.setting.value.as_ref()?, node)
    }

    fn bytes(&self, text: &str, node: NodeId) -> Option<Vec<u8>> {
        value::bytes(text, &data_type::find(self.data_type)?, node).ok()
    }
}
