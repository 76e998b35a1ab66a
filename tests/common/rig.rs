//! A node, its drives and its robot as processes on vcan0, for the tests of their link.

use std::io::BufRead;

use serde_json::Value;

use canopen_tools::candump::Line;

use crate::common::process::{Candump, Process, Scratch};

/// Node with its drives, its robot and the frames on its bus.
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
        let mut candump = Candump::start("vcan0");
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
        let end = self.first_sync + self::seconds(seconds);
        self.candump.until(|line| line.nanos > end);
    }

    /// Waits for a number of SYNCs on the bus, independently of its time stamps.
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
        // The object touches the wall one second after the hand has moved, at 3.5 s.
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

/// Returns seconds as nanoseconds.
pub(crate) fn seconds(seconds: f64) -> u64 {
    u64::try_from(std::time::Duration::from_secs_f64(seconds).as_nanos()).unwrap()
}
