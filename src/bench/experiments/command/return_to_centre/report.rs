//! Table, CSV and picture of the return to centre.

use std::fmt::Write;

use crate::command::picture::{Ink, Panel, Series};
use crate::command::table::Table;
use crate::return_to_centre::curve::Point;
use crate::return_to_centre::trial::Row;

/// Columns of the table, in its order.
const COLUMNS: [&str; 10] = [
    "configuration",
    "axis",
    "plateau",
    "commanded",
    "at the hand",
    "deadband",
    "edge at the hand",
    "hysteresis, of it damping",
    "wall at the hand",
    "let go: rests at",
];

/// Meaning of the columns, below the table.
const NOTE: &str = "plateau, deadband: as configured; at the hand: mean of the way out and back, edge of the parabola that fits it best; \
hysteresis: way out less way back on the plateau; let go: distance from the reference 3 s after the hand has opened, and time until the \
deadband was entered for good";

/// Scale and units of an axis: displacement, force, stiffness.
struct Units {
    scale: f64,
    displacement: &'static str,
    force: &'static str,
    stiffness: &'static str,
}

const TRANSLATION: Units = Units { scale: 1e3, displacement: "mm", force: "N", stiffness: "N/m" };
const ROTATION: Units =
    Units { scale: 1e3, displacement: "mrad", force: "N·m", stiffness: "N·m/rad" };

const fn units(row: &Row) -> &'static Units {
    if row.is_rotation { &ROTATION } else { &TRANSLATION }
}

/// Returns the table.
pub(super) fn table(rows: &[Row]) -> Table {
    Table {
        lead: None,
        columns: COLUMNS.to_vec(),
        rows: rows.iter().map(|row| cells(row).to_vec()).collect(),
        note: NOTE.to_owned(),
    }
}

fn cells(row: &Row) -> [String; 10] {
    let Units { scale, displacement, force, stiffness } = units(row);
    let decimals = if row.is_rotation { 4 } else { 2 };
    let size = |value: f64| format!("{value:.decimals$}");
    let forced = |value: f64| format!("{value:.decimals$} {force}");
    let far = |value: f64| format!("{:.1} {displacement}", value * scale);
    let absent = || "–".to_owned();
    let figures = row.figures.as_ref();
    let law = &row.law;
    let returned = match row.returned.after_s {
        Some(seconds) => format!("{}, {seconds:.2} s", far(row.returned.rests_at.abs())),
        None => format!("{}, outside", far(row.returned.rests_at.abs())),
    };
    [
        row.config.clone(),
        row.axis.to_owned(),
        forced(law.plateau),
        figures.map_or_else(absent, |one| forced(one.commanded)),
        figures.map_or_else(absent, |one| {
            let percent = 100.0 * (one.felt / one.commanded - 1.0);
            let off =
                if percent.is_finite() { format!(" ({percent:+.1} %)") } else { String::new() };
            forced(one.felt) + &off
        }),
        far(law.deadband),
        figures.and_then(|one| one.edge).map_or_else(absent, far),
        figures.map_or_else(absent, |one| {
            format!("{}, {}", size(one.hysteresis), forced(one.damping))
        }),
        figures
            .and_then(|one| one.wall_stiffness)
            .map_or_else(absent, |wall| format!("{wall:.0} {stiffness}")),
        returned,
    ]
}

/// Returns the figures of every axis, one line each, in SI units.
pub(super) fn csv(rows: &[Row]) -> String {
    let mut text = "configuration,axis,deadband,plateau,wall,commanded,felt,edge,command_from,hysteresis,damping,\
        wall_stiffness,released_at,rests_at,overshoot,inside_after_s,limited_cycles,stopped_by\n"
        .to_owned();
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.6}"));
    for row in rows {
        let (law, returned) = (&row.law, &row.returned);
        let of = |value: fn(&crate::return_to_centre::figures::Figures) -> Option<f64>| {
            number(row.figures.as_ref().and_then(value))
        };
        let numbers = [
            number(Some(law.deadband)),
            number(Some(law.plateau)),
            number(law.wall),
            of(|one| Some(one.commanded)),
            of(|one| Some(one.felt)),
            of(|one| one.edge),
            number(row.command_from),
            of(|one| Some(one.hysteresis)),
            of(|one| Some(one.damping)),
            of(|one| one.wall_stiffness),
            number(Some(returned.from)),
            number(Some(returned.rests_at)),
            number(Some(returned.overshoot)),
            number(returned.after_s),
        ];
        let cause = row.stopped_by.as_deref().unwrap_or_default().replace(',', ";");
        _ = writeln!(
            text,
            "{},{},{},{},{cause}",
            row.config,
            row.axis,
            numbers.join(","),
            row.limited_cycles
        );
    }
    text
}

/// Returns the curves, a line per displacement, in SI units.
pub(super) fn curves(rows: &[Row]) -> String {
    let mut text = "configuration,axis,displacement,law,commanded,felt_out,felt_back\n".to_owned();
    for row in rows {
        for Point { x, law, commanded, felt_out, felt_back, .. } in &row.points {
            let Row { config, axis, .. } = row;
            _ = writeln!(
                text,
                "{config},{axis},{x:.6},{law:.6},{commanded:.6},{felt_out:.6},{felt_back:.6}"
            );
        }
    }
    text
}

/// Returns a panel per axis: force over displacement, as in Fig. 4.
pub(super) fn panels(rows: &[Row]) -> Vec<Panel> {
    rows.iter().map(panel).collect()
}

fn panel(row: &Row) -> Panel {
    let scale = units(row).scale;
    let line = |name: &str, ink: Ink, value: fn(&Point) -> f64| {
        let points = row.points.iter().map(|point| [point.x * scale, value(point)]);
        Series::new(name, ink, points.collect())
    };
    let axes = if row.is_rotation {
        ["displacement, mrad", "moment on the hand, N·m"]
    } else {
        ["displacement, mm", "force on the hand, N"]
    };
    Panel {
        title: format!("{}, {}", row.config, row.axis),
        axes,
        places: Vec::new(),
        series: vec![
            line("at the hand, way out", Ink::Line, |point| point.felt_out),
            line("at the hand, way back", Ink::Line, |point| point.felt_back),
            line("mean of both ways", Ink::Line, Point::felt),
            line("Eq. 8", Ink::Dashed, |point| point.law),
        ],
    }
}
