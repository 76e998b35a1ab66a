//! Scenarios by file, or by the name of one of `config/scenarios`, which are compiled in.

mod shipped;

use std::fmt;
use std::io::ErrorKind;
use std::path::PathBuf;

use config::file_kind::FileKind;
use config::{encoding, files};
use run::exit::{Failure, Kind};
use sim::scenario::Scenario;

/// Reads a scenario by its name, or from the file `name` if that ends in `.toml`.
///
/// # Errors
/// Returns an unknown name, or what is wrong with the file.
pub fn load(name: &str) -> Result<Scenario, Failure> {
    load_with_text(name).map(|(scenario, ..)| scenario)
}

/// Reads a scenario as [`load`], and returns it with its path and text.
///
/// # Errors
/// As [`load`].
pub fn load_with_text(name: &str) -> Result<(Scenario, PathBuf, String), Failure> {
    let is_file = name.ends_with(".toml");
    let path = if is_file { PathBuf::from(name) } else { shipped::path(name) };
    let wrong =
        |reason: String| Failure::new(Kind::Configuration, format!("{}: {reason}", path.display()));
    let bytes = match (files::read(&path), shipped::text(&path)) {
        (Err(error), Some(text)) if error.kind() == ErrorKind::NotFound => Ok(text.into()),
        (read, _) => read,
    };
    let bytes = bytes.map_err(|error| {
        let is_unknown = error.kind() == ErrorKind::NotFound && !is_file;
        if is_unknown { unknown(name) } else { wrong(error.to_string()) }
    })?;
    let at = |line: &dyn fmt::Display| {
        Failure::new(Kind::Configuration, format!("{}:{line}", path.display()))
    };
    let text = encoding::decode(&bytes);
    let text = text.map_err(|error| at(&format_args!("{}: {error}", error.line)))?.to_owned();
    if let Some(other) = FileKind::from_text(&text).filter(|kind| *kind != FileKind::Scenario) {
        return Err(wrong(format!("is {other}")));
    }
    let scenario = Scenario::parse(&text).map_err(|error| at(&error))?;
    Ok((scenario, path, text))
}

/// Returns the shipped scenario whose name is nearest to an unknown one, if few letters differ; its folder may be missing.
fn similar(name: &str) -> Option<&'static str> {
    const MAX_DIFFERENT: usize = 2;
    let last = |name: &str| name.rsplit('/').next().unwrap_or_default().to_owned();
    let different = |full: &&str| strsim::damerau_levenshtein(&last(full), &last(name));
    shipped::names().min_by_key(different).filter(|full| different(full) <= MAX_DIFFERENT)
}

/// Returns the failure for an unknown name, with the known ones by folder.
fn unknown(name: &str) -> Failure {
    let of_folder = |folder: Option<&str>| {
        let names = shipped::names().map(|name| match name.split_once('/') {
            Some((folder, name)) => (Some(folder), name),
            None => (None, name),
        });
        let names = names.filter(|(of, _)| *of == folder).map(|(_, name)| name);
        names.collect::<Vec<_>>().join(", ")
    };
    if let Some(similar) = similar(name) {
        let reason = format!("--scenario {name}: unknown scenario; did you mean {similar}?");
        return Failure::new(Kind::Usage, reason);
    }
    let lines = [
        format!("--scenario {name}: unknown scenario"),
        format!("scenarios: {}", of_folder(None)),
        format!("faults/: {}", of_folder(Some("faults"))),
        format!("quirks/: {}", of_folder(Some("quirks"))),
        "or a file whose name ends in .toml".to_owned(),
    ];
    Failure::new(Kind::Usage, lines.join("\n"))
}
