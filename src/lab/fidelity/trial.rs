//! One run of the script by one hand, on the arm as configured or another one.

use std::fmt;

use serde::Serialize;
use thiserror::Error;

use crate::bench::Bench;
use crate::fidelity::release::Release;
use crate::fidelity::script::{self, Hand};
use crate::fidelity::truth::Truth;
use config::Config;
use controller::{Extensions, Settings};
use node::BringUpError;
use telemetry::fidelity::{Fidelity, Figures, Judged, Report, Sample};

/// The arm that the hand really holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Arm {
    /// As configured.
    Identified,
    /// With 30 % less friction than configured.
    LessFriction,
    /// Without friction, and without its compensation.
    Frictionless,
}

impl Arm {
    /// All arms.
    pub const ALL: [Self; 3] = [Self::Identified, Self::LessFriction, Self::Frictionless];

    /// Its friction, as a share of the configured one.
    pub const fn friction(self) -> f64 {
        match self {
            Self::Identified => 1.0,
            Self::LessFriction => 0.7,
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
            Self::Frictionless => "without friction",
        })
    }
}

/// Outcome of one run.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Fidelity until the end of the first hold: after an approach.
    pub approach: Fidelity,
    /// Fidelity over the whole script.
    pub at_hand: Fidelity,
    /// Braking after the release.
    pub release: Release,
    /// Cycles in which a joint was at its capacity.
    pub saturated_cycles: u64,
    /// Cause of a stop.
    pub stopped_by: Option<String>,
}

/// Reason why a configuration has no trial.
#[derive(Debug, Error)]
pub enum NoTrial {
    /// Nothing to press against.
    #[error("the experiment presses against a wall: add [remote.wall]")]
    NoWall,
    /// The drives do not boot.
    #[error(transparent)]
    BringUp(#[from] BringUpError),
}

impl Trial {
    /// Runs the script; `each` sees every cycle's time of the script in s, with its sample.
    ///
    /// # Errors
    /// Without a wall, or where the drives cannot be enabled.
    pub fn run(
        config: &Config,
        arm: Arm,
        hand: &Hand,
        seed: u64,
        mut each: impl FnMut(f64, Option<&Sample>),
    ) -> Result<Self, NoTrial> {
        let scenario = script::script(config, hand).ok_or(NoTrial::NoWall)?;
        let config = &arm.controlled(config);
        let world = config.clone().with_friction(arm.friction());
        let mut bench = Bench::in_world_of(&world, config, scenario, seed, false, ());
        bench.bring_up()?;
        let mut truth = Truth::new(config);
        let mut trial = Self {
            approach: Fidelity::new(Judged::Hand),
            at_hand: Fidelity::new(Judged::Hand),
            release: Release::default(),
            saturated_cycles: 0,
            stopped_by: None,
        };
        let period = config.controller.period;
        let dt = period.seconds();
        for _ in 0..period.cycles(script::SECONDS) {
            let record = bench.cycle();
            let t = record.at.since(bench.begun()).as_secs_f64();
            let sample = truth.sample(&bench, &record);
            trial.at_hand.add(sample.as_ref());
            if t < script::SLIDE_S {
                trial.approach.add(sample.as_ref());
            }
            trial.release.add(t, dt, &record);
            trial.saturated_cycles += u64::from(record.output.is_saturated());
            trial.stopped_by = record.cause.map(|cause| cause.to_string());
            each(t, sample.as_ref());
        }
        Ok(trial)
    }

    /// Figures of still contact after the approach.
    pub fn still(&self) -> Option<Figures> {
        self.approach.report()?.still_contact
    }

    /// Figures of what the hand felt.
    pub fn report(&self) -> Option<Report> {
        self.at_hand.report()
    }
}
