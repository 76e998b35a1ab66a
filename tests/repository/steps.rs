//! The functions that docs/loop.md names for the steps of a cycle, against the sources.

use std::fs;
use std::path::Path;

use crate::pages::Page;

const PAGE: &str = "docs/loop.md";

#[test]
fn every_step_of_a_cycle_names_functions_that_exist() {
    let page = Page::read(PAGE);
    let steps = steps(&page);
    assert!(steps.len() > 8, "{} steps", steps.len());
    for (step, paths) in steps {
        assert!(!paths.is_empty(), "{PAGE}: no function does \"{step}\"");
        for path in paths {
            assert!(is_function(path), "{PAGE}: {path} is in no file of src/");
        }
    }
}

/// Rows of the table of steps: the step, and the paths of its functions.
fn steps(page: &Page) -> Vec<(&str, Vec<&str>)> {
    let table = page.prose().skip_while(|line| !line.starts_with("| step | function |"));
    let rows = table.skip(2).take_while(|line| line.starts_with('|'));
    let cells = rows.map(|row| row.split('|').map(str::trim).collect::<Vec<_>>());
    cells.map(|cells| (cells[1], cells[2].split('`').skip(1).step_by(2).collect())).collect()
}

/// Returns whether a path `room::module::function` names a function outside of the module's tests.
fn is_function(path: &str) -> bool {
    let (module, name) = path.rsplit_once("::").unwrap();
    let module = module.replace("::", "/");
    let files = ["", "/mod", "/lib"].map(|file| format!("src/{module}{file}.rs"));
    let file = files.iter().find(|file| Path::new(file).exists());
    file.is_some_and(|file| {
        let source = fs::read_to_string(file).unwrap();
        let code = source.split("#[cfg(test)]").next().unwrap_or_default();
        ["(", "<"].iter().any(|after| code.contains(&format!("fn {name}{after}")))
    })
}

#[test]
fn wrong_names_of_functions_are_found() {
    for path in ["node::receive::await_sync", "node::safety::advance", "units::spatial::missing"] {
        assert_eq!(is_function(path), !path.ends_with("missing"), "{path}");
    }
    // Half a name, another file, no file, a function of the tests.
    let wrong = ["node::receive::await", "node::send::gather", "node::sync::gather"];
    for path in wrong.into_iter().chain(["node::cycle::sync_comes_first_and_once_a_period"]) {
        assert!(!is_function(path), "{path}");
    }
    let text =
        "| step | function | causes |\n|---|---|---|\n| a | `b::c`, `d::e` | `f` |\n| g | – | |\n";
    let page = Page { path: "docs/a.md".into(), text: text.to_owned() };
    assert_eq!(steps(&page), [("a", vec!["b::c", "d::e"]), ("g", vec![])]);
}
