//! Ends that are killed, stopped or doubled while the hand presses: where docs/safety.md says that it leads.

use nix::sys::signal::Signal;

use crate::common::linked::{LINK, linked};
use crate::common::process::Process;
use crate::common::rig::Rig;
use crate::ends::{Ends, Netem, end, five, is_engaged, scene};

const LOST: &str = "no new wrench from the commanded side";

/// Starts all five, and has the hand press into the wall.
fn pressing(name: &str) -> (Rig, Ends) {
    let (mut rig, ends) = five(name, &linked("kraft_like", LINK), &scene("2000.0"));
    rig.pressing();
    (rig, ends)
}

/// Returns the process of one end.
fn of<'a>(ends: &'a mut Ends, role: &str) -> &'a mut Process {
    if role == "near" { &mut ends.near } else { &mut ends.far }
}

/// Asserts that the robot held for want of a fresh command, and follows again after a reset.
fn robot_held_and_follows_again(mut rig: Rig, onset: f64) {
    rig.until(onset + 0.8);
    rig.reset();
    rig.syncs(50);
    let status = rig.status();
    assert_eq!(status["mode"], "armed", "{status:#}");
    assert_eq!(status["link"]["far_side"], "following", "{status:#}");
    rig.run.terminate().succeeds();
    let log = rig.robot.terminate().stderr;
    assert!(log.contains("holds: no fresh command"), "{log}");
    rig.sim.terminate().succeeds();
}

#[test]
fn hazard_34_killed_end_of_a_link_ends_reflection() {
    for role in ["near", "far"] {
        let (mut rig, mut ends) = pressing(&format!("net-killed-{role}"));
        let onset = rig.now();
        let killed = std::mem::replace(of(&mut ends, role), Process::of("true", &[]));
        killed.kill();
        assert_eq!(rig.off_for(onset), LOST, "{role}");
        let refused = rig.scratch.ctl("reset");
        assert!(refused.stderr.contains("the far side does not answer"), "{}", refused.stderr);
        *of(&mut ends, role) = end(&rig.scratch, role);
        robot_held_and_follows_again(rig, onset);
        ends.terminate();
    }
}

#[test]
fn hazard_34_and_35_stopped_end_of_a_link_ends_reflection() {
    for role in ["near", "far"] {
        let (mut rig, mut ends) = pressing(&format!("net-stopped-{role}"));
        let onset = rig.now();
        of(&mut ends, role).signal(Signal::SIGSTOP);
        assert_eq!(rig.off_for(onset), LOST, "{role}");
        rig.until(onset + 3.0);
        of(&mut ends, role).signal(Signal::SIGCONT);
        rig.until(onset + 3.2);
        let status = rig.status();
        assert_eq!(status["mode"], "reflection-off", "nothing of the backlog acts: {status:#}");
        robot_held_and_follows_again(rig, onset + 3.0);
        ends.terminate();
    }
}

#[test]
fn hazard_34_network_that_is_cut_ends_reflection() {
    let (mut rig, ends) = pressing("net-cut");
    let onset = rig.now();
    let cut = Netem::set("loss 100%");
    assert_eq!(rig.off_for(onset), LOST);
    drop(cut);
    robot_held_and_follows_again(rig, onset);
    ends.terminate();
}

#[test]
fn hazard_37_second_near_end_is_refused() {
    let (mut rig, ends) = pressing("net-second");
    let second = end(&rig.scratch, "near");
    rig.syncs(1_000);
    is_engaged(&rig.status());
    let log = second.terminate();
    log.succeeds();
    assert!(log.stderr.contains("the node closed the connection at once"), "{}", log.stderr);
    rig.run.terminate().succeeds();
    ends.terminate();
}
