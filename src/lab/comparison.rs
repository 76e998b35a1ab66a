//! One scenario without and with the passivity layer: oscillation in contact, and its bound by the layer.

use std::fmt;

use serde::Serialize;

use config::Config;
use controller::{Extensions, Settings};
use sim::scenario::Scenario;
use telemetry::contact::Contact;
use telemetry::summary::Summary;

/// Largest share of the driving energy that a bounded oscillation may keep.
const MAX_BOUNDED_SHARE: f64 = 0.1;

/// Least driving energy of an oscillation, in J.
const MIN_ACTIVE: f64 = 0.01;

/// Two runs of one scenario.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// The stiffness of the wall, in N/m.
    pub wall_stiffness_n_per_m: f64,
    /// Without the layer.
    pub without: Summary,
    /// With it.
    pub with: Summary,
}

/// Returns `config` with the environment of `scenario`.
#[must_use]
pub fn surrounded(config: &Config, scenario: &Scenario) -> Config {
    let mut remote = config.remote.clone();
    if let (Some(stiffness), Some((.., wall))) = (scenario.wall_stiffness(), &mut remote.wall) {
        wall.stiffness = stiffness;
    }
    config.clone().with_remote(remote)
}

/// Returns `config` without its passivity layer.
#[must_use]
pub fn without_passivity(config: &Config) -> Config {
    let extensions = Extensions { passivity: None, tank: None, ..config.controller.extensions };
    config.clone().with_controller(Settings { extensions, ..config.controller })
}

impl Comparison {
    /// Returns whether the loop without the layer drove the hand.
    pub fn is_active(&self) -> bool {
        driven(&self.without.contact) > MIN_ACTIVE
    }

    /// Returns whether it did, and the layer removed at least 90 % of the energy.
    pub fn is_bounded(&self) -> bool {
        self.is_active()
            && driven(&self.with.contact) <= MAX_BOUNDED_SHARE * driven(&self.without.contact)
    }
}

/// Returns the energy with which contact drove the hand, in J.
fn driven(contact: &Contact) -> f64 {
    (-contact.lowest_energy_j).max(0.0)
}

/// Returns the compared figures of a run.
fn row(run: &Summary) -> [f64; 5] {
    [
        f64::from(run.contact.reversals),
        driven(&run.contact) * 1e3,
        run.contact.peak_speed_m_per_s * 1e3,
        run.peak_felt_force_n,
        run.contact_seconds,
    ]
}

/// The comparison as a table.
impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let wall = format!("wall of {:.0} N/m, passivity layer", self.wall_stiffness_n_per_m);
        writeln!(f, "{wall:42} {:>10} {:>10}", "off", "on")?;
        let rows = [
            "reversals of the hand in contact",
            "energy the contact drove it with, mJ",
            "peak speed in contact, mm/s",
            "peak force felt, N",
            "time in contact, s",
        ];
        for ((what, without), with) in rows.iter().zip(row(&self.without)).zip(row(&self.with)) {
            writeln!(f, "{what:42} {without:10.1} {with:10.1}")?;
        }
        let verdict = match (self.is_active(), self.is_bounded()) {
            (false, _) => "the loop does not oscillate without the layer either",
            (true, false) => "the passivity layer does not bound this loop",
            (true, true) => "the uncontrolled loop is active; the passivity layer bounds it",
        };
        f.write_str(verdict)
    }
}
