//! Tables, CSV and picture of the torque curves.

use crate::command::table::{self, Column, Table};
use crate::pool;
use crate::torque_curves::calibration::{CurveErrors, JointCurves};
use crate::torque_curves::test_force::{ForceError, TEST_FORCE, TEST_MOMENT, TestForceResult};
use calibration::fit::Direction;
use config::JointParameters;
use controller::calibration::TorqueCurve;
use picture::{Ink, Panel, Series};

/// Names of the columns of joints.csv.
const JOINTS_HEAD: &str = "configuration,joint,seed,unit,range_n_or_nm,friction_n_or_nm,line_rms_percent,line_max_percent,\
line_rising_percent,line_falling_percent,polynomial_rms_percent,polynomial_max_percent,polynomial_rising_percent,\
polynomial_falling_percent";

/// Names of the columns of test_forces.csv.
const TEST_FORCES_HEAD: &str =
    "configuration,arm,curve,seed,along,size_percent,turned_deg,error_percent,weight_n,stopped_by";

/// Meaning of the columns of the joints.
const JOINTS_NOTE: &str = "error of the joint torque that a target makes, in percent of the range: rms and max over the range without friction; \
rising, falling: rms of the load cell's readings in that driving direction, friction included; the worst seed";

/// Number of points of a drawn curve.
const POINTS: i32 = 60;

/// Rows that differ in the seed alone: the first row, and all rows.
type Seeds<'r, R> = (&'r R, Vec<&'r R>);

/// Groups rows for which `is_same` is true, in the order of the first row of each group.
fn by_seeds<R>(rows: &[R], is_same: impl Fn(&R, &R) -> bool) -> Vec<Seeds<'_, R>> {
    let mut groups: Vec<Seeds<'_, R>> = Vec::new();
    for row in rows {
        match groups.iter_mut().find(|(first, _)| is_same(first, row)) {
            Some((_, group)) => group.push(row),
            None => groups.push((row, vec![row])),
        }
    }
    groups
}

/// Returns the table of the joints: the worst of all seeds.
pub(super) fn joints(rows: &[CurveErrors]) -> Table {
    let is_same = |a: &CurveErrors, b: &CurveErrors| (&a.config, &a.joint) == (&b.config, &b.joint);
    let columns: [Column<Seeds<'_, CurveErrors>>; 9] = [
        ("configuration", |(first, _)| first.config.clone()),
        ("joint", |(first, _)| first.joint.clone()),
        ("range", |(first, _)| format!("{:.1} {}", first.range, first.unit())),
        ("friction", |(first, rows)| {
            format!("{:.3} {}", worst(rows, |row| row.friction), first.unit())
        }),
        ("line: rms, max, %", |(_, rows)| pair(rows, 1, |row| [row.line.rms, row.line.max])),
        ("rising, falling, %", |(_, rows)| {
            pair(rows, 1, |row| [row.line.rising, row.line.falling])
        }),
        ("polynomial: rms, max, %", |(_, rows)| {
            pair(rows, 2, |row| [row.polynomial.rms, row.polynomial.max])
        }),
        ("rising, falling, %", |(_, rows)| {
            pair(rows, 1, |row| [row.polynomial.rising, row.polynomial.falling])
        }),
        ("seeds", |(_, rows)| rows.len().to_string()),
    ];
    Table::new(by_seeds(rows, is_same), columns, JOINTS_NOTE)
}

impl CurveErrors {
    const fn unit(&self) -> &'static str {
        if self.is_force { "N" } else { "N·m" }
    }
}

fn worst(rows: &[&CurveErrors], of: impl Fn(&CurveErrors) -> f64) -> f64 {
    pool::max(rows.iter().map(|row| of(row)))
}

/// Returns the maximum of each of two errors, as `1.0, 2.0`.
fn pair(rows: &[&CurveErrors], digits: usize, of: fn(&CurveErrors) -> [f64; 2]) -> String {
    let (a, b) = (worst(rows, |row| of(row)[0]), worst(rows, |row| of(row)[1]));
    format!("{a:.digits$}, {b:.digits$}")
}

/// Returns the table of the test forces: all seeds together.
pub(super) fn test_forces(rows: &[TestForceResult]) -> Table {
    let is_same = |a: &TestForceResult, b: &TestForceResult| {
        (&a.config, a.arm, a.curve) == (&b.config, b.arm, b.curve)
    };
    let columns: [Column<Seeds<'_, TestForceResult>>; 8] = [
        ("configuration", |(first, _)| first.config.clone()),
        ("arm", |(first, _)| first.arm.to_string()),
        ("curve", |(first, _)| first.curve.to_string()),
        ("error of forces, mean, max, %", |(_, rows)| errors(rows, 0)),
        ("turned, max, °", |(_, rows)| {
            some(&felt(rows, 0, |one| one.turned_deg), |of| {
                format!("{:.1}", pool::max(of.iter().copied()))
            })
        }),
        ("error of moments, mean, max, %", |(_, rows)| errors(rows, 3)),
        ("weight on the hand, N", |(_, rows)| {
            let weights: Vec<f64> = rows.iter().filter_map(|row| row.weight_n).collect();
            some(&weights, |of| format!("{:.2}", pool::max(of.iter().copied())))
        }),
        ("stopped", |(_, rows)| {
            let stopped = rows.iter().filter(|row| row.stopped_by.is_some()).count();
            format!("{stopped} of {}", rows.len())
        }),
    ];
    let note = format!(
        "a hand at rest feels {TEST_FORCE} N along x, y and z, or {TEST_MOMENT} N·m about them: size of the difference to the wanted \
         force or moment, all seeds; weight: force on the hand without a test force, the worst seed; stopped: runs that the node stopped"
    );
    Table::new(by_seeds(rows, is_same), columns, note)
}

/// Returns a figure of the test forces `from` to `from + 2`, of all seeds.
fn felt(rows: &[&TestForceResult], from: usize, of: fn(&ForceError) -> f64) -> Vec<f64> {
    let parts = rows.iter().flat_map(|row| row.felt.iter().skip(from).take(3));
    parts.flatten().map(of).collect()
}

fn errors(rows: &[&TestForceResult], from: usize) -> String {
    some(&felt(rows, from, |one| one.error_percent), |of| {
        format!("{:.1}, {:.1}", pool::mean(of.iter().copied()), pool::max(of.iter().copied()))
    })
}

fn some(values: &[f64], text: fn(&[f64]) -> String) -> String {
    if values.is_empty() { "–".to_owned() } else { text(values) }
}

/// Returns the CSV of the joints' errors in percent of the range, one line for each joint and seed.
pub(super) fn joints_csv(rows: &[CurveErrors]) -> anyhow::Result<String> {
    let row = |row: &CurveErrors| {
        let CurveErrors { config, joint, seed, range, friction, line, polynomial, .. } =
            row.clone();
        (config, joint, seed, row.unit(), [range, friction], line, polynomial)
    };
    table::csv(JOINTS_HEAD, rows.iter().map(row))
}

/// Returns the CSV of the test forces, one line for each force of each run.
pub(super) fn test_forces_csv(rows: &[TestForceResult]) -> anyhow::Result<String> {
    let along = ["x", "y", "z", "about x", "about y", "about z"];
    let each = rows.iter().flat_map(|row| along.iter().zip(&row.felt).map(move |one| (row, one)));
    let fields =
        |(row, (along, felt)): (&TestForceResult, (&&'static str, &Option<ForceError>))| {
            let TestForceResult { config, arm, curve, seed, weight_n, stopped_by, .. } =
                row.clone();
            let felt =
                felt.map(|one| [one.size_percent, one.turned_deg, one.error_percent].map(Some));
            let (arm, curve, felt) = (arm.to_string(), curve.to_string(), felt.unwrap_or_default());
            (config, arm, curve, seed, *along, felt, weight_n, stopped_by)
        };
    table::csv(TEST_FORCES_HEAD, each.map(fields))
}

/// Returns the panel of a joint: target over torque, as in Fig. 6.
pub(super) fn panel(config: &str, joint: &JointParameters, curves: &JointCurves) -> Panel {
    let end = curves.truth.max_torque();
    let curve = |curve: &TorqueCurve| {
        let torques = (-POINTS..=POINTS).map(|step| end * f64::from(step) / f64::from(POINTS));
        torques.map(|torque| [torque, curve.at(torque)]).collect::<Vec<_>>()
    };
    let marks = |direction: Direction| {
        let samples = curves.samples.iter().filter(|sample| sample.direction == direction);
        samples.map(|sample| [sample.torque, curves.target(sample)]).collect::<Vec<_>>()
    };
    let series = [
        Series::new("polynomial", Ink::Line, curve(&curves.fitted)),
        Series::new("maker's line", Ink::Dashed, curve(&curves.line)),
        Series::new("measured, rising", Ink::Marks, marks(Direction::Up)),
        Series::new("measured, falling", Ink::Marks, marks(Direction::Down)),
    ];
    let axes = ["joint torque, N·m or N", "target torque, ‰ of rated"];
    Panel::new(format!("{config}, {}", joint.name), axes, series)
}
