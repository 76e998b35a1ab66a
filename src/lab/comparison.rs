//! The same scenario without and with the passivity layer: whether the loop oscillates in contact, and
//! whether the layer bounds it.

use std::fmt;

use serde::Serialize;

use crate::config::Config;
use crate::controller::Beyond;
use crate::controller::Settings;
use crate::sim::scenario::Scenario;
use crate::telemetry::contact::Contact;
use crate::telemetry::summary::Summary;

/// The layer bounds an oscillation if it leaves no more than this of the energy that drives it.
const BOUNDED: f64 = 0.1;

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
    let mut config = config.clone();
    if let (Some(stiffness), Some((.., wall))) =
        (scenario.wall_stiffness(), &mut config.remote.wall)
    {
        wall.stiffness = stiffness;
    }
    config
}

/// `config` without its passivity layer.
#[must_use]
pub fn without_passivity(config: &Config) -> Config {
    let beyond = Beyond { passivity: None, tank: None, ..config.controller.beyond };
    Config { controller: Settings { beyond, ..config.controller }, ..config.clone() }
}

impl Comparison {
    /// Whether the uncontrolled loop drove the hand, and the layer took nearly all of that away.
    pub fn is_bounded(&self) -> bool {
        let driven = |contact: &Contact| (-contact.lowest_energy_j).max(0.0);
        let (without, with) = (driven(&self.without.contact), driven(&self.with.contact));
        with <= BOUNDED * without
    }
}

/// As people read it.
impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let row = |f: &mut fmt::Formatter<'_>, what, unit, value: &dyn Fn(&Summary) -> f64| {
            let (without, with) = (value(&self.without), value(&self.with));
            writeln!(f, "{what:32} {without:10.1} {with:10.1}  {unit}")
        };
        writeln!(
            f,
            "wall of {:.0} N/m, passivity layer   off         on",
            self.wall_stiffness_n_per_m
        )?;
        let reversals =
            |run: &Summary| f64::from(u32::try_from(run.contact.reversals).unwrap_or(u32::MAX));
        row(f, "reversals of the hand in contact", "", &reversals)?;
        row(f, "energy the contact drove it with", "mJ", &|run| {
            -run.contact.lowest_energy_j * 1e3
        })?;
        row(f, "peak speed in contact", "mm/s", &|run| run.contact.peak_speed_m_per_s * 1e3)?;
        row(f, "peak force felt", "N", &|run| run.peak_felt_force_n)?;
        row(f, "time in contact", "s", &|run| run.contact_seconds)?;
        let verdict = if self.is_bounded() {
            "the uncontrolled loop is active; the passivity layer bounds it"
        } else {
            "the passivity layer does not bound this loop"
        };
        f.write_str(verdict)
    }
}
