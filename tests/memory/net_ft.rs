//! A Net F/T sensor as that of `frhc robot`: its records in virtual time, its reader, the robot, and the node's end of the contract.

use std::net::SocketAddr;

use contract::{Feedback, Motion, NodeEnd, Order, Reason};

use crate::common::linked::{LINK, linked};
use crate::common::prelude::*;
use config::NetFtSensor;
use config::robots::RobotArm;
use net_ft::rdt::{Record, Request};
use net_ft::reader::Reader;
use net_ft::scale::Scale;
use sim::random::SplitMix;
use testbench::far_robot::{FarRobot, RobotLimits};

/// Records per second, and counts per unit.
const RATE: u64 = 7_000;
const COUNTS: f64 = 1e6;
const SECTION: &str = "address = \"192.168.1.1\"\ncounts_per_n = 1e6\ncounts_per_nm = 1e6";

/// Returns a robot's file with this section of a sensor.
fn text(section: &str) -> String {
    let text = fs::read_to_string(KRAFT).unwrap();
    let text = text.replacen("mass_kg = 0.8 ", "mass_kg = 0.0 ", 1);
    text.replacen("[safety]", &format!("[remote.link.sensor]\n{section}\n\n[safety]"), 1)
}

/// Network between the sensor and its reader: returns the datagrams that arrive for a record, with their sources.
type Network = fn(&mut SplitMix, Record, SocketAddr) -> Vec<(Record, SocketAddr)>;

/// A network, or a sensor, without faults.
const WELL: Network = |_, record, source| vec![(record, source)];

/// Sensor, reader, robot, and the node's end.
struct Rig {
    node: NodeEnd,
    far: FarRobot,
    reader: Reader,
    sensor: SocketAddr,
    network: Network,
    random: SplitMix,
    cycle: u32,
    is_streaming: bool,
    /// Records since the request, and newest one sent.
    sent: u32,
    /// Samples inside the sensor.
    samples: u64,
}

impl Rig {
    fn new() -> Self {
        let config = parse(KRAFT, &text(SECTION));
        let NetFtSensor { address, counts_per_n, counts_per_nm } = config.far_side.sensor.unwrap();
        let scale = Scale::new(counts_per_n, counts_per_nm).unwrap();
        let config = config.with_robot(RobotArm::load(Path::new(PUMA)).unwrap());
        Self {
            node: NodeEnd::new(1, 11),
            far: FarRobot::new(&config, RobotLimits::default(), 1, 22, 1).unwrap(),
            reader: Reader::new(address, scale, MS * 3, Instant::ZERO),
            sensor: address,
            network: WELL,
            random: SplitMix::new(5),
            cycle: 0,
            is_streaming: false,
            sent: 0,
            samples: 0,
        }
    }

    /// Returns a rig whose robot follows.
    fn following() -> Self {
        let mut rig = Self::new();
        rig.run(20);
        rig.node.begin_epoch();
        rig.run(20);
        assert_eq!(rig.far.reason(), Reason::None);
        rig
    }

    /// Sends the records of the last millisecond.
    fn sense(&mut self, now: Instant) {
        let due = u64::from(self.cycle) * RATE / 1_000;
        while self.samples < due {
            self.samples += 1;
            if !self.is_streaming {
                continue;
            }
            self.sent += 1;
            let count = i32::try_from(self.sent).unwrap();
            let record = Record {
                rdt_sequence: self.sent,
                ft_sequence: u32::try_from(self.samples).unwrap(),
                status: 0,
                counts: [count, 0, 0, 0, 0, -count],
            };
            for (record, source) in (self.network)(&mut self.random, record, self.sensor) {
                self.reader.on_datagram(now, source, &record.encode());
            }
        }
    }

    /// Performs a cycle of 1 ms; returns the feedback that the node takes.
    fn exchange(&mut self) -> Option<Feedback> {
        self.cycle += 1;
        let now = Instant::ZERO + MS * self.cycle;
        let motion = Motion::Rate([0.0, 0.0, -0.01, 0.0, 0.0, 0.0]);
        let command = self.node.command(now, &Order { motion, is_engaged: true, gripper: None });
        self.far.on_message(now, &command);
        self.sense(now);
        self.reader.on_empty(now);
        for request in self.reader.requests(now) {
            assert_eq!(request, Request::Stream);
            (self.is_streaming, self.sent) = (true, 0);
        }
        let reading = self.reader.reading();
        let outgoing = self.far.step_with_reading(now, reading.number, reading.wrench);
        self.node.on_message(now, &outgoing.feedback).map(|sample| sample.feedback)
    }

    fn run(&mut self, cycles: u32) -> Vec<Feedback> {
        (0..cycles).filter_map(|_| self.exchange()).collect()
    }
}

#[test]
fn wrench_of_a_sensor_at_7_khz_is_its_newest_record() {
    let mut rig = Rig::following();
    for _ in 0..20_000 {
        let [fx, .., mz] = rig.exchange().unwrap().measured.wrench.unwrap();
        assert_eq!(
            [fx, mz].map(|part| (part * COUNTS).round()),
            [1.0, -1.0].map(|sign| sign * f64::from(rig.sent))
        );
    }
    let counts = rig.reader.counts();
    assert_eq!((counts.lost, counts.waited, counts.requests), (0, 0, 1));
    assert_eq!(counts.records, u64::from(rig.sent));
}

/// Faults of a sensor or its network, and the reasons to hold that they are.
const FAULTS: [(&str, Network, Reason); 7] = [
    (
        "status",
        |_, record, source| vec![(Record { status: 1 << 31, ..record }, source)],
        Reason::SensorInvalid,
    ),
    ("silence", |_, _, _| vec![], Reason::SensorSilent),
    (
        "another port",
        |_, record, source| vec![(record, SocketAddr::new(source.ip(), 1))],
        Reason::SensorSilent,
    ),
    (
        "repeated",
        |_, record, source| vec![(Record { rdt_sequence: 5, ..record }, source)],
        Reason::SensorSilent,
    ),
    (
        "frozen",
        |_, record, source| vec![(Record { ft_sequence: 5, ..record }, source)],
        Reason::SensorSilent,
    ),
    (
        "every second lost",
        |_, record, source| {
            if record.rdt_sequence % 2 == 0 { vec![(record, source)] } else { vec![] }
        },
        Reason::SensorSilent,
    ),
    (
        "beyond its range",
        |_, record, source| {
            vec![(Record { counts: [0, 0, 0, -20_000_000, 0, 0], ..record }, source)]
        },
        Reason::SensorSaturated,
    ),
];

#[test]
fn hazard_47_faults_of_a_real_sensor_hold_until_a_new_epoch() {
    for (name, fault, reason) in FAULTS {
        let mut rig = Rig::following();
        rig.network = fault;
        let faulty = rig.run(6);
        let last = faulty.last().unwrap();
        assert_eq!((last.reason, last.measured.wrench), (reason, None), "{name}");
        rig.run(50);
        rig.node.begin_epoch();
        rig.run(5);
        assert_eq!(rig.far.reason(), reason, "{name}: it lasts");
        rig.network = WELL;
        let well = rig.run(300);
        assert_eq!(rig.far.reason(), reason, "{name}: the sensor is well again");
        assert!(well.last().unwrap().measured.wrench.is_some(), "{name}");
        rig.node.begin_epoch();
        rig.run(5);
        assert_eq!(rig.far.reason(), Reason::None, "{name}");
    }
}

#[test]
fn network_that_loses_repeats_and_swaps_holds_no_robot() {
    let mut rig = Rig::following();
    rig.network = |random, record, source| match random.unit() {
        share if share < 0.02 => vec![],
        share if share < 0.05 => vec![(record, source), (record, source)],
        _ => vec![(record, source)],
    };
    let mut oldest = 0.0_f64;
    let mut missing = 0;
    for _ in 0..20_000 {
        let feedback = rig.exchange().unwrap();
        assert_eq!(feedback.reason, Reason::None);
        match feedback.measured.wrench {
            Some(wrench) => oldest = oldest.max(f64::from(rig.sent) - (wrench[0] * COUNTS).round()),
            None => missing += 1,
        }
    }
    let counts = rig.reader.counts();
    assert!((2_000..3_600).contains(&counts.lost), "{counts:?}");
    assert!((3_500..5_000).contains(&counts.overtaken), "{counts:?}");
    assert!(oldest <= 7.0 && missing < 5, "{oldest} records old, {missing} missing");
}

#[test]
fn robot_without_its_sensor_holds_as_silent() {
    let mut rig = Rig::new();
    rig.network = |_, _, _| vec![];
    let feedbacks = rig.run(500);
    assert!(feedbacks.iter().all(|feedback| feedback.measured.wrench.is_none()));
    assert!(feedbacks.iter().skip(5).all(|feedback| feedback.reason == Reason::SensorSilent));
    rig.node.begin_epoch();
    rig.run(5);
    assert_eq!(rig.far.reason(), Reason::SensorSilent);
    rig.network = WELL;
    rig.run(150);
    rig.node.begin_epoch();
    rig.run(5);
    assert_eq!(rig.far.reason(), Reason::None);
}

#[test]
fn addresses_with_and_without_a_port_are_accepted() {
    for (address, expected) in [
        ("192.168.1.1", "192.168.1.1:49152"),
        ("192.168.1.1:5000", "192.168.1.1:5000"),
        ("fe80::1", "[fe80::1]:49152"),
        ("[fe80::1]:5000", "[fe80::1]:5000"),
    ] {
        let config = parse(KRAFT, &text(&SECTION.replace("192.168.1.1", address)));
        assert_eq!(config.far_side.sensor.unwrap().address.to_string(), expected);
    }
}

#[test]
fn sensors_that_cannot_be_read_are_refused_by_their_key() {
    let refused = |text: &str, reason: &str| {
        let refused = refusal(KRAFT, text);
        assert!(refused.contains(reason), "{reason}: {refused}");
        assert_eq!(refused.lines().count(), 1, "{refused}");
    };
    for value in ["0.0", "-1e6", "nan", "inf", "1e10"] {
        for key in ["counts_per_n", "counts_per_nm"] {
            let section = SECTION.replace(&format!("{key} = 1e6"), &format!("{key} = {value}"));
            let key = format!("remote.link.sensor.{key}: must be within 0.001..=1000000000, got");
            refused(&text(&section), &key);
        }
    }
    for address in [
        "netft.local",
        "192.168.1",
        "0.0.0.0",
        "224.0.0.1",
        "255.255.255.255",
        "::",
        "192.168.1.1:0",
        "192.168.1.1:70000",
    ] {
        let section = SECTION.replace("192.168.1.1", address);
        refused(
            &text(&section),
            "remote.link.sensor.address: must be the IP address of one sensor",
        );
    }
    for (rate, reason) in [
        ("9.0", "rate_hz: must be within 10..=8000, got 9"),
        ("nan", "rate_hz: must be within"),
        ("999.0", "rate_hz: must be 1 to 128 records in each cycle of 1 ms, got 999 per second"),
    ] {
        refused(&text(&format!("{SECTION}\nrate_hz = {rate}")), reason);
    }
    refused(&text(&format!("{SECTION}\nbias = true")), "remote.link.sensor.bias: unknown key");
    refused(&text("counts_per_n = 1e6\ncounts_per_nm = 1e6"), "missing field `address`");
    let payload = text(SECTION).replacen("mass_kg = 0.0 ", "mass_kg = 0.8 ", 1);
    refused(&payload, "remote.mass_kg: must be 0 with [remote.link.sensor], got 0.8");
    let node = linked("kraft_like", &format!("{LINK}\n[remote.link.sensor]\n{SECTION}"));
    let node = node.replacen("mass_kg = 0.8 ", "mass_kg = 0.0 ", 1);
    refused(&node, "remote.link.sensor: is the robot's sensor, and this file is the node's");
}

#[test]
fn rate_of_the_sensor_is_judged_by_the_cycle() {
    for (period_us, rate, is_accepted) in
        [(1_000, 1_000, true), (1_000, 8_000, true), (2_000, 500, true), (2_000, 499, false)]
    {
        let text = text(&format!("{SECTION}\nrate_hz = {rate}.0"));
        let before = "sync_period_us = 1000";
        assert!(text.contains(before));
        let text = text.replacen(before, &format!("sync_period_us = {period_us}"), 1);
        let refused = Config::parse(Path::new(KRAFT), &text);
        let is_named = refused.is_err_and(|refused| refused.to_string().contains("sensor.rate_hz"));
        assert_eq!(is_named, !is_accepted, "{period_us} µs, {rate} Hz");
    }
}
