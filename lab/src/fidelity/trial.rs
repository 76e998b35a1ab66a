//! Simulated arm of a run: as configured, or with other friction.

use derive_more::Display;
use serde::Serialize;

use config::Config;
use controller::{Extensions, Settings};

/// Simulated arm, by its friction.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Arm {
    /// As configured.
    #[display("as identified")]
    Identified,
    /// With 30 % less friction than configured.
    #[display("30 % less friction")]
    LessFriction,
    /// With 30 % more friction than configured.
    #[display("30 % more friction")]
    MoreFriction,
    /// Without friction, and without its compensation.
    #[display("without friction")]
    Frictionless,
}

impl Arm {
    /// Arms, the identified one first.
    pub const ALL: [Self; 4] =
        [Self::Identified, Self::LessFriction, Self::MoreFriction, Self::Frictionless];

    /// Returns the friction as a share of the configured one.
    pub const fn friction(self) -> f64 {
        match self {
            Self::Identified => 1.0,
            Self::LessFriction => 0.7,
            Self::MoreFriction => 1.3,
            Self::Frictionless => 0.0,
        }
    }

    /// Returns the configuration of the controller: without friction compensation on an arm without friction.
    pub(crate) fn controlled(self, config: &Config) -> Config {
        let Settings { extensions, .. } = config.controller;
        let friction = extensions.friction.filter(|_| self.friction() > 0.0);
        let extensions = Extensions { friction, ..extensions };
        config.clone().with_controller(Settings { extensions, ..config.controller })
    }
}
