//! The rack without its bench: a copy of the repository without `src/bench/` compiles.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Removes a folder at the end, also of a failed test.
struct Copy(PathBuf);

impl Drop for Copy {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).ok();
    }
}

#[test]
fn rack_compiles_without_the_bench() {
    let copy = Copy(Path::new(env!("CARGO_TARGET_TMPDIR")).join("rack-alone"));
    fs::remove_dir_all(&copy.0).ok(); // left by a killed run
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in ["Cargo.toml", "Cargo.lock", "src", "tests", "benches", "eds", "config"] {
        copied(&root.join(name), &copy.0.join(name), &root.join("src/bench"));
    }
    let manifest = copy.0.join("Cargo.toml");
    fs::write(&manifest, without_bench(&fs::read_to_string(&manifest).unwrap())).unwrap();
    let cargo = Command::new(env!("CARGO"))
        .args(["check", "--no-default-features", "--offline", "--quiet"])
        .current_dir(&copy.0)
        // Beside the builds of check.sh, whose dependencies serve here, too.
        .env("CARGO_TARGET_DIR", root.join("target"))
        .output()
        .unwrap();
    assert!(cargo.status.success(), "{}", String::from_utf8_lossy(&cargo.stderr));
}

#[test]
fn bench_is_taken_out_of_the_manifest() {
    let manifest = "[workspace]\nmembers = [\".\", \"src/a\", \"src/bench/b\"]\n\
        [features]\ndefault = [\"simulation\"]\nsimulation = [\"dep:b\"]\n\
        [dependencies]\na = { workspace = true }\nb = { workspace = true, optional = true }\n\
        [workspace.dependencies]\na = { path = \"src/a\" }\nb = { path = \"src/bench/b\" }\n";
    let rack: toml::Table = without_bench(manifest).parse().unwrap();
    let expected = "[workspace]\nmembers = [\".\", \"src/a\"]\n[dependencies]\na = { workspace = true }\n\
        [workspace.dependencies]\na = { path = \"src/a\" }\n";
    assert_eq!(rack, expected.parse().unwrap());
}

/// Returns the root manifest without members, feature and dependencies of the bench.
fn without_bench(manifest: &str) -> String {
    let mut manifest: toml::Table = manifest.parse().unwrap();
    manifest.remove("features");
    let is_bench = |path: Option<&str>| path.is_some_and(|path| path.starts_with("src/bench/"));
    let workspace = manifest["workspace"].as_table_mut().unwrap();
    for list in ["members", "default-members"] {
        let Some(list) = workspace.get_mut(list) else { continue };
        list.as_array_mut().unwrap().retain(|member| !is_bench(member.as_str()));
    }
    let known = workspace["dependencies"].as_table_mut().unwrap();
    known.retain(|_, of| !is_bench(of.get("path").and_then(toml::Value::as_str)));
    let known = known.clone();
    for section in ["dependencies", "dev-dependencies"] {
        let Some(section) = manifest.get_mut(section) else { continue };
        section.as_table_mut().unwrap().retain(|name, _| known.contains_key(name));
    }
    manifest.to_string()
}

/// Copies a file or a folder, except for `left_out`.
fn copied(from: &Path, to: &Path, left_out: &Path) {
    if from == left_out {
        return;
    }
    if !from.is_dir() {
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(from, to).unwrap();
        return;
    }
    for entry in fs::read_dir(from).unwrap().flatten() {
        copied(&entry.path(), &to.join(entry.file_name()), left_out);
    }
}
