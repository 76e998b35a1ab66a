//! Minimal Markdown parser for the checks of this folder: pages, headings with their anchors, links.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// A Markdown file of the repository.
pub(crate) struct Page {
    /// From the root of the repository.
    pub(crate) path: PathBuf,
    pub(crate) text: String,
}

impl Page {
    /// Reads a page by its path from the root.
    pub(crate) fn read(path: impl Into<PathBuf>) -> Self {
        let path = path.into();
        let text = fs::read_to_string(&path).unwrap();
        Self { path, text }
    }

    /// Lines outside of code blocks.
    pub(crate) fn prose(&self) -> impl Iterator<Item = &str> {
        let mut is_code = false;
        self.text.lines().filter(move |line| {
            let is_fence = line.trim_start().starts_with("```");
            is_code ^= is_fence;
            !is_code && !is_fence
        })
    }

    /// Headings without their marks.
    pub(crate) fn headings(&self) -> impl Iterator<Item = &str> {
        let headings = self.prose().filter(|line| line.starts_with('#'));
        headings.map(|line| line.trim_matches(['#', ' ']))
    }

    /// Anchors of the headings, as mdBook and GitHub both name them.
    pub(crate) fn anchors(&self) -> Vec<String> {
        let mut seen = BTreeMap::<String, u32>::new();
        let mut anchors = Vec::new();
        for heading in self.headings() {
            let anchor = anchor(heading);
            let count = seen.entry(anchor.clone()).or_default();
            anchors.push(if *count == 0 { anchor } else { format!("{anchor}-{count}") });
            *count += 1;
        }
        anchors
    }

    /// Targets of the links that lead to files or anchors of this repository.
    pub(crate) fn links(&self) -> Vec<&str> {
        let targets = self.prose().flat_map(|line| line.split("](").skip(1));
        let targets = targets.filter_map(|rest| Some(rest.split_once(')')?.0));
        let is_outside = |target: &&str| target.contains("://") || target.starts_with("mailto:");
        targets.filter(|target| !is_outside(target)).collect()
    }

    /// The file that a link of this page leads to, from the root, and its anchor.
    pub(crate) fn target<'l>(&self, link: &'l str) -> (PathBuf, Option<&'l str>) {
        let (file, anchor) = match link.split_once('#') {
            Some((file, anchor)) => (file, Some(anchor)),
            None => (link, None),
        };
        if file.is_empty() {
            return (self.path.clone(), anchor);
        }
        let mut path = self.path.parent().unwrap().to_path_buf();
        for part in Path::new(file).iter() {
            if part == ".." {
                path.pop();
            } else if part != "." {
                path.push(part);
            }
        }
        (path, anchor)
    }
}

/// The pages of the book, those of the ADRs included, in alphabetical order.
pub(crate) fn book() -> Vec<Page> {
    let mut paths = files(Path::new("docs"), &["md"]);
    paths.sort();
    paths.into_iter().map(Page::read).collect()
}

/// Files below `folder` with one of these extensions.
pub(crate) fn files(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            let extension = path.extension().and_then(|extension| extension.to_str());
            if path.is_dir() {
                folders.push(path);
            } else if extension.is_some_and(|extension| extensions.contains(&extension)) {
                files.push(path);
            }
        }
    }
    files
}

/// Anchor of a heading: letters, digits, `-` and `_` in lower case, blanks as `-`.
fn anchor(heading: &str) -> String {
    let kept = |c: char| c.is_alphanumeric() || c == '-' || c == '_' || c == ' ';
    let anchor = heading.chars().filter(|c| kept(*c)).map(|c| if c == ' ' { '-' } else { c });
    anchor.flat_map(char::to_lowercase).collect()
}

#[test]
fn headings_become_anchors() {
    assert_eq!(anchor("Eq. 10"), "eq-10");
    assert_eq!(anchor("[controller.readings]"), "controllerreadings");
    let text = "# One\n```\n# not one\n```\n## One\n".to_owned();
    let page = Page { path: "docs/a.md".into(), text };
    assert_eq!(page.anchors(), ["one", "one-1"]);
}

#[test]
fn links_are_seen_from_their_page() {
    let text = "[a](b.md#c), [d](../src/e.rs), [f](https://g.h)\n`` [x] ``\n".to_owned();
    let page = Page { path: "docs/adr/a.md".into(), text };
    assert_eq!(page.links(), ["b.md#c", "../src/e.rs"]);
    assert_eq!(page.target("b.md#c"), (PathBuf::from("docs/adr/b.md"), Some("c")));
    assert_eq!(page.target("../src/e.rs"), (PathBuf::from("docs/src/e.rs"), None));
    assert_eq!(page.target("#c"), (page.path.clone(), Some("c")));
}
