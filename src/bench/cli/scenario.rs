//! Scenarios by file, or by the name of one of `config/scenarios`, which are compiled in.

mod shipped;

use std::io::ErrorKind;
use std::path::PathBuf;

use config::files;
use run::exit::{Failure, Kind};
use sim::scenario::Scenario;

/// Reads a scenario by its name, or from the file `name` if that ends in `.toml`.
pub(super) fn load(name: &str) -> Result<Scenario, Failure> {
    load_with_text(name).map(|(scenario, ..)| scenario)
}

/// Reads a scenario as [`load`], and returns it with its path and text.
pub(super) fn load_with_text(name: &str) -> Result<(Scenario, PathBuf, String), Failure> {
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
    let text = String::from_utf8(bytes).map_err(|error| wrong(error.to_string()))?;
    let scenario = Scenario::parse(&text).map_err(|error| wrong(error.to_string()))?;
    Ok((scenario, path, text))
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
    let last = |name: &str| name.rsplit('/').next().map(str::to_owned);
    let similar = shipped::names().find(|full| last(full) == last(name));
    let similar = similar.map_or_else(String::new, |full| format!("; did you mean {full}?"));
    let lines = [
        format!("--scenario {name}: unknown scenario{similar}"),
        format!("scenarios: {}", of_folder(None)),
        format!("faults/: {}", of_folder(Some("faults"))),
        format!("quirks/: {}", of_folder(Some("quirks"))),
        "or a file whose name ends in .toml".to_owned(),
    ];
    Failure::new(Kind::Usage, lines.join("\n"))
}
