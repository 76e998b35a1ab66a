//! Tables, pictures and data of the dual peg.

use crate::command::dual_peg::{Figures, Series, SweepPoint};
use crate::command::table::{self, Column, Table};
use crate::dual_peg::condition::Condition;
use crate::dual_peg::statistics::{Ratio, TrialStatistics};
use crate::dual_peg::trial::Trial;
use picture::{Ink, Panel, Series as Curve};

/// Work of the three operators of Table I without and with force information; the paper does not state the unit.
const PAPER: [[f64; 3]; 2] = [[1.66, 2.55, 1.51], [0.59, 0.61, 0.42]];

/// Ratio above which the table has a note.
const NOTED: f64 = 0.45;

/// Names of the columns of trials.csv.
const HEAD: &str = "series,value_mm,operator,reflection,accommodation,trial,outcome,seconds,contact_seconds,attempts,\
literal_x_j,literal_y_j,literal_z_j,literal_about_x_j,literal_about_y_j,literal_about_z_j,\
absolute_x_j,absolute_y_j,absolute_z_j,absolute_about_x_j,absolute_about_y_j,absolute_about_z_j,\
peak_n,peak_nm,mean_n,mean_nm";

/// Meaning of the columns of the conditions.
const CONDITIONS_NOTE: &str = "on: the switches; W: Eq. 11 as printed, mean over the trials from the first contact on; spread: standard \
deviation; abs: sum of ∫|F dξ|; stopped and timed-out trials keep their work";

/// Returns all tables.
pub(super) fn tables(figures: &Figures) -> Vec<Table> {
    let mut tables = vec![conditions(figures), ratios(figures), aligned(figures)];
    if !figures.sweep.is_empty() {
        tables.push(sweep(figures));
    }
    if let (Some(shaking), Some(table)) = (figures.shaking, tables.last_mut()) {
        table.note.push_str(&format!("; the robot {shaking}"));
    }
    tables
}

fn conditions(figures: &Figures) -> Table {
    let columns: [Column<&TrialStatistics>; 10] = [
        ("operator", |one| one.operator.clone()),
        ("on", |one| one.condition.to_string()),
        ("inserted", |one| inserted([*one])),
        ("W, J", |one| format!("{:.3}", one.literal_j)),
        ("spread, J", |one| format!("{:.3}", one.literal_deviation_j)),
        ("x y z about x y z, J", |one| {
            one.literal_parts_j.map(|part| format!("{part:.3}")).join(" ")
        }),
        ("abs, J", |one| format!("{:.3}", one.absolute_j)),
        ("peak, N", |one| format!("{:.0}", one.peak_n)),
        ("mean, N", |one| format!("{:.1}", one.mean_n)),
        ("s", |one| format!("{:.1}", one.seconds)),
    ];
    Table::new(&figures.table, columns, CONDITIONS_NOTE)
        .below("work on the environment by operator and condition")
}

/// Returns the number of successful trials and of all, as `19 of 20`.
fn inserted<'p>(pooled: impl IntoIterator<Item = &'p TrialStatistics>) -> String {
    let (inserted, trials) = TrialStatistics::counts(pooled);
    format!("{inserted} of {trials}")
}

fn ratios(figures: &Figures) -> Table {
    let [without, with] = PAPER;
    let papers = without.into_iter().zip(with).zip(["1", "2", "3"]);
    let papers = papers.map(|((without, with), name)| {
        (format!("subject {name} of the paper"), with / without, String::new())
    });
    let ours = figures.ratios.iter().map(|Ratio { operator, ratio }| {
        let note = if *ratio > NOTED { format!("above {NOTED}") } else { String::new() };
        (operator.clone(), *ratio, note)
    });
    let columns: [Column<(String, f64, String)>; 3] = [
        ("operator", |(operator, ..)| operator.clone()),
        ("ratio", |(_, ratio, _)| format!("{ratio:.2}")),
        ("note", |(.., note)| note.clone()),
    ];
    Table::new(papers.chain(ours), columns, "the paper's: Table I, FRHC/NTRFC over no force info")
        .below("ratio of the work with both switches on to that with both off")
}

fn aligned(figures: &Figures) -> Table {
    let note =
        "at least 95 % of each condition must be inserted, none more than 20 % slower than another";
    let columns: [Column<&TrialStatistics>; 4] = [
        ("operator", |one| one.operator.clone()),
        ("on", |one| one.condition.to_string()),
        ("inserted", |one| inserted([*one])),
        ("s", |one| format!("{:.2}", one.seconds)),
    ];
    Table::new(&figures.aligned, columns, note).below("pegs that start aligned, seen without error")
}

fn sweep(figures: &Figures) -> Table {
    let columns: [Column<&SweepPoint>; 5] = [
        ("varied", |swept| point(swept.series).0.to_owned()),
        ("value", |swept| format!("{:.1} mm", point(swept.series).1)),
        ("ratio by operator", |swept| {
            let ratios = swept.ratios.iter().map(|one| format!("{:.2}", one.ratio));
            ratios.collect::<Vec<_>>().join(" ")
        }),
        ("inserted, neither", |swept| inserted(swept.in_condition(Condition::NEITHER))),
        ("inserted, both", |swept| inserted(swept.in_condition(Condition::BOTH))),
    ];
    let note = "the error of orientation is varied with the visual error";
    Table::new(&figures.sweep, columns, note).below("ratio over visual error and misalignment")
}

impl SweepPoint {
    /// Returns the trials of a condition.
    fn in_condition(&self, condition: Condition) -> impl Iterator<Item = &TrialStatistics> {
        self.pooled.iter().filter(move |one| one.condition == condition)
    }
}

/// Returns the name of a swept value, and the value in mm.
fn point(series: Series) -> (&'static str, f64) {
    match series {
        Series::Table => ("table", 0.0),
        Series::Aligned => ("aligned", 0.0),
        Series::VisualError(error) => ("visual error", 1e3 * error),
        Series::Misalignment(offset) => ("misalignment", 1e3 * offset),
    }
}

/// Returns the panels: work of each condition, and ratio over visual error and over misalignment.
pub(super) fn panels(figures: &Figures) -> Vec<Panel> {
    let swept = ["visual error", "misalignment"].map(|varied| {
        let curves = figures.ratios.iter().map(|Ratio { operator, .. }| {
            let points = figures.sweep.iter().filter_map(|swept| {
                let (name, value) = point(swept.series);
                let of = swept.ratios.iter().find(|one| one.operator == *operator)?;
                (name == varied).then_some([value, of.ratio])
            });
            Curve::new(operator.clone(), Ink::Line, points)
        });
        let curves = curves.filter(|curve| !curve.points.is_empty());
        Panel::new(format!("ratio over {varied}"), ["mm", "ratio"], curves)
    });
    let swept = swept.into_iter().filter(|panel| !panel.series.is_empty());
    [work(figures)].into_iter().chain(swept).collect()
}

fn work(figures: &Figures) -> Panel {
    let series = Condition::ALL.map(|condition| {
        let of = figures.table.iter().filter(|one| one.condition == condition);
        let points = (1_u32..).zip(of).map(|(place, one)| [f64::from(place), one.literal_j]);
        Curve::new(condition.to_string(), Ink::Marks, points)
    });
    let places = figures.ratios.iter().map(|ratio| ratio.operator.clone()).collect();
    Panel { places, ..Panel::new("work (Eq. 11) of each operator", ["operator", "J"], series) }
}

/// Returns all trials as CSV.
pub(super) fn csv(trials: &[(Series, Trial)]) -> anyhow::Result<String> {
    table::csv(HEAD, trials.iter().map(|(series, trial)| (point(*series), trial)))
}
