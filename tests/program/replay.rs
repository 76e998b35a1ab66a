//! `frhc replay` as a program: sessions of every configuration and scenario, and sessions that were changed.

use std::os::unix::fs::symlink;

use crate::common::prelude::*;
use crate::common::sessions::change_copy;
use canopen_tools::candump::Line;

/// Size of the header of a part of the inputs, in bytes.
const HEADER: usize = 20;

/// Records a session of `demo` with these arguments.
fn session(name: &str, args: &[&str]) -> PathBuf {
    let session = folder("replay", name).join("session");
    let out = ["-q", "demo", "--out", session.to_str().unwrap()];
    let ended = frhc(&[&out[..], args].concat());
    assert!([0, 6].contains(&ended.code), "{args:?}: {}", ended.stderr);
    session
}

fn short_session(name: &str) -> PathBuf {
    session(name, &["--scenario", "contact_10s", "--seconds", "6"])
}

fn replay(session: &Path, args: &[&str]) -> CommandOutput {
    frhc(&[&["replay", session.to_str().unwrap()], args].concat())
}

fn replayed(session: &Path) -> Value {
    let ended = replay(session, &["--verify", "--json"]);
    assert_eq!(ended.code, 0, "{}: {}{}", session.display(), ended.stdout, ended.stderr);
    serde_json::from_str(&ended.stdout).unwrap()
}

/// Returns the failure of a session that cannot be replayed: one line, exit code 4.
fn refused(session: &Path) -> String {
    let ended = replay(session, &[]);
    assert_eq!((ended.code, ended.stdout.as_str()), (4, ""), "{}", ended.stderr);
    assert_eq!(ended.stderr.lines().count(), 1, "{}", ended.stderr);
    ended.stderr
}

#[test]
fn session_of_every_configuration_is_replayed_bit_for_bit() {
    for file in HAND_CONTROLLERS {
        let name = file.replace('/', "-");
        let result = replayed(&session(&name, &["--config", file, "--seconds", "5"]));
        let cycles = result["cycle_count"].as_u64().unwrap();
        assert!(
            cycles >= 2_500 && result["frame_count"].as_u64().unwrap() > 2 * cycles,
            "{file}: {result}"
        );
        assert_eq!(result["intermediate"], Value::Null, "{file}");
    }
}

#[test]
fn session_with_a_gripper_is_replayed_with_its_signals() {
    let folder = folder("replay", "gripper-files");
    fs::create_dir_all(&folder).unwrap();
    let root = std::env::current_dir().unwrap();
    let text = fs::read_to_string(KRAFT_500HZ).unwrap();
    let text = text.replace("\"../eds/", &format!("\"{}/eds/", root.display()));
    let input = "[switches.gripper]\ninput = 1\nopen_counts = 10000\nclosed_counts = 0\nstroke_m = 0.08\n\
        force_n = 15.0\nmax_speed_m_per_s = 0.05\n\n[controller]";
    let gripper = "[remote.gripper]\nstroke_m = 0.08\nmax_speed_m_per_s = 0.2\nobject_m = 0.03\n\
        stiffness_n_per_m = 5000.0\n\n[safety]";
    let text = text.replacen("[controller]", input, 1).replacen("[safety]", gripper, 1);
    let file = folder.join("hand.toml");
    fs::write(&file, text).unwrap();
    let args = ["--scenario", "contact_10s", "--seconds", "6"];
    let session = session("gripper", &[&["--config", file.to_str().unwrap()], &args[..]].concat());
    assert!(replayed(&session)["cycle_count"].as_u64().unwrap() > 2_500);
    let table = frhc(&[
        "export",
        "csv",
        session.to_str().unwrap(),
        "gripper_d",
        "gripper",
        "gripper_force",
    ]);
    let last: Vec<f64> = table
        .stdout
        .lines()
        .last()
        .unwrap()
        .split(',')
        .filter_map(|cell| cell.parse().ok())
        .collect();
    let [.., commanded, opening, force] = last[..] else { panic!("{last:?}") };
    assert!(commanded < 0.027 && (opening - 0.027).abs() < 1e-6, "{last:?}");
    assert!((force - 15.0).abs() < 1e-3, "{last:?}");
}

#[test]
fn fault_record_is_replayed_where_its_session_was_recorded() {
    let name = ["--scenario", "config/scenarios/faults/encoder_jump.toml"];
    let session = session("fault", &name);
    let record = fs::read_dir(session.join("faults")).unwrap().next().unwrap().unwrap().path();
    let text = fs::read_to_string(record.join("fault.json")).unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    let emitted = session.join("sent.log");
    let result = replay(&record, &["--json", "--emit", emitted.to_str().unwrap()]);
    assert_eq!(result.code, 0, "{}{}", result.stdout, result.stderr);
    let result: Value = serde_json::from_str(&result.stdout).unwrap();
    assert_eq!(result["trip"]["cycle"], document["cycle"], "{result}");
    assert_eq!(result["trip"]["cause"], document["cause"], "{result}");
    assert_eq!(result["trip"]["replayed_cause"], document["cause"], "{result}");
    // As many SYNCs as the record has, but for the one of its last moment.
    let syncs = |log: &Path| stamps(log, " vcan0 080#").count();
    let (sent, recorded) = (syncs(&emitted), syncs(&record.join("bus.log")));
    assert!(recorded > 500 && sent.abs_diff(recorded) <= 1, "{sent} of {recorded}");
    let shown = replay(&record, &[]);
    let cycle = format!("trip      cycle {}, ", document["cycle"]);
    assert!(shown.stdout.contains(&cycle), "{}", shown.stdout);

    // Another cause than the recorded one, and a record that lies elsewhere.
    let other = text.replace("\"cause\": \"", "\"cause\": \"another ");
    fs::write(record.join("fault.json"), other).unwrap();
    let ended = replay(&record, &[]);
    assert!(
        ended.code == 1 && ended.stderr.contains("the record has \"another "),
        "{}",
        ended.stderr
    );
    let elsewhere = session.with_file_name("elsewhere");
    fs::rename(&record, &elsewhere).unwrap();
    assert!(refused(&elsewhere).contains("`frhc report "));
}

#[test]
fn session_of_every_scenario_is_replayed_bit_for_bit() {
    for kind in ["faults", "quirks"] {
        for entry in fs::read_dir(format!("config/scenarios/{kind}")).unwrap() {
            let file = entry.unwrap().path();
            let scenario = file.to_str().unwrap();
            // Scenarios that need another configuration, or end before a cycle, have no session to replay.
            let session = folder("replay", kind).join("session");
            let out = ["-q", "demo", "--out", session.to_str().unwrap(), "--scenario", scenario];
            let ended = frhc(&out);
            if [2, 3, 5].contains(&ended.code) {
                continue;
            }
            assert!(replayed(&session)["cycle_count"].as_u64().unwrap() > 100, "{scenario}");
        }
    }
}

#[test]
fn session_with_a_robot_is_replayed_with_its_file() {
    let robot = ["--robot", PUMA, "--seconds", "5"];
    let session = session("robot", &robot);
    replayed(&session);
    let description = fs::read_to_string(session.join("session.json")).unwrap();
    assert!(description.contains(PUMA), "{description}");
}

#[test]
fn session_without_passivity_layer_is_replayed_without_it() {
    let session = session("comparison", &["--scenario", "stiff-wall"]);
    for of in ["without", "with"] {
        replayed(&session.join(of));
    }
}

/// Returns the stamps of the lines that contain a text.
fn stamps(log: &Path, of: &str) -> impl Iterator<Item = String> {
    let text = fs::read_to_string(log).unwrap();
    let lines = text.lines().filter(|line| line.contains(of)).map(str::to_owned);
    let lines: Vec<_> = lines.collect();
    lines.into_iter().map(|line| line.split_once(' ').unwrap().0.to_owned())
}

/// Returns number and stamp of each cycle in the log of a session.
fn numbered_cycles(session: &Path) -> impl Iterator<Item = (u64, String)> {
    let log = fs::read_to_string(session.join("bus.log")).unwrap();
    let cycle = |line: &str| {
        let (stamp, data) = line.split_once(" node0 18FF0001##0")?;
        let number = u32::from_str_radix(&data[8..16], 16).unwrap();
        Some((u64::from(number.swap_bytes()), stamp.to_owned()))
    };
    log.lines().filter_map(cycle).collect::<Vec<_>>().into_iter()
}

#[test]
fn emitted_frames_are_those_that_the_node_has_sent() {
    let session = short_session("emitted");
    let emitted = session.join("sent.log");
    let ended = replay(&session, &["--emit", emitted.to_str().unwrap()]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let frames = |path: &Path, of: &dyn Fn(&Line<'_>) -> bool| {
        let log = fs::read_to_string(path).unwrap();
        let lines = log.lines().map(|line| (Line::parse(line).unwrap(), line));
        let frames = lines.filter(|(line, _)| of(line));
        frames.map(|(_, line)| line.split_once(' ').unwrap().1.to_owned()).collect::<Vec<_>>()
    };
    let sent = frames(&emitted, &|_| true);
    // SYNC, both groups of torques, and the heartbeat: only the node sends them. The last ones may not be on the wire yet.
    for cob_id in [0x80, 0x201, 0x204, 0x77F] {
        let is_one = |line: &Line<'_>| line.id == cob_id;
        let (sent, on_the_wire) =
            (frames(&emitted, &is_one), frames(&session.join("bus.log"), &is_one));
        assert!(on_the_wire.len() > 100 && sent.len() - on_the_wire.len() <= 2, "{cob_id:03X}h");
        assert_eq!(sent[..on_the_wire.len()], on_the_wire, "{cob_id:03X}h");
    }
    let part = session.join("part.log");
    let bounds = ["--emit", part.to_str().unwrap(), "--from", "1000", "--to", "1010"];
    assert_eq!(replay(&session, &bounds).code, 0);
    let syncs: Vec<_> = stamps(&part, " vcan0 080#").collect();
    let ends = numbered_cycles(&session).filter(|(cycle, _)| (999..=1_010).contains(cycle));
    let ends: Vec<_> = ends.map(|(_, stamp)| stamp).collect();
    assert_eq!((syncs.len(), ends.len()), (11, 12));
    let mut cycles = ends.windows(2).zip(&syncs);
    assert!(cycles.all(|(ends, sync)| ends[0] < *sync && *sync < ends[1]), "{ends:?} {syncs:?}");
    let part = frames(&part, &|_| true);
    assert!(part.len() >= 30 && sent.windows(part.len()).any(|window| window == part), "{part:?}");
    let again = replay(&session, &["--emit", emitted.to_str().unwrap()]);
    assert!(again.code == 4 && again.stderr.contains("exists"), "{}", again.stderr);
}

#[test]
fn gain_changed_by_a_millionth_is_named_where_it_acts() {
    let session = short_session("gain");
    change_copy(&session, "kraft_like.toml", |text| {
        text.replace("damping_ns_per_m = [8.0, 8.0", "damping_ns_per_m = [8.000008, 8.0")
    });
    let ended = replay(&session, &["--json"]);
    let result: Value = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!(result["intermediate"]["name"], "f_g_damping", "{result}");
}

#[test]
fn other_torque_is_named_by_cycle_and_frame() {
    let session = short_session("torque");
    change_copy(&session, "kraft_like.toml", |text| {
        text.replace("wrench_gain = [0.3, 0.3, 0.3", "wrench_gain = [0.4, 0.4, 0.4")
    });
    let ended = replay(&session, &[]);
    assert_eq!(ended.code, 1, "{}", ended.stdout);
    let line = ended.stdout.lines().find(|line| line.starts_with("replayed")).unwrap();
    assert!(line.contains(" sent in cycle ") && line.contains("recorded vcan0 201#"), "{line}");
    assert!(
        ended.stdout.contains("f_g_task is the first intermediate that differs"),
        "{}",
        ended.stdout
    );
}

#[test]
fn torques_of_another_configuration_are_compared_in_open_loop() {
    let session = short_session("with");
    let text = fs::read_to_string(KRAFT).unwrap();
    let other = session.join("other.toml");
    let other_gain = text.replace("wrench_gain = [0.3, 0.3, 0.3", "wrench_gain = [0.4, 0.4, 0.4");
    fs::write(
        &other,
        other_gain.replace("../eds/", &format!("{}/eds/", env!("CARGO_MANIFEST_DIR"))),
    )
    .unwrap();
    let ended = replay(&session, &["--with", other.to_str().unwrap()]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let first = ended.stdout.lines().next().unwrap();
    assert!(first.starts_with("open loop: "), "{first}");
    let with = ["--with", other.to_str().unwrap(), "--json"];
    let result: Value = serde_json::from_str(&replay(&session, &with).stdout).unwrap();
    assert!(result["cycle_count"].as_u64().unwrap() > 5_000, "{result}");
    let max = |joint: usize| result["torque_difference"][joint]["max"].as_f64().unwrap();
    assert!((0..6).any(|joint| max(joint) > 0.01), "{result}");
    let same = ["--with", KRAFT, "--json"];
    let result: Value = serde_json::from_str(&replay(&session, &same).stdout).unwrap();
    let joints = result["torque_difference"].as_array().unwrap();
    assert!(joints.iter().all(|joint| joint["max"].as_f64() == Some(0.0)), "{result}");
}

#[test]
fn edited_copy_is_refused_by_its_checksum() {
    let session = short_session("edited");
    let copy = session.join("files/01-kraft_like.toml");
    let text = fs::read_to_string(&copy).unwrap();
    fs::write(&copy, text + "#").unwrap();
    let reason = refused(&session);
    assert!(
        reason.contains("files/01-kraft_like.toml: not the file that was recorded"),
        "{reason}"
    );
}

#[test]
fn single_bit_of_the_inputs_is_found_or_changes_no_frame() {
    let session = short_session("bits");
    let file = session.join("inputs.bin");
    let inputs = fs::read(&file).unwrap();
    let mut found = 0;
    for edit in 0..100 {
        // After the header, over the complete file.
        let place = HEADER + (inputs.len() - HEADER) * edit / 100;
        let mut edited = inputs.clone();
        edited[place] ^= 1 << (edit % 8);
        fs::write(&file, edited).unwrap();
        let ended = replay(&session, &["--verify", "--json"]);
        if ended.stdout.is_empty() {
            assert!(edit == 0 && ended.stderr.contains("no call of the node"), "{}", ended.stderr);
            continue;
        }
        let result: Value = serde_json::from_str(&ended.stdout).unwrap();
        assert!([0, 1, 4].contains(&ended.code), "byte {place}: {}", ended.stderr);
        if ended.code == 0 {
            assert_eq!((&result["is_equal"], &result["is_complete"]), (&true.into(), &true.into()));
        } else {
            let end = result["end"].as_str().unwrap();
            assert!(end.contains("cycle") || end.contains("byte"), "byte {place}: {end}");
            found += 1;
        }
    }
    assert!(found > 50, "{found} of 100");
}

#[test]
fn recording_that_ends_anywhere_is_replayed_until_there() {
    let session = short_session("cut");
    let file = session.join("inputs.bin");
    let inputs = fs::read(&file).unwrap();
    // As a killed run leaves it.
    fs::remove_file(session.join("summary.json")).unwrap();
    let mut before = 0;
    for part in [30, 60, 90] {
        fs::write(&file, &inputs[..inputs.len() * part / 100]).unwrap();
        let ended = replay(&session, &["--json"]);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        let result: Value = serde_json::from_str(&ended.stdout).unwrap();
        let end = result["end"].as_str().unwrap();
        let last = result["last_cycle"].as_u64().unwrap();
        assert!(end.ends_with(&format!("the recording ends in cycle {}", last + 1)), "{end}");
        let (first, _) = numbered_cycles(&session).next().unwrap();
        assert_eq!(result["cycle_count"].as_u64().unwrap(), last + 1 - first, "{result}");
        let cycles = result["cycle_count"].as_u64().unwrap();
        assert!(cycles > before, "{cycles} after {before}");
        before = cycles;
        assert_eq!(replay(&session, &["--verify"]).code, 1);
    }
}

#[test]
fn each_end_of_a_recording_has_its_exit_code() {
    let session = short_session("ends");
    let [inputs, summary] = ["inputs.bin", "summary.json"].map(|name| session.join(name));
    let bytes = fs::read(&inputs).unwrap();
    let ends = |content: &[u8], code: i32, verdict: &str| {
        fs::write(&inputs, content).unwrap();
        let ended = replay(&session, &["--json"]);
        let result: Value = serde_json::from_str(&ended.stdout).unwrap();
        assert_eq!((ended.code, &result["verdict"]), (code, &verdict.into()), "{}", ended.stderr);
        ended.stderr
    };
    ends(&bytes, 0, "equal");
    // At some of these places the bytes are all numbers of one sample, and the frames differ.
    let said = (0..16).find_map(|place| {
        let mut damaged = bytes.clone();
        damaged[bytes.len() / 2 + 64 * place..][..64].fill(0xFF);
        fs::write(&inputs, damaged).unwrap();
        let ended = replay(&session, &["--json"]);
        let result: Value = serde_json::from_str(&ended.stdout).unwrap();
        assert!([1, 4].contains(&ended.code), "{}", ended.stderr);
        (result["verdict"] == "damaged").then_some(ended.stderr)
    });
    let said = said.unwrap();
    assert!(said.contains("damaged before its end: as recorded; the rest cannot be"), "{said}");
    let cut = &bytes[..bytes.len() / 2];
    // The summary says that the run has ended after it.
    ends(cut, 4, "damaged");
    fs::remove_file(&summary).unwrap();
    let said = ends(cut, 0, "cut");
    assert!(said.contains("no summary.json: the recording was killed"), "{said}");
    let said = ends(&bytes[..2 * HEADER], 4, "nothing");
    assert!(said.contains("nothing was replayed: "), "{said}");
}

#[test]
fn log_that_is_a_pipe_or_a_folder_is_refused() {
    let session = short_session("kinds");
    let log = session.join("bus.log");
    fs::remove_file(&log).unwrap();
    fs::create_dir(&log).unwrap();
    assert!(refused(&session).contains("bus.log: must be a regular file"));
    fs::remove_dir(&log).unwrap();
    assert!(Command::new("mkfifo").arg(&log).status().unwrap().success());
    assert!(refused(&session).contains("bus.log: must be a regular file"));
}

#[test]
fn session_that_is_none_is_refused_in_one_line() {
    let session = short_session("refused");
    let description = session.join("session.json");
    let text = fs::read_to_string(&description).unwrap();
    let with = |from: &str, to: &str| {
        assert!(text.contains(from));
        fs::write(&description, text.replacen(from, to, 1)).unwrap();
        refused(&session)
    };
    assert!(
        with("\"format\": 2", "\"format\": 3").contains("format 3; this program reads format 2")
    );
    assert!(with("{", "[").contains("session.json: "));
    assert!(with("files/01-", "../01-").contains("which is not in the session's folder"));
    assert!(with("files/01-", "files/99-").contains("99-kraft_like.toml: No such file"));
    fs::write(&description, &text).unwrap();

    let inputs = session.join("inputs.bin");
    let bytes = fs::read(&inputs).unwrap();
    let mut later = bytes.clone();
    later[6] += 1;
    for (content, reason) in [
        (&b"(0.1) can0 080#"[..], "not a file of inputs"),
        (&later, "inputs of format 3"),
        (&bytes[..8], "the inputs end inside the entry at byte 8"),
        (&bytes[..HEADER], "no call of the node was recorded"),
    ] {
        fs::write(&inputs, content).unwrap();
        let found = refused(&session);
        assert!(found.contains("inputs.bin: ") && found.contains(reason), "{found}");
    }
    fs::remove_file(&inputs).unwrap();
    assert!(refused(&session).contains("inputs.bin: No such file"));
    let elsewhere = session.with_file_name("inputs.bin");
    fs::write(&elsewhere, &bytes).unwrap();
    symlink(&elsewhere, &inputs).unwrap();
    assert!(refused(&session).contains("inputs.bin: must be a regular file"));
    assert!(refused(&session.join("absent")).contains("absent: not a session"));
}
