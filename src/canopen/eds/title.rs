//! Titles of EDS sections: objects, and the named sections of CiA 306.

use std::fmt;

use crate::object::Object;

/// Parsed title of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Title<'t> {
    /// Section with a fixed name.
    Named(Heading),
    /// `[1A00]`: an object, or the head of an array or record.
    Object(u16),
    /// `[1A00sub1]`: an object with a sub-index.
    Sub(u16, u8),
    /// `[1A00Name]`: names of compact sub-indices.
    Names(u16),
    /// `[1A00Value]`: values of compact sub-indices.
    Values(u16),
    /// `[1A00Denotation]`: denotations of compact sub-indices.
    Denotations(u16),
    /// `[1A00ObjectLinks]`: links between objects.
    Links(u16),
    /// Any other title.
    Other(&'t str),
}

/// Sections with a fixed name in CiA 306, in the order they are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Heading {
    /// `[FileInfo]`: version, author and dates of the file.
    FileInfo,
    /// `[DeviceInfo]`: identity, bit rates and features of the device.
    DeviceInfo,
    /// `[DeviceComissioning]`: node-id and bit rate in this system; only in a DCF.
    Commissioning,
    /// `[DummyUsage]`: data types that may be dummies in RPDOs.
    DummyUsage,
    /// `[Comments]`: free text in numbered lines.
    Comments,
    /// `[MandatoryObjects]`.
    Mandatory,
    /// `[OptionalObjects]`.
    Optional,
    /// `[ManufacturerObjects]`.
    Manufacturer,
}

/// Names of the sections. The standard misspells `DeviceComissioning`.
const NAMES: [(Heading, &str); 8] = [
    (Heading::FileInfo, "FileInfo"),
    (Heading::DeviceInfo, "DeviceInfo"),
    (Heading::Commissioning, "DeviceComissioning"),
    (Heading::DummyUsage, "DummyUsage"),
    (Heading::Comments, "Comments"),
    (Heading::Mandatory, "MandatoryObjects"),
    (Heading::Optional, "OptionalObjects"),
    (Heading::Manufacturer, "ManufacturerObjects"),
];

/// Common spelling of `DeviceComissioning`.
const COMMISSIONING: &str = "DeviceCommissioning";

impl Heading {
    /// Lists of objects.
    pub const LISTS: [Self; 3] = [Self::Mandatory, Self::Optional, Self::Manufacturer];

    /// Name in CiA 306.
    pub fn name(self) -> &'static str {
        NAMES.into_iter().find(|(named, _)| *named == self).map_or("", |(_, name)| name)
    }

    /// Returns the list of an object (CiA 306, 4.5.2).
    pub fn list_of(index: u16) -> Self {
        const MANDATORY: [u16; 3] =
            [Object::DEVICE_TYPE.index, Object::ERROR_REGISTER.index, Object::VENDOR_ID.index];
        match index {
            _ if MANDATORY.contains(&index) => Self::Mandatory,
            0x2000..=0x5FFF => Self::Manufacturer,
            _ => Self::Optional,
        }
    }
}

impl<'t> Title<'t> {
    /// Parses a title.
    pub fn parse(name: &'t str) -> Self {
        let objects = name.split_at_checked(4).and_then(|(index, rest)| {
            let index = hexadecimal(index)?;
            let is = |word: &str| rest.eq_ignore_ascii_case(word);
            match rest {
                "" => Some(Self::Object(index)),
                _ if is("Name") => Some(Self::Names(index)),
                _ if is("Value") => Some(Self::Values(index)),
                _ if is("Denotation") => Some(Self::Denotations(index)),
                _ if is("ObjectLinks") => Some(Self::Links(index)),
                _ => {
                    let (word, sub) = rest.split_at_checked(3)?;
                    let sub = u8::try_from(hexadecimal(sub)?).ok()?;
                    word.eq_ignore_ascii_case("sub").then_some(Self::Sub(index, sub))
                }
            }
        });
        objects.or_else(|| named(name).map(Self::Named)).unwrap_or(Self::Other(name))
    }
}

/// Spelling of CiA 306.
impl fmt::Display for Title<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Named(named) => f.write_str(named.name()),
            Self::Object(index) => write!(f, "{index:04X}"),
            Self::Sub(index, sub) => write!(f, "{index:04X}sub{sub:X}"),
            Self::Names(index) => write!(f, "{index:04X}Name"),
            Self::Values(index) => write!(f, "{index:04X}Value"),
            Self::Denotations(index) => write!(f, "{index:04X}Denotation"),
            Self::Links(index) => write!(f, "{index:04X}ObjectLinks"),
            Self::Other(name) => f.write_str(name),
        }
    }
}

fn named(name: &str) -> Option<Heading> {
    let found = NAMES.into_iter().find(|(_, known)| known.eq_ignore_ascii_case(name));
    let misspelt = name.eq_ignore_ascii_case(COMMISSIONING).then_some(Heading::Commissioning);
    found.map(|(named, _)| named).or(misspelt)
}

fn hexadecimal(text: &str) -> Option<u16> {
    let is_number = text.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_number.then(|| u16::from_str_radix(text, 16).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn title_is_case_insensitive() {
        for (name, title, written) in [
            ("1a00", Title::Object(0x1A00), "1A00"),
            ("1A00SUB1", Title::Sub(0x1A00, 1), "1A00sub1"),
            ("1018Sub0A", Title::Sub(0x1018, 10), "1018subA"),
            ("1003value", Title::Values(0x1003), "1003Value"),
            ("2000NAME", Title::Names(0x2000), "2000Name"),
            ("dummyusage", Title::Named(Heading::DummyUsage), "DummyUsage"),
            ("DeviceCommissioning", Title::Named(Heading::Commissioning), "DeviceComissioning"),
            ("Tools", Title::Other("Tools"), "Tools"),
            ("1018sub100", Title::Other("1018sub100"), "1018sub100"),
            ("1018sub", Title::Other("1018sub"), "1018sub"),
            ("+100", Title::Other("+100"), "+100"),
            ("10é", Title::Other("10é"), "10é"),
        ] {
            assert_eq!(
                (Title::parse(name), title.to_string().as_str()),
                (title, written),
                "{name}"
            );
        }
    }
}
