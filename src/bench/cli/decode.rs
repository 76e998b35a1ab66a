//! `frhc decode`: annotates candump lines with their meaning.
//!
//! Every input line is one output line, even if it cannot be decoded. Input may be a live pipe: output is flushed
//! before each wait for input. Decoding a line allocates no memory.

mod input;
mod json;
mod malformed_lines;
mod meaning;
mod text;
mod timestamps;
mod transcriber;

use std::io::{self, BufReader, BufWriter, IsTerminal};
use std::path::{Path, PathBuf};

use clap::Args;

use crate::decode::malformed_lines::MalformedLines;
use crate::decode::transcriber::{Broken, Form, Names, Transcriber};
use crate::session_config;
use ::replay::Session;
use canopen_tools::decode::Decoder;
use canopen_tools::members;
use canopen_tools::signals::{Member, identifier};
use config::Config;
use run::exit::{Failure, Kind, OrFail};
use run::interfaces::{self, Interfaces};
use run::print;

/// `frhc decode`.
#[derive(Debug, Args)]
pub struct Decode {
    /// Configuration with node names and scaling; without it that of the session, or the predefined connection set.
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    #[command(flatten)]
    interfaces: Interfaces,
    /// Show only lines of this joint, node or node-id. Repeatable.
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// Timestamps are relative to the previous line (candump -t d).
    #[arg(long)]
    delta: bool,
    /// Print one JSON object per line.
    #[arg(long)]
    json: bool,
    /// Log of candump -l or -L, or its screen output, plain or packed with gzip; or the folder of a session: all
    /// parts are read [default: stdin, also for `-`].
    #[arg(value_name = "LOG")]
    log: Option<PathBuf>,
}

/// Decodes the log and prints it.
pub(super) fn run(args: &Decode, quiet: bool) -> Result<(), Failure> {
    let is_session = |log: &&Path| log.join("session.json").symlink_metadata().is_ok();
    let session = args.log.as_deref().filter(is_session);
    let session = session.map(Session::open).transpose().or_fail(Kind::File)?;
    let (decoder, names) = decoder(args, session.as_ref())?;
    let only = members(args, &decoder)?;
    let (input, name) = match &session {
        Some(session) => input::of_session(session)?,
        None => input::open(args.log.as_deref())?,
    };
    let mut malformed = MalformedLines::new(name.clone(), quiet);
    let is_coloured = io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let form =
        if args.json { Form::Json } else { Form::Text(text::Columns::new(&decoder, is_coloured)) };
    let mut transcriber = Transcriber::new(decoder, names, only, form, args.delta);
    let input = BufReader::with_capacity(input::BUFFER, input);
    let output = print::data().map(|to| BufWriter::with_capacity(input::BUFFER, to));
    let written = output.map_err(Broken::Output).and_then(|output| {
        transcriber.run(input, output, |number, error| malformed.line(number, error))
    });
    match written {
        Err(Broken::Input(error)) => {
            // Errors of a session name its file.
            let is_named = session.is_some();
            let reason = if is_named { error.to_string() } else { format!("{name}: {error}") };
            return Err(Failure::new(Kind::File, reason));
        }
        Err(Broken::Output(error)) => {
            print::record_result(Err(error));
            return Ok(());
        }
        Ok(()) => {}
    }
    malformed.conclude(transcriber.counts)
}

/// Returns the decoder of `--config`, of a session, or of neither.
fn decoder(args: &Decode, session: Option<&Session>) -> Result<(Decoder, Names), Failure> {
    let config = match (&args.config, session) {
        (Some(file), _) => Config::load(file).or_fail(Kind::Configuration)?,
        (None, Some(session)) => session_config::configuration(session)?,
        (None, None) => {
            let needs_config = args.interfaces.interfaces.first().map(|name| format!("-i {name}"));
            let needs_config = needs_config.or(args.only.first().map(|it| format!("--only {it}")));
            if let Some(option) = needs_config {
                let reason = format!("{option} is of a configuration: add --config FILE");
                return Err(Failure::new(Kind::Usage, reason));
            }
            return Ok((Decoder::generic(), Vec::new()));
        }
    };
    let interfaces = match session {
        Some(session) if args.interfaces.interfaces.is_empty() => {
            session.manifest().interfaces.clone()
        }
        Some(_) | None => interfaces::resolve(&config, &args.interfaces.interfaces)?,
    };
    let buses = config.buses.iter().map(|bus| bus.name.clone());
    let channels = config.channels();
    let named = interfaces.into_iter().zip(channels.iter().copied());
    let names = named.chain(buses.zip(channels.iter().copied())).collect();
    Ok((Decoder::new(members::members(&config), members::timing(&config)), names))
}

/// Returns the members selected by `--only`; `None` for all.
fn members(args: &Decode, decoder: &Decoder) -> Result<Option<Vec<usize>>, Failure> {
    let find = |name: &String| {
        let number = name.parse::<u8>().ok();
        let is_it = |member: &Member| {
            member.name == identifier(name)
                || member.plan.name == *name
                || Some(member.node().raw()) == number
        };
        let all = || decoder.members().iter().map(|member| member.name.as_str());
        decoder.members().iter().position(is_it).ok_or_else(|| {
            let all = all().collect::<Vec<_>>().join(", ");
            Failure::new(Kind::Usage, format!("--only {name}: unknown node; expected {all}"))
        })
    };
    let found: Vec<usize> = args.only.iter().map(find).collect::<Result<_, _>>()?;
    Ok((!found.is_empty()).then_some(found))
}
