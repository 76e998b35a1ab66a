//! JSON input of `frhc explain`: on the command line, in a file or on stdin.

use std::ffi::OsStr;
use std::io::{self, IsTerminal, Read};

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value as Json;

use config::files;
use run::exit::{Failure, Kind};
use testbench::question::Question;

/// Maximum length of the input, in bytes.
const MAX_LENGTH: u64 = 1 << 20;

/// Question of one cycle, with the device if the input names one.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Input {
    /// Name of a shipped configuration, as `kraft_like`.
    pub(super) device: Option<String>,
    /// Joint positions and other inputs of the cycle to explain.
    #[serde(alias = "inputs")]
    pub(super) question: Question,
}

/// Part of the question that the command-line flags contain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Flags {
    /// No input.
    Absent,
    /// Some inputs, but not the joint positions.
    Some,
    /// Joint positions, so that no further input is needed.
    Position,
}

/// Reads the question: `given` is JSON, a file name, or `-` for stdin.
///
/// If it is absent, reads stdin unless that is a terminal or the flags suffice.
pub(super) fn read(given: Option<&OsStr>, flags: Flags) -> Result<Input, Failure> {
    match given {
        Some(given) if given == "-" => parse("stdin", &stdin()?),
        Some(given) => match given.to_str().filter(|text| is_inline(text)) {
            Some(text) => parse("QUESTION", text),
            None => {
                let name = given.display().to_string();
                parse(&name, &text(&name, files::open(given.as_ref()))?)
            }
        },
        None if flags == Flags::Position || io::stdin().is_terminal() => Ok(Input::default()),
        None => {
            let text = stdin()?;
            let is_answered_by_flags = text.trim().is_empty() && flags == Flags::Some;
            if is_answered_by_flags { Ok(Input::default()) } else { parse("stdin", &text) }
        }
    }
}

/// Returns whether this is JSON text. A file with such a name can be given as `./{…`.
fn is_inline(text: &str) -> bool {
    text.trim_start().starts_with(['{', '['])
}

fn stdin() -> Result<String, Failure> {
    text("stdin", Ok(io::stdin().lock()))
}

fn text(name: &str, input: io::Result<impl Read>) -> Result<String, Failure> {
    let mut text = String::new();
    let read = input.and_then(|input| input.take(MAX_LENGTH).read_to_string(&mut text));
    read.map_err(|error| Failure::new(Kind::File, format!("{name}: {error}")))?;
    Ok(text)
}

/// Parses twice: as any JSON to find out whether it names a device, then as the type, which rejects duplicate keys.
fn parse(name: &str, text: &str) -> Result<Input, Failure> {
    let wrong = |reason: String| Failure::new(Kind::Usage, format!("{name}: {reason}"));
    if text.trim().is_empty() {
        let reason =
            "empty; a question must be a JSON object such as {\"q\": [0, -0.8, 1.6, -0.7, 0, 0]}";
        return Err(wrong(format!("{reason}, or flags such as --q; {{}} uses the start pose")));
    }
    let whole: Json = strict(text).map_err(wrong)?;
    let question = must_be_object("a question", &whole).map_err(wrong)?;
    match question.get("inputs").or_else(|| question.get("question")) {
        Some(inner) => {
            must_be_object("the question", inner).map_err(wrong)?;
            strict(text).map_err(wrong)
        }
        None => Ok(Input { device: None, question: strict(text).map_err(wrong)? }),
    }
}

fn strict<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    serde_json::from_str(text).map_err(|error| error.to_string())
}

/// Returns the members of an object. Serde would accept an array too, in the order of the fields.
fn must_be_object<'j>(
    what: &str,
    json: &'j Json,
) -> Result<&'j serde_json::Map<String, Json>, String> {
    let kind = match json {
        Json::Object(members) => return Ok(members),
        Json::Array(_) => "an array",
        Json::Null | Json::Bool(_) | Json::Number(_) | Json::String(_) => "a single value",
    };
    Err(format!("{what} must be a JSON object, got {kind}"))
}
