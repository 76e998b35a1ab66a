//! Both ends of a link over loopback, their keys, and the network between them.

use crate::common::link_program;
use crate::common::prelude::*;
use crate::common::rig::{Rig, simulated};

/// The two processes that carry a link.
pub(crate) struct Ends {
    pub(crate) near: Process,
    pub(crate) far: Process,
}

/// Network between the ends, on the loopback interface, until it is dropped.
pub(crate) struct Netem;

impl Netem {
    /// Sets delay, jitter and losses of the packets, in the syntax of tc-netem(8).
    pub(crate) fn set(network: &str) -> Self {
        let netem = Self;
        netem.change(network);
        netem
    }

    /// Changes the properties of the network.
    pub(crate) fn change(&self, network: &str) {
        let line = format!("tc qdisc replace dev lo root netem {network} limit 100000");
        Process::start("sh", &["-c", &line]).wait().succeeds();
    }
}

impl Drop for Netem {
    fn drop(&mut self) {
        Process::start("tc", &["qdisc", "del", "dev", "lo", "root"]).wait();
    }
}

/// Starts `frhc-link`.
pub(crate) fn frhc_link(args: &[&str]) -> Process {
    Process::start(link_program(), args)
}

/// Creates keys and settings of both ends.
pub(crate) fn prepare(scratch: &Scratch) {
    frhc_link(&["key", "new", &scratch.path("keys")]).wait().succeeds();
    for (role, socket, network) in [
        ("near", "frhc/link.sock", "connect = [\"127.0.0.1\"]"),
        ("far", "far.sock", "listen = [\"127.0.0.1\"]"),
    ] {
        let socket = scratch.path(socket);
        let text = format!("keys = \"keys\"\nsocket = {socket:?}\n{network}\n");
        scratch.write(&format!("{role}.toml"), &text);
    }
}

/// Starts one end.
pub(crate) fn end(scratch: &Scratch, role: &str) -> Process {
    frhc_link(&[role, "--config", &scratch.path(&format!("{role}.toml"))])
}

impl Ends {
    /// Starts both ends.
    pub(crate) fn started(scratch: &Scratch) -> Self {
        prepare(scratch);
        Self { far: end(scratch, "far"), near: end(scratch, "near") }
    }

    /// Stops both ends; returns their logs.
    pub(crate) fn terminate(self) -> [String; 2] {
        [self.near, self.far].map(|end| {
            let outcome = end.terminate();
            outcome.succeeds();
            outcome.stderr
        })
    }
}

/// Starts node, drives and robot with both ends between them; `robot` is the file of the robot's scene.
pub(crate) fn five(name: &str, config: &str, robot: &str) -> (Rig, Ends) {
    let mut ends = None;
    let rig = Rig::started(name, config, |scratch, _| {
        ends = Some(Ends::started(scratch));
        let scene = scratch.write("config/robot.toml", robot);
        simulated(&scene, PUMA)(scratch, &scratch.path("far.sock"))
    });
    (rig, ends.unwrap())
}

/// Returns the text of the robot's file: that of the hand controller, with a wall and a box of this stiffness.
pub(crate) fn scene(stiffness: &str) -> String {
    let text = fs::read_to_string(KRAFT).unwrap();
    text.replace("stiffness_n_per_m = 2000.0", &format!("stiffness_n_per_m = {stiffness}"))
}

/// Asserts that the node is engaged and the robot follows.
pub(crate) fn is_engaged(status: &Value) {
    assert_eq!(status["mode"], "engaged", "{status:#}");
    assert_eq!(status["link"]["far_side"], "following", "{status:#}");
}

/// Sets the wall clock of this kernel forward.
pub(crate) fn step_wall_clock(hours: &str) {
    let line = format!("date --set \"$(date --date='{hours} hours')\" >/dev/null");
    assert!(Command::new("sh").args(["-c", &line]).status().unwrap().success());
}
