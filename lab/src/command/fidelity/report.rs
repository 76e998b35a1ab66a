//! Tables and CSV of the experiment.

use crate::command::table::{self, Column, Table};
use crate::fidelity::experiment::{Condition, FidelityResult};
use crate::fidelity::place::Place;
use crate::fidelity::worst_cases::{HandError, Releases, Still, WorstCases};

/// Meaning of the columns of still contact.
const STILL_NOTE: &str = "posture: way of the hand to the wall, third joint, smallest singular value, dry friction at the grip; \
approach slide press half: RMS error at the hand in still contact after each motion, of K_T times the sensed force, the worst hand; \
all: all still contact of the run, by hand; drag: in free motion, by hand; beyond: drag without assist and inertia";

/// Meaning of the columns of releases.
const RELEASES_NOTE: &str = "pull, excess: force of task, damper and K_D at the hand that pulls into the wall, or beyond task + K_D v; \
outside: time for which either is above 0.3 N; step, taken: largest change of the damper's force in a cycle, and its work; \
the worst of all hands and seeds";

/// Names of the columns of runs.csv.
const HEAD: &str = "configuration,course,arm,way_m,wall_n_per_m,held_n,hand,seed,situation,samples,wanted_rms_n,felt_rms_n,\
error_rms_n,error_max_n,error_rms_nm,error_x_n,error_y_n,error_z_n,error_x_nm,error_y_nm,error_z_nm,\
beyond_assist_rms_n,friction_n,compensation_n,centring_n,damping_n,passivity_n,inertia_n,pull_n,excess_n,step_n,\
taken_j,saturated_cycles,stopped_by";

/// Returns the tables of still contact and of releases.
pub(super) fn tables(pooled: &WorstCases) -> [Table; 2] {
    let hands = pooled.still.first().map(|one| {
        let names: Vec<&str> = one.hands.iter().map(|hand| hand.hand).collect();
        format!("hands: {}", names.join(", "))
    });
    let still: [Column<&Still>; 9] = [
        ("configuration", |one| one.config.clone()),
        ("arm", |one| one.condition.arm.to_string()),
        ("posture at the wall", |one| {
            let place = one.place.as_ref().map(Place::to_string);
            place.unwrap_or_else(|| {
                format!("{:.0} cm: out of reach", one.condition.distance_m * 100.0)
            })
        }),
        ("felt, N", |one| format!("{:.0}", one.condition.reflected_n)),
        ("approach slide press half, %", |one| {
            let holds = one.holds_percent.iter().map(|(_, percent)| {
                percent.map_or_else(|| "-".to_owned(), |percent| format!("{percent:.1}"))
            });
            holds.collect::<Vec<_>>().join(" ")
        }),
        ("all, %", |one| by_hand(one, 1, |hand| hand.error_percent)),
        ("all, N", |one| by_hand(one, 2, |hand| hand.error_n)),
        ("drag, N", |one| by_hand(one, 2, |hand| hand.drag_n)),
        ("beyond, N", |one| format!("{:.2}", one.drag_beyond_assist_n)),
    ];
    let releases: [Column<&Releases>; 8] = [
        ("configuration", |one| one.config.clone()),
        ("mode", |one| one.condition.course.to_string()),
        ("wall, kN/m", |one| {
            let wall = one.condition.stiffness_n_per_m.map(|wall| format!("{:.0}", wall / 1e3));
            wall.unwrap_or_else(|| "as configured".to_owned())
        }),
        ("pull, N", |one| format!("{:.2}", one.worst.pull_n)),
        ("excess, N", |one| format!("{:.2}", one.worst.excess_n)),
        ("outside, ms", |one| format!("{:.0}", one.worst.outside_s * 1e3)),
        ("step, N", |one| format!("{:.2}", one.worst.step_n)),
        ("taken, mJ", |one| format!("{:.1}", one.worst.taken_j * 1e3)),
    ];
    [
        Table { lead: hands, ..Table::new(&pooled.still, still, STILL_NOTE) },
        Table::new(&pooled.releases, releases, RELEASES_NOTE),
    ]
}

fn by_hand(still: &Still, digits: usize, value: fn(&HandError) -> f64) -> String {
    let hands = still.hands.iter().map(|hand| format!("{:.digits$}", value(hand)));
    hands.collect::<Vec<_>>().join(" ")
}

/// Returns the CSV of all runs, one line for each situation.
pub(super) fn csv(rows: &[FidelityResult]) -> anyhow::Result<String> {
    let situations = rows.iter().flat_map(|row| {
        let FidelityResult {
            config,
            condition,
            hand,
            seed,
            release,
            saturated_cycles,
            stopped_by,
            ..
        } = row;
        let Condition { course, arm, distance_m, stiffness_n_per_m, reflected_n } = condition;
        let (course, arm) = (course.to_string(), arm.to_string());
        let run = (config, course, arm, distance_m, stiffness_n_per_m, reflected_n, hand, seed);
        let release = [release.pull_n, release.excess_n, release.step_n, release.taken_j];
        row.situations().into_iter().filter_map(move |(situation, figures)| {
            Some((run.clone(), situation, figures?, release, saturated_cycles, stopped_by))
        })
    });
    table::csv(HEAD, situations)
}
