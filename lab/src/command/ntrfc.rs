//! `frhc-lab experiment ntrfc`: rate commands that become forces in contact (section 4.3 of the paper), and the impact.

mod bounds;

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::command::common::{Results, Robots, refused};
use crate::command::frame::{Files, Frame, Report};
use crate::command::table::{self, Column, Table};
use crate::contact_bounds::CourseResult;
use crate::no_trial::NoTrial;
use crate::ntrfc::{Press, PressResult};
use config::Config;
use picture::{Ink, Panel, Series};
use run::check::refuse_far_side;
use run::exit::{Failure, Kind, OrFail};

/// Files of the results.
const FILES: Files =
    Files { csv: &["presses.csv", "bounds.csv"], has_figures: true, picture: ("force.svg", 2) };

/// Names of the columns of presses.csv.
const HEAD: &str = "part,arm,speed_m_per_s,accommodation_m_per_ns,servo_share,deadband_n,bias_n,law_n,rest_n,peak_n,unrest_m_per_s";

/// Meaning of the columns of the forces, and of the gains.
const FORCES_NOTE: &str = "law: K_FA⁻¹ v + sign F_db; at rest: force of the tool on the wall, mean of the last second; error: difference from the \
law and the sensor's bias; peak: at the approach";
const GAINS_NOTE: &str =
    "frhc check warns above 0.25; unrest: RMS speed of the tool in the last second";

/// Commanded rates, in m/s.
const SPEEDS: [f64; 6] = [0.01, 0.02, 0.03, 0.04, 0.06, 0.08];

/// Commanded rates with a deadband of the accommodation, in m/s, and that deadband, in N.
const DEADBAND_SPEEDS: [f64; 4] = [-0.06, -0.02, 0.02, 0.06];
const DEADBAND: f64 = 2.0;

/// K_FA k_e τ_s above which the arm turns back at the wall.
const MAX_SHARE: f64 = 0.25;

/// Values of K_FA k_e τ_s, on both sides of [`MAX_SHARE`].
const SHARES: [f64; 6] = [0.1, 0.225, 0.275, 0.5, 1.0, 2.0];

/// Noise and bias of the sensor in [`Part::Biased`], in N.
const NOISE: f64 = 0.2;
const BIAS: f64 = 1.0;

/// Maximum difference from the law, as a share of it.
const TOLERANCE: f64 = 0.01;

/// `frhc-lab experiment ntrfc`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Configuration with the wall and the servo's lag.
    #[arg(short, long, value_name = "FILE", default_value = "config/kraft_like.toml")]
    config: PathBuf,
    #[command(flatten)]
    robots: Robots,
    #[command(flatten)]
    results: Results,
}

/// Part of the experiment that a press belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Part {
    /// Ideal sensor, no deadband.
    Ideal,
    /// Sensor with noise and bias.
    Biased,
    /// Ideal sensor, deadband of the accommodation.
    Deadband,
    /// Gains on both sides of the servo's bound.
    Gain,
}

/// Results of the experiment.
#[derive(Serialize)]
struct Figures {
    presses: Vec<Figure>,
    bounds: Vec<CourseResult>,
}

/// Press with its part.
#[derive(Serialize)]
struct Figure {
    part: Part,
    #[serde(flatten)]
    row: PressResult,
}

/// Runs the experiment, prints the tables and writes the files.
pub(super) fn run(args: &Arguments, is_quiet: bool) -> Result<(), Failure> {
    let config = Config::load(&args.config).or_fail(Kind::Configuration)?;
    refuse_far_side(&config, "experiment")?;
    if config.remote.wall.is_none() {
        return Err(refused(&args.config, NoTrial::NoWall));
    }
    let robots = args.robots.load()?;
    let frame = Frame::new(&args.results, &FILES, is_quiet)?;
    let presses = presses(args, config.remote.servo.time_constant());
    let jobs: Vec<_> =
        robots.iter().flat_map(|arm| presses.iter().map(move |press| (arm, *press))).collect();
    let presses = frame.play(&jobs, |(arm, (part, press))| {
        press.play(&config, arm).or_fail(Kind::Configuration).map(|row| Figure { part: *part, row })
    })?;
    let bounds = frame.play(&bounds::jobs(&robots), |(arm, course)| {
        course.play(&config, arm).or_fail(Kind::Configuration)
    })?;
    let figures = Figures { presses, bounds };
    let Figures { presses, bounds } = &figures;
    frame.conclude(Report {
        figures: &figures,
        tables: vec![forces(presses), gains(presses), bounds::table(bounds)],
        csv: vec![
            table::csv(HEAD, presses.iter().map(|Figure { part, row }| (part, row))),
            bounds::csv(bounds),
        ],
        panels: || Ok(panels(presses)),
        gate: gate(presses).or_else(|| bounds::gate(bounds)),
    })
}

/// Returns the presses of each arm.
fn presses(args: &Arguments, lag: f64) -> Vec<(Part, Press)> {
    let seed = args.results.seed;
    let every = if args.results.short { 3 } else { 1 };
    let speeds = SPEEDS.into_iter().step_by(every).flat_map(|speed| {
        let ideal = Press { speed, seed, ..Press::IDEAL };
        [(Part::Ideal, ideal), (Part::Biased, Press { noise: NOISE, bias: BIAS, ..ideal })]
    });
    let gains = SHARES.into_iter().step_by(every).map(|share| {
        let accommodation = share / (Press::IDEAL.stiffness * lag.max(1e-4));
        // The same force at rest for every gain.
        let speed = 10.0 * accommodation;
        (Part::Gain, Press { accommodation, speed, seed, ..Press::IDEAL })
    });
    let deadband = DEADBAND_SPEEDS
        .into_iter()
        .step_by(every)
        .map(|speed| (Part::Deadband, Press { speed, deadband: DEADBAND, seed, ..Press::IDEAL }));
    speeds.chain(deadband).chain(gains).collect()
}

fn forces(figures: &[Figure]) -> Table {
    let of = figures.iter().filter(|figure| figure.part != Part::Gain);
    let columns: [Column<&PressResult>; 8] = [
        ("arm", |row| row.arm.clone()),
        ("rate, mm/s", |row| format!("{:.0}", 1e3 * row.speed_m_per_s)),
        ("deadband, N", |row| format!("{:.1}", row.deadband_n)),
        ("bias, N", |row| format!("{:.1}", row.bias_n)),
        ("law, N", |row| format!("{:.2}", row.law_n)),
        ("at rest, N", |row| format!("{:.2}", row.rest_n)),
        ("error, %", |row| format!("{:+.2}", 100.0 * row.error())),
        ("peak, N", |row| format!("{:.1}", row.peak_n)),
    ];
    let rows = of.map(|figure| &figure.row);
    Table::new(rows, columns, FORCES_NOTE).below("rate against contact force")
}

fn gains(figures: &[Figure]) -> Table {
    let of = figures.iter().filter(|figure| figure.part == Part::Gain);
    let columns: [Column<&PressResult>; 7] = [
        ("arm", |row| row.arm.clone()),
        ("K_FA k_e τ_s", |row| format!("{:.3}", row.servo_share)),
        ("approach, mm/s", |row| format!("{:.0}", 1e3 * row.speed_m_per_s)),
        ("at rest, N", |row| format!("{:.1}", row.rest_n)),
        ("overshoot, %", |row| format!("{:.0}", 100.0 * row.overshoot())),
        ("unrest, mm/s", |row| format!("{:.2}", 1e3 * row.unrest_m_per_s)),
        ("end", |row| if row.is_calm() { "calm" } else { "oscillates" }.to_owned()),
    ];
    let rows = of.map(|figure| &figure.row);
    Table::new(rows, columns, GAINS_NOTE).below("approach over the gain")
}

/// Returns the panels: force at rest and peak force over the commanded rate.
fn panels(figures: &[Figure]) -> Vec<Panel> {
    let mut arms: Vec<&str> = figures.iter().map(|figure| figure.row.arm.as_str()).collect();
    arms.dedup();
    let curve = |arm: &str, part: Part, value: fn(&PressResult) -> f64| {
        let of = figures.iter().filter(|figure| figure.part == part && figure.row.arm == arm);
        of.map(|figure| [1e3 * figure.row.speed_m_per_s, value(&figure.row)]).collect::<Vec<_>>()
    };
    let law = arms
        .first()
        .map(|arm| Series::new("K_FA⁻¹ v", Ink::Dashed, curve(arm, Part::Ideal, |row| row.law_n)));
    let rest = arms.iter().flat_map(|arm| {
        let biased = format!("{arm}, bias {BIAS} N");
        [
            Series::new(*arm, Ink::Marks, curve(arm, Part::Ideal, |row| row.rest_n)),
            Series::new(biased, Ink::Marks, curve(arm, Part::Biased, |row| row.rest_n)),
        ]
    });
    let peak = arms
        .iter()
        .map(|arm| Series::new(*arm, Ink::Line, curve(arm, Part::Gain, |row| row.peak_n)));
    let mut gains = figures.iter().filter(|figure| figure.part == Part::Gain);
    let most = gains.clone().map(|figure| figure.row.peak_n).fold(0.0, f64::max);
    let bound = gains.next_back().map(|Figure { row, .. }| {
        let speed = 1e3 * row.speed_m_per_s * MAX_SHARE / row.servo_share;
        Series::new("K_FA k_e τ_s = 1/4", Ink::Dashed, vec![[speed, 0.0], [speed, most]])
    });
    let axes = ["mm/s", "N"];
    let approach = "largest force over the approach speed, the same force at rest";
    vec![
        Panel::new("force at rest over the commanded rate", axes, law.into_iter().chain(rest)),
        Panel::new(approach, axes, peak.chain(bound)),
    ]
}

/// Returns the reason to fail: a force that is not that of the law, or an oscillation at a gain within its bound.
fn gate(figures: &[Figure]) -> Option<String> {
    let Figure { row, .. } = figures.iter().find(|Figure { part, row }| match part {
        Part::Ideal | Part::Biased | Part::Deadband => row.error().abs() > TOLERANCE,
        Part::Gain => row.servo_share < MAX_SHARE && !row.is_calm(),
    })?;
    let PressResult { arm, speed_m_per_s, law_n, rest_n, servo_share, .. } = row;
    Some(format!(
        "{arm}, {speed_m_per_s:.3} m/s, K_FA k_e τ_s = {servo_share:.3}: {rest_n:.2} N at rest, law {law_n:.2} N"
    ))
}
