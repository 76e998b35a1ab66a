//! Signal: a number of each cycle, with name, unit and frame.

use std::fmt;

use thiserror::Error;

use crate::cycles::Cycle;
use crate::reading::Reading;

/// Source of a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Log or replay: both contain it.
    Both,
    /// `bus.log` only.
    Log,
    /// Replay only.
    Replay,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Both => "log, replay",
            Self::Log => "log",
            Self::Replay => "replay",
        })
    }
}

/// Named number of each cycle.
#[derive(Clone, Debug)]
pub struct Signal {
    /// Name: the quantity, as in STYLE.md, and its component or joint: `f_g_task.fx`, `tau.elbow`.
    pub name: String,
    /// Unit; empty for a number without one.
    pub unit: &'static str,
    /// Frame, as `{G}`; empty without one.
    pub frame: &'static str,
    /// Description of its quantity.
    pub about: &'static str,
    /// Log or replay, or both, that gives the value.
    pub source: Source,
    /// Index among the components of its quantity.
    pub(crate) place: usize,
    pub(crate) reading: Reading,
}

impl Signal {
    /// Returns the value in a cycle; NaN if absent.
    pub fn value(&self, cycle: &Cycle<'_>) -> f64 {
        self.reading.value(cycle, self.place).unwrap_or(f64::NAN)
    }

    /// Returns the name of its quantity: `tau` of `tau.elbow`.
    pub fn quantity(&self) -> &str {
        self.name.split_once('.').map_or(&*self.name, |(quantity, _)| quantity)
    }
}

/// Name that no signal has.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("unknown signal \"{name}\"{}; frhc signals SESSION lists all", nearest.as_ref().map_or_else(String::new, |name| format!(", did you mean {name}?")))]
pub struct UnknownSignal {
    /// Name as given.
    pub name: String,
    /// Similar name of a signal.
    pub nearest: Option<String>,
}

/// Returns the signals with these names, in the order of the names. A name is that of a signal, of a quantity for all its
/// components, or a pattern with `*`.
///
/// # Errors
/// Returns the first name that no signal has.
pub fn chosen(catalogue: &[Signal], names: &[String]) -> Result<Vec<Signal>, UnknownSignal> {
    let mut chosen: Vec<Signal> = Vec::new();
    for name in names {
        let mut found = catalogue
            .iter()
            .filter(|signal| signal.quantity() == name || matches(name, &signal.name))
            .peekable();
        if found.peek().is_none() {
            return Err(UnknownSignal { name: name.clone(), nearest: nearest(catalogue, name) });
        }
        for signal in found {
            if chosen.iter().all(|one| one.name != signal.name) {
                chosen.push(signal.clone());
            }
        }
    }
    Ok(chosen)
}

/// Returns whether a pattern matches the complete name; `*` matches any characters.
fn matches(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = name.strip_prefix(first) else { return false };
    let Some(last) = parts.next_back() else { return rest.is_empty() };
    for part in parts {
        let Some((_, after)) = rest.split_once(part) else { return false };
        rest = after;
    }
    rest.ends_with(last)
}

/// Returns the name that shares the longest beginning with `name`, if it shares three characters.
fn nearest(catalogue: &[Signal], name: &str) -> Option<String> {
    let shared = |other: &str| other.chars().zip(name.chars()).take_while(|(a, b)| a == b).count();
    let best = catalogue.iter().rev().max_by_key(|signal| shared(&signal.name))?;
    (shared(&best.name) >= 3).then(|| best.name.clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::placeholders;

    fn names(patterns: &[&str]) -> Vec<String> {
        let patterns: Vec<_> = patterns.iter().map(|name| (*name).to_owned()).collect();
        let chosen = chosen(&placeholders(), &patterns).unwrap();
        chosen.into_iter().map(|signal| signal.name).collect()
    }

    #[test]
    fn signal_is_chosen_by_name_quantity_or_pattern() {
        assert_eq!(names(&["f_s.fz", "energy"]), ["f_s.fz", "energy"]);
        assert_eq!(names(&["f_s"]).len(), 6);
        assert_eq!(names(&["f_s.f*", "f_s.fx"]), ["f_s.fx", "f_s.fy", "f_s.fz"]);
        assert!(names(&["*"]).len() > 100);
    }

    #[test]
    fn unknown_signal_is_named_with_the_nearest() {
        let error = chosen(&placeholders(), &["f_g_tusk.fx".to_owned()]).unwrap_err().to_string();
        assert!(error.contains("\"f_g_tusk.fx\", did you mean f_g_task.fx?"), "{error}");
        let error = chosen(&placeholders(), &["xyz".to_owned()]).unwrap_err().to_string();
        assert!(!error.contains("did you mean"), "{error}");
    }

    #[test]
    fn star_stands_for_any_characters() {
        for (pattern, name, is_one) in [
            ("a*c", "abbc", true),
            ("a*c", "ab", false),
            ("*ö*", "zwölf", true),
            ("", "a", false),
            ("**", "", true),
        ] {
            assert_eq!(matches(pattern, name), is_one, "{pattern} {name}");
        }
    }
}
