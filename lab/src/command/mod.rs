//! `frhc-lab experiment`: measurements on the simulation, with a table, and its data and picture as files.
//!
//! | file        | part                                                        |
//! |-------------|-------------------------------------------------------------|
//! | `common`    | options, and the configurations and arms that they name      |
//! | `frame`     | trials, output to stdout and to a folder, gate               |
//! | `runner`    | runs on all cores, with a progress bar                       |
//! | `table`     | tables as text and as Markdown, rows as CSV                  |
//! | `peg`       | `frhc-lab peg`: one contact or lowering of a peg             |
//! | the others  | one experiment each: its runs, and a `report` of its figures |

mod common;
pub mod delay;
pub mod dual_peg;
pub mod fidelity;
mod frame;
pub mod ntrfc;
pub mod peg;
pub mod return_to_centre;
mod runner;
mod table;
pub mod torque_curve;

use clap::Subcommand;

use run::exit::Failure;

/// `frhc-lab experiment`.
#[derive(Debug, Subcommand)]
pub enum Experiment {
    /// Compares what the hand feels with K_T times what is sensed, in the simulation's own truth.
    #[command(
        after_help = "Four hands meet a wall, hold, slide, press and let go, in pose mode, on the arm as identified, with 30 % less \
            friction, and without friction. --out writes runs.csv, force.svg and report.md. The exit code is 1 when a run \
            was stopped.\n\nExamples:\n  \
            frhc-lab experiment fidelity --out fidelity\n  \
            frhc-lab experiment fidelity --short --config config/jpl_like.toml --json | jq '.[].still_percent'"
    )]
    Fidelity(fidelity::Arguments),
    /// Measures the return to centre at the hand over the displacement of each axis (Fig. 4 of the paper).
    #[command(
        after_help = "The hand moves the grip slowly to both sides along each axis in rate mode, in free space, and lets go. --out writes \
            axes.csv, curves.csv, force.svg and report.md; --short takes two axes, faster. The exit code is 1 when a run was \
            stopped.\n\nExamples:\n  \
            frhc-lab experiment return-to-centre --out return\n  \
            frhc-lab experiment return-to-centre --short --config config/jpl_like.toml --json | jq '.[].figures.felt'"
    )]
    ReturnToCentre(return_to_centre::Arguments),
    /// Compares the maker's straight torque curves with calibrated polynomials, at the joints and at the hand (Fig. 6).
    #[command(
        after_help = "Each joint's motor has a curve by the seed. It is measured with a load cell in both driving directions, and fitted. \
            Then a hand at rest feels test forces along one axis each, with either curve. --out writes joints.csv, test_forces.csv, \
            curves.svg and report.md; --short takes one seed. The exit code is 1 when a run with the polynomials was stopped.\n\nExamples:\n  \
            frhc-lab experiment torque-curve --out curves\n  \
            frhc-lab experiment torque-curve --short --config config/kraft_like.toml --markdown"
    )]
    TorqueCurve(torque_curve::Arguments),
    /// Presses simulated arms against a wall with rate commands: the force at rest, and the peak of the approach (4.3).
    #[command(
        after_help = "Two arms approach a wall with a constant rate and come to rest with the force of the law, with an ideal sensor and with \
            noise and bias; then over K_FA on both sides of its bound. --out writes presses.csv, figures.json, force.svg and report.md. \
            The exit code is 1 when a force differs from the law by more than 1 %, or a gain within its bound oscillates.\n\n\
            Examples:\n  \
            frhc-lab experiment ntrfc --out ntrfc\n  \
            frhc-lab experiment ntrfc --short --robot config/robots/puma560.toml --markdown"
    )]
    Ntrfc(ntrfc::Arguments),
    /// Rests a hand at a wall over a link with delay, with and without the passivity layer, and says what is given up.
    #[command(
        after_help = "For each delay: the largest K_T that frhc check accepts, and contact with it in pose and rate mode, of the free object \
            and two arms; then a map over K_T and delay; then links that jitter, are too slow, or fail. --out writes runs.csv, \
            figures.json, map.svg and report.md; --short takes three delays, one arm and two gains. The exit code is 1 when a hand with accepted gains does not rest, or a lost link \
            still reflects.\n\nExamples:\n  \
            frhc-lab experiment delay --out delay\n  \
            frhc-lab experiment delay --short --robot config/robots/puma560.toml --markdown"
    )]
    Delay(delay::Arguments),
    /// Puts two pegs into two holes with a teleoperated arm, with and without reflection and accommodation (Table I).
    #[command(
        after_help = "Three operators, twenty trials each, in four conditions that differ in nothing but two switches; then without \
            misalignment, and over visual error and misalignment. --out writes trials.csv, figures.json, work.svg and report.md; --short takes \
            one operator, one trial of each condition, and no sweep. The exit code is 1 when perfectly aligned pegs fail in more than 5 % of the \
            trials of a condition, or take more than 20 % longer in one than in another.\n\nExamples:\n  \
            frhc-lab experiment dual-peg --out dual-peg\n  \
            frhc-lab experiment dual-peg --short --json | jq '.ratios'"
    )]
    DualPeg(dual_peg::Arguments),
}

/// Runs the experiment.
///
/// # Errors
/// Returns the failure, with its exit code.
pub fn run(experiment: &Experiment, quiet: bool) -> Result<(), Failure> {
    match experiment {
        Experiment::Fidelity(args) => fidelity::run(args, quiet),
        Experiment::ReturnToCentre(args) => return_to_centre::run(args, quiet),
        Experiment::TorqueCurve(args) => torque_curve::run(args, quiet),
        Experiment::Ntrfc(args) => ntrfc::run(args, quiet),
        Experiment::Delay(args) => delay::run(args, quiet),
        Experiment::DualPeg(args) => dual_peg::run(args, quiet),
    }
}
