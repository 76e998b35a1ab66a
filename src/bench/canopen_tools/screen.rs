//! Parser of `candump` screen output and of lines of its logs; either can be piped in.
//!
//! ```text
//!   can0  181   [8]  37 16 E8 03 00 00 FE FF                        without a stamp
//!  (1700000000.123456)  can0  181   [2]  37 16   '7.'               -t a, with ASCII text (-a)
//!  (000.001000)  can0  RX - -  701   [0]  remote request            -t d or -t z, with a direction (-x)
//!  (2026-01-31 08:15:00.123456)  can0  080   [0]                    -t A
//!   can0  181   {E}  37 16 E8 03 00 00 FE FF                        -8: data length code in braces
//!  (1700000000.123456) can0 181#3716                                a line of a log
//! ```

use std::str::SplitAsciiWhitespace;
use std::time::UNIX_EPOCH;

use crate::candump::{
    Bytes, Content, Line, NotALine, byte, fraction, identifier, is_error, long_dlc, stamp,
};

/// Parses a line of either form; returns the stamp in ns, if there is one.
///
/// # Errors
/// Returns the first invalid part.
pub fn parse(text: &str) -> Result<(Option<u64>, Line<'_>), NotALine> {
    let is_of_screen = |byte| matches!(byte, b'[' | b'{');
    if text.contains('#') && !text.bytes().any(is_of_screen) {
        return Line::parse(text).map(|line| (Some(line.nanos), line));
    }
    let (stamp, rest) = leading_stamp(text)?;
    let mut words = rest.split_ascii_whitespace();
    let interface = words.next().ok_or(NotALine::Interface)?;
    let (id, is_extended) = words
        .next()
        .and_then(|word| identifier(past_direction(word, &mut words)?))
        .ok_or(NotALine::Identifier)?;
    let (content, raw_dlc) = content(id, &mut words).ok_or(NotALine::Data)?;
    let (nanos, is_fine) = stamp.unwrap_or_default();
    let line = Line { nanos, is_fine, interface, id, is_extended, raw_dlc, content };
    Ok((stamp.map(|(nanos, _)| nanos), line))
}

/// Stamp in ns and whether it has nine digits; the rest of the line.
type StampAndRest<'t> = (Option<(u64, bool)>, &'t str);

fn leading_stamp(text: &str) -> Result<StampAndRest<'_>, NotALine> {
    let text = text.trim_start();
    if !text.starts_with('(') {
        return Ok((None, text));
    }
    let end = text.find(')').ok_or(NotALine::Stamp)?;
    let (word, rest) = text.split_at_checked(end + 1).ok_or(NotALine::Stamp)?;
    let read = stamp(word).or_else(|| date(word)).ok_or(NotALine::Stamp)?;
    Ok((Some(read), rest))
}

/// Parses `(2026-01-31 08:15:00.123456)` as UTC: only differences matter.
fn date(word: &str) -> Option<(u64, bool)> {
    let word = word.strip_prefix('(')?.strip_suffix(')')?;
    let (_, decimals) = word.split_once('.')?;
    let (_, is_fine) = fraction(decimals)?;
    let at = humantime::parse_rfc3339_weak(word).ok()?;
    let nanos = at.duration_since(UNIX_EPOCH).ok()?.as_nanos();
    Some((nanos.try_into().ok()?, is_fine))
}

/// Returns the identifier, after the `RX - -` of `-x`.
fn past_direction<'t>(word: &'t str, words: &mut SplitAsciiWhitespace<'t>) -> Option<&'t str> {
    if word != "RX" && word != "TX" {
        return Some(word);
    }
    words.nth(2)
}

/// Length of a frame in the line.
struct Length {
    bytes: u8,
    is_fd: bool,
    raw_dlc: Option<u8>,
}

/// Parses `[8]` (classical), `{8}` or `{E}` (data length code), `[08]` (CAN FD).
fn length(word: &str) -> Option<Length> {
    let (digits, is_code) = match word.strip_prefix('{') {
        Some(rest) => (rest.strip_suffix('}')?, true),
        None => (word.strip_prefix('[')?.strip_suffix(']')?, false),
    };
    if let Some(dlc) = long_dlc(digits).filter(|_| is_code) {
        return Some(Length { bytes: 8, is_fd: false, raw_dlc: Some(dlc) });
    }
    let bytes: u8 = digits.parse().ok().filter(|_| !digits.starts_with('+'))?;
    let is_fd = digits.len() == 2;
    if is_fd && is_code {
        return None;
    }
    let most = if is_fd { 64 } else { 8 };
    (bytes <= most).then_some(Length { bytes, is_fd, raw_dlc: None })
}

/// Parses `[8]  37 16 …` to content, and the data length code if it is above 8.
fn content(id: u32, words: &mut SplitAsciiWhitespace<'_>) -> Option<(Content, Option<u8>)> {
    let Length { bytes: length, is_fd, raw_dlc } = length(words.next()?)?;
    let mut bytes = Bytes::EMPTY;
    for place in 0..length {
        let word = words.next()?;
        if place == 0 && word == "remote" {
            return Some((Content::Remote(Some(length)), raw_dlc));
        }
        bytes.push(byte(word.as_bytes().try_into().ok()?)?)?;
    }
    let content = match words.next() {
        Some("remote") => Content::Remote(Some(length)),
        _ if is_fd => Content::Fd(0, bytes),
        _ if is_error(id) => Content::Error(bytes),
        _ => Content::Data(bytes),
    };
    (raw_dlc.is_none() || content.is_classical_of_8()).then_some((content, raw_dlc))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const NANOS: u64 = 1_000_000_000;

    /// Converts a line of the screen to a line of a log.
    fn as_log(text: &str) -> String {
        let (nanos, line) = parse(text).unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!(nanos.unwrap_or_default(), line.nanos);
        line.to_string()
    }

    #[test]
    fn candump_screen_lines_are_parsed() {
        for (text, log) in [
            ("  can0  181   [4]  37 16 E8 03", "(0.000000) can0 181#3716E803"),
            (" (1.000002)  can0  181   [2]  37 16   '7.'", "(1.000002) can0 181#3716"),
            (" (000.001000)  vcan0       080   [0]", "(0.001000) vcan0 080#"),
            (" (1.000000)  can0  TX B -  701   [1]  05", "(1.000000) can0 701#05"),
            ("(1.000000)  can0  701   [0]  remote request", "(1.000000) can0 701#R0"),
            ("(1.000000)  can0  701   [8]  remote request", "(1.000000) can0 701#R8"),
            ("  can0  1FFFFFFF   [1]  00      '.'", "(0.000000) can0 1FFFFFFF#00"),
            ("  can0  18FF0000  [03]  00 11 22", "(0.000000) can0 18FF0000##0001122"),
            (
                "  can0  20000004   [8]  00 08 00 00 00 00 00 00   ERRORFRAME",
                "(0.000000) can0 20000004#0008000000000000",
            ),
            ("(1.000000) can0 181#3716 R", "(1.000000) can0 181#3716"),
            ("  can0  123   {2}  37 16", "(0.000000) can0 123#3716"),
            (
                " (1.000000)  can0  123   {B}  11 22 33 44 55 66 77 88   '.\"3DUfw#'",
                "(1.000000) can0 123#1122334455667788_B",
            ),
            ("(1.000000)  can0  701   {F}  remote request", "(1.000000) can0 701#R8_F"),
        ] {
            assert_eq!(as_log(text), log);
        }
    }

    #[test]
    fn dates_differ_by_the_calendar() {
        let nanos = |text| parse(text).unwrap().0.unwrap();
        let before = nanos(" (2024-02-28 23:59:59.500000)  can0  080   [0]");
        let after = nanos(" (2024-03-01 00:00:00.750000)  can0  080   [0]");
        assert_eq!(after - before, (24 * 3_600 + 1) * NANOS + NANOS / 4);
    }

    #[test]
    fn invalid_lines_are_refused_with_a_reason() {
        for (text, reason) in [
            ("", NotALine::Interface),
            ("(x)  can0  080   [0]", NotALine::Stamp),
            ("  can0", NotALine::Identifier),
            ("  can0  80   [0]", NotALine::Identifier),
            ("  can0  080", NotALine::Data),
            ("  can0  080   [2]  11", NotALine::Data),
            ("  can0  080   [9]  11 22 33 44 55 66 77 88 99", NotALine::Data),
            ("  can0  080   [1]  +1", NotALine::Data),
            ("  can0  080   [E]  11 22 33 44 55 66 77 88", NotALine::Data),
            ("  can0  080   {E}  11 22", NotALine::Data),
            ("  can0  080   {08}  11", NotALine::Data),
        ] {
            assert_eq!(parse(text).map(|(_, line)| line.id), Err(reason), "{text}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_parsed_or_refused(text in ".*") {
            parse(&text).ok();
        }

        #[test]
        fn almost_valid_lines_are_parsed_or_refused(
            text in r" ?(\([0-9:. -]{0,26}\))? *can0 *(RX - -)? *[0-9A-F]{2,9} *\[[0-9]{1,3}\]( [0-9A-F]{2}){0,9}( remote)?",
        ) {
            if let Ok((_, line)) = parse(&text) {
                let log = line.to_string();
                let again = Line::parse(&log);
                prop_assert_eq!(again.as_ref().map(ToString::to_string), Ok(log.clone()));
            }
        }
    }
}
