//! Decoding of the input line by line.

use std::io::{self, BufReader, Read, Write};

use crate::decode::input::read_line;
use crate::decode::meaning::Meaning;
use crate::decode::timestamps::Timestamps;
use crate::decode::{json, text};
use ::replay::recorder_line::RecorderLine;
use canopen::frame::Channel;
use canopen_tools::candump::{Content, Line, NotALine};
use canopen_tools::decode::error_frame::ErrorFrame;
use canopen_tools::decode::{Bus, Decoder};
use canopen_tools::screen;
use units::time::Instant;

/// Error that ended decoding before the end of the input.
#[derive(Debug)]
pub(super) enum Broken {
    /// Reading failed.
    Input(io::Error),
    /// Writing failed.
    Output(io::Error),
}

/// Names of interfaces and buses, each with its channel.
pub(super) type Names = Vec<(String, Channel)>;

/// Output format.
pub(super) enum Form {
    Text(text::Columns),
    Json,
}

/// Counts of input lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    /// Lines that are not empty.
    pub(super) lines: u64,
    /// Lines that are not candump lines.
    pub(super) malformed: u64,
    /// Number of the newest line.
    number: u64,
}

/// Decodes line by line.
pub(super) struct Transcriber {
    decoder: Decoder,
    names: Names,
    only: Option<Vec<usize>>,
    form: Form,
    is_delta: bool,
    /// Interfaces found so far.
    buses: Vec<(String, Bus)>,
    stamps: Timestamps,
    pub(super) counts: Counts,
    /// Time of the newest line in ns, if timestamps are relative.
    clock: u64,
    scratch: String,
}

/// Maximum number of interfaces; further ones share the last bus.
const MAX_INTERFACES: usize = 32;

impl Transcriber {
    pub(super) fn new(
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
            stamps: Timestamps::default(),
            counts: Counts::default(),
            clock: 0,
            scratch: String::new(),
        }
    }

    /// Writes one line for each input line; calls `on_malformed` for those that are not candump lines.
    pub(super) fn run<R: Read>(
        &mut self,
        mut input: BufReader<R>,
        mut output: impl Write,
        mut on_malformed: impl FnMut(u64, NotALine),
    ) -> Result<(), Broken> {
        let mut raw = Vec::new();
        while read_line(&mut input, &mut raw).map_err(Broken::Input)? {
            self.counts.number += 1;
            if let Err(error) = self.line(&raw, &mut output).map_err(Broken::Output)? {
                self.counts.malformed += 1;
                on_malformed(self.counts.number, error);
            }
            if input.buffer().is_empty() {
                output.flush().map_err(Broken::Output)?;
            }
        }
        output.flush().map_err(Broken::Output)
    }

    /// Writes one line; the inner result is an error if it is not a candump line.
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

    /// Writes a line that cannot be decoded unchanged.
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

    /// Writes a frame with its meaning.
    fn frame(
        &mut self,
        text: &str,
        nanos: Option<u64>,
        line: &Line<'_>,
        output: &mut impl Write,
    ) -> io::Result<()> {
        let nanos = self.clock(nanos);
        let back = nanos.and_then(|nanos| self.stamps.on_timestamp(line.interface, nanos));
        let at = nanos.map(|nanos| Instant::from_micros(nanos / 1_000));
        let bus = line.canopen().map(|(cob_id, _)| (cob_id, self.bus(line.interface)));
        let meaning = match (&line.content, bus) {
            (Content::Data(data), Some((cob_id, bus))) => {
                Meaning::Frame(self.decoder.on_frame(bus, at, cob_id, data))
            }
            (Content::Data(_), None) => Meaning::Other("29 bits"),
            (Content::Fd(_, data), _) => match RecorderLine::read(line, data) {
                Some(pseudo) => Meaning::RecorderLine(pseudo),
                None => Meaning::Other("CAN FD"),
            },
            (Content::Remote(_), _) => Meaning::Other("remote frame"),
            (Content::Error(data), _) => Meaning::Error(error_frame(line.id, data)),
        };
        if let Some(only) = &self.only {
            let Meaning::Frame(annotation) = &meaning else { return Ok(()) };
            if !only.iter().any(|member| annotation.is_about(*member)) {
                return Ok(());
            }
        }
        match &mut self.form {
            Form::Text(columns) => {
                text::line(text, &meaning, back, columns, &mut self.scratch);
                output.write_all(self.scratch.as_bytes())
            }
            Form::Json => json::frame(
                self.counts.number,
                nanos,
                line,
                &meaning,
                back,
                &mut self.scratch,
                output,
            ),
        }
    }

    /// Returns the absolute time in ns; accumulates relative timestamps.
    fn clock(&mut self, nanos: Option<u64>) -> Option<u64> {
        if !self.is_delta {
            return nanos;
        }
        self.clock = self.clock.saturating_add(nanos?);
        Some(self.clock)
    }

    /// Returns the decoder's bus of an interface; a new one is added, at most [`MAX_INTERFACES`].
    fn bus(&mut self, interface: &str) -> Bus {
        if let Some((_, bus)) = self.buses.iter().find(|(name, _)| name == interface) {
            return *bus;
        }
        match self.buses.last() {
            Some((_, bus)) if self.buses.len() >= MAX_INTERFACES => *bus,
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
    use crate::decode::input;

    /// Returns the output for `input`, and its number of malformed lines.
    fn transcribed(input: &[u8], is_json: bool) -> (Vec<u8>, u64) {
        let decoder = Decoder::generic();
        let form =
            if is_json { Form::Json } else { Form::Text(text::Columns::new(&decoder, false)) };
        let mut transcriber = Transcriber::new(decoder, Vec::new(), None, form, false);
        let mut output = Vec::new();
        let mut reported = 0;
        transcriber.run(BufReader::new(input), &mut output, |_, _| reported += 1).unwrap();
        assert_eq!(transcriber.counts.malformed, reported);
        (output, reported)
    }

    fn lines(text: &[u8]) -> usize {
        let ends = text.iter().filter(|byte| **byte == b'\n').count();
        ends + usize::from(text.last().is_some_and(|last| *last != b'\n'))
    }

    #[test]
    fn malformed_line_passes_unchanged_and_the_next_is_decoded() {
        let (output, malformed) = transcribed(b"what?\n\n(1.000000) can0 703#05\n\xFF\xFE", false);
        let expected =
            "what?\n\n(1.000000) can0 703#05                heartbeat node 3   operational\n";
        assert_eq!(malformed, 2);
        assert_eq!(output, [expected.as_bytes(), b"\xFF\xFE\n"].concat());
    }

    #[test]
    fn overlong_line_stays_one_line() {
        let mut input = vec![b'x'; 3 * input::BUFFER];
        input.extend(b"\n(1.000000) can0 703#05\n");
        let (output, malformed) = transcribed(&input, false);
        assert_eq!((lines(&output), malformed), (2, 1));
    }

    #[test]
    fn error_frame_is_not_decoded_as_sync() {
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
        fn any_bytes_keep_their_number_of_lines(input in proptest::collection::vec(any::<u8>(), 0..400)) {
            let (output, _) = transcribed(&input, false);
            prop_assert_eq!(lines(&output), lines(&input));
        }
    }
}
