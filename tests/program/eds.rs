//! EDS and DCF files: parsing of real files, findings of `frhc check --eds`, and the DCFs of `frhc export dcf`.
//!
//! `GOLDEN=write cargo test --test program eds::` rewrites the golden files; check the difference before you
//! commit it.

use crate::common::prelude::*;
use canopen::eds::{Access, EdsObject, Severity};
use canopen::layout::Direction;

pub(crate) const DRIVE: &[u8] = include_bytes!("../../eds/frhc_drive.eds");

pub(crate) const SWITCHES: &[u8] = include_bytes!("../../eds/frhc_switches.eds");

const WINDOWS: &[u8] = include_bytes!("../eds_files/windows.eds");

const COMPACT: &[u8] = include_bytes!("../eds_files/compact.dcf");

const EDITOR: &[u8] = include_bytes!("../eds_files/editor.eds");

pub(crate) const BAD: &[u8] = include_bytes!("../eds_files/bad.eds");

pub(crate) const ALL: [&[u8]; 6] = [DRIVE, SWITCHES, WINDOWS, COMPACT, EDITOR, BAD];

pub(crate) fn node(raw: u8) -> NodeId {
    NodeId::new(raw).unwrap()
}

fn object(eds: &Eds, index: u16, sub: u8) -> &EdsObject {
    eds.object(Object { index, sub }).unwrap()
}

fn initial(eds: &Eds, index: u16, sub: u8) -> Vec<u8> {
    object(eds, index, sub).initial(node(3))
}

/// Returns the numbers of errors and warnings.
pub(crate) fn count(bytes: &[u8]) -> (usize, usize) {
    let findings = Eds::parse(bytes).unwrap().lint();
    let errors = findings.iter().filter(|finding| finding.severity == Severity::Error).count();
    (errors, findings.len() - errors)
}

#[test]
fn file_of_a_windows_editor_is_parsed() {
    let eds = Eds::parse(WINDOWS).unwrap();
    assert_eq!((eds.vendor(), eds.product()), (0xABC, 1));
    assert_eq!(eds.device().vendor_name, "Müller & Söhne; C:\\new");
    assert_eq!(eds.device().bitrates, [500, 1_000]);
    assert!(eds.device().has_lss && eds.commissioning().is_none());
    assert_eq!((1..=8).filter(|index| eds.dummy(*index)).collect::<Vec<_>>(), [2, 5]);
    assert!(object(&eds, 0x1001, 0).is_mappable);
    assert_eq!(initial(&eds, 0x1000, 0), [0x92, 1, 0x42, 0]);
    assert_eq!(initial(&eds, 0x1001, 0), [0]);
    assert_eq!(initial(&eds, 0x1014, 0), [0x83, 0, 0, 0]);
    assert_eq!(initial(&eds, 0x1400, 1), [0x03, 2, 0, 0]);
    assert_eq!(object(&eds, 0x1018, 0).access, Access::Constant);
    assert_eq!(initial(&eds, 0x2000, 0), [1]);
    assert_eq!(initial(&eds, 0x2001, 0), 1.5_f32.to_le_bytes());
    assert_eq!(initial(&eds, 0x2002, 0), b"Temp \xB0C; see C:\\notes #3");
    assert_eq!(object(&eds, 0x2002, 0).name, "Note; for people");
    assert_eq!(initial(&eds, 0x2004, 0), [0xDE, 0xAD, 0xBE, 0xEF]);
    assert_eq!(initial(&eds, 0x2005, 0), [0xFF; 4]);
    let firmware = object(&eds, 0x2003, 0);
    assert_eq!((firmware.data_type, firmware.flags), (0xF, 3));
    assert_eq!(firmware.setting.download_file.as_deref(), Some("C:\\new\\firmware.bin"));
    let offset = object(&eds, 0x2005, 0);
    assert_eq!(offset.limits(node(3)), Some(-0x8000_0000..=0x7FFF_FFFF));
    let torque = object(&eds, 0x6071, 0);
    assert_eq!(torque.limits(node(3)), Some(-1_000..=1_000));
    let rpdo = eds.pdo(Direction::Receive, 1).unwrap();
    assert_eq!((rpdo.can_move, rpdo.can_map, rpdo.max_entries), (false, true, 2));
    assert_eq!(count(WINDOWS).0, 0, "warnings only");
}

#[test]
fn compact_sections_are_expanded() {
    let eds = Eds::parse(COMPACT).unwrap();
    let commissioning = eds.commissioning().unwrap();
    assert_eq!((commissioning.node, commissioning.bitrate), (Some(node(127)), Some(1_000)));
    assert_eq!(commissioning.node_name, "master");
    assert_eq!((commissioning.is_manager, commissioning.serial), (true, Some(0x1234_5678)));
    assert_eq!(initial(&eds, 0x1016, 0), [6]);
    assert_eq!(object(&eds, 0x1016, 2).name, "Consumer heartbeat time2");
    let configured = |index, sub| object(&eds, index, sub).configured(node(127));
    assert_eq!(configured(0x1016, 6), Some(vec![0x32, 0, 6, 0]));
    assert_eq!(configured(0x1016, 5), None);
    assert_eq!(configured(0x1F81, 2), Some(vec![5, 0, 0, 0]));
    assert_eq!(object(&eds, 0x2000, 2).name, "Second gain");
    assert_eq!(object(&eds, 0x2000, 2).setting.denotation.as_deref(), Some("Gain of the elbow"));
    assert_eq!(initial(&eds, 0x2000, 2), [9, 0]);
    assert_eq!((object(&eds, 0x2000, 3).data_type, initial(&eds, 0x2000, 3)), (5, vec![7]));
    // CompactPDO = 26h: sub-indices 1, 2 and 5 of each communication parameter.
    let subs = |index| eds.objects().iter().filter(|one| one.object.index == index).count();
    assert_eq!([0x1400, 0x1401, 0x1402, 0x1800, 0x1801].map(subs), [4, 4, 0, 4, 0]);
    assert_eq!([0x1600, 0x1601, 0x1A00].map(subs), [65; 3]);
    assert_eq!(initial(&eds, 0x1401, 1), [0x03, 3, 0, 0]);
    assert_eq!(eds.pdo(Direction::Transmit, 1).unwrap().max_entries, 64);
    assert_eq!(count(COMPACT), (0, 0));
}

#[test]
fn file_of_a_simple_editor_is_parsed() {
    let eds = Eds::parse(EDITOR).unwrap();
    assert_eq!(eds.vendor(), 0x1234, "from the identity object, as DeviceInfo has none");
    assert_eq!(initial(&eds, 0x2000, 0), [0x2C, 1], "the file types it as UNSIGNED16");
    assert_eq!(object(&eds, 0x1001, 0).access, Access::ReadOnly);
    assert_eq!(
        object(&eds, 0x1018, 0).number.unwrap().value,
        4,
        "record with the wrong object type"
    );
    assert_eq!(eds.objects().iter().filter(|one| one.object.index == 0x1018).count(), 3);
    let switch = object(&eds, 0x2001, 0);
    assert_eq!(
        (switch.low, switch.high, switch.number),
        (None, None, None),
        "invalid limits are ignored"
    );
    assert_eq!(initial(&eds, 0x2001, 0), [0]);
    assert!(eds.object(Object { index: 0x2002, sub: 0 }).is_none(), "empty array");
    let lint: Vec<_> = eds.lint().iter().map(ToString::to_string).collect();
    for finding in [
        "2001h DefaultValue: 0.0: not a number",
        "2001h HighLimit: 2: does not fit BOOLEAN; not used",
        "2002h: has no sub-indices: not read",
        "1018h ObjectType: must be an array or record, as there are sub-indices",
    ] {
        assert!(lint.iter().any(|found| found.contains(finding)), "{finding}: {lint:#?}");
    }
}

#[test]
fn line_ends_byte_order_marks_and_encodings_do_not_matter() {
    let text: String = WINDOWS.iter().copied().map(char::from).collect();
    let objects = Eds::parse(WINDOWS).unwrap().objects().to_vec();
    let utf16 = |text: &str| {
        let units = [0xFEFF].into_iter().chain(text.encode_utf16());
        units.flat_map(u16::to_le_bytes).collect::<Vec<_>>()
    };
    for variant in [
        text.clone().into_bytes(),
        [b"\xEF\xBB\xBF", text.as_bytes()].concat(),
        text.replace("\r\n", "\r").into_bytes(),
        text.replace("\r\n", "\n").into_bytes(),
        text.replace("\r\n", "  \t\r\n\r\n").into_bytes(),
        [text.as_bytes(), b"\0\x1A"].concat(),
        utf16(&text),
    ] {
        assert_eq!(Eds::parse(&variant).unwrap().objects(), objects);
    }
}

#[test]
fn shipped_files_have_no_findings() {
    for bytes in [DRIVE, SWITCHES] {
        assert_eq!(Eds::parse(bytes).unwrap().lint(), []);
    }
}

/// Findings in the drive's EDS with `from` replaced by `to`.
/// Files of `eds/drives` that have errors as their makers have them: limits exchanged or for some node-ids only.
const SLIPS_OF_MAKERS: [(&str, usize); 1] = [("faulhaber-3150.eds", 3)];

#[test]
fn data_sheets_of_real_drives_are_read() {
    let files = fs::read_dir("eds/drives").unwrap().map(|entry| entry.unwrap().path());
    let sheets = files.filter(|path| path.extension().is_some_and(|end| end == "eds"));
    let mut read = 0;
    for path in sheets {
        let bytes = fs::read(&path).unwrap();
        let name = path.file_name().unwrap().to_str().unwrap();
        let slips = SLIPS_OF_MAKERS.iter().find(|(file, _)| *file == name);
        assert_eq!(count(&bytes).0, slips.map_or(0, |(_, errors)| *errors), "{name}");
        let eds = Eds::parse(&bytes).unwrap();
        assert!(eds.truncation().is_none(), "{name}");
        assert!(eds.lint().iter().all(|finding| finding.gap.is_none()), "{name}");
        read += 1;
    }
    assert!(read >= 12, "{read}");
}

fn findings(from: &str, to: &str) -> Vec<String> {
    let text = std::str::from_utf8(DRIVE).unwrap();
    assert!(text.contains(from), "{from}");
    let eds = Eds::parse(text.replacen(from, to, 1).as_bytes()).unwrap();
    eds.lint().iter().map(ToString::to_string).collect()
}

#[test]
fn each_error_is_found_at_its_entry() {
    for (from, to, finding) in [
        (
            "SupportedObjects=3\n",
            "SupportedObjects=4\n",
            ": error: [MandatoryObjects] SupportedObjects: 4, but 3 are listed",
        ),
        (
            "112=0x67FF",
            "112=0x6800",
            ": error: [OptionalObjects] 112: 6800h is listed, but there is no [6800]",
        ),
        (
            "112=0x67FF",
            "113=0x67FF",
            ": error: [OptionalObjects] SupportedObjects: number 112 is missing, next is 113",
        ),
        ("112=0x67FF", "112=0x6800", ": warning: 67FFh: is in no list of objects"),
        ("[1001]\n", "[1002]\n", "1: error: 1001h: is mandatory, but not described"),
        ("Dummy0003=1", "Dummy0003=2", ": warning: [DummyUsage] Dummy0003: neither 0 nor 1"),
        ("NrOfRXPDO=4", "NrOfRXPDO=3", ": warning: [DeviceInfo] NrOfRXPDO: 3, but 4 are described"),
        (
            "0x00000F8C\nProductName",
            "0x00000F8D\nProductName",
            "00000F8Dh, but the default of 1018h:1, which counts, is 00000F8Ch",
        ),
        (
            "HighLimit=8\n",
            "HighLimit=-1\n",
            ": error: 1003h:0 HighLimit: -1: does not fit UNSIGNED8; not used",
        ),
        ("ParameterName=Error register\n", "", ": error: 1001h ParameterName: is missing"),
        (
            "SubNumber=9\n",
            "SubNumber=8\n",
            ": error: 1003h SubNumber: 8, but 9 sub-indices are described",
        ),
        (
            "DefaultValue=$NODEID+0x80\n",
            "DefaultValue=$NODEID+0x700\n",
            ": error: 1014h DefaultValue: 701h is restricted",
        ),
        (
            "DefaultValue=$NODEID+0x200\n",
            "DefaultValue=0x17F\n",
            ": error: 1400h:1 DefaultValue: 17Fh is restricted",
        ),
        (
            "DefaultValue=0x60410010",
            "DefaultValue=0x60410008",
            "maps 8 bits of 6041h, which has 16",
        ),
        (
            "DefaultValue=0x60410010",
            "DefaultValue=0x60420010",
            "maps 6042h, which is not described",
        ),
        (
            "[1029]\n",
            "[1029]\nSubNumber=2\n",
            ": warning: 1029h SubNumber: is repeated with the same value",
        ),
        ("[DummyUsage]", "[dummyusage]", ": warning: [dummyusage]: CiA 306 spells it [DummyUsage]"),
    ] {
        let findings = findings(from, to);
        assert!(findings.iter().any(|found| found.contains(finding)), "{finding}: {findings:#?}");
    }
}

#[test]
fn findings_have_line_numbers() {
    let line = |text: &str| {
        1 + std::str::from_utf8(DRIVE).unwrap().lines().position(|line| line == text).unwrap()
    };
    let found = findings("DefaultValue=$NODEID+0x80\n", "DefaultValue=$NODEID+0x800\n");
    let expected = format!(
        "{}: error: 1014h DefaultValue: 87Fh has more than 11 bits",
        line("DefaultValue=$NODEID+0x80")
    );
    assert_eq!(found, [expected]);
}

#[test]
fn dcf_of_a_device_not_commissioned_has_no_errors() {
    let of = |node: &str, rate: &str| {
        let section = format!("[DeviceComissioning]\nNodeID={node}\nBaudrate={rate}\n[DummyUsage]");
        findings("[DummyUsage]", &section)
    };
    let blank = of("0", "0");
    assert_eq!(blank.len(), 2, "{blank:#?}");
    let reason = ": 0: the device is not commissioned";
    assert!(
        blank.iter().all(|it| it.contains(": warning: ") && it.ends_with(reason)),
        "{blank:#?}"
    );
    assert_eq!(of("3", "1000"), [""; 0]);
    assert!(of("128", "300").iter().all(|finding| finding.contains(": error: ")));
}

#[test]
fn sections_of_modules_and_tools_are_accepted() {
    let sections = "[SupportedModules]\nNrOfEntries=1\n[M1ModuleInfo]\n[M1SubExt1027]\n[Tool1]\n";
    let found = findings("[DummyUsage]", &format!("{sections}[Toolbox]\n[DummyUsage]"));
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(found[0].ends_with(": warning: [Toolbox]: not a section of CiA 306"));
}
