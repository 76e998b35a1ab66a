//! Options shared by the experiments, and the configurations and arms that they name.

use std::fmt::Display;
use std::num::NonZero;
use std::path::{Path, PathBuf};

use clap::Args;

use config::Config;
use config::robots::RobotArm;
use run::check::{refuse_far_side, require_switch_box};
use run::exit::{Failure, Kind, OrFail};
use run::results::Force;

/// Default configurations, used without `--config`.
const CONFIGS: [&str; 4] = [
    "config/kraft_like.toml",
    "config/kraft_like_500hz.toml",
    "config/jpl_like.toml",
    "config/sixr_spherical.toml",
];

/// Default arms, used without `--robot`.
const ROBOTS: [&str; 2] = ["config/robots/puma560.toml", "config/robots/eight_r_synthetic.toml"];

/// Options of an experiment on configurations.
#[derive(Debug, Args)]
pub(super) struct Common {
    /// A configuration; repeatable. Default: those in config/ up to 1 kHz.
    #[arg(short, long, value_name = "FILE")]
    config: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) results: Results,
}

/// Options of every experiment.
#[derive(Debug, Args)]
pub(super) struct Results {
    /// First seed of all that is random: the same seed is the same experiment, bit for bit.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub(super) seed: u64,
    /// The short form: a part of the experiment, in seconds.
    #[arg(long)]
    pub(super) short: bool,
    /// Folder for CSV files, pictures (SVG) and report.md.
    #[arg(short, long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) force: Force,
    /// Prints the figures as JSON.
    #[arg(long)]
    pub(super) json: bool,
    /// Prints the tables as Markdown.
    #[arg(long, conflicts_with = "json")]
    pub(super) markdown: bool,
}

impl Results {
    /// Returns `count` consecutive seeds from the first one on; with `--short` a single one.
    pub(super) fn seeds(&self, count: NonZero<u64>) -> impl Iterator<Item = u64> + use<> {
        let (seed, count) = (self.seed, if self.short { 1 } else { count.get() });
        (0..count).map(move |place| seed.wrapping_add(place))
    }
}

/// The arms of an experiment.
#[derive(Debug, Args)]
pub(super) struct Robots {
    /// A robot; repeatable. Default: both of config/robots/.
    #[arg(long, value_name = "FILE")]
    robot: Vec<PathBuf>,
}

impl Robots {
    /// Loads the arms; the shipped ones without `--robot`.
    ///
    /// # Errors
    /// Returns an error if a file is invalid (exit 3).
    pub(super) fn load(&self) -> Result<Vec<RobotArm>, Failure> {
        let shipped = ROBOTS.map(Path::new);
        let named: Vec<&Path> = self.robot.iter().map(PathBuf::as_path).collect();
        let files = if named.is_empty() { shipped.as_slice() } else { &named };
        files.iter().map(|file| RobotArm::load(file).or_fail(Kind::Configuration)).collect()
    }
}

/// Configuration with its name in tables.
pub(super) struct NamedConfig {
    /// File name without its extension.
    pub(super) name: String,
    /// Checked configuration.
    pub(super) config: Config,
}

impl Common {
    /// Loads the configurations; the shipped ones without `--config`.
    ///
    /// # Errors
    /// Returns an error if a file is invalid, or has no switch box (exit 3).
    pub(super) fn configs(&self) -> Result<Vec<NamedConfig>, Failure> {
        let files = match &*self.config {
            [] => CONFIGS.iter().map(PathBuf::from).collect(),
            named => named.to_vec(),
        };
        let named = |file: &PathBuf| {
            let config = Config::load(file).or_fail(Kind::Configuration)?;
            refuse_far_side(&config, "experiment")?;
            require_switch_box(&config)?;
            let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            Ok(NamedConfig { name, config })
        };
        files.iter().map(named).collect()
    }
}

/// Returns the reason to fail of an experiment in which no run may stop; an item is a stopped run and its cause.
pub(super) fn none_stopped<'r>(
    mut stopped: impl Iterator<Item = (String, &'r str)>,
) -> Option<String> {
    let (run, cause) = stopped.next()?;
    let count = 1 + stopped.count();
    Some(format!("{count} runs stopped; the first, {run}: {cause}"))
}

/// Returns the failure of an invalid file (exit 3), with its path.
pub(super) fn refused(file: &Path, reason: impl Display) -> Failure {
    Failure::new(Kind::Configuration, format!("{}: {reason}", file.display()))
}
