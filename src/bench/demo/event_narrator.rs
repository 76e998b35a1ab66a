//! Lines about injected faults, events on the network and mode changes of a simulated run, with the same timestamps as
//! `bus.log` and `fault.json`.

use canopen::master::event::Event;
use config::Config;
use faults::Target;
use node::record::{Mode, Record};
use run::log_time;
use sim::fault::Notice;
use units::numbering::Joint;
use units::time::Instant;

/// Index of the switch box among the nodes.
const SWITCH_BOX: usize = 6;

/// Formatter of events, with the node names of the configuration.
#[derive(Clone, Debug)]
pub struct EventNarrator {
    /// Names of the six drives and of a configured switch box.
    names: Vec<String>,
    mode: Mode,
    self_driven: Option<Joint>,
    has_begun: bool,
}

impl EventNarrator {
    /// Creates a formatter for the devices of `config`.
    pub fn new(config: &Config) -> Self {
        let names = config.node_plans().into_iter().map(|(_, plan)| plan.name).collect();
        Self { names, mode: Mode::Boot, self_driven: None, has_begun: false }
    }

    /// Returns `0.443022 s: the scenario begins: its own times count from here` at the first call, else `None`.
    pub fn scenario_start(&mut self, begun: Instant) -> Option<String> {
        let is_new = !std::mem::replace(&mut self.has_begun, true);
        is_new.then(|| line(begun, "the scenario begins: its own times count from here"))
    }

    /// Returns `3.643022 s: joint 3 (elbow): unplugged`; the second argument is the start of the scenario.
    pub fn fault(&self, begun: Instant, notice: &Notice) -> String {
        let target = notice.fault.target;
        let place = match target {
            Target::Joint(joint) => Some(joint.index()),
            Target::SwitchBox => Some(SWITCH_BOX),
            Target::Drives | Target::Bus(_) | Target::Link | Target::Host => None,
        };
        let name = place.and_then(|place| self.names.get(place));
        let name = name.map_or_else(|| target.to_string(), Clone::clone);
        line(begun + notice.at, &format!("{name}: {notice}"))
    }

    /// Returns `3.668022 s: node: joint 3 (elbow): heartbeat lost`.
    pub fn event(&self, at: Instant, event: &Event) -> String {
        match event.node().and_then(|node| self.names.get(node.0)) {
            Some(name) => line(at, &format!("node: {name}: {event}")),
            None => line(at, &format!("node: {event}")),
        }
    }

    /// Returns `3.646025 s: node: zero-torque, joint 3: no sample for 3 cycles`, if the mode has changed.
    pub fn mode_change(&mut self, record: &Record) -> Option<String> {
        let is_new = record.mode != self.mode;
        self.mode = record.mode;
        let text = match record.cause {
            Some(cause) => format!("node: {}, {cause}", record.mode),
            None => format!("node: {}", record.mode),
        };
        is_new.then(|| line(record.at, &text))
    }

    /// Returns the line about a withdrawn friction compensation, for example
    /// `4.612025 s: node: joint 3 (elbow): friction compensation …`, once per arming.
    pub fn withdrawal(&mut self, record: &Record) -> Option<String> {
        let joint = record.output.ledger.self_driven;
        let before = std::mem::replace(&mut self.self_driven, joint);
        let joint = joint.filter(|_| before.is_none())?;
        let name = self.names.get(joint.index()).map_or_else(|| joint.to_string(), Clone::clone);
        let text =
            "friction compensation drove it by itself and is withdrawn until the next arming";
        Some(line(record.at, &format!("node: {name}: {text}")))
    }
}

fn line(at: Instant, text: &str) -> String {
    format!("{}: {text}", log_time::format_seconds(at))
}
