//! Examples in README and docs/: commands with what they print.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;

use super::cli::folder;

/// A block of a page that shows what commands print.
struct Example {
    /// Command lines, without `$ `.
    commands: Vec<String>,
    printed: String,
}

/// README.md and the pages of docs/, below `root`.
pub(crate) fn pages(root: &Path) -> Vec<PathBuf> {
    let docs = fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let is_page = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "md");
    docs.filter(is_page).chain([root.join("README.md")]).collect()
}

/// Text between the examples of a page, and those; one text more than examples.
fn split(page: &str, program: &str) -> (Vec<String>, Vec<Example>) {
    let (mut texts, mut examples) = (vec![String::new()], Vec::new());
    let mut rest = page;
    let begins = format!("```text\n$ {program} ");
    while let Some((before, block)) = rest.split_once(&begins) {
        let (block, after) = block.split_once("```\n").unwrap();
        let block = format!("$ {program} {block}");
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
pub(crate) fn run(commands: &[String], folder: &Path) -> String {
    let program = Path::new(crate::common::program()).parent().unwrap().to_path_buf();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let mut bash = Command::new("bash");
    bash.args(["-c", &commands.join("\n")]).current_dir(folder).env("PATH", path);
    let output = bash.env("NO_COLOR", "1").env("LC_ALL", "C.UTF-8").output().unwrap();
    String::from_utf8(output.stdout).unwrap()
}

pub(crate) fn writes() -> bool {
    std::env::var_os("GOLDEN").is_some_and(|golden| golden == "write")
}

/// Runs the examples of all pages below `root` that begin with a command of `program`, and returns how many there are. Pages
/// run side by side, examples of a page one after the other in its own folder. `GOLDEN=write` writes what they print.
pub(crate) fn run_all(root: &Path, program: &str) -> usize {
    thread::scope(|scope| {
        let pages = pages(root).into_iter();
        let pages = pages.map(|path| scope.spawn(move || examples_print(&path, program)));
        let running: Vec<_> = pages.collect();
        running.into_iter().map(|page| page.join().unwrap()).sum()
    })
}

/// Runs the examples of a page, and returns how many there are.
fn examples_print(path: &Path, program: &str) -> usize {
    let page = fs::read_to_string(path).unwrap();
    let (texts, examples) = split(&page, program);
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
