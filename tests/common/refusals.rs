//! Tables of values that a configuration refuses.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::shipped::refusal;

/// Returns a configuration's text with a TOML value of a key, such as `joint[2].a_m`, and the number of the key's line.
/// A key that the text lacks is added to the table nearest to it.
pub(crate) fn with_value(text: &str, key: &str, value: &str) -> (String, usize) {
    let document = DeTable::parse(text).unwrap();
    let (mut table, mut rest) = (document.get_ref(), key);
    while let Some((step, below)) = rest.split_once('.') {
        let (name, index) = step.split_once('[').unwrap_or((step, "0]"));
        let found = match table.get(name).map(Spanned::get_ref) {
            Some(DeValue::Array(list)) => list
                .get(index.trim_end_matches(']').parse::<usize>().unwrap())
                .map(Spanned::get_ref),
            found => found,
        };
        let Some(DeValue::Table(found)) = found else { break };
        (table, rest) = (found, below);
    }
    let (place, value) = match table.get(rest) {
        Some(found) => (found.span(), value.to_owned()),
        None => {
            let first = table.keys().map(|key| key.span().start).min().unwrap();
            let start = text[..first].rfind('\n').map_or(0, |end| end + 1);
            (start..start, format!("{rest} = {value}\n"))
        }
    };
    let line = 1 + text[..place.start].matches('\n').count();
    (format!("{}{value}{}", &text[..place.start], &text[place.end..]), line)
}

/// Asserts that each of these values is refused by its key and line, for a reason that begins so.
#[track_caller]
pub(crate) fn are_refused(file: &str, text: &str, rows: &[(&str, &str, &str)]) {
    for (key, value, reason) in rows {
        let (text, line) = with_value(text, key, value);
        let refusal = refusal(file, &text);
        let expected = format!("{file}:{line}: {key}: {reason}");
        let is_named = refusal.lines().any(|line| line.starts_with(&expected));
        assert!(is_named, "{key} = {value}: {expected:?} is not in {refusal:?}");
        let in_file = format!("{file}:");
        assert!(refusal.lines().all(|line| line.starts_with(&in_file)), "{refusal:?}");
        assert!(!refusal.contains('\u{1b}'), "{refusal:?}");
    }
}
