//! The examples in README and docs/ print the output shown there.

use std::thread;

use crate::common::prelude::*;

/// A block of a page that shows what commands print.
struct Example {
    /// Command lines, without `$ `.
    commands: Vec<String>,
    printed: String,
}

/// README.md and the pages of docs/.
fn pages() -> Vec<PathBuf> {
    let docs = fs::read_dir("docs").unwrap().map(|entry| entry.unwrap().path());
    let is_page = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "md");
    docs.filter(is_page).chain([PathBuf::from("README.md")]).collect()
}

/// Returns the lines of a page from the one that starts with this text to the end of its block.
fn shown(beginning: &str) -> Vec<String> {
    let pages: String = pages().into_iter().map(|path| fs::read_to_string(path).unwrap()).collect();
    let lines = pages.lines().skip_while(|line| !line.starts_with(beginning));
    let block: Vec<String> =
        lines.take_while(|line| !line.starts_with("```")).map(str::to_owned).collect();
    assert!(!block.is_empty(), "{beginning}");
    block
}

/// Text between the examples of a page, and those; one text more than examples.
fn split(page: &str) -> (Vec<String>, Vec<Example>) {
    let (mut texts, mut examples) = (vec![String::new()], Vec::new());
    let mut rest = page;
    while let Some((before, block)) = rest.split_once("```text\n$ frhc ") {
        let (block, after) = block.split_once("```\n").unwrap();
        let block = format!("$ frhc {block}");
        let count = block.lines().take_while(|line| line.starts_with("$ ")).count();
        let commands = block.lines().take(count).map(|line| line[2..].to_owned()).collect();
        let printed = block.lines().skip(count).map(|line| format!("{line}\n")).collect();
        texts.last_mut().unwrap().push_str(before);
        texts.push(String::new());
        examples.push(Example { commands, printed });
        rest = after;
    }
    texts.last_mut().unwrap().push_str(rest);
    (texts, examples)
}

/// Standard output of commands in this folder.
fn run(commands: &[String], folder: &Path) -> String {
    let program = Path::new(crate::common::program()).parent().unwrap().to_path_buf();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let mut bash = Command::new("bash");
    bash.args(["-c", &commands.join("\n")]).current_dir(folder).env("PATH", path);
    let output = bash.env("NO_COLOR", "1").env("LC_ALL", "C.UTF-8").output().unwrap();
    String::from_utf8(output.stdout).unwrap()
}

fn writes() -> bool {
    std::env::var_os("GOLDEN").is_some_and(|golden| golden == "write")
}

/// Pages run side by side, examples of a page one after the other in its own folder. `GOLDEN=write` writes what they
/// print.
#[test]
fn examples_print_the_output_shown() {
    let counts: Vec<usize> = thread::scope(|scope| {
        let pages = pages().into_iter().map(|path| scope.spawn(move || examples_print(&path)));
        let running: Vec<_> = pages.collect();
        running.into_iter().map(|page| page.join().unwrap()).collect()
    });
    assert!(counts.iter().sum::<usize>() > 10, "{counts:?}");
}

/// Runs the examples of a page, and returns how many there are.
fn examples_print(path: &Path) -> usize {
    let page = fs::read_to_string(path).unwrap();
    let (texts, examples) = split(&page);
    let folder = folder("readme", path.file_stem().unwrap().to_str().unwrap());
    let mut written = texts[0].clone();
    for (Example { commands, printed: shown }, text) in examples.iter().zip(&texts[1..]) {
        let printed = run(commands, &folder);
        let lines: String = commands.iter().map(|command| format!("$ {command}\n")).collect();
        written += &format!("```text\n{lines}{printed}```\n{text}");
        assert!(writes() || printed == *shown, "{}: {commands:?}\n{printed}", path.display());
    }
    if writes() && written != page {
        fs::write(path, written).unwrap();
    }
    examples.len()
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
        ("start_deg", "start_dg"),
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
