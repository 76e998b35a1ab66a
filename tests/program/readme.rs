//! The examples in README and docs/ print the output shown there.

use crate::common::examples::{pages, run, run_all, writes};
use crate::common::prelude::*;

/// Returns the lines of a page from the one that starts with this text to the end of its block.
fn shown(beginning: &str) -> Vec<String> {
    let pages: String =
        pages(Path::new(".")).into_iter().map(|path| fs::read_to_string(path).unwrap()).collect();
    let lines = pages.lines().skip_while(|line| !line.starts_with(beginning));
    let block: Vec<String> =
        lines.take_while(|line| !line.starts_with("```")).map(str::to_owned).collect();
    assert!(!block.is_empty(), "{beginning}");
    block
}

#[test]
fn examples_print_the_output_shown() {
    let count = run_all(Path::new("."), "frhc");
    assert!(count > 10, "{count}");
}

/// The picture of docs/calibration.md is the one of its commands.
#[test]
fn torque_curve_is_drawn_as_shown() {
    let folder = folder("readme", "curve");
    let commands = [
        "frhc sim --config config/kraft_like.toml --calibrate elbow > elbow.csv",
        "frhc calib fit elbow.csv --config config/kraft_like.toml --out elbow",
    ];
    run(&commands.map(str::to_owned), &folder);
    let drawn = fs::read_to_string(folder.join("elbow/elbow.svg")).unwrap();
    let shown = Path::new("docs/img/elbow.svg");
    if writes() {
        fs::write(shown, &drawn).unwrap();
    }
    assert!(drawn == fs::read_to_string(shown).unwrap(), "{}", shown.display());
}

/// Writes a copy of the configuration to `path`, with the first `from` of each pair replaced by `to`.
fn write_changed(path: &Path, slips: &[(&str, &str)]) {
    let mut text = fs::read_to_string(KRAFT)
        .unwrap()
        .replace("../eds", concat!(env!("CARGO_MANIFEST_DIR"), "/eds"));
    for (from, to) in slips {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    fs::write(path, text).unwrap();
}

#[test]
fn refusals_name_file_line_and_key_as_shown() {
    let broken = [
        ("rest_deg", "rest_dg"),
        ("-0.393453", "-3.93453"),
        ("a_m = 0.254", "a_m = nan"),
        ("mass_kg = 0.45", "mass_kg = \"heavy\""),
    ];
    let bad = [("stiffness_n_per_m = 2000.0", "stiffness_n_per_m = 50000.0")];
    for (name, slips, beginning) in
        [("broken.toml", &broken[..], "frhc: broken.toml:"), ("bad.toml", &bad, "frhc: bad.toml:")]
    {
        let path = folder("readme", name).join(name);
        write_changed(&path, slips);
        let ended = frhc(&["check", "--config", path.to_str().unwrap()]);
        assert_eq!(ended.code, 3, "{}", ended.stderr);
        let stderr = ended.stderr.replace(path.to_str().unwrap(), name);
        let errors: Vec<&str> = stderr.lines().filter(|line| line.starts_with("frhc: ")).collect();
        assert_eq!(errors, shown(beginning));
    }
}
