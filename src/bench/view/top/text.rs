//! Text of a given number of columns. Names from a node may have characters that a terminal interprets; they are
//! replaced here.

use ratatui::text::Span;

/// Replacement of a character that a terminal interprets.
const REPLACEMENT: char = '\u{fffd}';

/// Shown at the end of a text that was cut.
const ELLIPSIS: char = '…';

/// Returns at most `max` characters of a text. Control characters and marks of direction are replaced; characters without
/// width are left out, as they would join others in a cell.
pub(super) fn clean(text: &str, max: usize) -> String {
    let mut cleaned: String = text.chars().filter_map(harmless).take(max + 1).collect();
    if let Some((end, _)) = cleaned.char_indices().nth(max) {
        cleaned.truncate(end);
        cleaned.pop();
        cleaned.push(ELLIPSIS);
    }
    cleaned
}

/// Returns the replacement of a character, or `None` if it is left out.
fn harmless(character: char) -> Option<char> {
    let is_direction = matches!(character,
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    if character.is_control() || is_direction {
        return Some(REPLACEMENT);
    }
    (width_of(character) > 0).then_some(character)
}

fn width_of(character: char) -> usize {
    if character.is_ascii() { 1 } else { width(character.encode_utf8(&mut [0; 4])) }
}

/// Returns the number of columns of a text.
pub(super) fn width(text: &str) -> usize {
    Span::raw(text).width()
}

/// Returns a text of exactly this number of columns: cut with an ellipsis, or padded on the right.
pub(super) fn fitted(text: &str, columns: usize) -> String {
    let mut fitted = cut(text, columns);
    fitted.extend(std::iter::repeat_n(' ', columns.saturating_sub(width(&fitted))));
    fitted
}

/// Returns a text of at most this number of columns, cut with an ellipsis.
pub(super) fn cut(text: &str, columns: usize) -> String {
    if width(text) <= columns {
        return text.to_owned();
    }
    if columns == 0 {
        return String::new();
    }
    let mut kept = head(text, columns - 1).to_owned();
    kept.push(ELLIPSIS);
    kept
}

/// Returns the longest beginning of at most this number of columns.
fn head(text: &str, columns: usize) -> &str {
    let mut used = 0;
    for (place, character) in text.char_indices() {
        used += width_of(character);
        if used > columns {
            return text.split_at(place).0;
        }
    }
    text
}

/// Returns a text in rows of at most this number of columns, broken at spaces; at most `max` rows, the last cut with an
/// ellipsis if there is more.
pub(super) fn wrapped(text: &str, columns: usize, max: usize) -> Vec<String> {
    let mut rows = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() && rows.len() < max {
        if rows.len() + 1 == max || width(rest) <= columns {
            rows.push(cut(rest, columns));
            break;
        }
        let fits = head(rest, columns);
        let next = rest.get(fits.len()..).and_then(|next| next.chars().next());
        let broken = if next == Some(' ') {
            fits
        } else {
            fits.rsplit_once(' ').map_or(fits, |(row, _)| row)
        };
        let row = if broken.trim().is_empty() { fits } else { broken };
        if row.is_empty() {
            break;
        }
        rows.push(row.trim_end().to_owned());
        rest = rest.get(row.len()..).unwrap_or_default().trim_start();
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_that_a_terminal_obeys_are_replaced() {
        assert_eq!(clean("a\u{1b}[31mb\r\n\u{9b}c", 99), "a\u{fffd}[31mb\u{fffd}\u{fffd}\u{fffd}c");
        assert_eq!(clean("\u{202e}evil\u{200b}\u{301}<b>", 99), "\u{fffd}evil<b>");
        assert_eq!(clean("abcdef", 4), "abc…");
        assert_eq!(clean("abcd", 4), "abcd");
    }

    #[test]
    fn fitted_text_has_exactly_its_columns() {
        for text in ["", "elbow", "a name of twenty chars", "関節関節関節関節", "ab関節", "é–µ·"]
        {
            for columns in 0..30 {
                assert_eq!(width(&fitted(text, columns)), columns, "{text} {columns}");
            }
        }
        assert_eq!(fitted("shoulder", 6), "shoul…");
        assert_eq!(fitted("関節関節", 6), "関節… ");
    }

    #[test]
    fn wrapped_text_keeps_its_words() {
        let text = "find the cause, then reset the node";
        assert_eq!(wrapped(text, 16, 9), ["find the cause,", "then reset the", "node"]);
        assert_eq!(wrapped(text, 16, 2), ["find the cause,", "then reset the …"]);
        assert_eq!(wrapped("abcdefghij", 4, 9), ["abcd", "efgh", "ij"]);
        assert_eq!(wrapped("  ", 4, 9), [""; 0]);
        assert_eq!(wrapped("関節", 1, 9), [""; 0]);
        for columns in 2..40 {
            assert!(wrapped(text, columns, 9).iter().all(|row| width(row) <= columns), "{columns}");
        }
    }
}
