//! Three processes: `frhc sim` has the drives and the hand, `frhc run` the node, and `frhc robot` or the Python example the
//! robot that the node commands over its socket.

use std::io::BufRead;

use nix::sys::signal::Signal;
use serde_json::Value;

use canopen_tools::candump::Line;

use crate::common::linked::{LINK, linked};
use crate::common::process::{Candump, Process, Scratch};

pub(crate) const KRAFT: &str = "config/kraft_like.toml";
pub(crate) const PUMA: &str = "config/robots/puma560.toml";

/// A node with its drives, its robot and what passes on its bus.
pub(crate) struct Rig {
    pub(crate) scratch: Scratch,
    candump: Candump,
    pub(crate) sim: Process,
    pub(crate) run: Process,
    pub(crate) robot: Process,
    first_sync: u64,
}

impl Rig {
    /// Starts all three; `robot` gets the path of the link's socket. Plays contact_10s.
    pub(crate) fn started(
        name: &str,
        config: &str,
        robot: impl FnOnce(&Scratch, &str) -> Process,
    ) -> Self {
        let scratch = Scratch::new(name);
        let config = scratch.write("config/linked.toml", config);
        let mut candump = Candump::of("vcan0");
        let sim = scratch.frhc(&["sim", "--config", &config, "--scenario", "contact_10s"]);
        let robot = robot(&scratch, &scratch.path("frhc/link.sock"));
        let recording = scratch.path("session");
        let run = scratch.frhc(&["run", "--config", &config, "--record", &recording]);
        let first_sync = candump.until(is_sync).nanos;
        let mut rig = Self { scratch, candump, sim, run, robot, first_sync };
        rig.until(0.6);
        rig
    }

    /// Lets the bus run until that time after the first SYNC, in s.
    pub(crate) fn until(&mut self, seconds: f64) {
        let end = self.first_sync + crate::seconds(seconds);
        self.candump.until(|line| line.nanos > end);
    }

    /// Lets the bus run for a number of SYNCs, whatever its time stamps.
    pub(crate) fn syncs(&mut self, count: usize) {
        (0..count).for_each(|_| _ = self.candump.until(is_sync));
    }

    pub(crate) fn status(&self) -> Value {
        let (process, mut stdout) = self.scratch.frhc_and_stdout(&["ctl", "status", "--json"]);
        let mut line = String::new();
        stdout.read_line(&mut line).unwrap();
        process.wait().succeeds();
        let answer: Value = serde_json::from_str(&line).unwrap();
        answer["status"].clone()
    }

    /// Returns the status once the hand presses into the wall of the robot's scene.
    pub(crate) fn pressing(&mut self) -> Value {
        self.scratch.ctl("--wait arm").succeeds();
        // The object meets the wall a second after the hand has moved, at 3.5 s.
        self.until(5.0);
        let status = self.status();
        assert_eq!(status["mode"], "engaged", "{status:#}");
        let force: f64 = status["f_g_task"].as_array().unwrap()[..3]
            .iter()
            .map(|part| part.as_f64().unwrap().powi(2))
            .sum::<f64>()
            .sqrt();
        assert!(force > 0.3, "{force} N: {status:#}");
        let link = &status["link"];
        assert_eq!(
            (&link["leader"], &link["far_side"]),
            (&"this node".into(), &"following".into())
        );
        assert_eq!((&link["connected"], &link["rejects"]), (&true.into(), &serde_json::json!({})));
        assert!(link["round_trip_p99_ms"].as_f64().unwrap() < 5.0, "{link:#}");
        status
    }

    /// Asserts that reflection is off 70 ms after `onset`, in s after the first SYNC; returns the cause.
    pub(crate) fn off_for(&mut self, onset: f64) -> String {
        self.until(onset + 0.17);
        let status = self.status();
        assert_eq!(status["mode"], "reflection-off", "{status:#}");
        let task = status["budget"]["task"].as_array().unwrap();
        assert!(task.iter().all(|torque| torque.as_f64().unwrap().abs() < 1e-9), "{status:#}");
        status["stopped_by"].as_str().unwrap().to_owned()
    }

    /// Returns the time on the bus after the first SYNC, in s.
    pub(crate) fn now(&mut self) -> f64 {
        let stamp = self.candump.mark().nanos;
        std::time::Duration::from_nanos(stamp - self.first_sync).as_secs_f64()
    }

    pub(crate) fn reset(&mut self) {
        let deadline = self.now() + 2.0;
        while self.scratch.ctl("reset").code != Some(0) {
            assert!(self.now() < deadline, "{:#}", self.status());
        }
        // The far side reports the new epoch a round trip later.
        self.syncs(10);
    }
}

fn is_sync(line: &Line<'_>) -> bool {
    line.canopen().is_some_and(|(id, _)| id == 0x80)
}

/// The simulated robot with the scene of a hand controller's file.
pub(crate) fn simulated<'a>(
    file: &'a str,
    arm: &'a str,
) -> impl FnOnce(&Scratch, &str) -> Process + 'a {
    move |scratch, socket| {
        scratch.frhc(&["robot", "--config", file, "--robot", arm, "--socket", socket])
    }
}

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
    let config = linked("kraft_like", LINK)
        .replace("mass_kg = 0.8 ", "mass_kg = 0.0 ")
        .replace("accommodation_m_per_ns = 0.01 ", "accommodation_m_per_ns = 0.0 ")
        .replace("accommodation_rad_per_nms = 0.5", "accommodation_rad_per_nms = 0.0");
    let mut rig = Rig::started("far-python", &config, |_, socket| {
        let wall = ["--wall", "z", "0.37"];
        Process::of("python3", &[&["examples/far_side_local.py", socket][..], &wall].concat())
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
        let text = std::fs::read_to_string(&path).unwrap_or_default();
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
    rig.robot = Process::of("true", &[]);
    assert_eq!(rig.off_for(onset), "the far side holds: far side ends");
    assert_eq!(rig.run.terminate().code, Some(6));
    rig.sim.terminate().succeeds();
}
