//! `frhc demo` with its telemetry and its page: readers change no byte of a session; a socket or address that cannot be used is named.

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::net::UnixStream;
use std::process::Child;
use std::thread;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::common::prelude::*;

/// Number of readers of a demo's telemetry, and of those that read nothing.
const READERS: usize = 20;
const STOPPED: usize = 5;

/// A demo at twice real time whose stderr is read.
fn demo(runtime: &Path, args: &[&str]) -> Child {
    let mut command = Command::new(crate::common::program());
    command.args(["-q", "demo", "--speed", "2", "--seed", "7"]).args(args);
    command.env("XDG_RUNTIME_DIR", runtime).stdout(Stdio::null()).stderr(Stdio::piped());
    command.spawn().unwrap()
}

/// Connects as soon as the node of this demo listens.
fn connected(demo: &mut Child, socket: &Path) -> UnixStream {
    loop {
        assert!(demo.try_wait().unwrap().is_none(), "{}: the demo has ended", socket.display());
        match UnixStream::connect(socket) {
            Ok(stream) => return stream,
            Err(error) if error.kind() == ErrorKind::NotFound => thread::yield_now(),
            Err(error) => panic!("{}: {error}", socket.display()),
        }
    }
}

#[test]
fn readers_change_no_byte_of_a_session() {
    let folder = folder("shown_demo", "bytes");
    let (alone, watched) = (folder.join("alone"), folder.join("watched"));
    let args = |out: &Path| ["--seconds", "4", "--out", out.to_str().unwrap()].map(str::to_owned);
    let run = |out: &Path| demo(&folder, &args(out).each_ref().map(String::as_str));
    let mut child = run(&alone);
    assert!(child.wait().unwrap().success());
    let socket = folder.join("frhc-view/telemetry.sock");
    assert!(!socket.exists(), "the socket ends with its demo");
    let mut child = run(&watched);
    let first = connected(&mut child, &socket);
    let others: Vec<_> = (1..READERS).map(|_| connected(&mut child, &socket)).collect();
    let reading = &others[STOPPED..];
    let drained: Vec<_> = reading
        .iter()
        .map(|reader| reader.try_clone().unwrap())
        .map(|reader| thread::spawn(|| BufReader::new(reader).lines().count()))
        .collect();
    let lines: Vec<_> = BufReader::new(first).lines().map(Result::unwrap).collect();
    assert!(child.wait().unwrap().success());
    let snapshots = lines.iter().filter(|line| line.contains("\"kind\":\"snapshot\"")).count();
    assert!((100..=200).contains(&snapshots), "4 s have 200 snapshots: {snapshots}");
    assert!(lines[0].starts_with("{\"version\":1,\"kind\":\"description\""), "{}", lines[0]);
    for reader in drained {
        assert!(reader.join().unwrap() > 90);
    }
    for name in ["bus.log", "inputs.bin"] {
        let of = |session: &Path| fs::read(session.join(name)).unwrap();
        assert!(of(&alone) == of(&watched), "{name} differs");
    }
}

#[test]
fn page_of_a_demo_is_served_until_ctrl_c() {
    let folder = folder("shown_demo", "page");
    let mut child = demo(&folder, &["--seconds", "600", "--view", "--listen", "127.0.0.1:0"]);
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.starts_with("look at http://") {
        line.clear();
        assert!(stderr.read_line(&mut line).unwrap() > 0, "no address");
    }
    let address = line.trim().trim_start_matches("look at http://").trim_end_matches('/');
    let mut stream = TcpStream::connect(address).unwrap();
    write!(stream, "GET /feed HTTP/1.1\r\nHost: {address}\r\n\r\n").unwrap();
    let mut events = BufReader::new(stream).lines().map(Result::unwrap);
    assert!(events.any(|line| line.contains("\"source\":\"demo\"")));
    assert!(events.any(|line| line.contains("\"kind\":\"snapshot\"")));
    kill(Pid::from_raw(child.id().try_into().unwrap()), Signal::SIGINT).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let mut rest = String::new();
    stderr.read_to_string(&mut rest).unwrap();
    assert!(rest.lines().last().unwrap().starts_with("frhc: interrupted after"), "{rest}");
    assert!(TcpStream::connect(address).is_err(), "the page ends with its demo");
}

#[test]
fn address_or_socket_that_cannot_be_had_is_named() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let folder = folder("shown_demo", "refused");
    let (file, out) = (folder.join("file"), folder.join("out"));
    fs::write(&file, "1,2,3").unwrap();
    let (file, out) = (file.to_str().unwrap(), out.to_str().unwrap());
    let socket = folder.join("telemetry.sock");
    let socket = socket.to_str().unwrap();
    let view = ["demo", "--out", out, "--telemetry", socket, "--view", "--listen", &address];
    for (args, code, reason) in [
        (&view[..], 4, format!("{address}: Address already in use")),
        (&["demo", "--out", out, "--telemetry", file], 4, format!("{file}: not a socket")),
        (&["demo", "--listen", &address], 2, "--view".to_owned()),
        (&["demo", "--speed", "0"], 2, "must be a number from 0.01 to 100".to_owned()),
        (&["demo", "--speed", "nan"], 2, "must be a number from 0.01 to 100".to_owned()),
    ] {
        let ended = frhc(args);
        assert_eq!(ended.code, code, "{args:?}: {}", ended.stderr);
        assert!(ended.stderr.contains(&reason), "{args:?}: {}", ended.stderr);
        assert!(!Path::new(out).exists(), "{args:?}: refused before any results");
    }
}
