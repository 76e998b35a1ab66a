//! `frhc explain robot`: a robot arm at given joint positions.

use std::path::PathBuf;

use clap::Args;

use crate::explain::rendered::{json, text};
use config::robots::RobotArm;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use testbench::explanation::Explanation;
use testbench::robot_explanation;

/// `frhc explain robot`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  frhc explain robot config/robots/puma560.toml --q 0,0.8,-3.1,0,0.8,0\n  \
        frhc explain robot config/robots/puma560.toml --json | jq -c .mass_matrix.value"
)]
pub(super) struct Robot {
    /// The arm: a file such as config/robots/puma560.toml.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Joint positions in rad, as many comma-separated numbers as joints; repeat it for several postures
    /// [default: the start position].
    #[arg(long, value_name = "Q,...", value_parser = parse_list, allow_hyphen_values = true)]
    q: Vec<Positions>,
    /// Print one JSON object per posture and line; each value has its unit and frame.
    #[arg(long)]
    json: bool,
}

/// Joint positions, in rad.
#[derive(Clone, Debug)]
struct Positions(Vec<f64>);

/// Explains every posture, and prints once all are accepted.
pub(super) fn run(args: &Robot) -> Result<(), Failure> {
    let arm = RobotArm::load(&args.file).or_fail(Kind::Configuration)?;
    let explanations = if args.q.is_empty() {
        vec![robot_explanation::explain(&arm, None).or_fail(Kind::Configuration)?]
    } else {
        args.q.iter().map(|q| posture(&arm, q)).collect::<Result<_, _>>()?
    };
    let (shown, separator): (fn(&Explanation) -> String, _) =
        if args.json { (json, "\n") } else { (text, "\n\n") };
    let shown: Vec<String> = explanations.iter().map(shown).collect();
    print::line(&shown.join(separator));
    Ok(())
}

fn posture(arm: &RobotArm, Positions(q): &Positions) -> Result<Explanation, Failure> {
    robot_explanation::explain(arm, Some(q))
        .map_err(|error| Failure::new(Kind::Usage, format!("--q: {error}")))
}

/// Parses comma-separated numbers.
fn parse_list(text: &str) -> Result<Positions, String> {
    let number = |part: &str| {
        let part = part.trim();
        part.parse().map_err(|_| format!("expected a number, got \"{part}\""))
    };
    text.split(',').map(number).collect::<Result<_, _>>().map(Positions)
}
