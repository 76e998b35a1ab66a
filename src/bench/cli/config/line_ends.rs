//! Line ends of an edited text as they were: `toml_edit` writes LF, and ends the last line.

use similar::{Algorithm, DiffTag, capture_diff_slices};

/// Content of a line and its end: `\n`, `\r\n`, or nothing after the last line.
type Line<'t> = (&'t str, &'t str);

/// Byte order mark of UTF-8, which some editors write.
const MARK: &str = "\u{feff}";

/// Returns `edited` with the line ends of `original`: a line that is in both keeps its own, a new one has that of most lines. The
/// last line ends only if that of `original` does. A byte order mark stays.
pub(super) fn restored(original: &str, edited: &str) -> String {
    let (mark, unmarked) =
        original.split_at(if original.starts_with(MARK) { MARK.len() } else { 0 });
    let (old, new) = (lines(unmarked), lines(edited));
    let ends_open = old.last().is_some_and(|(_, end)| end.is_empty());
    let usual = usual_end(&old);
    let mut text = mark.to_owned();
    let restored = with_old_ends(&old, &new);
    let last = restored.len().saturating_sub(1);
    for (number, (content, end)) in restored.into_iter().enumerate() {
        text.push_str(content);
        match (number == last && ends_open, end) {
            (true, _) => {}
            (false, "") => text.push_str(usual),
            (false, end) => text.push_str(end),
        }
    }
    text
}

/// Returns the contents of the lines, which a comparison without line ends needs.
pub(super) fn contents(text: &str) -> Vec<&str> {
    let text = text.strip_prefix(MARK).unwrap_or(text);
    lines(text).into_iter().map(|(content, _)| content).collect()
}

fn lines(text: &str) -> Vec<Line<'_>> {
    text.split_inclusive('\n')
        .map(|line| {
            let content = line.strip_suffix('\n').unwrap_or(line);
            let content =
                content.strip_suffix('\r').filter(|_| line.ends_with('\n')).unwrap_or(content);
            line.split_at(content.len())
        })
        .collect()
}

fn usual_end(lines: &[Line<'_>]) -> &'static str {
    let with_return = lines.iter().filter(|(_, end)| *end == "\r\n").count();
    if with_return * 2 > lines.len() { "\r\n" } else { "\n" }
}

/// Returns the new lines, those that are old ones with their old ends, the others without one.
fn with_old_ends<'t>(old: &[Line<'t>], new: &[Line<'t>]) -> Vec<Line<'t>> {
    let contents =
        |lines: &[Line<'t>]| lines.iter().map(|(content, _)| *content).collect::<Vec<_>>();
    let steps = capture_diff_slices(Algorithm::Patience, &contents(old), &contents(new));
    let mut lines = Vec::new();
    for step in steps {
        let (tag, in_old, in_new) = step.as_tag_tuple();
        match tag {
            DiffTag::Equal => lines.extend(old.get(in_old).unwrap_or_default()),
            DiffTag::Insert | DiffTag::Replace => {
                let added = new.get(in_new).unwrap_or_default();
                lines.extend(added.iter().map(|(content, _)| (*content, "")));
            }
            DiffTag::Delete => {}
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn new_lines_end_as_the_others_do() {
        assert_eq!(restored("a\r\nb\r\n", "a\nx\nb\n"), "a\r\nx\r\nb\r\n");
        assert_eq!(restored("a\nb\n", "a\nx\r\nb\n"), "a\nx\nb\n");
        assert_eq!(restored("a\r\nb\nc\n", "a\nx\nc\n"), "a\r\nx\nc\n");
    }

    #[test]
    fn last_line_without_an_end_stays_so() {
        assert_eq!(restored("a\nb", "a\nb\n"), "a\nb");
        assert_eq!(restored("a\nb", "a\nb\nx\n"), "a\nb\nx");
        assert_eq!(restored("a\r\nb\r\nc", "a\nb\nx\n"), "a\r\nb\r\nx");
        assert_eq!(restored("", "x\n"), "x\n");
    }

    #[test]
    fn byte_order_mark_stays() {
        assert_eq!(restored("\u{feff}a\r\n", "a\nb\n"), "\u{feff}a\r\nb\r\n");
    }

    proptest! {
        #[test]
        fn text_that_is_only_normalised_is_restored(text in "\u{feff}?([ab #]{0,3}(\n|\r\n)){0,8}[ab]{0,2}") {
            let normal = text.trim_start_matches(MARK).replace("\r\n", "\n");
            let ended = if normal.is_empty() || normal.ends_with('\n') { normal } else { normal + "\n" };
            prop_assert_eq!(restored(&text, &ended), text);
        }

        #[test]
        fn contents_are_those_of_the_edited_text(old in "([ab]{0,2}\r?\n){0,6}[ab]?", new in "([abc]{1,2}\n){0,6}") {
            let text = restored(&old, &new);
            prop_assert_eq!(contents(&text), contents(&new));
        }
    }
}
