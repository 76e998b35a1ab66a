//! Failures of drives, and the targets that follow. Times are those of the bus.

use crate::common::bench::{booted, until_contact};
use crate::common::prelude::*;

/// Returns the cycles from `onset` until every target is zero for good.
fn cycles_to_zero(wire: &Wire, onset: Instant) -> usize {
    let cycles_of = |group: u16| {
        let frames = wire.since(onset, group);
        assert!(frames.len() > 20, "{group:03X}h is not sent");
        frames.iter().rposition(|(_, frame)| frame.data() != [0; 6]).map_or(0, |last| last + 1)
    };
    [0x201, 0x204].map(cycles_of).into_iter().max().unwrap()
}

fn in_contact() -> (Bench<Wire>, Wire, Instant) {
    let (mut bench, wire) = booted(KRAFT, "contact_10s");
    let record = until_contact(&mut bench);
    wire.clear();
    (bench, wire, record.at)
}

#[test]
fn hazard_08_drive_fault_zeroes_all_torques_within_two_cycles() {
    for joint in 1..=6 {
        let (mut bench, wire, onset) = in_contact();
        bench.world_mut().drive_mut(Joint::new(joint).unwrap()).unwrap().fail_with(0x3210);
        until(&mut bench, |record| record.mode.is_stopped());
        bench.run(150);
        assert!(cycles_to_zero(&wire, onset) <= 2);
    }
}

#[test]
fn hazard_08_statusword_alone_stops_all_within_12_cycles() {
    for joint in Joint::ALL {
        let (mut bench, wire, onset) = in_contact();
        bench.world_mut().drive_mut(joint).unwrap().fail();
        let record = until(&mut bench, |record| record.mode.is_stopped());
        assert!(matches!(record.cause, Some(Cause::DriveLeft { joint: j, .. }) if j == joint));
        bench.run(150);
        // Their inhibit time is 10 ms (1801h:3), or six at once would delay the next SYNC.
        assert!(cycles_to_zero(&wire, onset) <= 12);
    }
}

#[test]
fn stop_is_cleared_only_by_reset_and_a_new_press() {
    let (mut bench, _, _) = in_contact();
    bench.world_mut().drive_mut(Joint::of::<2>()).unwrap().fail();
    until(&mut bench, |record| record.mode.is_stopped());
    assert!(bench.ask(Request::Arm).is_err());
    bench.ask(Request::Reset).unwrap();
    until(&mut bench, |record| record.mode == Mode::Ready);
    let refusal = bench.ask(Request::Arm).unwrap_err();
    assert_eq!(refusal.to_string(), "the deadman is closed: release it first");
}

#[test]
fn silent_node_lets_the_drives_stop_by_their_timers() {
    let (mut bench, wire, _) = in_contact();
    let fell_silent = bench.fall_silent_for(Duration::from_millis(6));
    let drives = bench.node().bus().stations().drives();
    assert!(drives.iter().all(|drive| drive.demand() == 0.0));
    // The current decays with the time constant of its loop, 0.2 ms.
    bench.fall_silent_for(Duration::from_millis(2));
    let left = bench.node().bus().stations().torques().amax();
    assert!(left < 1e-3, "{left} N·m");
    bench.fall_silent_for(Duration::from_millis(92));
    for node in 1..=6 {
        let emergencies = wire.since(fell_silent - Duration::from_millis(2), 0x680 + node);
        let (at, frame) = emergencies.first().unwrap();
        assert_eq!(frame.data()[..5], [0x50, 0x82, 0x11, 0, 0], "8250h, torque zero");
        // Six emergencies at once wait for each other.
        assert!(at.since(fell_silent) <= Duration::from_millis(7), "{:?}", at.since(fell_silent));
    }
    assert!(bench.node().bus().stations().torques().amax() < 1e-12);
}
