//! Electronic data sheets (CiA 306): what a device's maker says is in its object dictionary.
//!
//! Only what is described, not what a device holds: that is a
//! [`Dictionary`](crate::canopen::dictionary::Dictionary). Tolerant of what real files have, strict
//! about numbers: what is wrong is told with its line.

use thiserror::Error;

use crate::canopen::NodeId;
use crate::canopen::ini::Entry;
use crate::canopen::ini::Ini;
use crate::canopen::ini::LARGEST;
use crate::canopen::ini::Section;
use crate::canopen::object::Object;

/// Object types that have sub-indices (CiA 301, 7.4.3).
const ARRAY: i64 = 8;
const RECORD: i64 = 9;

/// Why a file is no EDS.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum EdsError {
    /// Too large to be one.
    #[error("larger than 4 MiB")]
    TooLarge,
    /// A line that is neither a section, a `key=value` nor a comment.
    #[error("line {0}: neither [section] nor key=value")]
    Line(usize),
    /// No objects at all.
    #[error("no object is described")]
    Empty,
    /// A section that must be there.
    #[error("line {line}: [{section}] is listed but not described")]
    Missing {
        /// Where it is listed.
        line: usize,
        /// Its name.
        section: String,
    },
    /// An object described twice.
    #[error("line {line}: [{section}] is described twice")]
    Twice {
        /// Where it is described again.
        line: usize,
        /// Its name.
        section: String,
    },
    /// A value that is none.
    #[error("line {line}: [{section}] {key} = {value}: {reason}")]
    Value {
        /// Its line.
        line: usize,
        /// Its section.
        section: String,
        /// Its key.
        key: String,
        /// What stands there.
        value: String,
        /// Why not.
        reason: &'static str,
    },
}

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

/// A number, or the node-id plus a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    /// The number.
    pub value: i64,
    /// Whether the node-id comes on top.
    pub plus_node_id: bool,
}

impl Number {
    /// For one node.
    pub fn resolve(self, node: NodeId) -> i64 {
        if self.plus_node_id {
            self.value.saturating_add(i64::from(node.raw()))
        } else {
            self.value
        }
    }
}

/// One object as it is described.
#[derive(Clone, Debug, PartialEq)]
pub struct Described {
    /// Which.
    pub object: Object,
    /// What its maker calls it.
    pub name: String,
    /// Data type, by its number in CiA 301, 7.4.7.1.
    pub data_type: u16,
    /// Who may do what with it.
    pub access: Access,
    /// What it holds after power-up, as it is written.
    pub default: String,
    /// The same as a number, for types that are numbers.
    pub number: Option<Number>,
    /// The lowest value it takes.
    pub low: Option<i64>,
    /// The highest value it takes.
    pub high: Option<i64>,
    /// Whether it may be mapped into a PDO.
    pub is_mappable: bool,
}

/// A whole data sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct Eds {
    vendor: u32,
    product: u32,
    dummies: Vec<u16>,
    objects: Vec<Described>,
}

impl Eds {
    /// Reads a file.
    ///
    /// # Errors
    /// The first thing that is wrong with it.
    pub fn parse(bytes: &[u8]) -> Result<Self, EdsError> {
        if bytes.len() > LARGEST {
            return Err(EdsError::TooLarge);
        }
        let ini = Ini::read(bytes).map_err(EdsError::Line)?;
        let mut objects = Vec::new();
        for section in ini.sections() {
            if let Some(place) = place(&section.name) {
                describe(&ini, section, place, &mut objects)?;
            }
        }
        objects.sort_by_key(|described: &(usize, Described)| described.1.object);
        for (before, (line, again)) in objects.iter().zip(objects.iter().skip(1)) {
            if before.1.object == again.object {
                let section = format!("{:04X}sub{:X}", again.object.index, again.object.sub);
                return Err(EdsError::Twice { line: *line, section });
            }
        }
        let objects: Vec<_> = objects.into_iter().map(|(_, described)| described).collect();
        if objects.is_empty() {
            return Err(EdsError::Empty);
        }
        listed(&ini, &objects)?;
        let device = ini.section("DEVICEINFO");
        let of_device = |key| device.map_or(Ok(0), |section| unsigned(section, key));
        Ok(Self {
            vendor: of_device("VENDORNUMBER")?,
            product: of_device("PRODUCTNUMBER")?,
            dummies: dummies(&ini),
            objects,
        })
    }

    /// Vendor-ID, zero if the file does not say.
    pub const fn vendor(&self) -> u32 {
        self.vendor
    }

    /// Product code, zero if the file does not say.
    pub const fn product(&self) -> u32 {
        self.product
    }

    /// Whether the device skips bits of an RPDO for this data type (`[DummyUsage]`).
    pub fn dummy(&self, index: u16) -> bool {
        self.dummies.contains(&index)
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
}

/// The data types that may stand for bits nobody takes.
fn dummies(ini: &Ini) -> Vec<u16> {
    let Some(section) = ini.section("DUMMYUSAGE") else { return Vec::new() };
    let is_used = |index: &u16| {
        section.value(&format!("DUMMY{index:04X}")).is_some_and(|entry| entry.value != "0")
    };
    (0x0001..=0x0007).filter(is_used).collect()
}

/// Where a section's object is: `1A00`, or `1A00SUB1`; `None` for every other section.
fn place(name: &str) -> Option<(u16, Option<u8>)> {
    let (index, sub) = match name.split_once("SUB") {
        Some((index, sub)) => (index, Some(u8::from_str_radix(sub, 16).ok()?)),
        None => (name, None),
    };
    let is_index = index.len() == 4 && index.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_index.then(|| u16::from_str_radix(index, 16).ok()).flatten().map(|index| (index, sub))
}

/// Appends the objects a section describes: none for the head of an array or record, whose
/// sub-indices have sections of their own, unless they are told compactly.
fn describe(
    ini: &Ini,
    section: &Section,
    (index, sub): (u16, Option<u8>),
    objects: &mut Vec<(usize, Described)>,
) -> Result<(), EdsError> {
    let kind = section.value("OBJECTTYPE").map(|entry| integer(section, entry)).transpose()?;
    let is_head = sub.is_none() && matches!(kind, Some(ARRAY | RECORD));
    if !is_head {
        let object = Object { index, sub: sub.unwrap_or(0) };
        objects.push((section.line, one(section, object)?));
        return Ok(());
    }
    let Some(compact) = section.value("COMPACTSUBOBJ") else { return Ok(()) };
    let count = integer(section, compact)?;
    let count = u8::try_from(count).map_err(|_| wrong(section, compact, "not within 0 and 254"))?;
    let head = one(section, Object { index, sub: 0 })?;
    let own_sub0 = ini.section(&format!("{index:04X}SUB0")).is_some();
    if !own_sub0 {
        let number = Some(Number { value: i64::from(count), plus_node_id: false });
        let default = count.to_string();
        let access = Access::Constant;
        let sub0 = Described { data_type: UNSIGNED8, access, number, default, ..head.clone() };
        objects
            .push((section.line, Described { low: None, high: None, is_mappable: false, ..sub0 }));
    }
    for sub in 1..=count {
        if ini.section(&format!("{index:04X}SUB{sub:X}")).is_none() {
            objects
                .push((section.line, Described { object: Object { index, sub }, ..head.clone() }));
        }
    }
    Ok(())
}

/// The data type of sub-index 0 of every array and record.
const UNSIGNED8: u16 = 5;

/// The one object a section describes.
fn one(section: &Section, object: Object) -> Result<Described, EdsError> {
    let data_type = section
        .value("DATATYPE")
        .map_or(Ok(i64::from(UNSIGNED8)), |entry| integer(section, entry))?;
    let data_type = u16::try_from(data_type).unwrap_or(u16::MAX);
    let limit = |key| section.value(key).map(|entry| integer(section, entry)).transpose();
    let default = section.value("DEFAULTVALUE");
    let number = match default {
        Some(entry) if is_number(data_type) => Some(number(section, entry)?),
        Some(_) | None => None,
    };
    let is_numeric = is_number(data_type);
    Ok(Described {
        object,
        name: section.value("PARAMETERNAME").map(|entry| entry.value.clone()).unwrap_or_default(),
        data_type,
        access: access(section)?,
        default: default.map(|entry| entry.value.clone()).unwrap_or_default(),
        number,
        low: if is_numeric { limit("LOWLIMIT")? } else { None },
        high: if is_numeric { limit("HIGHLIMIT")? } else { None },
        is_mappable: section.value("PDOMAPPING").is_some_and(|entry| entry.value != "0"),
    })
}

/// Whether values of a type are whole numbers: BOOLEAN, INTEGERn, UNSIGNEDn.
pub(super) const fn is_number(data_type: u16) -> bool {
    matches!(data_type, 0x01..=0x07 | 0x10 | 0x12..=0x16 | 0x18..=0x1B)
}

fn access(section: &Section) -> Result<Access, EdsError> {
    let Some(entry) = section.value("ACCESSTYPE") else { return Ok(Access::ReadOnly) };
    match entry.value.to_ascii_lowercase().as_str() {
        "const" => Ok(Access::Constant),
        "ro" => Ok(Access::ReadOnly),
        "wo" => Ok(Access::WriteOnly),
        "rw" => Ok(Access::ReadWrite),
        "rwr" => Ok(Access::ReadWriteInput),
        "rww" => Ok(Access::ReadWriteOutput),
        _ => Err(wrong(section, entry, "none of const, ro, wo, rw, rwr, rww")),
    }
}

/// Every object that is listed must be described.
fn listed(ini: &Ini, objects: &[Described]) -> Result<(), EdsError> {
    for list in ["MANDATORYOBJECTS", "OPTIONALOBJECTS", "MANUFACTUREROBJECTS"] {
        let Some(section) = ini.section(list) else { continue };
        let count = unsigned(section, "SUPPORTEDOBJECTS")?;
        for place in 1..=count.min(u32::from(u16::MAX)) {
            let Some(entry) = section.value(&place.to_string()) else { continue };
            let index = integer(section, entry)?;
            let known = objects.binary_search_by_key(&index, |one| i64::from(one.object.index));
            if known.is_err() {
                let section = format!("{index:04X}");
                return Err(EdsError::Missing { line: entry.line, section });
            }
        }
    }
    Ok(())
}

fn unsigned(section: &Section, key: &str) -> Result<u32, EdsError> {
    let Some(entry) = section.value(key) else { return Ok(0) };
    let value = integer(section, entry)?;
    u32::try_from(value).map_err(|_| wrong(section, entry, "not within 32 bits"))
}

fn integer(section: &Section, entry: &Entry) -> Result<i64, EdsError> {
    whole(&entry.value).ok_or_else(|| wrong(section, entry, "not a number"))
}

/// A number, with `$NODEID` before or behind it.
fn number(section: &Section, entry: &Entry) -> Result<Number, EdsError> {
    let text = entry.value.to_ascii_uppercase();
    let Some((before, behind)) = text.split_once("$NODEID") else {
        let value = integer(section, entry)?;
        return Ok(Number { value, plus_node_id: false });
    };
    let before = before.trim().trim_end_matches('+').trim();
    let behind = behind.trim().trim_start_matches('+').trim();
    let parts = [before, behind].into_iter().filter(|part| !part.is_empty());
    let sum = parts.map(whole).try_fold(0_i64, |sum, part| sum.checked_add(part?));
    let value = sum.ok_or_else(|| wrong(section, entry, "not $NODEID plus a number"))?;
    Ok(Number { value, plus_node_id: true })
}

/// A whole number: `0x1F`, `31`, `-5`, `037` in octal as C has it, `001`.
fn whole(text: &str) -> Option<i64> {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |digits| (-1, digits));
    let lower = digits.to_ascii_lowercase();
    let (radix, digits) = match lower.strip_prefix("0x") {
        Some(digits) => (16, digits),
        None if lower.len() > 1 && lower.starts_with('0') => (8, lower.as_str()),
        None => (10, lower.as_str()),
    };
    let is_digits = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_digits.then(|| i64::from_str_radix(digits, radix).ok()).flatten().map(|value| sign * value)
}

fn wrong(section: &Section, entry: &Entry, reason: &'static str) -> EdsError {
    EdsError::Value {
        line: entry.line,
        section: section.name.clone(),
        key: entry.key.clone(),
        value: entry.value.chars().take(40).collect(),
        reason,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DRIVE: &[u8] = include_bytes!("../../eds/frhc_drive.eds");

    #[test]
    fn the_shipped_drive_is_described() {
        let eds = Eds::parse(DRIVE).unwrap();
        assert_eq!((eds.vendor(), eds.product()), (0xF8C, 0x0402_0010));
        let torque = eds.object(Object::TARGET_TORQUE).unwrap();
        assert_eq!(
            (torque.low, torque.high, torque.is_mappable),
            (Some(-3_000), Some(3_000), true)
        );
        assert!(torque.access.is_output() && torque.access.is_writable());
        let cob_id = eds.object(Object::tpdo_communication(1, 1)).unwrap().number.unwrap();
        assert_eq!(cob_id.resolve(NodeId::new(3).unwrap()), 0x183);
    }

    /// A file of one object, with a value put in.
    fn with(key: &str, value: &str) -> Result<Described, EdsError> {
        let text = format!("[2000]\nDataType=0x0007\nAccessType=rw\n{key}={value}\n");
        Ok(Eds::parse(text.as_bytes())?.objects()[0].clone())
    }

    #[test]
    fn numbers_are_read_as_real_files_write_them() {
        for (text, value) in [
            ("0x1F", 31),
            ("31", 31),
            ("001", 1),
            ("037", 31),
            ("-5", -5),
            ("0X1f", 31),
            (" 7 ", 7),
        ] {
            let number = with("DefaultValue", text).unwrap().number.unwrap();
            assert_eq!((number.value, number.plus_node_id), (value, false), "{text}");
        }
        for text in ["$NODEID+0x180", "0x180+$NODEID", "$nodeid + 384"] {
            let number = with("DefaultValue", text).unwrap().number.unwrap();
            assert_eq!((number.value, number.plus_node_id), (0x180, true), "{text}");
        }
    }

    #[test]
    fn a_wrong_value_is_told_with_its_line() {
        let error = with("DefaultValue", "0xZZ").unwrap_err();
        assert_eq!(error.to_string(), "line 4: [2000] DEFAULTVALUE = 0xZZ: not a number");
        let error = with("AccessType2", "").and(with("LowLimit", "much")).unwrap_err();
        assert_eq!(error.to_string(), "line 4: [2000] LOWLIMIT = much: not a number");
    }

    #[test]
    fn what_is_listed_must_be_described() {
        let text = b"[OptionalObjects]\nSupportedObjects=1\n1=0x2001\n[2000]\nDataType=5\n";
        let error = Eds::parse(text).unwrap_err();
        assert_eq!(error.to_string(), "line 3: [2001] is listed but not described");
    }

    #[test]
    fn real_files_have_marks_latin_1_and_odd_line_ends() {
        let text =
            b"\xEF\xBB\xBF; a comment\r\n[2000]\r\nParameterName=Torque\r\nDataType=0x0005 \r\n";
        assert_eq!(Eds::parse(text).unwrap().objects().len(), 1);
        let latin = b"[2000]\nParameterName=Temp\xB0\nDataType=5\n";
        assert_eq!(Eds::parse(latin).unwrap().objects()[0].name, "Temp°");
    }

    #[test]
    fn a_compact_array_has_all_its_entries() {
        let text =
            b"[2000]\nObjectType=8\nDataType=6\nAccessType=rw\nCompactSubObj=3\nDefaultValue=9\n";
        let eds = Eds::parse(text).unwrap();
        let subs: Vec<_> =
            eds.objects().iter().map(|one| (one.object.sub, one.data_type)).collect();
        assert_eq!(subs, [(0, 5), (1, 6), (2, 6), (3, 6)]);
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            Eds::parse(&bytes).ok();
        }

        #[test]
        fn a_spoilt_file_is_read_or_refused(at in 0..DRIVE.len(), byte in any::<u8>()) {
            let mut bytes = DRIVE.to_vec();
            bytes[at] = byte;
            Eds::parse(&bytes).ok();
        }
    }
}
