//! The arm of a run: as configured, or another one.

use std::fmt;

use serde::Serialize;

use config::Config;
use controller::{Extensions, Settings};

/// The arm that the hand really holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Arm {
    /// As configured.
    Identified,
    /// With 30 % less friction than configured.
    LessFriction,
    /// With 30 % more friction than configured.
    MoreFriction,
    /// Without friction, and without its compensation.
    Frictionless,
}

impl Arm {
    /// All arms.
    pub const ALL: [Self; 4] =
        [Self::Identified, Self::LessFriction, Self::MoreFriction, Self::Frictionless];

    /// Its friction, as a share of the configured one.
    pub const fn friction(self) -> f64 {
        match self {
            Self::Identified => 1.0,
            Self::LessFriction => 0.7,
            Self::MoreFriction => 1.3,
            Self::Frictionless => 0.0,
        }
    }

    /// Returns the configuration of its controller.
    pub(crate) fn controlled(self, config: &Config) -> Config {
        let Settings { extensions, .. } = config.controller;
        let friction = extensions.friction.filter(|_| self.friction() > 0.0);
        let extensions = Extensions { friction, ..extensions };
        config.clone().with_controller(Settings { extensions, ..config.controller })
    }
}

impl fmt::Display for Arm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Identified => "as identified",
            Self::LessFriction => "30 % less friction",
            Self::MoreFriction => "30 % more friction",
            Self::Frictionless => "without friction",
        })
    }
}
