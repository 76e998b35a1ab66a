//! Network with more losses and delay than the link tolerates: reflection may end, but no old sample acts.

use std::io::Read;
use std::thread;
use std::time::{SystemTime, UNIX_EPOCH};

use contract::{Capability, FarEnd, Measurements, Pose};
use nix::libc::MSG_DONTWAIT;
use socket2::{Domain, SockAddr, Socket, Type};

use crate::common::linked::linked;
use crate::common::prelude::*;
use crate::common::rig::Rig;
use crate::ends::{Ends, Netem};
use bus::clock::monotonic;

/// Maximum age of a sample, in ms.
const MAX_AGE: f64 = 100.0;

fn wall_clock() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64()
}

/// The robot, in a thread of this test: it answers each command, and its force along x is the time of its reading, in s since
/// `base` on the wall clock.
fn answers(socket: &Socket, figures: &Capability, base: f64) {
    let mut far = FarEnd::new(1, 0xface, Duration::from_millis(100));
    let mut buffer = [0; 512];
    let send = |message: &[u8]| drop(socket.send_with_flags(message, MSG_DONTWAIT));
    while let Ok(length @ 1..) = (&mut &*socket).read(&mut buffer) {
        let now = Instant::ZERO + monotonic();
        far.on_message(now, &buffer[..length]);
        far.motion(now);
        let pose = Pose { position: [0.4, 0.0, 0.3], orientation: [0.0, 0.0, 0.0, 1.0] };
        let wrench = Some([wall_clock() - base, 0.0, 0.0, 0.0, 0.0, 0.0]);
        send(&far.feedback(now, &Measurements { wrench, pose: Some(pose), gripper: None }));
        if let Some(capability) = far.capability(now, figures) {
            send(&capability);
        }
    }
}

/// Returns the ages, in s, of the samples that acted in the cycles engaged, by the recording of the node (docs/candump.md).
fn ages(rig: &Rig, base: f64) -> Vec<f64> {
    let session = fs::read_dir(rig.scratch.path("session")).unwrap().next().unwrap().unwrap();
    let log = fs::read_to_string(session.path().join("bus.log")).unwrap();
    let mut newest = None;
    let mut ages = Vec::new();
    for line in log.lines() {
        let (stamp, rest) = line.strip_prefix('(').and_then(|line| line.split_once(") ")).unwrap();
        if let Some(wrench) = rest.strip_prefix("wrench0 18FF0000##0") {
            let force = u64::from_str_radix(&wrench[..16], 16).unwrap().swap_bytes();
            newest = Some((stamp.parse::<f64>().unwrap() - base, f64::from_bits(force)));
        } else if rest.starts_with("node0 18FF0001##003") {
            // Without a sample that may act the wrench is zero.
            ages.extend(newest.filter(|(_, force)| *force > 0.0).map(|(at, force)| at - force));
        }
    }
    ages
}

#[test]
fn hazard_36_nothing_old_acts_over_a_network_that_is_too_bad() {
    let keys = format!(
        "round_trip_ms = {MAX_AGE:.1}\nmax_age_ms = {MAX_AGE:.1}\nstiffest_contact_n_per_m = 20.0"
    );
    let text = linked("kraft_like", &keys);
    let config = Config::parse("config/kraft_like.toml".as_ref(), &text).unwrap();
    let stated = config.far_side.agreement.unwrap().stated;
    let mut figures = stated.capability([[-1.0; 3], [1.0; 3]]);
    (figures.sample_period, figures.hold_after, figures.sensor_range) = (1e-3, 0.1, [200.0, 20.0]);
    let network = Netem::set("delay 20ms");
    let (mut ends, base) = (None, wall_clock());
    let mut rig = Rig::started("net-stale", &text, |scratch, _| {
        ends = Some(Ends::started(scratch));
        let path = scratch.path("far.sock");
        while !fs::exists(&path).unwrap() {
            Process::start("sleep", &["0.01"]).wait();
        }
        let socket = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
        socket.connect(&SockAddr::unix(path).unwrap()).unwrap();
        thread::spawn(move || answers(&socket, &figures, base));
        Process::start("true", &[])
    });
    rig.scratch.ctl("--wait arm").succeeds();
    rig.until(3.5);
    let status = rig.status();
    assert_eq!(status["mode"], "engaged", "{status:#}");
    println!("delay 20ms: engaged, round trip p99 {} ms", status["link"]["round_trip_p99_ms"]);
    network.change("delay 40ms 4ms loss 5%");
    rig.until(6.0);
    println!("{}: {}", rig.status()["mode"], rig.status()["stopped_by"]);
    rig.run.signal(nix::sys::signal::Signal::SIGTERM);
    ends.unwrap().terminate();
    let acted = ages(&rig, base);
    let oldest = acted.iter().copied().fold(0.0, f64::max);
    println!("{} samples acted, the oldest after {:.1} ms", acted.len(), oldest * 1e3);
    assert!(acted.len() > 500, "{}", acted.len());
    assert!(oldest * 1e3 <= MAX_AGE + 2.0, "{oldest} s");
    assert!(oldest * 1e3 > 39.0, "the network was good: {oldest} s");
}
