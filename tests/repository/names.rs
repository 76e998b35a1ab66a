//! Names on pages and in sources: functions of docs/loop.md and docs/paper.md exist, and each citation of the paper
//! (`decision 12`, `Eq. 5`, `Fig. 3`) is a heading of docs/paper.md.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::pages::{self, Page};

const LOOP: &str = "docs/loop.md";
const PAPER: &str = "docs/paper.md";

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
    let anchors: BTreeSet<String> = Page::read(PAPER).anchors().into_iter().collect();
    let mut missing = Vec::new();
    let mut checked = 0;
    for folder in ["src", "lab", "tests", "docs", "examples", "benches", "config"] {
        for file in pages::files(Path::new(folder), &["rs", "md", "toml"]) {
            for anchor in cited(&fs::read_to_string(&file).unwrap()) {
                checked += 1;
                if !anchors.contains(&anchor) {
                    missing.push(format!("{}: {PAPER}#{anchor}", file.display()));
                }
            }
        }
    }
    assert!(missing.is_empty(), "{}", missing.join("\n"));
    assert!(checked > 150, "{checked} citations");
}

#[test]
fn every_function_on_the_pages_is_in_its_file() {
    let mut checked = 0;
    for (page, file, name) in on_the_loop().into_iter().chain(on_the_paper()) {
        checked += 1;
        assert!(has_function(&file, &name), "{page}: there is no fn {name} in {file}");
    }
    assert!(checked > 90, "{checked} functions");
}

/// Page, file and name of a function.
type FunctionName = (&'static str, String, String);

/// Returns the functions of the steps of a cycle, `room::module::function`.
fn on_the_loop() -> Vec<FunctionName> {
    let page = Page::read(LOOP);
    let table = page.prose().skip_while(|line| !line.starts_with("| step | function |")).skip(2);
    let cells = table.take_while(|line| line.starts_with('|')).map(|row| row.split('|').nth(2));
    cells
        .flat_map(|cell| {
            let paths: Vec<&str> = cell.unwrap().split('`').skip(1).step_by(2).collect();
            assert!(!paths.is_empty(), "{LOOP}: a step without a function");
            paths
        })
        .map(|path| {
            let (module, name) = path.rsplit_once("::").unwrap();
            let files = ["", "/mod", "/lib"];
            let files = files.map(|end| format!("src/{}{end}.rs", module.replace("::", "/")));
            let file = files.into_iter().find(|file| Path::new(file).exists());
            (LOOP, file.unwrap_or_else(|| path.to_owned()), name.to_owned())
        })
        .collect()
}

/// Returns the functions behind links to their file: a list of code spans.
fn on_the_paper() -> Vec<FunctionName> {
    let page = Page::read(PAPER);
    let text = page.prose().collect::<Vec<_>>().join(" ");
    let mut named = Vec::new();
    for place in text.split("](../src/").skip(1) {
        let Some((file, mut names)) = place.split_once("): ") else { continue };
        while let Some((name, rest)) = names.strip_prefix('`').and_then(|it| it.split_once('`')) {
            named.push((PAPER, format!("src/{file}"), name.to_owned()));
            names = rest.strip_prefix(", ").unwrap_or_default();
        }
    }
    named
}

/// Returns whether a file has a function of this name outside of its tests.
fn has_function(file: &str, name: &str) -> bool {
    let source = fs::read_to_string(file).unwrap_or_default();
    let code = source.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    ["(", "<"].iter().any(|after| code.contains(&format!("fn {name}{after}")))
}

/// Returns the anchors of everything that `text` cites.
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
    let digit = |c: char| c.is_ascii_digit();
    let mut numbers = Vec::new();
    let mut first: Option<u32> = None;
    loop {
        let end = text.find(|c: char| !digit(c)).unwrap_or(text.len());
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

#[test]
fn lists_and_ranges_are_read_and_sections_are_not() {
    assert_eq!(
        cited("//! (Decisions 27,\n//! 28 and 30-32: Eq. 5, 3.5; config. 3, decision n)"),
        ["decision-27", "decision-28", "decision-30", "decision-31", "decision-32", "eq-5"]
    );
}
