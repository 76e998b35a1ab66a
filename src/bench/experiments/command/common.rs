//! Options that every experiment has, and the two ways its results leave: standard output, and a folder of files.

use std::ops::Deref;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use crate::command::table::{self, Table};
use config::Config;
use config::robots::RobotArm;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results::{self, Force};

/// The configurations without `--config`.
const CONFIGS: [&str; 4] = [
    "config/kraft_like.toml",
    "config/kraft_like_500hz.toml",
    "config/jpl_like.toml",
    "config/sixr_spherical.toml",
];

/// The arms without `--robot`.
const ROBOTS: [&str; 2] = ["config/robots/puma560.toml", "config/robots/eight_r_synthetic.toml"];

/// Options of an experiment on configurations.
#[derive(Debug, Args)]
pub(super) struct Common {
    /// A configuration; repeatable. Default: those in config/.
    #[arg(short, long, value_name = "FILE")]
    config: Vec<PathBuf>,
    #[command(flatten)]
    results: Results,
}

/// Options of every experiment.
#[derive(Debug, Args)]
pub(super) struct Results {
    /// First seed of all that is random: the same seed is the same experiment, bit for bit.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) seed: u64,
    /// The short form: a part of the experiment, in seconds.
    #[arg(long)]
    pub(super) short: bool,
    /// Folder for CSV files, pictures (SVG) and report.md.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Prints the figures as JSON.
    #[arg(long)]
    json: bool,
    /// Prints the tables as Markdown.
    #[arg(long, conflicts_with = "json")]
    markdown: bool,
}

impl Deref for Common {
    type Target = Results;

    fn deref(&self) -> &Results {
        &self.results
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
    /// A file that is invalid (exit 3).
    pub(super) fn load(&self) -> Result<Vec<RobotArm>, Failure> {
        let shipped = ROBOTS.map(Path::new);
        let named: Vec<&Path> = self.robot.iter().map(PathBuf::as_path).collect();
        let files = if named.is_empty() { shipped.as_slice() } else { &named };
        files.iter().map(|file| RobotArm::load(file).or_fail(Kind::Configuration)).collect()
    }
}

/// A configuration with its name in tables.
pub(super) struct Named {
    /// Its file's name without extension.
    pub(super) name: String,
    /// The configuration.
    pub(super) config: Config,
}

impl Common {
    /// Loads the configurations; the shipped ones without `--config`.
    ///
    /// # Errors
    /// A file that is invalid, or in which nothing can be armed (exit 3).
    pub(super) fn configs(&self) -> Result<Vec<Named>, Failure> {
        let files = match &*self.config {
            [] => CONFIGS.iter().map(PathBuf::from).collect(),
            named => named.to_vec(),
        };
        let named = |file: &PathBuf| {
            let config = Config::load(file).or_fail(Kind::Configuration)?;
            require_switch_box(&config)?;
            let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            Ok(Named { name, config })
        };
        files.iter().map(named).collect()
    }
}

impl Results {
    /// Refuses a folder that already has one of `files`, before anything runs.
    ///
    /// # Errors
    /// A file exists, and `--force` is not given.
    pub(super) fn ensure_free(&self, files: &[&str]) -> Result<(), Failure> {
        let folder = self.out.iter();
        let mut paths = folder.flat_map(|folder| files.iter().map(|file| folder.join(file)));
        paths.try_for_each(|path| results::ensure_free(&path, self.force))
    }

    /// Prints the tables, or `figures` as JSON.
    ///
    /// # Errors
    /// Figures that JSON cannot represent.
    pub(super) fn print(&self, figures: &impl Serialize, tables: &[Table]) -> Result<(), Failure> {
        let text = if self.json {
            serde_json::to_string(figures).or_fail(Kind::Bus)?
        } else if self.markdown {
            table::markdown(tables)
        } else {
            table::text(tables)
        };
        print::line(&text);
        Ok(())
    }

    /// Writes the files of the results to the folder of `--out`, all or none; `contents` is not called without one.
    ///
    /// # Errors
    /// A picture that cannot be drawn, or a folder or file that cannot be written.
    pub(super) fn write<'n>(
        &self,
        contents: impl FnOnce() -> Result<Vec<(&'n str, String)>, Failure>,
    ) -> Result<(), Failure> {
        let Some(folder) = &self.out else { return Ok(()) };
        let contents = contents()?.into_iter().map(|(file, text)| (folder.join(file), text));
        let contents: Vec<_> = contents.collect();
        let created = std::fs::create_dir_all(folder);
        created
            .map_err(|error| Failure::new(Kind::Bus, format!("{}: {error}", folder.display())))?;
        results::export_all(&contents, self.force)
    }
}

/// Returns the failure (exit 1) of an experiment in which runs were stopped; `Ok` without one. An item is a run and its cause.
///
/// # Errors
/// When there is a stopped run.
pub(super) fn refuse_stopped<'r>(
    mut stopped: impl Iterator<Item = (String, &'r str)>,
) -> Result<(), Failure> {
    let Some((run, cause)) = stopped.next() else { return Ok(()) };
    let count = 1 + stopped.count();
    let reason = format!("{count} runs stopped; the first, {run}: {cause}");
    Err(Failure::new(Kind::Negative, reason))
}

/// Refuses a configuration in which nothing can be armed.
///
/// # Errors
/// When it has no switch box (exit 3).
pub fn require_switch_box(config: &Config) -> Result<(), Failure> {
    let refuse = |reason| format!("{}: {reason}", config.file.display());
    let found = config.switch_box().map_err(refuse);
    found.map(drop).map_err(|reason| Failure::new(Kind::Configuration, reason))
}
