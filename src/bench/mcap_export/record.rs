//! Records of an MCAP file (mcap.dev/spec): an opcode, the length of the fields, and the fields, little-endian.

use std::collections::BTreeMap;
use std::io;

/// Bytes at the start and at the end of a file.
pub(crate) const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// Algorithm of all checksums of a file.
pub(crate) type Checksum = crc::Crc<u32, crc::Table<16>>;

/// CRC-32 of zlib.
pub(crate) static CHECKSUM: Checksum = Checksum::new(&crc::CRC_32_ISO_HDLC);

/// Kind of a record, as the specification numbers them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Opcode {
    Header,
    Footer,
    Schema,
    Channel,
    Message,
    Chunk,
    MessageIndex,
    ChunkIndex,
    Attachment,
    AttachmentIndex,
    Statistics,
    Metadata,
    MetadataIndex,
    SummaryOffset,
    DataEnd,
}

impl Opcode {
    /// Returns the number in the file.
    pub(crate) const fn number(self) -> u8 {
        match self {
            Self::Header => 0x01,
            Self::Footer => 0x02,
            Self::Schema => 0x03,
            Self::Channel => 0x04,
            Self::Message => 0x05,
            Self::Chunk => 0x06,
            Self::MessageIndex => 0x07,
            Self::ChunkIndex => 0x08,
            Self::Attachment => 0x09,
            Self::AttachmentIndex => 0x0A,
            Self::Statistics => 0x0B,
            Self::Metadata => 0x0C,
            Self::MetadataIndex => 0x0D,
            Self::SummaryOffset => 0x0E,
            Self::DataEnd => 0x0F,
        }
    }
}

/// Fields of a record, in the order of the specification.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fields {
    bytes: Vec<u8>,
    /// Set if a field is longer than its 32-bit length can say.
    is_too_long: bool,
}

impl Fields {
    pub(crate) fn u8(self, value: u8) -> Self {
        self.raw(&[value])
    }

    pub(crate) fn u16(self, value: u16) -> Self {
        self.raw(&value.to_le_bytes())
    }

    pub(crate) fn u32(self, value: u32) -> Self {
        self.raw(&value.to_le_bytes())
    }

    pub(crate) fn u64(self, value: u64) -> Self {
        self.raw(&value.to_le_bytes())
    }

    /// Appends bytes as they are.
    pub(crate) fn raw(mut self, bytes: &[u8]) -> Self {
        self.bytes.extend_from_slice(bytes);
        self
    }

    /// Appends bytes behind their 32-bit length: texts, contents of schemas, lists.
    pub(crate) fn bytes(mut self, bytes: &[u8]) -> Self {
        let length = u32::try_from(bytes.len());
        self.is_too_long |= length.is_err();
        self.u32(length.unwrap_or(u32::MAX)).raw(bytes)
    }

    pub(crate) fn text(self, text: &str) -> Self {
        self.bytes(text.as_bytes())
    }

    /// Appends texts by their keys.
    pub(crate) fn texts(mut self, texts: &BTreeMap<String, String>) -> Self {
        let pair = |fields: Self, (key, text): (&String, &String)| fields.text(key).text(text);
        let pairs = texts.iter().fold(Self::default(), pair);
        self.is_too_long |= pairs.is_too_long;
        self.bytes(&pairs.bytes)
    }

    /// Appends the CRC of all fields before it.
    pub(crate) fn checksum(self) -> Self {
        let checksum = CHECKSUM.checksum(&self.bytes);
        self.u32(checksum)
    }

    /// Returns the encoded fields.
    pub(crate) fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Returns the record.
    ///
    /// # Errors
    /// Returns an error if a field has 4 GiB or more.
    pub(crate) fn record(&self, opcode: Opcode) -> io::Result<Vec<u8>> {
        if self.is_too_long {
            let reason = "a field of an MCAP record must have less than 4 GiB";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
        }
        let length = size(&self.bytes).to_le_bytes();
        Ok([&[opcode.number()][..], &length, &self.bytes].concat())
    }
}

/// Returns the number of bytes, as files count them.
pub(crate) fn size(bytes: &[u8]) -> u64 {
    u64::try_from(bytes.len()).unwrap_or(u64::MAX)
}
