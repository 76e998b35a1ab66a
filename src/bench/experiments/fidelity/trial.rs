//! One run of a script by one hand, on the arm as configured or another one.

use std::fmt;

use serde::Serialize;
use thiserror::Error;

use crate::fidelity::hold::Holds;
use crate::fidelity::release::ReleaseJudge;
use crate::fidelity::script::{Course, Hand};
use config::Config;
use controller::{Extensions, Settings};
use node::BringUpError;
use telemetry::fidelity::{Fidelity, Judged, Report, Sample};
use testbench::bench::Bench;
use testbench::truth::Truth;

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

/// A course, by one hand with one seed, on one arm, with a force held.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// The course.
    pub course: Course,
    /// The arm that the hand really holds.
    pub arm: Arm,
    /// The hand.
    pub hand: &'static Hand,
    /// The seed of its tremor.
    pub seed: u64,
    /// Force felt while the hand holds, in N.
    pub felt_n: f64,
}

/// Outcome of one run.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Still contact after each motion.
    pub holds: Holds,
    /// Fidelity over the whole script.
    pub at_hand: Fidelity,
    /// The release.
    pub release: ReleaseJudge,
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
    /// Plays `part` at the wall of `config`; `each` sees every cycle's time of the script in s, with its sample.
    ///
    /// # Errors
    /// Without a wall, or where the drives cannot be enabled.
    pub fn run(
        config: &Config,
        part: &Part,
        mut each: impl FnMut(f64, Option<&Sample>),
    ) -> Result<Self, NoTrial> {
        let Part { course, arm, hand, seed, felt_n } = *part;
        let scenario = course.script(config, hand, felt_n).ok_or(NoTrial::NoWall)?;
        let config = &arm.controlled(config);
        let world = config.clone().with_friction(arm.friction());
        let mut bench = Bench::in_world_of(&world, config, scenario, seed, false, ());
        bench.bring_up()?;
        let mut truth = Truth::new(config);
        let times = course.times();
        let [damping, ..] = *config.controller.damping.values();
        let mut trial = Self {
            holds: Holds::default(),
            at_hand: Fidelity::new(Judged::Hand),
            release: ReleaseJudge::new(times.release, damping),
            saturated_cycles: 0,
            stopped_by: None,
        };
        for _ in 0..config.controller.period.cycles(times.end) {
            let record = bench.cycle();
            let t = record.at.since(bench.begun()).as_secs_f64();
            let sample = truth.sample(&bench, &record);
            trial.at_hand.add(sample.as_ref());
            trial.holds.add(t, sample.as_ref().filter(|_| course == Course::Full));
            trial.release.add(t, sample.as_ref());
            trial.saturated_cycles += u64::from(record.output.is_saturated());
            trial.stopped_by = record.cause.map(|cause| cause.to_string());
            each(t, sample.as_ref());
        }
        Ok(trial)
    }

    /// Figures of what the hand felt.
    pub fn report(&self) -> Option<Report> {
        self.at_hand.report()
    }
}
