//! `lab/` beside the first workspace: the same profiles, lints and versions, and no test of a claim of docs/safety.md.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::pages;

const MANIFEST: &str = "lab/Cargo.toml";

/// Dependencies are shared in one target folder only where they are built alike. `GOLDEN=write` writes lab's tables.
#[test]
fn profiles_and_lints_of_lab_are_those_of_the_root() {
    let [root, lab] = ["Cargo.toml", MANIFEST].map(|file| fs::read_to_string(file).unwrap());
    let (_, tables) = root.split_once("[profile.").unwrap();
    let (tables, _) = tables.split_once("\n[lints]\nworkspace").unwrap();
    let tables =
        tables.replace("[workspace.lints", "[lints").replace("\nfrhc.opt", "\nfrhc-lab.opt");
    let lock = fs::read_to_string("lab/Cargo.lock").unwrap();
    // Cargo warns of packages that a workspace does not have.
    let is_here = |line: &&str| {
        let package = line.split_once(".opt-level");
        package.is_none_or(|(package, _)| lock.contains(&format!("\nname = \"{package}\"\n")))
    };
    let tables = tables.lines().filter(is_here).map(|line| format!("{line}\n"));
    let (begin, _) = lab.split_once("[profile.").unwrap();
    let expected = format!("{begin}[profile.{}", tables.collect::<String>());
    if std::env::var_os("GOLDEN").is_some_and(|golden| golden == "write") {
        fs::write(MANIFEST, &expected).unwrap();
        return;
    }
    assert!(
        lab == expected,
        "{MANIFEST} does not follow: GOLDEN=write cargo test --test repository lab"
    );
}

#[test]
fn versions_of_lab_are_those_of_the_root() {
    let [root, lab] = ["Cargo.lock", "lab/Cargo.lock"].map(locked);
    let other: Vec<_> = lab.difference(&root).collect();
    assert!(other.is_empty() && lab.len() > 50, "{other:?}");
    let manifest = table(MANIFEST);
    let known = &table("Cargo.toml")["workspace"]["dependencies"];
    for section in ["dependencies", "dev-dependencies"] {
        for (name, of) in manifest[section].as_table().unwrap() {
            if name != "frhc" {
                assert_eq!(requirement(of, "../"), requirement(&known[name], ""), "{name}");
            }
        }
    }
}

#[test]
fn claims_of_the_safety_page_have_no_test_in_lab() {
    for file in pages::files(Path::new("lab"), &["rs", "py"]) {
        let text = fs::read_to_string(&file).unwrap();
        let is_claim = |line: &&str| {
            let name = line.trim_start().strip_prefix("fn ").unwrap_or_default();
            ["hazard_", "promise_", "property_"].iter().any(|claim| name.starts_with(claim))
        };
        assert_eq!(text.lines().find(is_claim), None, "{}", file.display());
    }
}

fn table(file: &str) -> toml::Table {
    fs::read_to_string(file).unwrap().parse().unwrap()
}

/// Returns name and version of each package of a lock file that comes from a registry.
fn locked(file: &str) -> BTreeSet<(String, String)> {
    let lock = table(file);
    let packages = lock["package"].as_array().unwrap().iter();
    let packages = packages.filter(|package| package.get("source").is_some());
    let text = |package: &toml::Value, key: &str| package[key].as_str().unwrap().to_owned();
    packages.map(|package| (text(package, "name"), text(package, "version"))).collect()
}

/// Returns the folder, without `above`, or else the version that a manifest requires of a dependency.
fn requirement<'m>(dependency: &'m toml::Value, above: &str) -> &'m str {
    let path = dependency.get("path").and_then(toml::Value::as_str);
    let path = path.map(|path| path.strip_prefix(above).unwrap());
    let version = || dependency.get("version").unwrap_or(dependency).as_str().unwrap();
    path.unwrap_or_else(version)
}
