//! The file as a text: characters, lines, what is said twice, how names are spelt.

use std::borrow::Cow;
use std::collections::HashMap;
use std::collections::hash_map;

use crate::canopen::eds::ini::Oddity;
use crate::canopen::eds::ini::Section;
use crate::canopen::eds::keys;
use crate::canopen::eds::lint::Lint;
use crate::canopen::eds::text::Encoding;
use crate::canopen::eds::title::Named;
use crate::canopen::eds::title::Title;
use crate::canopen::eds::value;

pub(super) fn check(lint: &mut Lint<'_>) {
    encoding(lint);
    strays(lint);
    for section in lint.ini.sections() {
        name(lint, section);
        if section.is_first {
            keys_of(lint, section);
        }
    }
}

fn encoding(lint: &mut Lint<'_>) {
    match lint.eds.text.encoding {
        Encoding::Utf8 => {}
        Encoding::Utf8Marked => {
            lint.warning(
                1,
                None,
                "",
                "begins with a byte order mark, which other tools take for text",
            );
        }
        Encoding::Utf16 => lint.error(1, None, "", "is UTF-16, which other tools cannot read"),
        Encoding::Latin1(line) => {
            lint.warning(line, None, "", "not UTF-8; the file was read as Latin-1");
        }
    }
}

fn strays(lint: &mut Lint<'_>) {
    for stray in lint.ini.strays() {
        match stray.oddity {
            Oddity::NoEntry => {
                lint.error(
                    stray.line,
                    None,
                    "",
                    "neither [section], key=value nor ; comment: skipped",
                );
            }
            Oddity::Homeless => {
                lint.error(stray.line, None, "", "stands before any section: skipped")
            }
            Oddity::BehindSection => lint.error(stray.line, None, "", "text behind the ]: skipped"),
            Oddity::Unclosed => lint.warning(stray.line, None, "", "the ] is missing"),
            Oddity::Hash => lint.warning(stray.line, None, "", "a comment begins with ;"),
        }
    }
}

/// A section's name: spelling, and whether it was there before.
fn name(lint: &mut Lint<'_>, section: &Section<'_>) {
    let title = section.title;
    if !section.is_first {
        let reason = format_args!("[{}] is there again: the first counts", section.name);
        lint.error(section.line, Some(title), "", reason);
    }
    match title {
        Title::Named(named) if section.name != named.name() => {
            let reason =
                format!("CiA 306 spells it [{}], and some tools know no other", named.name());
            lint.warning(section.line, Some(Title::Other(section.name)), "", reason);
        }
        Title::Other(_) if section.is_first => {
            lint.warning(section.line, Some(title), "", "no section of CiA 306");
        }
        Title::Named(_)
        | Title::Object(_)
        | Title::Sub(..)
        | Title::Names(_)
        | Title::Values(_)
        | Title::Denotations(_)
        | Title::Links(_)
        | Title::Other(_) => {}
    }
}

/// Keys that are there twice, spelt differently, or followed by numbers that look octal.
fn keys_of(lint: &mut Lint<'_>, section: &Section<'_>) {
    let title = section.title;
    let mut seen: HashMap<Cow<'_, str>, &str> = HashMap::with_capacity(section.entries.len());
    for entry in &section.entries {
        let key = entry.key;
        match seen.entry(entry.folded()) {
            hash_map::Entry::Vacant(place) => {
                place.insert(entry.value);
            }
            hash_map::Entry::Occupied(before) if *before.get() == entry.value => {
                lint.warning(entry.line, Some(title), key, "is there again, with the same value");
            }
            hash_map::Entry::Occupied(_) => {
                lint.error(entry.line, Some(title), key, "is there again: the first counts");
            }
        }
        if let Some(known) = keys::canonical(title, key)
            && known != key
        {
            let reason = format_args!("CiA 306 spells it {known}, and some tools know no other");
            lint.warning(entry.line, Some(title), key, reason);
        }
    }
    if holds_numbers(title) {
        leading_zeros(lint, section);
    }
}

/// Whether values of a section's keys that are no texts are numbers.
const fn holds_numbers(title: Title<'_>) -> bool {
    match title {
        Title::Named(Named::FileInfo | Named::Comments) | Title::Names(_) | Title::Other(_) => {
            false
        }
        Title::Named(_)
        | Title::Object(_)
        | Title::Sub(..)
        | Title::Values(_)
        | Title::Denotations(_)
        | Title::Links(_) => true,
    }
}

fn leading_zeros(lint: &mut Lint<'_>, section: &Section<'_>) {
    let is_text = lint.is_text(section);
    for entry in &section.entries {
        let key = entry.key;
        let holds_text = keys::is_text(key)
            || (is_text
                && ["DefaultValue", "ParameterValue"]
                    .iter()
                    .any(|one| one.eq_ignore_ascii_case(key)));
        let digits = entry.word().strip_prefix('-').unwrap_or(entry.word());
        let is_decimal = digits.len() > 1 && digits.bytes().all(|byte| byte.is_ascii_digit());
        if !holds_text && is_decimal && digits.starts_with('0') {
            let value = value::whole(entry.word()).map_or(0, |(value, _)| value);
            let reason = format_args!(
                "{} begins with 0: read as {value}, and differently or not at all elsewhere",
                entry.word()
            );
            lint.warning(entry.line, Some(section.title), key, reason);
        }
    }
}
