//! Tables, CSV and picture of the torque curves.

use std::fmt::Write;

use crate::command::picture::{Ink, Panel, Series};
use crate::command::table::Table;
use crate::torque_curves::calibration::{Bench, Row, TorqueError};
use crate::torque_curves::test_force::{self, Feeling, TEST_FORCE, TEST_MOMENT};
use calibration::fit::Direction;
use config::JointParameters;
use controller::calibration::TorqueCurve;

/// Columns of the joints, in the table's order.
const JOINTS: [&str; 9] = [
    "configuration",
    "joint",
    "range",
    "friction",
    "line: rms, max, %",
    "rising, falling, %",
    "polynomial: rms, max, %",
    "rising, falling, %",
    "seeds",
];

/// Columns of the test forces, in the table's order.
const TEST_FORCES: [&str; 8] = [
    "configuration",
    "arm",
    "curve",
    "error of forces, mean, max, %",
    "turned, max, °",
    "error of moments, mean, max, %",
    "weight on the hand, N",
    "stopped",
];

/// Points of a curve.
const POINTS: i32 = 60;

/// Returns the table of the joints: the worst of all seeds.
pub(super) fn joints(rows: &[Row]) -> Table {
    let mut places: Vec<(&str, &str)> = Vec::new();
    for Row { config, joint, .. } in rows {
        let place = (config.as_str(), joint.as_str());
        if !places.contains(&place) {
            places.push(place);
        }
    }
    Table {
        lead: None,
        columns: JOINTS.to_vec(),
        rows: places
            .iter()
            .map(|(config, joint)| {
                let of = rows.iter().filter(|row| row.config == *config && row.joint == *joint);
                joint_cells(&of.collect::<Vec<_>>())
            })
            .collect(),
        note: "error of the joint torque that a target makes, in percent of the range: rms and max over the range without friction; \
            rising, falling: rms of the load cell's readings in that driving direction, friction included; the worst seed"
            .to_owned(),
    }
}

/// Returns the cells of one joint with all its seeds.
fn joint_cells(rows: &[&Row]) -> Vec<String> {
    let Some(first) = rows.first() else { return Vec::new() };
    let unit = if first.is_force { "N" } else { "N·m" };
    let worst = |of: fn(&Row) -> f64| rows.iter().map(|row| of(row)).fold(0.0, f64::max);
    let pair = |a: f64, b: f64| format!("{a:.1}, {b:.1}");
    vec![
        first.config.clone(),
        first.joint.clone(),
        format!("{:.1} {unit}", first.range),
        format!("{:.3} {unit}", worst(|row| row.friction)),
        pair(worst(|row| row.line.rms), worst(|row| row.line.max)),
        pair(worst(|row| row.line.rising), worst(|row| row.line.falling)),
        format!("{:.2}, {:.2}", worst(|row| row.polynomial.rms), worst(|row| row.polynomial.max)),
        pair(worst(|row| row.polynomial.rising), worst(|row| row.polynomial.falling)),
        rows.len().to_string(),
    ]
}

/// Returns the table of the test forces: all seeds together.
pub(super) fn test_forces(rows: &[test_force::Row]) -> Table {
    let key = |row: &test_force::Row| (row.config.clone(), row.arm.to_string(), row.curve);
    let mut keys: Vec<_> = Vec::new();
    for row in rows {
        if !keys.contains(&key(row)) {
            keys.push(key(row));
        }
    }
    Table {
        lead: None,
        columns: TEST_FORCES.to_vec(),
        rows: keys
            .iter()
            .map(|of| force_cells(&rows.iter().filter(|row| key(row) == *of).collect::<Vec<_>>()))
            .collect(),
        note: format!(
            "a hand at rest feels {TEST_FORCE} N along x, y and z, or {TEST_MOMENT} N·m about them: size of the difference to the wanted \
             force or moment, all seeds; weight: force on the hand without a test force, the worst seed; stopped: runs that the node stopped"
        ),
    }
}

/// Returns the cells of one arm and curve with all its seeds.
fn force_cells(rows: &[&test_force::Row]) -> Vec<String> {
    let Some(first) = rows.first() else { return Vec::new() };
    let felt = |from: usize, of: fn(&Feeling) -> f64| -> Vec<f64> {
        let parts = rows.iter().flat_map(|row| row.felt.iter().skip(from).take(3));
        parts.flatten().map(of).collect()
    };
    let errors = |from: usize| {
        let of = felt(from, |one| one.error_percent);
        if of.is_empty() { absent() } else { format!("{:.1}, {:.1}", mean(&of), max(&of)) }
    };
    let turned = felt(0, |one| one.turned_deg);
    let weights: Vec<f64> = rows.iter().filter_map(|row| row.weight_n).collect();
    let stopped = rows.iter().filter(|row| row.stopped_by.is_some()).count();
    vec![
        first.config.clone(),
        first.arm.to_string(),
        first.curve.to_string(),
        errors(0),
        if turned.is_empty() { absent() } else { format!("{:.1}", max(&turned)) },
        errors(3),
        if weights.is_empty() { absent() } else { format!("{:.2}", max(&weights)) },
        format!("{stopped} of {}", rows.len()),
    ]
}

fn absent() -> String {
    "–".to_owned()
}

fn mean(values: &[f64]) -> f64 {
    let count = u32::try_from(values.len().max(1)).unwrap_or(u32::MAX);
    values.iter().sum::<f64>() / f64::from(count)
}

fn max(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// Returns the errors of every joint and seed, one line each, in percent of the range.
pub(super) fn joints_csv(rows: &[Row]) -> String {
    let mut text =
        "configuration,joint,seed,unit,range,friction,line_rms,line_max,line_rising,line_falling,\
        polynomial_rms,polynomial_max,polynomial_rising,polynomial_falling\n"
            .to_owned();
    let of = |error: &TorqueError| {
        let TorqueError { rms, max, rising, falling } = error;
        format!("{rms:.6},{max:.6},{rising:.6},{falling:.6}")
    };
    for row in rows {
        let Row { config, joint, seed, is_force, range, friction, line, polynomial } = row;
        let unit = if *is_force { "N" } else { "N·m" };
        let (line, polynomial) = (of(line), of(polynomial));
        _ = writeln!(
            text,
            "{config},{joint},{seed},{unit},{range:.6},{friction:.6},{line},{polynomial}"
        );
    }
    text
}

/// Returns every test force of every run, one line each.
pub(super) fn test_forces_csv(rows: &[test_force::Row]) -> String {
    let mut text =
        "configuration,arm,curve,seed,along,size_percent,turned_deg,error_percent,weight_n,stopped_by\n"
            .to_owned();
    let along = ["x", "y", "z", "about x", "about y", "about z"];
    for row in rows {
        let test_force::Row { config, arm, curve, seed, weight_n, stopped_by, .. } = row;
        let weight = weight_n.map_or_else(String::new, |weight| format!("{weight:.6}"));
        let cause = stopped_by.as_deref().unwrap_or_default().replace(',', ";");
        for (along, feeling) in along.iter().zip(&row.felt) {
            let numbers = feeling.map_or_else(
                || ",,".to_owned(),
                |Feeling { size_percent, turned_deg, error_percent }| {
                    format!("{size_percent:.6},{turned_deg:.6},{error_percent:.6}")
                },
            );
            _ = writeln!(text, "{config},{arm},{curve},{seed},{along},{numbers},{weight},{cause}");
        }
    }
    text
}

/// Returns the panel of a joint: target over torque, as in Fig. 6.
pub(super) fn panel(config: &str, joint: &JointParameters, bench: &Bench) -> Panel {
    let end = bench.truth.max_torque();
    let curve = |curve: &TorqueCurve| {
        let torques = (-POINTS..=POINTS).map(|step| end * f64::from(step) / f64::from(POINTS));
        torques.map(|torque| [torque, curve.at(torque)]).collect()
    };
    let marks = |direction: Direction| {
        let samples = bench.samples.iter().filter(|sample| sample.direction == direction);
        samples.map(|sample| [sample.torque, bench.target(sample)]).collect()
    };
    Panel {
        title: format!("{config}, {}", joint.name),
        axes: ["joint torque, N·m or N", "target torque, ‰ of rated"],
        places: Vec::new(),
        series: vec![
            Series::new("polynomial", Ink::Line, curve(&bench.fitted)),
            Series::new("maker's line", Ink::Dashed, curve(&bench.line)),
            Series::new("measured, rising", Ink::Marks, marks(Direction::Up)),
            Series::new("measured, falling", Ink::Marks, marks(Direction::Down)),
        ],
    }
}
