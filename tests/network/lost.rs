//! Ends that are killed or stopped while the hand presses, and a network that is cut: where docs/safety.md says that it leads.

use nix::sys::signal::Signal;

use crate::common::linked::{LINK, linked};
use crate::common::process::Process;
use crate::common::rig::Rig;
use crate::ends::{Ends, Netem, end, five, scene};

const LOST: &str = "no new wrench from the commanded side";

/// Returns the process of one end.
fn process_of<'a>(ends: &'a mut Ends, role: &str) -> &'a mut Process {
    if role == "near" { &mut ends.near } else { &mut ends.far }
}

/// Resets until the robot follows again.
fn follows_again(rig: &mut Rig) {
    rig.reset();
    rig.syncs(50);
    let status = rig.status();
    assert_eq!(status["mode"], "armed", "{status:#}");
    assert_eq!(status["link"]["far_side"], "following", "{status:#}");
}

/// Stops one end for that long, then kills it, then cuts the network; a reset leads on each time.
fn stopped_killed_and_cut(role: &str, pause: f64) {
    let config = linked("kraft_like", LINK);
    let (mut rig, mut ends) = five(&format!("net-{role}"), &config, &scene("2000.0"));
    rig.pressing();

    let onset = rig.now();
    process_of(&mut ends, role).signal(Signal::SIGSTOP);
    assert_eq!(rig.off_for(onset), LOST, "{role}");
    rig.until(onset + pause);
    process_of(&mut ends, role).signal(Signal::SIGCONT);
    rig.until(onset + pause + 0.2);
    let status = rig.status();
    assert_eq!(status["mode"], "reflection-off", "{status:#}");
    assert_ne!(status["link"]["far_side"], "following", "nothing that waited acts: {status:#}");
    follows_again(&mut rig);

    let onset = rig.now();
    std::mem::replace(process_of(&mut ends, role), Process::start("true", &[])).kill();
    assert_eq!(rig.off_for(onset), LOST, "{role}");
    let refused = rig.scratch.ctl("reset");
    assert!(refused.stderr.contains("the far side does not answer"), "{}", refused.stderr);
    *process_of(&mut ends, role) = end(&rig.scratch, role);
    follows_again(&mut rig);

    let onset = rig.now();
    let cut = Netem::set("loss 100%");
    assert_eq!(rig.off_for(onset), LOST);
    drop(cut);
    follows_again(&mut rig);

    rig.run.terminate().succeeds();
    let log = rig.robot.terminate().stderr;
    assert_eq!(log.matches("holds: no fresh command").count(), 3, "{log}");
    rig.sim.terminate().succeeds();
    ends.terminate();
}

#[test]
fn hazard_34_and_35_stopped_or_killed_near_end_ends_reflection() {
    stopped_killed_and_cut("near", 3.0);
}

#[test]
fn hazard_34_and_35_stopped_or_killed_far_end_ends_reflection() {
    stopped_killed_and_cut("far", 0.5);
}
