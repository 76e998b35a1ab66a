//! `frhc view` as a process: its address, its ends, a port that is taken.
#![allow(clippy::zombie_processes, reason = "the process is killed, and ends with the test")]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Child;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::common::prelude::*;

/// A page, killed at the end of a test.
struct Page {
    process: Child,
    address: String,
}

impl Page {
    fn start(test: &str) -> Self {
        let socket = folder("view", test).join("absent.sock");
        let mut command = Command::new(crate::common::program());
        command.args(["view", "--listen", "127.0.0.1:0", "--socket"]).arg(socket);
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("http://").unwrap().trim_end_matches('/').to_owned();
        Self { process, address }
    }

    /// Returns exit code and stderr after this signal.
    fn end(mut self, signal: Signal) -> (Option<i32>, String) {
        kill(Pid::from_raw(self.process.id().try_into().unwrap()), signal).unwrap();
        let mut text = String::new();
        self.process.stderr.take().unwrap().read_to_string(&mut text).unwrap();
        (self.process.wait().unwrap().code(), text)
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.process.kill().ok();
    }
}

#[test]
fn page_is_served_until_a_signal_without_a_node() {
    for signal in [Signal::SIGINT, Signal::SIGTERM] {
        let page = Page::start("signal");
        let mut stream = TcpStream::connect(&page.address).unwrap();
        write!(stream, "GET / HTTP/1.1\r\nHost: {}\r\n\r\n", page.address).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 200 OK"), "{answer}");
        assert!(answer.ends_with("</html>\n"), "{answer}");
        assert_eq!(page.end(signal), (Some(0), String::new()));
    }
}

#[test]
fn taken_port_is_named_in_one_line() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let ended = frhc(&["view", "--listen", &address]);
    assert_eq!(ended.code, 4, "{}", ended.stderr);
    assert!(ended.stderr.starts_with(&format!("frhc: {address}: Address already in use")));
    assert_eq!(ended.stderr.lines().count(), 1, "{}", ended.stderr);
}

#[test]
fn address_that_others_reach_is_a_warning() {
    let taken = TcpListener::bind("0.0.0.0:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let ended = frhc(&["view", "--listen", &address]);
    assert_eq!(ended.code, 4, "{}", ended.stderr);
    let warning =
        format!("frhc: {address}: everyone who reaches this address may look, without a password");
    assert_eq!(ended.stderr.lines().next(), Some(&*warning));
}
