//! The bounds of accommodation: courses with gains 10 % inside and 10 % outside of each.

use std::fmt::Write;

use crate::command::runner;
use crate::command::table::Table;
use crate::contact_bounds::{Bound, Course, Model, Row};
use config::Config;
use config::robots::RobotArm;
use run::exit::{Failure, Kind, OrFail};

/// Gains as shares of the bound.
const SHARES: [f64; 2] = [0.9, 1.1];

/// Bounds in contact: the servo's, and that of the sampled loop over the cycles by which the force is late.
const BOUNDS: [Bound; 4] = [Bound::Servo, Bound::Sampled(0), Bound::Sampled(1), Bound::Sampled(2)];

/// Plays all courses of each arm.
pub(super) fn play(
    config: &Config,
    robots: &[RobotArm],
    is_quiet: bool,
) -> Result<Vec<Row>, Failure> {
    let models = [Model::Kinematic, Model::Simulated];
    let courses = BOUNDS.into_iter().flat_map(|bound| models.map(|model| (bound, model)));
    let courses = courses.chain([(Bound::Payload { is_removed: false }, Model::SimulatedMean)]);
    let courses =
        courses.flat_map(|(bound, model)| SHARES.map(|share| Course { bound, model, share }));
    let courses: Vec<Course> = courses.collect();
    let jobs: Vec<_> =
        robots.iter().flat_map(|arm| courses.iter().map(move |course| (arm, *course))).collect();
    let rows = runner::play_all(&jobs, is_quiet, |(arm, course)| {
        course.play(config, arm).or_fail(Kind::Configuration)
    });
    rows.into_iter().collect()
}

/// Returns the table of the courses.
pub(super) fn table(rows: &[Row]) -> Table {
    let row = |row: &Row| {
        let (symbols, figure, [calm, not_calm]) = match row.bound {
            Bound::Servo => (
                "K_FA k_e τ_s ≤ 1/4".to_owned(),
                format!("{:.1e} back", row.figure),
                ["comes to rest", "turns back"],
            ),
            Bound::Sampled(n) => (
                format!("K_FA k_e T < 2 cos({n} π/{})", 2 * n + 1),
                format!("{:.3} per cycle", row.figure),
                ["dies out", "grows"],
            ),
            Bound::Payload { .. } => (
                "K_FA m < T/2 coth(T/2τ_s)".to_owned(),
                format!("{:.3} per cycle", row.figure),
                ["dies out", "grows"],
            ),
        };
        vec![
            row.arm.clone(),
            symbols,
            model(row.model).to_owned(),
            format!("{:.1}", row.share),
            figure,
            if row.is_calm { calm } else { not_calm }.to_owned(),
        ]
    };
    Table {
        lead: Some("bounds of accommodation".to_owned()),
        columns: vec!["arm", "bound", "model", "share", "measured", "end"],
        rows: rows.iter().map(row).collect(),
        note: "share: gain over that at the bound; back: largest speed backwards over the largest speed, from rest at the wall; per cycle: growth of a \
               disturbance of the rest"
            .to_owned(),
    }
}

/// Returns the courses as CSV; the delay is empty but for the sampled bound.
pub(super) fn csv(rows: &[Row]) -> String {
    let mut text = "arm,bound,delay_cycles,model,share,figure,is_calm\n".to_owned();
    for Row { arm, bound, model: of, share, figure, is_calm } in rows {
        let bound = match bound {
            Bound::Servo => "servo,".to_owned(),
            Bound::Sampled(delay) => format!("sampled,{delay}"),
            Bound::Payload { .. } => "payload,".to_owned(),
        };
        let (arm, model) = (arm.replace(',', ";"), model(*of));
        _ = writeln!(text, "{arm},{bound},{model},{share},{figure:.9e},{is_calm}");
    }
    text
}

/// Refuses a course that oscillates within its bound, or is calm beyond it.
pub(super) fn judge(rows: &[Row]) -> Result<(), Failure> {
    let wrong = rows.iter().find(|row| row.is_calm != (row.share < 1.0));
    let Some(Row { arm, bound, model: of, share, is_calm, .. }) = wrong else { return Ok(()) };
    let found = if *is_calm { "is calm" } else { "oscillates" };
    let reason = format!("{arm}, {} model, {bound:?}: {found} at {share} of the bound", model(*of));
    Err(Failure::new(Kind::Negative, reason))
}

const fn model(model: Model) -> &'static str {
    match model {
        Model::Kinematic => "kinematic",
        Model::Simulated => "simulated",
        Model::SimulatedMean => "simulated, mean",
    }
}
