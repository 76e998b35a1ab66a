//! EDS and DCF files: parsing of real files, findings of `frhc check --eds`, and the DCFs of `frhc export dcf`.
//!
//! `GOLDEN=write cargo test --test program eds::` rewrites the golden files; check the difference before you
//! commit it.
#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::fs;
use std::path::Path;

use proptest::prelude::*;

use crate::common::cli::{folder, frhc};
use canopen::NodeId;
use canopen::eds::{Access, Eds, EdsObject, Severity};
use canopen::layout::Direction;
use canopen::object::Object;
use canopen_tools::concise;
use canopen_tools::sheet::Sheet;
use config::Config;

const DRIVE: &[u8] = include_bytes!("../../eds/frhc_drive.eds");
const SWITCHES: &[u8] = include_bytes!("../../eds/frhc_switches.eds");
const WINDOWS: &[u8] = include_bytes!("../eds_files/windows.eds");
const COMPACT: &[u8] = include_bytes!("../eds_files/compact.dcf");
const EDITOR: &[u8] = include_bytes!("../eds_files/editor.eds");
const BAD: &[u8] = include_bytes!("../eds_files/bad.eds");
const ALL: [&[u8]; 6] = [DRIVE, SWITCHES, WINDOWS, COMPACT, EDITOR, BAD];

fn node(raw: u8) -> NodeId {
    NodeId::new(raw).unwrap()
}

fn object(eds: &Eds, index: u16, sub: u8) -> &EdsObject {
    eds.object(Object { index, sub }).unwrap()
}

fn initial(eds: &Eds, index: u16, sub: u8) -> Vec<u8> {
    object(eds, index, sub).initial(node(3))
}

/// Returns the numbers of errors and warnings.
fn count(bytes: &[u8]) -> (usize, usize) {
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
            "00000F8Dh, but the default of 1018h:1 is 00000F8Ch",
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

/// Checks that two files describe the same device.
fn assert_same(one: &Eds, other: &Eds) {
    assert_eq!(one.objects(), other.objects());
    assert_eq!(one.device(), other.device());
    assert_eq!(one.commissioning(), other.commissioning());
    assert!((0..9).all(|index| one.dummy(index) == other.dummy(index)));
}

#[test]
fn written_file_describes_the_same_device() {
    for bytes in ALL {
        let eds = Eds::parse(bytes).unwrap();
        let written = Sheet::from_eds(&eds).write();
        let again = Eds::parse(&written).unwrap();
        assert_same(&eds, &again);
        assert_eq!(Sheet::from_eds(&again).write(), written, "written form is stable");
    }
}

#[test]
fn shipped_files_are_written_without_changes() {
    let sorted = |bytes: &[u8]| {
        let text = String::from_utf8(bytes.to_vec()).unwrap().replace("\r\n", "\n");
        let mut lines: Vec<_> = text.lines().map(str::to_owned).collect();
        lines.sort();
        lines
    };
    for bytes in [DRIVE, SWITCHES] {
        assert_eq!(
            sorted(&Sheet::from_eds(&Eds::parse(bytes).unwrap()).write()),
            sorted(bytes),
            "all lines are kept"
        );
    }
}

#[test]
fn oversized_files_are_refused() {
    let refusal = |text: String| Eds::parse(text.as_bytes()).unwrap_err().to_string();
    let compact = |name: &str| {
        let array =
            |index| format!("[{index:04X}]\nParameterName={name}\nDataType=5\nCompactSubObj=254\n");
        (0x2000..0x2400).map(array).collect::<String>()
    };
    let too_many = "more objects are described than any device has";
    assert_eq!(refusal(compact("x")), too_many);
    assert_eq!(refusal(compact(&"x".repeat(1_500))), too_many);
    assert_eq!(refusal("[x]\n".repeat(200_000)), too_many);
    assert_eq!(refusal("=\n".repeat(500_000)), "more than 200000 lines");
    assert_eq!(refusal(" ".repeat((2 << 20) + 1)), "larger than 2 MiB");
    assert_eq!(refusal("DataType=7\n[Tools]\n".to_owned()), "no object is described");
}

/// Corrupts one place of a file.
fn corrupt(bytes: &mut Vec<u8>, kind: u8, at: usize, byte: u8) {
    let at = at % bytes.len();
    match kind % 5 {
        0 => bytes[at] = byte,
        1 => bytes.insert(at, byte),
        2 => drop(bytes.remove(at)),
        3 => bytes.truncate(at + 1),
        _ => {
            // Repeat a line elsewhere.
            let line = bytes.split(|byte| *byte == b'\n').nth(at % 100).unwrap_or_default();
            let line = [line, b"\n"].concat();
            bytes.splice(at..at, line);
        }
    }
}

/// Parses, lints and writes a file; the written one must describe the same device.
fn assert_round_trip(bytes: &[u8]) {
    let Ok(eds) = Eds::parse(bytes) else { return };
    eds.lint();
    assert_same(&eds, &Eds::parse(&Sheet::from_eds(&eds).write()).unwrap());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn any_bytes_are_parsed_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        assert_round_trip(&bytes);
    }

    #[test]
    fn any_eds_like_text_is_parsed_or_refused(text in "(\\[(1[0468A]0[0-3](sub[0-9A])?|20[0-3][0-9](Value|Name)?|DeviceInfo)\\]\n|(ParameterName|DataType|DefaultValue|LowLimit|CompactSubObj|SubNumber|ObjectType|CompactPDO|NrOfRXPDO|[1-9])=(0x[0-9A-F]{1,8}|[0-9]{1,5}|\\$NODEID\\+[0-9]+|.{0,5})\n){0,60}") {
        assert_round_trip(text.as_bytes());
    }

    #[test]
    fn corrupted_files_are_parsed_or_refused(
        file in 0..ALL.len(),
        changes in prop::collection::vec((any::<u8>(), any::<usize>(), any::<u8>()), 1..8),
    ) {
        let mut bytes = ALL[file].to_vec();
        for (kind, at, byte) in changes {
            if !bytes.is_empty() {
                corrupt(&mut bytes, kind, at, byte);
            }
        }
        assert_round_trip(&bytes);
    }
}

/// Compares with a file in tests/golden, line by line.
fn compare(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    if std::env::var_os("GOLDEN").is_some_and(|word| word == "write") {
        fs::write(path, text).unwrap();
        return;
    }
    let golden = fs::read_to_string(&path).unwrap();
    for (number, (is, was)) in (1..).zip(text.lines().zip(golden.lines())) {
        assert_eq!(is, was, "{name}:{number}");
    }
    assert_eq!(text, golden, "{name}");
}

#[test]
fn findings_of_a_bad_file_are_listed_by_line() {
    let outcome = frhc(&["check", "--eds", "tests/eds_files/bad.eds"]);
    compare("bad_eds.txt", &outcome.stdout);
    let (errors, warnings) = count(BAD);
    let expected = format!("frhc: {errors} errors, {warnings} warnings\n");
    assert_eq!((outcome.code, outcome.stderr), (1, expected));
    for line in outcome.stdout.lines() {
        let rest = line.strip_prefix("tests/eds_files/bad.eds:").unwrap();
        let (number, rest) = rest.split_once(": ").unwrap();
        assert!(number.parse::<u32>().is_ok(), "{line}");
        assert!(rest.starts_with("error: ") || rest.starts_with("warning: "), "{line}");
    }
}

#[test]
fn findings_are_written_as_json() {
    let outcome = frhc(&[
        "check",
        "--json",
        "--eds",
        "tests/eds_files/bad.eds",
        "--eds",
        "eds/frhc_drive.eds",
    ]);
    assert_eq!(outcome.code, 1);
    let report: serde_json::Value = serde_json::from_str(&outcome.stdout).unwrap();
    let (errors, warnings) = count(BAD);
    assert_eq!(report["ok"], false);
    assert_eq!((&report["errors"], &report["warnings"]), (&errors.into(), &warnings.into()));
    assert_eq!(report["files"][0]["findings"].as_array().unwrap().len(), errors + warnings);
    assert_eq!(report["files"][1]["findings"].as_array().unwrap().len(), 0);
    assert_eq!(report["files"][1]["objects"].as_u64(), Some(260));
}

#[test]
fn check_ends_with_its_exit_code() {
    let folder = folder("eds", "codes");
    let file = |name: &str, bytes: &[u8]| {
        fs::write(folder.join(name), bytes).unwrap();
        folder.join(name).to_str().unwrap().to_owned()
    };
    for (path, code, word) in [
        ("eds/frhc_drive.eds".to_owned(), 0, ""),
        ("tests/eds_files/windows.eds".to_owned(), 0, ""),
        (file("empty.eds", b""), 3, "no object is described"),
        (
            file("binary.eds", &(0..=255).cycle().take(100_000).collect::<Vec<u8>>()),
            3,
            "no object is described",
        ),
        (file("large.eds", &vec![b' '; 5 << 20]), 3, "larger than 4 MiB"),
        (folder.to_str().unwrap().to_owned(), 3, "is a directory"),
        ("/dev/zero".to_owned(), 3, "must be a regular file"),
        (folder.join("none.eds").to_str().unwrap().to_owned(), 3, "No such file"),
    ] {
        let outcome = frhc(&["check", "--eds", &path]);
        assert_eq!(outcome.code, code, "{path}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(word), "{path}: {}", outcome.stderr);
        if code == 3 {
            assert!(outcome.stderr.contains(&path) && outcome.stdout.is_empty());
        }
    }
    assert_eq!(frhc(&["check"]).code, 2);
    assert_eq!(frhc(&["check", "--eds", "a.eds", "--config", "b.toml"]).code, 2);
}

const CONFIG: &str = "config/kraft_like.toml";

#[test]
fn check_of_a_configuration_counts_the_errors_of_its_eds() {
    let folder = folder("eds", "doubt");
    let drive = std::str::from_utf8(DRIVE).unwrap();
    fs::write(folder.join("drive.eds"), drive.replacen("SubNumber=9", "SubNumber=7", 1)).unwrap();
    fs::write(folder.join("switches.eds"), SWITCHES).unwrap();
    let text = fs::read_to_string(CONFIG).unwrap().replace("../eds/frhc_", "");
    let file = folder.join("frhc.toml");
    fs::write(&file, text).unwrap();
    let check =
        |args: &[&str]| frhc(&[&["check", "--config", file.to_str().unwrap()], args].concat());
    let outcome = check(&[]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (0, ""));
    let lines: Vec<_> = outcome.stdout.lines().filter(|line| line.starts_with("eds ")).collect();
    let drive = folder.join("drive.eds");
    assert_eq!(lines, [format!("eds   {}: 1 error; see frhc check --eds", drive.display())]);
    let report: serde_json::Value = serde_json::from_str(&check(&["--json"]).stdout).unwrap();
    assert_eq!(report["eds"].as_array().unwrap().len(), 6);
    assert_eq!(report["eds"][5]["node"], "roll");
}

#[test]
fn dcf_of_each_node_matches_its_plan() {
    let out = folder("eds", "dcf").join("new");
    let outcome = frhc(&["export", "dcf", "--config", CONFIG, "--out", out.to_str().unwrap()]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (0, ""));
    let config = Config::load(Path::new(CONFIG)).unwrap();
    let names: Vec<_> =
        outcome.stdout.lines().map(|line| line.rsplit('/').next().unwrap()).collect();
    assert_eq!(names.len(), 7);
    assert_eq!(fs::read_dir(&out).unwrap().count(), 7, "no temporary files");
    for (name, (_, plan)) in names.iter().zip(config.node_plans()) {
        let bytes = fs::read(out.join(name)).unwrap();
        let eds = Eds::parse(&bytes).unwrap();
        assert_eq!(eds.lint(), [], "{name}");
        assert_eq!(eds.commissioning().unwrap().node, Some(plan.node));
        let configured = |object| eds.object(object).unwrap().configured(plan.node);
        let mut expected = std::collections::BTreeMap::new();
        for (object, value) in plan.pdos.iter().flat_map(|pdo| pdo.writes()) {
            expected.insert(object, canopen::sdo::bytes(&value));
        }
        for (object, value) in &plan.safety {
            expected.insert(*object, canopen::sdo::bytes(value));
        }
        for (object, value) in
            expected.into_iter().filter(|(object, _)| eds.object(*object).is_some())
        {
            assert_eq!(configured(object), Some(value), "{name}: {object}");
        }
        assert_eq!(
            configured(Object::PRODUCER_HEARTBEAT),
            Some(plan.error_control.period_ms().to_le_bytes().to_vec())
        );
        assert_eq!(configured(Object::DEVICE_TYPE), None);
    }
    let elbow = fs::read(out.join("3_elbow.dcf")).unwrap();
    compare("3_elbow.dcf", std::str::from_utf8(&elbow).unwrap());
}

#[test]
fn concise_dcf_contains_every_download_in_order() {
    let out = folder("eds", "concise");
    let args = ["export", "dcf", "--concise", "--config", CONFIG, "--out", out.to_str().unwrap()];
    assert_eq!(frhc(&args).code, 0);
    let config = Config::load(Path::new(CONFIG)).unwrap();
    let (_, plan) = &config.node_plans()[2];
    let downloads = concise::decode(&fs::read(out.join("3_elbow.cdcf")).unwrap()).unwrap();
    let mut rest = downloads.iter();
    for (object, value) in plan.pdos.iter().flat_map(|pdo| pdo.writes()) {
        let content = canopen::sdo::bytes(&value);
        let found = rest.find(|download| download.object == object);
        assert_eq!(found.map(|found| &found.content), Some(&content), "{object}");
    }
    assert_eq!(downloads.last().unwrap().object, Object::MODE_OF_OPERATION);
}

#[test]
fn failed_export_writes_no_file() {
    let folder = folder("eds", "whole");
    let out = folder.join("out");
    let args = ["export", "dcf", "--config", CONFIG, "--out", out.to_str().unwrap()];
    let export = |more: &[&str]| frhc(&[&args[..], more].concat());
    fs::write(&out, "a file").unwrap();
    let outcome = export(&[]);
    assert!(outcome.code != 0 && outcome.stderr.contains("out"), "{}", outcome.stderr);
    assert_eq!(fs::read(&out).unwrap(), b"a file");
    fs::remove_file(&out).unwrap();
    // A folder with the name of an output file.
    fs::create_dir_all(out.join("5_yaw.dcf")).unwrap();
    fs::write(out.join("3_elbow.dcf"), "mine").unwrap();
    for force in [&[][..], &["--force"]] {
        let outcome = export(force);
        let named = if force.is_empty() { "3_elbow.dcf exists" } else { "5_yaw.dcf" };
        assert!(outcome.code != 0 && outcome.stderr.contains(named), "{}", outcome.stderr);
        assert_eq!(fs::read_dir(&out).unwrap().count(), 2, "no temporary files");
        assert_eq!(fs::read(out.join("3_elbow.dcf")).unwrap(), b"mine");
    }
}

#[test]
fn dcf_export_is_reproducible() {
    let out = folder("eds", "twice");
    let args = [
        "export",
        "dcf",
        "--force",
        "--config",
        "config/jpl_like.toml",
        "--out",
        out.to_str().unwrap(),
    ];
    let written = || {
        let outcome = frhc(&args);
        assert_eq!(outcome.code, 0, "{}", outcome.stderr);
        let files = outcome.stdout.lines().map(|path| fs::read(path).unwrap()).collect::<Vec<_>>();
        assert_eq!(fs::read_dir(&out).unwrap().count(), files.len());
        files
    };
    assert_eq!(written(), written());
}

#[test]
fn dcf_of_real_drives_is_written_and_slips_are_named() {
    for (file, slip) in [
        ("maxon_epos4", ""),
        ("elmo_gold", "1016h:1 must be within 0..=65535"),
        ("technosoft_ipos", ""),
    ] {
        let out = folder("eds", file).join("new");
        let config = format!("config/drives/{file}.toml");
        let outcome = frhc(&["export", "dcf", "--config", &config, "--out", out.to_str().unwrap()]);
        assert_eq!(outcome.code, 0, "{file}: {}", outcome.stderr);
        assert_eq!(outcome.stderr.is_empty(), slip.is_empty(), "{file}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(slip), "{file}: {}", outcome.stderr);
        assert_eq!(fs::read_dir(&out).unwrap().count(), 7, "{file}");
    }
}
