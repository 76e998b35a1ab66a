//! Finds a scenario: a file, or one of those in `config/scenarios` by name.

use std::path::Path;
use std::path::PathBuf;

use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::config::files;
use crate::sim::scenario::Scenario;

/// Reads the scenario called `name`, or in the file of that name.
pub(super) fn load(name: &str) -> Result<Scenario, Failure> {
    let path = if name.ends_with(".toml") {
        PathBuf::from(name)
    } else {
        Path::new("config/scenarios").join(name).with_extension("toml")
    };
    let wrong =
        |reason: String| Failure::new(Kind::Configuration, format!("{}: {reason}", path.display()));
    let bytes = files::read(&path).map_err(|error| wrong(error.to_string()))?;
    let text = String::from_utf8(bytes).map_err(|error| wrong(error.to_string()))?;
    Scenario::parse(&text).map_err(|error| wrong(error.to_string()))
}
