//! clippy.toml of the rack against that of the root, which is the bench's, too.

use std::fs;
use std::path::Path;

#[test]
fn rack_refuses_what_the_root_refuses_and_more() {
    let [root, rack, bench] = ["", "src", "src/bench"].map(settings);
    assert_eq!(bench, root);
    assert_eq!(rack.len(), root.len());
    for (key, value) in root {
        let other = &rack[&key];
        match (value.as_array(), other.as_array()) {
            (Some(some), Some(all)) => assert!(all.starts_with(some) && all.len() > some.len()),
            _ => assert_eq!(&value, other, "{key}"),
        }
    }
}

fn settings(folder: &str) -> toml::Table {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder).join("clippy.toml");
    fs::read_to_string(file).unwrap().parse().unwrap()
}
