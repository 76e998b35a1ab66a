//! ARCHITECTURE.md against the sources: the table of rooms matches the manifests, files have no circular imports, rooms
//! without side effects name no I/O, clock or log, and object indices are only in `canopen`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Rooms without side effects: no I/O, no clock, no log.
const PURE: &[&str] = &[
    "units",
    "toml_input",
    "canopen",
    "canopen_device",
    "faults",
    "canopen_tools",
    "controller",
    "robot",
    "contract",
    "remote",
    "sim",
];

/// Names that a pure room must not use.
const IMPURE: &[&str] = &[
    "std::fs",
    "std::net",
    "std::thread",
    "std::process",
    "std::env",
    "time::SystemTime",
    "std::time::Instant",
    "println!",
    "eprintln!",
];

#[test]
fn table_of_rooms_matches_the_manifests() {
    let in_manifests = rooms().map(|room| (room.clone(), dependencies(&room))).collect();
    assert_eq!(documented_rooms(), in_manifests);
}

#[test]
fn room_depends_only_on_rooms_of_lower_levels() {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let plan = text.split("```text").find(|block| block.contains("the rack, src/")).unwrap();
    let mut level = BTreeMap::new();
    for line in plan.lines() {
        let mut words = line.split([' ', '·']).filter(|word| !word.is_empty());
        let Some(Ok(number)) = words.next().map(str::parse::<u32>) else { continue };
        level.extend(words.map(|name| (name.to_owned(), number)));
    }
    let mut checked = 0;
    for room in rooms() {
        for below in dependencies(&room) {
            assert!(level[&room] > level[&below], "{room} depends on {below}");
            checked += 1;
        }
    }
    assert!(checked > 30, "{checked} dependencies");
}

#[test]
fn every_room_has_the_lints_and_no_automatic_targets() {
    for room in rooms() {
        let manifest = manifest(&room);
        assert_eq!(manifest["lints"]["workspace"].as_bool(), Some(true), "{room}: lints");
        let package = &manifest["package"];
        for key in ["autotests", "autobenches", "autoexamples", "build", "publish"] {
            assert_eq!(package[key].as_bool(), Some(false), "{room}: {key}");
        }
        assert_eq!(manifest["lib"]["name"].as_str(), Some(room.as_str()));
        assert_eq!(package["name"].as_str().unwrap(), format!("frhc-{}", room.replace('_', "-")));
        let lib = fs::read_to_string(folder(&room).join("lib.rs")).unwrap();
        assert!(lib.contains("#![forbid(unsafe_code)]"), "{room}: unsafe code");
    }
}

#[test]
fn every_room_is_a_workspace_member() {
    let text = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let manifest: toml::Table = text.parse().unwrap();
    for list in ["members", "default-members"] {
        let listed = manifest["workspace"][list].as_array().unwrap().iter();
        let listed = listed.filter_map(toml::Value::as_str).filter(|path| *path != ".");
        let listed: BTreeSet<PathBuf> = listed.map(|path| root().join(path)).collect();
        assert_eq!(listed, rooms().map(|room| folder(&room)).collect(), "{list}");
    }
}

#[test]
fn pure_rooms_have_no_side_effects_and_no_object_indices() {
    let mut violations = Vec::new();
    for room in rooms() {
        for file in sources(&room) {
            let text = fs::read_to_string(&file).unwrap();
            let found = violations_in(&room, &text);
            violations.extend(found.into_iter().map(|what| format!("{}: {what}", file.display())));
        }
    }
    assert!(violations.is_empty(), "{}", violations.join("\n"));
}

#[test]
fn files_of_a_room_have_no_circular_imports() {
    let mut circles: BTreeMap<_, _> =
        rooms().map(|room| (room.clone(), in_cycles(imports(&room)))).collect();
    circles.retain(|_, left| !left.is_empty());
    assert!(circles.is_empty(), "{circles:#?}");
}

#[test]
fn circular_imports_are_found() {
    let graph = |arrows: &[(&str, &str)]| {
        let mut graph = Imports::new();
        for (from, to) in arrows {
            graph.entry((*from).to_owned()).or_default().insert((*to).to_owned());
            graph.entry((*to).to_owned()).or_default();
        }
        graph
    };
    let tree = [("lib", "a"), ("a", "b"), ("lib", "b")];
    assert!(in_cycles(graph(&tree)).is_empty());
    let circle = [tree.as_slice(), &[("b", "c"), ("c", "a"), ("c", "d")]].concat();
    let found: Vec<String> = in_cycles(graph(&circle)).into_keys().collect();
    assert_eq!(found, ["a", "b", "c"]);
}

#[test]
fn items_marked_for_tests_are_dropped_and_all_else_is_kept() {
    for item in [
        "mod tests;",
        "mod tests {\n    use super::*;\n\n    const TEXT: &str = \"\n[a]\nb;\n\";\n}",
        "#[path = \"laws.rs\"]\nmod tests;",
        "#[expect(\n    clippy::float_cmp,\n    reason = \"exact\"\n)]\nmod tests;",
        "/// Steps of a test;\nuse crate::c::C;",
        "pub(crate) use crate::{\n    c::C,\n    d::D,\n};",
        "fn sample(\n    a: u8,\n) -> u8 {\n    a\n}",
        "const TEXT: &str =\n    \"long\";",
        "const ALL: [u8; 1] = [\n    1,\n];",
    ] {
        let text = |item: &str| format!("mod a;\n{item}mod b;\n\nuse crate::b::B;\n");
        assert_eq!(production(&text(&format!("#[cfg(test)]\n{item}\n"))), text(""), "{item}");
    }
    let field = "struct A {\n    a: u8,\n    #[cfg(test)]\n    b: u8,\n    c: u8,\n}\n";
    assert_eq!(production(field), "struct A {\n    a: u8,\n    c: u8,\n}\n");
    assert_eq!(violations_in("robot", "#[cfg(test)]\nmod tests;\nuse std::fs;").len(), 1);
}

#[test]
fn monitor_of_the_campaign_imports_neither_node_nor_controller() {
    let mut count = 0;
    for path in rust_files(folder("campaign").join("monitor")) {
        let text = ungrouped(&fs::read_to_string(&path).unwrap());
        let foreign = text.lines().find(|line| {
            ["node::", "controller::"].iter().any(|room| line.starts_with(&format!("use {room}")))
        });
        assert_eq!(foreign, None, "{}", path.display());
        count += 1;
    }
    assert!(count > 5, "{count} files");
}

#[test]
fn side_effects_and_object_indices_are_found() {
    assert!(violations_in("controller", "let torque = 0x6071;\n#[cfg(test)]").len() == 1);
    for (room, line) in [
        ("canopen", "use std::time::Instant;"),
        ("canopen", "use std::{\n    fmt,\n    time::{Duration, Instant},\n};"),
        ("robot", "println!(\"here\");"),
        ("node", "const TORQUE: u16 = 0x6071;"),
    ] {
        assert_eq!(violations_in(room, line).len(), 1, "{room}: {line}");
    }
    assert!(
        violations_in("canopen", "// by std::time::Instant, const TORQUE: u16 = 0x6071;")
            .is_empty()
    );
}

/// Returns the rooms of the table in ARCHITECTURE.md with their dependencies.
fn documented_rooms() -> BTreeMap<String, BTreeSet<String>> {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let rooms = text.split("## Rooms").nth(1).unwrap().split("## Invariants").next().unwrap();
    let rows = rooms.lines().filter(|line| line.starts_with("| `"));
    let row = |line: &str| {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let room = cells[1].trim_matches('`').to_owned();
        let below = cells[3].split('`').skip(1).step_by(2).map(str::to_owned);
        (room, below.collect())
    };
    rows.map(row).collect()
}

/// Returns the folders of `src/` and `src/bench/` that are crates.
fn rooms() -> impl Iterator<Item = String> {
    let folders = ["", "bench"].map(|half| fs::read_dir(src().join(half)).unwrap());
    let folders = folders.into_iter().flatten().map(|entry| entry.unwrap().path());
    let rooms = folders.filter(|folder| folder.join("Cargo.toml").is_file());
    rooms.map(|folder| folder.file_name().unwrap().to_str().unwrap().to_owned())
}

/// Returns the folder of a room: on the bench, or in the rack.
fn folder(room: &str) -> PathBuf {
    let bench = src().join("bench").join(room);
    if bench.is_dir() { bench } else { src().join(room) }
}

/// Returns the rooms that a room depends on, except for its tests.
fn dependencies(room: &str) -> BTreeSet<String> {
    let manifest = manifest(room);
    let all = manifest.get("dependencies").and_then(toml::Value::as_table);
    let names = all.into_iter().flat_map(toml::Table::keys).cloned();
    names.filter(|name| folder(name).join("Cargo.toml").is_file()).collect()
}

fn manifest(room: &str) -> toml::Table {
    fs::read_to_string(folder(room).join("Cargo.toml")).unwrap().parse().unwrap()
}

/// Returns the violations in `text` as a file of `room`.
fn violations_in(room: &str, text: &str) -> Vec<String> {
    let mut violations = Vec::new();
    let production = ungrouped(&production(text));
    let production = production.as_str();
    if PURE.contains(&room) {
        for impure in IMPURE.iter().filter(|impure| names(production, impure)) {
            violations.push(format!("names {impure}"));
        }
    }
    if !room.starts_with("canopen") {
        violations.extend(object_indices(production).map(|index| format!("writes {index} itself")));
    }
    violations
}

/// Returns the numbers written like an index of an object dictionary: 0x1000 to 0x9FFF.
fn object_indices(text: &str) -> impl Iterator<Item = &str> {
    let code = text.lines().filter(|line| !is_comment(line));
    let words = code.flat_map(|line| line.split(|c: char| !c.is_ascii_alphanumeric() && c != '_'));
    words.filter(|word| {
        let digits = word.strip_prefix("0x").unwrap_or_default();
        digits.len() == 4
            && digits.starts_with(|first: char| ('1'..='9').contains(&first))
            && digits.chars().all(|digit| digit.is_ascii_hexdigit())
    })
}

/// Returns whether a line of code, not a comment, uses `path`.
fn names(text: &str, path: &str) -> bool {
    let begins = |line: &str, at: usize| {
        !line[..at].ends_with(|before: char| before.is_alphanumeric() || "_:".contains(before))
    };
    text.lines()
        .filter(|line| !is_comment(line))
        .any(|line| line.match_indices(path).any(|(at, _)| begins(line, at)))
}

/// Returns `text` without its items marked `#[cfg(test)]`. The last line of a block has the indentation of its first, as
/// rustfmt writes it.
fn production(text: &str) -> String {
    let mut kept = String::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let indent = line.strip_suffix("#[cfg(test)]");
        let Some(indent) = indent.filter(|indent| indent.trim().is_empty()) else {
            kept.extend([line, "\n"]);
            continue;
        };
        let mut is_block = false;
        let mut is_last = |line: &str| {
            let ends = |all: &[&str]| all.iter().any(|end| line.strip_prefix(indent) == Some(end));
            is_block |= line.ends_with(['{', '(', '[']);
            is_block &= !ends(&[")]"]);
            if is_block { ends(&["}", "};", "];", ");"]) } else { line.ends_with([';', '}', ',']) }
        };
        lines.by_ref().filter(|line| !is_comment(line)).find(|line| is_last(line));
    }
    kept
}

/// Returns `text` with every `use a::{b, c::{d, e}};` written as one `use` for each item.
fn ungrouped(text: &str) -> String {
    let mut written = String::new();
    let mut statement = String::new();
    for line in text.lines() {
        let is_use = ["use ", "pub use ", "pub(crate) use ", "pub(super) use "]
            .iter()
            .any(|start| line.trim_start().starts_with(start));
        if statement.is_empty() && !is_use {
            written.extend([line, "\n"]);
            continue;
        }
        statement.push_str(line.trim());
        if statement.ends_with(';') {
            let (start, path) = statement.split_once("use ").unwrap_or_default();
            for item in items(path.trim_end_matches(';')) {
                written.extend([start, "use ", &item, ";\n"]);
            }
            statement.clear();
        }
    }
    written
}

/// Returns the paths of a tree like `a::{b, c::{d, self}}`.
fn items(tree: &str) -> Vec<String> {
    let Some((outer, group)) = tree.split_once('{') else {
        return vec![tree.trim().trim_end_matches("::self").to_owned()];
    };
    let group = group.strip_suffix('}').unwrap_or(group);
    let (mut depth, mut parts) = (0_i32, vec![String::new()]);
    for letter in group.chars() {
        depth += i32::from(letter == '{') - i32::from(letter == '}');
        match parts.last_mut() {
            Some(part) if letter != ',' || depth > 0 => part.push(letter),
            _ => parts.push(String::new()),
        }
    }
    let parts = parts.iter().map(|part| part.trim()).filter(|part| !part.is_empty());
    parts.flat_map(|part| items(&format!("{}{part}", outer.trim()))).collect()
}

fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with("//")
}

/// The modules of a room with the modules that each imports.
type Imports = BTreeMap<String, BTreeSet<String>>;

fn imports(room: &str) -> Imports {
    let folder = folder(room);
    let module = |file: &Path| {
        let path = file.strip_prefix(&folder).unwrap().with_extension("");
        let parts = path.iter().map(|part| part.to_str().unwrap());
        parts.filter(|part| !["lib", "mod"].contains(part)).collect::<Vec<_>>().join("::")
    };
    let texts: BTreeMap<String, String> = sources(room)
        .iter()
        .map(|file| (module(file), fs::read_to_string(file).unwrap()))
        .collect();
    let imported = |(module, text): (&String, &String)| {
        let production = ungrouped(&production(text));
        let lines = production.lines().filter_map(|line| line.trim().strip_prefix("use crate::"));
        let paths = lines.filter_map(|line| line.trim_end_matches(';').split(" as ").next());
        let named = paths.map(|path| file_of(path, &texts));
        (module.clone(), named.filter(|named| named != module).collect())
    };
    texts.iter().map(imported).collect()
}

/// Returns the module of `texts` that contains the item at `path`.
fn file_of(path: &str, texts: &BTreeMap<String, String>) -> String {
    let mut module = path;
    while !texts.contains_key(module) {
        module = module.rsplit_once("::").map_or("", |(outer, _)| outer);
    }
    module.to_owned()
}

/// Returns the modules on import cycles: repeatedly removes those that import nothing or are imported by none.
fn in_cycles(mut imports: Imports) -> Imports {
    loop {
        let imported: BTreeSet<String> = imports.values().flatten().cloned().collect();
        let before = imports.len();
        imports.retain(|module, below| !below.is_empty() && imported.contains(module));
        let left: BTreeSet<String> = imports.keys().cloned().collect();
        imports.values_mut().for_each(|below| below.retain(|module| left.contains(module)));
        if imports.len() == before {
            return imports;
        }
    }
}

/// Returns the source files of a room.
fn sources(room: &str) -> Vec<PathBuf> {
    rust_files(folder(room))
}

/// Returns the files below a folder that contain Rust.
fn rust_files(folder: PathBuf) -> Vec<PathBuf> {
    let (mut files, mut folders) = (Vec::new(), vec![folder]);
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            match path.extension() {
                _ if path.is_dir() => folders.push(path),
                Some(extension) if extension == "rs" => files.push(path),
                _ => {}
            }
        }
    }
    files
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn src() -> PathBuf {
    root().join("src")
}
