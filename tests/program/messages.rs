//! Messages for wrong files and arguments: one line with file, line, key and remedy, before anything is computed.

use crate::common::prelude::*;

/// Folder of the repository.
const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Asserts the exit code, the first line of stderr, and that nothing was printed.
#[track_caller]
fn is_refused(args: &[&str], code: i32, first: &str) {
    let ended = frhc(args);
    let line = ended.stderr.lines().next().unwrap_or_default();
    assert_eq!((ended.code, ended.stdout.as_str()), (code, ""), "{args:?}: {}", ended.stderr);
    assert!(line.contains(first), "{args:?}: {line}");
}

#[test]
fn errors_of_a_scenario_name_line_and_key() {
    let scratch = Scratch::new("scenario-errors");
    for (entry, reason) in [
        (
            "[[move]]\nat_s = \"x\"",
            "scenario.toml:3: move[0].at_s: invalid type: string \"x\", expected a number",
        ),
        (
            "[[move]]\nat_s = nan\nduration_s = 1.0\nto_m = [0, 0, 0]",
            "scenario.toml:2: move[0].at_s: must be within 0..=5, got NaN",
        ),
        (
            "[[fault]]\nat_s = nan\nkind = \"unplug\"\ndevice = \"elbow\"",
            "scenario.toml:3: fault[0].at_s: must be within 0..=5, got NaN",
        ),
        ("seconds = 6.0", "scenario.toml:2: duplicate key `seconds`"),
    ] {
        let file = scratch.write("scenario.toml", &format!("seconds = 5.0\n{entry}\n"));
        is_refused(&["demo", "--scenario", &file], 3, reason);
    }
}

#[test]
fn file_of_another_kind_is_named_in_one_line() {
    let scratch = Scratch::new("kinds");
    let scenario = scratch.write("scenario.toml", "seconds = 5.0\n");
    for (args, kind) in [
        (["check", "--config", PUMA], "is the file of a robot, for remote.robot and --robot"),
        (["check", "--config", &scenario], "is a scenario, for --scenario"),
        (["check", "--config", "eds/frhc_drive.eds"], "is an EDS or DCF; `frhc check --eds FILE`"),
        (["check", "--eds", KRAFT], "is the configuration of a hand controller"),
        (["explain", "robot", KRAFT], "is the configuration of a hand controller"),
        (
            ["demo", "--scenario", KRAFT],
            "kraft_like.toml: is the configuration of a hand controller",
        ),
        (
            ["demo", "--scenario", PUMA],
            "puma560.toml: is the file of a robot, for remote.robot and --robot",
        ),
    ] {
        is_refused(&args, 3, kind);
        assert_eq!(frhc(&args).stderr.lines().count(), 1, "{args:?}");
    }
}

#[test]
fn encoding_of_a_file_that_is_no_text_is_named_with_its_line() {
    let scratch = Scratch::new("encodings");
    let text = "seconds = 5.0\n# H\u{E4}nd\n";
    let latin: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let utf_16: Vec<u8> =
        format!("\u{FEFF}{text}").encode_utf16().flat_map(u16::to_le_bytes).collect();
    let binary = [&b"\x7FELF\n"[..], &[0; 40]].concat();
    for (content, reason) in [
        (latin, "any.toml:2: byte E4h is not UTF-8; the file seems to be Latin-1 or Windows-1252"),
        (utf_16, "any.toml:1: is UTF-16, by its byte order mark: save the file as UTF-8"),
        (binary, "any.toml:2: byte 00h is not text: it seems to be a binary file"),
    ] {
        let file = scratch.path("any.toml");
        fs::write(&file, content).unwrap();
        for args in [
            ["check", "--config", &file],
            ["explain", "robot", &file],
            ["demo", "--scenario", &file],
        ] {
            is_refused(&args, 3, reason);
        }
    }
    let marked = format!("\u{FEFF}{}", fs::read_to_string(format!("{ROOT}/{PUMA}")).unwrap());
    let file = scratch.write("marked.toml", &marked);
    assert_eq!(frhc(&["explain", "robot", &file]).code, 0);
}

#[test]
fn hostile_values_are_escaped_and_cut() {
    let scratch = Scratch::new("hostile");
    let kraft = fs::read_to_string(format!("{ROOT}/{KRAFT}")).unwrap();
    let with_eds = |eds: &str| {
        let (before, after) = kraft.split_once("eds = \"").unwrap();
        let rest = after.split_once('"').unwrap().1;
        scratch.write("hostile.toml", &format!("{before}eds = \"{eds}\"{rest}"))
    };
    let escapes = with_eds("x\\u001b[31mred\\nfrhc: all is well");
    is_refused(
        &["check", "--config", &escapes],
        3,
        "x\\u{1b}[31mred\\nfrhc: all is well: No such file",
    );
    let long = with_eds(&"a".repeat(100_000));
    let stderr = frhc(&["check", "--config", &long]).stderr;
    assert!(stderr.len() < 1_000 && stderr.contains(" characters)"), "{} bytes", stderr.len());
    let twice = scratch.write("twice.toml", &kraft.replacen("node_id", "node_id = 99\nnode_id", 1));
    is_refused(&["check", "--config", &twice], 3, "duplicate key `node_id`");
}

#[test]
fn numbers_of_options_are_refused_in_plain_words() {
    for (value, reason) in [
        ("x", "expected a whole number, 0 or above"),
        ("99999999999999999999999", "the number is too large"),
    ] {
        is_refused(&["demo", "--seed", value], 2, reason);
    }
    for command in ["demo", "campaign"] {
        is_refused(
            &[command, "--seed", "-1"],
            2,
            "'-1' for '--seed <N>': expected a whole number, 0 or above",
        );
    }
    is_refused(&["campaign", "--faults", "0"], 2, "must be at least 1, got 0");
    is_refused(&["explain", "--q", "1,x,3,4,5,6"], 2, "expected a number, got \"x\"");
}

#[test]
fn robot_that_cannot_hold_itself_is_refused() {
    let scratch = Scratch::new("weak");
    let puma = fs::read_to_string(format!("{ROOT}/{PUMA}")).unwrap();
    let weak = puma.lines().map(|line| match line.starts_with("max_torque_nm = ") {
        true => "max_torque_nm = 10.0",
        false => line,
    });
    let file = scratch.write("weak.toml", &weak.collect::<Vec<_>>().join("\n"));
    let reason =
        "joint[1].max_torque_nm: must hold the arm at its start: 31.64 N·m are needed, got 10 N·m";
    is_refused(&["explain", "robot", &file], 3, reason);
}

#[test]
fn results_that_cannot_be_written_are_refused_before_computing() {
    for args in [
        ["campaign", "--faults=20", "--out", "/proc/frhc"],
        ["demo", "--quiet", "--out", "/proc/frhc"],
    ] {
        is_refused(&args, 4, "/proc/frhc");
    }
}

#[test]
fn settings_change_keys_of_the_configuration() {
    let q = "--q=0,-0.8,1.6,-0.7,0,0";
    let values = |args: &[&str]| frhc(&[&["explain", q, "--json"][..], args].concat());
    let set = values(&["--set", "controller.rate_gain_per_s=[1, 1, 1, 2, 2, 2]"]);
    let asked = values(&["{\"rate_gain\": [1, 1, 1, 2, 2, 2]}"]);
    assert_eq!((set.stdout, set.stderr.as_str()), (asked.stdout, ""));
    assert!(asked.stderr.contains("use --set controller.rate_gain_per_s=[…]"), "{}", asked.stderr);
    is_refused(
        &["explain", q, "--set", "controller.assist_fraction=1.4"],
        3,
        "controller.assist_fraction: ",
    );
    is_refused(&["explain", q, "--set", "x"], 2, "expected KEY=VALUE");
}
