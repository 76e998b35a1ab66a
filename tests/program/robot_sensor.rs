//! `frhc robot` with a network sensor: a socket of this test sends its records.

use std::io::BufRead;
use std::net::{SocketAddr, UdpSocket};

use nix::sys::signal::Signal;

use crate::common::prelude::*;
use bus::clock;
use net_ft::rdt::{Record, Request};

/// Maximum time of a wait in a test, on a busy machine.
const LIMIT: Duration = Duration::from_secs(60);

/// Returns a configuration with this section of a sensor.
fn with_sensor(scratch: &Scratch, section: &str) -> String {
    let section = format!("[remote.link.sensor]\n{section}\n\n[safety]");
    scratch.variant(KRAFT, &[("mass_kg = 0.8 ", "mass_kg = 0.0 "), ("[safety]", &section)])
}

/// A sensor of the test.
struct Sensor {
    socket: UdpSocket,
    sequence: u32,
}

impl Sensor {
    fn new() -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_read_timeout(Some(LIMIT)).unwrap();
        Self { socket, sequence: 0 }
    }

    fn section(&self) -> String {
        let address = self.socket.local_addr().unwrap();
        format!("address = \"{address}\"\ncounts_per_n = 1e6\ncounts_per_nm = 1e6")
    }

    /// Waits for the next request.
    fn request(&self) -> ([u8; Request::LENGTH], SocketAddr) {
        let mut bytes = [0; Request::LENGTH];
        let (length, source) = self.socket.recv_from(&mut bytes).unwrap();
        assert_eq!(length, bytes.len());
        (bytes, source)
    }

    /// Sends two records of 3 N along x.
    fn send(&mut self, to: SocketAddr) {
        for _ in 0..2 {
            self.sequence += 1;
            let (rdt_sequence, counts) = (self.sequence, [3_000_000, 0, 0, 0, 0, 0]);
            let record = Record { rdt_sequence, ft_sequence: rdt_sequence, status: 0, counts };
            self.socket.send_to(&record.encode(), to).unwrap();
        }
    }
}

#[test]
fn robot_process_reads_its_sensor_and_stops_it_at_the_end() {
    let scratch = Scratch::new("robot-sensor");
    let mut sensor = Sensor::new();
    let config = with_sensor(&scratch, &sensor.section());
    let socket = scratch.path("far.sock");
    let args = ["robot", "--config", &config, "--robot", PUMA, "--socket", &socket, "--json"];
    let (robot, mut stdout) = scratch.frhc_and_stdout(&args);
    let (request, reader) = sensor.request();
    assert_eq!(request, Request::Stream.encode());
    let begun = clock::monotonic();
    let status = loop {
        assert!(clock::monotonic() < begun + LIMIT);
        sensor.send(reader);
        robot.signal(Signal::SIGUSR1);
        let mut line = String::new();
        stdout.read_line(&mut line).unwrap();
        let status: Value = serde_json::from_str(&line).unwrap();
        if !status["wrench"].is_null() {
            break status;
        }
    };
    assert_eq!(status["wrench"]["force_n"][0], 3.0, "{status}");
    assert_eq!(status["sensor"]["condition"], "valid", "{status}");
    assert_eq!(status["sensor"]["lost"], 0, "{status}");
    robot.terminate().succeeds();
    let is_stop = |request| request == Request::Stop.encode();
    let last = std::iter::repeat_with(|| sensor.request().0).find(|request| is_stop(*request));
    assert!(last.is_some());
}

#[test]
fn robot_process_names_a_sensor_that_is_silent() {
    let scratch = Scratch::new("robot-no-sensor");
    let sensor = Sensor::new();
    let config = with_sensor(&scratch, &sensor.section());
    let socket = scratch.path("far.sock");
    let args = ["robot", "--config", &config, "--robot", PUMA, "--socket", &socket];
    let robot = scratch.frhc(&args);
    // It is requested again, and named with the second request.
    for _ in 0..3 {
        assert_eq!(sensor.request().0, Request::Stream.encode());
    }
    let outcome = robot.terminate();
    outcome.succeeds();
    let address = sensor.socket.local_addr().unwrap();
    let line = format!("{address}: no new record of the force/torque sensor");
    assert_eq!(outcome.stderr.matches(&line).count(), 1, "{}", outcome.stderr);
}

#[test]
fn bias_without_a_sensor_is_refused() {
    let ended = frhc(&["robot", "--config", KRAFT, "--robot", PUMA, "--bias"]);
    assert_eq!(ended.code, 3, "{}", ended.stderr);
    assert!(
        ended.stderr.contains("config/kraft_like.toml: remote.link.sensor: absent"),
        "{}",
        ended.stderr
    );
}
