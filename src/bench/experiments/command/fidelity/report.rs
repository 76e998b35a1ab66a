//! Tables and CSV of the experiment.

use std::fmt::Write;

use crate::command::table::Table;
use crate::fidelity::experiment::{Condition, Row};
use crate::fidelity::place::Place;
use crate::fidelity::pooled::{HandError, Pooled, Releases, Still};
use telemetry::fidelity::{Figures, Shares};

/// Columns of the table of still contact.
const STILL: [&str; 9] = [
    "configuration",
    "arm",
    "posture at the wall",
    "felt, N",
    "approach slide press half, %",
    "all, %",
    "all, N",
    "drag, N",
    "beyond, N",
];

/// Meaning of its columns.
const STILL_NOTE: &str = "posture: way of the hand to the wall, third joint, smallest singular value, dry friction at the grip; \
approach slide press half: RMS error at the hand in still contact after each motion, of K_T times the sensed force, the worst hand; \
all: all still contact of the run, by hand; drag: in free motion, by hand; beyond: drag without assist and inertia";

/// Columns of the table of releases.
const RELEASES: [&str; 8] = [
    "configuration",
    "mode",
    "wall, kN/m",
    "pull, N",
    "excess, N",
    "outside, ms",
    "step, N",
    "taken, mJ",
];

/// Meaning of its columns.
const RELEASES_NOTE: &str = "pull, excess: force of task, damper and K_D at the hand that pulls into the wall, or beyond task + K_D v; \
outside: time for which either is above 0.3 N; step, taken: largest change of the damper's force in a cycle, and its work; \
the worst of all hands and seeds";

/// Returns the tables.
pub(super) fn tables(pooled: &Pooled) -> [Table; 2] {
    let hands = pooled.still.first().map(|one| {
        let names: Vec<&str> = one.hands.iter().map(|hand| hand.hand).collect();
        format!("hands: {}", names.join(", "))
    });
    let still = pooled.still.iter().map(still_cells).collect();
    let releases = pooled.releases.iter().map(release_cells).collect();
    [
        Table { lead: hands, columns: STILL.to_vec(), rows: still, note: STILL_NOTE.to_owned() },
        Table {
            lead: None,
            columns: RELEASES.to_vec(),
            rows: releases,
            note: RELEASES_NOTE.to_owned(),
        },
    ]
}

fn still_cells(still: &Still) -> Vec<String> {
    let Condition { arm, felt_n, way_m, .. } = still.condition;
    let by_hand = |value: fn(&HandError) -> f64, digits: usize| {
        let hands = still.hands.iter().map(|hand| format!("{:.digits$}", value(hand)));
        hands.collect::<Vec<_>>().join(" ")
    };
    let holds = still.holds_percent.iter().map(|(_, percent)| {
        percent.map_or_else(|| "-".to_owned(), |percent| format!("{percent:.1}"))
    });
    let place = still.place.as_ref().map(Place::to_string);
    vec![
        still.config.clone(),
        arm.to_string(),
        place.unwrap_or_else(|| format!("{:.0} cm: out of reach", way_m * 100.0)),
        format!("{felt_n:.0}"),
        holds.collect::<Vec<_>>().join(" "),
        by_hand(|hand| hand.error_percent, 1),
        by_hand(|hand| hand.error_n, 2),
        by_hand(|hand| hand.drag_n, 2),
        format!("{:.2}", still.drag_beyond_assist_n),
    ]
}

fn release_cells(releases: &Releases) -> Vec<String> {
    let Releases { config, condition, worst, .. } = releases;
    let wall = condition.stiffness_n_per_m.map(|wall| format!("{:.0}", wall / 1e3));
    vec![
        config.clone(),
        condition.course.to_string(),
        wall.unwrap_or_else(|| "as configured".to_owned()),
        format!("{:.2}", worst.pull_n),
        format!("{:.2}", worst.excess_n),
        format!("{:.0}", worst.outside_s * 1e3),
        format!("{:.2}", worst.step_n),
        format!("{:.1}", worst.taken_j * 1e3),
    ]
}

/// Returns every situation of every run, one line each.
pub(super) fn csv(rows: &[Row]) -> String {
    let mut text = "configuration,course,arm,way_m,wall_n_per_m,held_n,hand,seed,situation,samples,wanted_rms_n,felt_rms_n,\
        error_rms_n,error_max_n,error_rms_nm,error_x_n,error_y_n,error_z_n,error_x_nm,error_y_nm,error_z_nm,\
        beyond_assist_rms_n,friction_n,compensation_n,centring_n,damping_n,passivity_n,inertia_n,pull_n,excess_n,step_n,\
        taken_j,saturated_cycles,stopped_by\n"
        .to_owned();
    for row in rows {
        for (situation, figures) in row.situations() {
            let Some(figures) = figures else { continue };
            let Row {
                config, condition, hand, seed, release, saturated_cycles, stopped_by, ..
            } = row;
            let Condition { course, arm, way_m, stiffness_n_per_m, felt_n } = condition;
            let wall = stiffness_n_per_m.map(|wall| wall.to_string()).unwrap_or_default();
            let ends = [release.pull_n, release.excess_n, release.step_n, release.taken_j];
            let numbers = numbers(figures).into_iter().chain(ends);
            let numbers: Vec<String> = numbers.map(|number| format!("{number:.6}")).collect();
            let cause = stopped_by.as_deref().unwrap_or_default().replace(',', ";");
            _ = writeln!(
                text,
                "{config},{course},{arm},{way_m},{wall},{felt_n},{hand},{seed},{situation},{},{},{saturated_cycles},{cause}",
                figures.samples,
                numbers.join(",")
            );
        }
    }
    text
}

/// Returns the figures in the order of the columns.
const fn numbers(figures: &Figures) -> [f64; 18] {
    let Figures { wanted_rms_n, felt_rms_n, error_rms_n, error_max_n, error_rms_nm, .. } = *figures;
    let [x, y, z, about_x, about_y, about_z] = figures.error_rms_of_axes;
    let Shares { friction_n, compensation_n, centring_n, damping_n, passivity_n, inertia_n } =
        figures.shares;
    [
        wanted_rms_n,
        felt_rms_n,
        error_rms_n,
        error_max_n,
        error_rms_nm,
        x,
        y,
        z,
        about_x,
        about_y,
        about_z,
        figures.beyond_assist_rms_n,
        friction_n,
        compensation_n,
        centring_n,
        damping_n,
        passivity_n,
        inertia_n,
    ]
}
