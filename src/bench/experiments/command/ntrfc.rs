//! `frhc experiment ntrfc`: rate commands that become forces in contact, and the approach before (section 4.3 of the paper).

mod bounds;

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::command::common::{Results, Robots};
use crate::command::picture::{self, Ink, Panel, Series};
use crate::command::runner;
use crate::command::table::{self, Table};
use crate::contact_bounds;
use crate::ntrfc::{Press, Row};
use config::Config;
use run::exit::{Failure, Kind, OrFail};

/// Files of the results.
const FILES: [&str; 5] = ["presses.csv", "bounds.csv", "figures.json", "force.svg", "report.md"];

/// Commanded rates, in m/s.
const SPEEDS: [f64; 6] = [0.01, 0.02, 0.03, 0.04, 0.06, 0.08];

/// Commanded rates with a deadband of the accommodation, in m/s, and that deadband, in N.
const DEADBAND_SPEEDS: [f64; 4] = [-0.06, -0.02, 0.02, 0.06];
const DEADBAND: f64 = 2.0;

/// K_FA k_e τ_s above which the arm turns back at the wall.
const MAX_SHARE: f64 = 0.25;

/// K_FA k_e τ_s, on both sides of that bound.
const SHARES: [f64; 6] = [0.1, 0.225, 0.275, 0.5, 1.0, 2.0];

/// K_FA in m/s per N, stiffness in N/m.
const PRESS: Press = Press {
    speed: 0.02,
    accommodation: 0.002,
    deadband: 0.0,
    stiffness: 10_000.0,
    noise: 0.0,
    bias: 0.0,
    seed: 1,
};

/// Noise and bias of a sensor that is not ideal, in N.
const NOISE: f64 = 0.2;
const BIAS: f64 = 1.0;

/// Largest difference from the law, as a share of it.
const TOLERANCE: f64 = 0.01;

/// `frhc experiment ntrfc`.
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
    /// Ideal sensor.
    Ideal,
    /// Sensor with noise and bias.
    Biased,
    /// Ideal sensor, deadband of the accommodation.
    Deadband,
    /// Over K_FA k_e τ_s.
    Gain,
}

/// Everything that was measured.
#[derive(Serialize)]
struct Measured {
    presses: Vec<Figure>,
    bounds: Vec<contact_bounds::Row>,
}

/// A press with its part.
#[derive(Serialize)]
struct Figure {
    part: Part,
    #[serde(flatten)]
    row: Row,
}

/// Plays everything, prints the tables and writes the files.
pub(super) fn run(args: &Arguments, is_quiet: bool) -> Result<(), Failure> {
    let config = Config::load(&args.config).or_fail(Kind::Configuration)?;
    if config.remote.wall.is_none() {
        let reason = format!("{}: {}", args.config.display(), crate::ntrfc::NoPress::NoWall);
        return Err(Failure::new(Kind::Configuration, reason));
    }
    let robots = args.robots.load()?;
    args.results.ensure_free(&FILES)?;
    let presses = presses(args, config.remote.servo.time_constant());
    let jobs: Vec<_> =
        robots.iter().flat_map(|arm| presses.iter().map(move |press| (arm, *press))).collect();
    let figures = runner::play_all(&jobs, is_quiet, |(arm, (part, press))| {
        let row = press.play(&config, arm).or_fail(Kind::Configuration)?;
        Ok(Figure { part: *part, row })
    });
    let figures = figures.into_iter().collect::<Result<Vec<Figure>, Failure>>()?;
    let bounds = bounds::play(&config, &robots, is_quiet)?;
    let measured = Measured { presses: figures, bounds };
    let Measured { presses: figures, bounds } = &measured;
    let tables = [forces(figures), gains(figures), bounds::table(bounds)];
    args.results.print(&measured, &tables)?;
    args.results.write(|| {
        let picture = picture::svg(&panels(figures), 2).or_fail(Kind::Bus)?;
        let json = serde_json::to_string_pretty(&measured).or_fail(Kind::Bus)?;
        let bounds = bounds::csv(bounds);
        let contents = [csv(figures), bounds, json, picture, table::markdown(&tables)];
        Ok(FILES.into_iter().zip(contents).collect())
    })?;
    judge(figures)?;
    bounds::judge(bounds)
}

/// Returns the presses of each arm.
fn presses(args: &Arguments, lag: f64) -> Vec<(Part, Press)> {
    let seed = args.results.seed;
    let every = if args.results.short { 3 } else { 1 };
    let speeds = SPEEDS.into_iter().step_by(every).flat_map(|speed| {
        let ideal = Press { speed, seed, ..PRESS };
        [(Part::Ideal, ideal), (Part::Biased, Press { noise: NOISE, bias: BIAS, ..ideal })]
    });
    let gains = SHARES.into_iter().step_by(every).map(|share| {
        let accommodation = share / (PRESS.stiffness * lag.max(1e-4));
        // The same force at rest for every gain.
        let speed = 10.0 * accommodation;
        (Part::Gain, Press { accommodation, speed, seed, ..PRESS })
    });
    let deadband = DEADBAND_SPEEDS
        .into_iter()
        .step_by(every)
        .map(|speed| (Part::Deadband, Press { speed, deadband: DEADBAND, seed, ..PRESS }));
    speeds.chain(deadband).chain(gains).collect()
}

fn forces(figures: &[Figure]) -> Table {
    let of = figures.iter().filter(|figure| figure.part != Part::Gain);
    let row = |figure: &Figure| {
        let Row { arm, speed_m_per_s, deadband_n, bias_n, law_n, rest_n, peak_n, .. } = &figure.row;
        vec![
            arm.clone(),
            format!("{:.0}", 1e3 * speed_m_per_s),
            format!("{deadband_n:.1}"),
            format!("{bias_n:.1}"),
            format!("{law_n:.2}"),
            format!("{rest_n:.2}"),
            format!("{:+.2}", 100.0 * figure.row.error()),
            format!("{peak_n:.1}"),
        ]
    };
    Table {
        lead: Some("rate against contact force".to_owned()),
        columns: vec![
            "arm",
            "rate, mm/s",
            "deadband, N",
            "bias, N",
            "law, N",
            "at rest, N",
            "error, %",
            "peak, N",
        ],
        rows: of.map(row).collect(),
        note: "law: K_FA⁻¹ v + sign F_db; at rest: force of the tool on the wall, mean of the last second; error: difference from the law and the sensor's bias; peak: at the approach"
            .to_owned(),
    }
}

fn gains(figures: &[Figure]) -> Table {
    let of = figures.iter().filter(|figure| figure.part == Part::Gain);
    let row = |Figure { row, .. }: &Figure| {
        vec![
            row.arm.clone(),
            format!("{:.3}", row.servo_share),
            format!("{:.0}", 1e3 * row.speed_m_per_s),
            format!("{:.1}", row.rest_n),
            format!("{:.0}", 100.0 * row.overshoot()),
            format!("{:.2}", 1e3 * row.unrest_m_per_s),
            if row.is_calm() { "calm" } else { "oscillates" }.to_owned(),
        ]
    };
    Table {
        lead: Some("approach over the gain".to_owned()),
        columns: vec![
            "arm",
            "K_FA k_e τ_s",
            "approach, mm/s",
            "at rest, N",
            "overshoot, %",
            "unrest, mm/s",
            "end",
        ],
        rows: of.map(row).collect(),
        note: "frhc check warns above 0.25; unrest: RMS speed of the tool in the last second"
            .to_owned(),
    }
}

/// Returns the force at rest over the rate, and the peak over it.
fn panels(figures: &[Figure]) -> Vec<Panel> {
    let mut arms: Vec<&str> = figures.iter().map(|figure| figure.row.arm.as_str()).collect();
    arms.dedup();
    let curve = |arm: &str, part: Part, value: fn(&Row) -> f64| {
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
    vec![
        Panel {
            title: "force at rest over the commanded rate".to_owned(),
            axes: ["mm/s", "N"],
            places: Vec::new(),
            series: law.into_iter().chain(rest).collect(),
        },
        Panel {
            title: "largest force over the approach speed, the same force at rest".to_owned(),
            axes: ["mm/s", "N"],
            places: Vec::new(),
            series: peak.chain(bound).collect(),
        },
    ]
}

fn csv(figures: &[Figure]) -> String {
    let mut text = "part,arm,speed_m_per_s,accommodation_m_per_ns,servo_share,deadband_n,bias_n,law_n,rest_n,peak_n,unrest_m_per_s\n".to_owned();
    for Figure { part, row } in figures {
        let part = match part {
            Part::Ideal => "ideal",
            Part::Biased => "biased",
            Part::Deadband => "deadband",
            Part::Gain => "gain",
        };
        let numbers = [
            row.speed_m_per_s,
            row.accommodation_m_per_ns,
            row.servo_share,
            row.deadband_n,
            row.bias_n,
            row.law_n,
            row.rest_n,
            row.peak_n,
            row.unrest_m_per_s,
        ];
        let numbers = numbers.map(|number| format!("{number:.9e}")).join(",");
        _ = writeln!(text, "{part},{},{numbers}", row.arm.replace(',', ";"));
    }
    text
}

/// Refuses forces that are not those of the law, and a gain within its bound that oscillates.
fn judge(figures: &[Figure]) -> Result<(), Failure> {
    let wrong = figures.iter().find(|Figure { part, row }| match part {
        Part::Ideal | Part::Biased | Part::Deadband => row.error().abs() > TOLERANCE,
        Part::Gain => row.servo_share < MAX_SHARE && !row.is_calm(),
    });
    let Some(Figure { row, .. }) = wrong else { return Ok(()) };
    let Row { arm, speed_m_per_s, law_n, rest_n, servo_share, .. } = row;
    let reason = format!(
        "{arm}, {speed_m_per_s:.3} m/s, K_FA k_e τ_s = {servo_share:.3}: {rest_n:.2} N at rest, law {law_n:.2} N"
    );
    Err(Failure::new(Kind::Negative, reason))
}
