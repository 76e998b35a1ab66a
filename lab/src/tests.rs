//! Every command that help and documentation show is one that the command line takes.

use std::fs;
use std::path::Path;

use clap::{CommandFactory, Parser};

use super::Cli;

#[path = "../../tests/common/sh_blocks.rs"]
#[allow(dead_code, reason = "the first workspace uses all of it")]
mod sh_blocks;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Returns the first command of a line, if it is one of this program with the name of an experiment; `…` is left out.
fn of_lab(line: &str) -> Option<Vec<String>> {
    let mut words = sh_blocks::commands(line).into_iter().next()?;
    words.retain(|word| word != "…");
    (words.first()? == "frhc-lab" && words.len() > 2).then_some(words)
}

/// Returns the lines of the help of a command and of its subcommands.
fn helps(command: &clap::Command) -> Vec<String> {
    let own = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let own = own.lines().map(|line| line.trim().to_owned());
    own.chain(command.get_subcommands().flat_map(helps)).collect()
}

#[test]
fn examples_in_help_and_pages_have_valid_arguments() {
    let mut shown = helps(&Cli::command());
    for page in sh_blocks::pages(Path::new(ROOT)) {
        let text = fs::read_to_string(page).unwrap();
        shown.extend(sh_blocks::spans(&text, "frhc-lab"));
    }
    let commands: Vec<_> = shown.iter().filter_map(|line| of_lab(line)).collect();
    let errors = commands.iter().filter_map(|words| Cli::try_parse_from(words).err());
    let invalid: Vec<_> = errors.map(|error| error.to_string()).collect();
    assert!(invalid.is_empty(), "{}", invalid.join("\n"));
    assert!(commands.len() > 15, "{}", commands.len());
}

#[test]
fn every_experiment_has_an_example() {
    let lab = Cli::command();
    let experiments: Vec<_> =
        lab.get_subcommands().flat_map(clap::Command::get_subcommands).collect();
    for experiment in &experiments {
        let help = helps(experiment);
        assert!(help.iter().any(|line| of_lab(line).is_some()), "{}", experiment.get_name());
    }
    assert_eq!(experiments.len(), 6);
}
