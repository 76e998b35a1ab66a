//! Citations of the paper (`decision 12`, `Eq. 5`, `Fig. 3`) against docs/paper.md, and that page against the sources.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::pages::{self, Page};

const PAGE: &str = "docs/paper.md";

/// Words before a number, and the beginning of the anchor of that number.
const KINDS: [(&str, &str); 6] = [
    ("decisions ", "decision"),
    ("decision ", "decision"),
    ("eqs. ", "eq"),
    ("eq. ", "eq"),
    ("figs. ", "fig"),
    ("fig. ", "fig"),
];

#[test]
fn every_citation_has_an_anchor() {
    let anchors: BTreeSet<String> = Page::read(PAGE).anchors().into_iter().collect();
    let mut missing = Vec::new();
    let mut checked = 0;
    for folder in ["src", "tests", "docs", "examples", "benches", "config"] {
        for file in pages::files(Path::new(folder), &["rs", "md", "toml"]) {
            for anchor in cited(&fs::read_to_string(&file).unwrap()) {
                checked += 1;
                if !anchors.contains(&anchor) {
                    missing.push(format!("{}: {PAGE}#{anchor}", file.display()));
                }
            }
        }
    }
    assert!(missing.is_empty(), "{}", missing.join("\n"));
    assert!(checked > 150, "{checked} citations");
}

#[test]
fn every_function_on_the_page_is_in_its_file() {
    let page = Page::read(PAGE);
    let text = page.prose().collect::<Vec<_>>().join(" ");
    let mut checked = 0;
    for place in text.split("](../src/").skip(1) {
        let Some((file, names)) = place.split_once("): ") else { continue };
        let source = fs::read_to_string(Path::new("src").join(file)).unwrap();
        for name in listed(names) {
            checked += 1;
            assert!(source.contains(&format!("fn {name}")), "src/{file} has no fn {name}: {PAGE}");
        }
    }
    assert!(checked > 80, "{checked} functions");
}

/// The names of a list of code spans at the beginning of `text`.
fn listed(mut text: &str) -> Vec<&str> {
    let mut names = Vec::new();
    while let Some((name, rest)) = text.strip_prefix('`').and_then(|rest| rest.split_once('`')) {
        names.push(name);
        text = rest.strip_prefix(", ").unwrap_or_default();
    }
    names
}

/// Anchors of everything that `text` cites.
fn cited(text: &str) -> Vec<String> {
    // Comments may break a list of numbers.
    let lines = text.lines().map(|line| line.trim_start().trim_start_matches(['/', '!', '#']));
    let text = lines.map(str::trim).collect::<Vec<_>>().join(" ").to_lowercase();
    let mut anchors = Vec::new();
    for (word, kind) in KINDS {
        for (at, _) in text.match_indices(word) {
            let is_whole = !text[..at].ends_with(char::is_alphabetic);
            let numbers = if is_whole { numbers(&text[at + word.len()..]) } else { Vec::new() };
            anchors.extend(numbers.into_iter().map(|number| format!("{kind}-{number}")));
        }
    }
    anchors
}

/// Returns the integers of a list like `2, 3 and 4`, `2-4` or `1, 7, 3.3`; `3.3` is a section of the paper.
fn numbers(mut text: &str) -> Vec<u32> {
    let mut numbers = Vec::new();
    let mut first: Option<u32> = None;
    loop {
        let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
        let Ok(number) = text[..end].parse() else { return numbers };
        text = &text[end..];
        if let Some(section) = text.strip_prefix('.').filter(|rest| rest.starts_with(digit)) {
            text = section.trim_start_matches(digit);
        } else {
            numbers.extend(first.unwrap_or(number)..=number);
        }
        let separators = [", ", " and ", "-", "–", " to "];
        let Some(separator) = separators.into_iter().find(|it| text.starts_with(it)) else {
            return numbers;
        };
        first = (!matches!(separator, ", " | " and ")).then_some(number + 1);
        text = &text[separator.len()..];
    }
}

const fn digit(c: char) -> bool {
    c.is_ascii_digit()
}

#[test]
fn lists_and_ranges_are_read_and_sections_are_not() {
    assert_eq!(listed("`dx`, `update`. Within the deadband, `a`"), ["dx", "update"]);
    assert_eq!(numbers("2, 3 and 4)"), [2, 3, 4]);
    assert_eq!(numbers("2-4"), [2, 3, 4]);
    assert_eq!(numbers("1, 7, 3.3 |"), [1, 7]);
    assert_eq!(numbers("3.6)"), [0; 0]);
    assert_eq!(
        cited("//! (Decisions 27,\n//! 28 and 29: Eq. 5, 3.5)"),
        ["decision-27", "decision-28", "decision-29", "eq-5"]
    );
    assert_eq!(cited("Config. 3, decision n"), [""; 0]);
}
