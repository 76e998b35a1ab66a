//! `frhc config merge`: reads the files, shows the difference and what `check` says, and writes on request.

use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::Context;
use similar::TextDiff;

use crate::config::Merge;
use crate::config::merged;
use crate::config::original::{MAX_SIZE, Original};
use crate::config::source::Source;
use config::files::{self, Files};
use config::trust::Trust;
use config::{Config, Invalid, Problem, encoding, problem};
use run::check;
use run::exit::{Failure, Kind, OrFail};
use run::{print, results};
use units::wording::listed;

/// Unchanged lines around each difference.
const CONTEXT: usize = 3;

/// Argument that stands for stdin, and its name in messages.
const STDIN: [&str; 2] = ["-", "stdin"];

/// Merges the fragments. Leaves with what `check` says of the result.
pub(super) fn run(args: &Merge) -> Result<(), Failure> {
    let file = &args.config;
    let original = Original::read(file).map_err(|error| refused(file, None, &error));
    let original = original.or_fail(Kind::Configuration)?;
    refuse_arguments(args, &original)?;
    if args.write {
        of(file, original.ensure_writable())?;
        results::ensure_writable(original.path())?;
    }
    let base = decoded(file, original.content()).or_fail(Kind::Configuration)?;
    let fragments: Result<Vec<_>, _> = args.fragments.iter().map(|path| read(path)).collect();
    let text = merged::merge(&base, &fragments.or_fail(Kind::Configuration)?);
    let text = text.or_fail(Kind::Configuration)?;
    let is_changed = text != base.text;
    if is_changed {
        print::line(&(difference(file, &base.text, &text) + "\n"));
    } else {
        let names: Vec<_> = args.fragments.iter().map(|path| name(path).display()).collect();
        let names = listed(&names);
        print::line(&format!(
            "{}: nothing to change, as it has the values of {names}",
            file.display()
        ));
    }
    check_merged(file, &text)?;
    if is_changed && args.write {
        let kept = of(file, original.replace(text.as_bytes()))?;
        let (path, kept) = (original.path().display(), kept.display());
        print::line(&format!("{path}: written; the file as it was is {kept}"));
    } else if is_changed {
        print::line(&format!("{}: not written; --write writes it", file.display()));
    }
    Ok(())
}

/// Refuses arguments that name the configuration, or stdin, twice.
fn refuse_arguments(args: &Merge, original: &Original) -> Result<(), Failure> {
    let is_stdin = |path: &&PathBuf| path.as_os_str() == STDIN[0];
    if let Some(same) = args.fragments.iter().find(|path| !is_stdin(path) && original.is(path)) {
        let reason =
            format!("{} is the configuration itself, not a fragment of it", same.display());
        return Err(Failure::new(Kind::Usage, reason));
    }
    if args.fragments.iter().filter(is_stdin).count() > 1 {
        return Err(Failure::new(Kind::Usage, "stdin (-) can be read only once"));
    }
    Ok(())
}

/// Prints what `check` says of the merged text.
fn check_merged(file: &Path, text: &str) -> Result<(), Failure> {
    let config = Config::parse(file, text).map_err(|invalid| {
        let file = file.display();
        let reason = format!(
            "{invalid}\n{file}: not written, as check refuses it with these values; lines are those of the merged text"
        );
        Failure::new(Kind::Configuration, reason)
    })?;
    check::show(file, &config);
    Ok(())
}

/// Returns the difference as `diff -u` writes it, without its last line end.
fn difference(file: &Path, old: &str, new: &str) -> String {
    let name = file.display().to_string();
    let lines = TextDiff::from_lines(old, new);
    let text = lines.unified_diff().context_radius(CONTEXT).header(&name, &name).to_string();
    text.strip_suffix('\n').unwrap_or(&text).to_owned()
}

/// Reads a fragment.
fn read(path: &Path) -> Result<Source, Invalid> {
    if path.as_os_str() != STDIN[0] {
        let text = problem::text(&Files::on_disk(Trust::Any), path)?;
        return Ok(Source { file: path.to_path_buf(), text });
    }
    let content = files::at_most(MAX_SIZE, io::stdin().lock());
    decoded(name(path), &content.map_err(|error| refused(name(path), None, &error))?)
}

/// Name of a fragment in messages.
fn name(path: &Path) -> &Path {
    if path.as_os_str() == STDIN[0] { Path::new(STDIN[1]) } else { path }
}

fn decoded(file: &Path, content: &[u8]) -> Result<Source, Invalid> {
    let text =
        encoding::decode(content).map_err(|wrong| refused(file, Some(wrong.line), &wrong))?;
    Ok(Source { file: file.to_path_buf(), text: text.to_owned() })
}

fn refused(file: &Path, line: Option<usize>, reason: &impl Display) -> Invalid {
    let (file, key, reason) = (file.to_path_buf(), String::new(), reason.to_string());
    Invalid(vec![Problem { file, line, key, reason }])
}

/// Names the file of an error of writing.
fn of<T>(file: &Path, done: io::Result<T>) -> Result<T, Failure> {
    done.with_context(|| file.display().to_string()).or_fail(Kind::File)
}
