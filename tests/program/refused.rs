//! Refusals before any frame is sent: invalid configurations, EDS files and torque curves, files that others may write,
//! and configurations with one corrupted byte.
#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::fs;
use std::os::unix::fs::{PermissionsExt, chown, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use proptest::prelude::*;

use crate::common::bench::config;
use crate::common::cli::{CommandOutput, folder, frhc};
use canopen::eds::{Eds, Severity};
use config::Config;
use controller::calibration::TorqueCurve;

const KRAFT: &str = "config/kraft_like.toml";
const TEXT: &str = include_str!("../../config/kraft_like.toml");
const SHIPPED: [(&str, &str); 4] = [
    (KRAFT, TEXT),
    ("config/kraft_like_500hz.toml", include_str!("../../config/kraft_like_500hz.toml")),
    ("config/jpl_like.toml", include_str!("../../config/jpl_like.toml")),
    ("config/sixr_spherical.toml", include_str!("../../config/sixr_spherical.toml")),
];

/// An interface that does not exist: opening it ends the command with exit code 4.
const NO_INTERFACE: &str = "nosuchcan0";

/// Creates a folder with a configuration and its EDS files.
fn installation(name: &str, text: &str) -> PathBuf {
    let folder = folder("refused", name);
    for eds in ["eds/frhc_drive.eds", "eds/frhc_switches.eds"] {
        fs::create_dir_all(folder.join("eds")).unwrap();
        fs::copy(eds, folder.join(eds)).unwrap();
    }
    fs::create_dir_all(folder.join("config")).unwrap();
    fs::write(folder.join("config/arm.toml"), text.replace("vcan0", NO_INTERFACE)).unwrap();
    folder
}

/// Runs `frhc run` with the configuration of `folder`.
fn run_in(folder: &Path, more: &[&str]) -> CommandOutput {
    command_in(folder, "run", more)
}

/// Runs a command with the configuration of `folder`.
fn command_in(folder: &Path, name: &str, more: &[&str]) -> CommandOutput {
    let config = folder.join("config/arm.toml");
    let mut command = Command::new(crate::common::program());
    command.args([name, "--config"]).arg(config).args(more);
    for name in ["XDG_RUNTIME_DIR", "XDG_STATE_HOME", "RUNTIME_DIRECTORY", "STATE_DIRECTORY"] {
        command.env(name, folder);
    }
    let output = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    CommandOutput {
        code: output.status.code().unwrap(),
        stdout: text(output.stdout),
        stderr: text(output.stderr),
    }
}

/// Asserts that `run` is refused with exit code 3 and these words, before it opens a bus or socket.
#[track_caller]
fn is_refused(folder: &Path, words: &[&str]) {
    let ended = run_in(folder, &[]);
    assert_eq!(ended.code, 3, "{words:?}: {}", ended.stderr);
    for word in words {
        assert!(ended.stderr.contains(word), "{word}: {}", ended.stderr);
    }
    assert!(!ended.stderr.contains(NO_INTERFACE), "{}", ended.stderr);
    assert!(!folder.join("node.sock").exists() && !folder.join("faults").exists());
}

#[test]
fn promise_11_valid_configuration_gets_as_far_as_the_bus() {
    let folder = installation("in_order", TEXT);
    let ended = run_in(&folder, &[]);
    assert_eq!(ended.code, 4, "{}", ended.stderr);
    assert!(ended.stderr.contains(NO_INTERFACE), "{}", ended.stderr);
}

#[test]
fn hazard_18_invalid_config_is_refused_by_key_before_the_bus() {
    for (place, (from, to, words)) in [
        ("a_m = 0.254", "a_m = nan", ["joint[2].a_m", "NaN"]),
        ("a_m = 0.254", "a_m = -inf", ["joint[2].a_m", "inf"]),
        ("a_m = 0.254", "a_m = 99.0", ["joint[2].a_m", "must be within -10..=10, got 99"]),
        ("a_m = 0.254", "a_m = \"long\"", ["arm.toml:", "invalid type: string"]),
        ("max_torque_nm = 6.0 ", "max_torque_nm = 1e300 ", ["joint[0].", "torque"]),
        (
            "sync_period_us = 1000",
            "sync_period_us = 0",
            ["node.sync_period_us", "must be within 250..=100000, got 0"],
        ),
        ("heartbeat_ms = 5", "heartbeat_ms = 70000", ["arm.toml:", "70000"]),
        ("heartbeat_ms = 5", "heartbeat_s = 5", ["node.heartbeat_s", "unknown key"]),
        (
            "node_id = 127",
            "node_id = 128",
            ["node.node_id", "must be a node-id within 1..=127, got 128"],
        ),
        ("missing_samples = 3", "missing_samples = 300", ["safety.missing_samples", "300"]),
        ("[safety]", "[safety", ["arm.toml:", "expected"]),
        ("eds/frhc_drive.eds", "eds/absent.eds", ["joint[0].eds", "absent.eds"]),
        ("eds/frhc_drive.eds", "eds", ["joint[0].eds", "is a directory"]),
    ]
    .into_iter()
    .enumerate()
    {
        assert!(TEXT.contains(from), "{from}");
        let folder = installation(&format!("wrong_{place}"), &TEXT.replace(from, to));
        is_refused(&folder, &words);
    }
}

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
        let folder = installation(&format!("eds_{place}"), TEXT);
        fs::write(folder.join("eds/frhc_drive.eds"), text).unwrap();
        is_refused(&folder, &["joint[0]", word]);
    }
}

#[test]
fn hazard_18_truncated_eds_is_refused_where_check_finds_errors() {
    let whole = fs::read("eds/frhc_drive.eds").unwrap();
    let folder = installation("truncated", TEXT);
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
    let folder = installation("miscounts", TEXT);
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
        let folder = installation(&format!("announced_{index}"), TEXT);
        fs::write(folder.join("eds/frhc_drive.eds"), without_section(index)).unwrap();
        let words = format!("{index}h is listed, but there is no [{index}]: the node uses it");
        is_refused(&folder, &["joint[0].eds: joints 1, 2, 3, 4, 5 and 6: ", &words]);
    }
}

#[test]
fn equal_drives_are_refused_once_by_the_numbers_of_all() {
    let missing = TEXT.replace("frhc_drive.eds", "none.eds");
    let hint = "none.eds: No such file or directory (os error 2); a path starts at the folder of the configuration";
    let eds = fs::read_to_string("eds/frhc_drive.eds").unwrap();
    let without_limit = eds.replace("[6072]", "[2072]").replace("=0x6072\n", "=0x2072\n");
    for (name, text, sheet, reason) in [
        ("file", missing.as_str(), eds.as_str(), hint),
        ("object", TEXT, &without_limit, "6072h is not in its EDS; name what limits its torque"),
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

/// Runs `frhc` with a timeout of 10 s.
fn within_ten_seconds(args: &[&str]) -> CommandOutput {
    let mut command = Command::new("timeout");
    let output = command.args(["10", crate::common::program()]).args(args).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let code = output.status.code().unwrap();
    CommandOutput { code, stdout: text(output.stdout), stderr: text(output.stderr) }
}

#[test]
fn hazard_18_pipes_devices_and_folders_are_refused_as_files() {
    let folder = folder("refused", "irregular");
    let pipe = folder.join("pipe.toml");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let zero = folder.join("zero.toml");
    symlink("/dev/zero", &zero).unwrap();
    for (path, kind) in [(&pipe, "pipe"), (&zero, "device"), (&folder, "directory")] {
        let path = path.to_str().unwrap();
        let at = format!("@{path}");
        for args in [
            &["check", "--config", path][..],
            &["run", "--config", path, "--insecure"],
            &["check", "--eds", path],
            &["sdo", "read", "3", "6041", "--eds", path, "-i", NO_INTERFACE],
            &["sdo", "write", "3", "1F50:1", "d", &at, "-i", NO_INTERFACE],
            &["decode", path],
            &["calib", "fit", path, "--config", KRAFT],
            &["calib", "friction", path, "--config", KRAFT],
            &["explain", path],
        ] {
            let ended = within_ten_seconds(args);
            assert!([3, 4].contains(&ended.code), "{args:?}: {} {}", ended.code, ended.stderr);
            let words = format!("is a {kind}, must be a regular file");
            assert!(ended.stderr.contains(&words), "{args:?}: {}", ended.stderr);
            assert!(
                !ended.stderr.contains(NO_INTERFACE),
                "the interface comes later: {}",
                ended.stderr
            );
        }
    }
    for path in [&pipe, &zero] {
        let ended = within_ten_seconds(&["demo", "--scenario", path.to_str().unwrap()]);
        assert_eq!(ended.code, 3, "{}", ended.stderr);
        assert!(ended.stderr.contains("must be a regular file"), "{}", ended.stderr);
    }
}

#[test]
fn oversized_or_endless_value_file_is_refused_before_the_bus() {
    let folder = folder("refused", "endless");
    let large = folder.join("large.bin");
    fs::File::create(&large).unwrap().set_len((16 << 20) + 1).unwrap();
    let at = format!("@{}", large.display());
    let ended = within_ten_seconds(&["sdo", "write", "3", "1F50:1", "d", &at, "-i", NO_INTERFACE]);
    assert_eq!(ended.code, 4, "{}", ended.stderr);
    assert!(ended.stderr.contains("larger than 16 MiB"), "{}", ended.stderr);
    let ended = Command::new("timeout")
        .args([
            "10",
            crate::common::program(),
            "sdo",
            "write",
            "3",
            "1F50:1",
            "d",
            "-",
            "-i",
            NO_INTERFACE,
        ])
        .stdin(fs::File::open("/dev/zero").unwrap())
        .output()
        .unwrap();
    assert_eq!(ended.status.code(), Some(4));
    assert!(String::from_utf8(ended.stderr).unwrap().contains("larger than 16 MiB"));
}

#[test]
fn campaign_with_too_many_threads_is_refused() {
    for threads in ["100000", "257", "0", "many"] {
        let ended = within_ten_seconds(&["campaign", "--faults", "1", "--threads", threads]);
        assert_eq!(ended.code, 2, "{}", ended.stderr);
        assert!(
            ended.stderr.contains(&format!("must be 1 to 256, got {threads}")),
            "{}",
            ended.stderr
        );
    }
}

#[test]
fn hazard_18_files_of_other_users_are_refused_by_run() {
    let other = Some(54_321);
    for (name, path) in [
        ("others_config", "config/arm.toml"),
        ("others_eds", "eds/frhc_drive.eds"),
        ("others_folder", "config"),
    ] {
        let folder = installation(name, TEXT);
        if chown(folder.join(path), other, None).is_err() {
            // Only root can change the owner; `config::trust` has a test of the rule.
            return;
        }
        is_refused(&folder, &[path, "belongs to user 54321, must belong to root"]);
        let ended = run_in(&folder, &["--insecure"]);
        assert_eq!(ended.code, 4, "{}", ended.stderr);
    }
}

#[test]
fn hazard_18_files_writable_by_others_need_insecure() {
    let check = |name: &str, change: &dyn Fn(&Path), words: &[&str]| {
        let folder = installation(name, TEXT);
        change(&folder);
        is_refused(&folder, words);
        let ended = run_in(&folder, &["--insecure"]);
        assert_eq!(ended.code, 4, "{}", ended.stderr);
        fs::set_permissions(folder.join("config"), fs::Permissions::from_mode(0o755)).unwrap();
    };
    let set = |path: PathBuf, mode| fs::set_permissions(path, fs::Permissions::from_mode(mode));
    let anyones = "anyone may write it (mode 0666): chmod o-w it, or say --insecure";
    let of_config = |folder: &Path| set(folder.join("config/arm.toml"), 0o666).unwrap();
    check("anyones_config", &of_config, &["config/arm.toml", anyones]);
    let of_eds = |folder: &Path| set(folder.join("eds/frhc_switches.eds"), 0o666).unwrap();
    check("anyones_eds", &of_eds, &["switches.eds", "frhc_switches.eds", anyones]);
    let folder_too = |folder: &Path| set(folder.join("config"), 0o777).unwrap();
    check("anyones_folder", &folder_too, &["anyone may write", "config (mode 0777)"]);
    let link = |folder: &Path| {
        let (file, real) = (folder.join("config/arm.toml"), folder.join("config/real.toml"));
        fs::rename(&file, &real).unwrap();
        symlink(real, file).unwrap();
    };
    check("link", &link, &["config/arm.toml", "is a symbolic link"]);
}

#[test]
fn hazard_18_check_reads_files_writable_by_others() {
    let folder = installation("harmless", TEXT);
    let file = folder.join("config/arm.toml");
    fs::set_permissions(&file, fs::Permissions::from_mode(0o666)).unwrap();
    let ended = frhc(&["check", "--config", file.to_str().unwrap()]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
}

#[test]
fn hazard_19_non_monotone_curve_is_refused_before_the_bus() {
    let curve = "torque_curve = [133.144, -0.393453, 0.0196726]";
    for (place, (to, words)) in [
        ("[133.144, -3.9, 0.0196726]", ["joint[0].torque_curve", "stops rising at"]),
        ("[-133.144, 0.393453, -0.0196726]", ["joint[0].torque_curve", "stops rising at 0.000"]),
        ("[0.0, 0.0, 0.0]", ["joint[0].torque_curve", "stops rising at 0.000"]),
        ("[nan, 0.0, 0.0]", ["joint[0].torque_curve", "c1 = NaN"]),
        ("[133.144, 0.0, 1e9]", ["joint[0].torque_curve", "the curve ends at"]),
        ("[1e-9, 0.0, 0.0]", ["joint[0].torque_curve", "the curve ends at"]),
    ]
    .into_iter()
    .enumerate()
    {
        assert!(TEXT.contains(curve));
        let text = TEXT.replacen(curve, &format!("torque_curve = {to}"), 1);
        is_refused(&installation(&format!("curve_{place}"), &text), &words);
    }
}

#[test]
fn hazard_19_torque_curve_saturates_at_its_measured_end() {
    for joint in &config(KRAFT).joints {
        let curve =
            TorqueCurve::new(joint.plant.actuator.torque_curve, joint.plant.actuator.max_torque)
                .unwrap();
        let end = curve.at(joint.plant.actuator.max_torque);
        assert_eq!(
            (curve.at(1e6 * joint.plant.actuator.max_torque), curve.at(f64::INFINITY)),
            (end, end)
        );
        assert_eq!(curve.at(0.0), 0.0, "an odd curve is zero at zero");
    }
}

#[test]
fn hazard_20_overloaded_bus_is_refused_before_the_bus() {
    let slow = TEXT.replace("bitrate = 1_000_000", "bitrate = 500_000");
    is_refused(&installation("slow", &slow), &["bus[0].load_limit_percent", "179.8 % is above"]);
    let wide = TEXT.replace("layout = \"grouped\"", "layout = \"per-drive\"");
    is_refused(&installation("wide", &wide), &["bus[0].load_limit_percent", "bus load of 14"]);
}

/// Asserts that all numbers of the control loop are valid.
fn is_in_range(config: &Config) {
    let micros = config.period.as_micros();
    assert!((250..=100_000).contains(&micros));
    assert!((1..=1_000).contains(&config.heartbeat.as_millis()));
    assert!((1..=127).contains(&config.node_id.raw()));
    for joint in &config.joints {
        let link = &joint.plant.link;
        let [low, high] = link.range;
        assert!(low < high && low.is_finite() && high.is_finite());
        let lengths = [link.a, link.d, link.alpha, link.theta, link.mass, link.rotor_inertia];
        assert!(lengths.into_iter().all(f64::is_finite), "{link:?}");
        assert!(
            joint.plant.actuator.max_torque > 0.0 && joint.plant.actuator.max_torque.is_finite()
        );
        assert!((1e-3..=4e6).contains(&joint.plant.actuator.rated_torque));
        let max_target = joint.calibration.max_target().0;
        assert!(max_target != 0 && max_target != i16::MIN, "{max_target}");
    }
    assert!(config.gravity.into_iter().all(f64::is_finite));
    assert!(config.safety.gravity_ramp < Duration::from_secs(3_600));
    assert!((1..=100).contains(&config.safety.missing_samples));
    assert!(config.window() <= config.period);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn property_16_config_with_one_wrong_byte_is_valid_or_refused(
        (which, at, byte) in (0..SHIPPED.len(), any::<prop::sample::Index>(), any::<u8>()),
    ) {
        let (file, text) = SHIPPED[which];
        let mut bytes = text.as_bytes().to_vec();
        *at.get_mut(&mut bytes) = byte;
        let Ok(text) = String::from_utf8(bytes) else { return Ok(()) };
        match Config::parse(Path::new(file), &text) {
            Ok(config) => is_in_range(&config),
            Err(invalid) => {
                prop_assert!(!invalid.0.is_empty());
                prop_assert!(invalid.to_string().lines().all(|line| line.starts_with(file)));
            }
        }
    }
}

#[test]
fn property_16_rewritten_configuration_is_the_same() {
    for (file, text) in SHIPPED {
        let table: toml::Table = text.parse().unwrap();
        let read = |text: &str| format!("{:?}", Config::parse(Path::new(file), text).unwrap());
        assert_eq!(read(text), read(&table.to_string()), "{file}");
    }
}

#[test]
fn simulated_link_is_refused_on_real_buses() {
    let text = format!("{TEXT}\n[remote.link]\nmax_age_ms = 50.0\n");
    let gains = "wrench_gain = [0.01, 0.01, 0.01, 0.01, 0.01, 0.01]";
    let slow = text.replace("wrench_gain = [0.3, 0.3, 0.3, 0.15, 0.15, 0.15]", gains);
    let (local, linked) =
        (installation("max_age", &text), installation("delay", &format!("{slow}delay_ms = 5.0\n")));
    for (name, more) in [("run", [].as_slice()), ("commission", &["--prove"])] {
        let open = command_in(&local, name, more);
        assert_eq!(open.code, 4, "{name}, the interface is missing: {}", open.stderr);
        let refused = command_in(&linked, name, more);
        assert_eq!(refused.code, 3, "{name}: {}", refused.stderr);
        for word in ["[remote.link] describes a simulated link", &format!("for {name}, keep")] {
            assert!(refused.stderr.contains(word), "{word}: {}", refused.stderr);
        }
    }
}

#[test]
fn one_interface_for_two_buses_is_refused_by_name() {
    for name in ["run", "sim"] {
        let arguments =
            [name, "-c", "config/jpl_like.toml", "-i", "shoulder=can7", "-i", "wrist=can7"];
        let ended = frhc(&arguments);
        assert_eq!(ended.code, 2, "{name}: {}", ended.stderr);
        let reason =
            "-i: buses shoulder and wrist would both be on can7; each needs its own interface";
        assert!(ended.stderr.contains(reason), "{name}: {}", ended.stderr);
    }
}

#[test]
fn second_axis_of_a_node_is_refused_by_name() {
    let twice = TEXT.replace("\nnode_id = 3\n", "\nnode_id = 2\n");
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

#[test]
fn processor_that_does_not_exist_is_refused() {
    let folder = installation("cpu", TEXT);
    let ended = run_in(&folder, &["--cpu", "4096"]);
    assert_eq!(ended.code, 2, "{}", ended.stderr);
    assert!(
        ended.stderr.contains("--cpu 4096: this machine has no such processor"),
        "{}",
        ended.stderr
    );
    let ended = run_in(&folder, &["--cpu-latency", "-1"]);
    assert_eq!(ended.code, 2, "{}", ended.stderr);
}

#[test]
fn sync_period_that_60c2h_cannot_hold_is_refused() {
    let period = |micros: u32| {
        let text = TEXT.replace("sync_period_us = 1000", &format!("sync_period_us = {micros}"));
        Config::parse(Path::new(KRAFT), &text).map_err(|error| error.to_string())
    };
    let error = period(1_337).unwrap_err();
    let reason = "node.sync_period_us: must be a period that 60C2h can hold, one byte times 10^n s: 1330 or 1340, got 1337";
    assert!(error.contains(reason), "{error}");
    for held in [1_330, 2_000] {
        let error = period(held).err().unwrap_or_default();
        assert!(!error.contains("60C2h"), "{held}: {error}");
    }
}
