//! Every experiment in its short form: its gates hold, and its files are those of the report.

use crate::common::prelude::*;

/// Plays an experiment; its files are complete, and a second run replaces none of them.
fn passes(experiment: &str, files: &[&str]) {
    let results = folder("experiments", experiment).join("results");
    let out = results.to_str().unwrap();
    let args = ["-q", "experiment", experiment, "--short", "--markdown", "--out", out];
    let played = frhc(&args);
    assert_eq!(played.code, 0, "{experiment}: {}", played.stderr);
    let mut written: Vec<String> = fs::read_dir(&results)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    written.sort();
    let mut expected = files.to_vec();
    expected.sort_unstable();
    assert_eq!(written, expected, "{experiment}");
    for file in files {
        let text = fs::read_to_string(results.join(file)).unwrap();
        assert!(!text.contains("NaN"), "{experiment}, {file}");
        let (_, extension) = file.rsplit_once('.').unwrap();
        match extension {
            "svg" => assert!(text.starts_with("<svg") && text.contains("</svg>"), "{file}"),
            "csv" => assert!(text.lines().count() > 1, "{file}"),
            "md" => assert_eq!(text.trim(), played.stdout.trim(), "{file}"),
            _ => assert!(text.len() > 2, "{file}"),
        }
    }
    let again = frhc(&args);
    assert!(again.code == 2 && again.stderr.contains("--force"), "{}", again.stderr);
}

#[test]
fn fidelity_passes() {
    passes("fidelity", &["runs.csv", "force.svg", "report.md"]);
}

#[test]
fn return_to_centre_passes() {
    passes("return-to-centre", &["axes.csv", "curves.csv", "force.svg", "report.md"]);
}

#[test]
fn torque_curve_passes() {
    passes("torque-curve", &["joints.csv", "test_forces.csv", "curves.svg", "report.md"]);
}

#[test]
fn ntrfc_passes() {
    passes("ntrfc", &["presses.csv", "bounds.csv", "figures.json", "force.svg", "report.md"]);
}

#[test]
fn delay_passes() {
    passes("delay", &["runs.csv", "figures.json", "map.svg", "report.md"]);
}

#[test]
fn dual_peg_passes() {
    passes("dual-peg", &["trials.csv", "figures.json", "work.svg", "report.md"]);
}

#[test]
fn figures_are_printed_though_their_files_cannot_be_written() {
    // Files can be created, but nothing written to them, as on a full disk.
    let full = "trap '' XFSZ; ulimit -f 0; exec \"$0\" -q experiment ntrfc --short --out \"$1\"";
    let out = folder("experiments", "full").join("results");
    let out = out.to_str().unwrap();
    let program = crate::common::program();
    let played = Command::new("sh").args(["-c", full, program, out]).output().unwrap();
    let stderr = String::from_utf8_lossy(&played.stderr);
    assert_eq!(played.status.code(), Some(4), "{stderr}");
    assert!(
        String::from_utf8_lossy(&played.stdout).contains("at rest"),
        "the figures are not lost"
    );
    assert!(stderr.contains("results"), "{stderr}");
}

#[test]
fn folder_that_cannot_be_created_is_refused_before_any_run() {
    let played = frhc(&["-q", "experiment", "ntrfc", "--short", "--out", "/proc/results"]);
    assert_eq!(played.code, 4, "{}", played.stderr);
    assert_eq!(played.stdout, "", "nothing was computed");
    let reason = "cannot write in /proc: ";
    assert!(played.stderr.starts_with("frhc: /proc/results"), "{}", played.stderr);
    assert!(
        played.stderr.contains(reason) && !played.stderr.contains(".frhc-"),
        "{}",
        played.stderr
    );
}

#[test]
fn delay_is_refused_where_nothing_would_rest() {
    let folder = folder("experiments", "delay-refused");
    let shipped = include_str!("../../../config/kraft_like.toml");
    let shipped = shipped.replace("../eds/", &format!("{ROOT}/eds/"));
    for (old, new, reason) in [
        (
            "accommodation_m_per_ns = 0.01 ",
            "accommodation_m_per_ns = 0.0 ",
            "the rate command does not come to rest at the wall: raise remote.accommodation_m_per_ns",
        ),
        (
            "wrench_gain = [0.3,",
            "wrench_gain = [0.0,",
            "controller.wrench_gain along x must be above 0",
        ),
    ] {
        assert!(shipped.contains(old), "{old}");
        let file = folder.join("arm.toml");
        fs::write(&file, shipped.replacen(old, new, 1)).unwrap();
        let file = file.to_str().unwrap();
        let played = frhc(&["experiment", "delay", "--short", "--config", file]);
        assert_eq!((played.code, played.stdout.as_str()), (3, ""), "{}", played.stderr);
        assert!(played.stderr.contains("arm.toml"), "{}", played.stderr);
        assert!(played.stderr.contains(reason), "{reason}: {}", played.stderr);
    }
    let makers = "config/drives/maxon_epos4.toml";
    let slow = frhc(&["experiment", "delay", "--config", makers]);
    assert!(
        slow.code == 3 && slow.stderr.contains("add [controller.passivity]"),
        "{}",
        slow.stderr
    );
}
