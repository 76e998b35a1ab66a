//! What breaks in a simulated run, and what the node makes of it, one line each, with the time on the bus
//! as `bus.log` and `fault.json` have it.

use canopen::master::event::Event;
use config::Config;
use node::record::Mode;
use node::record::Record;
use run::time_line;
use sim::fault::Notice;
use sim::scenario::fault::Whom;
use units::time::Instant;

/// Tells it, with the names of the configuration.
#[derive(Debug)]
pub(super) struct Story {
    /// Of the six drives and the switch box.
    names: Vec<String>,
    mode: Mode,
    has_begun: bool,
}

impl Story {
    /// About the devices of `config`.
    pub(super) fn of(config: &Config) -> Self {
        let names = config.node_plans().into_iter().map(|(_, plan)| plan.name).collect();
        Self { names, mode: Mode::Boot, has_begun: false }
    }

    /// `0.443022 s: the scenario begins: its own times count from here`, once.
    pub(super) fn beginning(&mut self, begun: Instant) -> Option<String> {
        let is_new = !std::mem::replace(&mut self.has_begun, true);
        is_new.then(|| line(begun, "the scenario begins: its own times count from here"))
    }

    /// `3.643022 s: joint 3 (elbow): unplugged`, where the scenario began at `begun`.
    pub(super) fn fault(&self, begun: Instant, notice: &Notice) -> String {
        let whom = notice.fault.whom;
        let place = match whom {
            Whom::Joint(joint) => Some(joint.index()),
            Whom::Switches => self.names.len().checked_sub(1),
            Whom::Drives | Whom::Bus(_) | Whom::Link => None,
        };
        let name = place.and_then(|place| self.names.get(place));
        let name = name.map_or_else(|| whom.to_string(), Clone::clone);
        line(begun + notice.at, &format!("{name}: {notice}"))
    }

    /// `3.668022 s: node: joint 3 (elbow): heartbeat lost`.
    pub(super) fn event(&self, at: Instant, event: &Event) -> String {
        match event.node().and_then(|node| self.names.get(node.0)) {
            Some(name) => line(at, &format!("node: {name}: {event}")),
            None => line(at, &format!("node: {event}")),
        }
    }

    /// `3.646025 s: node: zero-torque, joint 3: no sample for 3 cycles`, where the mode has changed.
    pub(super) fn mode(&mut self, record: &Record) -> Option<String> {
        let is_new = record.mode != self.mode;
        self.mode = record.mode;
        let words = match record.cause {
            Some(cause) => format!("node: {}, {cause}", record.mode),
            None => format!("node: {}", record.mode),
        };
        is_new.then(|| line(record.at, &words))
    }
}

fn line(at: Instant, words: &str) -> String {
    format!("{}: {words}", time_line::seconds(at))
}
