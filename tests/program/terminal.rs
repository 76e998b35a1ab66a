//! The command line: help, output and exit codes.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixListener;
use std::thread;

use crate::common::cli::onto;
use crate::common::prelude::*;

/// Commands that print data without a CAN interface. `SOCKET`, `FEED`, `FOLDER`, `DATA` and `SWEEP` are replaced.
const PRINTING: &[&str] = &[
    "--help",
    "--version",
    "help demo",
    "demo --seconds 0.1",
    "demo --seconds 0.1 --json",
    "campaign --faults 1 --only emergency --threads 1",
    "campaign --faults 1 --only emergency --threads 1 --json",
    "campaign --replay 1 --out FOLDER/replay",
    "campaign --soak 100 --threads 1",
    "ctl status --socket SOCKET",
    "ctl arm --socket SOCKET",
    "ctl scale motion 0.5 --socket SOCKET",
    "ctl lock rz on --socket SOCKET",
    "ctl status --json --socket SOCKET",
    "check --config config/kraft_like.toml",
    "check --config config/kraft_like.toml --json",
    "check --eds eds/frhc_drive.eds",
    "plan --config config/kraft_like.toml",
    "plan --config config/kraft_like.toml --json",
    "explain --q 0,-0.8,1.6,-0.7,0,0",
    "explain --q 0,-0.8,1.6,-0.7,0,0 --json",
    "explain faults",
    "explain robot config/robots/puma560.toml",
    "explain robot config/robots/puma560.toml --json",
    "config merge config/kraft_like.toml FRAGMENT",
    "calib fit DATA",
    "calib fit DATA --json",
    "calib friction SWEEP --config config/kraft_like.toml",
    "calib friction SWEEP --config config/kraft_like.toml --json",
    "calib check --config config/kraft_like.toml",
    "decode tests/golden/sdo_segmented.log",
    "decode --json tests/golden/sdo_segmented.log",
    "export dbc --config config/kraft_like.toml",
    "export dcf --config config/kraft_like.toml --out FOLDER/dcf",
    "sim --config config/kraft_like.toml --calibrate elbow",
    "sim --config config/kraft_like.toml --calibrate-friction elbow",
    "replay SESSION --to 10",
    "replay SESSION --with config/kraft_like.toml --to 10",
    "plot SESSION q",
    "signals SESSION",
    "signals --json",
    "export csv SESSION q",
    "export mcap SESSION",
    "report SESSION",
    "sessions list FOLDER",
    "top --once --socket FEED",
];

/// Commands that need a bus: `tests/vcan.rs` runs them. `run` prints no data.
const ON_A_BUS: &[&str] = &["run", "commission", "scan", "sdo", "nmt", "lss"];

/// Commands that need a node: [`robot_process`](crate::robot_process), [`measure`](crate::measure) and [`measure_sign`](crate::measure_sign) run them.
const WITH_A_NODE: &[&str] = &["measure", "robot"];

/// Commands that serve until a signal: [`view`](crate::view) runs them.
const SERVING: &[&str] = &["view"];

/// Starts a node that grants every request, one client after the other.
fn node_at(socket: &Path) {
    let listener = UnixListener::bind(socket).unwrap();
    thread::spawn(move || {
        for client in listener.incoming() {
            let mut client = client.unwrap();
            BufReader::new(client.try_clone().unwrap()).read_line(&mut String::new()).unwrap();
            writeln!(client, "{{\"ok\":true,\"mode\":\"ready\"}}").unwrap();
        }
    });
}

/// Starts a node that sends its telemetry to every reader.
fn feed_at(socket: &Path) {
    let listener = UnixListener::bind(socket).unwrap();
    thread::spawn(move || {
        for reader in listener.incoming() {
            let lines = include_bytes!("../golden/telemetry.jsonl");
            reader.unwrap().write_all(lines).unwrap();
        }
    });
}

/// Returns the rows of [`PRINTING`] as arguments, in a folder of this test.
fn printing(test: &str) -> Vec<Vec<String>> {
    let folder = folder("terminal", test);
    // The path of a socket has at most 108 bytes.
    let socket = std::env::temp_dir().join(format!("frhc-{test}-{}.sock", std::process::id()));
    node_at(&socket);
    let feed = socket.with_extension("feed");
    feed_at(&feed);
    let data = folder.join("data.csv");
    let data = data.to_str().unwrap();
    let measured = frhc(&["sim", "--config", KRAFT, "--calibrate", "elbow", "--out", data]);
    assert_eq!(measured.code, 0, "{}", measured.stderr);
    let sweep = folder.join("sweep.csv");
    let sweep = sweep.to_str().unwrap();
    let swept = frhc(&["sim", "--config", KRAFT, "--calibrate-friction", "elbow", "--out", sweep]);
    assert_eq!(swept.code, 0, "{}", swept.stderr);
    let fragment = folder.join("fragment.toml");
    fs::write(&fragment, "[[joint]]\nname = \"elbow\"\ncoulomb_friction_nm = 0.05\n").unwrap();
    let session = folder.join("session");
    let session = session.to_str().unwrap();
    let recorded = frhc(&["-q", "demo", "--seconds", "0.1", "--out", session]);
    assert_eq!(recorded.code, 0, "{}", recorded.stderr);
    let known = [
        ("FRAGMENT", fragment.to_str().unwrap()),
        ("SESSION", session),
        ("SOCKET", socket.to_str().unwrap()),
        ("FEED", feed.to_str().unwrap()),
        ("FOLDER", folder.to_str().unwrap()),
        ("DATA", data),
        ("SWEEP", sweep),
    ];
    let replaced =
        |word: &str| known.iter().fold(word.to_owned(), |word, (from, to)| word.replace(from, to));
    PRINTING.iter().map(|line| line.split(' ').map(replaced).collect()).collect()
}

#[test]
fn failed_write_to_stdout_fails_every_command() {
    for args in printing("full") {
        let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let ended = onto(full, &args);
        assert_eq!(ended.code, 4, "{args:?}: {}", ended.stderr);
        let reports = ended.stderr.matches("frhc: stdout: No space left on device").count();
        assert_eq!(reports, 1, "{args:?}: {}", ended.stderr);
    }
}

#[test]
fn stdout_that_is_not_open_for_writing_fails_the_command() {
    for args in ["check --config config/kraft_like.toml", "decode tests/golden/sdo_segmented.log"] {
        let args: Vec<String> = args.split(' ').map(str::to_owned).collect();
        let ended = onto(File::open("/dev/null").unwrap(), &args);
        assert_eq!(ended.code, 4, "{args:?}: {}", ended.stderr);
        assert!(ended.stderr.contains("frhc: stdout: Bad file descriptor"), "{}", ended.stderr);
    }
}

#[test]
fn closed_stdout_fails_no_command() {
    for args in printing("hung_up") {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let ended = onto(writer, &args);
        assert!(!ended.stderr.contains("stdout"), "{args:?}: {}", ended.stderr);
        assert_eq!(ended.code, 0, "{args:?}: {}", ended.stderr);
    }
}

#[test]
fn every_command_is_tested_for_failing_output() {
    let help = frhc(&["--help"]).stdout;
    let commands: Vec<_> = listed(&help).collect();
    assert!(commands.len() > 20, "{commands:?}");
    for command in commands {
        let is_tested = |line: &&str| line.split(' ').next() == Some(command);
        let mut rows = PRINTING.iter().chain(ON_A_BUS).chain(WITH_A_NODE).chain(SERVING);
        assert!(rows.any(is_tested), "{command}");
    }
}

/// Returns the commands that a help page lists. Deeper lines continue a description.
fn listed(page: &str) -> impl Iterator<Item = &str> {
    let above = page.lines().take_while(|line| *line != "Options:");
    let rows = above.filter_map(|line| line.strip_prefix("  "));
    let rows = rows.filter(|row| row.starts_with(|first: char| first.is_ascii_lowercase()));
    rows.filter_map(|row| row.split_whitespace().next()).filter(|name| *name != "help")
}

/// Returns the help pages of a command and its subcommands.
fn help_pages(command: &[String]) -> Vec<(String, String)> {
    let page = frhc(&[command, &["--help".to_owned()]].concat()).stdout;
    let below: Vec<_> = listed(&page)
        .flat_map(|name| help_pages(&[command, &[name.to_owned()]].concat()))
        .collect();
    [vec![(command.join(" "), page.clone())], below].concat()
}

#[test]
fn every_help_page_has_an_example() {
    let pages = help_pages(&[]);
    assert!(pages.len() > 40, "{}", pages.len());
    for (command, page) in pages {
        assert!(page.contains("Example") && page.contains("  frhc "), "{command}: {page}");
    }
}

/// Asserts that the command fails with this code and message and prints no data; returns its stderr.
#[track_caller]
fn is_refused(args: &[&str], code: i32, words: &[&str]) -> String {
    let ended = frhc(args);
    assert_eq!(ended.code, code, "{args:?}: {}", ended.stderr);
    for word in words {
        assert!(ended.stderr.contains(word), "{args:?}: {word}: {}", ended.stderr);
    }
    assert_eq!(ended.stdout, "", "{args:?}");
    ended.stderr
}

#[test]
fn invalid_seconds_are_refused() {
    for seconds in ["-1", "0", "nan", "inf", "-inf", "1e300", "86401"] {
        let reason = ["--seconds", "must be a number above 0 and at most 86400"];
        // clap takes a separate value with a leading dash that is not a number for an option.
        let given = format!("--seconds={seconds}");
        is_refused(&["demo", &given], 2, &reason);
        is_refused(&["nmt", "watch", &given, "-i", "can7"], 2, &reason);
    }
    is_refused(&["demo", "--seconds", "-1"], 2, &["invalid value '-1' for '--seconds <N>'"]);
    is_refused(&["nmt", "watch", "--seconds", "-1"], 2, &["invalid value '-1'"]);
}

#[test]
fn options_without_effect_are_refused() {
    for args in [
        "nmt watch --wait -i can7",
        "nmt start 3 --timeout 100 -i can7",
        "nmt start 3 --json -i can7",
        "lss store --probe 5 -i can7",
        "lss inquire --global --probe 5 -i can7",
        "lss inquire --probe 5 -i can7",
        "lss inquire --selected --probe 5 -i can7",
        "lss configure --global --yes --node-id 4 --probe 5 -i can7",
        "decode -i can7 tests/golden/boot.log",
        "sim --config config/kraft_like.toml --reveal",
    ] {
        is_refused(&args.split(' ').collect::<Vec<_>>(), 2, &[]);
    }
}

#[test]
fn unknown_scenario_lists_the_shipped_ones() {
    let listed = ["contact_10s", "stiff-wall", "faults/: ", "unplug", "quirks/: ", "slow-sdo"];
    is_refused(&["demo", "--scenario", "nope"], 2, &listed);
    is_refused(
        &["demo", "--scenario", "unplug"],
        2,
        &["unknown scenario; did you mean faults/unplug?"],
    );
    let meant = ["unknown scenario; did you mean contact_10s?"];
    is_refused(&["demo", "--scenario", "contact10s"], 2, &meant);
    let listen = ["expected ADDRESS:PORT, as 127.0.0.1:8020"];
    is_refused(&["demo", "--view", "--listen", "8020"], 2, &listen);
    is_refused(&["demo", "--scenario", "nope.toml"], 3, &["nope.toml: No such file"]);
}

#[test]
fn shipped_scenarios_are_found_outside_the_repository() {
    let folder = folder("terminal", "elsewhere");
    for scenario in ["faults/unplug", "quirks/vague-aborts", "contact_10s"] {
        let mut command = Command::new(crate::common::program());
        command.args(["demo", "--seconds", "0.2", "--scenario", scenario]).current_dir(&folder);
        let output = command.output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{scenario}: {stderr}");
    }
}

#[test]
fn large_numbers_are_short_in_messages() {
    let folder = folder("terminal", "large");
    let text = fs::read_to_string(KRAFT).unwrap();
    let root = env!("CARGO_MANIFEST_DIR");
    let check = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        let file = folder.join("large.toml");
        let changed = text.replacen(from, to, 1).replace("../eds", &format!("{root}/eds"));
        fs::write(&file, changed).unwrap();
        is_refused(&["check", "--config", file.to_str().unwrap()], 3, &["1e300"])
    };
    for (from, to) in [
        ("a_m = 0.254", "a_m = 1e300"),
        ("gear_ratio = 40.0", "gear_ratio = 1e300"),
        ("max_torque_nm = 6.0 ", "max_torque_nm = 1e300 "),
        ("max_torque_nm = 6.0 ", "max_torque_nm = -1e300 "),
        ("mass_kg = 1.2", "mass_kg = 1e300"),
        ("node_id = 127", "node_id = 1e300"),
    ] {
        let stderr = check(from, to);
        assert_eq!(stderr.lines().count(), 1, "one mistake, one line: {stderr}");
        assert!(stderr.len() < 250, "{stderr}");
    }
    let answer = frhc(&["explain", "--q", "0,-0.8,1.6,-0.7,0,0", "--wrench", "1e300,0,0,0,0,0"]);
    assert!(
        answer.stdout.contains("1.000e300") && answer.stdout.len() < 9_000,
        "{}",
        answer.stdout
    );
}

#[test]
fn campaign_without_faults_is_refused() {
    is_refused(&["campaign", "--faults", "0"], 2, &["--faults"]);
    is_refused(&["campaign", "--soak", "0"], 2, &["--soak"]);
    is_refused(&["campaign", "--only", "nope"], 2, &["--only nope: unknown kind of fault"]);
}

/// Runs `frhc ctl status` with this runtime folder of the user.
fn status_in(runtime_dir: &str) -> CommandOutput {
    let mut command = Command::new(crate::common::program());
    command.args(["ctl", "status"]).env("XDG_RUNTIME_DIR", runtime_dir);
    let output = command.env_remove("RUNTIME_DIRECTORY").output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let (stdout, stderr) = (text(output.stdout), text(output.stderr));
    CommandOutput { code: output.status.code().unwrap(), stdout, stderr }
}

#[test]
fn ctl_names_the_sockets_it_tried() {
    let service = "frhc: no node at /run/frhc/node.sock: no such socket";
    for runtime_dir in ["", "relative", "./here"] {
        let ended = status_in(runtime_dir);
        assert_eq!(ended.code, 4, "{}", ended.stderr);
        assert!(ended.stderr.starts_with(service), "{runtime_dir}: {}", ended.stderr);
    }
    let ended = status_in("/nowhere");
    assert_eq!(ended.code, 4, "{}", ended.stderr);
    let user = "frhc: no node at /nowhere/frhc/node.sock: no such socket";
    assert!(ended.stderr.starts_with(user) && ended.stderr.contains(service), "{}", ended.stderr);
}
