//! Names of joints and buses. Screens, logs and tables print them, so they must be short, printable and unique.

use crate::problem::Problems;
use crate::value::Value;

/// Maximum length of a name, in characters.
const MAX_LEN: usize = 32;

/// Checks the names of all tables of one section.
pub(super) fn check<'n>(
    names: impl Iterator<Item = &'n Value<String>>,
    problems: &mut Problems<'_>,
) {
    let mut taken: Vec<&str> = Vec::new();
    for (value, name) in names.filter_map(|value| Some((value, value.as_ref()?.as_str()))) {
        let shown = name.escape_debug();
        if name.trim().is_empty() {
            problems.add(value, "must not be empty");
        } else if name.chars().any(is_unprintable) {
            problems
                .add(value, format_args!("must have printable characters alone, got \"{shown}\""));
        } else if name.trim() != name {
            problems.add(value, format_args!("must not begin or end with blanks, got \"{shown}\""));
        } else if name.chars().count() > MAX_LEN {
            let length = name.chars().count();
            problems
                .add(value, format_args!("must have at most {MAX_LEN} characters, got {length}"));
        } else if taken.contains(&name) {
            problems.add(value, format_args!("must be unique, got \"{shown}\" twice"));
        }
        taken.push(name);
    }
}

/// Returns whether `c` is a control character, a blank other than a space, or changes direction or width of text.
fn is_unprintable(c: char) -> bool {
    let is_invisible = matches!(
        c,
        '\u{AD}'
            | '\u{200B}'..='\u{200F}'
            | '\u{202A}'..='\u{202E}'
            | '\u{2060}'..='\u{206F}'
            | '\u{FEFF}'
            | '\u{FFF9}'..='\u{FFFB}'
    );
    c.is_control() || c.is_whitespace() && c != ' ' || is_invisible
}
