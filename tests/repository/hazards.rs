//! docs/safety.md against the tests: every hazard, promise and property has one, and the page names them.
//!
//! A test says by the beginning of its name what it shows: `hazard_12_…`, `promise_08_…`,
//! `hazard_40_and_property_05_…`. `GOLDEN=write cargo test --test repository` writes the page's lists anew.
#![allow(
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::path::PathBuf;

use crate::claims::Claim;
use crate::claims::HAZARDS;
use crate::claims::PROMISES;
use crate::claims::PROPERTIES;

const PAGE: &str = "docs/safety.md";

/// Behind this line of the page stands what is written here.
const MARK: &str = "<!-- from here on written by: GOLDEN=write cargo test --test repository -->\n";

/// What a test may show: the word its name begins with, the title of its list, and its claims.
const FAMILIES: [(&str, &str, &[Claim]); 3] = [
    ("promise", "Promises", &PROMISES),
    ("hazard", "Hazards", &HAZARDS),
    ("property", "Properties", &PROPERTIES),
];

/// A claim: a family and a number in it.
type Shown = (&'static str, u8);

/// Where a test is, and what its name says.
type Test = (String, String);

/// What a name says that it shows, and the words behind that.
fn shown(name: &str) -> Option<(Vec<Shown>, String)> {
    let mut words = name.split('_').peekable();
    let mut claims = Vec::new();
    let mut family = None;
    loop {
        let word = *words.peek()?;
        if let Some((known, ..)) = FAMILIES.iter().find(|(known, ..)| *known == word) {
            family = Some(*known);
        } else if let (2, Ok(number), Some(family)) = (word.len(), word.parse(), family) {
            claims.push((family, number));
        } else if word != "and" || !is_about_more(words.clone().nth(1)) {
            break;
        }
        words.next();
    }
    (!claims.is_empty()).then(|| (claims, words.collect::<Vec<_>>().join(" ")))
}

/// Whether the word behind an "and" begins another claim.
fn is_about_more(word: Option<&str>) -> bool {
    let is_family = |word: &str| FAMILIES.iter().any(|(known, ..)| *known == word);
    word.is_some_and(|word| is_family(word) || word.len() == 2 && word.parse::<u8>().is_ok())
}

/// Every test that shows something, by what it shows.
fn tests() -> BTreeMap<Shown, Vec<Test>> {
    let mut files = Vec::new();
    for folder in ["src", "tests"] {
        sources(Path::new(folder), &mut files);
    }
    files.sort();
    let mut tests = BTreeMap::<Shown, Vec<Test>>::new();
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        let place = file.display().to_string();
        for (claims, words) in text.lines().filter_map(function).filter_map(shown) {
            for claim in claims {
                tests.entry(claim).or_default().push((place.clone(), words.clone()));
            }
        }
    }
    tests
}

/// The name of the function that begins on a line of Rust or Python.
fn function(line: &str) -> Option<&str> {
    let line = line.trim_start().trim_start_matches("async ");
    let name = line.strip_prefix("fn ").or_else(|| line.strip_prefix("def "))?;
    name.split(['(', '<']).next()
}

/// Every file of a folder and those in it that may hold tests.
fn sources(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, files);
        } else if path.extension().is_some_and(|kind| kind == "rs" || kind == "py") {
            files.push(path);
        }
    }
}

/// The lists of the page.
fn lists(tests: &BTreeMap<Shown, Vec<Test>>) -> String {
    let mut lines = Vec::new();
    for (family, title, claims) in FAMILIES {
        lines.push(format!("\n## {title}\n"));
        for (number, what, figure) in claims {
            let figure = if figure.is_empty() { String::new() } else { format!(": {figure}") };
            lines.push(format!("**{number}. {what}**{figure}.\n"));
            let shown = tests.get(&(family, *number)).into_iter().flatten();
            lines.extend(shown.map(|(file, words)| format!("- [{words}](../{file})")));
            lines.push(String::new());
        }
    }
    lines.join("\n")
}

#[test]
fn every_hazard_promise_and_property_has_a_test() {
    let tests = tests();
    let claims = FAMILIES.iter().flat_map(|(family, _, claims)| {
        claims.iter().map(move |(number, what, _)| (*family, *number, *what))
    });
    let without: Vec<String> = claims
        .filter(|(family, number, _)| !tests.contains_key(&(family, *number)))
        .map(|(family, number, what)| format!("{family} {number}: {what}"))
        .collect();
    assert!(without.is_empty(), "without a test:\n{}", without.join("\n"));
}

#[test]
fn every_test_shows_something_that_is_claimed() {
    for (claim, tests) in tests() {
        let (family, number) = claim;
        let (.., claims) = FAMILIES.iter().find(|(known, ..)| *known == family).unwrap();
        let is_claimed = claims.iter().any(|(claimed, ..)| *claimed == number);
        assert!(is_claimed, "there is no {family} {number}: {tests:?}");
    }
}

#[test]
fn the_page_names_the_tests_that_are_there() {
    let page = fs::read_to_string(PAGE).unwrap();
    let (head, found) = page.split_once(MARK).unwrap();
    let expected = lists(&tests());
    if std::env::var_os("GOLDEN").is_some_and(|golden| golden == "write") {
        fs::write(PAGE, format!("{head}{MARK}{expected}")).unwrap();
        return;
    }
    let differs = found.lines().zip(expected.lines()).find(|(found, expected)| found != expected);
    assert!(
        found == expected,
        "{PAGE}: {differs:?}; write it anew by GOLDEN=write cargo test --test repository"
    );
}

#[test]
fn a_name_says_what_it_shows() {
    let one = (vec![("hazard", 12)], "a jump and a wrap".to_owned());
    assert_eq!(shown("hazard_12_a_jump_and_a_wrap"), Some(one));
    let three = (vec![("hazard", 6), ("hazard", 7), ("promise", 8)], "end".to_owned());
    assert_eq!(shown("hazard_06_and_07_and_promise_08_end"), Some(three));
    assert_eq!(shown("a_hazard_12_in_words"), None);
    assert_eq!(shown("hazard_of_a_jump"), None);
}
