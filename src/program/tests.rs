//! Every command that the documentation shows is one that the command line takes.
#![allow(
    clippy::indexing_slicing,
    clippy::unwrap_used,
    clippy::wildcard_enum_match_arm,
    reason = "what a test cannot do without has failed the test"
)]

use std::fs;
use std::path::Path;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};

use super::Cli;

#[path = "../../tests/common/sh_blocks.rs"]
mod sh_blocks;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Returns the commands of the program among those of a line, also in words that are a line of their own (`bash -c`).
fn of_frhc(line: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for words in sh_blocks::commands(line) {
        for word in words.iter().filter(|word| word.contains("frhc ")) {
            found.extend(of_frhc(word));
        }
        let behind_timeout =
            if words.first().is_some_and(|word| word == "timeout") { 2 } else { 0 };
        if words.get(behind_timeout).is_some_and(|word| word == "frhc") {
            found.push(words[behind_timeout..].to_vec());
        }
    }
    found
}

#[test]
fn sh_blocks_have_commands_with_valid_arguments() {
    let (mut tried, mut invalid) = (0, Vec::new());
    for block in sh_blocks::blocks(Path::new(ROOT)) {
        for words in block.lines.iter().flat_map(|line| of_frhc(line)) {
            tried += 1;
            if let Err(error) = Cli::try_parse_from(&words) {
                invalid.push(format!("{}: {}: {error}", block.page, words.join(" ")));
            }
        }
    }
    assert!(invalid.is_empty(), "{}", invalid.join("\n"));
    assert!(tried > 40, "{tried}");
}

/// Returns the examples in the help of a command and of its subcommands.
fn examples(command: &clap::Command) -> Vec<String> {
    let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let mut examples: Vec<_> = help.lines().map(|line| line.trim().to_owned()).collect();
    examples.retain(|line| !of_frhc(line).is_empty());
    examples.extend(command.get_subcommands().flat_map(self::examples));
    examples
}

#[test]
fn help_has_examples_with_valid_arguments() {
    let examples = examples(&Cli::command());
    let words = examples.iter().flat_map(|line| of_frhc(line));
    let errors = words.filter_map(|words| Cli::try_parse_from(words).err());
    let invalid: Vec<_> = errors.map(|error| error.to_string()).collect();
    assert!(invalid.is_empty(), "{}", invalid.join("\n"));
    assert!(examples.len() > 20, "{}", examples.len());
}

/// Returns whether an error comes from what a command in running text leaves out: arguments, or values such as `FILE`.
fn is_left_out(error: &clap::Error, words: &[&String]) -> bool {
    let is_upper = |word: &&String| word.chars().any(|character| character.is_ascii_uppercase());
    match error.kind() {
        ErrorKind::MissingRequiredArgument
        | ErrorKind::MissingSubcommand
        | ErrorKind::DisplayHelp
        | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => true,
        ErrorKind::ValueValidation => words.iter().any(is_upper),
        // An option without its value.
        ErrorKind::InvalidValue => words.last().is_some_and(|word| word.starts_with("--")),
        _ => false,
    }
}

#[test]
fn commands_in_text_have_arguments_that_exist() {
    let (mut tried, mut invalid) = (0, Vec::new());
    for page in sh_blocks::pages(Path::new(ROOT)) {
        for span in sh_blocks::spans(&fs::read_to_string(&page).unwrap(), "frhc") {
            tried += 1;
            let words = of_frhc(&span).into_iter().next().unwrap_or_default();
            let words: Vec<_> = words.iter().filter(|word| *word != "…").collect();
            let error = Cli::try_parse_from(&words).err();
            if let Some(error) = error.filter(|error| !is_left_out(error, &words)) {
                invalid.push(format!("{}: {span}: {error}", page.display()));
            }
        }
    }
    assert!(invalid.is_empty(), "{}", invalid.join("\n"));
    assert!(tried > 80, "{tried}");
}
