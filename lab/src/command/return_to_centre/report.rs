//! Table, CSV and picture of the return to centre.

use crate::command::table::{self, Column, Table};
use crate::return_to_centre::curve::Point;
use crate::return_to_centre::figures::Figures;
use crate::return_to_centre::trial::SweepResult;
use picture::{Ink, Panel, Series};

/// Meaning of the columns, below the table.
const NOTE: &str = "plateau, deadband: as configured; at the hand: mean of the way out and back, edge of the parabola that fits it best; \
hysteresis: way out less way back on the plateau; let go: distance from the reference 3 s after the hand has opened, and time until the \
deadband was entered for good";

/// Names of the columns of axes.csv.
const AXES_HEAD: &str = "configuration,axis,deadband_m_or_rad,plateau_n_or_nm,wall_m_or_rad,commanded_n_or_nm,felt_n_or_nm,\
edge_m_or_rad,command_from_m_or_rad,hysteresis_n_or_nm,damping_n_or_nm,wall_stiffness_n_per_m_or_nm_per_rad,\
released_at_m_or_rad,rests_at_m_or_rad,overshoot_m_or_rad,inside_after_s,limited_cycles,stopped_by";

/// Names of the columns of curves.csv.
const CURVES_HEAD: &str = "configuration,axis,displacement_m_or_rad,law_n_or_nm,commanded_n_or_nm,felt_out_n_or_nm,felt_back_n_or_nm";

/// Displacements in tables and pictures per m or rad.
const SCALE: f64 = 1e3;

impl SweepResult {
    /// Returns a displacement in mm or mrad.
    fn far(&self, displacement: f64) -> String {
        let unit = if self.is_rotation { "mrad" } else { "mm" };
        format!("{:.1} {unit}", displacement * SCALE)
    }

    /// Returns a force or moment without its unit.
    fn size(&self, force: f64) -> String {
        format!("{force:.*}", if self.is_rotation { 4 } else { 2 })
    }

    /// Returns a force in N or a moment in N·m.
    fn forced(&self, force: f64) -> String {
        self.size(force) + if self.is_rotation { " N·m" } else { " N" }
    }

    /// Returns a figure of the curve as text, or a dash where it is absent.
    fn figure(&self, text: impl Fn(&Figures) -> Option<String>) -> String {
        self.figures.as_ref().and_then(text).unwrap_or_else(|| "–".to_owned())
    }

    /// Returns the plateau at the hand, and its difference from the commanded one.
    fn felt(&self, figures: &Figures) -> String {
        let percent = 100.0 * (figures.felt / figures.commanded - 1.0);
        let off = if percent.is_finite() { format!(" ({percent:+.1} %)") } else { String::new() };
        self.forced(figures.felt) + &off
    }

    /// Returns the displacement at rest, and the time until the grip is within the deadband.
    fn end(&self) -> String {
        let after = self.returned.after_s.map(|seconds| format!("{seconds:.2} s"));
        let after = after.unwrap_or_else(|| "outside".to_owned());
        format!("{}, {after}", self.far(self.returned.rests_at.abs()))
    }
}

/// Returns one line for each configuration and axis.
pub(super) fn table(rows: &[SweepResult]) -> Table {
    let columns: [Column<&SweepResult>; 10] = [
        ("configuration", |row| row.config.clone()),
        ("axis", |row| row.axis.to_owned()),
        ("plateau", |row| row.forced(row.law.plateau)),
        ("commanded", |row| row.figure(|one| Some(row.forced(one.commanded)))),
        ("at the hand", |row| row.figure(|one| Some(row.felt(one)))),
        ("deadband", |row| row.far(row.law.deadband)),
        ("edge at the hand", |row| row.figure(|one| Some(row.far(one.edge?)))),
        ("hysteresis, of it damping", |row| {
            let of = |one: &Figures| {
                format!("{}, {}", row.size(one.hysteresis), row.forced(one.damping))
            };
            row.figure(|one| Some(of(one)))
        }),
        ("wall at the hand", |row| {
            let unit = if row.is_rotation { "N·m/rad" } else { "N/m" };
            row.figure(|one| Some(format!("{:.0} {unit}", one.wall_stiffness?)))
        }),
        ("let go: rests at", |row| row.end()),
    ];
    Table::new(rows, columns, NOTE)
}

/// Returns the figures of every axis, one line each, in SI units.
pub(super) fn csv(rows: &[SweepResult]) -> anyhow::Result<String> {
    let rows = rows.iter().map(|row| {
        let SweepResult {
            config,
            axis,
            law,
            command_from,
            returned,
            limited_cycles,
            stopped_by,
            ..
        } = row;
        let figures = row.figures.map(|one| {
            let plateau = [Some(one.commanded), Some(one.felt), one.edge];
            (plateau, [Some(one.hysteresis), Some(one.damping), one.wall_stiffness])
        });
        let (plateau, ways) = figures.unwrap_or_default();
        (config, axis, law, plateau, command_from, ways, returned, limited_cycles, stopped_by)
    });
    table::csv(AXES_HEAD, rows)
}

/// Returns the curves, a line per displacement, in SI units.
pub(super) fn curves(rows: &[SweepResult]) -> anyhow::Result<String> {
    let points = rows.iter().flat_map(|row| row.points.iter().map(move |point| (row, point)));
    let fields = |(row, point): (&SweepResult, &Point)| {
        let Point { x, law, commanded, felt_out, felt_back, .. } = *point;
        (row.config.clone(), row.axis, [x, law, commanded, felt_out, felt_back])
    };
    table::csv(CURVES_HEAD, points.map(fields))
}

/// Returns the panel of an axis: force over displacement, as in Fig. 4.
pub(super) fn panel(row: &SweepResult) -> Panel {
    let line = |name: &str, ink: Ink, value: fn(&Point) -> f64| {
        Series::new(name, ink, row.points.iter().map(|point| [point.x * SCALE, value(point)]))
    };
    let axes = if row.is_rotation {
        ["displacement, mrad", "moment on the hand, N·m"]
    } else {
        ["displacement, mm", "force on the hand, N"]
    };
    let series = [
        line("at the hand, way out", Ink::Line, |point| point.felt_out),
        line("at the hand, way back", Ink::Line, |point| point.felt_back),
        line("mean of both ways", Ink::Line, Point::felt),
        line("Eq. 8", Ink::Dashed, |point| point.law),
    ];
    Panel::new(format!("{}, {}", row.config, row.axis), axes, series)
}
