//! `frhc ctl`: asks a running node one question and prints its answer.

use std::io::BufRead;
use std::io::BufReader;
use std::io::Write;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;

use crate::cli::args::CommandMode;
use crate::cli::args::Ctl;
use crate::cli::args::CtlRequest;
use crate::cli::console::Ask;
use crate::cli::console::Question;
use crate::cli::console::default_socket;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::print;
use crate::config::Config;

/// A node that takes longer than this is not running.
const PATIENCE: Duration = Duration::from_secs(5);

/// Asks, and prints the answer.
pub(super) fn run(args: &Ctl) -> Result<(), Failure> {
    let socket = socket(args)?;
    let line = ask(&socket, question(args.request)).or_fail(Kind::Bus)?;
    let answer: serde_json::Value = serde_json::from_str(&line).or_fail(Kind::Bus)?;
    if args.json {
        print::line(line.trim_end());
    }
    let text = |key| answer.get(key).and_then(serde_json::Value::as_str);
    if answer.get("ok").and_then(serde_json::Value::as_bool) != Some(true) {
        let reason = text("error").unwrap_or("the node's answer is not understood");
        return Err(Failure::new(Kind::Negative, reason));
    }
    if !args.json {
        match answer.get("status") {
            Some(status) => print::line(&table(status)),
            None => print::line(text("mode").unwrap_or_default()),
        }
    }
    Ok(())
}

fn question(request: CtlRequest) -> Ask {
    match request {
        CtlRequest::Status => Ask::Status,
        CtlRequest::Arm => Ask::Arm,
        CtlRequest::Disarm => Ask::Disarm,
        CtlRequest::Reset => Ask::Reset,
        CtlRequest::Mode { mode: CommandMode::Rate } => Ask::Rate,
        CtlRequest::Mode { mode: CommandMode::Pose } => Ask::Pose,
    }
}

fn socket(args: &Ctl) -> Result<PathBuf, Failure> {
    if let Some(socket) = &args.socket {
        return Ok(socket.clone());
    }
    let configured = match &args.config {
        Some(file) => Config::load(file).or_fail(Kind::Configuration)?.socket,
        None => None,
    };
    Ok(configured.unwrap_or_else(default_socket))
}

fn ask(socket: &PathBuf, ask: Ask) -> anyhow::Result<String> {
    let mut stream =
        UnixStream::connect(socket).with_context(|| format!("no node at {}", socket.display()))?;
    stream.set_read_timeout(Some(PATIENCE))?;
    let mut question = serde_json::to_string(&Question { ask })?;
    question.push('\n');
    stream.write_all(question.as_bytes())?;
    let mut line = String::new();
    BufReader::new(stream).read_line(&mut line).context("the node does not answer")?;
    Ok(line)
}

/// A status as rows of name and value.
fn table(status: &serde_json::Value) -> String {
    let rows = status.as_object().into_iter().flatten();
    let rows = rows.filter(|(_, value)| !value.is_null());
    rows.map(|(name, value)| format!("{name:16} {}", plain(value))).collect::<Vec<_>>().join("\n")
}

fn plain(value: &serde_json::Value) -> String {
    if let Some(text) = value.as_str() {
        return text.to_owned();
    }
    if let Some(number) = value.as_f64().filter(|_| value.is_f64()) {
        return format!("{number:.3}");
    }
    match value.as_array() {
        Some(list) => list.iter().map(|item| format!("{:>8} ", plain(item))).collect(),
        None => value.to_string(),
    }
}
