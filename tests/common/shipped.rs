//! Shipped configurations, their text with changes, and what is refused of it.

use std::path::Path;

use config::{Config, files};
use units::numbering::Joint;

/// One bus at 1 kHz: target torques of three drives in one frame, statusword and controlword in PDOs of their own.
pub(crate) const KRAFT: &str = "config/kraft_like.toml";
pub(crate) const KRAFT_TEXT: &str = include_str!("../../config/kraft_like.toml");

/// One bus at 500 Hz: one PDO per direction and drive, the statusword in the first TPDO. It has room for an analogue input.
pub(crate) const KRAFT_500HZ: &str = "config/kraft_like_500hz.toml";
pub(crate) const KRAFT_500HZ_TEXT: &str = include_str!("../../config/kraft_like_500hz.toml");

/// Two buses at 1 kHz, one PDO per direction and drive, and a prismatic joint.
pub(crate) const JPL: &str = "config/jpl_like.toml";

/// Two buses at 1 kHz, a spherical wrist and an offset grip.
pub(crate) const SIXR: &str = "config/sixr_spherical.toml";

/// PUMA 560.
pub(crate) const PUMA: &str = "config/robots/puma560.toml";

/// Joint that carries weight, and is far from its limits.
pub(crate) const ELBOW: Joint = Joint::of::<3>();

pub(crate) fn config(file: &str) -> Config {
    Config::load(Path::new(file)).unwrap_or_else(|invalid| panic!("{file}: {invalid}"))
}

/// Returns the text of a shipped file.
pub(crate) fn text(file: &str) -> String {
    String::from_utf8(files::read(file.as_ref()).unwrap()).unwrap()
}

/// Parses the text of a configuration in place of that of `file`.
pub(crate) fn parse(file: &str, text: &str) -> Config {
    Config::parse(Path::new(file), text).unwrap_or_else(|invalid| panic!("{file}: {invalid}"))
}

/// Returns the problems of a text in place of that of `file`.
pub(crate) fn refusal(file: &str, text: &str) -> String {
    Config::parse(Path::new(file), text).map(|_| ()).unwrap_err().to_string()
}

/// Returns a text with replacements of every occurrence; each replaced text must be in it.
pub(crate) fn changed(text: &str, changes: &[(&str, &str)]) -> String {
    changes.iter().fold(text.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    })
}

/// Returns a configuration's text with a line in each `[[joint]]`.
pub(crate) fn in_each_joint(text: &str, line: &str) -> String {
    text.replace("\nencoder_counts_per_rev", &format!("\n{line}\nencoder_counts_per_rev"))
}
