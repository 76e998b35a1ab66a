//! `frhc signals`: the signals of a session, with unit and frame.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use crate::session_config::configuration;
use ::replay::Session;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use signals::{Recording, Signal, catalogue, placeholders};

/// `frhc signals`.
#[derive(Debug, Args)]
pub struct SignalList {
    /// Folder of a session, for the names of its joints and buses.
    #[arg(value_name = "SESSION")]
    session: Option<PathBuf>,
    /// Print one JSON object per line.
    #[arg(long)]
    json: bool,
}

/// Prints the signals.
pub(super) fn run(args: &SignalList) -> Result<(), Failure> {
    let signals = match &args.session {
        None => placeholders(),
        Some(folder) => {
            let session = Session::open(folder).or_fail(Kind::File)?;
            catalogue(&Recording::new(&session, &configuration(&session)?))
        }
    };
    if args.json {
        for Signal { name, unit, frame, about, source, .. } in &signals {
            let source = source.to_string();
            let object = json!({ "name": name, "unit": unit, "frame": frame, "source": source, "about": about });
            print::line(&object.to_string());
        }
        return Ok(());
    }
    let names = signals.iter().map(|signal| signal.name.chars().count());
    let width = names.max().unwrap_or_default();
    for Signal { name, unit, frame, about, source, .. } in &signals {
        let source = source.to_string();
        print::line(format!("{name:width$}  {unit:5}  {frame:5}  {source:11}  {about}").trim_end());
    }
    Ok(())
}
