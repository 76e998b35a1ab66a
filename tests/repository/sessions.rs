//! docs/sessions.md: its table of tags is that of the program.

use std::fs;

use inputs::intermediates::COUNT;
use inputs::table;

fn page() -> String {
    fs::read_to_string("docs/sessions.md").unwrap()
}

#[test]
fn page_has_each_tag_with_its_name() {
    let page = page();
    let rows = page.lines().filter_map(|line| {
        let cells: Vec<_> = line.split('|').map(|cell| cell.trim().trim_matches('`')).collect();
        let tag = u8::from_str_radix(cells.get(1)?, 16).ok()?;
        Some((tag, (*cells.get(2)?).to_owned()))
    });
    let expected = table::ALL.iter().map(|(tag, name)| (*tag, (*name).to_owned()));
    assert_eq!(rows.collect::<Vec<_>>(), expected.collect::<Vec<_>>());
}

#[test]
fn page_has_the_version_and_the_number_of_intermediates() {
    let page = page();
    assert!(page.contains(&format!("version of the format, u16, now {}.", table::FORMAT)));
    assert!(page.contains(&format!("digest {COUNT} bytes")));
}
