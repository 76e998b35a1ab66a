//! Tests of refused settings, files, ports and options: one line with the reason, and the exit code of docs/network.md.
#![allow(
    clippy::indexing_slicing,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

mod common;

use std::fs::{self, Permissions};
use std::net::UdpSocket;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use common::program::Running;

/// Asserts that a command ends with this exit code and one line with these words.
#[track_caller]
fn is_refused(args: &[&str], code: i32, words: &[&str]) {
    let (status, _, log) = Running::start(args).ended();
    assert_eq!(status.code(), Some(code), "{args:?}: {log:#?}");
    let lines: Vec<&String> = log.iter().filter(|line| line.starts_with("frhc-link: ")).collect();
    assert_eq!(lines.len(), 1, "{args:?}: {log:#?}");
    for word in words {
        assert!(lines[0].contains(word), "{word}: {log:#?}");
    }
}

/// A folder with keys and the settings of a near end.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let keys = folder.path().join("keys");
    let (status, ..) = Running::start(&["key", "new", keys.to_str().unwrap()]).ended();
    assert!(status.success());
    write(folder.path(), "");
    folder
}

/// Writes settings with these lines in addition.
fn write(folder: &Path, lines: &str) {
    let socket = folder.join("s");
    let text = format!("keys = \"keys\"\nsocket = {socket:?}\n{lines}");
    fs::write(folder.join("link.toml"), text).unwrap();
}

#[test]
fn settings_and_keys_that_are_wrong_are_refused() {
    let folder = folder();
    let file = folder.path().join("link.toml");
    let config = file.to_str().unwrap();
    let near = ["near", "--config", config];
    is_refused(&["near", "--config", "nowhere.toml"], 3, &["nowhere.toml", "No such file"]);
    write(folder.path(), "port = 1\n");
    is_refused(&near, 3, &[config, ":3: ", "unknown field \"port\""]);
    write(folder.path(), "arm = 2\n");
    is_refused(&near, 3, &["near.pem", "certificate of \"frhc-1-near\"", "\"frhc-2-near\""]);
    write(folder.path(), "connect = [\"host:70000\"]\n");
    is_refused(&near, 3, &[":3: connect: ", "no port"]);
    write(folder.path(), "");
    let keys = folder.path().join("keys");
    fs::set_permissions(keys.join("near.key"), Permissions::from_mode(0o644)).unwrap();
    is_refused(&near, 3, &["near.key", "other users may use it"]);
    fs::rename(keys.join("far.key"), keys.join("near.key")).unwrap();
    is_refused(&near, 3, &["near.key", "not the key of"]);
    is_refused(&["far", "--config", config], 3, &["far.key", "No such file"]);
    is_refused(&["key", "new", keys.to_str().unwrap()], 4, &["never overwritten"]);
    is_refused(&["key", "show", folder.path().to_str().unwrap()], 3, &["authority.pem"]);
}

#[test]
fn sockets_and_ports_that_cannot_be_used_are_refused() {
    let folder = folder();
    let file = folder.path().join("link.toml");
    let config = file.to_str().unwrap();
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    write(folder.path(), &format!("listen = [\"{address}\"]\n"));
    is_refused(&["far", "--config", config], 4, &[&address, "Address already in use"]);
    write(folder.path(), "listen = [\"no.such.host.invalid\"]\n");
    is_refused(&["far", "--config", config], 4, &["no.such.host.invalid"]);
    fs::write(folder.path().join("s"), "1,2,3").unwrap();
    is_refused(&["near", "--config", config], 4, &["not a socket"]);
    is_refused(&["far", "--config", config], 4, &["not a socket"]);
    let open = folder.path().join("open");
    fs::create_dir(&open).unwrap();
    fs::set_permissions(&open, Permissions::from_mode(0o777)).unwrap();
    fs::write(&file, format!("keys = \"keys\"\nsocket = {:?}\n", open.join("s"))).unwrap();
    is_refused(&["far", "--config", config], 4, &["every user may write it"]);
}

#[test]
fn wrong_usage_exits_with_2() {
    for args in [&["middle"][..], &["near"], &["key"], &["key", "new", "k", "--days", "0"]] {
        let (status, _, log) = Running::start(args).ended();
        assert_eq!(status.code(), Some(2), "{args:?}: {log:#?}");
    }
}
