//! Text from files and arguments in a message: without control characters, and of a length that a terminal can show.

use telemetry::digits;

/// Maximum characters of a word.
const MAX_WORD: usize = 200;

/// Maximum characters of a line; lists of all known names are shorter.
const MAX_LINE: usize = 4_000;

/// Returns a line as it is printed: control characters escaped, long numbers rounded, long words and lines cut in the
/// middle.
pub(crate) fn printable(line: &str) -> String {
    let line = without_error_numbers(line);
    let mut shown = String::with_capacity(line.len());
    for character in line.chars() {
        match character {
            control if control.is_control() => shown.extend(control.escape_default()),
            other => shown.push(other),
        }
    }
    let words = digits::shortened(&shown);
    let words = words.split(' ').map(|word| cut(word, MAX_WORD)).collect::<Vec<_>>();
    cut(&words.join(" "), MAX_LINE)
}

/// Removes the numbers that the standard library adds to the words of the system: ` (os error 2)`.
fn without_error_numbers(line: &str) -> String {
    let mut parts = line.split(" (os error ");
    let mut kept = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        match part.split_once(')') {
            Some((number, rest)) if number.bytes().all(|byte| byte.is_ascii_digit()) => {
                kept.push_str(rest);
            }
            Some(_) | None => kept.extend([" (os error ", part]),
        }
    }
    kept
}

/// Returns the first half and the last quarter of a text above a length, with its length.
fn cut(text: &str, max: usize) -> String {
    let length = text.chars().count();
    if length <= max {
        return text.to_owned();
    }
    let first: String = text.chars().take(max / 2).collect();
    let last: String = text.chars().skip(length - max / 4).collect();
    format!("{first}…{last} ({length} characters)")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped() {
        let hostile = "a.toml: eds = \u{1b}[31mred\u{7}\t\u{85}.eds";
        assert_eq!(printable(hostile), "a.toml: eds = \\u{1b}[31mred\\u{7}\\t\\u{85}.eds");
    }

    #[test]
    fn system_errors_are_words_without_their_numbers() {
        let line = "a: No such file or directory (os error 2); b: (os error of b): Not a directory (os error 20)";
        assert_eq!(
            printable(line),
            "a: No such file or directory; b: (os error of b): Not a directory"
        );
    }

    #[test]
    fn long_words_and_lines_are_cut_in_the_middle() {
        let path = format!("config/{}.eds: absent", "a".repeat(100_000));
        let short =
            format!("config/{}…{}.eds: (100012 characters) absent", "a".repeat(93), "a".repeat(45));
        assert_eq!(printable(&path), short);
        let many = "é ".repeat(50_000);
        let cut = printable(&many);
        assert!(cut.chars().count() < 3_100 && cut.ends_with("(100000 characters)"), "{cut}");
    }

    #[test]
    fn other_text_is_unchanged() {
        for text in ["", "  a.toml:3: joint[0].eds: µs ‰ is \"x\"", &"word ".repeat(700)] {
            assert_eq!(printable(text), text);
        }
    }
}
