//! Contact over networks: which ways do not end reflection.

use crate::common::linked::{LINK, linked, unyielding};
use crate::common::process::Process;
use crate::common::rig::Rig;
use crate::ends::{Ends, Netem, end, five, is_engaged, prepare, scene, step_wall_clock};

/// Keys of the node for ways up to a maximum age, in ms, and a soft wall.
fn patient(max_age: u32) -> String {
    format!(
        "round_trip_ms = {max_age}.0\nmax_age_ms = {max_age}.0\nstiffest_contact_n_per_m = 20.0"
    )
}

/// Lets the contact go on until a time after the first SYNC, in s; the node must stay engaged.
fn engaged_until(rig: &mut Rig, name: &str, end: f64) {
    let mut longest: f64 = 0.0;
    while rig.now() < end {
        let until = end.min(rig.now() + 0.5);
        rig.until(until);
        let status = rig.status();
        is_engaged(&status);
        longest = longest.max(status["link"]["round_trip_p99_ms"].as_f64().unwrap());
    }
    println!("{name}: engaged until {end} s, round trip p99 at most {longest:.1} ms");
}

/// Plays the contact over one network after the other, each until a time in s. No way is shorter than the one before: packets
/// would overtake each other where it changes.
fn engaged_over(name: &str, max_age: u32, networks: &[(&str, f64)]) {
    let network = Netem::set(networks[0].0);
    let (mut rig, ends) = five(name, &linked("kraft_like", &patient(max_age)), &scene("20.0"));
    rig.scratch.ctl("--wait arm").succeeds();
    rig.until(3.0);
    for (words, end) in networks {
        network.change(words);
        engaged_until(&mut rig, words, *end);
    }
    ended(rig, ends);
}

fn ended(rig: Rig, ends: Ends) {
    rig.run.terminate().succeeds();
    rig.robot.terminate().succeeds();
    rig.sim.terminate().succeeds();
    for log in ends.terminate() {
        assert!(log.contains("connected to frhc-1-") && log.contains(" rejected=0"), "{log}");
    }
}

#[test]
fn ways_up_to_8_ms_do_not_end_reflection() {
    engaged_over(
        "net-20",
        20,
        &[
            ("delay 0ms", 3.5),
            ("delay 2ms", 4.5),
            // Short: a packet that is lost three times over, one in a million, is late by more than 20 ms and ends reflection.
            ("delay 2ms 0.2ms loss 1%", 5.5),
            ("delay 5ms", 6.5),
            ("delay 8ms", 7.5),
        ],
    );
}

#[test]
fn ways_up_to_40_ms_do_not_end_reflection() {
    // stale.rs begins with 20 ms. A way that doubles looks like losses to QUIC, so 40 ms have a session of their own.
    engaged_over("net-40", 100, &[("delay 40ms", 5.0)]);
}

#[test]
fn hazard_37_python_example_beside_a_second_near_end() {
    let mut near = None;
    let mut rig = Rig::started("net-python", &unyielding("kraft_like", LINK), |scratch, _| {
        prepare(scratch);
        let keys = scratch.path("keys");
        let args = ["examples/far_side.py", &keys, "--listen", "127.0.0.1:7447"];
        let wall = ["--wall", "z", "0.37"];
        let far = Process::python(&[&args[..], &wall].concat());
        // The interpreter loads its packages first. A near end that finds no listener tries again a second later.
        Process::start("sleep", &["0.1"]).wait().succeeds();
        near = Some(end(scratch, "near"));
        far
    });
    rig.pressing();
    let second = end(&rig.scratch, "near");
    for hours in ["+1", "-1"] {
        step_wall_clock(hours);
        rig.syncs(300);
        is_engaged(&rig.status());
    }
    let log = second.terminate();
    log.succeeds();
    assert!(log.stderr.contains("the node closed the connection at once"), "{}", log.stderr);
    rig.run.terminate().succeeds();
    rig.robot.terminate().succeeds();
    rig.sim.terminate().succeeds();
    near.unwrap().terminate().succeeds();
}
