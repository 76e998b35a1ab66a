//! Three processes: `frhc sim` has the drives and the hand, `frhc run` the node, and `frhc robot` or the Python example the
//! robot that the node commands over its socket.

use nix::sys::signal::Signal;

use crate::common::linked::{LINK, linked, unyielding};
use crate::common::prelude::*;
use crate::common::rig::{Rig, simulated};

#[test]
fn contact_is_felt_through_three_processes() {
    for (name, hand, arm) in [
        ("far-kraft", "kraft_like", PUMA),
        ("far-jpl", "jpl_like", "config/robots/eight_r_synthetic.toml"),
    ] {
        let file = format!("config/{hand}.toml");
        let mut rig = Rig::started(name, &linked(hand, LINK), simulated(&file, arm));
        rig.pressing();
        rig.run.terminate().succeeds();
        rig.robot.terminate().succeeds();
        rig.sim.terminate().succeeds();
    }
}

#[test]
fn python_example_takes_the_place_of_the_robot() {
    let config = unyielding("kraft_like", LINK);
    let mut rig = Rig::started("far-python", &config, |_, socket| {
        let wall = ["--wall", "z", "0.37"];
        Process::python(&[&["examples/far_side_local.py", socket][..], &wall].concat())
    });
    rig.pressing();
    opens_sockets_of_can_netlink_and_unix_alone(&rig.run);
    rig.run.terminate().succeeds();
    rig.robot.terminate().succeeds();
    rig.sim.terminate().succeeds();
}

/// Asserts that a process has no socket of another address family, as the unit of the service demands.
fn opens_sockets_of_can_netlink_and_unix_alone(run: &Process) {
    let inodes = run.sockets();
    assert!(inodes.len() >= 4, "{inodes:?}");
    for table in ["tcp", "tcp6", "udp", "udp6", "raw", "raw6", "packet"] {
        let path = format!("/proc/net/{table}");
        let text = fs::read_to_string(&path).unwrap_or_default();
        let is_open = |inode: &String| {
            text.lines().any(|line| line.split_whitespace().any(|word| word == inode))
        };
        assert!(!inodes.iter().any(is_open), "{path}: {inodes:?}");
    }
}

#[test]
fn hazard_34_killed_robot_ends_reflection_until_a_reset() {
    let config = linked("kraft_like", LINK);
    let mut rig = Rig::started("far-killed", &config, simulated(KRAFT, PUMA));
    rig.pressing();
    let onset = rig.now();
    rig.robot.signal(Signal::SIGSTOP);
    assert_eq!(rig.off_for(onset), "no new wrench from the commanded side");
    let refused = rig.scratch.ctl("reset");
    assert!(refused.stderr.contains("the far side does not answer"), "{}", refused.stderr);
    rig.robot.signal(Signal::SIGCONT);
    rig.reset();
    assert_eq!(rig.status()["mode"], "armed");
    assert_eq!(rig.status()["link"]["far_side"], "following");
    let onset = rig.now();
    let killed = std::mem::replace(
        &mut rig.robot,
        simulated(KRAFT, PUMA)(&rig.scratch, &rig.scratch.path("frhc/link.sock")),
    );
    killed.kill();
    assert_eq!(rig.off_for(onset), "no new wrench from the commanded side");
    rig.until(onset + 0.6);
    rig.reset();
    assert_eq!(rig.status()["link"]["far_side"], "following", "the one that was started since");
    rig.run.terminate().succeeds();
    rig.robot.terminate().succeeds();
    rig.sim.terminate().succeeds();
}

#[test]
fn hazard_47_end_of_the_robot_is_named() {
    let config = linked("kraft_like", LINK);
    let mut rig = Rig::started("far-ended", &config, simulated(KRAFT, PUMA));
    rig.pressing();
    let onset = rig.now();
    rig.robot.terminate().succeeds();
    rig.robot = Process::start("true", &[]);
    assert_eq!(rig.off_for(onset), "the far side holds: far side ends");
    assert_eq!(rig.run.terminate().code, Some(6));
    rig.sim.terminate().succeeds();
}
