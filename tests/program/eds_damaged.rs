//! EDS files that are damaged, oversized or arbitrary bytes: parsed or refused, and written as they were read.

use proptest::prelude::*;

use crate::common::prelude::*;
use crate::eds::{ALL, DRIVE, SWITCHES};
use canopen_tools::sheet::Sheet;
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
