//! Commands that the documentation shows: `sh` blocks, and commands in running text.

use std::fs;
use std::path::{Path, PathBuf};

/// An `sh` block of a page.
#[derive(Debug)]
pub(crate) struct ShBlock {
    /// Page, from the root of the repository.
    pub(crate) page: String,
    pub(crate) lines: Vec<String>,
}

/// Pages with commands, below `root`, the root of the repository.
pub(crate) fn pages(root: &Path) -> Vec<PathBuf> {
    let mut pages = vec![root.join("README.md"), root.join("CONTRIBUTING.md")];
    let mut folders = vec![root.join("docs")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                pages.push(path);
            }
        }
    }
    pages.sort();
    pages
}

/// Returns the `sh` blocks of all pages.
pub(crate) fn blocks(root: &Path) -> Vec<ShBlock> {
    let mut blocks = Vec::new();
    for path in pages(root) {
        let text = fs::read_to_string(&path).unwrap();
        let page = path.strip_prefix(root).unwrap().to_str().unwrap().to_owned();
        for (language, lines) in fenced(&text) {
            if language == "sh" {
                blocks.push(ShBlock { page: page.clone(), lines });
            }
        }
    }
    blocks
}

/// Returns language and lines of each fenced block.
fn fenced(text: &str) -> Vec<(String, Vec<String>)> {
    let (mut blocks, mut open) = (Vec::new(), None);
    for line in text.lines() {
        match (&mut open, line.strip_prefix("```")) {
            (None, Some(language)) => open = Some((language.to_owned(), Vec::new())),
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (Some((_, lines)), None) => lines.push(line.to_owned()),
            (None, None) => {}
        }
    }
    blocks
}

/// Returns the code spans of the running text that are commands of `program`.
pub(crate) fn spans(text: &str, program: &str) -> Vec<String> {
    let mut fenced = false;
    let mut outside = String::new();
    for line in text.lines() {
        fenced ^= line.starts_with("```");
        if !fenced && !line.starts_with("```") {
            outside += line;
            outside.push('\n');
        }
    }
    let spans = outside.split('`').skip(1).step_by(2);
    let begins = format!("{program} ");
    spans.filter(|span| span.starts_with(&begins)).map(str::to_owned).collect()
}

/// Splits a line of the shell into its commands, and those into words. Comments, redirections and assignments in front of
/// a command are left out.
pub(crate) fn commands(line: &str) -> Vec<Vec<String>> {
    let mut commands: Vec<Vec<String>> = vec![Vec::new()];
    let mut is_target = false;
    for token in tokens(line) {
        let command = commands.last_mut().unwrap();
        match token {
            Token::Word(_) if is_target => is_target = false,
            Token::Word(word) if command.is_empty() && word.contains('=') => {}
            Token::Word(word) => command.push(word),
            Token::Redirection => is_target = true,
            Token::Separator => commands.push(Vec::new()),
        }
    }
    commands.retain(|words| !words.is_empty());
    commands
}

enum Token {
    Word(String),
    Redirection,
    Separator,
}

fn tokens(line: &str) -> Vec<Token> {
    let (mut tokens, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for character in line.chars().chain([' ']) {
        match (quote, character) {
            (Some(mark), _) if character == mark => quote = None,
            (None, '\'' | '"') => {
                quote = Some(character);
                word.get_or_insert_default();
            }
            (None, '#') if word.is_none() => break,
            (None, ' ' | '|' | ';' | '&' | '>' | '<') => {
                tokens.extend(word.take().map(Token::Word));
                match character {
                    '>' | '<' => tokens.push(Token::Redirection),
                    '|' | ';' | '&' => tokens.push(Token::Separator),
                    _ => {}
                }
            }
            _ => word.get_or_insert_default().push(character),
        }
    }
    tokens
}
