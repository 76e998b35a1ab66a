//! Conditions and runs of the fidelity experiment: every configuration, place, force, arm, hand and seed.

use serde::Serialize;

use crate::fidelity::hold::{Hold, Holds};
use crate::fidelity::place::{self, DISTANCES, Place};
use crate::fidelity::release::{Release, ReleaseJudge};
use crate::fidelity::script::{Course, Hand};
use crate::fidelity::trial::Arm;
use crate::no_trial::NoTrial;
use config::Config;
use telemetry::fidelity::{Fidelity, Figures, Sample, Situation, WrenchSource};
use testbench::bench::Bench;
use testbench::truth::Truth;

/// Reflected forces during a hold, in N.
pub const FORCES: [f64; 3] = [2.0, 5.0, 9.0];

/// Wall stiffnesses of the releases, in N/m.
pub const RELEASE_WALLS: [f64; 3] = [2_000.0, 10_000.0, 50_000.0];

/// Force held before a release in rate mode, in N: 9 N would deflect the grip by 16 cm.
const RATE_FORCE: f64 = 2.0;

/// Force held before a release in pose mode, in N.
const POSE_FORCE: f64 = 9.0;

/// Conditions of a run, except its hand and seed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Condition {
    /// Motion of the hand.
    pub course: Course,
    /// Simulated arm, which may differ from the configured one.
    pub arm: Arm,
    /// Distance of the hand from the start to the wall, in m.
    #[serde(rename = "way_m")]
    pub distance_m: f64,
    /// Stiffness of the wall, in N/m; `None` for the configured one.
    pub stiffness_n_per_m: Option<f64>,
    /// Reflected force during a hold, in N.
    #[serde(rename = "felt_n")]
    pub reflected_n: f64,
}

impl Condition {
    /// Returns all conditions of the experiment.
    pub fn full() -> Vec<Self> {
        let [near, ..] = DISTANCES;
        let everywhere = DISTANCES.iter().flat_map(|way| FORCES.map(|felt| (*way, felt)));
        let identified = everywhere.map(|(way, felt)| Self::still(Arm::Identified, way, felt));
        let others = [Arm::LessFriction, Arm::MoreFriction]
            .into_iter()
            .flat_map(|arm| [2.0, 9.0].map(|felt| Self::still(arm, near, felt)));
        let releases = RELEASE_WALLS.iter().flat_map(|wall| Self::releases(Some(*wall)));
        identified
            .chain(others)
            .chain([Self::still(Arm::Frictionless, near, 9.0)])
            .chain(releases)
            .collect()
    }

    /// Returns the conditions of the short form.
    pub fn short() -> Vec<Self> {
        let [near, _, far] = DISTANCES;
        let still = [near, far]
            .into_iter()
            .flat_map(|way| [2.0, 9.0].map(|felt| Self::still(Arm::Identified, way, felt)));
        still.chain(Self::releases(None)).collect()
    }

    const fn still(arm: Arm, distance_m: f64, reflected_n: f64) -> Self {
        Self { course: Course::Full, arm, distance_m, stiffness_n_per_m: None, reflected_n }
    }

    /// Returns the releases of both modes at the nearest place.
    fn releases(stiffness_n_per_m: Option<f64>) -> [Self; 2] {
        let [near, ..] = DISTANCES;
        let courses = [(Course::PoseRelease, POSE_FORCE), (Course::RateRelease, RATE_FORCE)];
        courses.map(|(course, felt)| Self {
            course,
            stiffness_n_per_m,
            ..Self::still(Arm::Identified, near, felt)
        })
    }
}

/// Result of one run.
#[derive(Clone, Debug, Serialize)]
pub struct FidelityResult {
    /// Name of the configuration.
    pub config: String,
    /// Conditions of the run.
    #[serde(flatten)]
    pub condition: Condition,
    /// Posture of the arm at the wall; `None` out of its reach.
    pub place: Option<Place>,
    /// Name of the operator's preset.
    pub hand: &'static str,
    /// Seed of the simulation.
    pub seed: u64,
    /// Still contact after each motion.
    pub holds: Vec<(Hold, Option<Figures>)>,
    /// Still contact over all of the script.
    pub still_contact: Option<Figures>,
    /// Contact while the grip moves.
    pub moving_contact: Option<Figures>,
    /// Motion without contact, for the drag.
    pub free_motion: Option<Figures>,
    /// Rest without contact.
    pub free_rest: Option<Figures>,
    /// Force on the hand while it withdraws.
    pub release: Release,
    /// Cycles in which a joint was at its capacity.
    pub saturated_cycles: u64,
    /// Cause of a stop.
    pub stopped_by: Option<String>,
}

impl FidelityResult {
    /// Plays one run of `config`; `each` is called in every cycle, with the time of the script in s and the sample.
    ///
    /// # Errors
    /// Returns an error if `config` has no wall, or the drives cannot be enabled.
    pub fn play(
        name: &str,
        config: &Config,
        condition: Condition,
        (hand, seed): (&'static Hand, u64),
        mut each: impl FnMut(f64, Option<&Sample>),
    ) -> Result<Self, NoTrial> {
        let Condition { course, arm, distance_m, stiffness_n_per_m, reflected_n } = condition;
        let placed = place::moved_wall(config, distance_m, stiffness_n_per_m);
        let scenario = course.script(&placed, hand, reflected_n).ok_or(NoTrial::NoWall)?;
        let controlled = arm.controlled(&placed);
        let world = controlled.clone().with_friction(arm.friction());
        let mut bench = Bench::in_world_of(&world, &controlled, scenario, seed, ());
        bench.bring_up()?;
        let mut truth = Truth::new(&controlled);
        let times = course.times();
        let [damping, ..] = *controlled.controller.damping.values();
        let (mut holds, mut at_hand) = (Holds::default(), Fidelity::new(WrenchSource::Hand));
        let mut release = ReleaseJudge::new(times.release, damping);
        let (mut saturated_cycles, mut stopped_by) = (0, None);
        for _ in 0..controlled.controller.period.cycles(times.end) {
            let record = bench.cycle();
            let t = record.at.since(bench.begun()).as_secs_f64();
            let sample = truth.sample(&bench, &record);
            at_hand.add(sample.as_ref());
            holds.add(t, sample.as_ref().filter(|_| course == Course::Full));
            release.add(t, sample.as_ref());
            saturated_cycles += u64::from(record.output.is_saturated());
            stopped_by = record.cause.map(|cause| cause.to_string());
            each(t, sample.as_ref());
        }
        let of = |situation| at_hand.figures(situation);
        Ok(Self {
            config: name.to_owned(),
            condition,
            place: Place::new(config, distance_m).ok(),
            hand: hand.0,
            seed,
            holds: holds.figures().to_vec(),
            still_contact: of(Situation::StillContact),
            moving_contact: of(Situation::MovingContact),
            free_motion: of(Situation::FreeMotion),
            free_rest: of(Situation::FreeRest),
            release: release.figures(),
            saturated_cycles,
            stopped_by,
        })
    }

    /// Returns the figures with the names of their situations.
    pub fn situations(&self) -> Vec<(String, Option<&Figures>)> {
        let holds = self.holds.iter();
        let holds =
            holds.map(|(hold, figures)| (format!("hold after {}", hold.name()), figures.as_ref()));
        let all = [
            ("still contact", self.still_contact.as_ref()),
            ("moving contact", self.moving_contact.as_ref()),
            ("free motion", self.free_motion.as_ref()),
            ("free rest", self.free_rest.as_ref()),
        ];
        holds.chain(all.map(|(name, figures)| (name.to_owned(), figures))).collect()
    }
}
