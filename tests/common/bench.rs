//! Complete control loop in one process, with a record of its frames.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use super::shipped::{ELBOW, config, text};
use bus::Tap;
use canopen::frame::{Channel, Frame, Telegram};
use config::Config;
use node::record::{Mode, Record};
use sim::quirks::Quirk;
use sim::scenario::Scenario;
use testbench::bench::Bench;
use units::time::Instant;

/// One millisecond.
pub(crate) const MS: Duration = Duration::from_millis(1);

/// Frames of all buses, with the times at which they were complete.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wire(Rc<RefCell<Vec<(Instant, Telegram)>>>);

impl Tap for Wire {
    fn on_wire(&mut self, at: Instant, telegram: &Telegram) {
        self.0.borrow_mut().push((at, *telegram));
    }
}

impl Wire {
    /// Returns the frames in candump's format, on interfaces bus0 and bus1, up to the first SYNC and `cycles` more.
    pub(crate) fn transcript(&self, cycles: usize) -> String {
        self.transcript_of(cycles, |_| true)
    }

    /// Returns the transcript of the frames that `is_of` selects.
    pub(crate) fn transcript_of(&self, cycles: usize, is_of: impl Fn(&Frame) -> bool) -> String {
        let mut syncs = 0;
        let mut text = String::new();
        for (at, Telegram { channel: Channel(bus), frame }) in self.0.borrow().iter() {
            syncs += usize::from(frame.cob_id == 0x80 && *bus == 0);
            if syncs > cycles {
                break;
            }
            if !is_of(frame) {
                continue;
            }
            let micros = at.as_micros();
            let stamp = format!("({}.{:06})", micros / 1_000_000, micros % 1_000_000);
            text.push_str(&format!("{stamp} bus{bus} {frame}\n"));
        }
        text
    }

    /// Returns the frames with one COB-ID since `from`.
    pub(crate) fn since(&self, from: Instant, cob_id: u16) -> Vec<(Instant, Frame)> {
        let wire = self.0.borrow();
        let of =
            wire.iter().filter(|(at, telegram)| *at >= from && telegram.frame.cob_id == cob_id);
        of.map(|(at, telegram)| (*at, telegram.frame)).collect()
    }

    /// Returns the frames of all buses.
    pub(crate) fn all(&self) -> Vec<(Instant, Telegram)> {
        self.0.borrow().clone()
    }

    pub(crate) fn clear(&self) {
        self.0.borrow_mut().clear();
    }
}

/// Returns a script whose hand presses the deadman `at` s, switches reflection on, sets the reference and moves 45 mm along
/// x: into the wall before which the object starts.
pub(crate) fn press_script(at: f64) -> String {
    let switch =
        |after: f64, switch: &str| format!("[[switch]]\nat_s = {:.2}\n{switch}\n", at + after);
    let switches = [
        switch(0.0, "deadman = true"),
        switch(0.05, "reflection = true"),
        switch(0.1, "reflection = false"),
        switch(0.15, "reference = true"),
        switch(0.2, "reference = false"),
    ];
    let moves =
        format!("[[move]]\nat_s = {:.2}\nduration_s = 0.3\nto_m = [0.045, 0.0, 0.0]\n", at + 0.25);
    format!("seconds = 10\n{}{moves}", switches.concat())
}

/// Returns a shipped scenario.
pub(crate) fn scenario(name: &str) -> Scenario {
    script(&text(&format!("config/scenarios/{name}.toml")))
}

pub(crate) fn script(text: &str) -> Scenario {
    Scenario::parse(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// Returns a bench before its boot whose elbow's drive has these quirks, and its frames.
pub(crate) fn bench_of(config: &Config, text: &str, quirks: &[&str]) -> (Bench<Wire>, Wire) {
    let mut script = script(text);
    let quirks = quirks.iter().map(|quirk| quirk.parse::<Quirk>().unwrap());
    script.quirks_mut().add(ELBOW, quirks);
    let wire = Wire::default();
    (Bench::new(config, script, 1, wire.clone()), wire)
}

/// Returns a bench after its boot.
pub(crate) fn started<T: Tap>(config: &Config, script: Scenario, tap: T) -> Bench<T> {
    let mut bench = Bench::new(config, script, 1, tap);
    bench.bring_up().unwrap();
    bench
}

/// Returns a bench after its boot, and its frames.
pub(crate) fn booted(config_name: &str, scenario_name: &str) -> (Bench<Wire>, Wire) {
    let wire = Wire::default();
    (started(&config(config_name), scenario(scenario_name), wire.clone()), wire)
}

/// Runs until a record is as wanted; fails after a minute.
pub(crate) fn until(bench: &mut Bench<Wire>, is_wanted: impl Fn(&Record) -> bool) -> Record {
    for _ in 0..60_000 {
        let record = bench.cycle();
        if is_wanted(&record) {
            return record;
        }
    }
    panic!("no such record within 60000 cycles")
}

/// Runs until the hand presses into the wall.
pub(crate) fn until_contact(bench: &mut Bench<Wire>) -> Record {
    until(bench, |record| record.mode == Mode::Engaged && record.f_s.force.norm() > 3.0)
}
