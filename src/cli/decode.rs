//! `frhc decode`: candump lines, each with what it says behind it.
//!
//! One line in is one line out, also where it says nothing. Lines come from a log, or live through a pipe:
//! whatever has been read is written before more is waited for. Nothing is allocated for a line.

mod complaints;
mod input;
mod json;
mod pseudo;
mod stamps;
mod text;

use std::io;
use std::io::BufReader;
use std::io::BufWriter;
use std::io::IsTerminal;
use std::io::Read;
use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use crate::cli::decode::complaints::Complaints;
use crate::cli::decode::input::read_line;
use crate::cli::decode::pseudo::Pseudo;
use crate::cli::decode::stamps::Stamps;
use bus::candump::Content;
use bus::candump::Line;
use bus::candump::NotALine;
use bus::screen;
use canopen::frame::Channel;
use canopen_tools::decode::Annotation;
use canopen_tools::decode::Bus;
use canopen_tools::decode::Decoder;
use canopen_tools::decode::error_frame::ErrorFrame;
use canopen_tools::members;
use canopen_tools::signals::Member;
use config::Config;
use run::exit::Failure;
use run::exit::Kind;
use run::exit::OrFail;
use run::interfaces;
use run::interfaces::Interfaces;
use run::print;
use units::time::Instant;

/// `frhc decode`.
#[derive(Debug, Args)]
pub(crate) struct Decode {
    /// The configuration that names nodes and scales values; without it the predefined connection set.
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    #[command(flatten)]
    interfaces: Interfaces,
    /// Only lines about this joint, node or node-id. Repeatable.
    #[arg(long, value_name = "NAME", requires = "config")]
    only: Vec<String>,
    /// Stamps are the time since the line before (candump -t d).
    #[arg(long)]
    delta: bool,
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
    /// A log of candump -l or -L, or what candump shows on a screen; stdin if not given or `-`.
    #[arg(value_name = "LOG")]
    log: Option<PathBuf>,
}

/// Reads the log and prints it.
pub(super) fn run(args: &Decode, quiet: bool) -> Result<(), Failure> {
    let (decoder, names) = decoder(args)?;
    let only = members(args, &decoder)?;
    let (input, name) = input::open(args.log.as_deref())?;
    let mut complaints = Complaints::new(name.clone(), quiet);
    let is_coloured = io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let form =
        if args.json { Form::Json } else { Form::Text(text::Columns::new(&decoder, is_coloured)) };
    let mut scribe = Scribe::new(decoder, names, only, form, args.delta);
    let input = BufReader::with_capacity(input::BUFFER, input);
    let output = print::data().map(|to| BufWriter::with_capacity(input::BUFFER, to));
    let written = output.map_err(Broken::Output).and_then(|output| {
        scribe.transcribe(input, output, |number, error| complaints.line(number, error))
    });
    match written {
        Err(Broken::Input(error)) => {
            return Err(Failure::new(Kind::File, format!("{name}: {error}")));
        }
        Err(Broken::Output(error)) => {
            print::keep(Err(error));
            return Ok(());
        }
        Ok(()) => {}
    }
    complaints.conclude(scribe.counts)
}

/// What broke off before the end of the input.
#[derive(Debug)]
enum Broken {
    /// Reading.
    Input(io::Error),
    /// Writing.
    Output(io::Error),
}

/// What interfaces and buses are called, each with its bus.
type Names = Vec<(String, Channel)>;

fn decoder(args: &Decode) -> Result<(Decoder, Names), Failure> {
    let Some(file) = &args.config else {
        if let Some(interface) = args.interfaces.interfaces.first() {
            let reason =
                format!("-i {interface} names a bus of a configuration: say --config FILE, too");
            return Err(Failure::new(Kind::Usage, reason));
        }
        return Ok((Decoder::generic(), Vec::new()));
    };
    let config = Config::load(file).or_fail(Kind::Configuration)?;
    let interfaces = interfaces::resolve(&config, &args.interfaces.interfaces)?;
    let buses = config.buses.iter().map(|bus| bus.name.clone());
    let channels = config.channels();
    let named = interfaces.into_iter().zip(channels.iter().copied());
    let names = named.chain(buses.zip(channels.iter().copied())).collect();
    Ok((Decoder::new(members::members(&config), members::timing(&config)), names))
}

/// The members that are asked for; `None` for everything.
fn members(args: &Decode, decoder: &Decoder) -> Result<Option<Vec<usize>>, Failure> {
    let find = |name: &String| {
        let number = name.parse::<u8>().ok();
        let is_it = |member: &Member| {
            member.name == *name || member.plan.name == *name || Some(member.node().raw()) == number
        };
        let all = || decoder.members().iter().map(|member| member.name.as_str());
        decoder.members().iter().position(is_it).ok_or_else(|| {
            let all = all().collect::<Vec<_>>().join(", ");
            Failure::new(Kind::Usage, format!("--only {name}: no such node; there is {all}"))
        })
    };
    let found: Vec<usize> = args.only.iter().map(find).collect::<Result<_, _>>()?;
    Ok((!found.is_empty()).then_some(found))
}

/// How lines are written.
enum Form {
    Text(text::Columns),
    Json,
}

/// What came in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    /// Lines, empty ones apart.
    lines: u64,
    /// Of those, how many are none of candump's.
    malformed: u64,
    /// The number of the newest line.
    number: u64,
}

/// What a line says.
enum Said<'d> {
    /// A CANopen frame.
    Frame(Annotation<'d>),
    /// A line of the session recorder's own.
    Pseudo(Pseudo),
    /// What a controller reports.
    Error(ErrorFrame),
    /// A frame that is no CANopen, and why.
    Other(&'static str),
}

/// Writes line after line.
struct Scribe {
    decoder: Decoder,
    names: Names,
    only: Option<Vec<usize>>,
    form: Form,
    is_delta: bool,
    /// Interfaces seen so far.
    buses: Vec<(String, Bus)>,
    stamps: Stamps,
    counts: Counts,
    /// Nanoseconds of the newest line, where stamps are differences.
    clock: u64,
    scratch: String,
}

/// More interfaces than this are taken for one.
const MOST_INTERFACES: usize = 32;

impl Scribe {
    fn new(
        decoder: Decoder,
        names: Names,
        only: Option<Vec<usize>>,
        form: Form,
        is_delta: bool,
    ) -> Self {
        Self {
            decoder,
            names,
            only,
            form,
            is_delta,
            buses: Vec::new(),
            stamps: Stamps::default(),
            counts: Counts::default(),
            clock: 0,
            scratch: String::new(),
        }
    }

    /// Writes a line for each that is read; tells of those that are none.
    fn transcribe<R: Read>(
        &mut self,
        mut input: BufReader<R>,
        mut output: impl Write,
        mut tell: impl FnMut(u64, NotALine),
    ) -> Result<(), Broken> {
        let mut raw = Vec::new();
        while read_line(&mut input, &mut raw).map_err(Broken::Input)? {
            self.counts.number += 1;
            if let Err(error) = self.line(&raw, &mut output).map_err(Broken::Output)? {
                self.counts.malformed += 1;
                tell(self.counts.number, error);
            }
            if input.buffer().is_empty() {
                output.flush().map_err(Broken::Output)?;
            }
        }
        output.flush().map_err(Broken::Output)
    }

    /// One line; the inner result says whether it is one of candump's.
    fn line(&mut self, raw: &[u8], output: &mut impl Write) -> io::Result<Result<(), NotALine>> {
        if raw.is_empty() {
            self.plain(raw, None, output)?;
            return Ok(Ok(()));
        }
        self.counts.lines += 1;
        let read = std::str::from_utf8(raw).map_err(|_| NotALine::Identifier);
        match read.and_then(|text| screen::parse(text).map(|(nanos, line)| (text, nanos, line))) {
            Ok((text, nanos, line)) => self.frame(text, nanos, &line, output).map(Ok),
            Err(error) => self.plain(raw, Some(error), output).map(|()| Err(error)),
        }
    }

    /// A line that says nothing, as it is.
    fn plain(
        &self,
        raw: &[u8],
        error: Option<NotALine>,
        output: &mut impl Write,
    ) -> io::Result<()> {
        match (&self.form, &self.only) {
            (_, Some(_)) => Ok(()),
            (Form::Text(_), None) => {
                output.write_all(raw)?;
                output.write_all(b"\n")
            }
            (Form::Json, None) => json::plain(self.counts.number, raw, error, output),
        }
    }

    /// A frame, with what it says.
    fn frame(
        &mut self,
        text: &str,
        nanos: Option<u64>,
        line: &Line<'_>,
        output: &mut impl Write,
    ) -> io::Result<()> {
        let nanos = self.clock(nanos);
        let back = nanos.and_then(|nanos| self.stamps.on_stamp(line.interface, nanos));
        let at = nanos.map(|nanos| Instant::from_micros(nanos / 1_000));
        let bus = line.canopen().map(|(cob_id, _)| (cob_id, self.bus(line.interface)));
        let said = match (&line.content, bus) {
            (Content::Data(data), Some((cob_id, bus))) => {
                Said::Frame(self.decoder.on_frame(bus, at, cob_id, data))
            }
            (Content::Data(_), None) => Said::Other("29 bits"),
            (Content::Fd(_, data), _) => match Pseudo::read(line, data) {
                Some(pseudo) => Said::Pseudo(pseudo),
                None => Said::Other("CAN FD"),
            },
            (Content::Remote(_), _) => Said::Other("remote frame"),
            (Content::Error(data), _) => Said::Error(error_frame(line.id, data)),
        };
        if let Some(only) = &self.only {
            let Said::Frame(annotation) = &said else { return Ok(()) };
            if !only.iter().any(|member| annotation.is_about(*member)) {
                return Ok(());
            }
        }
        match &mut self.form {
            Form::Text(columns) => {
                text::line(text, &said, back, columns, &mut self.scratch);
                output.write_all(self.scratch.as_bytes())
            }
            Form::Json => {
                json::frame(self.counts.number, nanos, line, &said, back, &mut self.scratch, output)
            }
        }
    }

    /// Nanoseconds since the beginning of all stamps.
    fn clock(&mut self, nanos: Option<u64>) -> Option<u64> {
        if !self.is_delta {
            return nanos;
        }
        self.clock = self.clock.saturating_add(nanos?);
        Some(self.clock)
    }

    /// The bus of an interface.
    fn bus(&mut self, interface: &str) -> Bus {
        if let Some((_, bus)) = self.buses.iter().find(|(name, _)| name == interface) {
            return *bus;
        }
        match self.buses.last() {
            Some((_, bus)) if self.buses.len() >= MOST_INTERFACES => *bus,
            Some(_) | None => {
                let named = self.names.iter().find(|(name, _)| name == interface);
                let bus = self.decoder.listen(named.map(|(_, channel)| *channel));
                self.buses.push((interface.to_owned(), bus));
                bus
            }
        }
    }
}

fn error_frame(id: u32, bytes: &[u8]) -> ErrorFrame {
    let mut data = [0; 8];
    for (to, from) in data.iter_mut().zip(bytes) {
        *to = *from;
    }
    ErrorFrame { classes: id & 0x1FFF_FFFF, data }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// What becomes of `input`, and how many lines of it are malformed.
    fn transcribed(input: &[u8], is_json: bool) -> (Vec<u8>, u64) {
        let decoder = Decoder::generic();
        let form =
            if is_json { Form::Json } else { Form::Text(text::Columns::new(&decoder, false)) };
        let mut scribe = Scribe::new(decoder, Vec::new(), None, form, false);
        let mut output = Vec::new();
        let mut told = 0;
        scribe.transcribe(BufReader::new(input), &mut output, |_, _| told += 1).unwrap();
        assert_eq!(scribe.counts.malformed, told);
        (output, told)
    }

    fn lines(text: &[u8]) -> usize {
        let ends = text.iter().filter(|byte| **byte == b'\n').count();
        ends + usize::from(text.last().is_some_and(|last| *last != b'\n'))
    }

    #[test]
    fn a_line_that_is_none_goes_through_and_the_next_one_is_read() {
        let (output, malformed) = transcribed(b"what?\n\n(1.000000) can0 703#05\n\xFF\xFE", false);
        let expected =
            "what?\n\n(1.000000) can0 703#05                heartbeat node 3   operational\n";
        assert_eq!(malformed, 2);
        assert_eq!(output, [expected.as_bytes(), b"\xFF\xFE\n"].concat());
    }

    #[test]
    fn an_overlong_line_is_one_line() {
        let mut input = vec![b'x'; 3 * input::BUFFER];
        input.extend(b"\n(1.000000) can0 703#05\n");
        let (output, malformed) = transcribed(&input, false);
        assert_eq!((lines(&output), malformed), (2, 1));
    }

    #[test]
    fn an_error_frame_is_no_sync() {
        let (output, _) = transcribed(b"(1.000000) can0 20000080#0000000000000000", false);
        let output = String::from_utf8(output).unwrap();
        assert!(output.contains("error frame") && !output.contains("SYNC"), "{output}");
    }

    proptest! {
        #[test]
        fn every_line_in_is_one_line_out(
            input in proptest::collection::vec(
                prop_oneof![
                    Just("\n".to_owned()),
                    ".{0,40}",
                    r"\([0-9]{1,3}\.[0-9]{6}\) can[0-9]{1,3} [0-9A-F]{3}#([0-9A-F]{2}){0,9}\r?\n",
                    r"\([0-9]{1,3}\.[0-9]{6}\) can0 [67]0[0-9]#([0-9A-F]{2}){8}\n",
                    r" (wrench|node|can)0 +18FF000[01] +\[[0-9]{2}\]( [0-9A-F]{2}){0,64}\n",
                    r"\(1.000000\) (wrench|node)0 18FF000[01]##0([0-9A-F]{2}){0,64}\n",
                ],
                0..40,
            ),
        ) {
            let input = input.concat();
            for is_json in [false, true] {
                let (output, _) = transcribed(input.as_bytes(), is_json);
                prop_assert_eq!(lines(&output), lines(input.as_bytes()));
                if is_json {
                    for line in String::from_utf8(output).unwrap().lines() {
                        let object: serde_json::Value = serde_json::from_str(line).unwrap();
                        prop_assert!(object.is_object());
                    }
                }
            }
        }

        #[test]
        fn any_bytes_are_as_many_lines(input in proptest::collection::vec(any::<u8>(), 0..400)) {
            let (output, _) = transcribed(&input, false);
            prop_assert_eq!(lines(&output), lines(&input));
        }
    }
}
