//! Electronic data sheets (EDS, CiA 306): the object dictionary of a device as its manufacturer describes it.
//!
//! Which values a device has is not said here. The parser is as tolerant as
//! real files require: invalid parts count as absent, and [`Eds::lint`] reports them by line.

mod compact;
mod device;
mod eds_object;
pub mod ini;
pub mod keys;
mod limits;
mod lint;
mod objects;
mod pdo;
mod read;
mod text;
pub mod title;
pub mod value;

pub use device::{Commissioning, DeviceInfo};
pub use eds_object::{Access, DcfEntries, EdsObject};
pub use limits::OutsideLimits;
pub use lint::{Finding, Gap, Severity};
pub use pdo::PdoAbility;
pub use text::encode;
pub use value::{NoValue, Number};

use std::sync::Arc;

use thiserror::Error;

use crate::data_type;
use crate::eds::ini::Ini;
use crate::eds::text::Text;
use crate::object::Object;

/// Maximum size of a file, in bytes, lines and sections, so that any file is read in 100 ms.
const MAX_BYTES: usize = 2 << 20;
const MAX_LINES: usize = 200_000;
const MAX_SECTIONS: usize = 60_000;

/// Error of a file that is not an EDS.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum EdsError {
    /// More bytes than any device's file has.
    #[error("larger than 2 MiB")]
    TooLarge,
    /// More lines than any device's file has.
    #[error("more than {MAX_LINES} lines")]
    TooManyLines,
    /// More objects than any device has, or more bytes of compact descriptions.
    #[error("more objects are described than any device has")]
    TooMany,
    /// No object.
    #[error("no object is described")]
    Empty,
}

/// EDS of a device type, or DCF of one device.
#[derive(Clone, Debug)]
pub struct Eds {
    source: Arc<[u8]>,
    text: Text,
    device: DeviceInfo,
    commissioning: Option<Commissioning>,
    dummies: u8,
    objects: Vec<EdsObject>,
}

impl Eds {
    /// Parses a file.
    ///
    /// # Errors
    /// Returns an error for a file without objects, or one above the limits. Parsing takes at most 150 MiB.
    pub fn parse(bytes: &[u8]) -> Result<Self, EdsError> {
        if bytes.len() > MAX_BYTES {
            return Err(EdsError::TooLarge);
        }
        let text = Text::decode(bytes);
        let count = |wanted| text.text.bytes().filter(|byte| *byte == wanted).count();
        if count(b'\n') > MAX_LINES {
            return Err(EdsError::TooManyLines);
        }
        if count(b'[') > MAX_SECTIONS {
            return Err(EdsError::TooMany);
        }
        let ini = Ini::read(&text.text);
        let (device, commissioning) = (device::info(&ini), device::commissioning(&ini));
        let dummies = device::dummies(&ini);
        let objects = objects::objects(&ini)?;
        drop(ini);
        Ok(Self { source: bytes.into(), text, device, commissioning, dummies, objects })
    }

    /// Content of the file.
    pub fn source(&self) -> &[u8] {
        &self.source
    }

    /// Findings in the file by line, at most 1,000 per severity.
    pub fn lint(&self) -> Vec<Finding> {
        lint::lint(self)
    }

    /// First sign that the file ends inside a section.
    pub fn truncation(&self) -> Option<Finding> {
        lint::truncation(self)
    }

    /// Sections of the file, as written.
    pub fn ini(&self) -> Ini<'_> {
        Ini::read(&self.text.text)
    }

    /// Vendor-ID; zero if absent.
    pub fn vendor(&self) -> u32 {
        self.identity(self.device.vendor, Object::VENDOR_ID)
    }

    /// Product code; zero if absent.
    pub fn product(&self) -> u32 {
        self.identity(self.device.product, Object::PRODUCT_CODE)
    }

    /// Returns the default of the identity object, which the device holds, or else the value of `[DeviceInfo]`.
    fn identity(&self, stated: u32, object: Object) -> u32 {
        let default = self.object(object).and_then(|described| described.number);
        let default = default.and_then(|number| u32::try_from(number.value).ok());
        default.filter(|default| *default != 0).unwrap_or(stated)
    }

    /// Numbers of `[DeviceInfo]` that differ from the defaults of the identity object.
    pub fn identity_conflicts(&self) -> Vec<Finding> {
        lint::identity_conflicts(self)
    }

    /// Content of `[DeviceInfo]`.
    pub const fn device(&self) -> &DeviceInfo {
        &self.device
    }

    /// Content of `[DeviceComissioning]` in a DCF.
    pub const fn commissioning(&self) -> Option<&Commissioning> {
        self.commissioning.as_ref()
    }

    /// Returns whether data type `index` (1 to 7) may be a dummy in an RPDO.
    pub fn dummy(&self, index: u16) -> bool {
        (1..=7).contains(&index) && self.dummies >> index & 1 == 1
    }

    /// Objects by index and sub-index.
    pub fn objects(&self) -> &[EdsObject] {
        &self.objects
    }

    /// Returns the description of `object`; `None` if the file does not describe it.
    pub fn object(&self, object: Object) -> Option<&EdsObject> {
        let found = self.objects.binary_search_by_key(&object, |described| described.object);
        self.objects.get(found.ok()?)
    }

    /// Length of an object in a PDO, in bits, dummies included.
    fn bits_in_pdo(&self, object: Object) -> Option<u8> {
        match self.object(object) {
            Some(described) => described.bits(),
            None if object.sub == 0 => data_type::find(object.index)?.bits,
            None => None,
        }
    }
}
