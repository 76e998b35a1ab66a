//! One object as its maker describes it.

use crate::NodeId;
use crate::data_type;
use crate::eds::value;
use crate::eds::value::Number;
use crate::object::Object;

/// Who may do what with an object, over SDO and PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Never changes.
    Constant,
    /// Read.
    ReadOnly,
    /// Written.
    WriteOnly,
    /// Both.
    ReadWrite,
    /// Both; as a process input it may be in a TPDO only.
    ReadWriteInput,
    /// Both; as a process output it may be in an RPDO only.
    ReadWriteOutput,
}

impl Access {
    /// Reads the word of `AccessType`, in any case, `r` and `w` included; `None` for any other.
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

    /// The word of `AccessType`.
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

    /// Whether SDO may read it.
    pub const fn is_readable(self) -> bool {
        !matches!(self, Self::WriteOnly)
    }

    /// Whether SDO may write it.
    pub const fn is_writable(self) -> bool {
        !matches!(self, Self::Constant | Self::ReadOnly)
    }

    /// Whether it may stand in a TPDO, if it may be mapped at all.
    pub const fn is_input(self) -> bool {
        !matches!(self, Self::WriteOnly | Self::ReadWriteOutput)
    }

    /// Whether it may stand in an RPDO, if it may be mapped at all.
    pub const fn is_output(self) -> bool {
        matches!(self, Self::WriteOnly | Self::ReadWrite | Self::ReadWriteOutput)
    }
}

/// One object as it is described.
#[derive(Clone, Debug, PartialEq)]
pub struct Described {
    /// Which.
    pub object: Object,
    /// What its maker calls it.
    pub name: String,
    /// Data type, by its number in CiA 301, 7.4.7.1; zero where the file says nothing that is one.
    pub data_type: u16,
    /// Who may do what with it; what the file does not say nobody may write.
    pub access: Access,
    /// What it holds after power-up, as it is written.
    pub default: String,
    /// The same as a number, for types that are whole numbers.
    pub number: Option<Number>,
    /// The lowest value it takes, where the file says one that is a value of its type.
    pub low: Option<i128>,
    /// The highest value it takes, likewise.
    pub high: Option<i128>,
    /// Whether it may be mapped into a PDO.
    pub is_mappable: bool,
    /// `ObjFlags`: bit 0, not to be written when a configuration is loaded; bit 1, not to be read
    /// when a device is scanned.
    pub flags: u32,
    /// What a DCF adds.
    pub setting: Setting,
}

/// What a DCF says of one object, for one device in one system (CiA 306, 5.3).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Setting {
    /// What it is to hold, as it is written.
    pub value: Option<String>,
    /// What this system calls it.
    pub denotation: Option<String>,
    /// Where what it holds is to be left (DOMAIN).
    pub upload_file: Option<String>,
    /// Where what it is to hold is found (DOMAIN).
    pub download_file: Option<String>,
    /// What a configuration tool knows it by.
    pub reference: Option<String>,
}

impl Described {
    /// The bits of its values; `None` for texts, domains and types that are unknown.
    pub fn bits(&self) -> Option<u8> {
        data_type::of(self.data_type)?.bits
    }

    /// What it holds after power-up, little-endian: its default, or else zeros, or nothing.
    pub fn initial(&self, node: NodeId) -> Vec<u8> {
        let written = Some(&self.default).filter(|text| !text.is_empty());
        written.and_then(|text| self.bytes(text, node)).unwrap_or_else(|| {
            match data_type::size(self.data_type) {
                Some(size) => vec![0; size],
                // Some describe bytes by words.
                None => self.default.clone().into_bytes(),
            }
        })
    }

    /// What a DCF wants it to hold, little-endian.
    pub fn configured(&self, node: NodeId) -> Option<Vec<u8>> {
        self.bytes(self.setting.value.as_ref()?, node)
    }

    fn bytes(&self, text: &str, node: NodeId) -> Option<Vec<u8>> {
        value::bytes(text, &data_type::of(self.data_type)?, node).ok()
    }
}
