//! Table and CSV of the experiment.

use std::fmt::Write;

use crate::cli::experiment::table::Table;
use lab::fidelity::experiment::{Pooled, Row};
use telemetry::fidelity::{Figures, Shares};

/// Columns of the table, in its order.
const COLUMNS: [&str; 9] = [
    "configuration",
    "arm",
    "still, %",
    "less inertia, %",
    "max, %",
    "moving, N",
    "drag, N",
    "beyond assist, N",
    "brake, N",
];

/// Meaning of the columns, below a table.
const NOTE: &str = "still: RMS error at the hand in still contact after the approach, of K_T times the sensed force, by hand; \
moving, beyond assist: RMS without commanded assist and inertia; the worst of all hands and seeds";

/// Returns the table.
pub(super) fn table(pooled: &[Pooled]) -> Table {
    Table {
        lead: pooled.first().map(|one| format!("hands: {}", hands(one))),
        columns: COLUMNS.to_vec(),
        rows: pooled.iter().map(|pooled| cells(pooled).to_vec()).collect(),
        note: NOTE.to_owned(),
    }
}

/// Names of the hands, in the order of their figures.
fn hands(pooled: &Pooled) -> String {
    pooled.still_percent.iter().map(|(hand, _)| *hand).collect::<Vec<_>>().join(", ")
}

fn cells(pooled: &Pooled) -> [String; 9] {
    let percents = |of: &[(&str, f64)]| {
        of.iter().map(|(_, percent)| format!("{percent:.1}")).collect::<Vec<_>>().join(" ")
    };
    let newtons = |force: f64| format!("{force:.2}");
    [
        pooled.config.clone(),
        pooled.arm.to_string(),
        percents(&pooled.still_percent),
        percents(&pooled.without_inertia_percent),
        format!("{:.0}", pooled.still_max_percent),
        newtons(pooled.moving_n),
        newtons(pooled.drag_n),
        newtons(pooled.drag_beyond_assist_n),
        newtons(pooled.brake_n),
    ]
}

/// Returns every situation of every run, one line each.
pub(super) fn csv(rows: &[Row]) -> String {
    let mut text = "configuration,arm,hand,seed,situation,samples,wanted_rms_n,felt_rms_n,error_rms_n,error_max_n,\
        error_rms_nm,error_x_n,error_y_n,error_z_n,error_x_nm,error_y_nm,error_z_nm,beyond_assist_rms_n,friction_n,\
        compensation_n,centring_n,damping_n,passivity_n,inertia_n,brake_n,saturated_cycles,stopped_by\n"
        .to_owned();
    for row in rows {
        for (situation, figures) in row.situations() {
            let Some(figures) = figures else { continue };
            let Row { config, arm, hand, seed, brake_n, saturated_cycles, stopped_by, .. } = row;
            let numbers = numbers(figures).map(|number| format!("{number:.6}")).join(",");
            let cause = stopped_by.as_deref().unwrap_or_default().replace(',', ";");
            _ = writeln!(
                text,
                "{config},{arm},{hand},{seed},{situation},{},{numbers},{brake_n:.6},{saturated_cycles},{cause}",
                figures.samples
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
