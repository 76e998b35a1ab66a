//! `frhc signals` and `frhc export csv` as a user runs them: complete sessions, incomplete and changed ones.

use std::collections::HashMap;
use std::os::unix::fs::PermissionsExt;

use crate::common::prelude::*;
use crate::common::sessions::change_copy;
use canopen_tools::candump::{Content, Line};

/// A column by its name: an absent value is NaN.
type Table = HashMap<String, Vec<f64>>;

fn session(name: &str) -> PathBuf {
    let session = folder("signals", name).join("session");
    let out = session.to_str().unwrap();
    let ended = frhc(&["-q", "demo", "--scenario", "contact_10s", "--seconds", "6", "--out", out]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    session
}

fn export(session: &Path, args: &[&str]) -> CommandOutput {
    frhc(&[&["export", "csv", session.to_str().unwrap()], args].concat())
}

fn table(session: &Path, args: &[&str]) -> (Table, String) {
    let ended = export(session, args);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let mut lines = ended.stdout.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut table = Table::new();
    for line in lines {
        for (name, field) in names.iter().zip(line.split(',')) {
            let value = if field.is_empty() { f64::NAN } else { field.parse().unwrap() };
            table.entry((*name).to_owned()).or_default().push(value);
        }
    }
    (table, ended.stderr)
}

/// Target torques of the second drive in the log, in their order.
fn targets_on_the_wire(session: &Path) -> Vec<f64> {
    let log = fs::read_to_string(session.join("bus.log")).unwrap();
    let lines = log.lines().filter_map(|line| Line::parse(line).ok());
    let targets = lines.filter(|line| line.id == 0x201).filter_map(|line| match line.content {
        Content::Data(data) => Some(f64::from(i16::from_le_bytes([data[2], data[3]]))),
        Content::Fd(..) | Content::Remote(_) | Content::Error(_) => None,
    });
    targets.collect()
}

#[test]
fn table_has_every_cycle_and_the_targets_of_the_wire() {
    let session = session("whole");
    let (table, notes) = table(&session, &["target", "mode", "energy"]);
    assert_eq!(notes, "");
    assert_eq!((table["cycle"].len(), table.len()), (6_000, 10));
    assert!(table["cycle"].windows(2).all(|pair| (pair[1] - pair[0] - 1.0).abs() < 1e-9));
    assert!(table["time"].windows(2).all(|pair| (pair[1] - pair[0] - 1e-3).abs() < 1e-9));
    assert!(table["energy"].iter().all(|energy| energy.is_finite()));
    // The wire has the frames of the boot before those of the cycles, and not yet those of the last one.
    let (replayed, wire) = (&table["target.elevation"], targets_on_the_wire(&session));
    let changes = |targets: &[f64]| {
        let mut targets: Vec<_> = targets.iter().map(|target| target.to_string()).collect();
        targets.dedup();
        targets
    };
    let (replayed, wire) = (changes(replayed), changes(&wire));
    assert!(wire.len() > 1_000, "{}", wire.len());
    assert!(replayed.starts_with(&wire) || wire.starts_with(&replayed));
}

#[test]
fn part_of_a_table_is_chosen_by_cycle_or_time() {
    let session = session("part");
    let (by_time, _) = table(&session, &["q.elbow", "--from", "3s", "--to", "3.5s"]);
    assert_eq!(by_time["time"].len(), 500);
    let first = by_time["cycle"][0].to_string();
    let last = by_time["cycle"].last().unwrap().to_string();
    let args = ["q.elbow", "--from", &first, "--to", &last];
    assert_eq!(table(&session, &args).0["cycle"], by_time["cycle"]);
    let (tenth, _) = table(&session, &[&args[..], &["--every", "10"]].concat());
    assert_eq!(tenth["cycle"].len(), 50);
}

#[test]
fn signals_of_the_replay_end_where_it_differs() {
    let session = session("differs");
    change_copy(&session, "kraft_like.toml", |text| {
        text.replace("wrench_gain = [0.3, 0.3, 0.3", "wrench_gain = [0.4, 0.4, 0.4")
    });
    let (table, notes) = table(&session, &["q.elbow", "task.elbow", "f_s.fx", "load"]);
    assert!(
        notes.contains("the replay end where it differs: other frames are sent in cycle "),
        "{notes}"
    );
    assert!(notes.contains("f_g_task is the first intermediate that differs"), "{notes}");
    let known = |name: &str| table[name].iter().filter(|value| value.is_finite()).count();
    assert_eq!(known("q.elbow"), 6_000);
    assert_eq!(known("f_s.fx"), 6_000);
    assert!((1_000..5_000).contains(&known("task.elbow")), "{}", known("task.elbow"));
    assert!(table["load.vcan0"][1_000..].iter().all(|load| (70.0..=100.0).contains(load)));
}

#[test]
fn log_and_replay_agree_where_both_have_a_signal() {
    let session = session("agree");
    let names = ["q", "f_s", "mode", "inputs", "samples"];
    let (both, _) = table(&session, &names);
    fs::remove_file(session.join("inputs.bin")).unwrap();
    let (logged, notes) = table(&session, &names);
    assert!(notes.contains("without signals of the replay: ") && notes.contains("inputs.bin"));
    assert_eq!(both["cycle"], logged["cycle"]);
    // The log has the time of SYNC on the wire.
    for (name, values) in both.iter().filter(|(name, _)| *name != "time") {
        let pairs = values.iter().zip(&logged[name]);
        let differing = pairs.filter(|(one, other)| (*one - *other).abs() > 1e-9);
        assert_eq!(differing.count(), 0, "{name}");
    }
}

#[test]
fn replay_alone_has_its_signals_without_a_log() {
    let session = session("no-log");
    fs::remove_file(session.join("bus.log")).unwrap();
    let (table, notes) = table(&session, &["tau.elbow", "load"]);
    assert!(notes.contains("bus.log: No such file"), "{notes}");
    assert!(table["tau.elbow"].iter().all(|torque| torque.is_finite()));
    assert!(table["load.vcan0"].iter().all(|load| load.is_nan()));
    fs::remove_file(session.join("inputs.bin")).unwrap();
    let ended = export(&session, &[]);
    assert_eq!((ended.code, ended.stderr.lines().count()), (4, 1), "{}", ended.stderr);
}

#[test]
fn signals_are_listed_with_the_names_of_the_session() {
    let session = session("listed");
    let ended = frhc(&["signals", session.to_str().unwrap(), "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let signals: Vec<Value> =
        ended.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let named = |name: &str| signals.iter().find(|signal| signal["name"] == name).unwrap();
    assert_eq!(named("gravity.elbow")["unit"], "N·m");
    assert_eq!(named("f_g_task.fx")["frame"], "{G}");
    assert_eq!(named("load.vcan0")["source"], "log");
    let (table, _) = table(&session, &["--to", "200"]);
    assert!(signals.iter().all(|signal| table.contains_key(signal["name"].as_str().unwrap())));
    assert_eq!(table.len(), signals.len() + 2);
    assert!(frhc(&["signals"]).stdout.contains("gravity.<joint>"));
}

#[test]
fn wrong_names_and_places_are_refused_in_one_line() {
    let session = session("wrong");
    for (args, reason) in [
        (&["tau.elbw"][..], "unknown signal \"tau.elbw\", did you mean tau.el"),
        (&["--from", "2.5"][..], "must be a cycle, as 5000, or a time, as 2.5s; got 2.5"),
        (&["--every", "0"][..], "--every"),
    ] {
        let ended = export(&session, args);
        assert_eq!((ended.code, &*ended.stdout), (2, ""), "{}", ended.stderr);
        assert!(ended.stderr.contains(reason), "{}", ended.stderr);
    }
    let out = session.join("table.csv");
    let args = ["q", "-o", out.to_str().unwrap()];
    assert_eq!(export(&session, &args).code, 0);
    assert_eq!(fs::metadata(&out).unwrap().permissions().mode() & 0o777, 0o600);
    let again = export(&session, &args);
    assert!(again.code == 2 && again.stderr.contains("--force"), "{}", again.stderr);
    assert_eq!(export(&session, &[&args[..], &["--force"]].concat()).code, 0);
    let nowhere = export(&session, &["q", "-o", "/nonexistent/table.csv"]);
    assert_eq!((nowhere.code, nowhere.stderr.lines().count()), (4, 1), "{}", nowhere.stderr);
}

#[test]
fn plot_has_modes_and_curves_of_its_signals() {
    let session = session("plot");
    let folder = session.parent().unwrap();
    let plot = |out: &Path, signals: &[&str]| {
        let args = ["plot", session.to_str().unwrap(), "-o", out.to_str().unwrap()];
        frhc(&[&args[..], signals].concat())
    };
    let svg = folder.join("felt.svg");
    let ended = plot(&svg, &["f_s", "q.elbow"]);
    assert_eq!((ended.code, &*ended.stderr), (0, ""), "{}", ended.stderr);
    let text = fs::read_to_string(&svg).unwrap();
    for word in ["engaged", "f_s at {S}: wrench of the environment", "f_s.mz", "q.elbow: position"]
    {
        assert!(text.contains(word), "{word}");
    }
    assert!(!text.contains("NaN") && text.len() < 300_000, "{}", text.len());
    let csv = folder.join("felt.csv");
    assert_eq!(plot(&csv, &["f_s.fx"]).code, 0);
    assert!(fs::read_to_string(&csv).unwrap().starts_with("cycle,time,f_s.fx\n"));
    let png = folder.join("felt.png");
    let drawn = plot(&png, &["f_s"]);
    if cfg!(feature = "png") {
        assert_eq!(drawn.code, 0, "{}", drawn.stderr);
        assert!(fs::read(&png).unwrap().starts_with(b"\x89PNG"));
    } else {
        let reason = "this build draws no PNG; give FILE.svg, or build with --features png";
        assert!(drawn.code == 2 && drawn.stderr.contains(reason), "{}", drawn.stderr);
    }
    for (out, reason) in [("felt.jpg", ".svg, .png or .csv"), ("felt.svg", "--force")] {
        let ended = plot(&folder.join(out), &["f_s"]);
        assert!(ended.code == 2 && ended.stderr.contains(reason), "{}", ended.stderr);
    }
    let nothing = plot(&folder.join("late.svg"), &["f_s", "--from", "99s"]);
    assert!(nothing.code == 2 && nothing.stderr.contains("no cycle"), "{}", nothing.stderr);
    assert!(!folder.join("late.svg").exists());
}
