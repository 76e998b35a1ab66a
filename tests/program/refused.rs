//! Refusals before any frame is sent: invalid configurations, EDS files and torque curves, files that others may write,
//! and configurations with one corrupted byte.

use proptest::prelude::*;

use crate::common::prelude::*;
use controller::calibration::TorqueCurve;

const SHIPPED: [(&str, &str); 4] = [
    (KRAFT, KRAFT_TEXT),
    (KRAFT_500HZ, include_str!("../../config/kraft_like_500hz.toml")),
    (JPL, include_str!("../../config/jpl_like.toml")),
    ("config/sixr_spherical.toml", include_str!("../../config/sixr_spherical.toml")),
];

/// An interface that does not exist: opening it ends the command with exit code 4.
pub(crate) const NO_INTERFACE: &str = "nosuchcan0";

/// Creates a folder with a configuration and its EDS files.
pub(crate) fn installation(name: &str, text: &str) -> PathBuf {
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
pub(crate) fn run_in(folder: &Path, more: &[&str]) -> CommandOutput {
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
pub(crate) fn is_refused(folder: &Path, words: &[&str]) {
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
    let folder = installation("in_order", KRAFT_TEXT);
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
        assert!(KRAFT_TEXT.contains(from), "{from}");
        let folder = installation(&format!("wrong_{place}"), &KRAFT_TEXT.replace(from, to));
        is_refused(&folder, &words);
    }
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
        assert!(KRAFT_TEXT.contains(curve));
        let text = KRAFT_TEXT.replacen(curve, &format!("torque_curve = {to}"), 1);
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
    let slow = KRAFT_TEXT.replace("bitrate = 1_000_000", "bitrate = 500_000");
    is_refused(&installation("slow", &slow), &["bus[0].load_limit_percent", "179.8 % is above"]);
    let wide = KRAFT_TEXT.replace("layout = \"grouped\"", "layout = \"per-drive\"");
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
        let read = |text: &str| format!("{:?}", parse(file, text));
        assert_eq!(read(text), read(&table.to_string()), "{file}");
    }
}

#[test]
fn simulated_link_is_refused_on_real_buses() {
    let text = format!("{KRAFT_TEXT}\n[remote.link]\nmax_age_ms = 50.0\n");
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
        let arguments = [name, "-c", JPL, "-i", "shoulder=can7", "-i", "wrist=can7"];
        let ended = frhc(&arguments);
        assert_eq!(ended.code, 2, "{name}: {}", ended.stderr);
        let reason =
            "-i: buses shoulder and wrist would both be on can7; each needs its own interface";
        assert!(ended.stderr.contains(reason), "{name}: {}", ended.stderr);
    }
}

#[test]
fn processor_that_does_not_exist_is_refused() {
    let folder = installation("cpu", KRAFT_TEXT);
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
        let text =
            KRAFT_TEXT.replace("sync_period_us = 1000", &format!("sync_period_us = {micros}"));
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
