//! Content of a report for its sections: a subject, its curves and figures, and its stops.

use std::ops::Range;

use crate::gather::SessionData;
use crate::stops::StopReport;
use crate::subject::Subject;
use controller::arm::JointKind;
use picture::strip::{Event, Plot, Strip};

/// Maximum number of characters of an event's name in a picture.
const NAME_LENGTH: usize = 34;

/// Subject with its curves, figures and stops.
#[derive(Debug)]
pub(crate) struct View<'a> {
    pub(crate) subject: &'a Subject,
    pub(crate) gathered: &'a SessionData,
    pub(crate) stops: &'a [StopReport],
    pub(crate) joints: &'a [String],
}

impl View<'_> {
    /// Returns the time of the session, in s: from time zero, or the first cycle of a part, to the last cycle.
    pub(crate) fn time(&self) -> Range<f64> {
        let [first, last] = self.gathered.ends.unwrap_or([0.0, 1.0]);
        // A boot before the first cycle belongs to it; the hours before a fault record do not.
        let from = if first < 0.5 * last { 0.0 } else { first };
        from..last
    }

    /// Returns a picture of this time with modes and stops, and the plots.
    pub(crate) fn strip(&self, title: &str, plots: impl IntoIterator<Item = Plot>) -> Strip {
        let mut strip = Strip::new(title, self.time());
        strip.bands = self.gathered.modes.bands(0.0);
        strip.events = (1..).zip(self.stops).map(|(number, stop)| event(number, stop)).collect();
        strip.plots = plots.into_iter().collect();
        strip
    }

    /// Returns name and units of position and torque of each joint; no units without a configuration.
    pub(crate) fn units(&self) -> Vec<(&str, &'static str, &'static str)> {
        let config = self.subject.config.as_ref();
        let kind = |place: usize| Some(config?.joints.get(place)?.plant.link.kind);
        let joints = self.joints.iter().take(6).enumerate();
        let units = joints.map(|(place, name)| match kind(place) {
            Some(JointKind::Revolute) => (name.as_str(), "rad", "N·m"),
            Some(JointKind::Prismatic) => (name.as_str(), "m", "N"),
            None => (name.as_str(), "", ""),
        });
        units.collect()
    }

    /// Returns the sentence in place of content that needs a replay.
    pub(crate) fn without_replay(&self, what: &str) -> String {
        let reason = crate::replayed::reason(&self.gathered.findings);
        format!("{what} need the replay: {reason}.")
    }
}

/// Returns a stop as an event of a picture.
fn event(number: usize, stop: &StopReport) -> Event {
    let name = stop.joint.clone().unwrap_or_else(|| stop.cause.clone());
    let mut short: String = name.chars().take(NAME_LENGTH).collect();
    if short.len() < name.len() {
        short.push('…');
    }
    Event { at: stop.at, name: format!("{number} {short}") }
}

/// Returns a plot of a given height whose axis need not contain zero.
pub(crate) fn small(plot: Plot, height: f64) -> Plot {
    Plot { has_zero: false, height, ..plot }
}
