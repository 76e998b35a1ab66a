//! docs/safety.md against the tests: every hazard, promise and property has a test, which docs/safety-tests.md lists.
//!
//! The name of a test begins with the claims it covers: `hazard_12_…`, `promise_08_…`,
//! `hazard_40_and_property_05_…`. `GOLDEN=write cargo test --test repository` rewrites the tables of the one page and the
//! lists of the other.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::claims::{Claim, HAZARDS, PROMISES, PROPERTIES};
use campaign::catalogue;
use campaign::expectation::{EXPECTATIONS, Expectation};

const PAGE: &str = "docs/safety.md";
const TESTS_PAGE: &str = "docs/safety-tests.md";

/// The part of a page after this line is generated.
const MARK: &str = "<!-- from here on written by: GOLDEN=write cargo test --test repository -->\n";

/// Families of claims: prefix of test names, title of the list, and claims.
const FAMILIES: [(&str, &str, &[Claim]); 3] = [
    ("promise", "Promises", &PROMISES),
    ("hazard", "Hazards", &HAZARDS),
    ("property", "Properties", &PROPERTIES),
];

/// Family and number of a claim.
type ClaimId = (&'static str, u8);

/// File of a test, and the rest of its name as words.
type Test = (String, String);

/// Splits a test name into the claims it covers and the remaining words.
fn parse_name(name: &str) -> Option<(Vec<ClaimId>, String)> {
    let mut words = name.split('_').peekable();
    let mut claims = Vec::new();
    let mut family = None;
    loop {
        let word = *words.peek()?;
        if let Some((known, ..)) = FAMILIES.iter().find(|(known, ..)| *known == word) {
            family = Some(*known);
        } else if let (2, Ok(number), Some(family)) = (word.len(), word.parse(), family) {
            claims.push((family, number));
        } else if word != "and" || !begins_claim(words.clone().nth(1)) {
            break;
        }
        words.next();
    }
    (!claims.is_empty()).then(|| (claims, words.collect::<Vec<_>>().join(" ")))
}

/// Returns whether the word after an "and" begins another claim.
fn begins_claim(word: Option<&str>) -> bool {
    let is_family = |word: &str| FAMILIES.iter().any(|(known, ..)| *known == word);
    word.is_some_and(|word| is_family(word) || word.len() == 2 && word.parse::<u8>().is_ok())
}

/// Returns the tests of each claim.
fn tests() -> BTreeMap<ClaimId, Vec<Test>> {
    let mut files = Vec::new();
    for folder in ["src", "tests", "link/src", "link/tests"] {
        sources(Path::new(folder), &mut files);
    }
    files.sort();
    let mut tests = BTreeMap::<ClaimId, Vec<Test>>::new();
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        let place = file.display().to_string();
        for (claims, words) in text.lines().filter_map(function).filter_map(parse_name) {
            for claim in claims {
                tests.entry(claim).or_default().push((place.clone(), words.clone()));
            }
        }
    }
    tests
}

/// Returns the name of the function that begins on a line of Rust or Python.
fn function(line: &str) -> Option<&str> {
    let line = line.trim_start().trim_start_matches("async ");
    let name = line.strip_prefix("fn ").or_else(|| line.strip_prefix("def "))?;
    name.split(['(', '<']).next()
}

/// Collects the Rust and Python files of a folder and its subfolders.
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

/// Returns the tables of promises and hazards, each row with a link to its tests.
fn tables() -> String {
    let mut lines = Vec::new();
    for (family, title, claims) in FAMILIES.iter().filter(|(family, ..)| *family != "property") {
        lines.push(format!("\n## {title}\n\n| | | figure | tests |\n|--:|---|---|---|"));
        lines.extend(claims.iter().map(|(number, what, figure)| {
            format!("| {number} | {what} | {figure} | [tests]({}) |", link(family, *number))
        }));
    }
    lines.join("\n") + "\n"
}

/// Returns the link from [`PAGE`] to the tests of a claim.
fn link(family: &str, number: u8) -> String {
    format!("safety-tests.md#{family}-{number}")
}

/// Returns the lists of tests, by claim.
fn lists(tests: &BTreeMap<ClaimId, Vec<Test>>) -> String {
    let mut lines = Vec::new();
    for (family, title, claims) in FAMILIES {
        lines.push(format!("\n## {title}\n"));
        for (number, what, figure) in claims {
            let figure = if figure.is_empty() { String::new() } else { format!(": {figure}") };
            let (first, rest) = family.split_at(1);
            lines.push(format!("### {}{rest} {number}\n\n{what}{figure}.\n", first.to_uppercase()));
            let injected = injected(*number);
            if family == "hazard" && !injected.is_empty() {
                lines.push(format!("Injected by the campaign: {}.\n", injected.join("; ")));
            }
            let shown = tests.get(&(family, *number)).into_iter().flatten();
            lines.extend(shown.map(|(file, words)| format!("- [{words}](../{file})")));
            lines.push(String::new());
        }
    }
    lines.join("\n")
}

/// Returns the kinds of fault that the campaign injects for a hazard.
fn injected(hazard: u8) -> Vec<&'static str> {
    catalogue::kinds().filter(|kind| kind.hazard == hazard).map(|kind| kind.name).collect()
}

#[test]
fn every_expectation_of_the_campaign_has_the_limit_of_the_page() {
    let page = fs::read_to_string(PAGE).unwrap();
    for Expectation { hazard, limit, without_timer, .. } in EXPECTATIONS {
        let begin = format!("| {hazard} | ");
        let (_, hazards) = page.split_once("\n## Hazards\n").unwrap();
        let line = hazards.lines().find(|line| line.starts_with(&begin)).unwrap();
        for limit in [Some(*limit), *without_timer].into_iter().flatten() {
            assert!(line.contains(&limit.to_string()), "{limit:?} is not the limit of: {line}");
        }
    }
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
fn every_number_in_a_test_name_is_a_claim() {
    for (claim, tests) in tests() {
        let (family, number) = claim;
        let (.., claims) = FAMILIES.iter().find(|(known, ..)| *known == family).unwrap();
        let is_claimed = claims.iter().any(|(claimed, ..)| *claimed == number);
        assert!(is_claimed, "there is no {family} {number}: {tests:?}");
    }
}

#[test]
fn pages_have_the_claims_and_the_existing_tests() {
    for (path, expected) in [(PAGE, tables()), (TESTS_PAGE, lists(&tests()))] {
        let page = fs::read_to_string(path).unwrap();
        let (head, found) = page.split_once(MARK).unwrap();
        if std::env::var_os("GOLDEN").is_some_and(|golden| golden == "write") {
            fs::write(path, format!("{head}{MARK}{expected}")).unwrap();
            continue;
        }
        let mut lines = found.lines().zip(expected.lines());
        let differs = lines.find(|(found, expected)| found != expected);
        assert!(
            found == expected,
            "{path}: {differs:?}; rewrite it with GOLDEN=write cargo test --test repository"
        );
    }
}

#[test]
fn test_names_are_split_into_claims_and_words() {
    let one = (vec![("hazard", 12)], "a jump and a wrap".to_owned());
    assert_eq!(parse_name("hazard_12_a_jump_and_a_wrap"), Some(one));
    let three = (vec![("hazard", 6), ("hazard", 7), ("promise", 8)], "end".to_owned());
    assert_eq!(parse_name("hazard_06_and_07_and_promise_08_end"), Some(three));
    assert_eq!(parse_name("a_hazard_12_in_words"), None);
    assert_eq!(parse_name("hazard_of_a_jump"), None);
}
