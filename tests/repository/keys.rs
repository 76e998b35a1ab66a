//! docs/configuration.md against the keys that a configuration file may have.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use crate::pages::{self, Page};

const PAGE: &str = "docs/configuration.md";

const ROBOT_PAGE: &str = "docs/robots.md";

/// A section as in `controller.tank`, and a key of it.
pub(crate) type Key = (String, String);

/// Cells of a key on the page.
pub(crate) struct Row {
    pub(crate) range: String,
    default: String,
}

/// A field of a struct of `config::raw`.
#[derive(Clone, Debug)]
pub(crate) struct Field {
    key: String,
    /// Its own type.
    pub(crate) of: String,
    is_optional: bool,
}

#[test]
fn every_key_is_on_the_page_with_its_default() {
    assert_documented(PAGE, &rows(), &keys());
    assert!(keys().len() > 130, "{} keys", keys().len());
}

#[test]
fn every_key_of_a_robot_file_is_on_its_page() {
    let keys = keys_of("RobotFile");
    assert_documented(ROBOT_PAGE, &rows_of(ROBOT_PAGE), &keys);
    assert!(keys.len() > 20, "{} keys", keys.len());
}

/// Compares the keys of a page with those of the source, and their defaults.
fn assert_documented(page: &str, rows: &BTreeMap<Key, Row>, keys: &BTreeMap<Key, Field>) {
    let [on_page, in_source] = [rows.keys().collect(), keys.keys().collect::<BTreeSet<_>>()];
    let difference: Vec<_> = on_page.symmetric_difference(&in_source).collect();
    assert!(difference.is_empty(), "in {page} or src/config/raw*.rs alone: {difference:?}");
    for (key, field) in keys {
        let default = &rows[key].default;
        assert_eq!(default == "required", !field.is_optional, "{key:?}: default {default}");
    }
}

#[test]
fn every_key_of_the_shipped_files_is_on_the_page() {
    let rows = rows();
    let files = fs::read_dir("config").unwrap().map(|entry| entry.unwrap().path());
    let files: Vec<_> = files.filter(|path| path.is_file()).collect();
    assert!(files.len() >= 4, "{files:?}");
    for file in files {
        let table = fs::read_to_string(&file).unwrap().parse::<toml::Table>().unwrap();
        let mut used = BTreeSet::new();
        flatten("", &toml::Value::Table(table), &mut used);
        for key in used {
            assert!(rows.contains_key(&key), "{}: {key:?} is not in {PAGE}", file.display());
        }
    }
}

/// Keys of the page. Every row must have all five cells.
pub(crate) fn rows() -> BTreeMap<Key, Row> {
    rows_of(PAGE)
}

/// Returns the keys of a page; the keys of `## Whole file` are in no section. A heading may name several sections, and a row
/// several keys.
fn rows_of(page: &str) -> BTreeMap<Key, Row> {
    let page = Page::read(page);
    let mut rows = BTreeMap::new();
    let mut sections = vec![String::new()];
    for line in page.prose() {
        if let Some(heading) = line.strip_prefix('#') {
            let names = heading.split(", ").map(|name| name.trim_matches(['#', ' ', '[', ']']));
            sections = names.map(|name| name.replace("Whole file", "")).collect();
        } else if let Some(row) = line.strip_prefix("| `") {
            let Some((key, row)) = row.split_once("` | ") else { continue };
            let cells: Vec<&str> = row.trim_end_matches('|').split(" | ").map(str::trim).collect();
            let [_unit, range, default, _effect] = *cells else {
                assert!(sections.concat().is_empty() || sections[0].contains(' '), "{line}");
                continue;
            };
            assert!(cells.iter().all(|cell| !cell.is_empty()), "{sections:?}: {line}");
            for (section, key) in sections
                .iter()
                .flat_map(|section| key.split("`, `").map(|key| (section.clone(), key.to_owned())))
            {
                let row = Row { range: range.to_owned(), default: default.to_owned() };
                let known = rows.insert((section, key), row);
                assert!(known.is_none(), "{sections:?}: twice: {line}");
            }
        }
    }
    rows
}

/// Keys of `config::raw`.
pub(crate) fn keys() -> BTreeMap<Key, Field> {
    keys_of("File")
}

/// Keys of the section `root` of `config::raw` and below.
fn keys_of(root: &str) -> BTreeMap<Key, Field> {
    let is_raw = |path: &std::path::PathBuf| path.to_str().unwrap().starts_with("src/config/raw");
    let sources = pages::files(Path::new("src/config"), &["rs"]).into_iter().filter(is_raw);
    let mut structs = BTreeMap::new();
    for source in sources {
        read(&fs::read_to_string(source).unwrap(), &mut structs);
    }
    let mut keys = BTreeMap::new();
    walk("", root, &structs, &mut keys);
    keys
}

/// Fields of the sections of a source file, by the name of the section's type: `Name {`, then `key: Type,`.
fn read(source: &str, structs: &mut BTreeMap<String, Vec<Field>>) {
    let mut fields: Option<&mut Vec<Field>> = None;
    for line in source.lines().map(str::trim) {
        let name = line.strip_suffix(" {").filter(|name| name.chars().all(char::is_alphanumeric));
        if let Some(name) = name {
            fields = Some(structs.entry(name.to_owned()).or_default());
        } else if line == "}" {
            fields = None;
        } else if let (Some(fields), Some((name, of))) = (&mut fields, line.split_once(": ")) {
            let is_optional = of.starts_with("Optional<");
            let of = WRAPPERS.iter().find_map(|wrapper| of.strip_prefix(wrapper)).unwrap_or(of);
            let of = of.trim_end_matches([',', '>']).to_owned();
            fields.push(Field { key: name.trim_start_matches("r#").to_owned(), of, is_optional });
        }
    }
}

/// Types of keys and sections around their own type.
const WRAPPERS: [&str; 6] =
    ["Value<", "Optional<", "Option<Sections<", "Option<", "Sections<", "OrEmpty<"];

/// Adds the keys of a struct and of those in it.
fn walk(
    section: &str,
    name: &str,
    structs: &BTreeMap<String, Vec<Field>>,
    keys: &mut BTreeMap<Key, Field>,
) {
    for field in &structs[name] {
        let Field { key, of, .. } = field;
        if structs.contains_key(of) {
            walk(&below(section, key), of, structs, keys);
        } else {
            keys.insert((section.to_owned(), key.clone()), field.clone());
        }
    }
}

/// Adds the keys of a TOML value.
fn flatten(section: &str, value: &toml::Value, keys: &mut BTreeSet<Key>) {
    let Some(table) = value.as_table() else { return };
    for (key, value) in table {
        let tables = value.as_array().filter(|list| list.iter().all(toml::Value::is_table));
        match tables {
            Some(list) => list.iter().for_each(|value| flatten(&below(section, key), value, keys)),
            None if value.is_table() => flatten(&below(section, key), value, keys),
            None => _ = keys.insert((section.to_owned(), key.clone())),
        }
    }
}

fn below(section: &str, key: &str) -> String {
    if section.is_empty() { key.to_owned() } else { format!("{section}.{key}") }
}

#[test]
fn every_shipped_fault_and_quirk_is_on_its_page() {
    let page = Page::read("docs/faults.md").text;
    let mut names = BTreeSet::new();
    for file in pages::files(Path::new("config/scenarios"), &["toml"]) {
        let text = fs::read_to_string(&file).unwrap();
        let script: toml::Table = text.parse().unwrap();
        let faults = script.get("fault").and_then(toml::Value::as_array).into_iter().flatten();
        names.extend(faults.map(|fault| fault["kind"].as_str().unwrap().to_owned()));
        if file.parent().unwrap().ends_with("quirks") {
            names.insert(file.file_stem().unwrap().to_str().unwrap().to_owned());
        }
    }
    let missing: Vec<_> =
        names.iter().filter(|name| !page.contains(&format!("| `{name}` |"))).collect();
    assert!(missing.is_empty() && names.len() > 40, "{missing:?}");
}
