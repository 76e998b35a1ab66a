//! Conversion of sections to objects. Absent or invalid parts get the default of CiA 306 or a plausible one;
//! [`lint`](crate::eds::lint) reports them.

use crate::data_type::{self, DOMAIN, DataType};
use crate::eds::eds_object::{Access, DcfEntries, EdsObject};
use crate::eds::ini::{Entry, Ini, Section};
use crate::eds::title::Title;
use crate::eds::value;
use crate::object::Object;

/// Object types (CiA 301, 7.4.3).
pub(super) const DOMAIN_OBJECT: i128 = 2;
pub(super) const RECORD_TYPE: i128 = 6;
pub(super) const ARRAY: i128 = 8;
pub(super) const RECORD: i128 = 9;

/// Returns whether a section is the head of an array or record, by its object type.
pub(super) fn is_head(section: &Section<'_>) -> bool {
    matches!(integer(section, "ObjectType"), Some(RECORD_TYPE | ARRAY | RECORD))
}

/// Parses the integer at a key; `None` if it is absent or invalid.
pub(super) fn integer(section: &Section<'_>, key: &str) -> Option<i128> {
    value::whole(section.value(key)?.word()).map(|(value, _)| value)
}

/// Parses an unsigned number.
pub(super) fn unsigned<T: TryFrom<i128>>(section: &Section<'_>, key: &str) -> Option<T> {
    T::try_from(integer(section, key)?).ok()
}

/// Converts the object of a section.
pub(super) fn one(ini: &Ini<'_>, section: &Section<'_>, object: Object) -> EdsObject {
    let number = data_type(ini, section);
    let data_type = data_type::find(number);
    let default = section.value("DefaultValue");
    let as_number = |entry: &Entry<'_>| value::number(entry.word(), data_type.as_ref()?).ok();
    let access = section.value("AccessType").and_then(|entry| Access::read(entry.word()));
    EdsObject {
        object,
        name: section.text("ParameterName").to_owned(),
        data_type: number,
        access: access.unwrap_or(Access::ReadOnly),
        default: default.map(|entry| text_of(entry, data_type)).unwrap_or_default(),
        number: default.and_then(as_number),
        low: section.value("LowLimit").and_then(as_number),
        high: section.value("HighLimit").and_then(as_number),
        is_mappable: section.value("PDOMapping").is_some_and(|entry| is_set(entry.word())),
        flags: unsigned(section, "ObjFlags").unwrap_or(0),
        setting: setting(section, data_type),
    }
}

/// Converts the DCF entries of a section.
fn setting(section: &Section<'_>, data_type: Option<DataType>) -> DcfEntries {
    let text = |key| section.value(key).map(|entry| entry.value.to_owned());
    DcfEntries {
        value: section.value("ParameterValue").map(|entry| text_of(entry, data_type)),
        denotation: text("Denotation"),
        upload_file: text("UploadFile"),
        download_file: text("DownloadFile"),
        reference: text("ParamRefd"),
    }
}

/// Returns a value as written: a text in full, any other without its comment.
pub(super) fn text_of(entry: &Entry<'_>, data_type: Option<DataType>) -> String {
    let is_fixed = data_type.is_some_and(|data_type| data_type.bits.is_some());
    if is_fixed { entry.word() } else { entry.value }.to_owned()
}

/// Returns whether a flag is set.
pub(super) fn is_set(word: &str) -> bool {
    match value::whole(word) {
        Some((number, _)) => number != 0,
        None => word.eq_ignore_ascii_case("true") || word.eq_ignore_ascii_case("yes"),
    }
}

/// Returns the number of a section's data type: as stated, DOMAIN for a domain, else zero. A type defined in the file
/// is resolved to its base type. CANFestival's editor writes `DataType=0xA0` and the base type as default of `[A0sub1]`.
fn data_type(ini: &Ini<'_>, section: &Section<'_>) -> u16 {
    let Some(number) = unsigned::<u16>(section, "DataType") else {
        let is_domain = integer(section, "ObjectType") == Some(DOMAIN_OBJECT);
        return if is_domain { DOMAIN } else { 0 };
    };
    if data_type::find(number).is_some() {
        return number;
    }
    let short = format!("{number:X}sub1");
    let own = ini.section(Title::Sub(number, 1)).or_else(|| ini.section(Title::Other(&short)));
    own.and_then(|own| unsigned(own, "DefaultValue")).unwrap_or(number)
}
