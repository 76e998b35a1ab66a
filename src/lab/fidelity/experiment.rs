//! The whole experiment: every configuration, arm, hand and seed, and the figures pooled over the seeds.

use std::num::NonZero;

use serde::Serialize;

use crate::fidelity::script::{HANDS, Hand};
use crate::fidelity::trial::{Arm, NoTrial, Trial};
use config::Config;
use telemetry::fidelity::{Figures, Sample, Situation};

/// Hands and seeds that take part.
#[derive(Clone, Copy, Debug)]
pub struct Participants {
    /// Hands that take part.
    pub hands: &'static [Hand],
    /// First seed.
    pub seed: u64,
    /// Number of seeds.
    pub seeds: NonZero<u64>,
}

impl Participants {
    /// All hands.
    pub const fn full(seed: u64, seeds: NonZero<u64>) -> Self {
        Self { hands: &HANDS, seed, seeds }
    }

    /// One hand, one seed.
    pub fn short(seed: u64) -> Self {
        let (hands, _) = HANDS.split_at(1);
        Self { hands, seed, seeds: NonZero::<u64>::MIN }
    }

    /// Every hand with every seed.
    pub fn each(&self) -> impl Iterator<Item = (&'static Hand, u64)> + use<> {
        let Self { hands, seed, seeds } = *self;
        let seeds = move || (0..seeds.get()).map(move |place| seed.wrapping_add(place));
        hands.iter().flat_map(move |hand| seeds().map(move |seed| (hand, seed)))
    }
}

/// One run, in figures.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The configuration.
    pub config: String,
    /// The arm.
    pub arm: Arm,
    /// The hand.
    pub hand: &'static str,
    /// The seed.
    pub seed: u64,
    /// Still contact after the approach.
    pub approach: Option<Figures>,
    /// Contact at rest, over the whole script.
    pub still_contact: Option<Figures>,
    /// Contact in motion.
    pub moving_contact: Option<Figures>,
    /// Motion without contact.
    pub free_motion: Option<Figures>,
    /// Rest without contact.
    pub free_rest: Option<Figures>,
    /// Largest braking force after the release, in N.
    pub brake_n: f64,
    /// Cycles in which a joint was at its capacity.
    pub saturated_cycles: u64,
    /// Cause of a stop.
    pub stopped_by: Option<String>,
}

impl Row {
    /// Plays one run of `config`; `each` sees every cycle's time of the script in s, with its sample.
    ///
    /// # Errors
    /// As [`Trial::run`].
    pub fn play(
        name: &str,
        config: &Config,
        arm: Arm,
        (hand, seed): (&'static Hand, u64),
        each: impl FnMut(f64, Option<&Sample>),
    ) -> Result<Self, NoTrial> {
        let trial = Trial::run(config, arm, hand, seed, each)?;
        let of = |situation| trial.at_hand.figures(situation);
        Ok(Self {
            config: name.to_owned(),
            arm,
            hand: hand.0,
            seed,
            approach: trial.still(),
            still_contact: of(Situation::StillContact),
            moving_contact: of(Situation::MovingContact),
            free_motion: of(Situation::FreeMotion),
            free_rest: of(Situation::FreeRest),
            brake_n: trial.release.peak_n(),
            saturated_cycles: trial.saturated_cycles,
            stopped_by: trial.stopped_by,
        })
    }

    /// Its figures with the names of their situations.
    pub const fn situations(&self) -> [(&'static str, Option<&Figures>); 5] {
        [
            ("still contact after the approach", self.approach.as_ref()),
            ("still contact", self.still_contact.as_ref()),
            ("moving contact", self.moving_contact.as_ref()),
            ("free motion", self.free_motion.as_ref()),
            ("free rest", self.free_rest.as_ref()),
        ]
    }
}

/// Rows of one configuration and arm, in worst cases over hands and seeds.
#[derive(Clone, Debug, Serialize)]
pub struct Pooled {
    /// The configuration.
    pub config: String,
    /// The arm.
    pub arm: Arm,
    /// RMS error of each hand in still contact after the approach, in percent: the worst seed.
    pub still_percent: Vec<(&'static str, f64)>,
    /// The same without inertia.
    pub without_inertia_percent: Vec<(&'static str, f64)>,
    /// Maximum error in still contact after the approach, in percent of its RMS force.
    pub still_max_percent: f64,
    /// Error in contact in motion beyond the assist, RMS in N.
    pub moving_n: f64,
    /// Drag in free motion, RMS in N.
    pub drag_n: f64,
    /// Drag in free motion beyond the assist, RMS in N.
    pub drag_beyond_assist_n: f64,
    /// Largest braking force after the release, in N.
    pub brake_n: f64,
    /// Runs that stopped.
    pub stopped: usize,
}

/// Pools rows by configuration and arm, in their order.
pub fn pooled(rows: &[Row]) -> Vec<Pooled> {
    let same = |a: &Row, b: &Row| a.config == b.config && a.arm == b.arm;
    rows.chunk_by(same).filter_map(|rows| rows.first().map(|first| pool(first, rows))).collect()
}

fn pool(first: &Row, rows: &[Row]) -> Pooled {
    let worst = |value: fn(&Row) -> Option<f64>| rows.iter().filter_map(value).fold(0.0, f64::max);
    let by_hand = |value: fn(&Figures) -> f64| {
        let hands = rows.chunk_by(|a, b| a.hand == b.hand);
        let percent = |rows: &[Row]| {
            let worst = rows.iter().filter_map(|row| row.approach.as_ref().map(value));
            rows.first().map(|row| (row.hand, 100.0 * worst.fold(0.0, f64::max)))
        };
        hands.filter_map(percent).collect()
    };
    Pooled {
        config: first.config.clone(),
        arm: first.arm,
        still_percent: by_hand(Figures::relative_error),
        without_inertia_percent: by_hand(|still| still.beyond_assist_rms_n / still.wanted_rms_n),
        still_max_percent: worst(|row| Some(100.0 * row.approach?.relative_max())),
        moving_n: worst(|row| Some(row.moving_contact?.beyond_assist_rms_n)),
        drag_n: worst(|row| Some(row.free_motion?.felt_rms_n)),
        drag_beyond_assist_n: worst(|row| Some(row.free_motion?.beyond_assist_rms_n)),
        brake_n: worst(|row| Some(row.brake_n)),
        stopped: rows.iter().filter(|row| row.stopped_by.is_some()).count(),
    }
}
