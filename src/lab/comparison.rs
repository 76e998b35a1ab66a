//! The same scenario without and with the passivity layer: whether the loop oscillates in contact, and
//! whether the layer bounds it.

use std::fmt;

use serde::Serialize;

use config::Config;
use controller::Extensions;
use controller::Settings;
use sim::scenario::Scenario;
use telemetry::contact::Contact;
use telemetry::summary::Summary;

/// The layer bounds an oscillation if it leaves no more than this of the energy that drives it.
const BOUNDED: f64 = 0.1;

/// Less is no oscillation, in J.
const ACTIVE: f64 = 0.01;

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

/// `config` with the surroundings that `scenario` asks for.
#[must_use]
pub fn surrounded(config: &Config, scenario: &Scenario) -> Config {
    let mut remote = config.remote.clone();
    if let (Some(stiffness), Some((.., wall))) = (scenario.wall_stiffness(), &mut remote.wall) {
        wall.stiffness = stiffness;
    }
    config.clone().with_remote(remote)
}

/// `config` without its passivity layer.
#[must_use]
pub fn without_passivity(config: &Config) -> Config {
    let extensions = Extensions { passivity: None, tank: None, ..config.controller.extensions };
    config.clone().with_controller(Settings { extensions, ..config.controller })
}

impl Comparison {
    /// Whether the uncontrolled loop drove the hand.
    pub fn is_active(&self) -> bool {
        driven(&self.without.contact) > ACTIVE
    }

    /// Whether it did, and the layer took nearly all of that away.
    pub fn is_bounded(&self) -> bool {
        self.is_active() && driven(&self.with.contact) <= BOUNDED * driven(&self.without.contact)
    }
}

/// The energy that contact drove the hand with, in J.
fn driven(contact: &Contact) -> f64 {
    (-contact.lowest_energy_j).max(0.0)
}

/// What is compared of a run.
fn row(run: &Summary) -> [f64; 5] {
    [
        f64::from(run.contact.reversals),
        driven(&run.contact) * 1e3,
        run.contact.peak_speed_m_per_s * 1e3,
        run.peak_felt_force_n,
        run.contact_seconds,
    ]
}

/// As people read it.
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
            (false, _) => "the loop drives nobody without the layer either",
            (true, false) => "the passivity layer does not bound this loop",
            (true, true) => "the uncontrolled loop is active; the passivity layer bounds it",
        };
        f.write_str(verdict)
    }
}
