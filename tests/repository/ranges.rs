//! Ranges of docs/configuration.md against the configuration: it refuses a number beyond either end, with the key.

use std::fs;
use std::path::Path;

use toml::{Table, Value};

use crate::keys;
use config::Config;

/// A file with most of the optional sections, and those that it lacks.
const FILE: &str = "config/kraft_like.toml";
const OPTIONAL: &str = r#"
[operator]
[controller.tank]
initial_j = 1.0
min_j = 0.1
low_j = 0.5
max_j = 2.0
refill_ns_per_m_per_j = 10.0
[remote.sphere]
centre_m = [0.4, 0.0, 0.9]
radius_m = 0.1
stiffness_n_per_m = 2000.0
damping_ns_per_m = 20.0
[remote.link.sensor]
address = "192.168.1.1"
counts_per_n = 1e6
counts_per_nm = 1e6
"#;

#[test]
fn numbers_beyond_the_ranges_of_the_page_are_refused() {
    let fields = keys::keys();
    let mut accepted = Vec::new();
    let mut checked = 0;
    for (key, row) in keys::rows() {
        let Some(ends) = range(&row.range) else { continue };
        let of = &*fields[&key].of;
        for beyond in beyond(ends, of).into_iter().flatten() {
            let Some(text) = with(&key, beyond) else { continue };
            checked += 1;
            let problems = Config::parse(Path::new(FILE), &text).err().map(|found| found.0);
            let named = |problem: &config::Problem| problem.key.ends_with(&*key.1);
            if !problems.is_some_and(|problems| problems.iter().any(named)) {
                accepted.push(format!("[{}] {} = {}: {}", key.0, key.1, beyond, row.range));
            }
        }
    }
    assert!(accepted.is_empty(), "{}", accepted.join("\n"));
    assert!(checked > 90, "{checked} numbers");
}

/// Both ends of a range as the page writes it: `250–100,000`, `0–10⁶`.
fn range(text: &str) -> Option<[f64; 2]> {
    let (low, high) = text.split_once('–')?;
    let high = high.split([' ', ';']).next()?.trim_end_matches(',');
    Some([number(low)?, number(high)?])
}

fn number(text: &str) -> Option<f64> {
    let text = text.replace('−', "-").replace(',', "");
    let text = text.replace("10⁻⁶", "1e-6").replace("4·10⁶", "4e6").replace("10⁶", "1e6");
    text.parse().ok()
}

/// A number below and one above a range, for a field of this type.
fn beyond([low, high]: [f64; 2], of: &str) -> [Option<f64>; 2] {
    if of == "f64" {
        let step = |end: f64| (end.abs() * 0.01).max(1e-7);
        return [Some(low - step(low)), Some(high + step(high))];
    }
    [Some(low - 1.0), Some(high + 1.0)].map(|end| end.filter(|end| *end >= 0.0))
}

/// The file with another value of a key; `None` where it has no such section.
fn with((section, key): &keys::Key, value: f64) -> Option<String> {
    let mut file: Table = fs::read_to_string(FILE).unwrap().parse().unwrap();
    merge(&mut file, OPTIONAL.parse().unwrap());
    let mut place = &mut file;
    for part in section.split('.') {
        let value = place.get_mut(part)?;
        let first = if value.is_array() { value.get_mut(0)? } else { value };
        place = first.as_table_mut()?;
    }
    let is_whole = !matches!(&*keys::keys()[&(section.clone(), key.clone())].of, "f64");
    let text = if is_whole { format!("{value}") } else { format!("{value:?}") };
    let value = format!("v = {text}").parse::<Table>().unwrap()["v"].clone();
    place.insert(key.clone(), value);
    Some(toml::to_string(&file).unwrap())
}

/// Adds the sections that a file lacks.
fn merge(file: &mut Table, more: Table) {
    for (key, value) in more {
        match (file.get_mut(&key), value) {
            (Some(Value::Table(there)), Value::Table(more)) => merge(there, more),
            (_, value) => _ = file.insert(key, value),
        }
    }
}

#[test]
fn ranges_are_read_as_the_page_writes_them() {
    assert_eq!(range("250–100,000"), Some([250.0, 100_000.0]));
    assert_eq!(range("−10–10"), Some([-10.0, 10.0]));
    assert_eq!(range("1–1000, at least the cycle"), Some([1.0, 1000.0]));
    assert_eq!(range("10⁻⁶–10⁶"), Some([1e-6, 1e6]));
    assert_eq!(range("≥ 0"), None);
}
