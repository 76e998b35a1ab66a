//! The module graph of ARCHITECTURE.md, checked against the sources.
#![allow(
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::fs;
use std::path::Path;
use std::path::PathBuf;

/// A module, the modules it may import, and the outside crates it may name.
type Rule = (&'static str, &'static [&'static str], &'static [&'static str]);

const MODULES: &[Rule] = &[
    ("time", &[], &[]),
    ("written", &[], &["serde", "toml"]),
    ("spatial", &[], &["nalgebra"]),
    ("canopen", &["time"], &["canopen_rs", "thiserror"]),
    ("controller", &["spatial"], &["nalgebra", "thiserror"]),
    ("robot", &["spatial", "time"], &["nalgebra", "thiserror"]),
    (
        "sim",
        &["canopen", "spatial", "time", "written"],
        &["canopen_rs", "nalgebra", "serde", "thiserror", "toml"],
    ),
    ("bus", &["canopen", "time"], &["nix", "socket2", "socketcan", "thiserror", "thread_priority"]),
    ("remote", &["spatial", "time"], &["nalgebra", "snow", "thiserror"]),
    (
        "telemetry",
        &["canopen", "controller", "spatial", "time"],
        &["humantime", "nalgebra", "serde", "thiserror"],
    ),
    (
        "config",
        &["canopen", "controller", "robot", "spatial", "written"],
        &["csv", "nalgebra", "nix", "serde", "serde_ignored", "thiserror", "toml"],
    ),
    (
        "node",
        &[
            "bus",
            "canopen",
            "config",
            "controller",
            "remote",
            "robot",
            "spatial",
            "telemetry",
            "time",
        ],
        &["nalgebra", "thiserror"],
    ),
    (
        "lab",
        &[
            "bus",
            "canopen",
            "config",
            "controller",
            "node",
            "remote",
            "robot",
            "sim",
            "spatial",
            "telemetry",
            "time",
        ],
        &["nalgebra", "serde", "tracing"],
    ),
    (
        "cli",
        &[
            "bus",
            "canopen",
            "config",
            "controller",
            "lab",
            "node",
            "remote",
            "sim",
            "telemetry",
            "time",
        ],
        &[
            "anyhow",
            "clap",
            "indicatif",
            "nix",
            "rtrb",
            "serde",
            "serde_json",
            "tempfile",
            "tokio",
            "tracing",
            "tracing_subscriber",
        ],
    ),
];

/// Every crate of Cargo.toml.
const OUTSIDE: &[&str] = &[
    "anyhow",
    "canopen_rs",
    "clap",
    "csv",
    "humantime",
    "indicatif",
    "nalgebra",
    "nix",
    "rtrb",
    "serde",
    "serde_ignored",
    "serde_json",
    "snow",
    "socket2",
    "socketcan",
    "tempfile",
    "thiserror",
    "thread_priority",
    "tokio",
    "toml",
    "tracing",
    "tracing_subscriber",
];

/// Modules that perform no I/O, read no clock and log nothing.
const PURE: &[&str] = &["time", "written", "spatial", "canopen", "controller", "robot", "sim"];

/// What a pure module may not name.
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
fn every_import_follows_the_module_graph() {
    let mut violations = Vec::new();
    for (module, inside, outside) in MODULES {
        for file in sources(module) {
            let text = fs::read_to_string(&file).unwrap();
            let found = judge(module, inside, outside, &text);
            violations.extend(found.into_iter().map(|what| format!("{}: {what}", file.display())));
        }
    }
    assert!(violations.is_empty(), "{}", violations.join("\n"));
}

#[test]
fn every_module_has_a_rule() {
    let lib = fs::read_to_string(src().join("lib.rs")).unwrap();
    let modules = lib.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
    for module in modules {
        assert!(MODULES.iter().any(|(name, ..)| *name == module), "{module} has no rule");
    }
}

#[test]
fn every_dependency_is_known_here() {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
    let text = fs::read_to_string(manifest).unwrap();
    let (_, rest) = text.split_once("[dependencies]").unwrap();
    let (dependencies, _) = rest.split_once("\n[").unwrap();
    for name in dependencies.lines().filter_map(|line| line.split_once(" = ")).map(|(name, _)| name)
    {
        assert!(OUTSIDE.contains(&name.replace('-', "_").as_str()), "{name} has no rule");
    }
}

#[test]
fn a_wrong_import_is_found() {
    let judge = |module: &str, text: &str| {
        let (module, inside, outside) = MODULES.iter().find(|(name, ..)| *name == module).unwrap();
        judge(module, inside, outside, text)
    };
    assert!(judge("sim", "use crate::canopen::frame::Frame;").is_empty());
    assert!(judge("sim", "// as in crate::controller::arm").is_empty());
    assert!(judge("controller", "let torque = 0x6071;\n#[cfg(test)]").len() == 1);
    for (module, line) in [
        ("sim", "use crate::controller::arm::Arm;"),
        ("sim", "let arm = crate::robot::object::Object;"),
        ("canopen", "use crate::controller::Output;"),
        ("controller", "use crate::canopen::pdo::PerMille;"),
        ("controller", "use crate::{spatial::Wrench};"),
        ("node", "use crate::sim::world::World;"),
        ("node", "use socketcan::CanSocket;"),
        ("canopen", "use std::time::Instant;"),
        ("robot", "println!(\"here\");"),
        ("node", "const TORQUE: u16 = 0x6071;"),
    ] {
        assert_eq!(judge(module, line).len(), 1, "{module}: {line}");
    }
}

/// What is wrong with `text` as a part of `module`.
fn judge(module: &str, inside: &[&str], outside: &[&str], text: &str) -> Vec<String> {
    let mut violations = Vec::new();
    if names(text, "crate::{") {
        violations.push("hides imports in braces".to_owned());
    }
    for (other, ..) in MODULES {
        if *other != module && !inside.contains(other) && names(text, &format!("crate::{other}::"))
        {
            violations.push(format!("imports {other}"));
        }
    }
    let production = text.split("#[cfg(test)]").next().unwrap_or_default();
    for krate in OUTSIDE.iter().filter(|krate| !outside.contains(krate)) {
        if names(production, &format!("{krate}::")) {
            violations.push(format!("names {krate}"));
        }
    }
    if PURE.contains(&module) {
        for impure in IMPURE.iter().filter(|impure| names(production, impure)) {
            violations.push(format!("names {impure}"));
        }
    }
    if module != "canopen" {
        violations.extend(object_indices(production).map(|index| format!("writes {index} itself")));
    }
    violations
}

/// Numbers that are written like an index of an object dictionary: 0x1000 to 0x9FFF.
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

/// Whether a line of code (not a comment) names `path` as a whole.
fn names(text: &str, path: &str) -> bool {
    let begins = |line: &str, at: usize| {
        !line[..at].ends_with(|before: char| before.is_alphanumeric() || "_:".contains(before))
    };
    text.lines()
        .filter(|line| !is_comment(line))
        .any(|line| line.match_indices(path).any(|(at, _)| begins(line, at)))
}

fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with("//")
}

/// The files of `src/<module>.rs` and `src/<module>/`, all the way down.
fn sources(module: &str) -> Vec<PathBuf> {
    let mut files = vec![src().join(module).with_extension("rs")];
    files.retain(|file| file.is_file());
    let mut folders = vec![src().join(module)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    assert!(!files.is_empty(), "module {module} has no file");
    files
}

fn src() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}
