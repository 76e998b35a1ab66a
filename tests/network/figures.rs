//! Contact over networks: which ways do not end reflection, and that nothing old acts on the others.

use crate::common::linked::{LINK, linked};
use crate::common::rig::Rig;
use crate::ends::{Netem, five, is_engaged, scene, step_wall_clock};

/// Keys of the node for ways up to a maximum age, in ms, and a soft wall.
fn patient(max_age: u32) -> String {
    format!("round_trip_ms = {max_age}.0\nmax_age_ms = {max_age}.0\nstiffest_contact_n_per_m = 20.0")
}

/// Arms, and plays the contact up to a time after the first SYNC, in s; looks at the status every half second.
fn engaged_until(rig: &mut Rig, name: &str, end: f64) {
    rig.scratch.ctl("--wait arm").succeeds();
    rig.until(3.0);
    let mut longest: f64 = 0.0;
    while rig.now() < end {
        let until = rig.now() + 0.5;
        rig.until(until);
        let status = rig.status();
        is_engaged(&status);
        longest = longest.max(status["link"]["round_trip_p99_ms"].as_f64().unwrap());
    }
    println!("{name}: engaged, round trip p99 at most {longest} ms");
}

/// Plays the contact over a network with this maximum age.
fn no_trip(name: &str, network: &str, max_age: u32, end: f64) {
    let _network = Netem::set(network);
    let (mut rig, ends) = five(name, &linked("kraft_like", &patient(max_age)), &scene("20.0"));
    engaged_until(&mut rig, network, end);
    rig.run.terminate().succeeds();
    rig.robot.terminate().succeeds();
    rig.sim.terminate().succeeds();
    ends.terminate();
}

#[test]
fn contact_is_felt_over_a_network() {
    let (mut rig, ends) = five("net-contact", &linked("kraft_like", LINK), &scene("2000.0"));
    let status = rig.pressing();
    println!("round trip p99 {} ms", status["link"]["round_trip_p99_ms"]);
    rig.run.terminate().succeeds();
    rig.robot.terminate().succeeds();
    rig.sim.terminate().succeeds();
    for log in ends.terminate() {
        assert!(!log.contains("rejected=1") && log.contains("connected to frhc-1-"), "{log}");
    }
}

#[test]
fn ways_up_to_8_ms_do_not_end_reflection() {
    for delay in ["0ms", "2ms", "5ms", "8ms"] {
        no_trip(&format!("net-{delay}"), &format!("delay {delay}"), 20, 6.0);
    }
}

#[test]
fn ways_up_to_40_ms_do_not_end_reflection() {
    for delay in ["20ms", "40ms"] {
        no_trip(&format!("net-{delay}"), &format!("delay {delay}"), 100, 6.0);
    }
}

#[test]
fn one_percent_of_loss_at_2_ms_does_not_end_reflection() {
    no_trip("net-loss", "delay 2ms 0.2ms loss 1%", 20, 9.5);
}

#[test]
fn wall_clock_that_is_set_changes_nothing() {
    let (mut rig, ends) = five("net-clock", &linked("kraft_like", LINK), &scene("2000.0"));
    rig.pressing();
    for hours in ["+1", "-1"] {
        step_wall_clock(hours);
        rig.syncs(500);
        is_engaged(&rig.status());
    }
    rig.run.terminate().succeeds();
    ends.terminate();
}
