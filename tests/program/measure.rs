//! `frhc measure direction` beside a node that is played: its telemetry, and a person at its arm.

use std::io::Write;
use std::os::unix::net::UnixListener;
use std::thread;

use serde_json::{Value, json};

use crate::common::prelude::*;

/// Arm of one's own, as a copy of a shipped one.
fn arm(test: &str) -> PathBuf {
    let folder = folder("measure", test);
    let eds = Path::new(env!("CARGO_MANIFEST_DIR")).join("eds");
    let file = folder.join("my_arm.toml");
    fs::write(&file, text(KRAFT).replace("\"../eds/", &format!("\"{}/", eds.display()))).unwrap();
    file
}

/// Posture of a played arm, with the grip in front of it.
const FROM: [f64; 6] = [0.0, -0.9, 1.6, -0.7, 0.3, 0.0];

/// Description of the played node, with the joints of the arm.
fn description(first: &str) -> Value {
    let names = [first, "elevation", "elbow", "pitch", "yaw", "roll"];
    let joints = names.map(|name| json!({ "name": name }));
    json!({ "version": 1, "kind": "description", "hand": { "joints": joints } })
}

/// Plays a node that describes itself, with these snapshots.
fn node(file: &Path, description: &Value, snapshots: Vec<Value>) -> PathBuf {
    // The path of a socket has at most 108 bytes.
    let name = file.parent().unwrap().file_name().unwrap().to_string_lossy();
    let socket = std::env::temp_dir().join(format!("frhc-{name}-{}.sock", std::process::id()));
    _ = fs::remove_file(&socket);
    let listener = UnixListener::bind(&socket).unwrap();
    let described = description.to_string();
    thread::spawn(move || {
        for reader in listener.incoming() {
            let mut reader = reader.unwrap();
            // It ends when it has found what it wants.
            let lines =
                std::iter::once(described.clone()).chain(snapshots.iter().map(Value::to_string));
            for line in lines {
                if writeln!(reader, "{line}").is_err() {
                    break;
                }
            }
        }
    });
    socket
}

fn snapshot(step: u64, mode: &str, q: &[Option<f64>]) -> Value {
    json!({ "version": 1, "kind": "snapshot", "at_us": step * 50_000, "mode": mode, "q": q })
}

/// Returns snapshots of a person who moves one joint after the other, each after a rest, and rests.
fn turned(moves: &[(usize, f64)]) -> Vec<Value> {
    let (mut q, mut step) = (FROM, 0);
    let mut snapshots = Vec::new();
    for (joint, by) in moves {
        for part in 0..40 {
            if part >= 20 {
                q[*joint] += by / 20.0;
            }
            step += 1;
            snapshots.push(snapshot(step, "ready", &q.map(Some)));
        }
    }
    for _ in 0..20 {
        step += 1;
        snapshots.push(snapshot(step, "ready", &q.map(Some)));
    }
    snapshots
}

fn measure(file: &Path, socket: &Path) -> CommandOutput {
    let [file, socket] = [file, socket].map(|path| path.to_str().unwrap());
    frhc(&["measure", "direction", "--config", file, "--socket", socket])
}

const ALL_JOINTS: [(usize, f64); 6] = [(0, 0.1), (1, 0.1), (2, 0.1), (3, 0.1), (4, 0.1), (5, 0.1)];

#[test]
fn joints_that_turn_as_the_file_says_are_kept_and_not_asked_for_again() {
    let file = arm("right");
    let socket = node(&file, &description("azimuth"), turned(&ALL_JOINTS));
    let first = measure(&file, &socket);
    // The played node ends before the pushes.
    assert_eq!(first.code, 4, "{}{}", first.stdout, first.stderr);
    for joint in 1..=6 {
        assert!(first.stdout.contains(&format!("  joint {joint}: right\n")), "{}", first.stdout);
    }
    assert!(
        first.stdout.contains(
            "Move joint 1 (azimuth) alone, by 5°, so that the grip goes towards +y of {0}.\n"
        ),
        "{}",
        first.stdout
    );
    assert!(first.stdout.contains("Push the grip 5 cm towards +x of {0}.\n"), "{}", first.stdout);
    let kept = fs::read_to_string(file.with_extension("measured.toml")).unwrap();
    assert!(
        kept.contains("\"joint 1\"") && kept.contains("\"joint 6\"") && !kept.contains("push"),
        "{kept}"
    );

    // Pushes along y and turns about z are azimuth's; the first one asked for is another.
    let socket = node(&file, &description("azimuth"), turned(&[(0, 0.2)]));
    let second = measure(&file, &socket);
    assert!(second.stdout.starts_with("6 motions are measured already"), "{}", second.stdout);
    assert!(
        second.stdout.contains("  push +x: by the configuration it was +y; once more\n"),
        "{}",
        second.stdout
    );
    let socket = node(&file, &description("azimuth"), turned(&[(0, 0.2), (0, 0.2)]));
    let third = measure(&file, &socket);
    assert_eq!(third.code, 5, "{}", third.stderr);
    let wanted = "push +x: by the configuration it was +y, twice: the base stands otherwise than {0} of the kinematics";
    assert!(third.stderr.contains(wanted), "{}", third.stderr);
}

#[test]
fn wrong_sign_and_swapped_nodes_are_named_with_their_keys() {
    let file = arm("wrong");
    let socket = node(&file, &description("azimuth"), turned(&[(0, -0.1), (0, -0.1)]));
    let reversed = measure(&file, &socket);
    assert_eq!(reversed.code, 5, "{}", reversed.stderr);
    let key = "joint 1: the position fell where it should grow, twice: the sign of gear_ratio (or encoder_counts_per_rev) of \"azimuth\"";
    assert!(reversed.stderr.contains(key), "{}", reversed.stderr);
    assert!(!file.with_extension("measured.toml").exists(), "nothing was right");

    let socket = node(&file, &description("azimuth"), turned(&[(1, 0.1), (1, 0.1)]));
    let swapped = measure(&file, &socket);
    assert_eq!(swapped.code, 5, "{}", swapped.stderr);
    let key = "joint 2 (elevation) moved instead, twice: node_id of \"azimuth\" (1) and \"elevation\" (2) are swapped";
    assert!(swapped.stderr.contains(key), "{}", swapped.stderr);
}

#[test]
fn node_that_may_not_be_judged_is_refused() {
    let file = arm("refused");
    let refused = |description: &Value, snapshots| {
        let ended = measure(&file, &node(&file, description, snapshots));
        (ended.code, ended.stderr)
    };
    let azimuth = description("azimuth");
    let (code, error) = refused(&azimuth, vec![snapshot(0, "armed", &FROM.map(Some))]);
    assert_eq!(code, 1);
    assert!(
        error
            .contains("the node is armed: a hand turns the joints, so run `frhc ctl disarm` first"),
        "{error}"
    );
    let mut unknown = FROM.map(Some);
    unknown[2] = None;
    let (code, error) = refused(&azimuth, vec![snapshot(0, "ready", &unknown)]);
    assert_eq!(code, 1);
    assert!(error.contains("zero unknown: elbow; run `frhc ctl zero` first"), "{error}");
    let (code, error) = refused(&description("shoulder"), Vec::new());
    assert_eq!(code, 3);
    assert!(
        error.contains("the node runs another configuration, with the joints shoulder, elevation"),
        "{error}"
    );
    let nobody = measure(&file, Path::new("/nonexistent/telemetry.sock"));
    assert_eq!(nobody.code, 4);
    assert!(
        nobody.stderr.contains("No node offers /nonexistent/telemetry.sock"),
        "{}",
        nobody.stderr
    );
}
