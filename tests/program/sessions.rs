//! Sessions in parts, as a program: replayed, packed, listed, decoded, and damaged.

use std::os::unix::fs::{PermissionsExt, symlink};

use crate::common::prelude::*;

const PARTS: u32 = 6;

/// Records a session of six parts.
fn session(name: &str) -> PathBuf {
    let session = folder("sessions", name).join("session");
    let out = ["-q", "demo", "--scenario", "contact_10s", "--seconds", "6"];
    let parts = ["--out", session.to_str().unwrap(), "--part-size", "0.5"];
    let ended = frhc(&[&out[..], &parts].concat());
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    session
}

fn on(session: &Path, before: &[&str], after: &[&str]) -> CommandOutput {
    frhc(&[before, &[session.to_str().unwrap()], after].concat())
}

/// Replays a session; returns the result and the output on stderr.
fn replayed(session: &Path) -> (Value, String) {
    let ended = on(session, &["replay"], &["--json"]);
    assert_eq!(ended.code, 0, "{}{}", ended.stdout, ended.stderr);
    (serde_json::from_str(&ended.stdout).unwrap(), ended.stderr)
}

/// Replays a session that is damaged before its end; returns the result and the output on stderr.
fn damaged(session: &Path) -> (Value, String) {
    let ended = on(session, &["replay"], &["--json"]);
    assert_eq!(ended.code, 4, "{}{}", ended.stdout, ended.stderr);
    (serde_json::from_str(&ended.stdout).unwrap(), ended.stderr)
}

#[track_caller]
fn is_whole(session: &Path) {
    let ended = on(session, &["replay"], &["--verify", "--json"]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""), "{}", ended.stdout);
    let result: Value = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!((&result["cycle_count"], &result["intermediate"]), (&6_000.into(), &Value::Null));
}

fn pack(session: &Path) -> CommandOutput {
    on(session, &["sessions", "pack"], &[])
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<_> = entries.map(|name| name.into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn session_in_parts_is_replayed_bit_for_bit_plain_and_packed() {
    let session = session("parts");
    let summary = fs::read_to_string(session.join("summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(summary["recording"]["parts"], PARTS);
    assert_eq!(summary["recording"]["ended_early"], Value::Null);
    is_whole(&session);
    let decoded = on(&session, &["decode"], &[]);
    assert!(decoded.stdout.contains("elbow"), "the configuration is that of the session");
    let of_first = on(&session.join("bus.log"), &["decode", "-c", KRAFT], &[]);
    assert!(decoded.stdout.starts_with(&of_first.stdout));

    let ended = pack(&session);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(ended.stdout.contains("12 files packed"), "{}", ended.stdout);
    let packed = names(&session).into_iter().filter(|name| name.ends_with(".gz"));
    assert_eq!(packed.count(), 12);
    is_whole(&session);
    assert!(on(&session, &["decode"], &[]).stdout == decoded.stdout, "other lines when packed");
    let packed = session.join("bus.log.gz");
    let packed = on(&packed, &["decode", "-c", KRAFT], &[]);
    assert!(packed.stdout == of_first.stdout);
    assert!(pack(&session).stdout.contains("nothing to pack"));
    for entry in fs::read_dir(&session).unwrap().flatten() {
        let mode = entry.metadata().unwrap().permissions().mode() & 0o777;
        assert!([0o600, 0o700].contains(&mode), "{}: {mode:o}", entry.path().display());
    }
}

#[test]
fn sessions_of_one_and_many_parts_have_the_same_lines() {
    let many = session("many");
    let one = many.with_file_name("one");
    let out = ["-q", "demo", "--scenario", "contact_10s", "--seconds", "6", "--out"];
    assert_eq!(on(&one, &out, &[]).code, 0);
    let parts = names(&many).into_iter().filter(|name| name.ends_with(".log"));
    let mut parts: Vec<_> = parts.collect();
    // The name of the first one is shorter.
    parts.sort_by_key(|name| (name.len(), name.clone()));
    let lines = parts.iter().flat_map(|name| fs::read(many.join(name)).unwrap());
    assert!(lines.eq(fs::read(one.join("bus.log")).unwrap()));
    is_whole(&one);
}

#[test]
fn missing_middle_part_is_named_and_the_rest_is_read() {
    let session = session("middle");
    let whole = on(&session, &["decode"], &[]).stdout;
    for file in ["bus-002.log", "inputs-003.bin"] {
        fs::remove_file(session.join(file)).unwrap();
    }
    let (result, stderr) = damaged(&session);
    for file in ["bus-002.log: is missing", "inputs-003.bin: is missing"] {
        assert!(stderr.contains(file), "{stderr}");
    }
    assert!(result["end"].as_str().unwrap().ends_with("inputs-003.bin: is missing"), "{result}");
    assert_eq!((&result["is_equal"], &result["is_complete"]), (&true.into(), &false.into()));
    let cycles = result["cycle_count"].as_u64().unwrap();
    assert!((1_500..3_000).contains(&cycles), "two of six parts: {cycles}");
    let decoded = on(&session, &["decode"], &[]);
    assert!(decoded.stderr.contains("bus-002.log: is missing"), "{}", decoded.stderr);
    let missing = whole.lines().count() - decoded.stdout.lines().count();
    assert!((8_000..16_000).contains(&missing), "{missing} lines");
    let list = on(&session, &["sessions", "list"], &[]);
    assert!(list.stdout.contains("missing: bus-002.log, inputs-003.bin"), "{}", list.stdout);
}

#[test]
fn missing_last_part_is_noticed_by_the_summary() {
    let session = session("last");
    for file in ["bus-006.log", "inputs-006.bin"] {
        fs::remove_file(session.join(file)).unwrap();
    }
    let (result, stderr) = damaged(&session);
    assert!(stderr.contains("inputs-006.bin: is missing"), "{stderr}");
    assert!(result["end"].as_str().unwrap().contains("inputs-006.bin: is missing"), "{result}");
    // Without it, nothing indicates further files.
    fs::remove_file(session.join("summary.json")).unwrap();
    let (result, stderr) = replayed(&session);
    assert!(stderr.contains("no summary.json: the recording was killed"), "{stderr}");
    assert_eq!(result["is_complete"], true, "{result}");
}

#[test]
fn part_that_is_another_or_is_cut_ends_the_replay_by_name() {
    let session = session("exchanged");
    let [second, third] = ["inputs-002.bin", "inputs-003.bin"].map(|name| session.join(name));
    let bytes = fs::read(&second).unwrap();
    let ends = |reason: &str| {
        let (result, _) = damaged(&session);
        assert!(result["end"].as_str().unwrap().contains(reason), "{result}");
        assert_eq!(result["is_equal"], true, "{result}");
        result["cycle_count"].as_u64().unwrap()
    };
    fs::copy(&third, &second).unwrap();
    let first = ends("inputs-002.bin: not the part that follows");
    let mut before = 0;
    for tenths in [0, 3, 5, 8] {
        fs::write(&second, &bytes[..bytes.len() * tenths / 10]).unwrap();
        let cycles = ends("inputs-00");
        assert!(cycles >= first && cycles >= before, "{cycles}");
        before = cycles;
    }
    fs::write(&second, &bytes).unwrap();
    is_whole(&session);
}

#[test]
fn packed_part_that_is_damaged_is_named() {
    let session = session("damaged");
    pack(&session);
    let third = session.join("inputs-003.bin.gz");
    let mut bytes = fs::read(&third).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    fs::write(&third, &bytes).unwrap();
    let ended = on(&session, &["replay"], &["--verify"]);
    assert_eq!(ended.code, 4, "{}", ended.stderr);
    assert!(ended.stdout.contains("inputs-003.bin.gz: "), "{}", ended.stdout);
    let log = session.join("bus-004.log.gz");
    let bytes = fs::read(&log).unwrap();
    fs::write(&log, &bytes[..bytes.len() / 2]).unwrap();
    let ended = on(&session, &["decode"], &[]);
    assert!(ended.code == 4 && ended.stderr.contains("bus-004.log.gz: "), "{}", ended.stderr);
}

#[test]
fn symbolic_link_as_a_part_is_never_followed() {
    let session = session("link");
    let link = |file: &str| {
        let (part, elsewhere) = (session.join(file), session.with_file_name(file));
        fs::rename(&part, &elsewhere).unwrap();
        symlink(&elsewhere, &part).unwrap();
    };
    link("inputs-003.bin");
    let (result, _) = damaged(&session);
    let end = result["end"].as_str().unwrap();
    assert!(end.contains("inputs-003.bin: must be a regular file"), "{end}");
    link("bus-003.log");
    let ended = on(&session, &["replay"], &[]);
    assert_eq!((ended.code, ended.stdout.as_str()), (4, ""));
    assert!(ended.stderr.contains("bus-003.log: must be a regular file"), "{}", ended.stderr);
    let ended = on(&session, &["decode"], &[]);
    assert_eq!(ended.code, 4);
    assert!(ended.stderr.contains("bus-003.log: must be a regular file"), "{}", ended.stderr);
    let ended = pack(&session);
    assert_eq!(ended.code, 4);
    assert!(ended.stderr.contains(": must be a regular file"), "{}", ended.stderr);
}

#[test]
fn full_disk_while_packing_loses_nothing() {
    let session = session("full");
    let program = crate::common::program();
    // No part fits into 50 kB.
    let limited = format!("ulimit -f 50; exec \"{program}\" sessions pack \"$0\"");
    let before = names(&session);
    let ended = Command::new("sh").args(["-c", &limited]).arg(&session).output().unwrap();
    let stderr = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(4), "{stderr}");
    assert!(stderr.lines().count() == 1 && stderr.contains("File too large"), "{stderr}");
    assert_eq!(names(&session), before);
    is_whole(&session);
    assert_eq!(pack(&session).code, 0);
    is_whole(&session);
}

#[test]
fn sessions_of_a_folder_are_listed_and_packed() {
    let first = session("folder");
    let parent = first.parent().unwrap();
    let second = parent.join("stopped");
    let unplug = ["-q", "demo", "--scenario", "faults/unplug", "--seconds", "3", "--out"];
    assert_eq!(on(&second, &unplug, &[]).code, 6);
    fs::create_dir(parent.join("empty")).unwrap();
    assert_eq!(on(parent, &["sessions", "pack"], &[]).code, 0);
    let list = on(parent, &["sessions", "list"], &[]).stdout;
    let rows: Vec<_> = list.lines().collect();
    assert_eq!(rows.len(), 3, "{list}");
    for (row, cells) in [
        (rows[1], ["session ", " 6.0 s ", "  6 ", " yes ", " engaged"]),
        (rows[2], ["stopped ", " 3.0 s ", "  1 ", " yes ", " drives-off: "]),
    ] {
        cells.iter().for_each(|cell| assert!(row.contains(cell), "{cell:?} in {row}"));
    }
    let json = on(parent, &["sessions", "list"], &["--json"]).stdout;
    let rows: Vec<Value> = json.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((&rows[0]["parts"], &rows[1]["packed"]), (&PARTS.into(), &2.into()));
    for command in ["list", "pack"] {
        let ended = on(&parent.join("empty"), &["sessions", command], &[]);
        assert_eq!(ended.code, 4);
        assert!(ended.stderr.contains("empty: no session is in this folder"), "{}", ended.stderr);
    }
}

#[test]
fn list_goes_on_behind_an_unreadable_session() {
    let first = session("unreadable");
    let parent = first.parent().unwrap();
    fs::create_dir(parent.join("bad")).unwrap();
    fs::write(parent.join("bad/session.json"), "{").unwrap();
    let list = on(parent, &["sessions", "list"], &[]);
    assert_eq!(list.code, 4);
    assert!(list.stderr.ends_with(": 1 of 2 unreadable\n"), "{}", list.stderr);
    let rows: Vec<_> = list.stdout.lines().collect();
    assert!(rows[1].starts_with("bad ") && rows[1].contains("  unreadable: session.json: "));
    assert!(rows[2].starts_with("session ") && rows[2].ends_with(" engaged"), "{}", list.stdout);
    let json = on(parent, &["sessions", "list"], &["--json"]).stdout;
    let rows: Vec<Value> = json.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(rows[0]["unreadable"].is_string() && rows[1]["is_recording"] == false, "{json}");
}

#[test]
fn endless_line_of_a_log_is_named_by_file_and_line() {
    let session = folder("sessions", "endless").join("session");
    let out = ["-q", "demo", "--scenario", "contact_10s", "--seconds", "2", "--out"];
    assert_eq!(on(&session, &out, &[]).code, 0);
    let log = session.join("bus.log");
    let number = fs::read_to_string(&log).unwrap().lines().count() + 1;
    // A sparse file takes no room on the disk.
    fs::File::options().append(true).open(&log).unwrap().set_len(10_000_000_000).unwrap();
    let reason = format!("bus.log: line {number} is longer than 1 MiB: not a candump log\n");
    for (path, args) in [(&session, &[][..]), (&log, &["-c", KRAFT])] {
        let ended = on(path, &["decode"], args);
        assert!(ended.code == 4 && ended.stderr.ends_with(&reason), "{}", ended.stderr);
        assert!(ended.stderr.lines().count() == 1 && ended.stdout.contains("elbow"));
    }
    let ended = on(&session, &["report"], &[]);
    assert!(ended.code == 0 && ended.stderr.contains(&reason), "{}", ended.stderr);
    assert!(fs::read_to_string(session.join("report.html")).unwrap().contains(reason.trim_end()));
    assert_eq!(on(&session, &["replay"], &["--verify"]).code, 0);
}

#[test]
fn fault_record_names_its_session_without_its_folders() {
    let session = folder("sessions", "fault").join("my-session");
    let unplug = ["-q", "demo", "--scenario", "faults/unplug", "--seconds", "3", "--out"];
    assert_eq!(on(&session, &unplug, &[]).code, 6);
    let record = fs::read_dir(session.join("faults")).unwrap().next().unwrap().unwrap().path();
    let document = fs::read_to_string(record.join("fault.json")).unwrap();
    let fault: Value = serde_json::from_str(&document).unwrap();
    assert_eq!(
        (&fault["session"], &fault["session_name"]),
        (&"../..".into(), &"my-session".into())
    );
    assert!(!document.contains(session.parent().unwrap().to_str().unwrap()), "{document}");
    // Its cycle is that of the session's log.
    let cycle = u32::try_from(fault["cycle"].as_u64().unwrap()).unwrap();
    let bytes: String = cycle.to_le_bytes().iter().map(|byte| format!("{byte:02X}")).collect();
    let log = fs::read_to_string(session.join("bus.log")).unwrap();
    let mut cycles = log.lines().filter(|line| line.contains(" node0 "));
    assert!(cycles.any(|line| line.ends_with(&bytes)), "cycle {cycle}");
}

#[test]
fn campaign_logs_are_readable_by_their_owner_only() {
    let out = folder("sessions", "campaign").join("case");
    let args = ["campaign", "-c", KRAFT, "--seed", "1", "--replay", "1", "--out"];
    assert!([0, 1].contains(&on(&out, &args, &[]).code));
    let mut folders = vec![out];
    let mut files = 0;
    while let Some(folder) = folders.pop() {
        assert_eq!(mode(&folder), 0o700, "{}", folder.display());
        for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if entry.is_dir() {
                folders.push(entry);
            } else {
                assert_eq!(mode(&entry), 0o600, "{}", entry.display());
                files += 1;
            }
        }
    }
    // The log and the scenario of the case, and its session.
    assert!(files > 6, "{files}");
}

/// Case 11 of seed 5 showed its proof test at 5.719 s, and its log at 0.620 s.
#[test]
fn replayed_case_has_the_times_of_its_log() {
    let out = folder("sessions", "clock").join("case");
    let ended = on(&out, &["campaign", "--seed", "5", "--replay", "11", "--out"], &[]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let log = fs::read_to_string(out.join("case-11/bus.log")).unwrap();
    let of_log = |line: &str, id: &str| {
        let seconds = line.split_once(") ")?.0.trim_start_matches('(').parse::<f64>();
        line.contains(id).then(|| seconds.unwrap())
    };
    let printed = |line: &str, text: &str| {
        line.contains(text).then(|| line.split(' ').next().unwrap().parse::<f64>().unwrap())
    };
    for (joint, id) in [("joint 1 (azimuth)", " 681#5082"), ("joint 6 (roll)", " 686#5082")] {
        let text = format!("{joint}: proof test of its watchdog: emergency 8250h");
        let seen = ended.stdout.lines().find_map(|line| printed(line, &text)).unwrap();
        let logged = log.lines().find_map(|line| of_log(line, id)).unwrap();
        assert!((seen - logged).abs() < 0.001, "{seen} s printed, {logged} s in the log");
    }
    // All lines are in the order of their times.
    let times: Vec<f64> = ended.stdout.lines().filter_map(|line| printed(line, " s: ")).collect();
    assert!(times.len() > 20 && times.is_sorted(), "{}", ended.stdout);
}

fn mode(path: &Path) -> u32 {
    fs::metadata(path).unwrap().permissions().mode() & 0o777
}
