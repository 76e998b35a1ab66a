//! Electronic data sheets (CiA 306): what a device's maker says is in its object dictionary.
//!
//! Only what is described, not what a device holds: that is a
//! [`Dictionary`](crate::dictionary::Dictionary). Reading is as tolerant as real files demand:
//! what cannot be understood counts as not said, and [`Eds::lint`] tells of it with its line.

mod compact;
mod described;
mod device;
mod ini;
mod keys;
mod lint;
mod objects;
mod pdo;
mod read;
pub mod sheet;
mod text;
mod title;
pub mod value;

pub use described::Access;
pub use described::Described;
pub use described::Setting;
pub use device::Commissioning;
pub use device::DeviceInfo;
pub use lint::Finding;
pub use lint::Severity;
pub use pdo::PdoAbility;
pub(crate) use sheet::Sheet;
pub use value::NoValue;
pub use value::Number;

use std::sync::Arc;

use thiserror::Error;

use crate::data_type;
use crate::eds::ini::Ini;
use crate::eds::text::Text;
use crate::object::Object;

/// The most bytes, lines and sections a file may have: what an EDS of 2 MiB has, and no more, so that
/// any file is read in 100 ms.
const LARGEST: usize = 2 << 20;
const MOST_LINES: usize = 200_000;
const MOST_SECTIONS: usize = 60_000;

/// Why a file is no EDS.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum EdsError {
    /// Too large to be one.
    #[error("larger than 2 MiB")]
    TooLarge,
    /// More lines than that many bytes of an EDS have.
    #[error("more than {MOST_LINES} lines")]
    TooManyLines,
    /// More objects than any device has.
    #[error("more objects are described than any device has")]
    TooMany,
    /// No objects at all.
    #[error("no object is described")]
    Empty,
}

/// A whole data sheet, or the configuration of one device.
#[derive(Clone, Debug)]
pub struct Eds {
    source: Arc<[u8]>,
    text: Text,
    device: DeviceInfo,
    commissioning: Option<Commissioning>,
    dummies: u8,
    objects: Vec<Described>,
}

impl Eds {
    /// Reads a file.
    ///
    /// # Errors
    /// When it is none: without objects, or larger than any. What is read takes 150 MiB at most.
    pub fn parse(bytes: &[u8]) -> Result<Self, EdsError> {
        if bytes.len() > LARGEST {
            return Err(EdsError::TooLarge);
        }
        let text = Text::decode(bytes);
        let count = |wanted| text.text.bytes().filter(|byte| *byte == wanted).count();
        if count(b'\n') > MOST_LINES {
            return Err(EdsError::TooManyLines);
        }
        if count(b'[') > MOST_SECTIONS {
            return Err(EdsError::TooMany);
        }
        let ini = Ini::read(&text.text);
        let (device, commissioning) = (device::info(&ini), device::commissioning(&ini));
        let dummies = device::dummies(&ini);
        let objects = objects::objects(&ini)?;
        drop(ini);
        Ok(Self { source: bytes.into(), text, device, commissioning, dummies, objects })
    }

    /// The file itself, byte by byte.
    pub fn source(&self) -> &[u8] {
        &self.source
    }

    /// Everything that is wrong with the file, by line; at most 1,000 findings.
    pub fn lint(&self) -> Vec<Finding> {
        lint::lint(self)
    }

    /// The first sign that the file was cut off, or lost a part; `None` for one that is whole.
    pub fn gap(&self) -> Option<Finding> {
        lint::gap(self)
    }

    /// The file written anew: the same description, in the order of CiA 306, without its comments.
    pub fn write(&self) -> Vec<u8> {
        self.sheet().write()
    }

    /// Its sections, to be changed.
    pub fn sheet(&self) -> Sheet<'_> {
        Sheet::of(&Ini::read(&self.text.text))
    }

    /// Vendor-ID, zero if the file does not say.
    pub fn vendor(&self) -> u32 {
        self.identity(self.device.vendor, Object::VENDOR_ID)
    }

    /// Product code, zero if the file does not say.
    pub fn product(&self) -> u32 {
        self.identity(self.device.product, Object::PRODUCT_CODE)
    }

    /// What `[DeviceInfo]` says, or else the default of the identity object.
    fn identity(&self, told: u32, object: Object) -> u32 {
        let default =
            || self.object(object)?.number.and_then(|number| u32::try_from(number.value).ok());
        if told == 0 { default().unwrap_or(0) } else { told }
    }

    /// What it says of the device as a whole.
    pub const fn device(&self) -> &DeviceInfo {
        &self.device
    }

    /// Where the device is, if this is a DCF.
    pub const fn commissioning(&self) -> Option<&Commissioning> {
        self.commissioning.as_ref()
    }

    /// Whether data type `index` (1 to 7) may stand in an RPDO for bits that nobody takes.
    pub fn dummy(&self, index: u16) -> bool {
        (1..=7).contains(&index) && self.dummies >> index & 1 == 1
    }

    /// Every object, by index and sub-index.
    pub fn objects(&self) -> &[Described] {
        &self.objects
    }

    /// One object.
    pub fn object(&self, object: Object) -> Option<&Described> {
        let found = self.objects.binary_search_by_key(&object, |described| described.object);
        self.objects.get(found.ok()?)
    }

    /// How long a value of an object is in a PDO, in bits, dummies included.
    fn bits_in_pdo(&self, object: Object) -> Option<u8> {
        match self.object(object) {
            Some(described) => described.bits(),
            None if object.sub == 0 => data_type::of(object.index)?.bits,
            None => None,
        }
    }
}
