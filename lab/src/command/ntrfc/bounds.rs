//! Bounds of force accommodation: courses with gains 10 % below and 10 % above each.

use crate::command::table::{self, Column, Table};
use crate::contact_bounds::{Bound, Course, CourseResult, Model};
use config::robots::RobotArm;

/// Names of the columns of bounds.csv; only the sampled bound has a delay.
const HEAD: &str = "arm,bound,delay_cycles,model,share,figure,is_calm";

/// Meaning of the columns of the table.
const NOTE: &str = "share: gain over that at the bound; back: largest speed backwards over the largest speed, from rest at the wall; per cycle: \
growth of a disturbance of the rest";

/// Gains as shares of the bound.
const SHARES: [f64; 2] = [0.9, 1.1];

/// Bounds in contact: that of the servo, and that of the sampled loop with a force delayed by 0, 1 and 2 cycles.
const BOUNDS: [Bound; 4] = [Bound::Servo, Bound::Sampled(0), Bound::Sampled(1), Bound::Sampled(2)];

/// Returns all courses of each arm.
pub(super) fn jobs(robots: &[RobotArm]) -> Vec<(&RobotArm, Course)> {
    let models = [Model::Kinematic, Model::Simulated];
    let courses = BOUNDS.into_iter().flat_map(|bound| models.map(|model| (bound, model)));
    let courses = courses.chain([(Bound::Payload { is_removed: false }, Model::SimulatedMean)]);
    let courses =
        courses.flat_map(|(bound, model)| SHARES.map(|share| Course { bound, model, share }));
    let courses: Vec<Course> = courses.collect();
    robots.iter().flat_map(|arm| courses.iter().map(move |course| (arm, *course))).collect()
}

/// Returns the table of the courses.
pub(super) fn table(rows: &[CourseResult]) -> Table {
    let columns: [Column<&CourseResult>; 6] = [
        ("arm", |row| row.arm.clone()),
        ("bound", |row| match row.bound {
            Bound::Servo => "K_FA k_e τ_s ≤ 1/4".to_owned(),
            Bound::Sampled(n) => format!("K_FA k_e T < 2 cos({n} π/{})", 2 * n + 1),
            Bound::Payload { .. } => "K_FA m < T/2 coth(T/2τ_s)".to_owned(),
        }),
        ("model", |row| model(row.model).to_owned()),
        ("share", |row| format!("{:.1}", row.share)),
        ("measured", |row| match row.bound {
            Bound::Servo => format!("{:.1e} back", row.figure),
            Bound::Sampled(_) | Bound::Payload { .. } => format!("{:.3} per cycle", row.figure),
        }),
        ("end", |row| {
            let ends = match row.bound {
                Bound::Servo => ("turns back", "comes to rest"),
                Bound::Sampled(_) | Bound::Payload { .. } => ("grows", "dies out"),
            };
            if row.is_calm { ends.1 } else { ends.0 }.to_owned()
        }),
    ];
    Table::new(rows, columns, NOTE).below("bounds of accommodation")
}

/// Returns the courses as CSV.
pub(super) fn csv(rows: &[CourseResult]) -> anyhow::Result<String> {
    let row = |row: &CourseResult| {
        let (bound, delay) = match row.bound {
            Bound::Servo => ("servo", None),
            Bound::Sampled(delay) => ("sampled", Some(delay)),
            Bound::Payload { .. } => ("payload", None),
        };
        (row.arm.clone(), bound, delay, model(row.model), row.share, row.figure, row.is_calm)
    };
    table::csv(HEAD, rows.iter().map(row))
}

/// Returns the reason to fail: a course that oscillates within its bound, or is calm beyond it.
pub(super) fn gate(rows: &[CourseResult]) -> Option<String> {
    let wrong = rows.iter().find(|row| row.is_calm != (row.share < 1.0))?;
    let CourseResult { arm, bound, model: of, share, is_calm, .. } = wrong;
    let found = if *is_calm { "is calm" } else { "oscillates" };
    Some(format!("{arm}, {} model, {bound:?}: {found} at {share} of the bound", model(*of)))
}

const fn model(model: Model) -> &'static str {
    match model {
        Model::Kinematic => "kinematic",
        Model::Simulated => "simulated",
        Model::SimulatedMean => "simulated, mean",
    }
}
