//! File as a text: encoding, lines, duplicates, spelling.

use std::borrow::Cow;
use std::collections::{HashMap, hash_map};
use std::fmt;

use crate::eds::ini::{Oddity, Section};
use crate::eds::lint::{Lint, Spot};
use crate::eds::text::Encoding;
use crate::eds::title::{Heading, Title};
use crate::eds::{keys, value};

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
    let first = Spot::line(1);
    match lint.eds.text.encoding {
        Encoding::Utf8 => {}
        Encoding::Utf8Marked => {
            lint.warning(first, "begins with a byte order mark, which other tools take for text");
        }
        Encoding::Utf16 => lint.error(first, "is UTF-16, which other tools cannot read"),
        Encoding::Latin1(line) => {
            lint.warning(Spot::line(line), "not UTF-8; the file was read as Latin-1");
        }
    }
}

fn strays(lint: &mut Lint<'_>) {
    for stray in lint.ini.strays() {
        let spot = Spot::line(stray.line);
        match stray.oddity {
            Oddity::NoEntry => {
                lint.error(spot, "neither [section], key=value nor ; comment: skipped");
            }
            Oddity::Homeless => lint.error(spot, "before any section: skipped"),
            Oddity::BehindSection => lint.error(spot, "text behind the ]: skipped"),
            Oddity::Unclosed => lint.warning(spot, "the ] is missing"),
            Oddity::Hash => lint.warning(spot, "a comment begins with ;"),
        }
    }
}

/// Checks the name of a section: spelling and duplicates.
fn name(lint: &mut Lint<'_>, section: &Section<'_>) {
    let spot = Spot::section(section);
    if !section.is_first {
        lint.error(spot, format_args!("[{}] is repeated: the first counts", section.name));
    }
    match section.title {
        Title::Named(named) if section.name != named.name() => {
            let spot = Spot { title: Some(Title::Other(section.name)), ..spot };
            spelling(lint, spot, format_args!("[{}]", named.name()));
        }
        Title::Other(name) if section.is_first && !is_of_modules_or_tools(name) => {
            lint.warning(spot, "not a section of CiA 306");
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

/// Returns whether a section belongs to modular devices or tools, which are not read here:
/// `[SupportedModules]`, `[M1SubExt1027]`, `[Tool1]`.
fn is_of_modules_or_tools(name: &str) -> bool {
    let known = ["SupportedModules", "ConnectedModules", "DynamicChannels", "Tools"];
    let is_numbered = |prefix: &str| {
        let rest = name.strip_prefix(prefix).unwrap_or_default();
        rest.starts_with(|digit: char| digit.is_ascii_digit())
    };
    known.iter().any(|known| known.eq_ignore_ascii_case(name))
        || ["M", "Tool"].into_iter().any(is_numbered)
}

fn spelling(lint: &mut Lint<'_>, spot: Spot<'_>, known: impl fmt::Display) {
    lint.warning(spot, format_args!("CiA 306 spells it {known}, and some tools know no other"));
}

/// Checks keys for duplicates, spelling, and numbers that look octal.
fn keys_of(lint: &mut Lint<'_>, section: &Section<'_>) {
    let mut seen: HashMap<Cow<'_, str>, &str> = HashMap::with_capacity(section.entries.len());
    for entry in &section.entries {
        let spot = Spot::entry(section, entry);
        match seen.entry(entry.folded()) {
            hash_map::Entry::Vacant(place) => {
                place.insert(entry.value);
            }
            hash_map::Entry::Occupied(before) if *before.get() == entry.value => {
                lint.warning(spot, "is repeated with the same value");
            }
            hash_map::Entry::Occupied(_) => lint.error(spot, "is repeated: the first counts"),
        }
        if let Some(known) = keys::canonical(section.title, entry.key)
            && known != entry.key
        {
            spelling(lint, spot, known);
        }
    }
    if holds_numbers(section.title) {
        leading_zeros(lint, section);
    }
}

/// Returns whether the values of a section are numbers, except for texts.
const fn holds_numbers(title: Title<'_>) -> bool {
    match title {
        Title::Named(Heading::FileInfo | Heading::Comments) | Title::Names(_) | Title::Other(_) => {
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
    let is_value = |key: &str| {
        ["DefaultValue", "ParameterValue"].iter().any(|value| value.eq_ignore_ascii_case(key))
    };
    for entry in &section.entries {
        let word = entry.word();
        let digits = word.strip_prefix('-').unwrap_or(word);
        let looks_octal = digits.len() > 1
            && digits.starts_with('0')
            && digits.bytes().all(|digit| digit.is_ascii_digit());
        let holds_text = keys::is_text(entry.key) || (is_text && is_value(entry.key));
        if let Some((value, _)) = value::whole(word).filter(|_| looks_octal && !holds_text) {
            let spot = Spot::entry(section, entry);
            let how = "and differently or not at all elsewhere";
            lint.warning(spot, format_args!("{word} begins with 0: read as {value}, {how}"));
        }
    }
}
