//! Worst figures of the experiment: over all seeds of each hand, and over all hands.

use serde::Serialize;

use crate::fidelity::experiment::{Condition, FidelityResult};
use crate::fidelity::hold::Hold;
use crate::fidelity::place::Place;
use crate::fidelity::release::Release;
use crate::fidelity::script::Course;
use telemetry::fidelity::Figures;

/// Errors of one hand in still contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HandError {
    /// Name of the operator's preset.
    pub hand: &'static str,
    /// RMS error at the hand, in N.
    pub error_n: f64,
    /// RMS error at the hand, in percent of K_T times the sensed force.
    pub error_percent: f64,
    /// RMS drag in free motion, in N.
    pub drag_n: f64,
}

/// Still contact under one condition.
#[derive(Clone, Debug, Serialize)]
pub struct Still {
    /// Name of the configuration.
    pub config: String,
    /// Conditions of the runs.
    #[serde(flatten)]
    pub condition: Condition,
    /// Posture at the wall; `None` out of reach.
    pub place: Option<Place>,
    /// RMS error of the worst hand in each hold, in percent; `None` without still contact.
    pub holds_percent: Vec<(Hold, Option<f64>)>,
    /// Errors over all still contact, by hand.
    pub hands: Vec<HandError>,
    /// Maximum error at the hand, in N.
    pub max_n: f64,
    /// Drag in free motion beyond assist and inertia, RMS in N.
    pub drag_beyond_assist_n: f64,
    /// Number of runs that stopped.
    pub stopped: usize,
}

/// Releases under one condition: the worst of all hands and seeds.
#[derive(Clone, Debug, Serialize)]
pub struct Releases {
    /// Name of the configuration.
    pub config: String,
    /// Conditions of the runs.
    #[serde(flatten)]
    pub condition: Condition,
    /// Largest value of each figure.
    pub worst: Release,
    /// Number of runs that stopped.
    pub stopped: usize,
}

/// Worst figures, by configuration and condition.
#[derive(Clone, Debug, Serialize)]
pub struct WorstCases {
    /// Conditions with holds in still contact.
    pub still: Vec<Still>,
    /// Conditions with a release alone.
    pub releases: Vec<Releases>,
}

impl WorstCases {
    /// Pools rows by configuration and condition; rows of one group must be adjacent.
    pub fn new(rows: &[FidelityResult]) -> Self {
        let same = |a: &FidelityResult, b: &FidelityResult| {
            a.config == b.config && a.condition == b.condition
        };
        let (mut still, mut releases) = (Vec::new(), Vec::new());
        for rows in rows.chunk_by(same) {
            let Some(first) = rows.first() else { continue };
            match first.condition.course {
                Course::Full => still.push(still_of(first, rows)),
                Course::PoseRelease | Course::RateRelease => {
                    releases.push(releases_of(first, rows));
                }
            }
        }
        Self { still, releases }
    }
}

fn still_of(first: &FidelityResult, rows: &[FidelityResult]) -> Still {
    let hold = |place: usize| {
        let figures = rows.iter().filter_map(|row| row.holds.get(place)?.1);
        figures.map(|figures| 100.0 * figures.relative_error()).reduce(f64::max)
    };
    let all_holds = (0..).zip(Hold::ALL);
    Still {
        config: first.config.clone(),
        condition: first.condition,
        place: first.place.clone(),
        holds_percent: all_holds.map(|(place, name)| (name, hold(place))).collect(),
        hands: rows.chunk_by(|a, b| a.hand == b.hand).filter_map(hand_of).collect(),
        max_n: worst(rows, |row| Some(row.still_contact?.error_max_n)),
        drag_beyond_assist_n: worst(rows, |row| Some(row.free_motion?.beyond_assist_rms_n)),
        stopped: stopped(rows),
    }
}

fn hand_of(rows: &[FidelityResult]) -> Option<HandError> {
    Some(HandError {
        hand: rows.first()?.hand,
        error_n: worst(rows, |row| Some(row.still_contact?.error_rms_n)),
        error_percent: worst(rows, |row| {
            row.still_contact.as_ref().map(Figures::relative_error).map(|share| 100.0 * share)
        }),
        drag_n: worst(rows, |row| Some(row.free_motion?.felt_rms_n)),
    })
}

fn releases_of(first: &FidelityResult, rows: &[FidelityResult]) -> Releases {
    let of = |value: fn(&Release) -> f64| worst(rows, |row| Some(value(&row.release)));
    Releases {
        config: first.config.clone(),
        condition: first.condition,
        worst: Release {
            pull_n: of(|release| release.pull_n),
            excess_n: of(|release| release.excess_n),
            outside_s: of(|release| release.outside_s),
            step_n: of(|release| release.step_n),
            taken_j: of(|release| release.taken_j),
            seconds: of(|release| release.seconds),
        },
        stopped: stopped(rows),
    }
}

fn worst(rows: &[FidelityResult], value: impl Fn(&FidelityResult) -> Option<f64>) -> f64 {
    rows.iter().filter_map(value).fold(0.0, f64::max)
}

fn stopped(rows: &[FidelityResult]) -> usize {
    rows.iter().filter(|row| row.stopped_by.is_some()).count()
}
