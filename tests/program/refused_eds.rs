//! EDS files that are refused before any frame is sent, and slips of makers that are warnings.

use crate::common::prelude::*;
use crate::refused::{installation, is_refused};
use canopen::eds::Severity;
#[test]
fn hazard_18_invalid_eds_is_refused_by_name_before_the_bus() {
    let eds = fs::read_to_string("eds/frhc_drive.eds").unwrap();
    let cut = eds.split_once("[6071]").unwrap().0;
    for (place, (text, word)) in [
        (String::new(), "frhc_drive.eds"),
        ("not an EDS at all\n".to_owned(), "frhc_drive.eds"),
        (eds.replace("0x04020010", "0x04020011"), "is not what its EDS describes"),
        (cut.to_owned(), "is not in its EDS"),
        ("[A]\n".repeat(2 << 20), "larger than 4 MiB"),
    ]
    .into_iter()
    .enumerate()
    {
        let folder = installation(&format!("eds_{place}"), KRAFT_TEXT);
        fs::write(folder.join("eds/frhc_drive.eds"), text).unwrap();
        is_refused(&folder, &["joint[0]", word]);
    }
}

#[test]
fn hazard_18_truncated_eds_is_refused_where_check_finds_errors() {
    let whole = fs::read("eds/frhc_drive.eds").unwrap();
    let folder = installation("truncated", KRAFT_TEXT);
    let (file, config) = (folder.join("eds/frhc_drive.eds"), folder.join("config/arm.toml"));
    assert!(Config::load(&config).is_ok());
    let mut refused = 0;
    for place in 1..=40 {
        let cut = &whole[..whole.len() * place / 41];
        fs::write(&file, cut).unwrap();
        let errors =
            |eds: Eds| eds.lint().iter().filter(|it| it.severity == Severity::Error).count();
        let errors = Eds::parse(cut).map(errors);
        match Config::load(&config) {
            // Only objects that no plan uses are missing, and the cut is between two of them.
            Ok(config) => {
                let [drive, _] = &config.eds_files[..] else { panic!("two files") };
                assert_eq!(Ok(drive.gaps.len()), errors, "cut at {} bytes", cut.len());
                assert!(place > 30, "cut at {} bytes", cut.len());
            }
            Err(invalid) => {
                let text = invalid.to_string();
                assert!(text.contains("joint[0].eds") && text.contains("frhc_drive.eds"), "{text}");
                refused += 1;
            }
        }
    }
    assert!(refused >= 35, "{refused} of 40 cuts were refused");
    let inside = whole.len() - 30;
    fs::write(&file, &whole[..inside]).unwrap();
    is_refused(&folder, &["joint[0].eds", "the file ends inside a section; frhc check --eds"]);
}

#[test]
fn miscount_of_the_last_object_is_no_truncated_file() {
    let eds = fs::read_to_string("eds/frhc_drive.eds").unwrap();
    let folder = installation("miscounted_last", KRAFT_TEXT);
    let (file, config) = (folder.join("eds/frhc_drive.eds"), folder.join("config/arm.toml"));
    let part = "ParameterName=a\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\nPDOMapping=0\n";
    let last =
        format!("[2F00]\nParameterName=a\nObjectType=0x9\nSubNumber=8\n\n[2F00sub7]\n{part}");
    fs::write(&file, format!("{eds}\n{last}")).unwrap();
    let ended = frhc(&["check", "--config", config.to_str().unwrap()]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let warning =
        "2F00h SubNumber: 8, but 1 sub-indices are described; nothing that is used is missing";
    assert!(ended.stdout.contains(warning), "{}", ended.stdout);
    // A file that was cut there lacks the objects behind it.
    let (before, _) = eds.split_once("[67FF]\n").unwrap();
    fs::write(&file, format!("{before}{last}")).unwrap();
    is_refused(&folder, &["joint[0].eds", "the file ends inside a section; frhc check --eds"]);
}

#[test]
fn identity_object_counts_where_the_device_info_contradicts_it() {
    let eds = fs::read_to_string("eds/frhc_drive.eds").unwrap();
    let folder = installation("identities", KRAFT_TEXT);
    let (file, config) = (folder.join("eds/frhc_drive.eds"), folder.join("config/arm.toml"));
    let vendor = "VendorNumber=0x00000F8C";
    assert!(eds.contains(vendor));
    fs::write(&file, eds.replacen(vendor, "VendorNumber=0x0000002A", 1)).unwrap();
    let ended = frhc(&["check", "--config", config.to_str().unwrap()]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let mut lines = ended.stdout.lines().filter(|line| line.starts_with("eds "));
    let (line, another) = (lines.next().unwrap(), lines.next());
    assert_eq!(another, None);
    let words = "warning: [DeviceInfo] VendorNumber: 0000002Ah, but the default of 1018h:1, which counts, is 00000F8Ch";
    assert!(line.ends_with(words), "{line}");
}

/// Returns a copy of the drive's EDS without the section of an object, which its list announces.
fn without_section(index: &str) -> String {
    let eds = fs::read_to_string("eds/frhc_drive.eds").unwrap();
    let (before, rest) = eds.split_once(&format!("[{index}]\n")).unwrap();
    let (_, after) = rest.split_once("\n[").unwrap();
    format!("{before}[{after}")
}

#[test]
fn miscounts_of_makers_are_warnings_of_check_once_per_file() {
    let eds = fs::read_to_string("eds/frhc_drive.eds").unwrap();
    let folder = installation("miscounts", KRAFT_TEXT);
    let (file, config) = (folder.join("eds/frhc_drive.eds"), folder.join("config/arm.toml"));
    let miscounted = eds.replace("SupportedObjects=112", "SupportedObjects=113");
    for (text, words) in [
        (miscounted, "[OptionalObjects] SupportedObjects: 113, but 112 are listed"),
        (without_section("6065"), "6065h is listed, but there is no [6065]"),
    ] {
        fs::write(&file, text).unwrap();
        let ended = frhc(&["check", "--config", config.to_str().unwrap()]);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        let mut lines = ended.stdout.lines().filter(|line| line.starts_with("eds "));
        let (line, another) = (lines.next().unwrap(), lines.next());
        assert_eq!(another, None);
        for part in ["frhc_drive.eds:", "warning: ", words, "; nothing that is used is missing"] {
            assert!(line.contains(part), "{part}: {line}");
        }
    }
}

#[test]
fn eds_that_announces_a_used_object_without_section_is_refused() {
    for index in ["607E", "1014", "6071"] {
        let folder = installation(&format!("announced_{index}"), KRAFT_TEXT);
        fs::write(folder.join("eds/frhc_drive.eds"), without_section(index)).unwrap();
        let words = format!("{index}h is listed, but there is no [{index}]: the node uses it");
        is_refused(&folder, &["joint[0].eds: joints 1, 2, 3, 4, 5 and 6: ", &words]);
    }
}

#[test]
fn equal_drives_are_refused_once_by_the_numbers_of_all() {
    let missing = KRAFT_TEXT.replace("frhc_drive.eds", "none.eds");
    let hint = "none.eds: No such file or directory (os error 2); a path starts at the folder of the configuration";
    let eds = fs::read_to_string("eds/frhc_drive.eds").unwrap();
    let without_limit = eds.replace("[6072]", "[2072]").replace("=0x6072\n", "=0x2072\n");
    for (name, text, sheet, reason) in [
        ("file", missing.as_str(), eds.as_str(), hint),
        (
            "object",
            KRAFT_TEXT,
            &without_limit,
            "6072h is not in its EDS; name what limits its torque",
        ),
    ] {
        let folder = installation(&format!("equal_{name}"), text);
        fs::write(folder.join("eds/frhc_drive.eds"), sheet).unwrap();
        let invalid = Config::load(&folder.join("config/arm.toml")).unwrap_err().to_string();
        assert_eq!(invalid.lines().count(), 1, "{invalid}");
        for part in ["joint[0].eds: joints 1, 2, 3, 4, 5 and 6: ", reason] {
            assert!(invalid.contains(part), "{part}: {invalid}");
        }
    }
}

#[test]
fn second_axis_of_a_node_is_refused_by_name() {
    let twice = KRAFT_TEXT.replace("\nnode_id = 3\n", "\nnode_id = 2\n");
    let folder = installation("second-axis", &twice);
    is_refused(&folder, &["node_id: must be unique on its bus, got 2 twice"]);
    let eds = folder.join("eds/frhc_drive.eds");
    let one = fs::read_to_string(&eds).unwrap();
    let controlword = one.split("\n[6040]\n").nth(1).unwrap().split("\n[").next().unwrap();
    let (lists, rest) = one.split_once("=0x6040\n").unwrap();
    let key = lists.rsplit('\n').next().unwrap();
    let objects: u32 = key.parse().unwrap();
    // In place of another object of the list, so that its numbers stay right.
    let (_, rest) = rest.split_once('\n').unwrap();
    let text = format!("{lists}=0x6040\n{}=0x6840\n{rest}\n[6840]\n{controlword}\n", objects + 1);
    fs::write(&eds, text).unwrap();
    let second = "node 2 is the drive of elevation already, and its second axis (its EDS has 6840h: objects + 800h) cannot be";
    is_refused(&folder, &[second]);
}
