//! The book: its table of contents, its links, the dates of its decisions.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::pages::{self, Page};

const SUMMARY: &str = "docs/SUMMARY.md";
const INDEX: &str = "docs/adr/index.md";

/// Pages outside of the book whose links are checked, too.
const OTHERS: [&str; 7] = [
    "README.md",
    "CONTRIBUTING.md",
    "ARCHITECTURE.md",
    "SECURITY.md",
    "STYLE.md",
    "CHANGELOG.md",
    "lab/README.md",
];

#[test]
fn summary_lists_every_page_once() {
    let summary = Page::read(SUMMARY);
    let listed: Vec<PathBuf> =
        summary.links().into_iter().map(|link| summary.target(link).0).collect();
    let once: BTreeSet<&PathBuf> = listed.iter().collect();
    assert_eq!(once.len(), listed.len(), "a page is listed twice");
    let book = pages::book();
    let pages = book.iter().map(|page| &page.path).filter(|path| *path != Path::new(SUMMARY));
    assert_eq!(once, pages.collect());
}

#[test]
fn every_link_and_anchor_resolves() {
    let pages: Vec<Page> =
        pages::book().into_iter().chain(OTHERS.into_iter().map(Page::read)).collect();
    let mut broken = Vec::new();
    let mut checked = 0;
    for page in &pages {
        for link in page.links() {
            checked += 1;
            if let Some(reason) = unresolved(page, link) {
                broken.push(format!("{}: {link}: {reason}", page.path.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
    assert!(checked > 100, "{checked} links");
}

#[test]
fn simulated_runs_of_the_pages_have_a_latch_of_their_own() {
    let pages = pages::book().into_iter().chain(OTHERS.into_iter().map(Page::read));
    let mut checked = 0;
    for page in pages {
        for block in page.text.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next())
        {
            if block.contains("frhc sim ") && block.contains("frhc run ") {
                checked += 1;
                let has_latch = block.contains("STATE_DIRECTORY=");
                assert!(has_latch, "{}: no STATE_DIRECTORY in\n{block}", page.path.display());
            }
        }
    }
    assert!(checked > 3, "{checked} blocks");
}

/// Why a link leads nowhere.
fn unresolved(page: &Page, link: &str) -> Option<&'static str> {
    let (path, anchor) = page.target(link);
    if !path.exists() {
        return Some("no such file");
    }
    let is_page = path.extension().is_some_and(|extension| extension == "md");
    let is_in_book = |path: &Path| path.starts_with("docs");
    if is_page && is_in_book(&page.path) && !is_in_book(&path) {
        return Some("mdBook has no page for a Markdown file outside of docs/");
    }
    if page.path != Path::new(SUMMARY) && is_in_book(&page.path) && path.ends_with("README.md") {
        return Some("mdBook names this page index.html, and does not change links to it");
    }
    let anchor = anchor?;
    let is_there = is_page && Page::read(path).anchors().iter().any(|known| known == anchor);
    (!is_there).then_some("no such heading")
}

#[test]
fn every_adr_has_a_date_and_a_status_that_the_index_repeats() {
    let index = Page::read(INDEX);
    let adrs = pages::book().into_iter().filter(|page| page.path.starts_with("docs/adr"));
    let adrs: Vec<Page> = adrs.filter(|page| page.path != Path::new(INDEX)).collect();
    assert!(adrs.len() >= 19, "{} ADRs", adrs.len());
    for adr in &adrs {
        let name = adr.path.file_name().unwrap().to_str().unwrap();
        let [status, date] = ["Status", "Date"].map(|key| line(adr, key));
        let is_date = date.len() == 10 && date.split('-').all(|part| part.parse::<u16>().is_ok());
        assert!(is_date, "{name}: date {date}");
        assert!(["accepted", "superseded"].contains(&&*status), "{name}: status {status}");
        let title = adr.headings().next().unwrap();
        let (number, title) = title.split_once(". ").unwrap();
        let remark = if status == "superseded" { ", superseded" } else { "" };
        let row = format!("| {number} | [{title}]({name}){remark} |");
        assert!(index.prose().any(|line| line == row), "{INDEX} must have the row\n{row}");
    }
    let rows = index.prose().filter(|line| line.contains(" | [")).count();
    assert_eq!(rows, adrs.len(), "rows of {INDEX}");
}

/// The value of a line `Key: value`.
fn line(page: &Page, key: &str) -> String {
    let begin = format!("{key}: ");
    let found = page.prose().find_map(|line| line.strip_prefix(&*begin));
    found.unwrap_or_default().trim_end().to_owned()
}
