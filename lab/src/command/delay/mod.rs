//! `frhc-lab experiment delay`: contact over a link with delay, with and without the passivity layer.

mod report;

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::command::common::{Results, Robots, refused};
use crate::command::frame::{Files, Frame, Report};
use crate::delay::link::{self, LinkConditions};
use crate::delay::measurement::Outcome;
use crate::delay::script::CommandMode;
use crate::delay::trial::{self, Follower, Trial, TrialResult};
use crate::no_trial::NoTrial;
use config::Config;
use config::robots::RobotArm;
use run::check::{refuse_far_side, require_switch_box};
use run::exit::{Failure, Kind, OrFail};

/// Files of the results.
const FILES: Files = Files { csv: &["runs.csv"], has_figures: true, picture: ("map.svg", 2) };

/// Delays per direction, each with the maximum age of a sample, in ms.
const LINKS: [[f64; 2]; 6] =
    [[0.0, 20.0], [2.0, 20.0], [5.0, 20.0], [8.0, 20.0], [20.0, 100.0], [40.0, 100.0]];

/// Delays per direction, each with a maximum age that no sample can meet, in ms.
const HOPELESS: [[f64; 2]; 2] = [[12.0, 20.0], [60.0, 100.0]];

/// K_T along x of the map, in pose mode and in rate mode.
const POSE_GAINS: [f64; 10] = [0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.4, 2.0];
const RATE_GAINS: [f64; 10] = [0.3, 0.6, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0];

/// Gain of the runs with an accepted gain, as a share of the largest one.
const WITHIN: f64 = 0.999;

/// Start and end of the outage since the start of the node, in s, while the hand rests at the wall.
const OUTAGE_S: [f64; 2] = [8.0, 8.5];

/// Maximum duration of the end of reflection (stop S1) after the maximum age of a sample, in s.
const END_S: f64 = 0.05;

/// Periods of the node that the end of reflection may take in addition.
const END_PERIODS: f64 = 2.0;

/// `frhc-lab experiment delay`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Configuration with the wall, the gains and the passivity layer.
    #[arg(short, long, value_name = "FILE", default_value = "config/kraft_like.toml")]
    config: PathBuf,
    #[command(flatten)]
    robots: Robots,
    #[command(flatten)]
    results: Results,
}

/// Part of the experiment that a run belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Part {
    /// Largest gain that the gain check accepts.
    Accepted,
    /// Map over gain and delay, with the free object.
    Map,
    /// Links with jitter and loss, with every sample too old, or with an outage.
    Disturbed,
}

/// Run with its part.
#[derive(Debug, Serialize)]
struct Figure {
    part: Part,
    #[serde(flatten)]
    row: TrialResult,
}

/// Runs the experiment, prints the tables and writes the files.
pub(super) fn run(args: &Arguments, is_quiet: bool) -> Result<(), Failure> {
    let config = Config::load(&args.config).or_fail(Kind::Configuration)?;
    refuse_far_side(&config, "experiment")?;
    require_switch_box(&config)?;
    let extensions = &config.controller.extensions;
    if extensions.passivity.is_none() && extensions.tank.is_none() {
        let reason = "the experiment compares passivity layers: add [controller.passivity]";
        return Err(refused(&args.config, reason));
    }
    let refused = |reason: NoTrial| refused(&args.config, reason);
    trial::ensure_playable(&config).map_err(refused)?;
    let arms = args.robots.load()?;
    let frame = Frame::new(&args.results, &FILES, is_quiet)?;
    let trials = frame.prepare("largest accepted gains", || trials(args, &config, &arms))?;
    let figures = frame.play(&trials, |(part, trial)| {
        trial.play(&config).map(|row| Figure { part: *part, row }).map_err(refused)
    })?;
    frame.conclude(Report {
        figures: &figures,
        tables: report::tables(&figures),
        csv: vec![report::csv(&figures)],
        panels: || Ok(report::panels(&figures)),
        gate: gate(&figures, config.period.as_secs_f64()),
    })
}

/// Returns every run, in the order of the tables.
fn trials<'a>(args: &Arguments, config: &Config, arms: &'a [RobotArm]) -> Vec<(Part, Trial<'a>)> {
    let Results { seed, short, .. } = args.results;
    // Short: no delay, 8 ms and 40 ms; the object and one arm; one accepted and one refused gain.
    let is_played = |link: &LinkConditions| !short || [0.0, 8.0, 40.0].contains(&link.delay_ms);
    let links: Vec<LinkConditions> =
        LINKS.map(LinkConditions::new).into_iter().filter(is_played).collect();
    let every = if short { 5 } else { 1 };
    let arms = arms.iter().take(if short { 1 } else { usize::MAX }).map(Follower::Arm);
    let led: Vec<Follower<'a>> = [Follower::Object].into_iter().chain(arms).collect();
    let [k_t, ..] = *config.controller.reflection.gain().values();
    let usual = Trial {
        led: Follower::Object,
        link: LinkConditions::default(),
        commanded: CommandMode::Pose,
        k_t,
        has_layer: true,
        seed,
    };
    let accepted = links.iter().flat_map(|link| {
        let with_link = config.clone().with_link(link.settings(seed));
        let runs = led.iter().flat_map(|led| {
            let k_t = WITHIN * link::largest_accepted(&led.configure(&with_link));
            let trial = Trial { led: *led, link: *link, k_t, ..usual };
            [CommandMode::Pose, CommandMode::Rate].map(|commanded| Trial { commanded, ..trial })
        });
        runs.collect::<Vec<_>>()
    });
    let map = [(CommandMode::Pose, POSE_GAINS), (CommandMode::Rate, RATE_GAINS)];
    let links = &links;
    let map = map.into_iter().flat_map(|(commanded, gains)| {
        let gains = gains.into_iter().skip(every / 2).step_by(every);
        gains.flat_map(move |k_t| {
            links.iter().map(move |link| Trial { link: *link, commanded, k_t, ..usual })
        })
    });
    let with = |(part, trial): (Part, Trial<'a>)| {
        [false, true].map(|has_layer| (part, Trial { has_layer, ..trial }))
    };
    let compared = accepted.map(|trial| (Part::Accepted, trial));
    let compared = compared.chain(map.map(|trial| (Part::Map, trial))).flat_map(with);
    let disturbed = disturbed().map(|link| (Part::Disturbed, Trial { link, ..usual }));
    compared.chain(disturbed).collect()
}

/// Returns links with jitter and loss, with too much delay, and with an outage.
fn disturbed() -> impl Iterator<Item = LinkConditions> {
    let unsteady = LinkConditions::new([5.0, 20.0]);
    let unsteady = LinkConditions { jitter_ms: 3.0, loss_percent: 2.0, reorders: true, ..unsteady };
    let failing = [[5.0, 20.0], [20.0, 100.0]].map(LinkConditions::new);
    let failing = failing.map(|link| LinkConditions { outage_s: Some(OUTAGE_S), ..link });
    [unsteady].into_iter().chain(HOPELESS.map(LinkConditions::new)).chain(failing)
}

/// Returns the reason to fail: an accepted gain at which the hand does not rest, or torque after the loss of a link.
fn gate(figures: &[Figure], period: f64) -> Option<String> {
    let is_wrong = |Figure { row, .. }: &&Figure| {
        let TrialResult { link, outcome, .. } = row;
        if link.outage_s.is_some() {
            let end = link.max_age_ms / 1e3 + END_S + END_PERIODS * period;
            let has_ended = row.reflected_for_s.is_some_and(|reflected| reflected <= end);
            return *outcome != Outcome::LinkLost || !has_ended;
        }
        match row.is_usable {
            true => row.is_accepted && row.has_layer && *outcome != Outcome::Calm,
            false => *outcome != Outcome::LinkLost || row.largest_nm > 0.0,
        }
    };
    let TrialResult { led, link, commanded, k_t, outcome, .. } =
        &figures.iter().find(is_wrong)?.row;
    let delay_ms = link.delay_ms;
    Some(format!("{led}, {commanded} mode, {delay_ms} ms one way, K_T = {k_t:.3}, {outcome}"))
}
