//! `frhc check --eds`: its list of findings, its JSON and its exit codes.

use crate::common::prelude::*;
use crate::eds::{BAD, DRIVE, SWITCHES, count};

/// Compares with a file in tests/golden, line by line.
pub(crate) fn compare(name: &str, text: &str) {
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
    let report: Value = serde_json::from_str(&outcome.stdout).unwrap();
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

#[test]
fn check_of_a_configuration_counts_the_errors_of_its_eds() {
    let folder = folder("eds", "doubt");
    let drive = std::str::from_utf8(DRIVE).unwrap();
    fs::write(folder.join("drive.eds"), drive.replacen("SubNumber=9", "SubNumber=7", 1)).unwrap();
    fs::write(folder.join("switches.eds"), SWITCHES).unwrap();
    let text = fs::read_to_string(KRAFT).unwrap().replace("../eds/frhc_", "");
    let file = folder.join("frhc.toml");
    fs::write(&file, text).unwrap();
    let check =
        |args: &[&str]| frhc(&[&["check", "--config", file.to_str().unwrap()], args].concat());
    let outcome = check(&[]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (0, ""));
    let lines: Vec<_> = outcome.stdout.lines().filter(|line| line.starts_with("eds ")).collect();
    let drive = folder.join("drive.eds");
    assert_eq!(lines, [format!("eds   {}: 1 error; see frhc check --eds", drive.display())]);
    let report: Value = serde_json::from_str(&check(&["--json"]).stdout).unwrap();
    assert_eq!(report["eds"].as_array().unwrap().len(), 6);
    assert_eq!(report["eds"][5]["node"], "roll");
}
