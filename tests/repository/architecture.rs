//! ARCHITECTURE.md against the sources: drawing and tables have every room, dependencies run down the drawing, files have
//! no circular imports, rooms without side effects name no I/O, clock or log, and object indices are only in `canopen`.

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
fn map_has_each_room_once_in_drawing_and_tables() {
    let rooms: Vec<String> = rooms().collect::<BTreeSet<_>>().into_iter().collect();
    let mut in_tables = documented_rooms();
    in_tables.sort();
    assert_eq!(in_tables, rooms);
    let levels = levels();
    let drawn: Vec<&String> = levels.keys().filter(|room| *room != "frhc").collect();
    assert_eq!(drawn, rooms.iter().collect::<Vec<_>>());
}

#[test]
fn room_depends_only_on_rooms_of_lower_levels() {
    let level = levels();
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
    let listed = manifest["workspace"]["members"].as_array().unwrap().iter();
    let listed = listed.filter_map(toml::Value::as_str).filter(|path| *path != ".");
    let listed: BTreeSet<PathBuf> = listed.map(|path| root().join(path)).collect();
    assert_eq!(listed, rooms().map(|room| folder(&room)).collect());
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
fn files_of_a_crate_have_no_circular_imports() {
    let beside = ["lab/src", "link/src"].map(|folder| root().join(folder));
    let folders = rooms().map(|room| folder(&room)).chain(beside);
    let mut circles: BTreeMap<_, _> =
        folders.map(|folder| (folder.clone(), in_cycles(imports(&modules(&folder))))).collect();
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
fn imports_are_read_by_every_path_to_a_module() {
    let imports_with = |c: &str| {
        let texts = [
            ("", "pub use a::b::B;\npub(crate) use a::b as other;\n"),
            ("a", "pub use b::B as C;\n\nuse b::D;\n"),
            ("a::b", "pub struct B;\n"),
            ("a::c", c),
            ("d", ""),
        ];
        let texts = texts.map(|(module, text)| (module.to_owned(), text.to_owned()));
        imports(&texts.into_iter().collect())
    };
    let of_c = |text: &str| imports_with(text)["a::c"].iter().cloned().collect::<Vec<_>>();
    for (text, found) in [
        ("use crate::{\n    a::b::D,\n    d::E,\n};", vec!["a::b", "d"]),
        ("use super::F;", vec!["a"]),
        ("use super::super::d;", vec!["d"]),
        ("use super::super::B;", vec!["a::b"]),
        ("use super::C;", vec!["a::b"]),
        ("use crate::other::D;", vec!["a::b"]),
        ("fn f(d: &crate::d::E) {\n    super::g(d);\n}", vec!["a", "d"]),
        ("use std::fmt;\nuse d::E;\n// crate::d\n", vec![]),
        ("#[cfg(test)]\nmod tests {\n    use super::super::F;\n}\n", vec![]),
    ] {
        assert_eq!(of_c(text), found, "{text}");
    }
    assert_eq!(imports_with("")["a"].iter().collect::<Vec<_>>(), ["a::b"]);
    assert!(imports_with("")[""].is_empty());
    let circle: Vec<String> = in_cycles(
        imports_with("")
            .into_iter()
            .chain([("a::b".to_owned(), BTreeSet::from(["a".to_owned()]))])
            .collect(),
    )
    .into_keys()
    .collect();
    assert_eq!(circle, ["a", "a::b"]);
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

fn map() -> String {
    fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap()
}

/// Returns the rooms of the drawing in ARCHITECTURE.md with their levels.
fn levels() -> BTreeMap<String, u32> {
    let map = map();
    let plan = map.split("```text").find(|block| block.contains("the rack, src/")).unwrap();
    let mut levels = BTreeMap::new();
    for line in plan.split("```").next().unwrap().lines() {
        let mut words = line.split([' ', '·']).filter(|word| !word.is_empty());
        let Some(Ok(level)) = words.next().map(str::parse::<u32>) else { continue };
        levels.extend(words.map(|name| (name.to_owned(), level)));
    }
    levels
}

/// Returns the rooms of the tables in ARCHITECTURE.md, in their order.
fn documented_rooms() -> Vec<String> {
    let map = map();
    let rooms = map.split("## Rooms").nth(1).unwrap().split("\n## ").next().unwrap();
    let rows = rooms.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` |"));
    rows.map(|(room, _)| room.to_owned()).collect()
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

/// The modules of a crate in `folder`, `""` for its root, with their texts.
fn modules(folder: &Path) -> BTreeMap<String, String> {
    let module = |file: &Path| {
        let path = file.strip_prefix(folder).unwrap().with_extension("");
        let parts = path.iter().map(|part| part.to_str().unwrap());
        parts.filter(|part| !["lib", "mod"].contains(part)).collect::<Vec<_>>().join("::")
    };
    let files = rust_files(folder.to_path_buf());
    files.iter().map(|file| (module(file), fs::read_to_string(file).unwrap())).collect()
}

/// Returns which modules each module names: every `use`, and paths in code from `crate`, `self` or `super`. What is re-exported counts where it is defined, so a
/// `mod.rs` may re-export parts that import from it.
fn imports(texts: &BTreeMap<String, String>) -> Imports {
    let mut exports = BTreeMap::new();
    let mut named = BTreeMap::<&String, Vec<String>>::new();
    for (module, text) in texts {
        let production = ungrouped(&production(text));
        let paths = named.entry(module).or_default();
        for line in production.lines().map(str::trim).filter(|line| !is_comment(line)) {
            let Some((start, path)) = line.trim_end_matches(';').split_once("use ") else {
                let words = line.split(|c: char| !c.is_alphanumeric() && !"_:".contains(c));
                let words = words.filter(|word| {
                    ["crate::", "self::", "super::"].iter().any(|start| word.starts_with(start))
                });
                paths.extend(words.filter_map(|word| absolute(module, word, texts)));
                continue;
            };
            let (path, alias) = path.split_once(" as ").unwrap_or((path, ""));
            let Some(path) = absolute(module, path, texts) else { continue };
            if start.starts_with("pub") {
                let last = path.rsplit("::").next().unwrap_or_default();
                let name = if alias.is_empty() { last } else { alias };
                exports.insert(joined(module, name), path);
            } else {
                paths.push(path);
            }
        }
    }
    let modules = named.into_iter().map(|(module, paths)| {
        let below = paths.iter().map(|path| file_of(&defined(path, &exports), texts));
        (module.clone(), below.filter(|below| below != module).collect())
    });
    modules.collect()
}

/// Returns the path from the root of the room; `None` for one that leads into another crate.
fn absolute(module: &str, path: &str, texts: &BTreeMap<String, String>) -> Option<String> {
    let (first, mut rest) = path.split_once("::")?;
    match first {
        "crate" => Some(rest.to_owned()),
        "self" => Some(joined(module, rest)),
        "super" => {
            let outer =
                |inner: &str| inner.rsplit_once("::").map_or("", |(outer, _)| outer).to_owned();
            let mut above = outer(module);
            while let Some(further) = rest.strip_prefix("super::") {
                (above, rest) = (outer(&above), further);
            }
            Some(joined(&above, rest))
        }
        child => texts.contains_key(&joined(module, child)).then(|| joined(module, path)),
    }
}

fn joined(module: &str, path: &str) -> String {
    if module.is_empty() { path.to_owned() } else { format!("{module}::{path}") }
}

/// Returns where the item at `path` is defined, behind every re-export.
fn defined(path: &str, exports: &BTreeMap<String, String>) -> String {
    let mut path = path.to_owned();
    for _ in 0..8 {
        let exported = |(name, target): (&String, &String)| {
            let rest = path.strip_prefix(name)?;
            (rest.is_empty() || rest.starts_with("::")).then(|| format!("{target}{rest}"))
        };
        let Some(next) = exports.iter().rev().find_map(exported) else { break };
        path = next;
    }
    path
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
