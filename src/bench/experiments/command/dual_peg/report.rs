//! Tables, pictures and data of the dual peg.

use std::fmt::Write;

use crate::command::dual_peg::{Figures, Ratio, Series};
use crate::command::picture::{Ink, Panel, Series as Curve};
use crate::command::table::Table;
use crate::dual_peg::condition::Condition;
use crate::dual_peg::pooled::Pooled;
use crate::dual_peg::trial::Trial;

/// Work of the three operators of Table I without and with force information, in units that the paper does not state.
const PAPER: [[f64; 3]; 2] = [[1.66, 2.55, 1.51], [0.59, 0.61, 0.42]];

/// Ratio above which docs/experiments.md says so.
const NOTED: f64 = 0.45;

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
    Table {
        lead: Some("work on the environment by operator and condition".to_owned()),
        columns: vec![
            "operator",
            "on",
            "inserted",
            "W, J",
            "spread, J",
            "x y z about x y z, J",
            "abs, J",
            "peak, N",
            "mean, N",
            "s",
        ],
        rows: figures.table.iter().map(condition_row).collect(),
        note: "on: the switches; W: Eq. 11 as printed, mean over the trials from the first contact on; spread: standard deviation; abs: sum of \
               ∫|F dξ|; stopped and timed-out trials keep their work"
            .to_owned(),
    }
}

fn condition_row(pooled: &Pooled) -> Vec<String> {
    let parts = pooled.literal_parts_j.map(|part| format!("{part:.3}")).join(" ");
    vec![
        pooled.operator.clone(),
        pooled.condition.to_string(),
        format!("{} of {}", pooled.inserted, pooled.trials),
        format!("{:.3}", pooled.literal_j),
        format!("{:.3}", pooled.literal_deviation_j),
        parts,
        format!("{:.3}", pooled.absolute_j),
        format!("{:.0}", pooled.peak_n),
        format!("{:.1}", pooled.mean_n),
        format!("{:.1}", pooled.seconds),
    ]
}

fn ratios(figures: &Figures) -> Table {
    let [without, with] = PAPER;
    let papers = without.into_iter().zip(with).map(|(without, with)| with / without);
    let names = ["1", "2", "3"];
    let mut rows: Vec<Vec<String>> = names
        .into_iter()
        .zip(papers)
        .map(|(name, ratio)| {
            vec![format!("subject {name} of the paper"), format!("{ratio:.2}"), String::new()]
        })
        .collect();
    rows.extend(figures.ratios.iter().map(|Ratio { operator, ratio }| {
        let note = if *ratio > NOTED { format!("above {NOTED}") } else { String::new() };
        vec![operator.clone(), format!("{ratio:.2}"), note]
    }));
    Table {
        lead: Some("ratio of the work with both switches on to that with both off".to_owned()),
        columns: vec!["operator", "ratio", "note"],
        rows,
        note: "the paper's: Table I, FRHC/NTRFC over no force info".to_owned(),
    }
}

fn aligned(figures: &Figures) -> Table {
    let row = |pooled: &Pooled| {
        vec![
            pooled.operator.clone(),
            pooled.condition.to_string(),
            format!("{} of {}", pooled.inserted, pooled.trials),
            format!("{:.2}", pooled.seconds),
        ]
    };
    Table {
        lead: Some("pegs that start aligned, seen without error".to_owned()),
        columns: vec!["operator", "on", "inserted", "s"],
        rows: figures.aligned.iter().map(row).collect(),
        note: "at least 95 % of each condition must be inserted, none more than 20 % slower than another".to_owned(),
    }
}

fn sweep(figures: &Figures) -> Table {
    let row = |swept: &super::Swept| {
        let (name, value) = point(swept.series);
        let ratios: Vec<String> =
            swept.ratios.iter().map(|one| format!("{:.2}", one.ratio)).collect();
        let inserted = |condition: Condition| {
            let of = swept.pooled.iter().filter(|one| one.condition == condition);
            let counts = of.fold((0, 0), |(a, b), one| (a + one.inserted, b + one.trials));
            format!("{} of {}", counts.0, counts.1)
        };
        vec![
            name.to_owned(),
            format!("{value:.1} mm"),
            ratios.join(" "),
            inserted(Condition::NEITHER),
            inserted(Condition::BOTH),
        ]
    };
    Table {
        lead: Some("ratio over visual error and misalignment".to_owned()),
        columns: vec![
            "varied",
            "value",
            "ratio by operator",
            "inserted, neither",
            "inserted, both",
        ],
        rows: figures.sweep.iter().map(row).collect(),
        note: "the error of orientation is varied with the visual error".to_owned(),
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

/// Returns the pictures: the work of each condition, and the ratio over what is varied.
pub(super) fn panels(figures: &Figures) -> Vec<Panel> {
    let mut panels = vec![work(figures)];
    for (title, is_of) in
        [("ratio over visual error", "visual error"), ("ratio over misalignment", "misalignment")]
    {
        let mut series: Vec<Curve> = Vec::new();
        for Ratio { operator, .. } in &figures.ratios {
            let points = figures.sweep.iter().filter(|swept| point(swept.series).0 == is_of);
            let points = points.filter_map(|swept| {
                let of = swept.ratios.iter().find(|one| one.operator == *operator)?;
                Some([point(swept.series).1, of.ratio])
            });
            let points: Vec<[f64; 2]> = points.collect();
            if !points.is_empty() {
                series.push(Curve::new(operator.clone(), Ink::Line, points));
            }
        }
        if !series.is_empty() {
            panels.push(Panel {
                title: title.to_owned(),
                axes: ["mm", "ratio"],
                places: Vec::new(),
                series,
            });
        }
    }
    panels
}

fn work(figures: &Figures) -> Panel {
    let series = Condition::ALL.map(|condition| {
        let of = figures.table.iter().filter(|one| one.condition == condition);
        let points = (1_u32..).zip(of).map(|(place, one)| [f64::from(place), one.literal_j]);
        Curve::new(condition.to_string(), Ink::Marks, points.collect())
    });
    Panel {
        title: "work (Eq. 11) of each operator".to_owned(),
        axes: ["operator", "J"],
        places: figures.ratios.iter().map(|ratio| ratio.operator.clone()).collect(),
        series: series.into(),
    }
}

/// Returns all trials as CSV, with the digits that recompute the tables.
pub(super) fn csv(trials: &[(Series, Trial)]) -> String {
    let mut text = "series,value_mm,operator,reflection,accommodation,trial,outcome,seconds,contact_seconds,attempts,\
        literal_x_j,literal_y_j,literal_z_j,literal_about_x_j,literal_about_y_j,literal_about_z_j,\
        absolute_x_j,absolute_y_j,absolute_z_j,absolute_about_x_j,absolute_about_y_j,absolute_about_z_j,\
        peak_n,peak_nm,mean_n,mean_nm\n"
        .to_owned();
    for (series, trial) in trials {
        let (name, value) = point(*series);
        let Condition { reflection, accommodation } = trial.condition;
        let numbers = trial.literal_j.iter().chain(&trial.absolute_j);
        let rest = [trial.peak_n, trial.peak_nm, trial.mean_n, trial.mean_nm];
        let numbers: Vec<String> = numbers.chain(&rest).map(|one| format!("{one:.9e}")).collect();
        let Trial { operator, number, outcome, seconds, contact_seconds, attempts, .. } = trial;
        _ = writeln!(
            text,
            "{name},{value},{operator},{reflection},{accommodation},{number},{outcome},{seconds:.9e},{contact_seconds:.9e},{attempts},{}",
            numbers.join(",")
        );
    }
    text
}
